"""Products, sensors, the infeed and the unloader as the instructor changes them."""

import pytest

from app.sim import training
from app.sim.conveyor import training as own
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.register_map import (
    ConveyorCommand,
    ConveyorState,
)
from tests.sim.conveyor.bench import QUICK, line, put, running
from tests.sim.conveyor.line import Operator, Witness


@pytest.mark.sweep(8)
@pytest.mark.parametrize("sensor", [2, 3, 4])
async def test_a_blind_sensor_loses_products_and_is_suspected(sensor: int) -> None:
    on = running()
    on.go(8)
    await on.fetch()
    await on.train(training.REG_MACHINE_FAULT, 20 + sensor)
    lost = await on.until_event(11, sensor)
    position = Geometry().sensors[sensor - 1]
    assert lost.value == pytest.approx(position + 10, abs=1), "lost_after past it"
    assert (await on.products())[lost.snapshot[1]]["state"] == 5
    assert (await on.status())["lost_present"] == 1
    if sensor == 4:
        await on.until(lambda: on.device.tracking.brake and not on.device.machine.speeds[2])
        on.go(5)
        assert on.true()[0].head == pytest.approx(660, abs=2), "it waits at the end for a person"
        assert (await on.products())[lost.snapshot[1]]["state"] == 5
        await on.done(ConveyorCommand.CONFIRM, lost.snapshot[1])
    suspected = await on.until_event(28, sensor)
    assert suspected.value == 1
    await on.train(training.REG_MACHINE_FAULT, 0)
    await Operator(on).recover()
    on.go(5)
    await on.until_event(29, sensor)
    await on.fetch()
    assert on.device.state in (ConveyorState.AUTOMATIC, ConveyorState.WAITING, ConveyorState.GAP)


async def test_a_blind_first_sensor_shows_at_the_second() -> None:
    on = running()
    on.go(8)
    await on.fetch()
    await on.train(training.REG_MACHINE_FAULT, 21)
    await on.until_event(12, 2)
    suspected = await on.until_event(28, 1)
    assert suspected.value == 1
    await on.train(training.REG_MACHINE_FAULT, 0)
    await Operator(on).recover()
    await on.until_event(29, 1)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("sensor", [1, 2, 3, 4])
async def test_a_stuck_sensor_is_suspected_and_the_line_recovers(sensor: int) -> None:
    on = running()
    on.go(8)
    await on.fetch()
    await on.train(training.REG_MACHINE_FAULT, 30 + sensor)
    assert await on.get(f"beam_{sensor}") == 1
    suspected = await on.until_event(28, sensor)
    assert suspected.value == 2
    await on.train(training.REG_MACHINE_FAULT, 0)
    await Operator(on).recover()
    await on.until_event(29, sensor)
    witness = Witness(on)
    on.go(10)
    assert witness.worst < 2


async def test_a_product_taken_away_is_lost_and_one_put_is_unexpected() -> None:
    on = line()
    await on.start()
    on.device.machine.place(40.0, 30.0)
    await on.until(lambda: on.device.tracking.entered == 1 and on.true()[0].tail > 140)
    await on.train(own.REG_REMOVE, 1)
    assert on.true() == []
    lost = await on.until_event(11, 2)
    assert lost.snapshot[1] == 1
    await on.train(own.REG_PUT, 380)
    found = await on.until_event(12, 3)
    assert found.snapshot[1] == 2
    assert (await on.products())[2]["state"] in (2, 3)
    await on.until_event(5)
    status = await on.status()
    assert (status["lost"], status["unexpected"], status["unloaded"]) == (1, 1, 1)
    await on.done(ConveyorCommand.DELETE, 1)
    assert (await on.status())["lost_present"] == 0


async def test_one_put_across_two_belts_keeps_its_record_while_the_last_belt_unloads() -> None:
    on = line(settings={**QUICK, "unload_dwell": 2.0})
    first = await put(on, 640.0)
    await on.start()
    await on.until(lambda: on.device.tracking.brake and not on.device.machine.speeds[2])
    assert on.device.machine.place(443.0, 25.0)
    found = await on.until_event(12, 3)
    second = found.snapshot[1]
    assert second != first and on.device.machine.speeds[2] == 0
    on.go(1)
    assert on.device.machine.products[1].tail < 445, "it hangs between a belt that runs and one that stands"
    assert (await on.until_event(5)).snapshot[1] == first
    assert (await on.until_event(5)).snapshot[1] == second
    on.go(0.1)
    assert on.true() == []
    assert 15 not in [event.code for event in on.events], "never withdrawn"
    assert {event.snapshot[1] for event in on.events if event.code == 12} == {second}, "never taken for another one"
    assert (await on.status())["lost"] == 0


async def test_an_empty_grip_of_the_unloader_is_told() -> None:
    on = line()
    await on.start()
    on.device.machine.place(40.0, 30.0)
    await on.until(lambda: bool(on.true()) and on.true()[0].tail > 570, 60)
    await on.train(own.REG_REMOVE, 1)
    lost = await on.until_event(11, 0)
    assert lost.snapshot[1] == 1
    status = await on.status()
    assert (status["lost"], status["unloaded"], status["products"]) == (1, 0, 0)


async def test_the_unloader_does_not_reach_the_next_one_when_the_one_it_was_told_to_take_is_gone() -> None:
    on = line(settings={**QUICK, "unload_dwell": 1.0})
    first, second = await put(on, 650.0, 20.0), await put(on, 630.0, 20.0)
    await on.start()
    await on.until(lambda: on.device.tracking.brake and not on.device.machine.speeds[2])
    assert (await on.products())[first]["state"] == 6
    await on.train(own.REG_REMOVE, 1)
    lost = await on.until_event(11, 0)
    assert lost.snapshot[1] == first
    assert [product.by_hand for product in on.true()] == [True], "the second one is still there"
    await on.until_event(5)
    on.go(0.1)
    assert on.true() == []
    status = await on.status()
    assert (status["lost"], status["unloaded"], status["products"]) == (1, 1, 0)
    told = [(event.code, event.snapshot[1]) for event in on.events if event.code in (5, 11)]
    assert told == [(5, first), (11, first), (5, second)]


@pytest.mark.sweep(8)
async def test_a_full_buffer_holds_the_infeed_and_loses_nothing() -> None:
    on = running(slots=5, settings={**QUICK, "unload_dwell": 8.0}, interval=2.0)
    witness = Witness(on)
    full = False
    for _ in range(60):
        on.go(2)
        full |= (await on.status())["buffer_full"] == 1
        await on.fetch()
    assert full
    codes = {event.code for event in on.events}
    assert 13 in codes and not codes & {11, 12}
    assert on.device.tracking.refused == 0
    assert witness.worst < 2
