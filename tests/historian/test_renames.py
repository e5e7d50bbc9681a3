"""What happened on a machine follows it to its new name: live, from the plant file, and together with what still waits."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import pytest
from sqlalchemy import Connection

from app.clock import ManualClock
from app.db import Database
from app.errors import StorageError
from app.historian import record_query, renames
from app.historian.events import EndedCommand, ring_positions
from app.plant.definitions import Equipment
from tests.historian import books
from tests.historian.books import FORCE, PASSAGE, RUN, Records
from tests.historian.rings import BEGIN, CONVEYOR, Event, Ring, conveyor
from tests.historian.sequence_rings import Device, sequences


def named(machines: Iterable[Equipment], **names: str) -> list[Equipment]:
    """`machines` after `[equipment.<new>] was = "<first>"`."""
    return [replace(item, id=names[item.id], was=item.id) if item.id in names else item for item in machines]


def products(history: Database, equipment: str) -> list[int]:
    return sorted(one.number for one in books.ask(history, PASSAGE, equipment=equipment))


def drained(ring: Ring, *numbers: int) -> Sequence[Event]:
    for number in numbers:
        ring.passage(number)
    return ring.drain()


async def opened(history: Database, machines: Iterable[Equipment], changed: list[str] | None = None) -> Records:
    """As a server that starts with these machines."""
    clock = ManualClock()
    clock.step_wall((BEGIN - clock.micros()) / 1e6 + 3600)
    book = Records(history, clock, (changed if changed is not None else []).append)
    await book.load()
    book.configure(machines)
    return book


async def test_passages_go_on_under_the_new_name(history: Database) -> None:
    changed: list[str] = []
    ring = Ring()
    book = await opened(history, conveyor("c1", "c2"), changed)
    await book.take("c1", drained(ring, 1, 2))
    before = book.last("c1")
    changed.clear()
    book.configure(named(conveyor("c1", "c2"), c1="line1"))
    assert book.last("line1") == before and book.last("c1") is None
    await book.take("line1", drained(ring, 3))
    assert products(history, "line1") == [1, 2, 3] and products(history, "c1") == [] and changed == ["line1"]
    assert history.run(ring_positions).keys() == {"line1"}
    book = await opened(history, named(conveyor("c1", "c2"), c1="belt"))  # twice, and while the server was down
    assert book.last("belt") is not None
    last = drained(ring, 4)
    await book.take("belt", last)
    assert products(history, "belt") == [1, 2, 3, 4]
    book = await opened(history, conveyor("c1", "c2"))  # and back
    await book.take("c1", last)
    assert products(history, "c1") == [1, 2, 3, 4], "what is delivered again is still known"


async def test_without_any_event_it_follows_by_itself(history: Database) -> None:
    book = await opened(history, conveyor("c1"))
    await book.take("c1", drained(Ring(), 1))
    book = await opened(history, named(conveyor("c1"), c1="line1"))
    assert not book._followed, "the book looks for this each second"
    await book.close()
    assert products(history, "line1") == [1] and book._followed


async def test_what_waits_and_who_asked_follow_too(history: Database) -> None:
    ring, write = Ring(), history.write
    book = await opened(history, conveyor("c1"))

    async def full(work: object) -> object:
        raise StorageError("history.db: database or disk is full")

    history.write = full  # type: ignore[method-assign, assignment]
    ring.tell(1, 7)
    told = ring.tell(6, 7, request=300)
    with pytest.raises(StorageError):
        await book.take("c1", ring.drain())
    book.command_ended(EndedCommand("c1", (300,), "Ana Kos", "fell down", told.time, told.time))
    book.configure(named(conveyor("c1"), c1="line1"))
    history.write = write  # type: ignore[method-assign]
    await book.close()
    (one,) = books.ask(history, PASSAGE, equipment="line1")
    assert [step.person for step in books.events(history, one, CONVEYOR)] == ["", "Ana Kos"]


async def test_two_that_change_names_keep_their_own(history: Database) -> None:
    one, other = Ring(), Ring()
    book = await opened(history, conveyor("c1", "c2"))
    await book.take("c1", drained(one, 1, 2))
    await book.take("c2", drained(other, 8, 9, 10))
    book.configure(named(conveyor("c1", "c2"), c1="c2", c2="c1"))
    await book.take("c1", drained(other, 11))
    await book.take("c2", drained(one, 3))
    assert (products(history, "c1"), products(history, "c2")) == ([8, 9, 10, 11], [1, 2, 3])
    assert {name: mark.sequence for name, mark in history.run(ring_positions).items()} == {
        "c1": other.sequence,
        "c2": one.sequence,
    }


async def test_who_takes_the_name_of_one_that_is_gone_takes_nothing_else(history: Database) -> None:
    ring = Ring()
    book = await opened(history, conveyor("c1", "c2"))
    await book.take("c1", drained(ring, 1))
    await book.take("c2", drained(Ring(), 2))
    book.configure(named(conveyor("c2"), c2="c1"))
    await book.close()
    assert products(history, "c1") == [2]
    book = await opened(history, conveyor("c1", "c2"))
    await book.take("c1", drained(ring, 3))
    assert (products(history, "c1"), products(history, "c2")) == ([1, 3], [2]), "it comes back with what it had"


async def test_a_history_from_before_goes_on_where_both_names_have_rows(history: Database) -> None:
    def past(connection: Connection) -> None:
        for name, sequence in (("c1", 10), ("line1", 20)):
            connection.exec_driver_sql(
                "INSERT INTO event_mark (equipment, boot, sequence, time) VALUES (?, 1, ?, ?)",
                (name, sequence, sequence),
            )
            connection.exec_driver_sql(
                "INSERT INTO event_gap (equipment, boot, sequence, time, count) VALUES (?, 1, 5, 5, 3)", (name,)
            )

    history.run(past)
    assert history.run(lambda connection: renames.follow(connection, {"c1": "line1"})) == {"line1"}
    assert {name: mark.sequence for name, mark in history.run(ring_positions).items()} == {"line1": 20}
    assert history.run(lambda connection: record_query.lost(connection, "line1", None, None)) == 3
    assert history.run(lambda connection: renames.follow(connection, {"c1": "line1"})) == set()


async def test_runs_and_forces_follow(history: Database) -> None:
    device = Device()
    book = Records(history, ManualClock())
    (item,) = sequences("s1")
    book.configure([item])
    device.tell(device.block.force(2, 3, 60.0, device.time))
    device.start()
    await book.take("s1", device.drain())
    book.configure([replace(item, id="seq", was="s1")])
    await book.close()
    while device.block.running:
        device.scan()
    await book.take("seq", device.drain())
    assert [(one.equipment, one.outcome) for one in books.ask(history, RUN)] == [("seq", "done")]
    assert [one.equipment for one in books.ask(history, FORCE)] == ["seq"]
