"""Frames for browsers: encoded once, dropped for the slow, full after a gap."""

import asyncio
from typing import Any

import orjson

from app.clock import ManualClock
from app.live.frames import Live
from app.tags.batch import Batch
from app.tags.database import Tag, TagDatabase


def plant(count: int = 4, period: float = 0.02) -> tuple[TagDatabase, Live, ManualClock]:
    clock = ManualClock()
    tags = TagDatabase(clock)
    tags.configure([Tag(f"m1.p{i}", f"p{i}", "hall") for i in range(count)])
    return tags, Live(tags, clock, period), clock


def publish(tags: TagDatabase, clock: ManualClock, **values: float) -> None:
    handles = [tags.handle("m1." + key) for key in values]
    tags.publish(Batch("hall", 0, clock.micros(), clock.micros(), handles, list(values.values())))


async def frame(watcher: Any) -> dict[str, Any]:
    return orjson.loads(await asyncio.wait_for(watcher.next(), 10))  # type: ignore[no-any-return]


async def test_the_first_frame_is_full_and_the_next_holds_only_what_changed() -> None:
    tags, live, clock = plant()
    publish(tags, clock, p0=1.0)
    watcher = live.join("motor", ["m1.p0", "m1.p1"])
    first = await frame(watcher)
    assert first["full"] is True
    assert [v[:2] for v in first["v"]] == [[0, 1.0], [1, None]]
    publish(tags, clock, p1=7.5, p3=9.0)
    second = await frame(watcher)
    assert [v[:2] for v in second["v"]] == [[1, 7.5]]
    assert second["n"] == first["n"] + 1
    assert "full" not in second


async def test_changes_within_one_period_come_as_one_frame() -> None:
    tags, live, clock = plant(period=0.1)
    watcher = live.join("motor", ["m1.p0"])
    await frame(watcher)
    publish(tags, clock, p0=1.0)
    assert (await frame(watcher))["v"][0][1] == 1.0
    publish(tags, clock, p0=2.0)
    publish(tags, clock, p0=3.0)
    assert [v[1] for v in (await frame(watcher))["v"]] == [3.0]


async def test_a_slow_watcher_gets_a_full_frame_and_costs_the_others_nothing() -> None:
    tags, live, clock = plant(period=0.001)
    slow, fast = live.join("motor", ["m1.p0"]), live.join("motor", ["m1.p0"])
    await frame(slow)
    await frame(fast)
    for i in range(5):
        publish(tags, clock, p0=float(i))
        assert (await frame(fast))["v"][0][1] == float(i)
    late = await frame(slow)
    assert late["full"] is True
    assert late["v"][0][1] == 4.0
    publish(tags, clock, p0=9.0)
    assert "full" not in await frame(slow)


async def test_numbers_of_frames_have_no_gap_unless_one_was_dropped() -> None:
    tags, live, clock = plant(period=0.001)
    watcher = live.join("motor", ["m1.p0"])
    numbers = [(await frame(watcher))["n"]]
    for i in range(5):
        publish(tags, clock, p0=float(i))
        numbers.append((await frame(watcher))["n"])
    assert numbers == list(range(numbers[0], numbers[0] + 6))


async def test_a_frame_comes_every_second_even_when_nothing_changes() -> None:
    _, live, _ = plant()
    watcher = live.join("motor", ["m1.p0"])
    await frame(watcher)
    beat = asyncio.create_task(live.beat())
    try:
        assert (await asyncio.wait_for(frame(watcher), 2))["v"] == []
    finally:
        beat.cancel()


async def test_pages_of_one_kind_share_their_frames_and_a_left_page_is_forgotten() -> None:
    tags, live, clock = plant()
    a, b = live.join("motor", ["m1.p0"]), live.join("motor", ["m1.p0"])
    await a.next()
    await b.next()
    publish(tags, clock, p0=1.0)
    assert await asyncio.wait_for(a.next(), 1) is await asyncio.wait_for(b.next(), 1)
    live.leave(a)
    live.leave(b)
    assert live.pages == []
    publish(tags, clock, p0=2.0)


async def test_a_new_revision_sends_everybody_a_full_frame_with_new_handles() -> None:
    tags, live, _clock = plant()
    watcher = live.join("motor", ["m1.p1"])
    await frame(watcher)
    tags.configure([Tag("m1.p1", "p1", "hall")])
    live.renew()
    renewed = await frame(watcher)
    assert (renewed["rev"], renewed["full"], [v[0] for v in renewed["v"]]) == (2, True, [0])
