"""The conveyor's PLC over its registers: commands and their refusals, faults and recovery, both presets, power, and the true positions."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from app.errors import ConfigurationError, DeviceException
from app.plant.definitions import Device, Equipment, EquipmentType
from app.registers.plc_map import AnswerState, real, real_of
from app.sim import training
from app.sim.conveyor.machine import FAULTS, Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import (
    ConveyorCommand,
    ConveyorState,
    Motor,
    Source,
)
from app.sim.machines import MACHINE_FAULTS, VIRTUAL_DEVICES
from tests.sim.conveyor.bench import QUICK, SIMULATION, TOLERANCE, line, put, running
from tests.sim.conveyor.line import MemoryPort, Port, TestLine, Witness, tcp_port

# ---- the map


# ---- one product, from entry to unloading


@pytest.mark.parametrize("geometry", [Geometry(), SIMULATION], ids=["model", "simulation"])
async def test_a_product_runs_from_entry_to_unloading(geometry: Geometry) -> None:
    on = line(geometry=geometry, settings={})
    witness = Witness(on)
    await on.done(ConveyorCommand.START)
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
        (30, 0),
        (1, 1),
        (2, 1),
        *((code, sensor) for sensor in (2, 3, 4) for code in (3, 4)),
        (5, 0),
    ]
    assert events[3].value == pytest.approx(32.5, abs=0.6), "measured at S1"
    times = [event.time for event in events]
    assert times == sorted(times)
    age = (events[-1].time - events[2].time) / 1e6
    assert events[-1].value == pytest.approx(age)
    assert all(abs(event.value) < 1.5 for event in events[4:-1]), "corrections"
    assert await on.products() == {}
    assert (await on.status())["unloaded"] == 1
    assert witness.worst < 1.5


async def test_it_stops_with_the_head_at_the_end_and_waits_for_the_dwell() -> None:
    on = line(settings={})
    await on.done(ConveyorCommand.START)
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


# ---- commands


async def test_start_and_stop_are_answered_and_told_in_order() -> None:
    on = line()
    await on.fetch()
    assert (await on.order(ConveyorCommand.START)).state is AnswerState.DONE
    on.go(1)
    stop = await on.order(ConveyorCommand.STOP)
    assert stop.state is AnswerState.RUNNING
    on.go(2)
    assert (await on.answer(stop.id)).state is AnswerState.DONE
    assert await on.codes() == [(30, 0), (33, 0), (31, 0)]
    assert (await on.order(ConveyorCommand.STOP)).state is AnswerState.DONE, "always accepted, standing too"


async def test_a_repeated_command_does_nothing_again() -> None:
    on = line()
    first = await on.order(ConveyorCommand.INSERT, real(300.0), real(40.0), id=77)
    assert first.state is AnswerState.DONE
    assert await on.order(ConveyorCommand.INSERT, real(500.0), real(40.0), id=77) == first
    assert list(await on.products()) == [first.detail]


async def test_commands_are_refused_with_their_reason() -> None:
    on = line()
    one = await put(on, 300.0)

    async def reason(code: int, *arguments: int, expected: int = 0) -> int:
        answer = await on.order(code, *arguments, expected=expected)
        assert answer.state is AnswerState.REJECTED
        return answer.reason

    assert await reason(99) == 1
    assert await reason(ConveyorCommand.START, expected=ConveyorState.AUTOMATIC) == 2
    assert await reason(ConveyorCommand.DELETE, 12345) == 7
    assert await reason(ConveyorCommand.CONFIRM, 12345) == 7
    assert await reason(ConveyorCommand.EDIT, 12345, real(100.0), real(20.0)) == 7
    assert await reason(ConveyorCommand.INSERT, real(310.0), real(30.0)) == 8
    two = await put(on, 400.0)
    assert await reason(ConveyorCommand.EDIT, two, real(305.0), real(30.0)) == 8
    assert await reason(ConveyorCommand.INSERT, real(700.0), real(30.0)) == 9
    assert await reason(ConveyorCommand.INSERT, real(10.0), real(30.0)) == 9
    assert await reason(ConveyorCommand.INSERT, real(float("nan")), real(30.0)) == 9
    assert await reason(ConveyorCommand.INSERT, real(100.0), real(float("inf"))) == 11
    assert await reason(ConveyorCommand.INSERT, real(100.0), real(5.0)) == 11
    assert await reason(ConveyorCommand.EDIT, one, real(300.0), real(151.0)) == 11
    small = line(slots=5)
    for n in range(5):
        await put(small, 100.0 + 60 * n)
    assert (await small.order(ConveyorCommand.INSERT, real(600.0), real(30.0))).reason == 10
    assert (await small.status())["buffer_full"] == 1
    await on.done(ConveyorCommand.START)
    on.go(1)
    assert await reason(ConveyorCommand.MANUAL) == 12
    assert await reason(ConveyorCommand.EDIT, one, real(100.0), real(30.0)) == 12
    await on.train(training.REG_MACHINE_FAULT, 50)
    assert await reason(ConveyorCommand.START) == 3
    assert await reason(ConveyorCommand.MANUAL) == 3
    await on.train(training.REG_MACHINE_FAULT, 1)
    await on.done(ConveyorCommand.RESET)
    await on.until(lambda: not on.device.machine.speeds[1])
    await on.done(ConveyorCommand.START)
    await on.until(lambda: on.device.state == ConveyorState.FAULT)
    assert await reason(ConveyorCommand.START) == 4


async def test_records_are_put_edited_confirmed_and_deleted() -> None:
    on = line()
    await on.fetch()
    answer = await on.order(ConveyorCommand.INSERT, real(300.0), real(40.0))
    id = answer.detail
    await on.done(ConveyorCommand.EDIT, id, real(320.0), real(25.5))
    row = (await on.products())[id]
    assert (row["head"], row["tail"], row["length"], row["area"], row["state"]) == (320.0, 294.5, 25.5, 2, 1)
    on.device.power_cycle()
    assert (await on.products())[id]["state"] == 3
    assert (await on.status())["uncertain"] == 1
    await on.done(ConveyorCommand.CONFIRM, 0)
    assert (await on.products())[id]["state"] == 1
    await on.done(ConveyorCommand.DELETE, id)
    assert await on.products() == {}
    assert await on.codes() == [(8, 0), (7, 0), (34, 0), (9, 0), (6, 0)]
    assert on.events[2].snapshot[:2] == (0, id)
    assert real_of(on.events[2].snapshot[4] << 16 | on.events[2].snapshot[5]) == 25.5


# ---- manual


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


async def test_the_gap_stop_names_the_pair_and_the_line_goes_on_by_itself() -> None:
    on = line(settings={**QUICK, "unload_dwell": 3.0})
    await put(on, 655.0)
    front, rear = await put(on, 485.0), await put(on, 425.0)
    witness = Witness(on)
    await on.done(ConveyorCommand.START)
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


# ---- settings


async def test_settings_are_all_or_none_and_act_at_once() -> None:
    on = line()
    await on.done(ConveyorCommand.START)
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


@pytest.mark.parametrize("belt", [1, 2, 3])
@pytest.mark.parametrize("early", [0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0, -0.1, -0.3])
async def test_a_jam_while_the_gap_stops_the_line_is_what_stopped_it_when_the_gap_is_over(
    belt: int, early: float
) -> None:
    """A gap stop that ends by itself is forgotten; what keeps the line standing is not."""

    async def meeting() -> TestLine:
        on = line(settings={**QUICK, "unload_dwell": 3.0})
        for place in (655.0, 485.0, 425.0):
            await put(on, place)
        await on.done(ConveyorCommand.START)
        return on

    on = await meeting()
    begun = on.device.steps
    await on.until_event(20)
    steps = on.device.steps - begun
    on = await meeting()
    on.go(max(0.0, steps / 100 - early))
    await on.train(training.REG_MACHINE_FAULT, belt)
    for _ in range(40):
        on.go(1)
        status = await on.status()
        if status["state"] == ConveyorState.FAULT:
            break
    assert status["state"] == ConveyorState.FAULT
    on.go(25)
    status = await on.status()
    assert status["state"] == ConveyorState.FAULT
    assert (status["first_out"], status["first_out_source"]) == (24, belt)
    jam = next(event for event in await on.fetch() if event.code == 24)
    assert status["first_out_time"] == jam.time


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
    await on.done(ConveyorCommand.START)
    on.go(10)
    assert (23, 0) in await on.codes()
    assert witness.worst < 2, "the belts coasted, the encoders counted"


async def test_a_silent_host_ends_automatic() -> None:
    on = line(settings={**QUICK, "host_timeout": 1.0})
    for beat in range(30):
        await on.port.write(9, [beat + 1], 6)
        on.go(0.1)
        if beat == 5:
            await on.done(ConveyorCommand.START)
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
    await on.done(ConveyorCommand.START)
    on.go(8)
    await on.fetch()
    on.go(8)
    await on.fetch()
    assert witness.worst < 2 and witness.worst_flagged < 2
    assert not [event for event in on.events if event.code in (11, 12)]


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
                await on.done(ConveyorCommand.START)
            seen.append([await on.port.read(0x0100, 96), await on.port.read(0x0800, 124)])
            await on.fetch()
        return [seen, on.events]

    one, two, other = await run(3), await run(3), await run(4)
    assert one == two
    assert one != other


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


def equipment(**options: object) -> Equipment:
    kind = EquipmentType("conveyor", Path("conveyor"), "c", Device(), {}, {}, (), (), {}, (), {})
    return Equipment("c1", kind, "l", 5, {}, "", {}, (), options)


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
