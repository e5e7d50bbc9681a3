"""Lines of one to sixteen belts and one to thirty-two sensors: what their PLC shows, and products over lines of any build."""

import math

import pytest

from app.blocks.product_tracking import Code
from app.plant import types
from app.registers.codec import decode
from app.sim import training
from app.sim.conveyor.machine import MOST_BELTS, Geometry, fault_names
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import ConveyorCommand, ConveyorEvent, ConveyorState, Motor
from tests.sim.conveyor.bench import QUICK
from tests.sim.conveyor.layouts import LONGEST, NEAR, SHORTEST, Run, layout, run
from tests.sim.conveyor.line import TestLine
from tests.sim.conveyor.test_soak import PUT, REMOVED, Soak
from tests.sim.conveyor.test_soak import QUICK as SOAKED


def wide(belts: int, sensors: int, **options: object) -> VirtualConveyor:
    """A line of belts of 200 mm, its sensors spread evenly, the last one on the last belt."""
    length = 200.0 * belts
    places = tuple(round(60 + (length - 120) * n / max(1, sensors - 1), 1) for n in range(sensors))
    geometry = Geometry(
        tuple(200.0 * (n + 1) for n in range(belts)), places, shares=tuple(60.0 + 2 * n for n in range(belts))
    )
    return VirtualConveyor(geometry, arrivals=False, settings=QUICK, **options)  # type: ignore[arg-type]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("belts", "sensors"), [(1, 1), (2, 3), (4, 5), (11, 20), (16, 32)])
def test_the_map_of_a_line_of_any_build_says_what_it_is(belts: int, sensors: int) -> None:
    plc = wide(belts, sensors, start="automatic")
    for _ in range(250):
        plc.step()
    plc.machine.fault = fault_names(belts, sensors)[f"stuck_{sensors}"]
    plc.step()
    data, problems = types.read_type("conveyor", ["en"], given={"belts": belts, "sensors": sensors})
    assert problems == []
    kind = data.type

    def value(key: str) -> float:
        register = kind.points[key].register
        assert register
        found = decode(register, plc.read(3, register.address, register.words))
        assert isinstance(found, int | float), key
        return found

    assert kind.device.plc
    for image in kind.device.plc.images:
        words = plc.read(3, image.address, image.words)
        assert words[0] == words[-1] and words[0] % 2 == 0, hex(image.address)
    assert (value("device_belts"), value("device_sensors"), value("device_areas")) == (belts, sensors, belts + 1)
    for n in range(1, belts + 1):
        assert value(f"belt_end_{n}") == 200 * n
        assert value(f"speed_setpoint_{n}") == pytest.approx(QUICK["automatic_speed"] * (58 + 2 * n) / 100)
        assert value(f"speed_{n}") == pytest.approx(value(f"speed_setpoint_{n}"), abs=0.8)
        assert value(f"encoder_{n}") == plc.machine.pulses[n - 1] > 0
        assert value(f"motor_{n}") == Motor.FORWARD
        if f"device_belt_{n}_share" in kind.points:
            assert value(f"device_belt_{n}_share") == 58 + 2 * n
    for n in range(1, sensors + 1):
        assert value(f"sensor_position_{n}") == pytest.approx(plc.geometry.sensors[n - 1])
        assert value(f"beam_{n}") == (n == sensors)
        assert value(f"input_{n}") == (n != sensors), "an intact beam reads 1"
    assert [value(f"area_end_{n}") for n in range(1, belts + 2)] == pytest.approx(plc.geometry.area_ends)
    assert not any(math.isnan(value(key)) for key in kind.points if key.endswith("_end_1"))


@pytest.mark.sweep(8)
@pytest.mark.parametrize("belts", [1, 5, 16])
async def test_the_last_belt_moves_alone_by_hand_and_its_jam_is_told(belts: int) -> None:
    on = TestLine(wide(belts, 3))
    kind = types.read_type("conveyor", ["en"], given={"belts": belts, "sensors": 3})[0].type
    await on.done(ConveyorCommand.MANUAL)
    await on.hold(kind.commands[f"jog_forward_{belts}"].hold_bits, 1.0, 20.0)
    assert [pulses > 0 for pulses in on.device.machine.pulses] == [n == belts for n in range(1, belts + 1)]
    await on.hold(kind.commands["jog_reverse"].hold_bits, 1.0, 20.0)
    assert all(speed < 0 for speed in on.device.machine.speeds)
    await on.stand()
    await on.train(training.REG_MACHINE_FAULT, kind.training.faults[f"jam_{belts}"])
    await on.hold(kind.commands["jog_forward"].hold_bits, 2.0, 20.0)
    await on.until_event(ConveyorEvent.JAM, belts)
    assert (on.device.first_out.first.code, on.device.first_out.first.source) == (ConveyorEvent.JAM, belts)


# belts and sensors: the ends of what may be built, one line between
BUILDS = [(1, 1), (1, 9), (2, 1), (3, 32), (9, 20), (16, 32)]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("belts", "sensors"), BUILDS)
def test_products_keep_their_order_their_place_and_their_length_on_any_line(belts: int, sensors: int) -> None:
    """The soak runs ten thousand of them over many lines."""
    judge(run(layout(belts + sensors, belts=belts, sensors=sensors), sensors, 12 if belts < MOST_BELTS else 4))


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(100, 120))
def test_ten_thousand_products_over_lines_of_any_build(seed: int) -> None:
    """Half a thousand over each of twenty lines: of each number of belts, and of as many sensors as chance has it."""
    judge(run(layout(seed, belts=1 + seed % MOST_BELTS), seed, 500))


def by_hand(seed: int, belts: int, goal: int) -> Soak:
    """Products are taken off a line of any build, and put on it, while it runs."""
    length = layout(seed, belts=belts).length
    geometry = layout(seed, belts=belts, sensors=max(2, round(length / 250)))
    line = TestLine(VirtualConveyor(geometry, seed=seed, interval=3.0, slots=60, settings=SOAKED))
    return Soak(line, seed=seed, goal=goal, happens=(REMOVED, PUT))


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("seed", "belts"), [(1, 1), (3, 6)])
async def test_what_a_hand_takes_off_any_line_or_puts_on_it_is_told(seed: int, belts: int) -> None:
    soak = by_hand(seed, belts, 12)
    await soak.run()
    soak.settle()


@pytest.mark.soak
@pytest.mark.parametrize("belts", range(2, MOST_BELTS + 1))
async def test_ten_thousand_products_with_hands_on_lines_of_any_build(belts: int) -> None:
    """Six hundred and seventy over each of fifteen lines; one belt alone has hardly room for a hand."""
    soak = by_hand(200 + belts, belts, 670)
    await soak.run()
    soak.settle()


def judge(done: Run) -> None:
    """Nothing was lost, doubled or met; what was measured is as long as what came."""
    plc, machine, follow = done.plc, done.plc.machine, done.plc.tracking
    assert (machine.fallen, machine.backed_out, machine.removed) == (0, 0, 0)
    assert (follow.lost, follow.found, follow.refused) == (0, 0, 0)
    assert machine.collisions == 0, "the gap supervision keeps them apart"
    assert follow.unloaded == machine.unloaded
    assert follow.entered == follow.unloaded + len(follow.products)
    assert [event.id for event in done.codes(Code.UNLOADED)] == [n + 1 for n in range(follow.unloaded)]
    measured = [event.value for event in done.codes(Code.IDENTIFIED)]
    assert all(SHORTEST - NEAR < length < LONGEST + NEAR for length in measured)
    for product in follow.products:
        true = min(machine.products, key=lambda one: abs(one.head - product.right))
        if product.length_known and product.open_at < 0:
            assert abs(product.length - true.length) < 1.0 + 0.01 * true.length
    assert plc.state in (ConveyorState.AUTOMATIC, ConveyorState.WAITING, ConveyorState.GAP)
