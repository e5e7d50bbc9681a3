"""The conveyor's PLC over its registers: commands and their refusals, faults and recovery, both presets, power, and the true positions."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from app.errors import ConfigurationError, DeviceException
from app.plant.definitions import Device, Equipment, EquipmentType
from app.registers.plc_map import AnswerState
from app.sim import training
from app.sim.conveyor.machine import FAULTS, Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import (
    ConveyorCommand,
    ConveyorState,
)
from app.sim.machines import MACHINE_FAULTS, VIRTUAL_DEVICES
from tests.sim.conveyor.bench import QUICK, SIMULATION, TOLERANCE, line, running
from tests.sim.conveyor.line import MemoryPort, Port, TestLine, Witness, tcp_port

# ---- one product, from entry to unloading


@pytest.mark.sweep(8)
@pytest.mark.parametrize("geometry", [Geometry(), SIMULATION], ids=["model", "simulation"])
async def test_a_product_runs_from_entry_to_unloading(geometry: Geometry) -> None:
    on = line(geometry=geometry, settings={})
    witness = Witness(on)
    await on.start()
    on.device.machine.place(40.0, 32.5)
    await on.until(lambda: on.device.tracking.entered == 1)
    (row,) = (await on.products()).values()
    assert (row["id"], row["state"], row["corrected_at"]) == (1, 2, 0)
    assert row["head"] == pytest.approx(geometry.sensors[0], abs=0.5)
    await on.until(lambda: on.device.machine.unloaded == 1, 90)
    on.step()
    events = await on.fetch()
    assert [(event.code, event.source) for event in events] == [
        (34, 0),
        (41, 0),
        (30, 0),
        (1, 1),
        (2, 1),
        *((code, sensor) for sensor in (2, 3, 4) for code in (3, 4)),
        (5, 0),
    ]
    assert events[4].value == pytest.approx(32.5, abs=0.6), "measured at S1"
    times = [event.time for event in events]
    assert times == sorted(times)
    age = (events[-1].time - events[3].time) / 1e6
    assert events[-1].value == pytest.approx(age)
    assert all(abs(event.value) < 1.5 for event in events[5:-1]), "corrections"
    assert await on.products() == {}
    assert (await on.status())["unloaded"] == 1
    assert witness.worst < 1.5


# ---- settings


async def test_settings_are_all_or_none_and_act_at_once() -> None:
    on = line()
    await on.start()
    on.go(1)
    await on.fetch()
    assert (await on.set(automatic_speed=101.0)).reason == 21
    assert (await on.set(automatic_speed=40.0, jam_time=0.05)).detail == 14
    assert (await on.set(shortest=60.0, longest=50.0)).detail == 9
    assert on.device.machine.speeds[0] == 60
    assert (await on.set(automatic_speed=40.0, manual_speed=20.0)).state is AnswerState.DONE
    on.go(1)
    assert on.device.machine.speeds == [40, 40, 40]
    status = await on.status()
    assert (status["automatic_speed"], status["manual_speed"], status["jerk"]) == (40, 20, 1000)
    assert await on.codes() == [(38, 0)]
    on.device.power_cycle()
    assert (await on.status())["automatic_speed"] == 40


# ---- faults: what the PLC sees, what it does, how it goes on


async def test_an_emergency_stop_cuts_the_drives_and_waits_for_a_reset() -> None:
    on = running()
    witness = Witness(on)
    on.go(12)
    await on.until(lambda: on.device.machine.speeds[0] == 60)
    await on.fetch()
    await on.train(training.REG_MACHINE_FAULT, 50)
    on.go(0.5)
    assert on.device.machine.speeds == [0, 0, 0]
    status = await on.status()
    assert (status["state"], status["emergency_stop"], status["first_out"]) == (ConveyorState.EMERGENCY_STOP, 1, 22)
    assert (await on.codes())[:2] == [(22, 0), (31, 0)]
    await on.done(ConveyorCommand.RESET)
    assert await on.get("state") == ConveyorState.EMERGENCY_STOP, "still pressed"
    await on.train(training.REG_MACHINE_FAULT, 0)
    status = await on.status()
    assert (status["state"], status["emergency_stop"]) == (ConveyorState.EMERGENCY_STOP, 0)
    await on.done(ConveyorCommand.RESET)
    assert await on.get("state") == ConveyorState.STOPPED
    await on.start()
    on.go(10)
    assert (23, 0) in await on.codes()
    assert witness.worst < 2, "the belts coasted, the encoders counted"


async def test_a_silent_host_ends_automatic() -> None:
    on = line(settings={**QUICK, "host_timeout": 1.0})
    for beat in range(30):
        await on.port.write(9, [beat + 1], 6)
        on.go(0.1)
        if beat == 5:
            await on.start()
    assert await on.get("automatic") == 1
    await on.fetch()
    await on.train(training.REG_MACHINE_FAULT, 60)
    for beat in range(30, 50):
        await on.port.write(9, [beat + 1], 6)
        on.go(0.1)
    status = await on.status()
    assert (status["automatic"], status["host_silent"], status["first_out"]) == (0, 1, 35)
    assert (await on.order(ConveyorCommand.START)).reason == 2
    await on.train(training.REG_MACHINE_FAULT, 0)
    await on.port.write(9, [99], 6)
    on.go(0.1)
    assert await on.codes() == [(35, 0), (31, 0), (36, 0)]
    assert (await on.order(ConveyorCommand.START)).state is AnswerState.DONE


# ---- power and repetition


@pytest.mark.sweep(8)
async def test_a_power_cycle_keeps_tracking() -> None:
    on = running()
    witness = Witness(on)
    on.go(20)
    await on.fetch()
    before, kept = await on.products(), await on.status()
    assert len(before) >= 3
    await on.train(training.REG_POWER, 1)
    after, status = await on.products(), await on.status()
    assert list(after) == list(before)
    assert {row["state"] for row in after.values()} <= {2, 3, 6}
    assert [row["entered"] for row in after.values()] == [row["entered"] for row in before.values()]
    assert all(abs(after[id]["head"] - before[id]["head"]) < 1 for id in before)
    assert (status["boots"], status["mode"], status["uncertain"]) == (2, 0, 1)
    for name in ("next_id", "entered", "unloaded", "corrections", "automatic_speed"):
        assert status[name] == kept[name]
    power = (await on.fetch())[-1]
    assert (power.code, power.value) == (34, 2)
    on.go(1)
    witness.worst_flagged = 0
    await on.start()
    on.go(8)
    await on.fetch()
    on.go(8)
    await on.fetch()
    assert witness.worst < 2 and witness.worst_flagged < 2
    assert not [event for event in on.events if event.code in (11, 12)]


@pytest.mark.sweep(8)
async def test_the_same_seed_and_writes_repeat_a_run_to_the_bit() -> None:
    async def run(seed: int) -> list[object]:
        on = running(seed=seed)
        on.device.scan_time.stopwatch = iter(range(10**9)).__next__ if seed == 3 else None
        seen: list[object] = []
        for second in range(60):
            on.go(1)
            if second == 20:
                await on.train(training.REG_MACHINE_FAULT, 12)
            if second == 40:
                await on.done(ConveyorCommand.STOP)
            if second == 45:
                await on.start()
            seen.append([await on.port.read(0x0100, 96), await on.port.read(0x0800, 124)])
            await on.fetch()
        return [seen, on.events]

    one, two, other = await run(3), await run(3), await run(4)
    assert one == two
    assert one != other


@pytest.mark.sweep(8)
async def test_positions_stay_within_the_tolerance_in_normal_running() -> None:
    worst = 0.0
    for seed, geometry in ((1, Geometry()), (2, SIMULATION)):
        on = running(seed=seed, geometry=geometry)
        witness = Witness(on)
        for _ in range(30):
            on.go(5)
            await on.fetch()
        assert witness.fates["unloaded"] > 40 and set(witness.fates) == {"unloaded"}
        assert witness.worst_flagged == 0, "nothing was doubtful"
        assert on.device.machine.collisions == 0
        worst = max(worst, witness.worst)
    assert worst < 0.4 * TOLERANCE, f"{worst:.2f} mm"


@pytest.fixture(params=["memory", "tcp"])
async def road(request: pytest.FixtureRequest) -> AsyncIterator[tuple[TestLine, Port]]:
    on = running(seed=6)
    if request.param == "memory":
        yield on, MemoryPort(on.device)
    else:
        async with tcp_port(on.device) as port:
            yield on, port


@pytest.mark.sweep(8)
async def test_memory_and_tcp_tell_the_same(road: tuple[TestLine, Port]) -> None:
    on, port = road
    on.port = port
    direct = MemoryPort(on.device)
    on.go(20)
    for address, count in (
        (0, 32),
        (0x0100, 96),
        (0x0180, 64),
        (0x0200, 34),
        (0x0320, 66),
        (0x0400, 10),
        (0x0800, 124),
    ):
        assert await port.read(address, count) == await direct.read(address, count)
    with pytest.raises(DeviceException) as error:
        await port.read(0x0160, 1)
    assert error.value.code == 2
    with pytest.raises(DeviceException) as error:
        await port.write(0x0100, [1], 6)
    assert error.value.code == 2
    await on.fetch()
    assert (await on.set(automatic_speed=25.0)).state is AnswerState.DONE
    await on.stand()
    assert (await on.status())["automatic_speed"] == 25
    assert [code for code, _ in await on.codes() if code in (38, 33, 31)] == [38, 33, 31]


# ---- the plant file


MODEL = {
    "belts": 3.0,
    "sensors": 4.0,
    "belt_1_end": 215.0,
    "belt_2_end": 445.0,
    "line_length": 660.0,
    "sensor_1": 100.0,
    "sensor_2": 215.0,
    "sensor_3": 445.0,
    "sensor_4": 560.0,
}
"""Where the belts of the model end and its sensors are, as every plant file has it after it was read."""


def equipment(**options: object) -> Equipment:
    kind = EquipmentType("conveyor", Path("conveyor"), "c", Device(), {}, {}, (), (), {}, (), {})
    return Equipment("c1", kind, "l", 5, {}, "", {}, (), {**MODEL, **options})


async def test_a_plant_file_describes_the_line() -> None:
    device = VIRTUAL_DEVICES["conveyor"](
        equipment(
            sensor_1=150.0,
            rated_speed=60.0,
            resolution=1024.0,
            intact_is_one=0.0,
            product_slots=33.0,
            simulation={"start": "automatic", "arrivals": 0.0, "automatic_speed": 50.0},
        ),
        1,
    )
    assert isinstance(device, VirtualConveyor)
    on = TestLine(device)
    on.go(2)
    status = await on.status()
    assert (status["sensor_position_1"], status["slots"], status["automatic"]) == (150, 33, 1)
    assert status["speed_1"] == pytest.approx(50, abs=1)
    assert tuple(MACHINE_FAULTS["conveyor"]) == FAULTS
    assert (await on.port.read(0xE003, 1)) == [10]


def test_what_cannot_be_is_named() -> None:
    for options, said in (
        ({"belt_2_end": 100.0}, "rising positions expected"),
        ({"simulation": {"start": "forward"}}, "simulation.start = 'forward': expected automatic or stopped"),
        ({"simulation": {"interval": "soon"}}, "simulation.interval = 'soon': expected a number"),
        ({"simulation": {"automatic_sped": 3.0}}, "automatic_sped"),
        ({"simulation": {"automatic_speed": 300.0}}, "automatic_speed takes 5 to 100, not 300"),
    ):
        with pytest.raises(ConfigurationError, match=said):
            VIRTUAL_DEVICES["conveyor"](equipment(**options), 1)
