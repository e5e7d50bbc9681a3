"""The virtual drive as a control meets it: registers, words, states, ramps, stops, faults, alarms, the buffer, the watchdog."""

from collections.abc import Callable
from itertools import pairwise
from random import Random

import pytest

from app.errors import ConfigurationError, DeviceException
from app.profidrive.state_machine import Reaction, State
from app.profidrive.words import ENABLES, RUN, Control, Status
from app.sim.sinamics import messages, registers
from app.sim.sinamics import training as own
from app.sim.sinamics.drive import DEFAULTS, VirtualSinamics
from app.sim.sinamics.messages import ALARMS, FAULTS
from app.sim.training import REG_MACHINE_FAULT, REG_RESET

HALF = 0x2000
QUICK, COAST = ENABLES & ~Control.NO_QUICK_STOP, ENABLES & ~Control.NO_COAST_STOP


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


def value(drive: VirtualSinamics, number: int) -> float:
    return registers.REGISTERS[number].decode(drive.read(3, at(number), 1)[0])


def running(word: int = RUN, setpoint: int = HALF, **options: float) -> VirtualSinamics:
    drive = VirtualSinamics(disturbance=0, **options)  # type: ignore[arg-type]
    command(drive, ENABLES, setpoint)
    command(drive, word)
    step(drive, 8)
    assert drive.state is State.OPERATION
    return drive


def code_of(deed: Callable[[], object]) -> int:
    with pytest.raises(DeviceException) as error:
        deed()
    return error.value.code


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


def test_magnetising_takes_its_time_and_current_before_anything_turns() -> None:
    drive = VirtualSinamics(parameters={"p0346": 1.0})
    command(drive, ENABLES, HALF)
    command(drive, RUN)
    step(drive, 0.5)
    assert drive.state is State.SWITCHED_ON and drive.speed == 0
    assert 0 < value(drive, 40345) < drive.shaft.magnetising_current
    step(drive, 0.6)
    assert drive.state is State.OPERATION
    assert value(drive, 40345) >= 0.9 * drive.shaft.magnetising_current


@pytest.mark.parametrize(("up", "down"), [(2.0, 4.0), (5.0, 5.0), (10.0, 1.0)])
def test_ramps_take_the_parameters_from_zero_to_the_greatest_speed(up: float, down: float) -> None:
    drive = VirtualSinamics(disturbance=0, parameters={"p1120": up, "p1121": down, "p0346": 0, "p1226": 5})
    command(drive, ENABLES, 0x4000)
    command(drive, RUN)
    step(drive, up / 2)
    assert drive.ramp == pytest.approx(750, abs=1500 / up * 0.2)
    step(drive, up)
    command(drive, ENABLES)
    step(drive, down / 2 - 0.05)
    assert drive.ramp == pytest.approx(750, abs=1500 / down * 0.1)
    assert drive.state is State.RAMP_STOP
    step(drive, down / 2 + 3)
    assert drive.state is State.READY_TO_SWITCH_ON


def test_reversing_goes_through_zero_on_the_ramps_and_never_jumps() -> None:
    drive = running()
    drive.write(6, 99, [RUN | Control.INVERT])
    seen = []
    for _ in range(800):
        step(drive, 0.01)
        seen.append(drive.ramp)
    assert seen[-1] == pytest.approx(-750)
    assert max(abs(b - a) for a, b in pairwise(seen)) <= 1500 / 5 * 0.01 + 1e-6
    assert not drive.status & Status.FORWARD and value(drive, 40341) < 0
    assert drive.read(3, 110, 1)[0] > 0x8000


def test_a_negative_setpoint_turns_backwards_and_inverted_forwards() -> None:
    assert running(setpoint=-HALF).speed < -700
    assert running(RUN | Control.INVERT, setpoint=-HALF).speed > 700


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


def test_setpoint_is_zero_without_its_enable_and_held_without_control_by_plc() -> None:
    drive = running()
    command(drive, RUN & ~Control.ENABLE_SETPOINT)
    step(drive, 5)
    assert abs(drive.speed) < 5 and drive.state is State.OPERATION
    command(drive, RUN, HALF)
    step(drive, 5)
    command(drive, RUN & ~Control.BY_PLC, 0x1000)
    step(drive, 5)
    assert drive.speed == pytest.approx(750, abs=5), "word and set-point are ignored as a whole"


@pytest.mark.parametrize(("bit", "speed"), [(Control.ENABLE_RAMP, 0.0), (Control.CONTINUE_RAMP, 750.0)])
def test_the_ramp_generator_stops_or_stands_still(bit: Control, speed: float) -> None:
    drive = running()
    command(drive, RUN & ~bit, 0x4000)
    step(drive, 6)
    assert drive.speed == pytest.approx(speed, abs=6) and drive.state is State.OPERATION
    command(drive, ENABLES & ~bit)
    step(drive, 4)
    assert drive.state is State.READY_TO_SWITCH_ON, "a stop goes on regardless"


# ---- the run interlock, the emergency stop, the panel


@pytest.mark.parametrize(
    ("register", "state", "bit"),
    [
        (own.REG_INTERLOCK, State.INHIBITED, Status.NO_COAST_STOP),
        (own.REG_EMERGENCY, State.QUICK_STOP, Status.NO_QUICK_STOP),
    ],
)
def test_terminals_stop_it_and_it_does_not_start_by_itself_when_they_close(
    register: int, state: State, bit: Status
) -> None:
    drive = running()
    drive.write(6, register, [1])
    step(drive, 0.1)
    assert drive.state is state and not drive.status & bit
    step(drive, 5)
    command(drive, ENABLES)
    command(drive, RUN)
    assert drive.state is State.INHIBITED, "the word cannot overrule it"
    drive.write(6, register, [0])
    step(drive, 1)
    assert drive.state is State.INHIBITED, "OFF is wanted first"
    command(drive, ENABLES)
    command(drive, RUN)
    step(drive, 1)
    assert drive.state is State.OPERATION


def test_local_control_takes_it_off_and_says_so() -> None:
    drive = running()
    drive.write(6, own.REG_LOCAL, [1])
    step(drive, 5)
    assert drive.state is State.READY_TO_SWITCH_ON
    assert not drive.status & Status.CONTROL_REQUESTED and value(drive, 40349) == 0
    command(drive, RUN)
    assert drive.state is State.READY_TO_SWITCH_ON


# ---- faults and alarms


@pytest.mark.parametrize("number", FAULTS)
def test_every_fault_stops_as_its_reaction_says_and_needs_cause_gone_edge_and_off(number: int) -> None:
    drive = running()
    drive.write(6, REG_MACHINE_FAULT, [number])
    step(drive, 0.1 if number != messages.BLOCKED else 3)
    assert drive.faults == [number] and drive.status & Status.FAULT
    assert value(drive, 40400) == number
    expected = {Reaction.OFF1: State.RAMP_STOP, Reaction.OFF3: State.QUICK_STOP, Reaction.OFF2: State.INHIBITED}
    assert drive.state is expected[FAULTS[number].reaction]
    step(drive, 5)
    assert drive.state is State.INHIBITED
    if number != messages.BLOCKED:  # a motor that stands is not known to be blocked
        command(drive, ENABLES | Control.ACKNOWLEDGE)
        assert drive.faults == [number], "the cause is still there"
    drive.write(6, REG_MACHINE_FAULT, [0])
    command(drive, ENABLES)
    assert drive.status & Status.FAULT, "nothing acknowledges itself"
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == [] and not drive.status & Status.FAULT
    command(drive, RUN | Control.ACKNOWLEDGE)
    step(drive, 1)
    assert drive.state is State.OPERATION


@pytest.mark.parametrize("number", ALARMS)
def test_every_alarm_warns_leaves_it_running_and_goes_with_its_cause(number: int) -> None:
    drive = running()
    drive.write(6, REG_MACHINE_FAULT, [number])
    step(drive, 0.1)
    assert drive.state is State.OPERATION and not drive.faults
    assert drive.status & Status.ALARM and value(drive, 40408) == value(drive, 40409) == number
    drive.write(6, REG_MACHINE_FAULT, [0])
    step(drive, 0.1)
    assert not drive.status & Status.ALARM and value(drive, 40408) == 0


def test_a_held_acknowledge_bit_is_no_edge() -> None:
    drive = running()
    command(drive, RUN | Control.ACKNOWLEDGE)
    drive.write(6, REG_MACHINE_FAULT, [7860])
    step(drive, 0.1)
    drive.write(6, REG_MACHINE_FAULT, [0])
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == [7860]
    command(drive, ENABLES)
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == []


def test_an_edge_that_fits_into_one_step_is_lost() -> None:
    drive = running()
    drive.write(6, REG_MACHINE_FAULT, [7860])
    step(drive, 0.1)
    drive.write(6, REG_MACHINE_FAULT, [0])
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    drive.write(6, 99, [ENABLES])
    drive.write(6, 99, [ENABLES | Control.ACKNOWLEDGE])
    step(drive, 0.05)
    drive.write(6, REG_MACHINE_FAULT, [7860])
    step(drive, 0.05)
    drive.write(6, REG_MACHINE_FAULT, [0])
    drive.write(6, 99, [ENABLES])
    drive.write(6, 99, [ENABLES | Control.ACKNOWLEDGE])
    step(drive, 0.05)
    assert drive.faults == [7860]


def test_the_buffer_shifts_by_situations_and_only_its_eighth_place_is_overwritten() -> None:
    drive = VirtualSinamics()
    command(drive, ENABLES)
    numbers = list(FAULTS)
    for number in numbers[:10]:
        drive._enter(number)
    step(drive, 0.05)
    assert drive.buffer[0] == [*numbers[:7], numbers[9]]
    assert [value(drive, 40400 + n) for n in range(8)] == drive.buffer[0]
    first = list(drive.buffer[0])
    for n in range(9):
        command(drive, ENABLES | Control.ACKNOWLEDGE)
        command(drive, ENABLES)
        drive._enter(numbers[n])
        step(drive, 0.05)
        assert (first in drive.buffer) is (n < 7)
        assert len(drive.buffer) == 8 and all(len(situation) == 8 for situation in drive.buffer)


def test_a_blocked_motor_trips_after_a_second_at_the_limit_and_the_current_stays_at_its_limit() -> None:
    drive = running()
    drive.write(6, REG_MACHINE_FAULT, [messages.BLOCKED])
    seen = []
    for _ in range(300):
        step(drive, 0.01)
        seen.append((drive.shaft.current, bool(drive.status & Status.LIMIT_NOT_REACHED), drive.faults))
    limited = [current for current, free, faults in seen if not free]
    assert limited and max(limited) <= drive.parameter("p0640") + 0.01
    assert 90 <= len(limited) <= 130
    assert drive.faults == [messages.BLOCKED]


def test_overload_warns_first_and_then_trips() -> None:
    drive = running(setpoint=0x4000)
    drive.write(6, own.REG_LOAD, [100])
    story = []
    for _ in range(300):
        step(drive, 1)
        now = (bool(drive.faults), *drive.alarms)
        story += [] if story and story[-1] == now else [now]
    assert (False, messages.NEAR_OVERLOAD) in story
    assert drive.faults == [messages.OVERLOAD]


@pytest.mark.parametrize(("supply", "number"), [(200, messages.UNDERVOLTAGE), (0, messages.UNDERVOLTAGE)])
def test_a_supply_that_fails_trips_it_and_it_is_not_acknowledged_before_it_is_back(supply: int, number: int) -> None:
    drive = running()
    drive.write(6, own.REG_SUPPLY, [supply])
    step(drive, 2)
    assert drive.faults == [number] and value(drive, 40344) < 360
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == [number]
    drive.write(6, own.REG_SUPPLY, [400])
    step(drive, 1)
    command(drive, ENABLES)
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == []


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


@pytest.mark.parametrize("words", [2, 10])
def test_what_the_map_does_not_list_answers_2_whether_read_or_written(words: int) -> None:
    drive = VirtualSinamics(process_words=words)
    known = (
        {at(n) for n in registers.REGISTERS}
        | {at(40100 + n) for n in range(words)}
        | {at(40110 + n) for n in range(words)}
    )
    for address in range(0x0300):
        if address in known:
            drive.read(3, address, 1)
        else:
            assert code_of(lambda a=address: drive.read(3, a, 1)) == 2  # type: ignore[misc]
            assert code_of(lambda a=address: drive.write(6, a, [0])) == 2  # type: ignore[misc]
    assert code_of(lambda: drive.read(3, at(40349), 2)) == 2, "a range with one that is not there"


@pytest.mark.parametrize(
    ("deed", "code"),
    [
        (lambda d: d.read(4, 99, 1), 1),
        (lambda d: d.write(5, 99, [1]), 1),
        (lambda d: d.read(3, 99, 0), 3),
        (lambda d: d.read(3, 99, 126), 3),
        (lambda d: d.write(16, 99, []), 3),
        (lambda d: d.write(6, 99, [1, 2]), 3),
        (lambda d: d.write(6, 99, [0x10000]), 3),
        (lambda d: d.write(6, 109, [0]), 4),
        (lambda d: d.write(16, 108, [0, 0]), 4),
    ],
)
def test_bad_requests_are_refused_by_code_and_nothing_of_them_acts(
    deed: Callable[[VirtualSinamics], object], code: int
) -> None:
    drive = running()
    before = [drive.read(3, at(n), 1)[0] for n in (40100, 40101, 40322)]
    assert code_of(lambda: deed(drive)) == code
    step(drive, 0.1)
    assert [drive.read(3, at(n), 1)[0] for n in (40100, 40101, 40322)] == before


def test_energy_is_counted_in_whole_kilowatt_hours_and_never_goes_back() -> None:
    drive = running(setpoint=0x4000)
    before = drive.energy
    step(drive, 10)
    assert drive.energy > before
    drive.energy = 12.7
    assert value(drive, 40348) == 13


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


@pytest.mark.parametrize(("start", "sign"), [("forward", 1), ("reverse", -1)])
def test_a_drive_that_runs_since_long_stays_where_it_is(start: str, sign: int) -> None:
    drive = VirtualSinamics(start=start, setpoint=60, disturbance=0)
    for _ in range(100):
        step(drive, 0.05)
        assert drive.speed == pytest.approx(sign * 900, abs=3)
    assert drive.state is State.OPERATION and not drive.faults and not drive.alarms


WORDS = [ENABLES, RUN, RUN | Control.INVERT, QUICK, COAST, 0, RUN & ~Control.BY_PLC, RUN | Control.ACKNOWLEDGE,
         ENABLES | Control.ACKNOWLEDGE, RUN & ~Control.ENABLE_OPERATION, RUN & ~Control.ENABLE_RAMP]  # fmt: skip
WORLD = {own.REG_INTERLOCK: (0, 1), own.REG_EMERGENCY: (0, 1), own.REG_LOCAL: (0, 1), own.REG_SUPPLY: (400, 400, 0),
         own.REG_LOAD: (0, 15, 150), REG_MACHINE_FAULT: (0, 0, 0, *FAULTS, *ALARMS)}  # fmt: skip


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
                assert not drive.machine.pulses or drive._entered
            assert drive.shaft.current <= max(drive.parameter("p0640"), drive.shaft.magnetising_current) + 0.01
            assert abs(drive.ramp) <= 1.3 * drive.parameter("p1082") + 30
            assert bool(drive.status & Status.FAULT) is drive.machine.faulted
            assert all(0 <= word <= 0xFFFF for word in drive.read(3, at(40340), 10))
