"""The three drives of the conveyor: who gives a belt its speed, and what stops it."""

import pytest

from app.sim.conveyor.register_map import (
    ConveyorCommand,
    ConveyorState,
    Motor,
    Source,
)
from tests.sim.conveyor.bench import line, put


async def test_it_stops_with_the_head_at_the_end_and_waits_for_the_dwell() -> None:
    on = line(settings={})
    await on.start()
    on.device.machine.place(40.0, 30.0)
    await on.until(lambda: bool(on.device.tracking.brake), 60)
    assert (await on.status())["speed_source_3"] == Source.UNLOADING
    await on.until(lambda: on.device.machine.speeds[2] == 0)
    (product,) = on.true()
    assert product.head == pytest.approx(660.0, abs=1.5)
    status = await on.status()
    assert (status["state"], status["unloading"], status["motor_3"]) == (ConveyorState.WAITING, 1, Motor.STOPPED)
    assert status["motor_1"] == Motor.FORWARD
    before = on.device.steps
    await on.until(lambda: on.device.machine.unloaded == 1)
    assert 1.9 < (on.device.steps - before) / 100 < 2.3
    on.go(3)
    assert await on.get("state") == ConveyorState.AUTOMATIC


async def test_backwards_head_and_tail_change_places() -> None:
    on = line()
    id = await put(on, 300.0, 30.0)
    await on.done(ConveyorCommand.MANUAL)
    await on.fetch()
    await on.hold(2, 1)
    on.go(0.5)
    row = (await on.products())[id]
    assert row["direction"] == 1 and row["head"] < row["tail"]
    assert (37, 1) in await on.codes()
    assert row["head"] == pytest.approx(on.true()[0].tail, abs=0.5)
