"""When the virtual drive trips, and when a trip can be reset."""

import pytest

from app.sim.eura_e800.faults import FAULTS, OH
from tests.sim.eura_e800.stand import FORWARD, RESET, command, drive, go, image, inject, refusal, until


@pytest.mark.sweep(8)
@pytest.mark.parametrize("running", [True, False], ids=["running", "standing"])
@pytest.mark.parametrize("code", FAULTS, ids=[name for name, _ in FAULTS.values()])
def test_fault_trips_refuses_the_reset_and_clears_when_its_cause_is_gone(code: int, running: bool) -> None:
    device = command(drive(), FORWARD, 6) if running else go(drive(), 0.1)
    inject(device, code)
    until(device, lambda: device.fault != 0, 70)
    words = image(device)
    assert device.fault == code
    assert words[5] & 0xFF == code
    assert (words[0], words[1], words[2], words[0x17], words[0x18]) == (0, 0, 0, 0, 0)
    assert words[0x0C] == 4
    assert refusal(lambda: device.write(6, 0x2000, [RESET])) == 4
    assert refusal(lambda: device.write(6, 0x2001, [1])) == 4
    command(device, FORWARD, 1)
    assert device.status == code
    inject(device, 0)
    go(device, 30)
    assert device.status == code
    command(device, RESET, 2)
    assert device.status == 0
    assert command(device, FORWARD, 1).status == 1


def test_supply_too_low_or_too_high_trips() -> None:
    for volts, code in ((120, 0x08), (290, 0x05)):
        device = go(drive(), 0.1)
        device.write(6, 0xE024, [volts])
        until(device, lambda device=device: device.fault != 0, 5)
        assert device.fault == code
        assert refusal(lambda device=device: device.write(6, 0x2000, [RESET])) == 4
        device.write(6, 0xE024, [230])
        go(device, 3)
        assert command(device, RESET).status == 0


def test_overheated_drive_has_to_cool_before_the_reset() -> None:
    device = command(drive(), FORWARD, 6)
    inject(device, OH)
    until(device, lambda: device.fault != 0, 70)
    inject(device, 0)
    go(device, 1)
    assert refusal(lambda: device.write(6, 0x2000, [RESET])) == 4
    go(device, 30)
    assert command(device, RESET).status == 0
