"""What an instructor does to the line."""

import pytest

from app.sim import training
from app.sim.conveyor import training as own
from tests.sim.conveyor.bench import line, put, running


async def test_a_sensor_pressed_by_hand_moves_nothing_and_is_told_when_it_fits_nothing() -> None:
    on = line()
    id = await put(on, 300.0)
    await on.train(own.REG_SENSORS, 0b0010)
    on.go(0.5)
    await on.train(own.REG_SENSORS, 0)
    assert (await on.products())[id]["head"] == 300
    await on.start()
    on.go(0.5)
    await on.fetch()
    await on.train(own.REG_SENSORS, 0b1000)
    on.go(0.1)
    await on.train(own.REG_SENSORS, 0)
    assert (12, 4) in await on.codes()


@pytest.mark.sweep(8)
async def test_a_reset_of_the_instructor_forgets_everything() -> None:
    on = running(seed=4)
    on.go(15)
    await on.set(automatic_speed=20.0)
    await on.train(training.REG_MACHINE_FAULT, 31)
    on.go(1)
    await on.train(training.REG_RESET, 1)
    assert (await on.status())["boots"] == 1
    fresh = running(seed=4)
    fresh.step()
    for _ in range(20):
        assert await on.port.read(0x0100, 96) == await fresh.port.read(0x0100, 96)
        assert await on.products() == await fresh.products()
        assert [product.head for product in on.true()] == [product.head for product in fresh.true()]
        on.go(1)
        fresh.go(1)
