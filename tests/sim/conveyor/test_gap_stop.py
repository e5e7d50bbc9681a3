"""The gap stop of the conveyor: it names the pair, it holds in manual too, and the line goes on by itself."""

import pytest

from app.sim.conveyor.register_map import (
    ConveyorCommand,
    ConveyorState,
    Source,
)
from tests.sim.conveyor.bench import QUICK, line, put
from tests.sim.conveyor.line import Witness


async def test_the_gap_stop_names_the_pair_and_the_line_goes_on_by_itself() -> None:
    on = line(settings={**QUICK, "unload_dwell": 3.0})
    await put(on, 655.0)
    front, rear = await put(on, 485.0), await put(on, 425.0)
    witness = Witness(on)
    await on.start()
    stop = await on.until_event(20)
    assert (stop.snapshot[1], stop.snapshot[3]) == (rear, front)
    await on.until(lambda: not any(on.device.machine.speeds))
    status = await on.status()
    assert (status["state"], status["gap_stop"]) == (ConveyorState.GAP, 1)
    assert [status[f"speed_source_{belt}"] for belt in (1, 2, 3)] == [Source.GAP, Source.GAP, Source.UNLOADING]
    assert (status["first_out"], status["first_out_rear"], status["first_out_front"]) == (20, rear, front)
    assert status["first_out_value"] == pytest.approx(stop.value)
    assert status["first_out_time"] == stop.time
    assert 0 < status["smallest_gap"] < stop.value
    await on.until(lambda: on.device.machine.unloaded == 3, 30)
    assert on.device.machine.collisions == 0
    on.go(11)
    assert await on.get("first_out") == 0, "it ended by itself, and nobody had to do anything"
    assert witness.fates == {"unloaded": 3}
    assert [code for code, _ in await on.codes() if code in (20, 21)][:1] == [21]


async def test_manual_stops_before_two_products_touch() -> None:
    on = line()
    await put(on, 300.0, 30.0)
    await put(on, 200.0, 30.0)
    await on.done(ConveyorCommand.MANUAL)
    for _ in range(4):
        await on.hold(1 | 0b001 << 4, 3)
        on.go(1)
    assert on.device.machine.collisions == 0
    front, rear = on.true()
    assert front.tail - rear.head > 2
