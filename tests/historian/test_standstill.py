"""A program that stood still saw nothing: what is stored, counted and alarmed for that time, whoever notices it first."""

import os
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from sqlalchemy import Connection

from app.clock import ManualClock
from app.db import Database
from app.historian import query
from app.historian.aggregate import aggregate
from app.historian.recorder import Recorder
from app.plant.definitions import Kind
from app.plant.derive import Derivation
from app.tags.batch import Batch
from app.tags.database import Standstill, Tag, TagDatabase
from app.tags.quality import BAD, GOOD, NO_DATA, STALE, QualityReason, is_good, reason
from tests.alarms.conftest import HOT, Plot
from tests.conftest import PogonServer
from tests.historian.conftest import point
from tests.historian.recording import rows_of
from tests.plant.test_derive import START, _plant, run

FAST, SLOW, NEVER = "m1.speed", "m1.heat", "m1.serial"
LIMITS = {FAST: 2.0, SLOW: 30.0, NEVER: 0.0}
SECOND = 1_000_000


class House:
    """Three points of three blocks that are seen four times a second and swept as often, until time is lost."""

    def __init__(self, history: Database, kind: Kind = Kind.ANALOG) -> None:
        self.clock = ManualClock()
        self.tags = TagDatabase(self.clock)
        self.points = [point(name, kind) for name in LIMITS]
        self.tags.configure(Tag(item.name, item.id, "link.a", LIMITS[item.name]) for item in self.points)
        self.recorder = Recorder(self.tags, history, self.clock, keep_days=400, quota=1 << 30)
        self.seen = 0
        self.stills: list[Standstill] = []
        self.tags.on_standstill(self.stills.append)

    def scan(self) -> None:
        now = self.clock.micros()
        for block, name in enumerate(LIMITS):
            handle = self.tags.handle(name)
            handles = [handle] if self.tags.value(handle) != 5.0 or not is_good(self.tags.quality(handle)) else []
            self.tags.publish(Batch("link.a", block, now, now, handles, [5.0] * len(handles)))
        self.seen = now

    def live(self, seconds: float) -> None:
        for _ in range(round(seconds * 4)):
            self.scan()
            self.tags.sweep()
            self.clock.advance(0.25)


def by_sweep(house: House) -> None:
    house.tags.sweep()


def by_batch(house: House) -> None:
    house.scan()


def by_time(house: House) -> None:
    house.tags.wake()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("notice", [by_sweep, by_batch, by_time])
@pytest.mark.parametrize("kind", [Kind.ANALOG, Kind.ENUM])
@pytest.mark.parametrize("lost", [2.1, 5.0, 30.0, 31.9, 3 * 3600.0])
async def test_nothing_good_is_stored_for_a_time_that_nobody_saw(
    history: Database, lost: float, kind: Kind, notice: Callable[[House], None]
) -> None:
    house = House(history, kind)
    await house.recorder.configure(house.points)
    house.live(3)
    left = house.seen
    house.clock.advance(lost)
    back = house.clock.micros()
    notice(house)
    house.live(3)
    await house.recorder.flush()
    for name in LIMITS:
        rows = rows_of(history, name)
        assert [row[0] for row in rows] == sorted({row[0] for row in rows})
        unseen = [(max(a[0], left), b[0]) for a, b in pairwise(rows) if is_good(a[2])]
        assert is_good(rows[-1][2]) and rows[-1][0] >= back, "it goes on afterwards"
        assert all(end <= left + 2.26 * SECOND or begin >= back for begin, end in unseen if end > begin), rows
        found = history.run(lambda c, n=name: aggregate(c, _number(c, n), left - SECOND, back))
        assert found.good <= 3.26 * SECOND
        assert house.tags.sample(name).quality == GOOD
    assert [still.end for still in house.stills] == [back]
    assert house.stills[0].seconds == pytest.approx(lost, abs=0.5)


def _number(connection: Connection, name: str) -> int:
    found = query.find(connection, name)
    assert found is not None
    return found.number


@pytest.mark.parametrize("lost", [0.25, 1.0, 1.9])
async def test_a_short_hold_up_is_no_standstill(history: Database, lost: float) -> None:
    house = House(history)
    await house.recorder.configure(house.points)
    for _ in range(5):
        house.live(1)
        house.clock.advance(lost - 0.25)
    await house.recorder.flush()
    assert not house.stills
    assert all(is_good(row[2]) for name in LIMITS for row in rows_of(history, name))


@pytest.mark.parametrize("notice", [by_sweep, by_batch])
async def test_an_hour_that_the_wall_clock_left_out_was_seen_by_nobody(
    history: Database, notice: Callable[[House], None]
) -> None:
    house = House(history)
    await house.recorder.configure(house.points)
    house.live(3)
    left = house.seen
    house.clock.step_wall(3600)
    notice(house)
    assert all(house.tags.quality(handle) == GOOD for handle in range(3)), "what is known now does not suffer"
    house.live(3)

    def good(name: str, until: int) -> int:
        return history.run(lambda c: aggregate(c, _number(c, name), left, until)).good

    await house.recorder.flush()
    assert all(good(name, left + 3590 * SECOND) <= 3 * SECOND for name in LIMITS)
    house.clock.step_wall(-3600)
    house.live(1)
    await house.recorder.flush()
    assert [still.seconds for still in house.stills] == [0.0]
    assert all(good(name, house.clock.micros()) <= 4 * SECOND for name in LIMITS), (
        "the rest of the hour is still to come"
    )


def test_stale_is_dated_from_when_it_was_last_seen_and_in_order() -> None:
    clock = ManualClock()
    tags = TagDatabase(clock)
    tags.configure([Tag("a.x", "a.x", "l", 3.0), Tag("a.y", "a.y", "l", 2.0), Tag("b.z", "b.z", "l", 2.5)])
    begin = clock.micros()
    tags.publish(Batch("l", 0, begin, begin, [0, 1], [1.0, 2.0]))
    tags.publish(Batch("l", 1, begin, begin, [2], [3.0]))
    tags.sweep()
    heard: list[Batch] = []
    tags.subscribe(heard.append)
    for _ in range(5):
        clock.advance(0.8)
        tags.sweep()
    assert [(batch.time - begin, list(batch.handles)) for batch in heard] == [
        (2 * SECOND, [1]),
        (2.5 * SECOND, [2]),
        (3 * SECOND, [0]),
    ]
    assert all(tags.quality(handle) == STALE for handle in range(3))


def test_a_batch_that_comes_after_the_limit_and_before_the_sweep_leaves_a_stale_piece() -> None:
    clock = ManualClock()
    tags = TagDatabase(clock)
    tags.configure([Tag("a.x", "a.x", "l", 2.0)])
    begin = clock.micros()
    tags.sweep()
    tags.publish(Batch("l", 0, begin, begin, [0], [1.0]))
    tags.sweep()
    clock.advance(1.9)
    tags.sweep()
    clock.advance(0.2)
    heard: list[Batch] = []
    tags.subscribe(heard.append)
    tags.publish(Batch("l", 0, clock.micros(), clock.micros(), [], []))
    told = [(batch.time - begin, [batch.qualities[0] if batch.qualities else None]) for batch in heard if batch.handles]
    assert told == [(2 * SECOND, [STALE]), (2.1 * SECOND, [GOOD])]


async def test_a_bad_value_stays_as_it_is(history: Database) -> None:
    house = House(history)
    await house.recorder.configure(house.points)
    house.live(1)
    now = house.clock.micros()
    house.tags.publish(Batch("link.a", 0, now, now, [0], [None], BAD | QualityReason.COMM_FAILURE << 2))
    house.tags.sweep()
    house.clock.advance(30)
    house.tags.sweep()
    await house.recorder.flush()
    assert reason(rows_of(history, FAST)[-1][2]) is QualityReason.COMM_FAILURE
    assert NO_DATA in [row[2] for row in rows_of(history, SLOW)]


async def test_a_delay_does_not_count_what_nobody_saw(history: Database, tmp_path: Path) -> None:
    database = Database(tmp_path / "pogon.db", "pogon")
    database.migrate()
    plot = Plot(database, ManualClock())
    engine = await plot.begin(replace(HOT, on_delay=10.0))
    for _ in range(20):
        plot.tags.sweep()
        plot.put(after=0.25, t=80.0)
    plot.wait(30)
    assert plot.letters == ""
    assert engine.evaluation.due is not None and 4 <= engine.evaluation.due - plot.clock.monotonic() <= 6
    for _ in range(28):
        plot.tags.sweep()
        plot.put(after=0.25, t=80.0)
        engine.tick()
    assert plot.letters != ""
    database.close()


def test_hours_count_until_the_values_were_stale_and_again_when_they_are_seen() -> None:
    assert _plant is not None
    for stale in (True, False):  # whether its inputs were noticed to be stale, or do not grow stale so soon
        hours = Derivation(_plant)
        run(hours, START, status=1, speed_magnitude=1000)
        run(hours, START + 3600 * SECOND)
        dark, back = START + 3602 * SECOND, START + 7200 * SECOND
        if stale:
            run(hours, dark, STALE, status=1)
        hours.interrupted(dark, back)
        run(hours, back)
        run(hours, back + 1 * SECOND, status=1)
        end = run(hours, back + 3601 * SECOND)
        kept = hours.retained()["m1.running_hours"]["value"]
        assert kept == pytest.approx((3602 + 3600 + (0 if stale else 1)) / 3600)
        assert end


def test_the_extremes_of_a_day_know_nothing_of_a_value_of_the_day_before_that_nobody_saw_on_this_one() -> None:
    assert _plant is not None
    day = Derivation(_plant)
    run(day, START, current=80)
    run(day, START + 2 * SECOND, STALE, current=80)
    run(day, START + 24 * 3600 * SECOND)
    found = run(day, START + 24 * 3600 * SECOND + 1, current=40)
    assert (found["current_max_today"][0], found["current_min_today"][0]) == (40, 40)


@pytest.mark.slow
@pytest.mark.real_time
def test_a_server_that_was_stopped_for_some_seconds_stored_nothing_good_for_them(
    pogon_server: Callable[..., PogonServer],
) -> None:
    server = pogon_server()
    time.sleep(4)
    stopped = time.time_ns() // 1000
    os.kill(server.process.pid, signal.SIGSTOP)
    time.sleep(6)
    going = time.time_ns() // 1000
    os.kill(server.process.pid, signal.SIGCONT)
    time.sleep(4)
    server.stop()
    assert "stood still" in server.log()
    database = Database(server.data / "history.db", "history")
    try:
        names = database.run(
            lambda connection: [row[0] for row in connection.exec_driver_sql("SELECT name FROM point")]
        )
        stories = {name: rows for name in names if (rows := rows_of(database, name))}
        assert {"m1.speed", "m1.frequency", "sys.loop_lag"} <= stories.keys() and len(stories) > 100
        for name, rows in stories.items():
            segments = [(a[0], b[0]) for a, b in pairwise(rows) if is_good(a[2])]
            dark = [(a, b) for a, b in segments if b > stopped + 2.6 * SECOND and a < going]
            assert not dark, (name, stopped, going, rows)
    finally:
        database.close()
