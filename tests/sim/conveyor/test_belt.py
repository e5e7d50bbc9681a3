"""Belts follow their ramps, and their pulses."""

import pytest

from app.sim import training
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.register_map import (
    ConveyorCommand,
    ConveyorEvent,
    ConveyorState,
    Motor,
    Source,
)
from tests.sim.conveyor.bench import TOLERANCE, line, running
from tests.sim.conveyor.line import Witness


async def test_speeds_follow_the_ramp_and_say_where_they_come_from() -> None:
    on = line(settings={})
    await on.start()
    on.go(0.4)
    status = await on.status()
    assert 5 < status["speed_1"] < 20
    assert (status["speed_setpoint_1"], status["speed_source_1"], status["motor_1"]) == (30, Source.AUTOMATIC, 1)
    on.go(2)
    status = await on.status()
    assert status["speed_2"] == pytest.approx(30, abs=0.5)
    assert status["belt_speed_2"] == pytest.approx(18.85, abs=0.3)
    assert status["line_speed"] == pytest.approx(18.85, abs=0.3)
    # v/a + a/j seconds to stop, half the speed on the way (the ramp is symmetric)
    assert status["stop_distance_2"] == pytest.approx(18.85 * (30 / 60 + 60 / 240) / 2, abs=0.05)
    assert status["encoder_1"] == pytest.approx(on.device.machine.pulses[0])
    began = await on.get("encoder_1")
    await on.done(ConveyorCommand.STOP)
    assert (await on.status())["motor_1"] == Motor.STOPPING
    assert await on.get("state") == ConveyorState.STOPPING
    on.go(2)
    moved = (await on.get("encoder_1") - began) * Geometry().pulse_length
    assert moved == pytest.approx(status["stop_distance_2"], abs=1.0)
    assert await on.get("state") == ConveyorState.STOPPED


async def test_manual_moves_only_while_it_is_held_in_one_direction() -> None:
    on = line(settings={})
    await on.hold(1, 0.5)
    assert on.device.machine.speeds == [0, 0, 0], "not in manual"
    await on.done(ConveyorCommand.MANUAL)
    assert await on.get("mode") == 2
    await on.hold(3, 0.5)
    assert on.device.machine.speeds == [0, 0, 0], "both directions"
    on.device.write(16, 0x0380, [1, 50, *(0, 0)])
    on.go(0.3)
    status = await on.status()
    assert (status["state"], status["speed_source_1"], status["speed_setpoint_1"]) == (
        ConveyorState.MANUAL,
        Source.MANUAL,
        10,
    )
    on.go(0.19)
    assert all(speed > 5 for speed in on.device.machine.speeds)
    on.go(1)
    assert on.device.machine.speeds == [0, 0, 0], "the counter stood still"
    await on.hold(2, 1, speed=20.0)
    assert all(speed < -15 for speed in on.device.machine.speeds)
    assert (await on.status())["reverse"] == 1
    on.go(1)
    await on.hold(1 | 0b010 << 4, 1)
    first, second, third = on.device.machine.speeds
    assert (first, third) == (0, 0) and second > 5
    on.go(1)
    await on.start()
    assert await on.get("mode") == 1
    await on.hold(2, 0.3)
    assert on.device.machine.speeds[0] > 0, "automatic does not listen to it"


@pytest.mark.parametrize("belt", [1, 2, 3])
async def test_slip_is_corrected_at_the_next_sensor_and_told(belt: int) -> None:
    on = running()
    await on.set(slip_warning=1.0)
    witness = Witness(on)
    await on.train(training.REG_MACHINE_FAULT, 10 + belt)
    told = []
    for _ in range(6):
        on.go(8)
        told += await on.fetch()
    outside = [event for event in told if event.code == 10]
    assert belt + 1 in {event.source for event in outside}
    assert all(2 < abs(event.value) < TOLERANCE for event in outside)
    assert belt in {event.source for event in told if event.code == ConveyorEvent.SLIP}
    assert witness.worst < TOLERANCE
    assert not [event for event in told if event.code in (11, 12)], "none lost, none unexpected"
    await on.train(training.REG_MACHINE_FAULT, 0)
    on.go(20)
    witness.worst = 0
    on.go(5)
    assert witness.worst < 2
