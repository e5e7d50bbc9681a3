"""The crane's program by its telegrams: manual, limits, brakes, the sequence with its interruptions, weights, settings, power."""

import math
from collections.abc import Callable

import pytest

from app.blocks.arc_positioner.circle import Point
from app.registers.plc_map import AnswerState, real
from app.sim import training
from app.sim.crane import training as own
from app.sim.crane.configuration import AXES
from app.sim.crane.plc_axis import HOT
from app.sim.crane.register_map import (
    STAGING,
    CraneCommand,
    CraneEvent,
    CraneReason,
    CraneState,
    DriveChoice,
    Mode,
    SafetyTrip,
    Step,
    StepState,
    Suspension,
)
from tests.sim.crane.crane_stand import JOGS, Stand

DONE, REJECTED = AnswerState.DONE, AnswerState.REJECTED


def manual(**options: object) -> Stand:
    stand = Stand(start="manual", **options)
    assert stand.crane.mode is Mode.MANUAL
    return stand


def in_step(step: Step, **options: object) -> Stand:
    """A cycle that has just entered `step`."""
    stand = Stand(**options)
    stand.cycle()
    until_step(stand, step)
    return stand


def until_step(stand: Stand, step: Step) -> None:
    def there() -> bool:
        if stand.crane.cycle.state is StepState.WAITING and step is not Step.WEIGHT_CONFIRMATION:
            stand.ask(CraneCommand.CONFIRM_WEIGHT, real(stand.crane.weight))
        return stand.crane.cycle.step is step

    stand.until(there, 400)


# ---- manual


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("step", [1, 4])
def test_a_lever_moves_its_axis_at_the_speed_of_its_step(axis: str, way: int, step: int) -> None:
    stand = manual()
    stand.put("trolley", 10000.0)
    stand.put("bridge", 30000.0)
    assert stand.ask(CraneCommand.SELECT_STEP, step) is DONE
    stand.jog(axis, way)
    moved = stand.crane.axes[axis]
    stand.until(lambda: abs(moved.speed) > 0.98 * moved.steps[step - 1], 12)
    assert moved.speed * way > 0 and moved.speed == pytest.approx(way * moved.steps[step - 1], rel=0.03)
    assert not any(other.moving for name, other in stand.crane.axes.items() if name != axis)
    assert stand.crane.state == CraneState.MANUAL_MOVING
    stand.release()
    assert stand.crane.state == CraneState.MANUAL
    stand.until(lambda: not any(moved.brakes_open), 1)


def test_two_levers_move_nothing_and_a_second_one_stops_the_first() -> None:
    stand = manual()
    stand.lever = JOGS["hoist", 1] | JOGS["trolley", 1]
    stand.run(4)
    assert not stand.crane.moving
    stand.release()
    stand.run(0.5)
    stand.jog("hoist", 1)
    stand.until(lambda: stand.crane.axes["hoist"].speed > 10, 5)
    stand.lever |= JOGS["bridge", 1]
    stand.until(lambda: not stand.crane.moving, 10)
    stand.lever = JOGS["hoist", 1]
    stand.run(3)
    assert not stand.crane.moving, "all have to be released first"


def test_a_lever_that_is_not_kept_alive_is_released() -> None:
    stand = manual()
    stand.jog("trolley", 1)
    stand.until(lambda: stand.crane.axes["trolley"].speed > 50, 5)
    stand.lever = 0
    stand.talker.plc.write(16, 0x0380, [JOGS["trolley", 1], 7, 0, 0])
    stand.run(0.4)
    assert stand.crane.axes["trolley"].setpoint > 0
    stand.run(0.3)
    assert stand.crane.axes["trolley"].setpoint == 0


@pytest.mark.parametrize("mode", ["stopped", "automatic"])
def test_outside_manual_a_lever_moves_nothing(mode: str) -> None:
    stand = Stand(start=mode)
    stand.jog("hoist", -1)
    stand.run(4)
    assert not stand.crane.moving


# ---- limits


@pytest.mark.sweep(8)
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("way", [1, -1])
def test_an_axis_slows_down_stops_at_its_switch_and_is_acknowledged_after_moving_away(axis: str, way: int) -> None:
    stand = manual()
    stand.put("trolley", 10000.0)
    crane, end = stand.crane, "upper" if way > 0 else "lower"
    moved, places = crane.axes[axis], crane.places
    slow, stop = getattr(places, f"{axis}_{end}_slow_at"), getattr(places, f"{axis}_{end}_stop_at")
    stand.put(axis, slow - way * 3000.0)
    stand.ask(CraneCommand.SELECT_STEP, 4)
    stand.jog(axis, way)
    stand.until(lambda: way * (moved.axis.position - stop) >= 0, 120)
    assert abs(moved.speed) <= moved.steps[0] + 1
    stand.until(lambda: not crane.moving, 10)
    assert way * (moved.axis.position - stop) < 0.2 * moved.max_speed
    source = 2 * AXES.index(axis) + (2 if way > 0 else 1)
    assert (CraneEvent.STOP_HIT, source) in stand.talker.codes()
    number = 1 if way > 0 else 0
    assert crane.permissives(moved)[1 - number][0] is False and crane.permissives(moved)[number][0] is True
    stand.release()
    assert stand.ask(CraneCommand.RESET) is DONE
    stand.run(0.5)
    assert moved.limits.active, "not before moving away"
    stand.jog(axis, -way)
    stand.until(lambda: way * (stop - moved.axis.position) > 50, 30)
    stand.release()
    stand.ask(CraneCommand.RESET)
    stand.run(0.5)
    assert not moved.limits.active


@pytest.mark.sweep(8)
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("first", [own.STOP_DEAD, own.SLOW_DEAD])
def test_a_switch_that_does_not_answer_is_found_by_the_position(axis: str, way: int, first: int) -> None:
    stand = manual()
    stand.put("trolley", 10000.0)
    crane, end = stand.crane, "upper" if way > 0 else "lower"
    moved, places = crane.axes[axis], crane.places
    place = getattr(places, f"{axis}_{end}_{'stop' if first == own.STOP_DEAD else 'slow'}_at")
    code = first + 2 * AXES.index(axis) + (way > 0)
    stand.talker.fault(code)
    stand.put(axis, place - way * 100.0)
    stand.ask(CraneCommand.SELECT_STEP, 4)
    stand.jog(axis, way)
    source = 2 * AXES.index(axis) + (2 if way > 0 else 1)
    stand.until(lambda: any(moved.limits.alarms.values()), 120)
    stand.until(lambda: not crane.moving, 20)
    assert (CraneEvent.SWITCH_FAILED, source) in stand.talker.codes()
    assert not moved.allowed.healthy and crane.start_permissives["limits_ok"] is False


# ---- brakes, drives, emergency


@pytest.mark.parametrize("brake", [0, 1, 2, 3])
def test_a_brake_that_sticks_ends_the_start_with_its_time_out(brake: int) -> None:
    stand = manual()
    axis = ("hoist", "hoist", "trolley", "bridge")[brake]
    stand.talker.fault(own.BRAKE_STICKS + brake)
    at = stand.crane.axes[axis].axis.position
    stand.jog(axis, 1)
    stand.run(7)
    assert stand.crane.axes[axis].axis.position == at
    codes = {code for code, _ in stand.talker.codes()}
    assert CraneEvent.BRAKE_OPEN_TIMEOUT in codes
    stand.talker.fault(0)
    stand.release()
    stand.ask(CraneCommand.RESET)
    stand.run(1)
    stand.jog(axis, 1)
    stand.until(lambda: stand.crane.axes[axis].speed > 5, 5)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("fault", "axis"),
    [
        *((own.TRIP + n, axis) for n, axis in enumerate(("hoist", "hoist", "trolley", "bridge"))),
        *((own.SILENT + n, axis) for n, axis in enumerate(("hoist", "hoist", "trolley", "bridge"))),
        *((own.FEEDBACK_LOST + n, axis) for n, axis in enumerate(("hoist", "hoist", "trolley", "bridge"))),
        *((own.HOT + n, axis) for n, axis in enumerate(("hoist", "hoist", "trolley", "bridge"))),
        (own.EMERGENCY_STOP, "hoist"),
        (own.OVER_SPEED, "hoist"),
    ],
)
def test_what_fails_stops_its_axis_at_once_and_a_reset_brings_it_back(fault: int, axis: str) -> None:
    stand = manual()
    crane, moved = stand.crane, stand.crane.axes[axis]
    stand.ask(CraneCommand.SELECT_STEP, 3)
    stand.jog(axis, 1)
    stand.until(lambda: moved.speed > 0.9 * moved.steps[2], 10)
    stand.talker.fault(fault)
    stand.until(lambda: moved.axis.held and abs(moved.speed) < 1, 12)
    at = moved.axis.position
    stand.run(2)
    assert abs(moved.axis.position - at) < 1
    stand.talker.fault(0)
    stand.lever = 0
    stand.run(40 if fault >= own.HOT and fault < own.EMERGENCY_STOP else 1)
    stand.ask(CraneCommand.RESET)
    stand.run(1)
    stand.jog(axis, 1)
    stand.until(lambda: moved.speed > 20, 60)
    assert not crane.held


def lose_power(stand: Stand) -> None:
    stand.talker.train(training.REG_POWER, 1)


def press(stand: Stand) -> None:
    stand.talker.fault(own.EMERGENCY_STOP)


@pytest.mark.parametrize(
    ("happens", "trip", "told"),
    [
        (press, SafetyTrip.EMERGENCY_STOP, CraneEvent.SAFETY_BRAKE_STOP),
        (lose_power, SafetyTrip.POWER, CraneEvent.SAFETY_BRAKE),
    ],
)
@pytest.mark.parametrize(
    ("axis", "way"), [("hoist", 0), ("hoist", 1), ("hoist", -1), *((name, 1) for name in ("trolley", "bridge"))]
)
def test_the_hoists_safety_brakes_fall_in_with_an_emergency_stop_and_with_power_and_wait_for_a_reset(
    happens: Callable[[Stand], None], trip: SafetyTrip, told: CraneEvent, axis: str, way: int
) -> None:
    """Whatever the crane does; the hoist stands within the way that a brake needs, and its drive never pulls against it."""
    stand = manual()
    crane, hoist = stand.crane, stand.crane.axes["hoist"]
    stand.put("hoist", 20000.0)
    stand.put("trolley", 10000.0)
    stand.ask(CraneCommand.SELECT_STEP, 4)
    if way:
        stand.jog(axis, way)
        stand.until(lambda: abs(crane.axes[axis].speed) > 0.95 * crane.axes[axis].max_speed, 12)
    happens(stand)
    stand.until(lambda: hoist.axis.safety_brake, 0.2)
    at = hoist.axis.position
    stand.run(0.2)
    stand.release()
    stand.until(lambda: not crane.moving, 60)
    assert crane.safety_trip is trip and crane.held
    assert abs(hoist.axis.position - at) <= hoist.max_speed**2 / (2 * hoist.axis.data.brake_deceleration)
    assert hoist.axis.strain == 0.0
    assert [source for code, source in stand.talker.codes() if code == told] == [trip]
    if trip is SafetyTrip.EMERGENCY_STOP:
        assert stand.reason(CraneCommand.RESET) == CraneReason.EMERGENCY_STOP
        stand.talker.fault(0)
        stand.run(1)
    assert stand.reason(CraneCommand.AUTOMATIC) == CraneReason.HELD and crane.safety_trip is trip
    assert stand.ask(CraneCommand.RESET) is DONE
    assert not hoist.axis.safety_brake and crane.safety_trip is SafetyTrip.NONE
    assert stand.ask(CraneCommand.MANUAL) is DONE
    stand.jog("hoist", 1)
    stand.until(lambda: hoist.speed > 20, 60)


def test_what_tripped_the_safety_brakes_first_is_kept() -> None:
    """A button that is pressed afterwards, or a supply that goes, does not hide an over-speed."""
    stand = manual()
    stand.talker.fault(own.OVER_SPEED)
    stand.jog("hoist", -1)
    stand.until(lambda: stand.crane.safety_brake, 10)
    press(stand)
    stand.run(1)
    lose_power(stand)
    stand.run(1)
    assert stand.crane.safety_trip is SafetyTrip.OVER_SPEED


@pytest.mark.parametrize(
    ("first", "event"), [(own.TRIP, CraneEvent.DRIVE_TRIPPED), (own.SILENT, CraneEvent.DRIVE_COMMUNICATION)]
)
@pytest.mark.parametrize("motor", [1, 2, 3, 4])
def test_a_drive_that_fails_at_rest_is_told_and_lets_no_cycle_begin(first: int, event: CraneEvent, motor: int) -> None:
    """Else the cycle took a full ladle up, and found out when the turn of that drive came."""
    stand = Stand(start="automatic")
    stand.talker.fault(first + motor - 1)
    stand.run(6)
    assert [(code, source) for code, source in stand.talker.codes() if 21 <= code <= 28] == [(event, motor)]
    assert not stand.crane.start_permissives["drives_ok"]
    assert stand.reason(CraneCommand.START_CYCLE, 1, 2, real(210.0)) == CraneReason.NOT_ALLOWED
    stand.talker.fault(0)
    stand.run(1)
    assert stand.ask(CraneCommand.RESET) is DONE
    stand.run(1)
    stand.cycle()
    assert stand.crane.cycle.runs


def test_a_drive_that_is_not_selected_is_nobodys_business() -> None:
    stand = Stand()
    stand.ask(CraneCommand.SELECT_DRIVES, DriveChoice.FIRST)
    stand.talker.fault(own.SILENT + 1)
    stand.run(10)
    assert not [code for code, _ in stand.talker.codes() if 21 <= code <= 28]
    stand.cycle()


def test_what_a_motor_has_is_told_with_its_alarm() -> None:
    stand = Stand()
    stand.talker.fault(own.HOT + 3)
    stand.run(40)
    told = [event for event in stand.talker.events() if event.code == CraneEvent.HOT]
    assert [event.value for event in told] == [pytest.approx(HOT, abs=5)]


def test_the_other_drive_of_the_drum_makes_no_alarm_of_its_own() -> None:
    stand = manual()
    stand.jog("hoist", 1)
    stand.until(lambda: stand.crane.axes["hoist"].speed > 10, 5)
    stand.talker.fault(own.TRIP)
    stand.run(3)
    told = [(code, source) for code, source in stand.talker.codes() if 21 <= code <= 28]
    assert told == [(CraneEvent.DRIVE_TRIPPED, 1)]


@pytest.mark.parametrize(
    ("choice", "active"),
    [(DriveChoice.FIRST, {1}), (DriveChoice.SECOND, {2}), (DriveChoice.BOTH, {1, 2}), (DriveChoice.BY_HOURS, {1})],
)
def test_the_selected_drives_work_and_only_they_count_hours(choice: DriveChoice, active: set[int]) -> None:
    stand = manual()
    assert stand.ask(CraneCommand.SELECT_DRIVES, choice) is DONE
    stand.jog("hoist", 1)
    stand.run(6)
    hoist = stand.crane.axes["hoist"]
    assert {motor.number for motor in hoist.motors if motor.hours.seconds} == active
    assert {motor.number for motor in hoist.motors if motor.starts == 1} == active
    assert hoist.speed == pytest.approx(20.32, rel=0.03)
    assert all(motor.fan_on is (motor.number in active) for motor in hoist.motors)


def test_with_no_drive_selected_the_hoist_says_so_and_stays() -> None:
    stand = manual()
    stand.ask(CraneCommand.SELECT_DRIVES, DriveChoice.NONE)
    stand.jog("hoist", 1)
    stand.run(5)
    hoist = stand.crane.axes["hoist"]
    assert not hoist.speed and stand.crane.permissives(hoist)[0][4] is False


def test_the_fan_runs_on_and_hours_are_reset_and_kept() -> None:
    stand = manual()
    stand.jog("trolley", 1)
    stand.run(4)
    stand.release()
    motor = stand.crane.axes["trolley"].motors[0]
    stand.run(35)  # the preset is over
    assert motor.fan_on and 20 < motor.fan.left < 60
    stand.run(61)
    assert not motor.fan_on
    hours = motor.hours.hours
    assert hours > 0 and stand.ask(CraneCommand.RESET_HOURS, 3) is DONE
    stand.run(0.5)
    assert motor.hours.hours == 0 and motor.hours.before == pytest.approx(3600 * hours)
    assert (CraneEvent.HOURS_RESET, 3) in stand.talker.codes()


@pytest.mark.parametrize(
    ("fault", "way"),
    [(own.ROPE_OVERLAP, 1), (own.SLACK_ROPE, -1), (own.OVERLOAD, 1), (own.SCALE, 1)],
)
def test_what_blocks_one_direction_leaves_the_other(fault: int, way: int) -> None:
    stand = manual()
    stand.talker.fault(fault)
    hoist = stand.crane.axes["hoist"]
    stand.jog("hoist", way)
    stand.run(4)
    assert not hoist.speed
    stand.release()
    stand.run(0.5)
    stand.jog("hoist", -way)
    stand.until(lambda: -way * hoist.speed > 10, 5)


def test_without_an_encoder_the_axis_creeps_and_keeps_its_last_position() -> None:
    stand = manual()
    hoist = stand.crane.axes["hoist"]
    stand.talker.fault(own.ENCODER)
    stand.ask(CraneCommand.SELECT_STEP, 4)
    at = hoist.position
    stand.jog("hoist", -1)
    stand.run(6)
    assert hoist.speed == pytest.approx(-20.32, rel=0.03) and hoist.position == at


# ---- automatic


@pytest.mark.sweep(8)
def test_a_cycle_brings_the_ladle_from_stand_to_stand_and_tells_every_step_in_the_order_of_the_thesis() -> None:
    stand = Stand()
    crane = stand.crane
    beside = {Step.ARC_LIFT: [0.0], Step.ARC_LOWERING: [0.0]}
    seen: list[tuple[int, int, float]] = []
    sway: list[float] = []

    def look() -> None:
        """How far the true load is beside the circle, and from where the plan has it by now; and what is told."""
        if crane.cycle.step in beside and crane.travel.circle:
            hoist = crane.axes["hoist"].axis.position - crane.load.rope.stretch
            true = Point(crane.axes["trolley"].axis.position, hoist)
            beside[crane.cycle.step] += [abs(crane.travel.circle.radial_error(true)), crane.travel.worst]
        if not sway and crane.cycle.step is Step.LOWER:
            sway.append(crane.sway())
        if crane.newest != stand.talker.heard:
            seen.extend((event.code, event.source, event.value) for event in stand.talker.events())

    stand.watch = look
    stand.cycle(planned=190.0)
    stand.until(lambda: crane.cycle.state is StepState.WAITING, 300)
    assert crane.cycle.step is Step.WEIGHT_CONFIRMATION
    assert crane.load.locked and crane.load.stand == 0 and crane.weight == 210.0
    assert not crane.cycle.fits, "20 t beside the plan"
    assert stand.reason(CraneCommand.CONFIRM_WEIGHT, real(205.0)) == CraneReason.OTHER_WEIGHT
    assert stand.ask(CraneCommand.CONFIRM_WEIGHT, real(210.4)) is DONE
    stand.until(lambda: not crane.cycle.open, 300)
    assert crane.cycle.state is StepState.DONE and (crane.load.stand, crane.load.locked) == (2, False)
    lock = crane.places.stand(2)
    assert abs(crane.axes["bridge"].axis.position - lock["bridge"]) < 5
    assert crane.cycles_done == 1
    assert all(max(errors) <= 2 and len(errors) > 1000 for errors in beside.values())
    entered = [source for code, source, _ in seen if code == CraneEvent.STEP_ENTERED]
    assert entered == [int(step) for step in Step if step]
    ended = {source: value for code, source, value in seen if code == CraneEvent.STEP_ENDED}
    assert list(ended) == entered and sum(ended.values()) == pytest.approx(crane.cycle.seconds, abs=1)
    paths = [(source, value) for code, source, value in seen if code == CraneEvent.PATH_DONE]
    assert [source for source, _ in paths] == [220, 420] and all(value <= 2 for _, value in paths)
    left = [(source, value) for code, source, value in seen if code == CraneEvent.SWAY_LEFT]
    assert left == [(302, pytest.approx(sway[0], abs=2))], "told once, where it was left"
    told = [(source, value) for code, source, value in seen if code == CraneEvent.WEIGHT_CONFIRMED]
    assert told == [(0, pytest.approx(210.4))]


OFTEN = (Step.TO_LOCK, Step.ARC_LIFT, Step.TO_SET_DOWN)
"""Of which each run of the tests has one; the others are for `make soak`."""
PAUSES = [step for step in Step if step >= 100 and step not in (Step.SAFE_HEIGHT, Step.WEIGHT_CONFIRMATION)]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "step", [step if step in OFTEN else pytest.param(step, marks=pytest.mark.soak) for step in PAUSES]
)
def test_a_cycle_that_is_suspended_anywhere_goes_on_and_ends(step: Step) -> None:
    stand = in_step(step)
    crane = stand.crane
    stand.run(1.5 if step is Step.WEIGHT_CHECK else 3.0)
    if crane.cycle.step is not step:
        pytest.skip("a short one")
    assert stand.ask(CraneCommand.SUSPEND) is DONE
    stand.until(lambda: not crane.moving, 20)
    assert crane.state == CraneState.SUSPENDED
    took, lasts = crane.cycle.in_step, crane.cycle.seconds
    stand.run(5)
    assert crane.cycle.in_step == took and crane.cycle.seconds == pytest.approx(lasts + 5, abs=0.1)
    assert stand.ask(CraneCommand.RESUME) is DONE
    until_step(stand, Step.SAFE_HEIGHT_AGAIN)
    stand.until(lambda: not crane.cycle.open, 100)
    assert crane.cycles_done == 1 and crane.load.stand == 2


@pytest.mark.sweep(8)
@pytest.mark.parametrize("motor", [2, 3])
def test_an_axis_whose_motor_is_too_hot_when_its_turn_comes_suspends_instead_of_standing_for_ever(motor: int) -> None:
    stand = in_step(Step.BELOW_LOCK)
    crane = stand.crane
    hot = next(one for axis in crane.axes.values() for one in axis.motors if one.number == motor + 1)
    hot.temperature = HOT + 5
    stand.until(lambda: crane.cycle.state is StepState.SUSPENDED, 60)
    assert crane.cycle.suspension is Suspension.DRIVE
    hot.temperature = 60.0
    stand.run(2)
    stand.ask(CraneCommand.RESET)
    stand.run(2)
    assert stand.ask(CraneCommand.RESUME) is DONE
    until_step(stand, Step.INTO_LOCK)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("fault", "why"),
    [
        *((own.TRIP + n, Suspension.DRIVE) for n in (0, 1, 2)),
        (own.SILENT + 2, Suspension.DRIVE),
        (own.FEEDBACK_LOST + 1, Suspension.DRIVE),
        (own.ENCODER + 1, Suspension.ENCODER),
        (own.EMERGENCY_STOP, Suspension.EMERGENCY_STOP),
        (own.SCALE, Suspension.SCALE),
        (own.OVERLOAD, Suspension.OVERLOAD),
        (own.ROPE_OVERLAP, Suspension.ROPE),
    ],
)
@pytest.mark.parametrize("step", [Step.ARC_LIFT, pytest.param(Step.ARC_LOWERING, marks=pytest.mark.soak)])
def test_a_fault_during_the_arc_suspends_and_the_cycle_is_resumed_after_the_reset(
    step: Step, fault: int, why: Suspension
) -> None:
    stand = in_step(step)
    crane = stand.crane
    stand.run(12)
    stand.talker.fault(fault)
    stand.until(lambda: crane.cycle.state is StepState.SUSPENDED, 5)
    assert crane.cycle.suspension is why
    stand.until(lambda: not crane.moving, 20)
    stand.talker.fault(0)
    stand.run(2)
    stand.ask(CraneCommand.RESET)
    stand.run(2)
    assert stand.ask(CraneCommand.RESUME) is DONE
    until_step(stand, Step.SAFE_HEIGHT_AGAIN if step is Step.ARC_LOWERING else Step.LOADED_SAFE_HEIGHT)
    assert crane.load.stand == (2 if step is Step.ARC_LOWERING else 0)


@pytest.mark.sweep(8)
def test_a_lever_suspends_and_what_it_moved_away_is_asked_back() -> None:
    stand = in_step(Step.TO_SET_DOWN)
    crane = stand.crane
    stand.run(6)
    stand.jog("hoist", -1)
    stand.until(lambda: crane.cycle.state is StepState.SUSPENDED, 2)
    assert crane.cycle.suspension is Suspension.JOG
    stand.until(lambda: not crane.moving, 20)
    stand.release()
    stand.run(1)
    stand.jog("hoist", -1)
    stand.until(lambda: crane.axes["hoist"].position < crane.settings["safe_height"] - 400, 40)
    stand.release()
    assert stand.reason(CraneCommand.RESUME) == CraneReason.OUT_OF_PLACE
    stand.jog("hoist", 1)
    stand.until(lambda: crane.axes["hoist"].position > crane.settings["safe_height"] - 5, 60)
    stand.release()
    assert stand.ask(CraneCommand.RESUME) is DONE


@pytest.mark.sweep(8)
def test_an_abort_leaves_the_load_where_it_is_and_a_new_cycle_is_refused() -> None:
    stand = in_step(Step.LOADED_SAFE_HEIGHT)
    crane = stand.crane
    stand.run(5)
    assert stand.ask(CraneCommand.ABORT) is DONE
    stand.until(lambda: not crane.moving, 20)
    assert crane.cycle.state is StepState.ABORTED and crane.cycles_aborted == 1 and crane.load.locked
    at = crane.axes["hoist"].axis.position
    stand.run(5)
    assert abs(crane.axes["hoist"].axis.position - at) < 0.1
    assert stand.reason(CraneCommand.START_CYCLE, 1, 2, real(210)) == CraneReason.LOADED
    assert stand.reason(CraneCommand.RESUME) == CraneReason.NO_CYCLE


@pytest.mark.sweep(8)
def test_a_power_cycle_suspends_a_cycle_that_can_be_resumed() -> None:
    stand = in_step(Step.ARC_LIFT)
    crane = stand.crane
    stand.run(15)
    stand.talker.train(training.REG_POWER, 1)
    stand.run(3)
    assert crane.cycle.state is StepState.SUSPENDED and crane.mode is Mode.OFF
    assert crane.axes["hoist"].axis.held and abs(crane.axes["hoist"].speed) < 1
    assert stand.reason(CraneCommand.AUTOMATIC) == CraneReason.HELD
    assert stand.ask(CraneCommand.RESET) is DONE
    assert stand.ask(CraneCommand.AUTOMATIC) is DONE
    assert stand.ask(CraneCommand.RESUME) is DONE
    until_step(stand, Step.LOADED_SAFE_HEIGHT)


@pytest.mark.sweep(8)
def test_stop_stops_everything_and_suspends() -> None:
    stand = in_step(Step.TO_SET_DOWN)
    crane = stand.crane
    stand.run(5)
    assert crane.moving
    assert stand.ask(CraneCommand.STOP) is AnswerState.RUNNING
    stand.until(lambda: not crane.moving, 10)
    stand.run(0.1)
    assert (crane.mode, crane.state, crane.cycle.suspension) == (Mode.OFF, CraneState.OFF, Suspension.STOP)


def test_a_host_that_falls_silent_suspends_the_cycle() -> None:
    stand = Stand(settings={"host_timeout": 2.0})
    stand.cycle()
    stand.run(4)
    assert stand.crane.host_silent and stand.crane.cycle.suspension is Suspension.HOST


@pytest.mark.parametrize(
    ("start", "end", "planned", "why"),
    [
        (1, 1, 210, CraneReason.SAME_STAND),
        (0, 2, 210, CraneReason.NO_SUCH_STAND),
        (1, 5, 210, CraneReason.NO_SUCH_STAND),
        (2, 1, 210, CraneReason.STAND_OCCUPIED),
        (2, 3, 210, CraneReason.NO_LADLE),
        (1, 2, 355, CraneReason.OVERLOAD),
        (1, 2, math.nan, CraneReason.OVERLOAD),
        (1, 2, -1, CraneReason.OVERLOAD),
    ],
)
def test_a_cycle_that_cannot_be_is_refused(start: int, end: int, planned: float, why: CraneReason) -> None:
    stand = Stand(start="automatic")
    assert stand.reason(CraneCommand.START_CYCLE, start, end, real(planned)) == why


@pytest.mark.sweep(8)
def test_it_works_by_itself_when_nobody_commands_it() -> None:
    stand = Stand(start="automatic", orders=True, pause=1)
    stand.until(lambda: stand.crane.cycles_done == 2, 700)
    assert stand.crane.load.stand in (0, 3)


def test_a_crane_that_orders_its_own_cycles_moves_soon_after_it_was_switched_on_and_then_keeps_its_pause() -> None:
    stand = Stand(start="automatic", orders=True, pause=600)
    stand.until(lambda: stand.crane.moving, 6)
    assert stand.ask(CraneCommand.ABORT) is DONE
    stand.run(20)
    assert not stand.crane.cycle.open


# ---- the original's formulas


@pytest.mark.sweep(8)
def test_the_formulas_of_the_original_lift_too_and_are_farther_from_the_circle() -> None:
    def worst(mode: int) -> float:
        """Farthest that the load is from the circle [mm]."""
        stand = Stand(start="automatic", settings={"arc_speed": 100.0})
        assert stand.ask(CraneCommand.SELECT_PATH, mode) is DONE
        stand.cycle()
        until_step(stand, Step.ARC_LIFT)
        crane, errors = stand.crane, [0.0]

        def look() -> None:
            true = Point(
                crane.axes["trolley"].axis.position, crane.axes["hoist"].axis.position - crane.load.rope.stretch
            )
            if crane.travel.circle and crane.cycle.step is Step.ARC_LIFT:
                errors.append(abs(crane.travel.circle.radial_error(true)))

        stand.watch = look
        stand.until(lambda: stand.crane.cycle.step is not Step.ARC_LIFT, 200)
        return max(errors)

    ours, original = worst(0), worst(1)
    assert ours <= 2 and original > 3 * ours, f"{ours:g} mm, {original:g} mm"


# ---- settings


def test_settings_are_not_changed_while_an_axis_moves() -> None:
    stand = manual()
    stand.jog("trolley", 1)
    stand.until(lambda: stand.crane.axes["trolley"].speed > 20, 5)
    answer = stand.talker.commit({"trolley_step_1": 90.0}, STAGING)
    assert (answer.state, answer.reason) == (REJECTED, CraneReason.MOVING)
    stand.release()
    assert stand.talker.commit({"trolley_step_1": 90.0}, STAGING).state is DONE
    stand.run(0.5)
    stand.jog("trolley", 1)
    stand.until(lambda: stand.crane.axes["trolley"].speed > 88, 5)


@pytest.mark.parametrize(
    "wrong",
    [
        {"hoist_step_2": 10.0},
        {"hoist_step_4": 140.0},
        {"trolley_slow_down_time": 1.0},
        {"bridge_slow_down_time": 8.0},
        {"hoist_max_position": 20000.0},
        {"safe_height": 11000.0},
        {"arc_radius": 6000.0},
        {"overload_limit": 360.0},
    ],
)
def test_a_set_that_contradicts_itself_is_refused_as_a_whole(wrong: dict[str, float]) -> None:
    stand = manual()
    before = dict(stand.crane.settings)
    assert stand.talker.commit({**wrong, "trolley_fan_run_on": 99.0}, STAGING).state is REJECTED
    assert stand.crane.settings == before


def test_a_set_that_cannot_be_kept_leaves_every_old_value_in_effect_and_in_the_registers() -> None:
    stand = manual()
    before = dict(stand.crane.settings)
    stand.talker.fault(own.MEMORY)
    answer = stand.talker.commit({"hoist_step_1": 30.0, "trolley_fan_run_on": 99.0}, STAGING)
    assert (answer.state, answer.reason) == (REJECTED, CraneReason.NOT_KEPT)
    assert stand.crane.settings == before and stand.crane.axes["hoist"].steps[0] == pytest.approx(20.32)
    stand.talker.fault(0)
    assert stand.talker.commit({"hoist_step_1": 30.0}, STAGING).state is DONE
    assert stand.crane.settings == before | {"hoist_step_1": 30.0}


def test_other_ramps_and_speeds_are_driven() -> None:
    stand = manual(settings={"hoist_max_speed": 100.0, "hoist_step_4": 100.0, "hoist_step_3": 60.0})
    stand.ask(CraneCommand.SELECT_STEP, 4)
    stand.jog("hoist", -1)
    stand.until(lambda: stand.crane.axes["hoist"].speed < -98, 10)
    stand.run(2)
    assert stand.crane.axes["hoist"].speed == pytest.approx(-100, abs=1)
