"""Every register of the map is served as it stands there."""

import pytest

from app.sim.sinamics import registers
from app.sim.sinamics.drive import VirtualSinamics
from tests.sim.sinamics.stand import at, code_of, step, value


@pytest.mark.parametrize("number", registers.REGISTERS)
def test_every_register_is_read_and_is_written_only_if_it_may(number: int) -> None:
    drive, register = VirtualSinamics(), registers.REGISTERS[number]
    assert len(drive.read(3, at(number), 1)) == 1
    if not register.writable:
        assert code_of(lambda: drive.write(6, at(number), [0])) == 4
        assert value(drive, registers.ACCESS_ERROR) == 1
        return
    for bound in (register.low, register.high):
        drive.write(6, at(number), [register.encode(bound)])
        step(drive, 0.01)
        assert value(drive, number) == pytest.approx(bound)
        assert drive.parameter(register.parameter) == pytest.approx(bound)
    beyond = round(register.high * register.factor) + 1
    if beyond <= (0x7FFF if register.low < 0 else 0xFFFF):
        assert code_of(lambda: drive.write(16, at(number), [beyond])) == 3
        assert value(drive, registers.ACCESS_ERROR) == 2
