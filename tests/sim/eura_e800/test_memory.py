"""RAM and EEPROM of the virtual drive."""

from tests.sim.eura_e800.stand import drive, go, put, refusal


def test_two_writes_in_one_step_are_judged_together() -> None:
    device = drive(F113=40.0)
    put(device, "F113", 20.0)
    assert refusal(lambda: put(device, "F112", 30.0)) == 3
    device.step()
    assert (device.parameter("F112"), device.parameter("F113")) == (0.5, 20.0)


def test_ram_only_writes_are_gone_after_power_off() -> None:
    device = drive()
    put(device, "F114", 8.0)
    go(device, 0.02)
    assert device.memory.eeprom_writes == 1
    device.write(6, 0x2001, [4])
    put(device, "F114", 9.0)
    go(device, 0.02)
    assert (device.parameter("F114"), device.memory.eeprom_writes) == (9.0, 1)
    device.power_cycle()
    assert device.parameter("F114") == 8.0
    assert device.memory.eeprom_enabled
    device.write(6, 0x2001, [4])
    device.write(6, 0x2001, [3])
    put(device, "F114", 7.0)
    go(device, 0.02)
    device.power_cycle()
    assert device.parameter("F114") == 7.0


def test_line_settings_wait_for_power_up() -> None:
    device = drive()
    before = device.communication
    assert before == (1, 2, 1, 2, 3)
    put(device, "F900", 17)
    put(device, "F904", 5)
    go(device, 0.1)
    assert device.parameter("F900") == 17
    assert device.communication == before
    device.power_cycle()
    assert device.communication == (17, 2, 1, 2, 5)
