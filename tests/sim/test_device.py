"""Every virtual device keeps the contract of its bus: writes act at the step border, reads change nothing, training is always there."""

from pathlib import Path

import pytest

from app.errors import DeviceException
from app.plant.loader import read_plant
from app.sim.device import BUSY, DT, MOST_WAITING, VirtualDevice
from app.sim.machines import VIRTUAL_DEVICES
from app.sim.training import BASE, MAGIC, REG_LINE_DELAY

ITEMS = {
    item.type.name: item
    for name in ("demo", "crane", "sinamics", "epos")
    if (plant := read_plant(Path("plants") / name)[0])
    for item in plant.equipment.values()
}


@pytest.fixture(params=ITEMS)
def device(request: pytest.FixtureRequest) -> VirtualDevice:
    return VIRTUAL_DEVICES[request.param](ITEMS[request.param], 1)


def test_every_machine_that_can_be_simulated_is_in_a_plant_of_ours() -> None:
    assert set(ITEMS) == set(VIRTUAL_DEVICES)


def test_it_says_that_it_is_simulated_and_steps_by_ten_milliseconds(device: VirtualDevice) -> None:
    assert device.dt == DT and device.read(3, BASE, 2) == [MAGIC, 1]


def test_a_write_acts_at_the_step_border_and_not_before(device: VirtualDevice) -> None:
    device.write(6, REG_LINE_DELAY, [700])
    assert device.line_fault.delay_ms == 0
    device.step()
    assert device.line_fault.delay_ms == 700


@pytest.mark.parametrize(("function", "address"), [(1, 0x1000), (3, 0xEFFF), (4, BASE)])
def test_what_it_does_not_have_is_an_exception_of_modbus(device: VirtualDevice, function: int, address: int) -> None:
    with pytest.raises(DeviceException) as refused:
        device.read(function, address, 1)
    assert refused.value.code in (1, 2)


def test_a_refused_write_leaves_nothing_behind(device: VirtualDevice) -> None:
    with pytest.raises(DeviceException):
        device.write(16, REG_LINE_DELAY, [500, 999, 0])
    device.step()
    assert device.line_fault.delay_ms == 0


def test_one_that_stands_still_keeps_so_many_writes_and_no_more(device: VirtualDevice) -> None:
    """A plant may be paused for a night, with a client that goes on writing; what was taken acts, and then there is room again."""
    with pytest.raises(DeviceException) as refused:
        for number in range(2 * MOST_WAITING):
            device.write(6, REG_LINE_DELAY, [number % 1000])
    assert (refused.value.code, number) == (BUSY, MOST_WAITING)
    device.step()
    assert device.line_fault.delay_ms == (MOST_WAITING - 1) % 1000
    device.write(6, REG_LINE_DELAY, [700])
    device.step()
    assert device.line_fault.delay_ms == 700
