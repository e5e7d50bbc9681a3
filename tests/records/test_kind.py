"""Kinds of records as the types declare them."""

from app.records.kind import Column
from tests.records.test_fold import CONVEYOR, SEQUENCE


def test_the_kinds_of_our_types_are_read() -> None:
    assert list(CONVEYOR.records) == ["passage"]
    assert list(SEQUENCE.records) == ["force", "run"], "forces first: a run counts those that stand"
    assert CONVEYOR.records["passage"].outcomes == (
        "open",
        "unloaded",
        "diverted",
        "deleted",
        "lost",
        "returned",
        "unknown",
    )
    assert SEQUENCE.records["run"].outcomes == ("open", "done", "timed_out", "aborted", "unknown")
    assert SEQUENCE.records["run"].csv[0] == Column("started_utc", "begun.utc")
    assert SEQUENCE.records["run"].hooks.fold is not None
    assert CONVEYOR.records["passage"].hooks.fold is None
