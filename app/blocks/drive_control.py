"""S120_MNG: one drive with its brakes, from permissives to the closed brake."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import isfinite
from typing import NamedTuple

from app.profidrive.scaling import Scaling
from app.profidrive.words import ENABLES, Control, Status


class State(Enum):
    """Where the start sequence is."""

    BLOCKED = "blocked"
    """A permissive is missing, or an alarm stands."""
    READY = "ready"
    MAGNETISING = "magnetising"
    """Preset: the drive is switched on and does not yet have its torque."""
    PRESET = "preset"
    """Energised with closed brakes, until the hold runs out."""
    OPENING = "opening"
    """Brake command given, feedback missing."""
    RUNNING = "running"
    """Reference given."""
    STOPPING = "stopping"
    """Reference 0, on the way to zero speed."""
    QUICK_STOP = "quick_stop"
    CLOSING = "closing"
    """Brake command taken, feedback still open."""


class DriveAlarm(Enum):
    """Stands until it is acknowledged and its cause is gone, in whichever order."""

    COMMUNICATION = "communication"
    DRIVE_TRIPPED = "drive_tripped"
    """Torque was lost outside a stop of ours, or a drive that stands faulted was to run for `Times.start`."""
    MAGNETISING_TIMEOUT = "magnetising_timeout"
    BRAKE_OPEN_TIMEOUT = "brake_open_timeout"
    BRAKE_FEEDBACK_LOST = "brake_feedback_lost"
    """A brake closed, or seemed to, while it was commanded open."""
    BRAKE_CLOSE_TIMEOUT = "brake_close_timeout"
    """A brake still says open: the drive goes on holding the load."""
    START_TIMEOUT = "start_timeout"
    """Reference given and no motion."""
    STOP_TIMEOUT = "stop_timeout"
    """No zero speed in time: the brake closed on the moving axis."""


class Missing(Enum):
    """A permissive that is not there."""

    COMMUNICATION = "communication"
    NO_COAST_STOP = "no_coast_stop"
    NO_QUICK_STOP = "no_quick_stop"
    READY_TO_SWITCH_ON = "ready_to_switch_on"
    NO_FAULT = "no_fault"
    NOT_INHIBITED = "not_inhibited"
    MOTOR_TEMPERATURE = "motor_temperature"
    EMERGENCY = "emergency"
    RUN_PERMISSIVE = "run_permissive"
    NO_ALARM = "no_alarm"
    BRAKES_CLOSED = "brakes_closed"
    """A brake is open that nobody opened."""


class DriveInputs(NamedTuple):
    """Of one scan."""

    status: int | None
    """ZSW1; None = no communication."""
    speed: float
    """Measured [mm/s], signed."""
    brakes_open: Sequence[bool]
    """Feedback of every brake."""
    run: bool
    """A movement is wanted: energise and open the brakes."""
    reference: float = 0.0
    """Speed wanted [mm/s], signed."""
    emergency_ok: bool = True
    run_permissive: bool = True
    temperature_ok: bool = True
    acknowledge: bool = False
    """Counts when it comes."""


class Outputs(NamedTuple):
    """Of one scan."""

    control: int
    """STW1"""
    setpoint: int
    """NSOLL_A, signed."""
    reference: float
    """The same [mm/s]."""
    open_brakes: bool
    state: State
    running: bool
    """Motor energised: hours and fan count by it."""


@dataclass(frozen=True, slots=True)
class Times:
    """Time-outs [s].

    Raises:
        ValueError: one of them is not a finite number above 0.
    """

    preset_hold: float = 30.0
    """Energised after the last movement; source: thesis 002."""
    brake_open: float = 4.0
    """Source: thesis 002."""
    magnetising: float = 5.0
    """Assumed, as are those below."""
    start: float = 3.0
    stop: float = 8.0
    brake_close: float = 2.0
    quick_stop: float = 2.0
    """After it the brake closes whatever the speed is."""

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}, a finite number above 0 expected")


BRAKES_WANTED = frozenset({State.OPENING, State.RUNNING, State.STOPPING, State.QUICK_STOP})
"""States with the brake command on."""
ENERGISED = frozenset({State.MAGNETISING, State.PRESET, *BRAKES_WANTED, State.CLOSING})
"""States with the preset: the drive is switched on."""
PERMISSIVE_WORD = Status.NO_COAST_STOP | Status.NO_QUICK_STOP | Status.READY_TO_SWITCH_ON
PERMISSIVE_BITS = PERMISSIVE_WORD | Status.FAULT | Status.SWITCHING_ON_INHIBITED
"""Bits of ZSW1 that a start needs, and how they have to stand."""


@dataclass(slots=True)
class DriveControl:
    """Permissives → preset → energised → brakes open → feedback → reference → zero speed → brakes closed → preset hold → off.

    - The brakes are commanded open only while the drive says operation enabled; torque lost takes the command in the same scan.
    - A reference goes out only with every brake's feedback open.
    - Preset stays 30 s after the last movement, so that the next one begins with a magnetised motor.
    - Emergency stop: quick stop by the drive; the brakes close at zero speed, at the latest after `times.quick_stop`.
    - A brake that still says open keeps the drive energised at zero speed.
    - After an alarm or an interruption `run` has to be seen dropped before it counts again.
    - Every time-out has its alarm, and every alarm blocks the next start until it is acknowledged.

    Source: thesis 002, S120_MNG (reference/profidrive.md section 5, theses-facts.md section 2). What it leaves open is marked as assumed in
    `Times`; emergency stop as a quick stop, torque watch and holding against a stuck brake are ours.
    """

    scaling: Scaling
    """Of the set-point; reference = greatest speed [mm/s]."""
    times: Times = field(default_factory=Times)
    zero_speed: float = 1.0
    """Below it the axis stands [mm/s]."""
    reverse_by_bit: bool = False
    """As the original: a set-point without sign, and the inversion bit."""
    state: State = State.BLOCKED
    alarms: set[DriveAlarm] = field(default_factory=set)
    elapsed: float = 0.0
    """In this state [s]."""
    armed: bool = False
    """`run` was seen dropped since the last interruption."""
    missing: tuple[Missing, ...] = ()
    """Permissives that keep a start back."""
    acknowledged: set[DriveAlarm] = field(default_factory=set)
    """Alarms that somebody has seen and whose cause is still there."""
    _no_motion: float = 0.0
    _waited: float = 0.0
    """The drive has been silent or faulted for so long while it was off [s]."""
    _emergency: bool = False
    """A quick stop has taken the sequence; the drive switches off after it, and that is no trip."""
    _seen: bool = True
    """An acknowledgement that is there at the first scan is not new."""

    def step(self, inputs: DriveInputs, dt: float) -> Outputs:
        """One scan of `dt` [s].

        Raises:
            ValueError: speed or reference is not finite; `safe` is what holds then.
        """
        if not (isfinite(inputs.speed) and isfinite(inputs.reference)):
            name = "reference" if isfinite(inputs.speed) else "speed"
            raise ValueError(f"{name} is {getattr(inputs, name)}, a finite number expected")
        if inputs.acknowledge and not self._seen:
            self.acknowledged |= self.alarms
        self._seen = inputs.acknowledge
        if self.acknowledged:
            self.alarms -= self.acknowledged - self._causes(inputs)
            self.acknowledged &= self.alarms
        if not inputs.run:
            self.armed = True
        self.missing = () if self._permitted(inputs) else tuple(self._missing(inputs))
        self.elapsed += dt
        before = self.state
        self._watch(inputs)
        self._wait(inputs, dt)
        if self.state is before:
            self._sequence(inputs, dt)
        if self.state is not before:
            self.elapsed = 0.0
        return self._outputs(inputs)

    def safe(self) -> Outputs:
        """An input is bad: brakes closed, drive off."""
        self._fail(None)
        self.state = State.BLOCKED
        return Outputs(ENABLES, 0, 0.0, False, self.state, False)

    def _permitted(self, inputs: DriveInputs) -> bool:
        """Nothing is missing: the usual case, found out without a list."""
        return (
            inputs.status is not None
            and inputs.status & PERMISSIVE_BITS == PERMISSIVE_WORD
            and inputs.temperature_ok
            and inputs.emergency_ok
            and inputs.run_permissive
            and not self.alarms
            and (self.state in BRAKES_WANTED or not any(inputs.brakes_open))
        )

    def _missing(self, inputs: DriveInputs) -> Sequence[Missing]:
        status = inputs.status
        word = status or 0
        rows = (
            (Missing.COMMUNICATION, status is not None),
            (Missing.NO_COAST_STOP, word & Status.NO_COAST_STOP),
            (Missing.NO_QUICK_STOP, word & Status.NO_QUICK_STOP),
            (Missing.READY_TO_SWITCH_ON, word & Status.READY_TO_SWITCH_ON),
            (Missing.NO_FAULT, status is not None and not word & Status.FAULT),
            (Missing.NOT_INHIBITED, status is not None and not word & Status.SWITCHING_ON_INHIBITED),
            (Missing.MOTOR_TEMPERATURE, inputs.temperature_ok),
            (Missing.EMERGENCY, inputs.emergency_ok),
            (Missing.RUN_PERMISSIVE, inputs.run_permissive),
            (Missing.NO_ALARM, not self.alarms),
            (Missing.BRAKES_CLOSED, self.state in BRAKES_WANTED or not any(inputs.brakes_open)),
        )
        return [name for name, there in rows if not there]

    def _watch(self, inputs: DriveInputs) -> None:
        """What interrupts at any time."""
        torque = inputs.status is not None and bool(inputs.status & Status.OPERATION_ENABLED)
        fault = inputs.status is not None and bool(inputs.status & Status.FAULT)
        if self.state not in ENERGISED:
            self._emergency = False
            return
        if inputs.status is None:
            self._fail(DriveAlarm.COMMUNICATION)
        elif fault or (not torque and self.state is not State.MAGNETISING):
            self._fail(None if self._emergency and not fault else DriveAlarm.DRIVE_TRIPPED)
        elif not inputs.emergency_ok:
            self.armed = False
            if self.state in BRAKES_WANTED:
                self.state, self._emergency = State.QUICK_STOP, True
            elif self.state is not State.CLOSING:
                self.state = State.BLOCKED
        elif self.state in (State.RUNNING, State.STOPPING) and not all(inputs.brakes_open):
            self._fail(DriveAlarm.BRAKE_FEEDBACK_LOST, State.CLOSING)

    def _wait(self, inputs: DriveInputs, dt: float) -> None:
        """A drive that could not come is told, also while nobody asks for it; one that is not to run is left alone, and an acknowledgement
        gives it the time anew."""
        silent = inputs.status is None
        unable = silent or bool((inputs.status or 0) & Status.FAULT)
        wanted = (inputs.run or inputs.run_permissive) and not inputs.acknowledge
        counts = unable and wanted and self.state not in ENERGISED
        self._waited = self._waited + dt if counts else 0.0
        alarm = DriveAlarm.COMMUNICATION if silent else DriveAlarm.DRIVE_TRIPPED
        if self._waited >= self.times.start and alarm not in self.alarms:
            self._fail(alarm)

    def _sequence(self, inputs: DriveInputs, dt: float) -> None:
        times, wanted = self.times, inputs.run and self.armed
        torque = bool((inputs.status or 0) & Status.OPERATION_ENABLED)
        stands = abs(inputs.speed) <= self.zero_speed
        match self.state:
            case State.BLOCKED:
                self.armed = self.armed and not inputs.run
                if not self.missing:
                    self.state = State.READY
            case State.READY:
                if self.missing:
                    self.state = State.BLOCKED
                elif wanted:
                    self.state = State.MAGNETISING
            case State.MAGNETISING:
                if not self._may_go_on(inputs):
                    self.armed, self.state = False, State.BLOCKED
                elif torque:
                    self.state = State.PRESET
                elif self.elapsed >= times.magnetising:
                    self._fail(DriveAlarm.MAGNETISING_TIMEOUT)
            case State.PRESET:
                if not self._may_go_on(inputs) or any(inputs.brakes_open):
                    self.armed, self.state = False, State.BLOCKED
                elif wanted:
                    self.state = State.OPENING
                elif self.elapsed >= times.preset_hold:
                    self.state = State.READY
            case State.OPENING:
                if not wanted or not self._may_go_on(inputs):
                    self.state = State.STOPPING if all(inputs.brakes_open) else State.CLOSING
                elif all(inputs.brakes_open):
                    self.state, self._no_motion = State.RUNNING, 0.0
                elif self.elapsed >= times.brake_open:
                    self._fail(DriveAlarm.BRAKE_OPEN_TIMEOUT, State.CLOSING)
            case State.RUNNING:
                asked = abs(inputs.reference) > self.zero_speed
                self._no_motion = self._no_motion + dt if asked and stands else 0.0
                if not wanted or not self._may_go_on(inputs):
                    self.armed = self.armed and not inputs.run
                    self.state = State.STOPPING
                elif self._no_motion >= times.start:
                    self._fail(DriveAlarm.START_TIMEOUT, State.CLOSING)
            case State.STOPPING:
                if stands:
                    self.state = State.CLOSING
                elif wanted and self._may_go_on(inputs):
                    self.state, self._no_motion = State.RUNNING, 0.0
                elif self.elapsed >= times.stop:
                    self._fail(DriveAlarm.STOP_TIMEOUT, State.CLOSING)
            case State.QUICK_STOP:
                if stands or self.elapsed >= times.quick_stop:
                    self.state = State.CLOSING
            case State.CLOSING:
                if not any(inputs.brakes_open):
                    goes_on = self._may_go_on(inputs) and not self._emergency
                    self.state = State.PRESET if goes_on else State.BLOCKED
                elif self.elapsed >= times.brake_close:
                    self.alarms.add(DriveAlarm.BRAKE_CLOSE_TIMEOUT)

    def _may_go_on(self, inputs: DriveInputs) -> bool:
        """What has to hold during the whole sequence."""
        return inputs.emergency_ok and inputs.run_permissive and inputs.temperature_ok and not self.alarms

    def _fail(self, alarm: DriveAlarm | None, then: State = State.BLOCKED) -> None:
        if alarm is not None:
            self.alarms.add(alarm)
            self.acknowledged.discard(alarm)
        self.armed, self.state = False, then

    def _causes(self, inputs: DriveInputs) -> set[DriveAlarm]:
        """Alarms whose cause is there now."""
        stays = set()
        if inputs.status is None:
            stays.add(DriveAlarm.COMMUNICATION)
        if inputs.status is None or inputs.status & Status.FAULT:
            stays.add(DriveAlarm.DRIVE_TRIPPED)
        if self.state not in BRAKES_WANTED and any(inputs.brakes_open):
            stays.add(DriveAlarm.BRAKE_CLOSE_TIMEOUT)
        return stays

    def _outputs(self, inputs: DriveInputs) -> Outputs:
        control = int(ENABLES)
        if self.state in ENERGISED and inputs.status is not None:
            control |= Control.ON
        if not inputs.emergency_ok or self.state is State.QUICK_STOP:
            control &= ~Control.NO_QUICK_STOP
        if inputs.acknowledge:
            control |= Control.ACKNOWLEDGE
        moves = self.state is State.RUNNING and all(inputs.brakes_open)
        setpoint, reference = 0, 0.0
        if moves:  # beyond 100 % no axis is meant to go
            setpoint = min(max(self.scaling.raw(inputs.reference), -self.scaling.one), self.scaling.one)
            reference = self.scaling.value(setpoint)
        if self.reverse_by_bit:
            control |= Control.INVERT if setpoint < 0 else 0
            setpoint = abs(setpoint)
        torque = bool((inputs.status or 0) & Status.OPERATION_ENABLED)
        return Outputs(
            control,
            setpoint,
            reference,
            self.state in BRAKES_WANTED and torque,
            self.state,
            self.state in ENERGISED and torque,
        )


def original_inhibited(status: int) -> bool:
    """The original's PWR_ON_INHIB_ACT: taken from bit 4 (no coast stop) instead of bit 6, a known defect; for comparison only."""
    return bool(status & Status.NO_COAST_STOP)
