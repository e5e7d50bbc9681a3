"""Rows that cannot be those of a table."""

import pytest

from app.links.conformance import lists
from app.links.conformance.finding import Broken, Skipped
from app.links.conformance.server import Server
from app.links.conformance.subject import Rows, Subject
from tests.links.conformance.servers import data_of
from tests.links.conformance.test_header import nobody


def row(id: int, generation: int = 2, last: int = 2, state: int = 1) -> list[int]:
    return [0, id, generation, state, *[0] * 19, last]


@pytest.mark.parametrize(
    ("rows", "seen"),
    [
        ([row(1), row(1)], "0x081C = 1"),
        ([row(1, 3, 3)], "0x0806 = 3, 0x081B = 3"),
        ([row(1), row(2, 2, 4)], "0x081E = 2, 0x0833 = 4"),
        ([row(1, state=8)], "0x0807 = 8"),
    ],
)
async def test_a_row_that_cannot_be_is_named(rows: list[list[int]], seen: str) -> None:
    subject = Subject(Server(nobody), data_of("conveyor"))
    subject.tables["product"] = Rows([2, 20, len(rows), 24], rows)
    with pytest.raises(Broken) as broken:
        await lists.rows(subject)
    assert broken.value.seen == seen


async def test_empty_rows_may_hold_anything_and_no_rows_are_nothing_to_judge() -> None:
    subject = Subject(Server(nobody), data_of("conveyor"))
    subject.tables["product"] = Rows([2, 20, 2, 24], [row(0, state=8), row(5)])
    await lists.rows(subject)
    subject.tables["product"] = Rows([2, 20, 0, 24])
    with pytest.raises(Skipped):
        await lists.rows(subject)
