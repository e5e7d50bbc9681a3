"""Quality is one integer: level, reason, origin, and the worst of many."""

from itertools import product

import pytest

from app.tags import quality
from app.tags.quality import BAD, GOOD, UNCERTAIN, Origin, QualityReason

NAMED = {name: getattr(quality, name) for name in QualityReason.__members__ if name != "NONE"}


@pytest.mark.parametrize(("name", "word"), NAMED.items())
@pytest.mark.parametrize("flags", [0, Origin.SIMULATED, Origin.FORCED | Origin.LOCAL])
def test_each_named_quality_has_its_reason_whatever_its_origin(name: str, word: int, flags: int) -> None:
    assert quality.reason(word | flags) is QualityReason[name]
    assert quality.level(word | flags) in (UNCERTAIN, BAD) and quality.origin(word | flags) == flags
    assert quality.name(word | flags) == f"{('good', 'uncertain', 'bad')[word & 3]}:{name.lower()}"


def test_only_what_may_still_be_shown_is_unseen() -> None:
    unseen = {name for name, word in NAMED.items() if quality.is_unseen(word)}
    assert unseen == {"STALE", "HALTED"}
    assert not any(quality.is_bad(NAMED[name]) for name in unseen)


@pytest.mark.parametrize("flags", [0, Origin.SIMULATED, Origin.SUBSTITUTED])
def test_origin_does_not_lower_the_level(flags: int) -> None:
    assert quality.is_good(GOOD | flags) and not quality.is_bad(GOOD | flags)
    assert quality.name(GOOD | flags) == "good"


def test_the_worst_of_many_has_the_worst_level_its_first_reason_and_all_origins() -> None:
    words = [
        GOOD | Origin.SIMULATED,
        quality.STALE,
        quality.OUT_OF_RANGE | Origin.FORCED,
        quality.NO_DATA,
        quality.DEVICE,
    ]
    assert quality.worst([]) == GOOD
    assert quality.worst(words) == quality.NO_DATA | Origin.SIMULATED | Origin.FORCED
    assert quality.worst(words[:3]) == quality.STALE | Origin.SIMULATED | Origin.FORCED
    for one, other in product(words, repeat=2):
        both = quality.worst([one, other])
        assert quality.level(both) == max(quality.level(one), quality.level(other))
        assert quality.origin(both) == quality.origin(one) | quality.origin(other)
