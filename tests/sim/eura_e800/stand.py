"""A virtual E800 on the table: without watchdog and disturbance, operated by telegrams."""

from collections.abc import Callable

import pytest

from app.errors import DeviceException
from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.parameters import PARAMETERS

QUIET = {"F905": 0.0}


FORWARD, REVERSE, STOP, COAST, JOG, JOG_STOP, RUN, RESET = 1, 2, 3, 4, 5, 6, 8, 9


def drive(**parameters: float) -> VirtualE800:
    """A drive without watchdog and disturbance."""
    return VirtualE800(parameters=QUIET | parameters, disturbance=0)


def go(device: VirtualE800, seconds: float) -> VirtualE800:
    for _ in range(round(seconds / device.dt)):
        device.step()
    return device


def command(device: VirtualE800, code: int, seconds: float = 0.01) -> VirtualE800:
    device.write(6, 0x2000, [code])
    return go(device, seconds)


def inject(device: VirtualE800, code: int) -> None:
    device.write(6, 0xE010, [code])


def image(device: VirtualE800) -> list[int]:
    return device.read(3, 0x1000, 25)


def faulted() -> VirtualE800:
    device = command(drive(), FORWARD, 6)
    inject(device, 0x0D)
    return go(device, 0.02)


def until(device: VirtualE800, holds: Callable[[], bool], limit: float = 30.0) -> float:
    """Simulated time until `holds` [s]."""
    for count in range(round(limit / device.dt)):
        if holds():
            return count * device.dt
        device.step()
    raise AssertionError(f"not within {limit} s")


def put(device: VirtualE800, code: str, value: float) -> None:
    device.write(6, PARAMETERS[code].address, [PARAMETERS[code].encode(value)])


def refusal(call: Callable[[], object]) -> int:
    """Exception code with which `call` is refused."""
    with pytest.raises(DeviceException) as error:
        call()
    return error.value.code
