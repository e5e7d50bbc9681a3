"""The start sequence of a drive with its brakes: order, time-outs, alarms, interruptions."""

import math
from collections.abc import Callable

import pytest

from app.blocks.drive_control import (
    DriveAlarm,
    DriveControl,
    DriveInputs,
    Missing,
    Outputs,
    State,
    Times,
    original_inhibited,
)
from app.blocks.limit_switches import SwitchPlaces
from app.profidrive.scaling import Scaling
from app.profidrive.state_machine import Reaction
from app.profidrive.words import ENABLES, RUN, Control, Status
from app.sim.crane.axis import AxisData
from app.sim.crane.driven import DrivenAxis
from app.sim.crane.figures import HOIST

DT = 0.01
PLACES = SwitchPlaces(300, 1300, 33080, 34080, 500, 20.32)


class Hoist:
    """The hoist in the middle of its way, and what its drive control went through."""

    def __init__(self) -> None:
        self.driven = DrivenAxis(AxisData.of(HOIST), PLACES, 15000.0)
        self.states: list[State] = []
        self.outs: list[Outputs] = []
        self.run(0.2)

    def run(self, seconds: float, speed: float = 0.0, *, acknowledge: bool = False) -> Outputs:
        for _ in range(round(seconds / DT)):
            out = self.driven.step(speed, DT, acknowledge=acknowledge)
            self.outs.append(out)
            if not self.states or self.states[-1] is not out.state:
                self.states.append(out.state)
        return out

    @property
    def alarms(self) -> set[DriveAlarm]:
        return self.driven.control.alarms

    def well(self) -> bool:
        """Goes through a whole movement."""
        self.run(0.5)
        out = self.run(3.0, 50.8)
        return out.state is State.RUNNING and self.driven.axis.speed > 40


def test_start_sequence_is_that_of_the_reference_step_by_step() -> None:
    hoist = Hoist()
    hoist.run(4.0, 50.8)
    hoist.run(36.0)
    assert hoist.states == [
        State.BLOCKED, State.READY, State.MAGNETISING, State.PRESET, State.OPENING, State.RUNNING,
        State.STOPPING, State.CLOSING, State.PRESET, State.READY,
    ]  # fmt: skip
    first: dict[str, int] = {}
    for n, out in enumerate(hoist.outs):
        for name, there in (
            ("preset", out.control == RUN), ("energised", out.running), ("open", out.open_brakes), ("reference", out.setpoint),
        ):  # fmt: skip
            if there:
                first.setdefault(name, n)
    assert list(first) == ["preset", "energised", "open", "reference"]
    assert (first["reference"] - first["open"]) * DT == pytest.approx(HOIST["brake_release"].value, abs=0.03)
    assert hoist.outs[-1].control == ENABLES
    preset = sum(out.state is State.PRESET for out in hoist.outs) * DT
    assert preset == pytest.approx(30.0, abs=0.1), "held 30 s after the last movement"
    assert hoist.driven.axis.strain == 0.0 and not hoist.alarms


def test_the_next_move_within_the_hold_starts_from_a_magnetised_motor() -> None:
    hoist = Hoist()
    hoist.run(3.0, 50.8)
    hoist.run(10.0)
    begin = len(hoist.outs)
    hoist.run(2.0, -50.8)
    started = next(n for n, out in enumerate(hoist.outs[begin:]) if out.setpoint)
    assert started * DT < HOIST["brake_release"].value + 0.05
    assert State.MAGNETISING not in {out.state for out in hoist.outs[begin:]}


def fail(name: str) -> Callable[[Hoist], None]:
    return lambda hoist: setattr(hoist.driven.faults, name, True)


def trip(hoist: Hoist) -> None:
    hoist.driven.drive.cause = Reaction.OFF2


def close(hoist: Hoist) -> None:
    hoist.driven.faults.feedback = False


def heal(hoist: Hoist) -> None:
    faults = hoist.driven.faults
    hoist.driven.drive.cause, hoist.driven.axis.stuck, faults.feedback = None, False, None
    faults.emergency = faults.no_permissive = faults.hot = faults.no_communication = False


@pytest.mark.parametrize(
    ("fault", "alarms", "closes"),
    [
        (fail("emergency"), set(), 1.5),
        (fail("no_permissive"), set(), 2.0),
        (fail("hot"), set(), 2.0),
        (fail("no_communication"), {DriveAlarm.COMMUNICATION}, 0.02),
        (trip, {DriveAlarm.DRIVE_TRIPPED}, 0.03),
        (close, {DriveAlarm.BRAKE_FEEDBACK_LOST}, 0.02),
    ],
    ids=["emergency", "permissive", "temperature", "communication", "trip", "brake"],
)
def test_what_interrupts_a_movement_closes_the_brakes_and_wants_a_new_request(
    fault: Callable[[Hoist], None], alarms: set[DriveAlarm], closes: float
) -> None:
    hoist = Hoist()
    hoist.run(4.0, 50.8)
    begin = len(hoist.outs)
    fault(hoist)
    hoist.run(4.0, 50.8)
    after = hoist.outs[begin:]
    assert next(n for n, out in enumerate(after) if not out.open_brakes) * DT <= closes
    assert not any(out.setpoint for out in after[2:]) and not hoist.driven.axis.speed
    assert hoist.alarms - {DriveAlarm.DRIVE_TRIPPED} == alarms - {DriveAlarm.DRIVE_TRIPPED}
    heal(hoist)
    begin = len(hoist.outs)
    hoist.run(3.0, 50.8, acknowledge=True)
    assert not any(out.setpoint for out in hoist.outs[begin:]), "still held from before"
    hoist.run(0.5, acknowledge=False)
    hoist.run(0.5, acknowledge=True)
    assert hoist.well() and not hoist.alarms


TIMEOUTS = [
    ("magnetising", DriveAlarm.MAGNETISING_TIMEOUT, Times().magnetising),
    ("brake stays closed", DriveAlarm.BRAKE_OPEN_TIMEOUT, 4.0),
    ("no motion", DriveAlarm.START_TIMEOUT, Times().start),
]


@pytest.mark.parametrize(("what", "alarm", "after"), TIMEOUTS, ids=[row[0] for row in TIMEOUTS])
def test_every_timeout_of_the_start_has_its_alarm_and_blocks_until_acknowledged(
    what: str, alarm: DriveAlarm, after: float
) -> None:
    hoist, wait = Hoist(), {"magnetising": State.MAGNETISING, "no motion": State.RUNNING}.get(what, State.OPENING)
    if what == "magnetising":
        hoist.driven.drive.magnetising_time = 100.0
    elif what == "no motion":
        hoist.driven.axis.stuck = True
        hoist.driven.faults.feedback = None
        hoist.driven.axis.brake = 0.0
    else:
        hoist.driven.axis.stuck = True
    if what == "no motion":
        # the feedback lies: open, and the brake is closed
        for _ in range(400):
            hoist.driven.faults.feedback = hoist.driven.out.open_brakes
            hoist.run(DT, 50.8)
    else:
        hoist.run(8.0, 50.8)
    waited = sum(out.state is wait for out in hoist.outs) * DT
    assert hoist.alarms == {alarm} and waited == pytest.approx(after, abs=0.05)
    assert not hoist.outs[-1].open_brakes and not hoist.outs[-1].setpoint
    heal(hoist)
    hoist.driven.drive.magnetising_time = 0.5
    hoist.run(1.0)
    assert not (hoist.run(3.0, 50.8).setpoint or Missing.NO_ALARM not in hoist.driven.control.missing)
    hoist.run(0.5, acknowledge=True)
    assert hoist.well()


def test_a_brake_that_does_not_close_is_held_by_the_drive() -> None:
    hoist = Hoist()
    hoist.run(3.0, 50.8)
    hoist.driven.axis.stuck = True
    hoist.run(60.0)
    out = hoist.outs[-1]
    assert hoist.alarms == {DriveAlarm.BRAKE_CLOSE_TIMEOUT} and out.state is State.CLOSING
    assert out.running and out.control == RUN and not out.setpoint and not out.open_brakes
    hoist.run(0.5, acknowledge=True)
    assert hoist.alarms, "its cause is there"
    heal(hoist)
    hoist.run(1.0)
    assert not hoist.alarms, "seen, and gone"
    assert hoist.well()


def test_a_stop_that_takes_too_long_closes_the_brake_on_the_moving_axis() -> None:
    hoist = Hoist()
    hoist.driven.control.times = Times(stop=0.5)
    hoist.run(6.0, 132.08)
    hoist.run(0.6)
    assert hoist.alarms == {DriveAlarm.STOP_TIMEOUT} and not hoist.outs[-1].open_brakes


def test_one_acknowledgement_resets_the_drive_and_the_alarm() -> None:
    hoist = Hoist()
    hoist.run(3.0, 50.8)
    trip(hoist)
    hoist.run(1.0)
    heal(hoist)
    hoist.run(0.5)
    assert hoist.alarms == {DriveAlarm.DRIVE_TRIPPED} and hoist.driven.drive.status & Status.FAULT
    assert hoist.run(DT, acknowledge=True).control & Control.ACKNOWLEDGE
    hoist.run(0.1, acknowledge=True)
    assert not hoist.alarms and not hoist.driven.drive.status & Status.FAULT


GOOD = int(Status.READY_TO_SWITCH_ON | Status.NO_COAST_STOP | Status.NO_QUICK_STOP)


@pytest.mark.parametrize(
    ("change", "missing"),
    [
        ({"status": None}, Missing.COMMUNICATION),
        ({"status": GOOD & ~Status.NO_COAST_STOP}, Missing.NO_COAST_STOP),
        ({"status": GOOD & ~Status.NO_QUICK_STOP}, Missing.NO_QUICK_STOP),
        ({"status": GOOD & ~Status.READY_TO_SWITCH_ON}, Missing.READY_TO_SWITCH_ON),
        ({"status": GOOD | Status.FAULT}, Missing.NO_FAULT),
        ({"status": GOOD | Status.SWITCHING_ON_INHIBITED}, Missing.NOT_INHIBITED),
        ({"temperature_ok": False}, Missing.MOTOR_TEMPERATURE),
        ({"emergency_ok": False}, Missing.EMERGENCY),
        ({"run_permissive": False}, Missing.RUN_PERMISSIVE),
        ({"brakes_open": (False, True)}, Missing.BRAKES_CLOSED),
    ],
)
def test_every_permissive_keeps_a_start_back_and_is_named(change: dict, missing: Missing) -> None:  # type: ignore[type-arg]
    control = DriveControl(Scaling(132.08))
    good = DriveInputs(GOOD, 0.0, (False, False), False, 50.0)
    bad = good._replace(**change)
    for run in (False, True, True, True):
        out = control.step(bad._replace(run=run), DT)
        assert out.state is State.BLOCKED and not out.control & Control.ON and not out.open_brakes
    assert missing in control.missing
    control.step(good._replace(run=True), DT)
    assert control.step(good._replace(run=True), DT).state is State.READY, "it was asked for while it was blocked"
    control.step(good, DT)
    assert control.step(good._replace(run=True), DT).state is State.MAGNETISING


def running(**fields: bool) -> tuple[DriveControl, DriveInputs]:
    control = DriveControl(Scaling(132.08), **fields)  # type: ignore[arg-type]
    control.state, control.armed = State.RUNNING, True
    return control, DriveInputs(GOOD | Status.OPERATION_ENABLED, 30.0, (True, True), True, 66.04)


@pytest.mark.parametrize(
    ("reference", "raw"), [(66.04, 0x2000), (-66.04, -0x2000), (1e9, 0x4000), (-1e9, -0x4000), (0.0, 0)]
)
def test_reference_is_scaled_and_never_beyond_a_hundred_per_cent(reference: float, raw: int) -> None:
    control, inputs = running()
    out = control.step(inputs._replace(reference=reference), DT)
    assert (out.setpoint, out.control) == (raw, RUN) and out.reference == pytest.approx(raw / 0x4000 * 132.08)
    control, inputs = running(reverse_by_bit=True)
    out = control.step(inputs._replace(reference=reference), DT)
    assert (out.setpoint, bool(out.control & Control.INVERT)) == (abs(raw), raw < 0)


@pytest.mark.parametrize("brakes", [(True, False), (False, True), (False, False)])
def test_no_reference_with_one_brake_of_two_closed(brakes: tuple[bool, bool]) -> None:
    control, inputs = running()
    out = control.step(inputs._replace(brakes_open=brakes), DT)
    assert (out.setpoint, out.open_brakes, out.state) == (0, False, State.CLOSING)
    control, inputs = running()
    control.state = State.OPENING
    assert control.step(inputs._replace(brakes_open=brakes), DT).setpoint == 0


def test_inputs_must_be_finite_and_safe_is_closed_and_off() -> None:
    control, inputs = running()
    for name in ("speed", "reference"):
        with pytest.raises(ValueError, match=name):
            control.step(inputs._replace(**{name: math.nan}), DT)  # type: ignore[arg-type]
    out = control.safe()
    assert (out.control, out.setpoint, out.open_brakes, out.state) == (ENABLES, 0, False, State.BLOCKED)
    with pytest.raises(ValueError, match="brake_open"):
        Times(brake_open=0.0)


def test_original_tells_inhibited_from_the_wrong_bit() -> None:
    assert original_inhibited(Status.NO_COAST_STOP) and not original_inhibited(Status.SWITCHING_ON_INHIBITED)


@pytest.mark.parametrize(
    ("change", "alarm"),
    [
        ({"status": None}, DriveAlarm.COMMUNICATION),
        ({"status": GOOD | Status.FAULT}, DriveAlarm.DRIVE_TRIPPED),
    ],
)
def test_a_drive_that_cannot_come_is_told_whether_it_is_asked_for_or_not(change: dict, alarm: DriveAlarm) -> None:  # type: ignore[type-arg]
    """It may have tripped while it rested, when nobody watched it: a cycle would begin, and hang its load up until its turn comes."""
    for run in (True, False):
        control = DriveControl(Scaling(132.08))
        good = DriveInputs(GOOD, 0.0, (False, False), False, 50.0)
        bad = good._replace(**change)

        def go(inputs: DriveInputs, seconds: float, control: DriveControl = control) -> None:
            for _ in range(round(seconds / DT)):
                control.step(inputs, DT)

        go(bad._replace(run_permissive=False), 60)
        assert not control.alarms, "it is not to run: somebody may be at work on it"
        go(bad._replace(run=run), control.times.start - 0.1)
        assert not control.alarms
        go(bad._replace(run=run), 0.2)
        assert control.alarms == {alarm}
        go(bad._replace(acknowledge=True), 0.1)
        assert control.alarms == {alarm}, "its cause is there"
        go(good, 0.1)
        assert not control.alarms
        go(good._replace(run=True), 0.1)
        assert control.state is State.MAGNETISING
