"""What a source publishes: columns of the same length, one quality for all unless each has its own."""

from dataclasses import FrozenInstanceError

import pytest

from app.clock import ManualClock
from app.tags.batch import Batch
from app.tags.database import Tag, TagDatabase
from app.tags.quality import COMM_FAILURE, GOOD


@pytest.fixture
def tags() -> TagDatabase:
    made = TagDatabase(ManualClock())
    made.configure([Tag("a", "a", "hall"), Tag("b", "b", "hall")])
    return made


@pytest.mark.parametrize(
    ("more", "qualities"),
    [
        ({}, (GOOD, GOOD)),
        ({"quality": COMM_FAILURE}, (COMM_FAILURE, COMM_FAILURE)),
        ({"quality": COMM_FAILURE, "qualities": [GOOD, COMM_FAILURE]}, (GOOD, COMM_FAILURE)),
    ],
)
def test_a_quality_is_of_all_values_unless_each_has_its_own(
    tags: TagDatabase, more: dict[str, object], qualities: tuple[int, int]
) -> None:
    tags.publish(Batch("hall", 0, 5, 5, [0, 1], [1.0, 2.0], **more))  # type: ignore[arg-type]
    assert (tags.quality(0), tags.quality(1)) == qualities


def test_a_batch_is_as_it_was_published() -> None:
    batch = Batch("hall", 0, 5, 5, [], [])
    with pytest.raises(FrozenInstanceError):
        batch.time = 6  # type: ignore[misc]
