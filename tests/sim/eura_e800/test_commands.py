"""Commands of the virtual drive in every state, its lock, and its sources of start and stop."""

from collections.abc import Callable

import pytest

from app.errors import DeviceException
from app.sim.eura_e800.drive import VirtualE800
from tests.sim.eura_e800.stand import (
    COAST,
    FORWARD,
    JOG,
    JOG_STOP,
    RESET,
    REVERSE,
    RUN,
    STOP,
    command,
    drive,
    faulted,
    go,
    image,
    inject,
)

STATES: dict[str, Callable[[], VirtualE800]] = {
    "stopped": lambda: go(drive(), 0.1),
    "forward": lambda: command(drive(), FORWARD, 6),
    "reverse": lambda: command(drive(), REVERSE, 6),
    "stopping": lambda: command(command(drive(), FORWARD, 6), STOP, 1),
    "jogging": lambda: command(drive(), JOG, 2),
    "coasting": lambda: command(command(drive(), FORWARD, 6), COAST, 0.02),
    "fault": lambda: go(faulted(), 0.1),
    "locked": lambda: locked(command(drive(), FORWARD, 6)),
    "deaf": lambda: command(drive(F200=1, F201=1), FORWARD, 0.1),
}


def locked(device: VirtualE800) -> VirtualE800:
    device.write(6, 0x2001, [2])
    return go(device, 0.02)


AFTER = {
    # state: status and whole hertz 7 s after each command, in the order 1 2 3 4 5 6 8 9 10 11
    "stopped": "1/50 2/50 0/0 0/0 1/5 0/0 1/50 0/0 0/0 0/0",
    "forward": "1/50 2/20 0/0 0/0 1/50 1/50 1/50 1/50 1/50 1/50",
    "reverse": "1/20 2/50 0/0 0/0 2/50 2/50 1/20 2/50 2/50 2/50",
    "stopping": "1/50 2/30 0/0 0/0 1/5 0/0 1/50 0/0 0/0 0/0",
    "jogging": "1/50 2/50 0/0 0/0 1/5 0/0 1/50 1/5 0/0 1/5",
    # 4 = over-current: there is no flying start, and the motor is as big as the drive.
    "coasting": "4/0 2/50 0/0 0/0 4/0 0/0 4/0 0/0 0/0 0/0",
    "fault": "13/0 13/0 13/0 13/0 13/0 13/0 13/0 ex4 13/0 13/0",
    "locked": "1/50 1/50 1/50 1/50 1/50 1/50 1/50 1/50 1/50 1/50",
    "deaf": "0/0 0/0 0/0 0/0 0/0 0/0 0/0 0/0 0/0 0/0",
}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(("position", "code"), list(enumerate((1, 2, 3, 4, 5, 6, 8, 9, 10, 11))))
def test_each_command_in_each_state(state: str, position: int, code: int) -> None:
    device = STATES[state]()
    try:
        # A ramp of 50 Hz takes 5 s, so a reversal from 50 Hz stands at 20 Hz after 7 s.
        command(device, code, 7)
        words = image(device)
        got = f"{words[5] & 0xFF}/{round(words[0] / 100)}"
    except DeviceException as refused:
        got = f"ex{refused.code}"
    assert got == AFTER[state].split()[position]


def test_writing_5_as_the_thesis_does_to_reset_moves_the_motor() -> None:
    device = go(drive(), 0.1)
    inject(device, 0x0D)
    go(device, 0.05)
    inject(device, 0)
    go(device, 0.02)
    assert image(command(device, JOG, 1))[5] & 0xFF == 0x0D
    command(device, RESET)
    assert image(device)[5] & 0xFF == 0
    command(device, JOG, 2)
    assert image(device)[0] == 500
    assert device.shaft_speed > 100
    command(device, JOG_STOP, 2)
    assert image(device)[5] & 0xFF == 0


def test_run_without_direction_follows_f202() -> None:
    assert command(drive(F202=0), RUN, 1).status == 1
    assert command(drive(F202=1), RUN, 1).status == 2


def test_f209_makes_stop_a_coast() -> None:
    device = command(drive(F209=1), FORWARD, 6)
    command(device, STOP)
    assert (device.status, image(device)[0], image(device)[0x17]) == (0, 0, 0)
    assert device.shaft_speed > 1300
    go(device, 10)
    assert device.shaft_speed == 0


def test_start_and_stop_sources_are_separate() -> None:
    assert command(drive(F200=1), FORWARD, 1).status == 0
    device = command(drive(F201=0), FORWARD, 1)
    for code in (STOP, COAST):
        assert command(device, code, 1).status == 1


def test_lock_holds_commands_and_unlock_frees_them() -> None:
    device = locked(drive())
    assert command(device, FORWARD, 1).status == 0
    device.write(6, 0x2001, [1])
    go(device, 0.02)
    assert command(device, FORWARD, 1).status == 1
