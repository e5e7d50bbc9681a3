"""The instructor's registers: identity, limits, and that the device's own rules do not touch them."""

import pytest

from app.errors import DeviceException
from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.faults import FAULTS
from app.sim.eura_e800.training import LIMITS
from app.sim.training import BASE, END, REG_MACHINE_FAULT, is_training


def step(device: VirtualE800, seconds: float) -> None:
    for _ in range(round(seconds / device.dt)):
        device.step()


def refused(device: VirtualE800, function: int, address: int, *words: int) -> int:
    with pytest.raises(DeviceException) as error:
        device.write(function, address, words)
    return error.value.code


def test_identity_says_simulated() -> None:
    assert VirtualE800().read(3, 0xE000, 4) == [0x5047, 1, 1, 1]


def test_whole_area_comes_in_one_telegram() -> None:
    words = VirtualE800(load=20, quadratic_load=30, disturbance=4).read(3, BASE, END - BASE)
    assert len(words) == 64
    assert words[0x20:0x25] == [20, 30, 4, 25, 230]
    assert words[0x2F:0x31] == [0, 0]


def test_only_training_addresses_are_training() -> None:
    assert [is_training(a) for a in (0x1000, 0xDFFF, 0xE000, 0xE03F, 0xE040)] == [False, False, True, True, False]
    assert [is_training(a) for a in (0xE0FF, 0xE100, 0xE1C8, 0xE1C9)] == [False, True, True, False]
    with pytest.raises(DeviceException) as error:
        VirtualE800().read(3, 0xE100, 1)
    assert error.value.code == 2 and refused(VirtualE800(), 6, 0xE100, 1) == 2


@pytest.mark.parametrize("address", sorted(set(LIMITS) - {0xE030}))
def test_every_register_takes_its_range_and_no_more(address: int) -> None:
    device = VirtualE800()
    for word in LIMITS[address]:
        device.write(6, address, [word])
        device.step()
        assert device.read(3, address, 1) == [word]
    if LIMITS[address][1] < 0xFFFF:
        assert refused(device, 6, address, LIMITS[address][1] + 1) == 3


def test_bad_requests_are_refused_by_code() -> None:
    device = VirtualE800()
    assert refused(device, 6, 0xE000, 1) == 2
    assert refused(device, 6, 0xE02F, 1) == 2
    assert refused(device, 6, 0xE030, 0) == 3
    assert refused(device, 5, 0xE020, 1) == 1
    assert refused(device, 6, 0xE020, 1, 2) == 3
    for bad in (1, 2, 3, 0x1B, 0x100):
        assert refused(device, 6, REG_MACHINE_FAULT, bad) == 3
    for function, address, count, code in ((4, 0xE000, 1, 1), (3, 0xE03F, 2, 2), (3, 0xE000, 0, 3)):
        with pytest.raises(DeviceException) as error:
            device.read(function, address, count)
        assert error.value.code == code


def test_a_block_is_all_or_nothing() -> None:
    device = VirtualE800()
    assert refused(device, 16, 0xE020, 40, 501) == 3
    device.step()
    assert device.read(3, 0xE020, 1) == [15]
    device.write(16, 0xE020, [40, 10, 0])
    device.step()
    assert device.read(3, 0xE020, 3) == [40, 10, 0]


def test_line_fault_is_kept_for_the_bus() -> None:
    device = VirtualE800()
    device.write(16, 0xE012, [250, 4, 3])
    device.write(6, 0xE011, [7])
    assert device.line_fault.mode == 0
    device.step()
    fault = device.line_fault
    assert (fault.mode, fault.delay_ms, fault.argument, fault.count) == (7, 250, 4, 3)
    fault.count -= 1
    assert device.read(3, 0xE011, 4) == [7, 250, 4, 2]


def test_every_status_code_is_a_fault_to_inject() -> None:
    device = VirtualE800()
    for code in FAULTS:
        device.write(6, REG_MACHINE_FAULT, [code])


def test_load_supply_and_ambient_act_on_the_machine() -> None:
    device = VirtualE800(parameters={"F905": 0.0}, start="forward", disturbance=0)
    step(device, 1)
    before = device.read(3, 0x1000, 25)
    device.write(6, 0xE020, [60])
    device.write(6, 0xE024, [250])
    device.write(6, 0xE023, [45])
    step(device, 60)
    after = device.read(3, 0x1000, 25)
    assert after[2] > before[2]
    assert after[6] >= before[6] + 35
    assert after[0x17] < before[0x17]
    assert after[4] > before[4] + 15
    assert after[7] > before[7] + 2


def test_reset_returns_to_the_initial_state_and_repeats_from_there() -> None:
    device, fresh = VirtualE800(seed=9, start="forward"), VirtualE800(seed=9, start="forward")
    step(device, 3)
    device.write(6, 0xE011, [1])
    device.write(6, 0x0101 + 13, [77])
    device.write(6, REG_MACHINE_FAULT, [0x0D])
    step(device, 1)
    assert device.status == 0x0D
    device.write(6, 0xE030, [1])
    device.step()
    fresh.step()
    for _ in range(300):
        assert device.read(3, 0x1000, 25) == fresh.read(3, 0x1000, 25)
        assert device.motor.speed == fresh.motor.speed
        device.step()
        fresh.step()
    assert device.line_fault.mode == 0
