"""The communication watchdog of the virtual drive (F905)."""

import pytest

from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.faults import CE
from tests.sim.eura_e800.stand import FORWARD, RESET, command, go, until


def test_silence_longer_than_f905_trips_and_coasts() -> None:
    device = VirtualE800(parameters={"F905": 1.0})
    device.telegram_seen()
    command(device, FORWARD, 0.99)
    assert device.status == 1
    assert until(device, lambda: device.fault != 0, 1) == pytest.approx(0.02, abs=0.011)
    assert device.fault == CE
    assert device.frequency == 0
    device.telegram_seen()
    assert command(device, RESET).status == 0


def test_telegrams_feed_the_watchdog() -> None:
    device = VirtualE800(parameters={"F905": 1.0})
    command(device, FORWARD)
    for _ in range(30):
        device.telegram_seen()
        go(device, 0.9)
    assert device.status == 1


def test_training_registers_do_not_feed_it() -> None:
    device = VirtualE800(parameters={"F905": 1.0})
    device.telegram_seen()
    command(device, FORWARD)
    for _ in range(20):
        device.read(3, 0xE000, 4)
        device.write(6, 0xE020, [20])
        go(device, 0.1)
    assert device.fault == CE


@pytest.mark.parametrize("case", ["switched off", "never heard", "standing"])
def test_silence_that_does_not_trip(case: str) -> None:
    device = VirtualE800(parameters={"F905": 0.0 if case == "switched off" else 1.0})
    if case != "never heard":
        device.telegram_seen()
    if case != "standing":
        device.write(6, 0x2000, [FORWARD])
    go(device, 20)
    assert device.fault == 0
