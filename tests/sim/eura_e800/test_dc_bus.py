"""The DC bus of the virtual drive."""

from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.faults import OE
from tests.sim.eura_e800.stand import FORWARD, QUIET, STOP, command, drive, go, until


def test_braking_too_fast_raises_the_bus_until_it_trips() -> None:
    device = VirtualE800(parameters=QUIET | {"F115": 0.3}, inertia_ratio=40, disturbance=0, load=0, quadratic_load=0)
    command(device, FORWARD, 12)
    assert device.status == 1
    before = device.bus_voltage
    device.write(6, 0x2000, [STOP])
    until(device, lambda: device.fault != 0, 2)
    assert device.fault == OE
    assert device.bus_voltage > before + 60


def test_bus_falls_under_load_and_rises_in_braking() -> None:
    device = go(drive(F115=0.8), 1)
    standing = device.bus_voltage
    command(device, FORWARD, 8)
    running = device.bus_voltage
    assert running < standing - 3
    device.write(6, 0x2000, [STOP])
    highest = 0.0
    for _ in range(80):
        device.step()
        highest = max(highest, device.bus_voltage)
    assert device.fault == 0
    assert highest > standing + 3
