"""What cannot be is noticed: jams, dead encoders, blind and stuck sensors."""

import pytest

from app.sim import training
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.register_map import (
    ConveyorCommand,
    ConveyorEvent,
    ConveyorState,
    Motor,
)
from tests.sim.conveyor.bench import QUICK, SIMULATION, TOLERANCE, line, running
from tests.sim.conveyor.line import Operator, Witness


@pytest.mark.sweep(8)
@pytest.mark.parametrize("belt", [1, 2, 3])
async def test_a_jam_stops_the_line_and_is_over_after_reset_and_start(belt: int) -> None:
    on = running()
    witness = Witness(on)
    on.go(11)
    await on.fetch()
    await on.until(lambda: all(speed == 60 for speed in on.device.machine.speeds))
    before = on.device.steps
    await on.train(training.REG_MACHINE_FAULT, belt)
    await on.until(lambda: on.device.state == ConveyorState.FAULT, 2)
    assert (on.device.steps - before) / 100 == pytest.approx(0.51, abs=0.03)
    on.go(1)
    status = await on.status()
    assert (status[f"jam_{belt}"], status[f"motor_{belt}"], status["automatic"]) == (1, Motor.JAMMED, 0)
    assert (status["first_out"], status["first_out_source"]) == (24, belt)
    assert on.device.machine.speeds == [0, 0, 0]
    told = await on.fetch()
    jam = next(event for event in told if event.code == 24)
    assert (jam.source, jam.value) == (belt, 60)
    assert [event.code for event in told if event.time == jam.time] == [24, 31], "cause before consequence"
    await on.done(ConveyorCommand.RESET)
    await on.start()
    await on.until(lambda: on.device.state == ConveyorState.FAULT, 3), "the cause is still there"
    await on.train(training.REG_MACHINE_FAULT, 0)
    on.go(1)
    await on.done(ConveyorCommand.RESET)
    assert (await on.status())["first_out"] == 0
    await on.start()
    on.go(10)
    assert (25, belt) in await on.codes()
    assert await on.get("state") in (ConveyorState.AUTOMATIC, ConveyorState.WAITING, ConveyorState.GAP)
    assert witness.worst < 2


@pytest.mark.parametrize(("belt", "doubted"), [(1, {1}), (2, {1, 3}), (3, {3})])
async def test_a_jam_leaves_uncertain_what_lies_on_its_belt_and_another_one(belt: int, doubted: set[int]) -> None:
    on = running()
    ends = on.device.geometry.belt_ends

    def lying() -> dict[int, list[int]]:
        """What is well known and measured, by where it lies: 0, 2, 4 whole on belt 1, 2, 3; 1, 3 across the ends between them."""
        found: dict[int, list[int]] = {place: [] for place in range(5)}
        for product in on.device.tracking.products:
            if product.state == 1 and product.length:
                first, last = (sum(end < x for end in ends) for x in (product.left, product.right))
                found[first + last].append(product.id)
        return found

    await on.until(lambda: {place for place, ids in lying().items() if ids} >= {1, 2, 3}, 300)
    await on.train(training.REG_MACHINE_FAULT, belt)
    while on.device.state != ConveyorState.FAULT:
        before = lying()
        on.step()
    assert set().union(*(before[place] for place in doubted)), "something lies across"
    states = {id: row["state"] for id, row in (await on.products()).items()}
    for place, ids in before.items():
        for id in ids:
            assert states[id] == (3 if place in doubted else 1), f"product {id} on {place}, jam of belt {belt}"
    await on.train(training.REG_MACHINE_FAULT, 0)
    await on.stand()
    await on.done(ConveyorCommand.RESET)
    await on.start()
    in_doubt = {id for place in doubted for id in before[place]}
    for _ in range(300):
        in_doubt = {id for id, row in (await on.products()).items() if id in in_doubt and row["state"] == 3}
        if not in_doubt:
            break
        on.step(10)
    assert not in_doubt, "the next sensor has made them certain, or they are unloaded"


async def test_stops_in_between_do_not_hide_a_jam() -> None:
    on = line(settings={**QUICK, "jam_time": 1.0})
    await on.train(training.REG_MACHINE_FAULT, 3)
    starts = 0
    while on.device.state != ConveyorState.FAULT:
        starts += 1
        assert starts < 8, "each start is shorter than the jam time, all of them together are not"
        await on.start()
        on.go(0.3)
        await on.stand()
    assert starts > 1
    assert (24, 3) in await on.codes()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("belt", [1, 2, 3])
async def test_a_dead_encoder_is_no_jam_and_makes_positions_uncertain(belt: int) -> None:
    on = running()
    witness = Witness(on)
    on.go(11)
    await on.until(lambda: all(speed == 60 for speed in on.device.machine.speeds))
    await on.fetch()
    await on.train(training.REG_MACHINE_FAULT, 40 + belt)
    failed = await on.until_event(ConveyorEvent.ENCODER, belt, 5)
    on.go(1)
    status = await on.status()
    assert (status[f"encoder_fault_{belt}"], status[f"jam_{belt}"]) == (1, 0)
    assert status["state"] == ConveyorState.FAULT and status["first_out"] == 26
    begin, end = (0.0, *Geometry().belt_ends)[belt - 1 : belt + 1]
    on_it = [row for row in (await on.products()).values() if row["tail"] < end and row["head"] > begin]
    assert all(row["state"] in (2, 3) for row in on_it)
    assert failed.value == 60
    assert witness.worst < TOLERANCE, "before it was noticed"
    await on.train(training.REG_MACHINE_FAULT, 0)
    await Operator(on).recover()
    witness.worst = 0.0
    on.go(10)
    assert (27, belt) in await on.codes()
    assert witness.worst < 2


@pytest.mark.sweep(8)
@pytest.mark.parametrize("speed", [10.0, 30.0, 37.0, 50.0, 80.0, 100.0])
async def test_one_pulse_more_or_less_is_no_other_speed(speed: float) -> None:
    for geometry in (Geometry(), SIMULATION):
        on = line(geometry=geometry, settings={**QUICK, "automatic_speed": speed})
        await on.start()
        on.go(3.0)
        shown = []
        for _ in range(40):
            on.go(0.05)
            shown.append((await on.status())["speed_1"])
        assert max(shown) - min(shown) < 0.5, "the dead-band of the point"
        assert sum(shown) / len(shown) == pytest.approx(speed, abs=0.41)
