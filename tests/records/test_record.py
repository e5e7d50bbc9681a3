"""What a record knows of its time: how long it took, its pauses, and that folding leaves the former one as it was."""

import pytest

from app.records import fold
from app.records.fold import Machine
from app.records.kind import End, Parts, Pause, Verb, When
from app.records.record import Record
from tests.records.test_fold import SECOND, A, B, C, D, E, event, kind, rule, told


def test_folding_leaves_the_former_record_as_it_was() -> None:
    former = Record("thing", 7, 1, 1, 0, fields={"it": 1}, id=1)
    after = fold.fold(rule(Verb.COUNT), former, event(B), Machine())
    assert (former.fields, after.fields) == ({"it": 1}, {"it": 2})
    assert after is not former


@pytest.mark.parametrize(("seconds", "wanted"), [("elapsed", 3.0), ("value", 2.5), ("unknown", None)])
def test_how_long_it_took(seconds: str, wanted: float | None) -> None:
    (one,) = told(kind(ends=(End("gone", When(frozenset({C})), seconds=seconds),)), event(A, 1), event(C, 4, 2.5))
    assert one.seconds == wanted


def test_a_pause_is_no_time_of_a_part() -> None:
    made = kind(
        parts=Parts(frozenset({B}), frozenset({E})),
        pause=Pause(frozenset({D}), frozenset({D + 10, C})),
    )
    (one,) = told(
        made,
        event(A),
        event(B, 1, source=1),
        event(D, 2),
        event(D + 10, 4),
        event(E, 5, 1.5, source=1),
        event(B, 5, source=2),
        event(D, 6),
        event(C, 9),
    )
    assert (one.paused, one.pause) == (5 * SECOND, None)
    assert [(part.number, part.state, part.seconds, part.paused) for part in one.parts.values()] == [
        (1, "done", 1.5, 2 * SECOND),
        (2, "gone", 1.0, 3 * SECOND),
    ]
