"""Records are found by filters and pages, and by an index."""

import random
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from sqlalchemy import Connection
from sqlalchemy.event import listen

from app.db import Database
from app.historian import record_query
from app.historian.record_query import ANY, RecordFilter
from app.records.record import Record
from tests.historian import stories
from tests.historian.kinds import FORCE, PASSAGE, RUN, ask, tell
from tests.historian.rings import BEGIN, SECOND


def fill(history: Database) -> None:
    for seed, equipment in enumerate(("c1", "c2", "seq1", "seq2")):
        begin = BEGIN + seed * 17
        portions = stories.runs(seed, 60, begin) if equipment.startswith("seq") else stories.products(seed, 200, begin)
        tell(history, equipment, portions)


def fits(kind: Any, one: Record, name: str, asked: float | str) -> bool:
    of, how = kind.filters[name].of, kind.filters[name].how
    value = {"number": one.number, "seconds": one.seconds, "alarms": one.alarms}.get(of, one.fields.get(of))
    match how:
        case "above":
            return value is not None and value > asked
        case "alarm":
            return bool(value) if asked == ANY else asked in map(str, value)
        case "any":
            return bool(value)
    return value not in (None, "") if asked == ANY else value == asked


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", [PASSAGE, RUN, FORCE], ids=lambda kind: kind.name)
def test_filters_and_pages_are_those_of_brute_force(history: Database, kind: Any) -> None:
    fill(history)
    source = random.Random(11)
    rows = sorted(ask(history, kind, 10**6), key=lambda one: (-one.begun, -one.id))
    assert ask(history, kind, 10**6) == rows
    assert len(rows) > 15
    keys = sorted({str(one.fields.get(kind.key)) for one in rows if one.fields.get(kind.key)})
    choices = {
        "product": (1, 2, 40_003, 70_002), "correction": (0.5, 2.0, 5.0), "alarm": (ANY, "10", "1"), "longer": (1.0, 2.5),
        "first_out": (ANY, "no.such", *keys), "forced": (ANY,),
    }  # fmt: skip
    for _ in range(150):
        given = {name: source.choice(choices[name]) for name in kind.filters if source.random() < 0.3}
        wanted = RecordFilter(
            equipment=source.choice(["", "c1", "seq2", "c9"]),
            begin=source.choice([None, BEGIN + source.randrange(0, 400) * SECOND]),
            end=source.choice([None, BEGIN + source.randrange(0, 400) * SECOND]),
            outcome=source.choice(["", "", *kind.outcomes]),
            given=given,
        )
        fitting = [
            one
            for one in rows
            if wanted.equipment in ("", one.equipment)
            and (wanted.begin is None or one.begun >= wanted.begin)
            and (wanted.end is None or one.begun < wanted.end)
            and wanted.outcome in ("", one.outcome)
            and all(fits(kind, one, name, asked) for name, asked in given.items())
        ]
        paged: list[Record] = []
        page = wanted
        while found := history.run(lambda c, page=page: record_query.find(c, kind, page, 23)):  # type: ignore[misc]
            paged += found
            page = replace(page, before=(found[-1].begun, found[-1].id))
        assert paged == fitting, wanted
        assert history.run(lambda c, wanted=wanted: record_query.count(c, kind, wanted, 10_000)) == len(fitting)  # type: ignore[misc]
        check_times(history, kind, wanted, fitting)


def check_times(history: Database, kind: Any, wanted: RecordFilter, fitting: Sequence[Record]) -> None:
    parts = history.run(lambda c: record_query.parts(c, [one.id for one in fitting]))
    taken: dict[str, list[float]] = {}
    for one in fitting:  # the newest first
        for part in parts[one.id].values():
            if part.state == "done" and part.seconds is not None:
                taken.setdefault(part.key, []).append(part.seconds)
    found = history.run(lambda c: record_query.part_times(c, kind, wanted))
    assert sorted(one.key for one in found) == sorted(taken)
    for row in found:
        values = taken[row.key]
        assert (row.spread.count, row.spread.least, row.spread.most) == (len(values), min(values), max(values))
        assert row.spread.mean == pytest.approx(sum(values) / len(values))
        assert row.spread.last == values[0]
    outcomes, spread = history.run(lambda c: record_query.times(c, kind, wanted, "done"))
    assert outcomes == {o: n for o in kind.outcomes if (n := sum(one.outcome == o for one in fitting))}
    done = [one.seconds for one in fitting if one.outcome == "done" and one.seconds is not None]
    assert (spread.least, spread.most, spread.last) == ((min(done), max(done), done[0]) if done else (None, None, None))


@pytest.mark.sweep(8)
def test_one_can_choose_from_what_ever_stopped_a_run(history: Database) -> None:
    fill(history)
    for equipment in ("seq1", "seq2"):
        rows = [one for one in ask(history, RUN, equipment=equipment) if one.fields.get("first_out")]
        found = history.run(lambda c, equipment=equipment: record_query.choices(c, RUN, equipment))  # type: ignore[misc]
        assert sorted(str(one.fields["first_out"]) for one in found) == sorted(
            {str(one.fields["first_out"]) for one in rows}
        )
        assert len(found) > 1


@pytest.mark.parametrize(
    ("kind", "wanted", "index"),
    [
        (PASSAGE, {}, "ix_record_begun"),
        (PASSAGE, {"equipment": "c1"}, "ix_record_machine"),
        (PASSAGE, {"begin": 5, "end": 9}, "ix_record_begun"),
        (RUN, {"equipment": "s", "begin": 5}, "ix_record_machine"),
        (RUN, {"before": (5, 1)}, "ix_record_begun"),
        (RUN, {"outcome": "aborted"}, "ix_record_outcome"),
        (PASSAGE, {"outcome": "lost", "begin": 5}, "ix_record_outcome"),
    ],
)
def test_a_page_is_read_by_an_index_and_sorts_nothing(
    history: Database, kind: Any, wanted: dict[str, Any], index: str
) -> None:
    found = plan(history, kind, wanted)
    assert index in found
    assert "TEMP B-TREE" not in found


@pytest.mark.parametrize(
    ("kind", "wanted", "index"),
    [
        (PASSAGE, {"given": {"product": 7}}, "ix_record_number"),
        (PASSAGE, {"given": {"product": 7}, "equipment": "c1"}, "ix_record_number"),
        (RUN, {"given": {"first_out": "s3.pressure_ok"}}, "ix_record_key"),
        (RUN, {"given": {"first_out": "s3.pressure_ok"}, "equipment": "s"}, "ix_record_key"),
    ],
)
def test_what_few_have_is_found_by_an_index(history: Database, kind: Any, wanted: dict[str, Any], index: str) -> None:
    """Not by reading all until enough of them were met: after a year that is everything."""
    assert index in plan(history, kind, wanted)


def plan(history: Database, kind: Any, wanted: dict[str, Any]) -> str:
    """How SQLite goes about a page."""
    asked: list[tuple[str, Any]] = []

    def work(connection: Connection) -> str:
        listen(connection, "before_cursor_execute", lambda *given: asked.append((given[2], given[3])))
        record_query.find(connection, kind, RecordFilter(**wanted), 50)
        statement, given = asked[0]
        return " ".join(str(row[3]) for row in connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}", given))

    return history.run(work)
