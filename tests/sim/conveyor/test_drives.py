"""The three drives of the conveyor: who gives a belt its speed, and what stops it."""

from copy import copy

import pytest

from app.blocks.s_ramp import SRamp
from app.plant import expression, types
from app.plant.plant_files.languages import LANGUAGES
from app.sim.conveyor.register_map import (
    ConveyorCommand,
    ConveyorState,
    Motor,
    Source,
)
from tests.sim.conveyor.bench import line, put

STOP = types.read_type("conveyor", LANGUAGES)[0].type.commands["stop"]
SEEN = 0.5
"""From the press to the telegram, and from standstill to what is read of it [s]."""


@pytest.mark.sweep(8)
@pytest.mark.parametrize("acceleration", [5.0, 20.0, 32.0, 60.0, 500.0])
@pytest.mark.parametrize("jerk", [10.0, 30.0, 240.0, 5000.0])
def test_a_stop_is_given_the_time_of_the_ramp_whenever_it_comes(acceleration: float, jerk: float) -> None:
    """In the middle of a start most of all: the acceleration has to go before the belt can brake."""
    values = {"acceleration": acceleration, "jerk": jerk}
    allowed = expression.number(STOP.timeout, lambda key: (values[key], 0))
    starting, longest, done = SRamp(acceleration, jerk), 0.0, False
    while not done:
        for _ in range(10):
            done = starting.step(100.0, 0.02).done
        stopping, seconds = copy(starting), 0.02
        while not stopping.step(0.0, 0.02).done:
            seconds += 0.02
        longest = max(longest, seconds)
    assert longest + SEEN <= allowed


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
