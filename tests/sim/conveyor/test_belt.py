"""Belts follow their ramps, and their pulses."""

from struct import pack, unpack_from

import pytest

from app.blocks.ramp_record import RampState
from app.sim import training
from app.sim.conveyor.machine import EMERGENCY_STOP, Geometry
from app.sim.conveyor.register_map import (
    RAMP,
    RAMP_WORDS,
    RAMPS,
    ConveyorCommand,
    ConveyorEvent,
    ConveyorState,
    Motor,
    Source,
)
from tests.sim.conveyor.bench import SIMULATION, TOLERANCE, line, running
from tests.sim.conveyor.line import TestLine, Witness


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


@pytest.mark.sweep(8)
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


@pytest.mark.parametrize("geometry", [Geometry(), SIMULATION])
async def test_at_an_even_speed_one_pulse_is_not_news(geometry: Geometry) -> None:
    on = line(settings={"automatic_speed": 33.3}, geometry=geometry)
    await on.start()
    on.go(2.5)
    told = []
    for _ in range(100):
        on.go(0.11)
        told.append((await on.status())["belt_speed_1"])
    assert max(told) - min(told) < 0.25, "half of the dead-band of the point"
    assert told[-1] == pytest.approx(0.333 * geometry.full_speed, abs=0.15)


async def test_the_last_start_and_stop_of_each_belt_are_in_the_table() -> None:
    on = line(settings={})
    assert on.device.read(3, RAMPS, 4)[1:] == [6, 0, RAMP_WORDS]
    await on.start()
    on.go(0.3)
    assert ramp(on, 1)["state"] == RampState.RUNNING
    assert on.device.read(3, RAMPS, 4)[2] == 5, "the starts of three belts, of which the last is row 5"
    on.go(2)
    start = ramp(on, 3)
    assert (start["id"], start["state"], start["speed"], start["acceleration"]) == (3, RampState.COMPLETE, 0, 0)
    # 30 % with 60 %/s and 240 %/s²: a/j rising, v/a − a/j constant, a/j falling
    assert [start[f"duration_{n}"] for n in (1, 2, 3)] == pytest.approx([0.25, 0.25, 0.25], abs=1e-5)
    assert [start[f"jerk_{n}"] for n in (1, 2, 3)] == [240, 0, -240]
    await on.done(ConveyorCommand.STOP)
    on.go(2)
    stop = ramp(on, 4)
    assert (stop["id"], stop["state"], stop["speed"]) == (4, RampState.COMPLETE, 30)
    assert [stop[f"jerk_{n}"] for n in (1, 2, 3)] == [-240, 0, 240]
    assert stop["began"] > start["began"] + 2_000_000
    on.device.power_cycle()
    assert on.device.read(3, RAMPS, 4)[2] == 0


async def test_an_emergency_stop_is_a_stop_without_a_ramp() -> None:
    on = line(settings={})
    await on.start()
    on.go(2)
    on.device.machine.fault = EMERGENCY_STOP
    on.go(0.1)
    stop = ramp(on, 2)
    assert (stop["state"], stop["speed"], stop["duration_1"]) == (RampState.CUT_OFF, 30, 0)


def ramp(on: TestLine, slot: int) -> dict[str, float]:
    """A row of the table of ramps."""
    words = on.device.read(3, RAMPS + 4 + (slot - 1) * RAMP_WORDS, RAMP_WORDS)
    assert words[2] == words[-1] and words[2] % 2 == 0
    data = pack(f">{RAMP_WORDS}H", *words)
    codes = {"u16": ">H", "u32": ">I", "u64": ">Q", "f32": ">f"}
    return {key: unpack_from(codes[place.type], data, 2 * place.address)[0] for key, place in RAMP.items()}
