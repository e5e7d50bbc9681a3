"""The virtual drive as a control meets it: registers, words, states, ramps, stops, faults, alarms, the buffer, the watchdog."""

from random import Random

import pytest

from app.errors import ConfigurationError
from app.profidrive.state_machine import Reaction, State
from app.profidrive.words import ENABLES, RUN, Control, Status
from app.sim.sinamics import messages, registers
from app.sim.sinamics import training as own
from app.sim.sinamics.drive import VirtualSinamics
from app.sim.sinamics.messages import ALARMS, FAULTS
from app.sim.sinamics.parameters import DEFAULTS
from app.sim.training import REG_MACHINE_FAULT, REG_RESET
from tests.sim.sinamics.stand import HALF, at, command, running, step

QUICK, COAST = ENABLES & ~Control.NO_QUICK_STOP, ENABLES & ~Control.NO_COAST_STOP


# ---- start and stops


def test_the_example_of_the_sheet_starts_it() -> None:
    drive = VirtualSinamics()
    assert drive.state is State.INHIBITED
    command(drive, RUN, HALF)
    assert drive.state is State.INHIBITED, "a drive that powers up with ON stays inhibited"
    command(drive, 0x047E)
    assert drive.read(3, 109, 1)[0] & Status.READY_TO_SWITCH_ON
    command(drive, 0x047F)
    assert drive.state is State.SWITCHED_ON, "the motor is being magnetised"
    step(drive, DEFAULTS["p0346"][0])
    assert drive.state is State.OPERATION
    step(drive, 5)
    assert drive.speed == pytest.approx(750, abs=5)
    assert drive.read(3, at(registers.ACTUAL), 1)[0] == pytest.approx(HALF, abs=60)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("word", "while_stopping", "after", "longest"),
    [
        (ENABLES, State.RAMP_STOP, State.READY_TO_SWITCH_ON, 3.0),
        (QUICK, State.QUICK_STOP, State.INHIBITED, 1.0),
        (COAST, State.INHIBITED, State.INHIBITED, 30.0),
        (0x0400, State.INHIBITED, State.INHIBITED, 30.0),
    ],
)
def test_each_stop_ends_where_and_as_fast_as_it_should(
    word: int, while_stopping: State, after: State, longest: float
) -> None:
    drive = running()
    command(drive, word)
    assert drive.state is while_stopping and abs(drive.speed) > 500
    pulses = drive.machine.pulses
    assert pulses is (while_stopping in (State.RAMP_STOP, State.QUICK_STOP))
    assert (drive.shaft.voltage > 0) is pulses
    step(drive, longest)
    assert drive.state is after and abs(drive.speed) < 20


def test_quick_stop_is_faster_than_the_ramp_and_coasting_the_slowest() -> None:
    times = []
    for word in (QUICK, ENABLES, COAST):
        drive = running(load=2, quadratic_load=0)
        command(drive, word)
        n = 0
        while abs(drive.speed) > 20:
            step(drive, 0.01)
            n += 1
        times.append(n)
    assert times[0] < times[1] < times[2]


def test_a_start_into_a_coasting_motor_catches_it_without_a_jump() -> None:
    drive = running(load=2, quadratic_load=0)
    command(drive, COAST)
    step(drive, 0.5)
    command(drive, ENABLES)
    command(drive, RUN)
    before = drive.speed
    step(drive, 0.6)
    assert drive.state is State.OPERATION and not drive.faults
    assert abs(drive.speed - before) < 200


# ---- the run interlock, the emergency stop, the panel


# ---- faults and alarms


# ---- monitoring of the process data


@pytest.mark.parametrize("number", sorted(registers.WATCHED))
def test_any_access_to_the_process_data_is_a_sign_of_life(number: int) -> None:
    drive = running()
    for _ in range(30):
        drive.read(3, at(number), 1)
        step(drive, 0.1, silent=True)
    assert not drive.faults


@pytest.mark.parametrize("number", [40341, 40400, 40322, 40102])
def test_other_registers_are_none_and_the_drive_trips_after_p2040(number: int) -> None:
    drive = running()
    quiet = 0.0
    while not drive.faults:
        drive.read(3, at(number), 1)
        step(drive, 0.01, silent=True)
        quiet += 0.01
        assert quiet < 2
    assert drive.faults == [messages.TIMEOUT] and quiet == pytest.approx(1.0, abs=0.05)
    assert drive.state is State.QUICK_STOP


def test_with_p2040_at_0_or_without_pulses_silence_does_nothing() -> None:
    drive = running(parameters={"p2040": 0})  # type: ignore[arg-type]
    step(drive, 20, silent=True)
    assert drive.state is State.OPERATION
    idle = VirtualSinamics()
    command(idle, ENABLES)
    step(idle, 20, silent=True)
    assert not idle.faults


# ---- registers


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"start": "up"}, "start 'up'"),
        ({"rated_current": 0.5}, "0.5"),
        ({"rated_current": 500}, "500"),
        ({"setpoint": 300}, "300"),
        ({"process_words": 4}, "4"),
        ({"inertia_ratio": -1}, "-1"),
        ({"load": 600}, "600"),
        ({"parameters": {"p9999": 1}}, "p9999"),
        ({"parameters": {"p1120": -1}}, "p1120"),
    ],
)
def test_a_plant_file_that_asks_too_much_is_told_what(options: dict[str, object], named: str) -> None:
    with pytest.raises(ConfigurationError, match=named):
        VirtualSinamics(**options)  # type: ignore[arg-type]


# ---- time and chance


@pytest.mark.sweep(8)
@pytest.mark.parametrize("start", ["", "forward", "reverse"])
def test_the_same_seed_and_writes_repeat_a_run_and_reset_begins_anew(start: str) -> None:
    def story(drive: VirtualSinamics) -> list[list[int]]:
        seen = []
        for n in range(600):
            if n == 50:
                drive.write(6, 99, [ENABLES])
            if n == 300:
                drive.write(6, 99, [RUN])
            step(drive, 0.01)
            seen.append(drive.read(3, at(40340), 10))
        return seen

    drive = VirtualSinamics(seed=7, start=start, setpoint=60)
    first = story(drive)
    assert first == story(VirtualSinamics(seed=7, start=start, setpoint=60))
    drive.write(6, REG_RESET, [1])
    step(drive, 0.01)
    again = VirtualSinamics(seed=7, start=start, setpoint=60)
    again.step()
    assert [drive.read(3, at(40340), 10), drive.status] == [again.read(3, at(40340), 10), again.status]
    assert first != story(VirtualSinamics(seed=8, start=start, setpoint=60)) or not start


WORDS = [ENABLES, RUN, RUN | Control.INVERT, QUICK, COAST, 0, RUN & ~Control.BY_PLC, RUN | Control.ACKNOWLEDGE,
         ENABLES | Control.ACKNOWLEDGE, RUN & ~Control.ENABLE_OPERATION, RUN & ~Control.ENABLE_RAMP]  # fmt: skip
WORLD = {own.REG_INTERLOCK: (0, 1), own.REG_EMERGENCY: (0, 1), own.REG_LOCAL: (0, 1), own.REG_SUPPLY: (400, 400, 0),
         own.REG_LOAD: (0, 15, 150), REG_MACHINE_FAULT: (0, 0, 0, *FAULTS, *ALARMS)}  # fmt: skip


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(24))
def test_whatever_comes_in_whatever_order_these_always_hold(seed: int) -> None:
    """No torque without pulses, no pulses with an open interlock or a fault that coasts, no start without OFF before it, limits kept."""
    chance = Random(seed)
    drive = VirtualSinamics(seed=seed, rated_current=chance.choice([2.0, 15.0, 120.0]))
    last_off = False
    for _ in range(250):
        if chance.random() < 0.6:
            drive.write(16, 99, [chance.choice(WORDS), chance.choice([0, HALF, 0x4000, 0x7FFF, 0x8000, 0xC000])])
        if chance.random() < 0.3:
            register = chance.choice(list(WORLD))
            drive.write(6, register, [chance.choice(WORLD[register])])
        for _ in range(chance.choice([1, 3, 25])):
            before = drive.state
            step(drive, 0.01, silent=chance.random() < 0.1)
            last_off = last_off or drive.state in (State.READY_TO_SWITCH_ON,)
            if drive.state is State.SWITCHED_ON and before is State.INHIBITED:
                pytest.fail("switched on out of S1")
            if not drive.machine.pulses:
                assert drive.shaft.torque == 0
            if drive._training[own.REG_INTERLOCK]:
                assert not drive.machine.pulses
            if any(FAULTS[number].reaction is Reaction.OFF2 for number in drive.faults) and drive.machine.faulted:
                assert not drive.machine.pulses or drive.buffer.new
            assert drive.shaft.current <= max(drive.parameter("p0640"), drive.shaft.magnetising_current) + 0.01
            assert abs(drive.ramp) <= 1.3 * drive.parameter("p1082") + 30
            assert bool(drive.status & Status.FAULT) is drive.machine.faulted
            assert all(0 <= word <= 0xFFFF for word in drive.read(3, at(40340), 10))
