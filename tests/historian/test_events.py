"""Every event of every ring is kept once, whatever breaks in between; who caused it is known by the command that it names."""

import random
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import Connection

from app.clock import ManualClock
from app.db import Database
from app.errors import StorageError
from app.historian import events, store
from app.historian.events import Delivery, EndedCommand, Events, Fold, event_of, has_ring, told
from app.historian.tables import event as event_table
from app.historian.tables import event_machine
from app.plant.definitions import Device, Equipment, EquipmentType, PlcMap
from app.records.event import Event
from tests.historian import rings
from tests.historian.rings import BEGIN, SECOND, Ring
from tests.historian.test_recorder import limit_pages
from tests.historian.test_renames import named
from tests.virtual import inline


def machines(*ids: str, ring: bool = True) -> list[Equipment]:
    """Machines of a type of which nothing is made."""
    kind = EquipmentType(
        "press", Path(), "type", Device(services=(PlcMap(10, events=ring),)), {}, {}, (), (), {}, (), {}
    )
    return [Equipment(id, kind, "hall", 1, {"en": id}, "line", {}, ()) for id in ids]


def kept(database: Database, *ids: str, folds: Sequence[Fold] = ()) -> Events:
    clock = ManualClock()
    clock.step_wall((BEGIN - clock.micros()) / 1e6 + 3600)
    made = Events(database, clock, folds=folds)
    made.configure(machines(*ids or ("p1", "p2")))
    return made


def stored(database: Database, equipment: str = "p1") -> list[Event]:
    def work(connection: Connection) -> list[Event]:
        rows = connection.execute(told().where(event_machine.c.name == equipment).order_by(event_table.c.id))
        return [event_of(row) for row in rows]

    return database.run(work)


def sequences(database: Database, equipment: str = "p1") -> list[int]:
    return [event.sequence for event in stored(database, equipment)]


def said(told: Iterable[rings.Event]) -> list[tuple[object, ...]]:
    return [
        (e.boot, e.sequence, e.time, e.code, e.source, None if e.value != e.value else e.value, e.snapshot, e.request)
        for e in told
    ]


class Witness(Fold):
    """Writes down what it is told."""

    def __init__(self, *machines: str) -> None:
        self.machines = frozenset(machines)
        self.told: list[tuple[object, ...]] = []

    def configure(self, machines: Iterable[Equipment]) -> None:
        pass

    def put(self, connection: Connection, equipment: str, number: int, event: Event) -> None:
        self.told.append(("put", event.sequence))

    def lose(self, connection: Connection, equipment: str, number: int, lost: int) -> None:
        self.told.append(("lose", lost))

    def begin_again(self, connection: Connection, equipment: str, number: int, event: Event) -> None:
        self.told.append(("again", event.sequence))

    def attributed(self, connection: Connection, equipment: str, event: Event) -> None:
        self.told.append(("attributed", event.sequence, event.person, event.reason))

    def done(self, connection: Connection, equipment: str) -> None:
        self.told.append(("done", equipment))


async def test_an_event_is_kept_as_the_ring_said_it(history: Database) -> None:
    ring = Ring()
    ring.tell(300, 7, source=65535, value=2.5, second=6, other=1.5, request=41)
    ring.tell(1)
    ring.tell(2, value=0.0)
    told = ring.drain()
    await kept(history).take("p1", told)
    found = stored(history)
    assert [
        (e.boot, e.sequence, e.time, e.code, e.source, e.value, e.words, e.request) for e in found
    ] == said(told)  # fmt: skip
    assert [(e.equipment, e.person, e.reason) for e in found] == [("p1", "", "")] * 3
    assert [e.id for e in found] == sorted({e.id for e in found})


async def test_a_machine_of_which_nothing_is_made_keeps_its_events_and_one_without_a_ring_has_none(
    history: Database,
) -> None:
    assert [has_ring(one) for one in (*machines("p1"), *machines("p2", ring=False))] == [True, False]
    made = kept(history, "p1")
    ring = Ring()
    ring.tell(1)
    await made.take("p1", ring.events)
    await made.take("p2", ring.events)
    assert (sequences(history, "p1"), sequences(history, "p2")) == ([1], [])
    assert made.last("p1") is not None and made.last("p2") is None


@pytest.mark.sweep(8)
async def test_redelivery_after_a_crash_changes_nothing(history: Database) -> None:
    """Killed between the commit and the acknowledgement, at every place, with portions cut anywhere, over restarts of the device."""
    source = random.Random(11)
    ring = Ring()
    for number in range(120):
        ring.tell(number % 9 + 1, number)
        if number % 50 == 49:
            ring.boot += 1
    told = ring.drain()
    for number in range(20):
        database = Database(history.path.with_name(f"again-{number}.db"), "history", inline)
        database.migrate()
        at = 0
        while at < len(told):
            server = kept(database)  # a new process every time
            await server.load()
            size, back = source.randrange(1, 30), source.randrange(0, 12)
            await server.take("p1", told[max(0, at - back) : at + size])
            at += size
        assert sequences(database) == list(range(1, 121))
        database.close()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("back", range(1, 6))
@pytest.mark.parametrize("shift", [-86_400.0, -3600.0, -1.5, 0.9, 1.5, 30.0, 3600.0, 86_400.0])
@pytest.mark.parametrize("boots", [0, 1], ids=["same boot", "switched on since"])
async def test_a_clock_that_was_set_while_the_server_was_down_doubles_nothing(
    history: Database, shift: float, back: int, boots: int
) -> None:
    """Killed after the history and before the alarms' journal had the last `back` events: they come once more, with other times."""
    witness = Witness("p1")
    made, ring = kept(history, folds=[witness]), Ring()
    for code in range(1, 6):
        ring.tell(code)
    told = ring.drain()
    await made.take("p1", told)
    again = kept(history, folds=[witness])
    await again.load()
    ring.boot += boots
    ring.tell(6)
    met = replace(ring.which, reader=object(), number=0)
    moved = round(shift * SECOND)
    await again.take(
        "p1", [replace(e, time=e.time + moved, boot=ring.boot, ring=met) for e in [*told[-back:], *ring.drain()]]
    )
    assert sequences(history) == [1, 2, 3, 4, 5, 6]
    assert [one for one in witness.told if one[0] != "done"] == [("put", n) for n in range(1, 7)]


@pytest.mark.parametrize("shift", [-86_400.0, -1.5, 0.0, 3600.0])
@pytest.mark.parametrize("restarted", [False, True])
async def test_a_device_that_lost_everything_is_kept_whatever_the_clock_says(
    history: Database, shift: float, restarted: bool
) -> None:
    made, ring = kept(history), Ring()
    for code in (1, 2, 3):
        ring.tell(code)
    await made.take("p1", ring.drain())
    if restarted:
        made = kept(history)
        await made.load()
    ring.begin_anew()
    ring.time += round(shift * SECOND)
    ring.tell(4)
    ring.tell(5)
    told = ring.drain()
    await made.take("p1", told)
    await made.take("p1", told)
    ring.tell(6)
    await made.take("p1", [*told, *ring.drain()])
    assert [event.code for event in stored(history)] == [1, 2, 3, 4, 5, 6]


async def test_an_event_that_another_offset_gave_another_time_is_the_same(history: Database) -> None:
    made, ring = kept(history), Ring()
    ring.tell(1)
    ring.tell(2)
    told = ring.drain()
    await made.take("p1", told)
    await made.take("p1", [replace(event, time=event.time + 40_000) for event in told])
    assert sequences(history) == [1, 2]


async def test_a_device_that_lost_everything_counts_from_one_and_is_kept(history: Database) -> None:
    witness = Witness("p1")
    made, ring = kept(history, folds=[witness]), Ring()
    for code in (1, 2, 3):
        ring.tell(code)
    await made.take("p1", ring.drain())
    ring.begin_anew()  # boot and sequence are as they were before
    ring.tell(4, after=5)
    ring.tell(5)
    await made.take("p1", ring.drain())
    assert [(e.boot, e.sequence, e.code) for e in stored(history)] == [
        (1, 1, 1),
        (1, 2, 2),
        (1, 3, 3),
        (1, 1, 4),
        (1, 2, 5),
    ]
    assert [one for one in witness.told if one[0] != "done"] == [
        ("put", 1), ("put", 2), ("put", 3), ("again", 1), ("put", 1), ("put", 2),
    ]  # fmt: skip


async def test_a_sequence_that_wraps_goes_on(history: Database) -> None:
    made, ring = kept(history), Ring(sequence=2**32 - 3)
    ring.tell(1)
    ring.tell(2)
    await made.take("p1", ring.drain())
    ring.tell(3)
    await made.take("p1", ring.drain())
    assert sequences(history) == [2**32 - 2, 2**32 - 1, 1]


@pytest.mark.parametrize(("told", "counted"), [(0, 5), (3, 3), (5, 5), (40, 5)])
async def test_what_is_missing_is_counted_but_never_what_is_there(history: Database, told: int, counted: int) -> None:
    """The link's count may begin before what is stored, or it may know of no loss: between event 1 and event 7 five are missing."""
    witness = Witness("p1")
    made, ring = kept(history, folds=[witness]), Ring()
    ring.tell(1)
    await made.take("p1", ring.drain())
    ring.sequence += 5
    ring.tell(2)
    await made.take("p1", ring.drain(), told)
    assert history.run(lambda connection: events.lost(connection, "p1", None, None)) == counted
    assert [one for one in witness.told if one[0] == "lose"] == [("lose", counted)] * (counted > 0)


async def test_folds_are_told_in_order_and_only_of_their_machines(history: Database) -> None:
    mine, other = Witness("p1"), Witness("p2")
    made, ring = kept(history, folds=[mine, other]), Ring()
    ring.tell(1)
    ring.tell(2)
    told = ring.drain()
    await made.take("p1", told)
    await made.take("p1", told)
    assert mine.told == [("put", 1), ("put", 2), ("done", "p1")]
    assert other.told == []


async def test_each_command_is_given_to_the_events_that_carry_its_id_however_near_the_next_one_is(
    history: Database,
) -> None:
    witness = Witness("p1")
    made, ring = kept(history, folds=[witness]), Ring()
    ring.time = made._clock.micros()
    at = ring.time
    for request in (41, 0, 42, 42):
        ring.tell(5, request=request, after=0.01)
    made.command_ended(EndedCommand("p1", (42,), "Ivo Ban", "later", at, at + SECOND))
    made.command_ended(EndedCommand("p1", (41,), "Ana Kos", "", at, at + SECOND))
    made.command_ended(EndedCommand("p2", (41,), "Eva Novak", "on another machine", at, at + SECOND))
    await made.take("p1", ring.drain())
    assert [(e.person, e.reason) for e in stored(history)] == [
        ("Ana Kos", ""), ("", ""), ("Ivo Ban", "later"), ("Ivo Ban", "later"),
    ]  # fmt: skip
    assert [one for one in witness.told if one[0] == "attributed"] == [
        ("attributed", 3, "Ivo Ban", "later"), ("attributed", 4, "Ivo Ban", "later"), ("attributed", 1, "Ana Kos", ""),
    ]  # fmt: skip


@pytest.mark.parametrize("first", ["event", "command"])
async def test_event_and_end_of_the_command_come_in_any_order(history: Database, first: str) -> None:
    made, ring = kept(history), Ring()
    ring.time = made._clock.micros()
    ring.tell(5, request=41)
    command = EndedCommand("p1", (40, 41), "Ana Kos", "stuck", ring.time - SECOND, ring.time)
    if first == "command":
        made.command_ended(command)
    await made.take("p1", ring.drain())
    if first == "event":
        made.command_ended(command)
    await made.close()
    assert [e.person for e in stored(history)] == ["Ana Kos"]


async def test_an_id_that_was_given_again_belongs_to_the_later_command(history: Database) -> None:
    made, ring = kept(history), Ring()
    ring.tell(5, request=41)
    ring.tell(5, request=41, after=600)
    await made.take("p1", ring.drain())
    made.command_ended(EndedCommand("p1", (41,), "Ana Kos", "", ring.time - SECOND, ring.time))
    await made.close()
    assert [e.person for e in stored(history)] == ["", "Ana Kos"]


@pytest.mark.sweep(8)
async def test_a_full_disk_stops_nothing_and_nothing_is_missing_afterwards(tmp_path: Path) -> None:
    database = Database(tmp_path / "history.db", "history", inline)
    database.migrate()
    room = 1
    limit_pages(database, lambda: room)
    made, ring = kept(database), Ring()
    refused = 0
    for _ in range(60):
        for code in range(200):
            ring.tell(code + 1, code)
        told = ring.drain()
        try:
            await made.take("p1", told)
        except StorageError:
            refused += 1
        assert (made.last("p1") is None) or made.last("p1").sequence <= told[-1].sequence  # type: ignore[union-attr]
    assert refused and made.failed and made.waiting == refused * 200
    mark = made.last("p1")
    assert (0 if mark is None else mark.sequence) == ring.sequence - refused * 200, (
        "what waits is not said to be stored"
    )
    room = 1 << 30
    made._clock.advance(10)  # type: ignore[attr-defined]
    await made.close()
    assert sequences(database) == list(range(1, ring.sequence + 1))
    database.close()


async def test_events_are_cut_with_the_rest_of_the_history(history: Database) -> None:
    made = kept(history)
    for id in ("p1", "p2"):
        ring = Ring(time=BEGIN)
        for code in range(1, 101):
            ring.tell(code, after=60)
        await made.take(id, ring.drain(), 3)
    border = BEGIN + 3600 * SECOND
    assert history.run(events.oldest) == BEGIN + 60 * SECOND
    removed, done = history.run(lambda connection: store.cut(connection, border, 20))
    assert (removed, done) == (40, False), "of each machine a portion"
    history.run(lambda connection: store.cut(connection, border, 1000))
    for id in ("p1", "p2"):
        assert [e.time for e in stored(history, id)] == [BEGIN + n * 60 * SECOND for n in range(60, 101)]
        assert history.run(lambda connection, id=id: events.lost(connection, id, None, None)) == 0  # type: ignore[misc]
    assert history.run(events.oldest) == border


async def test_a_machine_that_is_renamed_keeps_its_events_without_a_row_being_written(history: Database) -> None:
    made, ring = kept(history, "p1"), Ring()
    ring.tell(1)
    await made.take("p1", ring.drain())
    ids = [e.id for e in stored(history, "p1")]
    made.configure(named(machines("p1"), p1="press"))
    ring.tell(2)
    await made.take("press", ring.drain())
    found = stored(history, "press")
    assert [e.sequence for e in found] == [1, 2] and [e.id for e in found][:1] == ids
    assert sequences(history, "p1") == []


@pytest.mark.sweep(8)
def test_an_event_costs_little(history: Database) -> None:
    """A day of the demo plant may take 50 MB."""
    ring = Ring()
    for number in range(20_000):
        ring.tell(number % 40 + 1, number, source=number % 4, value=0.25, second=number % 3, after=0.9)
    before = history.run(store.used)
    history.run(lambda connection: events.store(connection, Delivery("p1", ring.drain()), (), BEGIN))
    assert (history.run(store.used) - before) / 20_000 < 80, "bytes per event"
