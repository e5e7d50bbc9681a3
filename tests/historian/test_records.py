"""Records in the history: the same as in memory, the same as before there were records, whatever breaks in between."""

import hashlib
import random
from dataclasses import replace
from typing import Any

import pytest
from sqlalchemy import Connection
from sqlalchemy.event import listen

from app.db import Database
from app.historian import record_query, records, store
from app.historian.record_query import RecordFilter
from app.historian.records import RecordFold
from app.plant.events import begins_again, position_of
from app.plant.kept import kept
from app.records import fold
from tests.historian import books, rings, stories
from tests.historian.kinds import PASSAGE, RUN, ask, item, tell
from tests.historian.rings import BEGIN, SECOND, Ring
from tests.historian.sequence_rings import Device, definition
from tests.historian.stories import Portion
from tests.records.shelf import MemoryShelf, reading
from tests.virtual import inline


def whole(history: Database, kind: Any) -> list[tuple[Any, ...]]:
    """All records of a kind with parts and events, in the order in which they began to be kept."""

    def look(connection: Connection) -> list[tuple[Any, ...]]:
        found = sorted(record_query.find(connection, kind, RecordFilter(), 10**6), key=lambda one: one.id)
        parts = record_query.parts(connection, [one.id for one in found])
        told = record_query.events(connection, [one.id for one in found])
        return [
            (replace(one, id=0, parts=dict(parts[one.id])), [(event.boot, event.sequence) for event in told[one.id]])
            for one in found
        ]

    return history.run(look)


# ---- as in memory, as before --------------------------------------------------------------------------------


FORMER_PASSAGES = (
    "660334aefa3af819", "2b8656e2ca9b7cd4", "3d5c2dbd6f2f5b56", "b7229404b61aaef6", "3397c2b1818bc801", "8894c32cbfa5cba4",
    "1aa18ae8525d4e5a", "30f130d73de62b24", "f257b3d4a026c321", "a607bdd400110d2a", "fb4c09672a2ed48c", "5e66387e4f20fd8b",
)  # fmt: skip
FORMER_RUNS = (
    "3060817cc09a2f17", "005c26fa47e16054", "47f64419e203e90e", "0bc7af6af17345ea", "0aa1601711174245", "6f5f391a18c24076",
    "a46a7b130f9fd86a", "038fe4eb4c65a344", "e88eb040223d9006", "dc870f8688b0aef6", "d3f795f8a86c0afc", "96e6f8d677659a85",
)  # fmt: skip
"""SHA-256 (its beginning) of what the versions before the records made of the same events, by seed."""


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("seed", "former"), list(enumerate(FORMER_PASSAGES)))
def test_passages_are_those_of_the_version_before(history: Database, seed: int, former: str) -> None:
    tell(history, "c1", stories.products(seed, 120))
    now = [
        (one.number, one.boot, one.begun, one.entry, one.fields.get("length"), one.fields["corrections"], one.fields.get("greatest"),
         one.alarms, one.outcome, one.ended, one.missed, one.duration, sorted(events))
        for one, events in whole(history, PASSAGE)
    ]  # fmt: skip
    assert hashlib.sha256(repr(now).encode()).hexdigest()[:16] == former, now


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("seed", "former"), list(enumerate(FORMER_RUNS)))
def test_runs_are_those_of_the_version_before(history: Database, seed: int, former: str) -> None:
    tell(history, "seq1", stories.runs(seed, 30))
    causes = ("", *RUN.fields["cause"].words)
    now = []
    for one, events in whole(history, RUN):
        said = one.fields.get
        now.append(
            (one.boot, one.definition, one.begun, one.entry > 0, one.outcome, one.ended, one.seconds, said("step"), said("suspensions"),
             one.paused, said("stalls"), said("losses"), said("forces"), said("first_out") or "", said("first_step"), said("first_bit"),
             said("first_time"), said("first_value"), said("first_together"), said("acknowledged"), one.missed,
             causes.index(said("cause") or ""),
             [(part.number, part.key, part.state, part.begun, part.ended, part.seconds, part.paused) for part in one.parts.values()],
             sorted(events))
        )  # fmt: skip
    assert hashlib.sha256(repr(now).encode()).hexdigest()[:16] == former, now


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(8))
def test_the_store_says_what_the_fold_says(history: Database, seed: int) -> None:
    for equipment, portions in (("c1", stories.products(seed, 90)), ("seq1", stories.runs(seed, 20))):
        told = [replace(portion, lost=0) for portion in portions if portion.events]
        tell(history, equipment, told)
        machine, source = item(equipment), records.source_of(item(equipment))
        assert source is not None
        shelf, mark = MemoryShelf(), None
        for event in (event for portion in told for event in portion.events):
            if mark is not None and begins_again(event, mark):
                fold.begin_again(source.machine, shelf, reading(machine.type, event))
            mark = position_of(event)
            fold.take(source.machine, shelf, reading(machine.type, event))
        for kind in machine.type.records.values():
            own = [
                (replace(one, id=0, equipment=equipment, parts=dict(sorted(one.parts.items()))), shelf.events[one.id])
                for one in shelf.records
                if one.kind == kind.name
            ]
            assert whole(history, kind) == [
                (one, [(event.boot, event.sequence) for event in told]) for one, told in own
            ]


@pytest.mark.parametrize("equipment", ["c1", "seq1"])
def test_the_number_of_a_machine_is_looked_up_once_for_a_delivery(history: Database, equipment: str) -> None:
    asked: list[str] = []
    listen(history.engine, "before_cursor_execute", lambda *given: asked.append(given[2]))
    portions = stories.products(3, 30) if equipment == "c1" else stories.runs(3, 5)
    for portion in portions:
        asked.clear()
        tell(history, equipment, [portion])
        assert sum("FROM event_machine WHERE name" in one for one in asked) <= 1


@pytest.mark.sweep(8)
@pytest.mark.parametrize("equipment", ["c1", "seq1"])
def test_redelivery_after_a_crash_changes_nothing(history: Database, equipment: str) -> None:
    """Killed between the commit and the acknowledgement, at every place, with portions cut anywhere: as if nothing had happened."""
    source = random.Random(7)
    portions = stories.products(2, 60) if equipment == "c1" else stories.runs(2, 8)
    told = [event for portion in portions for event in portion.events]
    told = told[: next((n for n in range(1, len(told)) if told[n].sequence <= told[n - 1].sequence), len(told))]
    tell(history, equipment, [Portion(tuple(told))])
    kinds = list(item(equipment).type.records.values())
    wanted = [whole(history, kind) for kind in kinds]
    for number in range(6):
        database = Database(history.path.with_name(f"again-{number}.db"), "history", inline)
        database.migrate()
        at = 0
        while at < len(told):
            size, back = source.randrange(1, 12), source.randrange(0, 6)
            tell(database, equipment, [Portion(tuple(told[max(0, at - back) : at + size]))])
            at += size
        assert [whole(database, kind) for kind in kinds] == wanted
        database.close()


# ---- what a person asks -------------------------------------------------------------------------------------


def test_records_are_cut_with_the_rest_of_the_history(history: Database) -> None:
    ring = Ring(time=BEGIN - BEGIN % store.HOUR)
    border = ring.time + 2 * store.HOUR
    for product in range(1, 41):
        ring.tell(1, product, after=360)
        ring.tell(5, product, after=1)
    tell(history, "c1", [Portion(tuple(ring.drain()))])
    device = Device(time=border - 30 * SECOND, dt=0.1)
    device.run()
    tell(history, "seq1", [Portion(tuple(device.drain()))])
    before = ask(history, PASSAGE)
    assert history.run(lambda connection: store.size(connection, history.path, ring.time)).oldest == before[-1].begun
    removed, done = history.run(lambda connection: store.cut(connection, border + 5, 7))
    assert (removed, done) == (8 + 14, False), "seven passages and a run; of each machine seven events"
    while not done:
        removed, done = history.run(lambda connection: store.cut(connection, border + 5, 7))
    assert ask(history, PASSAGE) == [one for one in before if one.begun >= border]
    assert ask(history, RUN) == []
    for table in ("record_part", "record_event"):
        left = history.run(
            lambda c, table=table: c.exec_driver_sql(  # type: ignore[misc]
                f"SELECT count(*) FROM {table} WHERE record NOT IN (SELECT id FROM record)"
            ).scalar_one()
        )
        assert left == 0


async def test_a_definition_that_changes_does_not_change_what_happened(history: Database) -> None:
    device = Device()
    device.start()
    device.lose(1)
    device.scan()
    tell(history, "seq1", [Portion(tuple(device.drain()))])
    device.give()
    other = replace(item("seq1"), sequence=definition("other", ("lower", "turn", "drive")))
    device.run()
    changed = RecordFold([other])
    history.run(lambda c: books.store(c, changed, "seq1", device.drain()))
    new, old = ask(history, RUN)
    known = history.run(lambda c: record_query.definitions(c, [new.definition, old.definition, "none"]))
    assert known[old.definition].part(2)["de"] == "Lift de"
    assert known[new.definition].part(2)["de"] == "Turn de"
    assert known[old.definition].labels[str(old.fields["first_out"])]["hr"] == "Pressure hr"
    assert known[old.definition].value(2, 3) == "pressure"
    assert known["none"].part(1) == {}
    assert kept(definition()) != kept(definition(steps=("lower", "lift")))


def test_what_is_no_machine_s_makes_no_record(history: Database) -> None:
    tell(
        history, "c1", [Portion((rings.Event(1, BEGIN, 30), rings.Event(2, BEGIN + 1, 1, snapshot=rings.snapshot(0))))]
    )
    assert ask(history, PASSAGE) == []
