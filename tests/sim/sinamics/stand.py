"""A virtual SINAMICS on the table, operated by telegrams."""

from collections.abc import Callable

import pytest

from app.errors import DeviceException
from app.profidrive.state_machine import State
from app.profidrive.words import ENABLES, RUN
from app.sim.sinamics import registers
from app.sim.sinamics.drive import VirtualSinamics

HALF = 0x2000


def at(number: int) -> int:
    return number - registers.FIRST_NUMBER


def step(drive: VirtualSinamics, seconds: float, *, silent: bool = False) -> None:
    """Time passes; the control reads the status as a real one does."""
    for _ in range(round(seconds / drive.dt)):
        if not silent:
            drive.read(3, at(registers.STATUS), 2)
        drive.step()


def command(drive: VirtualSinamics, word: int, setpoint: int | None = None) -> None:
    drive.write(16, at(registers.CONTROL), [word] if setpoint is None else [word, setpoint & 0xFFFF])
    step(drive, 0.05)


def running(word: int = RUN, setpoint: int = HALF, **options: float) -> VirtualSinamics:
    drive = VirtualSinamics(disturbance=0, **options)  # type: ignore[arg-type]
    command(drive, ENABLES, setpoint)
    command(drive, word)
    step(drive, 8)
    assert drive.state is State.OPERATION
    return drive


def value(drive: VirtualSinamics, number: int) -> float:
    return registers.REGISTERS[number].decode(drive.read(3, at(number), 1)[0])


def code_of(deed: Callable[[], object]) -> int:
    with pytest.raises(DeviceException) as error:
        deed()
    return error.value.code
