"""Records of products from event rings: what is kept, once, in order, whatever breaks in between."""

import random
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from app.clock import ManualClock
from app.db import Database
from app.errors import StorageError
from app.historian import events, record_query, store
from app.historian.events import EndedCommand
from app.historian.records import RecordFold
from tests.historian import books
from tests.historian.books import PASSAGE, Records, Said, Told, everything
from tests.historian.rings import BEGIN, CONVEYOR, SECOND, Event, Ring, conveyor
from tests.historian.test_recorder import limit_pages
from tests.virtual import inline


@pytest.fixture
def kept(history: Database) -> Records:
    clock = ManualClock()
    clock.step_wall((BEGIN - clock.micros()) / 1e6 + 3600)
    return Records(history, clock, machines=conveyor("c1", "c2"))


def ask(history: Database, **wanted: object) -> list[Told]:
    return books.ask(history, PASSAGE, **wanted)


def steps(history: Database, one: Told) -> list[Said]:
    return books.events(history, one, CONVEYOR)


async def test_a_passage_has_entry_length_corrections_and_end(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.passage(7, 30.5, (0.4, -2.5, 1.0))
    await kept.take("c1", ring.drain())
    (one,) = ask(history)
    assert (one.equipment, one.number, one.boot, one.entry, one.length) == ("c1", 7, 1, 1, 30.5)
    assert (one.begun, one.ended, one.outcome) == (BEGIN + SECOND, ring.time, "unloaded")
    assert (one.corrections, one.greatest, one.missed, one.alarms) == (6, 2.5, 0, ())
    assert one.duration == (ring.time - one.begun) / 1e6
    told = steps(history, one)
    assert [step.code for step in told] == [1, 2, 3, 4, 3, 4, 3, 4, 5]
    assert [(step.source, step.value) for step in told if step.code == 3] == [(2, 0.4), (3, -2.5), (4, 1.0)]
    assert [step.time for step in told] == sorted(step.time for step in told)


async def test_what_is_nobodys_makes_no_passage(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(30)
    ring.tell(22)
    await kept.take("c1", ring.drain())
    assert ask(history) == []
    assert kept.last("c1") is not None


async def test_only_machines_that_track_products_are_kept(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.passage(1)
    await kept.take("m1", ring.drain())
    assert ask(history) == []
    assert kept.last("m1") is None


async def test_alarm_codes_are_those_of_the_alarms_of_the_machine_each_once(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(1, 5)
    ring.tell(10, 5, source=2, value=3.0)
    ring.tell(14, 5, value=2.0)
    ring.tell(10, 5, source=3, value=-4.0)
    ring.tell(11, 5, source=4)
    await kept.take("c1", ring.drain())
    (one,) = ask(history)
    assert one.alarms == (10, 11), "14 is no alarm of this machine"
    assert (one.outcome, one.ended, one.greatest) == ("lost", ring.time, 4.0)


async def test_who_is_seen_again_was_not_lost(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(1, 5)
    ring.tell(11, 5, source=2)
    ring.tell(3, 5, source=3, value=1.0)
    await kept.take("c1", ring.drain())
    assert (ask(history)[0].outcome, ask(history)[0].ended) == ("open", None)
    ring.tell(5, 5)
    await kept.take("c1", ring.drain())
    assert ask(history)[0].outcome == "unloaded"


async def test_who_was_gone_when_the_unloader_gripped_is_lost(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(1, 5)
    ring.tell(5, 5, value=20.0)
    ring.tell(11, 5, source=0, value=660.0)
    await kept.take("c1", ring.drain())
    assert (ask(history)[0].outcome, ask(history)[0].ended) == ("lost", ring.time)


async def test_who_was_unloaded_is_not_lost_at_a_sensor_afterwards(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(1, 5)
    unloaded = ring.tell(5, 5, value=20.0)
    ring.tell(11, 5, source=4, value=570.0)
    await kept.take("c1", ring.drain())
    assert (ask(history)[0].outcome, ask(history)[0].ended) == ("unloaded", unloaded.time)


@pytest.mark.parametrize("code", [15, 16])
async def test_who_goes_back_past_the_beginning_has_returned(kept: Records, history: Database, code: int) -> None:
    ring = Ring()
    ring.tell(1, 5)
    ring.tell(code, 5)
    await kept.take("c1", ring.drain())
    assert (ask(history)[0].outcome, ask(history)[0].ended) == ("returned", ring.time)


async def test_an_unexpected_product_begins_with_being_seen(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(12, 5, source=3)
    ring.tell(12, 0, source=3)
    ring.tell(1, 6)
    ring.tell(11, 6, source=2)
    ring.tell(12, 6, source=2, value=12.0)
    await kept.take("c1", ring.drain())
    lost, put = ask(history)
    assert (put.number, put.entry, put.outcome) == (5, 12, "open")
    assert (lost.number, lost.outcome, len(steps(history, lost))) == (6, "open", 3), "it was found where nobody looked"


async def test_who_was_inserted_in_front_says_nothing_about_those_behind(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(1, 1)
    await kept.take("c1", ring.drain())
    ring.sequence += 3
    ring.tell(8, 2)
    ring.tell(5, 2)
    await kept.take("c1", ring.drain(), 3)
    assert {one.number: one.outcome for one in ask(history)} == {1: "open", 2: "unloaded"}


async def test_the_length_that_a_person_gives_is_that_of_the_passage(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(8, 1, value=100.0, other=20.0)
    ring.tell(1, 2)
    ring.tell(2, 2, value=30.5)
    ring.tell(7, 2, value=140.0, other=28.0)
    ring.tell(8, 3, value=300.0)
    ring.tell(8, 4, value=400.0, other=0.0)
    ring.tell(8, 5, value=500.0, other=25.0)
    ring.tell(7, 5, value=510.0, other=0.0)
    await kept.take("c1", ring.drain())
    lengths = {one.number: one.length for one in ask(history)}
    assert lengths == {1: 20.0, 2: 28.0, 3: None, 4: None, 5: 25.0}, "a device that passes no length on changes none"


async def test_a_lost_product_that_is_deleted_stays_lost_and_says_so(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(1, 5)
    lost = ring.tell(11, 5, source=2)
    ring.tell(6, 5)
    await kept.take("c1", ring.drain())
    (one,) = ask(history)
    assert (one.outcome, one.ended) == ("lost", lost.time)
    assert [step.code for step in steps(history, one)] == [1, 11, 6]


async def test_a_gap_stop_belongs_to_both_products(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(1, 1)
    ring.tell(1, 2)
    ring.tell(20, 2, second=1, value=4.5, other=6.0)
    await kept.take("c1", ring.drain())
    rear, front = ask(history)
    assert (rear.number, front.number) == (2, 1)
    assert rear.alarms == front.alarms == (20,)
    assert [(step.words["product"], step.value, step.words["second_value"]) for step in steps(history, front)][-1] == (
        2,
        4.5,
        6.0,
    )


async def test_restart_in_mid_passage_goes_on_with_the_same_passage(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.passage(3)
    events = ring.drain()
    await kept.take("c1", events[:4])
    again = Records(history, ManualClock())
    again.configure(conveyor("c1"))
    await again.load()
    mark = again.last("c1")
    assert mark is not None
    assert (mark.boot, mark.sequence) == (1, 4)
    await again.take("c1", events[4:])
    (one,) = ask(history)
    assert one.outcome == "unloaded"
    assert len(steps(history, one)) == len(events)


@pytest.mark.sweep(8)
async def test_redelivery_after_a_crash_changes_nothing(kept: Records, history: Database) -> None:
    """Killed between the commit and the acknowledgement, at every place, with portions cut anywhere: as if nothing had happened."""
    source = random.Random(5)
    ring = Ring()
    for product in range(1, 9):
        ring.passage(product, 20.0 + product)
        ring.tell(20, product + 1, second=product, value=3.0)
    events = ring.drain()
    await kept.take("c1", events)
    wanted = everything(history, PASSAGE)
    for number in range(20):
        path = history.path.with_name(f"again-{number}.db")
        database = Database(path, "history", inline)
        database.migrate()
        at = 0
        while at < len(events):
            server = Records(database, ManualClock())  # a new process every time
            server.configure(conveyor("c1"))
            await server.load()
            size = source.randrange(1, 12)
            back = source.randrange(0, 6)
            await server.take("c1", [replace(one, time=one.time) for one in events[max(0, at - back) : at + size]])
            at += size
        assert everything(database, PASSAGE) == wanted
        database.close()


@pytest.mark.parametrize("boot", [1, 3], ids=["the same boot", "another boot"])
async def test_a_power_cycle_goes_on_with_the_numbers_and_a_ring_that_begins_again_is_new(
    kept: Records, history: Database, boot: int
) -> None:
    ring = Ring()
    ring.tell(1, 1)
    ring.boot = 2
    ring.tell(34, value=2)
    ring.tell(3, 1, source=2, value=0.1)
    await kept.take("c1", ring.drain())
    assert len(ask(history)) == 1
    other = Ring(time=ring.time + 60 * SECOND, boot=boot)
    other.tell(34, value=3)
    await kept.take("c1", other.drain())
    assert [one.outcome for one in ask(history)] == ["unknown"], "what was on the line is not known any more"
    other.passage(1)
    await kept.take("c1", other.drain())
    newest, oldest = ask(history)
    assert (newest.number, newest.outcome, newest.boot) == (1, "unloaded", boot)
    assert (oldest.number, oldest.outcome) == (1, "unknown")


async def test_another_product_with_the_number_of_one_that_is_on_its_way(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.tell(1, 1)
    ring.tell(1, 1)
    await kept.take("c1", ring.drain())
    newest, oldest = ask(history)
    assert (oldest.outcome, oldest.ended, newest.outcome) == ("unknown", newest.begun, "open")


async def test_lost_events_are_in_every_passage_that_was_under_way(kept: Records, history: Database) -> None:
    ring = Ring()
    ring.passage(1)
    ring.tell(1, 2)
    ring.tell(1, 3)
    await kept.take("c1", ring.drain())
    ring.sequence += 7
    ring.tell(1, 4)
    events = ring.drain()
    await kept.take("c1", events, 7)
    await kept.take("c1", events, 7)
    assert {one.number: one.missed for one in ask(history)} == {1: 0, 2: 7, 3: 7, 4: 0}
    assert history.run(lambda connection: record_query.lost(connection, "c1", None, None)) == 7, (
        "told twice, counted once"
    )
    ring.tell(5, 4)
    await kept.take("c1", ring.drain())
    assert {one.number: one.outcome for one in ask(history)} == {
        1: "unloaded",
        2: "unknown",
        3: "unknown",
        4: "unloaded",
    }, "nobody overtakes on a line: 2 and 3 have left unseen"


async def test_a_product_whose_entry_was_lost_says_so(kept: Records, history: Database) -> None:
    ring = Ring(sequence=100)
    ring.tell(3, 9, source=3, value=0.2)
    ring.tell(5, 9)
    await kept.take("c1", ring.drain(), 36)
    (one,) = ask(history)
    assert (one.entry, one.outcome) == (0, "unloaded")


async def test_who_deleted_it_and_why_stands_at_the_event(kept: Records, history: Database) -> None:
    clock = kept._clock
    ring = Ring(time=clock.micros())
    ring.tell(1, 1)
    ring.tell(1, 2)
    ring.tell(7, 2)
    await kept.take("c1", ring.drain())
    deleted = ring.time + SECOND
    kept.command_ended(
        EndedCommand("c1", (41,), "Ana Kos", "fell down", deleted, deleted + 100_000)
    )  # told before its event is there
    await kept.take("c2", [])
    ring.tell(6, 1, request=41)
    ring.tell(6, 2, request=42)
    await kept.take("c1", ring.drain())
    by = {
        one.number: [(s.code, s.person, s.reason) for s in steps(history, one) if s.code == 6] for one in ask(history)
    }
    assert by == {1: [(6, "Ana Kos", "fell down")], 2: [(6, "", "")]}


async def test_a_command_that_never_had_an_event_is_forgotten(kept: Records) -> None:
    now = kept._clock.micros()
    kept.command_ended(EndedCommand("c1", (41,), "Ana Kos", "", now, now))
    await kept.close()
    assert len(kept._commands) == 1
    kept._clock.advance(120)  # type: ignore[attr-defined]
    await kept.close()
    assert kept._commands == []


@pytest.mark.sweep(8)
async def test_a_full_disk_stops_nothing_and_nothing_is_missing_afterwards(tmp_path: Path) -> None:
    database = Database(tmp_path / "history.db", "history", inline)
    database.migrate()
    room = 1
    limit_pages(database, lambda: room)
    changed: list[str] = []
    kept = Records(database, ManualClock(), changed.append)
    kept.configure(conveyor("c1"))
    ring = Ring()
    refused = 0
    for product in range(1, 500):
        ring.passage(product)
        events = ring.drain()
        try:
            await kept.take("c1", events)
        except StorageError as error:
            refused += 1
            assert "full" in str(error) or "not written" in str(error)
        kept._clock.advance(1)  # type: ignore[attr-defined]
    assert refused > 400
    assert kept.failed
    assert kept.waiting == refused * 9
    room = 1 << 30
    kept._clock.advance(10)  # type: ignore[attr-defined]
    ring.passage(500)
    await kept.take("c1", ring.drain())
    assert not kept.failed
    assert kept.waiting == 0
    assert [one.number for one in ask(database)] == list(range(500, 0, -1))
    assert {one.outcome for one in ask(database)} == {"unloaded"}
    assert changed[-1] == "c1"
    database.close()


async def test_a_disk_that_takes_nothing_for_long_drops_the_oldest_and_counts_them(
    kept: Records, history: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(events, "MOST_WAITING", 20)
    original = history.write

    async def full(work: object) -> object:
        raise StorageError("history.db: database or disk is full")

    history.write = full  # type: ignore[method-assign, assignment]
    ring = Ring()
    ring.tell(1, 1)
    for product in range(2, 8):
        ring.passage(product)
        with pytest.raises(StorageError):
            await kept.take("c1", ring.drain())
    history.write = original  # type: ignore[method-assign]
    kept._clock.advance(10)  # type: ignore[attr-defined]
    await kept.close()
    assert kept.dropped > 0
    assert history.run(lambda connection: record_query.lost(connection, "c1", None, None)) == kept.dropped
    assert [one.number for one in ask(history)] == [7, 6]


async def test_a_broken_file_is_told_and_no_traceback(tmp_path: Path) -> None:
    path = tmp_path / "history.db"
    path.write_bytes(b"this is no database " * 500)
    database = Database(path, "history", inline)
    kept = Records(database, ManualClock())
    kept.configure(conveyor("c1"))
    await kept.load()
    ring = Ring()
    ring.passage(1)
    with pytest.raises(StorageError):
        await kept.take("c1", ring.drain())
    assert kept.failed
    await kept.close()
    database.close()


async def test_passages_are_cut_with_the_rest_of_the_history(kept: Records, history: Database) -> None:
    ring = Ring(time=BEGIN - BEGIN % store.HOUR)
    border = ring.time + 2 * store.HOUR
    for product in range(1, 41):
        ring.tell(1, product, after=360)
        ring.tell(5, product, after=1)
    await kept.take("c1", ring.drain())
    before = ask(history)
    removed, done = history.run(lambda connection: store.cut(connection, border + 5, 7))
    assert (removed, done) == (14, False), "seven passages and seven events"
    while not done:
        removed, done = history.run(lambda connection: store.cut(connection, border + 5, 7))
    after = ask(history)
    assert after == [one for one in before if one.begun >= border]
    left = history.run(lambda c: c.exec_driver_sql("SELECT count(DISTINCT record) FROM record_event").scalar_one())
    assert left == len(after)
    size = history.run(lambda connection: store.size(connection, history.path, ring.time))
    assert size.oldest == history.run(events.oldest) == after[-1].begun


def test_an_event_is_one_row_however_many_tell_it(history: Database) -> None:
    event = Event(5, BEGIN, 1, 1, 0.0, (0, 7, 0, 0, 0, 0))
    for _ in range(3):
        fold = RecordFold(conveyor("c1"))
        history.run(lambda c, fold=fold: events.store(c, events.Delivery("c1", [event]), (fold,), BEGIN))  # type: ignore[misc]
    with closing(sqlite3.connect(history.path)) as connection:
        for table in ("event", "record_event"):
            assert connection.execute(f"SELECT count(*) FROM {table}").fetchone() == (1,)
