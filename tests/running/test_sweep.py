"""What the system says of itself is published when it changed."""

import asyncio

from app.clock import ManualClock
from app.running.sweep import Sweep
from app.tags.batch import Batch
from app.tags.database import Standstill, Tag, TagDatabase


def test_only_what_changed_is_published_and_then_it_is_told() -> None:
    tags = TagDatabase(ManualClock())
    tags.configure([Tag(f"sys.{key}", key, "sys", 0.0) for key in ("loop_lag", "a", "b")])
    values, heard, told = {"a": 1, "b": 2}, list[Batch](), []
    tags.subscribe(heard.append)
    sweep = Sweep(
        tags, ManualClock(), values=lambda: values, published=lambda: told.append(len(heard)), second=lambda: None
    )
    sweep.publish()
    values["b"] = 3
    sweep.publish()
    sweep.loop_lag = 0.01234
    sweep.publish()
    sweep.publish()
    handles = {tags.handle(f"sys.{key}"): key for key in ("loop_lag", "a", "b")}
    changed = [{handles[h]: v for h, v in zip(batch.handles, batch.values, strict=True)} for batch in heard]
    assert changed == [{"loop_lag": 0.0, "a": 1, "b": 2}, {"b": 3}, {"loop_lag": 12.3}, {}]
    assert told == [1, 2, 3, 4], "after the values, so that who is told reads them"


async def test_what_stands_still_right_after_it_began_is_told() -> None:
    """Before the first pause is over somebody has looked: else what came until then would hold over any time."""
    clock, stills = ManualClock(), list[Standstill]()
    tags = TagDatabase(clock)
    tags.configure([Tag("sys.loop_lag", "loop_lag", "sys", 0.0)])
    tags.on_standstill(stills.append)
    sweep = Sweep(tags, clock, values=dict, published=lambda: None, second=lambda: None)
    task = asyncio.ensure_future(sweep.run())
    await asyncio.sleep(0)
    begun = clock.micros()
    tags.publish(Batch("sys", 0, begun, begun, [0], [1.0]))
    clock.advance(5.4)
    tags.wake()
    task.cancel()
    assert [(still.begin - begun, still.end - begun) for still in stills] == [(2_000_000, 5_400_000)]
