"""What becomes history, and what happens when the database does not take it."""

import asyncio
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sqlalchemy import event

from app.db import Database
from app.historian import recorder, store
from app.historian.recorder import Recorder
from app.historian.store import HEARTBEAT, RAMP, Row
from app.historian.track import Track
from app.plant.definitions import Kind, Point
from app.tags.database import Standstill, Tag
from app.tags.quality import COMM_FAILURE, GOOD, NO_DATA, STALE
from tests.historian.conftest import Source, point
from tests.historian.recording import QUOTA, recording, rows_of
from tests.virtual import inline

ROOT = Path(__file__).resolve().parents[2]
BEGIN = 1_773_036_000_000_000
signals = st.lists(
    st.tuples(
        st.integers(1, 5_000_000),
        st.one_of(st.floats(-3, 3, allow_nan=False), st.integers(-3, 3), st.sampled_from([0.0, 0.5, 1.0, -1.0])),
    ),
    min_size=1,
    max_size=80,
)


def kept(samples: list[tuple[int, float]], dead_band: float, *, linear: bool = True) -> list[Row]:
    track, rows = Track(1, dead_band, linear), list[Row]()
    for moment, value in samples:
        track.take(moment, value, GOOD, 0, rows)
    track.end(rows)
    return rows


def on_line(rows: list[Row], moment: int) -> float:
    """The line through the stored rows, at `moment`."""
    for a, b in pairwise(rows):
        if a[1] <= moment <= b[1]:
            assert a[2] is not None
            assert b[2] is not None
            return a[2] + (b[2] - a[2]) * (moment - a[1]) / (b[1] - a[1])
    assert moment == rows[-1][1]
    assert rows[-1][2] is not None
    return rows[-1][2]


def in_time(steps: list[tuple[int, float]]) -> list[tuple[int, float]]:
    out, moment = [], BEGIN
    for step, value in steps:
        moment += step
        out.append((moment, value))
    return out


@pytest.mark.sweep(8)
@settings(max_examples=400, deadline=None)
@example([(1, -1), (500_000, 1.5), (700_000, 0.0), (1, 0.0)], 2.0)
@example([(1, -1), (1_000_000, 1.5), (1, 0.0)], 2.0)
@given(signals, st.sampled_from([0.0, 0.1, 0.5, 1.0, 2.0]))
def test_line_and_hold_through_what_is_stored_are_within_the_dead_band(
    steps: list[tuple[int, float]], dead_band: float
) -> None:
    samples = in_time(steps)
    rows = kept(samples, dead_band)
    assert [row[1] for row in rows] == sorted({row[1] for row in rows})
    reach = dead_band * (1 + 1e-6) + 1e-9
    for moment, value in samples:
        assert abs(on_line(rows, moment) - value) <= reach
        since, held = [(row[1], row[2]) for row in rows if row[1] <= moment][-1]
        assert held is not None
        until = min((row[1] for row in rows if row[1] > moment), default=since)
        assert abs(held - value) <= reach or until - since <= RAMP, "no line is drawn there"


@pytest.mark.sweep(8)
@settings(max_examples=200, deadline=None)
@given(signals)
def test_a_step_is_stored_exactly_when_it_changes(steps: list[tuple[int, float]]) -> None:
    samples = in_time(steps)
    rows = kept(samples, 0.0, linear=False)
    changes = [samples[0]] + [b for a, b in pairwise(samples) if a[1] != b[1]]
    assert [(row[1], row[2]) for row in rows] == [(t, float(v)) for t, v in changes]


@pytest.mark.parametrize("band", [1.0, 0.5, 0.1, 0.05, 0.01, 0.001])
@pytest.mark.parametrize("at", [0, 1, 3, 7, 29, 1000, -3])
def test_a_last_digit_that_flickers_by_the_dead_band_is_not_stored(band: float, at: int) -> None:
    track, rows = Track(1, band, True), []  # type: ignore[var-annotated]
    for i in range(200):
        track.take(1_000_000 + i * 100_000, round((at + i % 2) * band, 3), GOOD, 0, rows)
    assert len(rows) == 1


def test_a_slow_value_costs_few_rows() -> None:
    samples = [(BEGIN + i * 100_000, i / 1000) for i in range(1, 10_001)]
    assert len(kept(samples, 0.5)) <= 45


@pytest.mark.parametrize("speed", [-300.0, -1.0, 0.5, 7.0, 1e4])
@pytest.mark.parametrize("band", [0.1, 1.0, 20.0])
def test_a_ramp_costs_two_rows_a_second_at_most(speed: float, band: float) -> None:
    samples = [(BEGIN, 0.0)] + [(BEGIN + i * 100_000, speed * i / 10) for i in range(1, 601)]
    rows = kept(samples, band)
    assert len(rows) <= 2 + 60 * 1.2
    assert rows[-1][1:3] == samples[-1]


async def test_the_end_of_a_ramp_is_stored_within_a_second_and_a_half(history: Database) -> None:
    source, made = await recording(history, point(dead_band=1))
    for i in range(25):
        source.publish(m1_speed=10.0 * i)
        source.clock.advance(0.1)
    end = source.clock.micros() - 100_000
    for _ in range(3):
        source.clock.advance(0.5)
        source.publish(m1_speed=240.0)
        await made.flush()
    assert rows_of(history)[-1][:2] == (end, 240)


def test_the_last_suppressed_sample_is_the_corner_before_a_jump() -> None:
    rows = kept([(BEGIN, 0.0), (BEGIN + 1, 0.1), (BEGIN + 2, 0.2), (BEGIN + 3, 9.0)], 0.5)
    assert [(row[1] - BEGIN, row[2]) for row in rows] == [(0, 0.0), (2, 0.2), (3, 9.0)]


async def test_a_source_that_lists_only_changes_still_gives_true_corners(history: Database) -> None:
    source, made = await recording(history, point())
    begin = source.clock.micros()
    for second in range(10):
        source.publish(m1_speed=100 if second < 8 else 900)
        source.clock.advance(1)
    await made.flush()
    assert [((t - begin) / 1e6, v) for t, v, _ in rows_of(history)] == [(0, 100), (7, 100), (8, 900)]


async def test_every_change_of_quality_is_stored_and_bad_has_no_value(history: Database) -> None:
    source, made = await recording(history, point(dead_band=50))
    for quality, value in ((GOOD, 10), (GOOD, 11), (STALE, 11), (GOOD, 11), (COMM_FAILURE, 11), (GOOD, 12)):
        source.publish(quality, m1_speed=value)
        source.clock.advance(1)
    await made.flush()
    assert [(v, q) for _, v, q in rows_of(history)] == [
        (10, GOOD),
        (11, GOOD),
        (11, STALE),
        (11, GOOD),
        (None, COMM_FAILURE),
        (12, GOOD),
    ]


async def test_a_constant_value_is_stored_every_ten_minutes(history: Database) -> None:
    source, made = await recording(history, point(), point("m1.fault", Kind.TEXT), point("m1.run", Kind.BOOL))
    for _ in range(35 * 60):
        source.publish(m1_speed=5, m1_fault="OC", m1_run=1)
        source.clock.advance(1)
        await asyncio.sleep(0)
        if made._clock.micros() % 10_000_000 == 0:
            await made.flush()
    for name in ("m1.speed", "m1.fault", "m1.run"):
        rows = rows_of(history, name)
        assert max(b[0] - a[0] for a, b in pairwise(rows)) <= HEARTBEAT + 11_000_000
        assert 4 <= len(rows) <= 9
        assert len({row[1] for row in rows}) == 1


async def test_what_is_no_number_is_stored_as_bad(history: Database) -> None:
    source, made = await recording(history, point())
    for value in (1.0, float("nan"), float("inf"), None):
        source.publish(m1_speed=value)
        source.clock.advance(1)
    await made.flush()
    assert [(v, q & 3) for _, v, q in rows_of(history)] == [(1.0, 0), (None, 2), (None, 2), (None, 2)]


async def test_a_clock_that_is_set_back_loses_nothing(history: Database) -> None:
    source, made = await recording(history, point(dead_band=1))
    source.publish(m1_speed=1.0)
    source.clock.step_wall(-3600)
    source.publish(m1_speed=1.1)
    source.clock.advance(1)
    source.publish(m1_speed=5.0)
    await made.close()
    assert [v for _, v, _ in rows_of(history)] == [1.1, 5.0, 1.0]


async def test_what_does_not_change_is_stored_where_the_clock_was_set_back_to(history: Database) -> None:
    """A source lists changes only, and ten minutes after the last sample are a year away when the clock had been a year ahead."""
    source, made = await recording(history, point(), point("m1.fault", Kind.TEXT), point("m1.run", Kind.BOOL))
    source.publish(m1_speed=1.0, m1_fault="OC", m1_run=1)
    source.clock.step_wall(-365 * 86_400)
    source.clock.advance(1)
    for _ in range(3):
        await made.flush()
        source.clock.advance(1)
    back = source.clock.micros() - 3_000_000
    for name, value in (("m1.speed", 1.0), ("m1.fault", "OC"), ("m1.run", 1)):
        assert [(time, told) for time, told, _ in rows_of(history, name)][:-1] == [(back, value)]


@pytest.mark.parametrize("back", [0.2, 2, 3600])
async def test_behind_the_time_that_was_lived_twice_stands_what_is_so_then(history: Database, back: float) -> None:
    """What was stored before the clock was set back does not come true again when that time comes."""
    names = {"m1.speed": 7.0, "m1.fault": "", "m1.run": 0}
    source, made = await recording(history, point(), point("m1.fault", Kind.TEXT), point("m1.run", Kind.BOOL))
    source.publish(m1_speed=1.0, m1_fault="OC", m1_run=1)
    source.clock.advance(1)
    source.publish(m1_speed=5.0, m1_fault="UV", m1_run=1)
    before = source.clock.micros()
    source.clock.step_wall(-back)
    source.clock.advance(back / 4)
    source.publish(m1_speed=7.0, m1_fault="", m1_run=0)
    source.clock.advance(back / 4)
    await made.flush()
    source.clock.advance(back / 2 + 0.01)
    await made.flush()
    for name, value in names.items():
        assert [row[1:] for row in rows_of(history, name) if row[0] <= before + 1][-1] == (value, GOOD), name
    source.clock.advance(1)
    source.publish(m1_speed=8.0)
    await made.flush()
    assert rows_of(history)[-1][1:] == (8.0, GOOD)


@pytest.mark.parametrize("noticed", [True, False])
async def test_a_point_that_goes_after_the_clock_was_set_back_is_not_good_later(
    history: Database, noticed: bool
) -> None:
    source, made = await recording(history, point())
    source.publish(m1_speed=1.0)
    before = source.clock.micros()
    source.clock.step_wall(-2)
    if noticed:
        source.publish(m1_speed=2.0)
    source.clock.advance(0.5)
    gone = source.clock.micros()
    made.follow([], {})
    await made.close()
    rows = rows_of(history)
    assert (gone, None, NO_DATA) in rows
    assert rows[-1] == (before + 1, None, NO_DATA)


async def test_a_server_killed_after_its_clock_was_set_back_leaves_no_good_value_behind(history: Database) -> None:
    """Its last sign of life is not the latest one: that is of before the clock was set."""
    source, made = await recording(history, point())
    source.publish(m1_speed=1.0)
    before = source.clock.micros()
    await made.flush()
    source.clock.step_wall(-3600)
    source.clock.advance(1)
    source.publish(m1_speed=2.0)
    ended = source.clock.micros()
    await made.flush()
    history.run(lambda c: store.begin_run(c, ended + 86_400_000_000))
    assert rows_of(history) == [
        (ended, 2.0, GOOD),
        (ended + 1, None, NO_DATA),
        (before, 1.0, GOOD),
        (before + 1, None, NO_DATA),
    ]


async def test_a_server_killed_after_its_clock_was_set_back_twice_leaves_no_good_value_behind(
    history: Database,
) -> None:
    """What it said before the second time is neither the latest nor the last: nobody closed it."""
    source, made = await recording(history, point())
    source.publish(m1_speed=1.0)
    ends = [source.clock.micros()]
    await made.flush()
    for value in (2.0, 3.0):
        source.clock.step_wall(-3600)
        source.clock.advance(1)
        await made.flush()
        source.clock.advance(0.4)
        source.publish(m1_speed=value)
        ends.append(source.clock.micros())
    await made.flush()
    history.run(lambda c: store.begin_run(c, ends[0] + 86_400_000_000))
    rows = rows_of(history)
    for end in ends:
        following = next(row for row in rows if row[0] > end)
        assert following == (end + 1, None, NO_DATA)


@pytest.mark.parametrize("seconds", [0.0, 10.0])
async def test_what_does_not_change_is_known_behind_the_end_of_a_run_whose_clock_was_ahead(
    history: Database, seconds: float
) -> None:
    """Where the former run ended nothing was known any more, and a value that stays is told again after ten minutes only."""
    source, made = await recording(history, point())
    source.publish(m1_speed=1.0)
    source.clock.advance(seconds)
    await made.close()
    ended = source.clock.micros()
    later, again = await recording(history, point())  # its clock begins where that of the other one began
    later.publish(m1_speed=1.0)
    for _ in range(3):
        later.clock.advance(seconds / 2 + 0.5)
        await again.flush()
    assert rows_of(history)[-2:] == [(ended + 1, None, NO_DATA), (ended + 2, 1.0, GOOD)]


async def test_behind_every_time_that_was_lived_before_stands_what_is_so_then(history: Database) -> None:
    """A clock that is set back twice ends two histories: behind each of them it goes on with what is so."""
    source, made = await recording(history, point())
    source.clock.advance(100)
    source.publish(m1_speed=1.0)
    first = source.clock.micros()
    source.clock.step_wall(-60)
    source.publish(m1_speed=2.0)
    source.clock.advance(20)
    source.publish(m1_speed=3.0)
    second = source.clock.micros()
    source.clock.step_wall(-10)
    source.publish(m1_speed=4.0)
    for _ in range(60):
        source.clock.advance(1)
        await made.flush()
    assert rows_of(history)[-4:] == [
        (second, 3.0, GOOD),
        (second + 1, 4.0, GOOD),
        (first, 1.0, GOOD),
        (first + 1, 4.0, GOOD),
    ]


@pytest.mark.parametrize("lost", [False, True])
async def test_what_does_not_change_is_known_behind_every_run_that_was_ahead(history: Database, lost: bool) -> None:
    """Two runs end later than a third one begins, by clocks that were ahead; `lost`: at their ends nothing was known anyway."""
    ends, quality = [], NO_DATA if lost else GOOD
    for later, seconds in enumerate((300, 60)):
        source, made = await recording(history, point(), later=later)
        source.publish(m1_speed=1.0)
        source.clock.advance(seconds)
        source.publish(quality=quality, m1_speed=1.0)
        await made.close()
        ends.append(source.clock.micros())
    source, made = await recording(history, point(), later=2)
    source.publish(m1_speed=1.0)
    for _ in range(302):
        source.clock.advance(1)
        await made.flush()
        now = source.clock.micros()
        *_, (_, _, stored) = (row for row in rows_of(history) if row[0] <= now)
        assert stored == GOOD or now in ends, now


@pytest.mark.parametrize("restarted", [False, True])
async def test_behind_a_time_that_the_clock_left_out_stands_what_is_so_then(history: Database, restarted: bool) -> None:
    """The clock went an hour ahead, where what was known broke off, and comes back to before that."""
    source, made = await recording(history, point())
    source.publish(m1_speed=1.0)
    await made.flush()
    broke_off = source.clock.micros() + 2_000_000
    source.clock.step_wall(3600)
    made.break_off(Standstill(broke_off, source.clock.micros(), 0.0))
    await made.flush()
    if restarted:
        await made.close()
        source, made = await recording(history, point(), later=-60)
    else:
        source.clock.step_wall(-3660)
    source.publish(m1_speed=1.0)
    for _ in range(70):
        source.clock.advance(1)
        await made.flush()
    now = source.clock.micros()
    assert now > broke_off
    *_, (_, _, stored) = (row for row in rows_of(history) if row[0] <= now)
    assert stored == GOOD


async def test_points_without_history_leave_none(history: Database) -> None:
    silent = Point("m1.code", "m1.code", "m1", "code", "code", history=False)
    source, made = await recording(history, point(), silent)
    source.publish(m1_speed=1, m1_code=2)
    await made.flush()
    assert rows_of(history, "m1.code") == []
    assert len(rows_of(history)) == 1


async def test_a_renamed_point_goes_on_in_its_own_history(history: Database) -> None:
    source, made = await recording(history, point("m1.speed"))
    source.publish(m1_speed=1)
    renamed = Point("m1.rpm", "m1.speed", "m1", "rpm", "rpm", unit="1/min")
    source.tags.configure([Tag("m1.rpm", "m1.speed", "link.a")])
    await made.configure([renamed])
    source.clock.advance(1)
    source.publish(m1_rpm=2)
    await made.close()
    assert [v for _, v, _ in rows_of(history, "m1.rpm")] == [1, 2]


async def test_a_handle_that_is_another_points_after_a_reload_never_mixes_two_histories(history: Database) -> None:
    source, made = await recording(history, point("m1.speed"), point("m2.speed"))
    source.publish(m1_speed=1, m2_speed=2)
    source.clock.advance(1)
    source.tags.configure([Tag("m2.speed", "m2.speed", "link.a"), Tag("m1.speed", "m1.speed", "link.a")])
    source.publish(m1_speed=10, m2_speed=20)
    await made.configure([point("m2.speed"), point("m1.speed")])
    await made.close()
    assert [v for _, v, _ in rows_of(history, "m1.speed")] == [1, 10]
    assert [v for _, v, _ in rows_of(history, "m2.speed")] == [2, 20]


async def test_a_removed_point_ends_with_no_data(history: Database) -> None:
    source, made = await recording(history, point("m1.speed"), point("m1.current"))
    source.publish(m1_speed=1, m1_current=2)
    source.tags.configure([Tag("m1.speed", "m1.speed", "link.a")])
    source.clock.advance(5)
    await made.configure([point("m1.speed")])
    await made.close()
    assert [(v, q) for _, v, q in rows_of(history, "m1.current")] == [(2, GOOD), (None, NO_DATA)]


async def test_a_value_that_was_there_before_the_recorder_is_taken(history: Database) -> None:
    source = Source(point())
    source.publish(m1_speed=7)
    source.clock.advance(60)
    made = Recorder(source.tags, history, source.clock, keep_days=400, quota=QUOTA)
    await made.configure([point()])
    await made.close()
    assert rows_of(history) == [(source.clock.micros(), 7, GOOD)]


def limit_pages(database: Database, limit: Callable[[], int]) -> None:
    """Let the disk be full: the file may have no more than `limit()` pages."""

    @event.listens_for(database.engine, "checkout")
    def _limit(connection: Any, *_: object) -> None:
        connection.execute(f"PRAGMA max_page_count={limit()}")


async def test_a_full_disk_is_told_and_what_was_seen_meanwhile_is_filled_in(
    history: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    room = 1 << 30
    limit_pages(history, lambda: room)
    source, made = await recording(history, point())
    source.publish(m1_speed=-1)
    source.clock.advance(1)
    await made.flush()
    room = 1
    for value in range(5000):
        source.publish(m1_speed=value)
        source.clock.advance(0.01)
    await made.flush()
    assert made.full
    assert made.statistics()["full"] == 1
    assert "full" in made.error
    await made.flush()
    room = 1 << 30
    await made.flush()
    assert made.full, "tried again too early"
    source.clock.advance(recorder.RETRY_PAUSE)
    await made.flush()
    assert not made.full
    assert made.statistics() | {"quota_days": 0, "fill": 0} == {
        "full": 0,
        "fill": 0,
        "rows_per_second": made.statistics()["rows_per_second"],
        "dropped": 0,
        "quota_days": 0,
    }
    assert [v for _, v, _ in rows_of(history)] == [-1, *range(5000)]


async def test_what_does_not_fit_into_memory_is_dropped_counted_and_leaves_a_gap(
    history: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "BUFFER_LIMIT", 100)
    room = 1 << 30
    limit_pages(history, lambda: room)
    source, made = await recording(history, point())
    room = 1
    published = 0
    while not made.full:
        source.publish(m1_speed=published)
        source.clock.advance(0.1)
        published += 1
        await made.flush()
    fitted = published - 1
    for _ in range(300):
        source.publish(m1_speed=published)
        source.clock.advance(0.1)
        published += 1
        await made.flush()
    room = 1 << 30
    source.clock.advance(10)
    await made.close()
    values = [v for _, v, _ in rows_of(history)]
    assert values[: fitted + 1] == [*range(fitted), None]
    tail = values[fitted + 1 :]
    assert tail == [*range(published - len(tail), published)]
    assert 95 <= len(tail) <= 101
    assert made.dropped == published - (len(values) - 1), "every row is either there or counted"


async def test_points_that_a_full_disk_does_not_take_are_recorded_when_there_is_room(history: Database) -> None:
    room = 1
    limit_pages(history, lambda: room)
    points = [point(f"m{i}.speed") for i in range(1, 400)]
    source, made = await recording(history, *points)
    assert made.full
    source.publish(m7_speed=7)
    room = 1 << 30
    source.clock.advance(10)
    await made.flush()
    source.publish(m8_speed=8)
    await made.close()
    assert [v for _, v, _ in rows_of(history, "m7.speed")] == [7]
    assert [v for _, v, _ in rows_of(history, "m8.speed")] == [8]


async def test_a_failing_recorder_never_raises_into_the_tag_database(history: Database, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    broken = Database(tmp_path / "file" / "history.db", "history", inline)
    source = Source(point())
    made = Recorder(source.tags, broken, source.clock, keep_days=1, quota=QUOTA)
    await made.configure([point()])
    source.publish(m1_speed=1)
    await made.flush()
    assert made.full
    await made.close()
    broken.close()


async def test_it_runs_writes_and_can_be_cancelled_at_any_time_without_loss(history: Database) -> None:
    source, made = await recording(history, point())
    written: list[int] = []
    for value in range(30):
        task = asyncio.create_task(made.flush())
        source.publish(m1_speed=value)
        source.clock.advance(1)
        await asyncio.sleep(0.001 * (value % 4))
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        written.append(value)
    await made.close()
    assert [v for _, v, _ in rows_of(history)] == written


KILLED = """
import asyncio, sys
from pathlib import Path
from app.clock import SystemClock
from app.db import Database
from app.historian.recorder import Recorder
from app.plant.definitions import Point
from app.tags.batch import Batch
from app.tags.database import Tag, TagDatabase

async def main():
    clock = SystemClock()
    tags = TagDatabase(clock)
    points = [Point(f"m1.p{i}", f"m1.p{i}", "m1", f"p{i}", "p") for i in range(50)]
    tags.configure(Tag(p.name, p.id, "link.a") for p in points)
    database = Database(Path(sys.argv[1]), "history")
    database.migrate()
    recorder = Recorder(tags, database, clock, keep_days=10, quota=1 << 30)
    await recorder.configure(points)
    task = asyncio.create_task(recorder.run())
    n = 0
    while not task.done():
        n += 1
        now = clock.micros()
        tags.publish(Batch("link.a", 0, now, now, range(50), [n + i / 100 for i in range(50)]))
        print(now, flush=True)
        await asyncio.sleep(0.01)
    await task

asyncio.run(main())
"""


@pytest.mark.real_time
def test_kill_9_loses_no_more_than_the_last_second(tmp_path: Path) -> None:
    path = tmp_path / "history.db"
    with subprocess.Popen([sys.executable, "-c", KILLED, str(path)], cwd=ROOT, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        begun = last = int(process.stdout.readline())
        told, until = 1, time.monotonic() + 120
        while told < 300 or last - begun < 2_700_000:  # however long a busy machine takes for so many
            assert time.monotonic() < until, f"{told} batches: expected 300"
            last, told = int(process.stdout.readline()), told + 1
        os.kill(process.pid, signal.SIGKILL)
        for line in process.stdout:
            last = int(line) if line.endswith(b"\n") else last
    assert process.returncode == -signal.SIGKILL
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        for number in range(1, 51):
            (newest, count) = connection.execute(
                "SELECT max(t), count(*) FROM sample WHERE point = ?", (number,)
            ).fetchone()
            assert last - newest < 1_000_000
            assert count > 100
    connection.close()
    again = Database(path, "history", inline)
    again.migrate()
    again.run(lambda c: store.begin_run(c, last + 60_000_000))
    assert rows_of(again, "m1.p7")[-1][2] == NO_DATA
    again.close()
