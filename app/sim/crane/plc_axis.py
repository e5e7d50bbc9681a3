"""An axis as the crane's PLC drives it: limit switches, one or two drives with their controls, brakes, motion, encoder, fans and hours."""

from collections.abc import Mapping, Sequence
from math import floor, inf, nan
from typing import NamedTuple

from app.blocks.drive_control import DriveControl, DriveInputs, State, Times
from app.blocks.drive_selection import DriveSelection, Selection
from app.blocks.limit_switches import Allowed, LimitSwitches, Switches, SwitchPlaces
from app.blocks.motor_hours import FanRunOn, RunningHours
from app.profidrive.scaling import Scaling
from app.profidrive.state_machine import Reaction
from app.sim.crane import training
from app.sim.crane.axis import Axis, AxisData, Brake
from app.sim.crane.configuration import AXES, Places
from app.sim.crane.figures import AXES as FIGURES
from app.sim.crane.register_map import DRIVES, SafetyTrip, drives_of
from app.sim.sinamics.axis_drive import VirtualDrive

COOL, WARM, HOT = 25.0, 60.0, 140.0
"""Temperature of a motor [°C]: of its hall, what full torque adds, and where its protection answers; no source."""
WARMING = 600.0
"""Time constant of a motor's temperature [s]."""
AT_REST = 1.0
"""Slower than this the axis stands [mm/s]."""
RESTS = (State.BLOCKED, State.READY, State.PRESET)
RESTING = 0.1
"""How often an axis that stands behind closed brakes is looked at [s]."""
NOWHERE = SwitchPlaces(0.0, 0.0, 0.0, 0.0, 1.0, 1.0)
FAULT_CODE = 7860
"""What a drive that the instructor tripped shows: F07860, external fault 1."""


class Asked(NamedTuple):
    """What is wanted of an axis in a scan."""

    speed: float = 0.0
    """[mm/s], signed."""
    run: bool = False
    """Energised with open brakes, also at speed 0."""


class Surroundings(NamedTuple):
    """What holds for every axis in a scan."""

    emergency_ok: bool
    up_ok: bool
    """Of the hoist: raising is permitted by scale, load and rope."""
    down_ok: bool
    acknowledge: bool
    fault: int
    """Code of the instructor's fault."""
    load: float
    """On the hook [1 = full load]."""


class Motor:
    """One motor with its drive, the control of it, its fan and hours."""

    def __init__(self, number: int, scaling: Scaling) -> None:
        self.number = number
        """From 1, as in `DRIVES`."""
        self.scaling = scaling
        self.hours, self.starts = RunningHours(), 0
        self.temperature = COOL
        self.fan_on = False
        self.start_up()

    def start_up(self) -> None:
        """What a power cycle forgets."""
        self.drive, self.control = VirtualDrive(self.scaling), DriveControl(self.scaling)
        self.fan = FanRunOn(0.0)
        self.out = self.control.safe()
        self.torque = self.reference = 0.0
        self.silent = self.selected = False
        self.reset_hours = False

    @property
    def running(self) -> bool:
        """A reference would go out."""
        return self.control.state is State.RUNNING

    @property
    def hold_left(self) -> float:
        """Of the preset [s]."""
        preset = self.control.state is State.PRESET
        return max(0.0, self.control.times.preset_hold - self.control.elapsed) if preset else 0.0

    def count(self, torque: float, hot: bool, dt: float) -> None:
        """Hours, fan and temperature of `dt` [s] at `torque` [part of the rated one]."""
        energised = self.out.running
        self.hours.step(energised, dt, reset=self.reset_hours)
        self.reset_hours = False
        self.fan_on = self.fan.step(energised, dt)
        self.torque = torque if energised else 0.0
        goal = 2 * HOT if hot else COOL + WARM * self.torque**2
        time = WARMING / 100 if hot or self.temperature > HOT - 20 else WARMING
        self.temperature += (goal - self.temperature) * min(1.0, dt / time)


class PlcAxis:
    """One axis."""

    def __init__(self, name: str, settings: Mapping[str, float], places: Places, position: float) -> None:
        self.name, self.number = name, AXES.index(name) + 1
        self._places = places
        self._resolution = FIGURES[name]["resolution"].value
        scaling = Scaling(settings[f"{name}_max_speed"])
        self.motors = tuple(Motor(DRIVES.index(drive) + 1, scaling) for drive in drives_of(name))
        self.axis = Axis(AxisData.of(FIGURES[name]), position=position)
        if len(self.motors) > 1:
            self.axis.second = Brake()
        self.selection = Selection.BOTH
        self._trip = SafetyTrip.NONE
        self.start_up(settings)

    def start_up(self, settings: Mapping[str, float]) -> None:
        """What a power cycle forgets: everything but the mechanics, hours and the selection."""
        for motor in self.motors:
            motor.start_up()
        self._select = DriveSelection()
        self.allowed = Allowed(0.0, 0.0, True)
        self.low, self.high = Switches(), Switches()
        self.setpoint = 0.0
        self.target = nan
        self.encoder_ok = True
        self.position = 0.0
        """As measured; it stays while the encoder is bad [mm]."""
        self.brakes_open = (False,) * len(self.motors)
        self.up_allowed = self.down_allowed = False
        self._since = 0.0
        self._last: tuple[object, ...] = ()
        self.active: Sequence[Motor] = self.motors
        self._permissive = True
        self.limits = LimitSwitches(NOWHERE)
        self.take(settings)
        self._read(0)

    def take(self, settings: Mapping[str, float]) -> None:
        """Settings in effect; only at standstill."""
        value = {key.removeprefix(f"{self.name}_"): v for key, v in settings.items() if key.startswith(self.name)}
        self.max_speed, self.max_rpm = value["max_speed"], value["max_rpm"]
        self.steps = [value[f"step_{n}"] for n in (1, 2, 3, 4)]
        self._factor = value["resolution"]
        speed = self.max_speed
        data = AxisData.of(FIGURES[self.name])
        self.axis.take(
            data.with_(
                max_speed=speed,
                acceleration=speed / value["speed_up_time"],
                deceleration=speed / value["slow_down_time"],
                safety_speed=FIGURES[self.name]["over_speed"].value * speed if self.name == "hoist" else 0.0,
            )
        )
        scaling = Scaling(speed)
        times = Times(
            preset_hold=value["preset_hold"], brake_open=value["brake_timeout"], stop=value["slow_down_time"] + 5
        )
        for motor in self.motors:
            motor.scaling = motor.drive.scaling = motor.control.scaling = scaling
            motor.control.times = times
            motor.fan.run_on = value["fan_run_on"]
        places, name = self._places, self.name
        ends = [getattr(places, f"{name}_{end}_at") for end in ("lower_stop", "lower_slow", "upper_slow", "upper_stop")]
        low_stop, low_slow, high_slow, high_stop = ends
        self.limits.places = self._switch_places = SwitchPlaces(
            low_stop, low_slow, high_slow, high_stop, value["end_tolerance"], value["step_1"]
        )

    # ---- what others ask

    @property
    def speed(self) -> float:
        """[mm/s]"""
        return self.axis.speed

    @property
    def running(self) -> bool:
        """Every drive that works is energised, its brakes are open: a reference goes out."""
        return bool(self.active) and all(motor.running for motor in self.active)

    @property
    def moving(self) -> bool:
        """It moves, or its brakes are held open: they fall in a moment later, those that stick never."""
        return abs(self.axis.speed) > AT_REST / 2 or any(motor.out.open_brakes for motor in self.motors)

    @property
    def safety_trip(self) -> SafetyTrip:
        """Why its safety brakes have fallen in; they do it at over-speed by themselves."""
        if not self.axis.safety_brake:
            return SafetyTrip.NONE
        return self._trip or SafetyTrip.OVER_SPEED

    def trip(self, why: SafetyTrip) -> None:
        """The safety brakes fall in, where the axis has some: the hoist."""
        if self.axis.data.safety_speed and not self.axis.safety_brake:
            self.axis.safety_brake, self._trip = True, why

    def lift(self) -> None:
        """The safety brakes are lifted."""
        self.axis.safety_brake, self._trip = False, SafetyTrip.NONE

    @property
    def energised(self) -> bool:
        """A drive has torque."""
        return any(motor.out.running for motor in self.motors)

    @property
    def alarmed(self) -> bool:
        """A drive that works has an alarm."""
        return any(motor.control.alarms for motor in self.active)

    @property
    def drives_ok(self) -> bool:
        """Those that work are there, have no alarm and no motor that is too hot."""
        hot = any(motor.temperature >= HOT for motor in self.active)
        return bool(self.active) and self._permissive and not self.alarmed and not hot

    @property
    def state(self) -> State:
        """Of the drive that works, of two the one that is less far."""
        states = list(State)
        return min((motor.control.state for motor in self.active or self.motors), key=states.index)

    @property
    def stop_distance(self) -> float:
        """Way to standstill [mm], signed."""
        return self.axis.speed * abs(self.axis.speed) / (2 * self.axis.data.deceleration)

    @property
    def brakes_agree(self) -> bool:
        """Every feedback says what is commanded, once the brake has had its time."""
        opened = any(motor.out.open_brakes for motor in self.motors)
        return all(there == opened for there in self.brakes_open)

    # ---- one scan

    def step(self, asked: Asked, around: Surroundings, dt: float) -> None:
        """`dt` [s] of switches, controls, drives and motion; an axis that rests is looked at now and then."""
        now = (
            asked.run,
            around.emergency_ok,
            around.acknowledge,
            around.fault,
            self.selection,
            around.up_ok,
            around.down_ok,
        )
        self._since += dt
        if now == self._last and not asked.run and self._since < RESTING and not self.awake:
            return
        dt, self._since, self._last = min(self._since, RESTING), 0.0, now
        self._read(around.fault)
        self.allowed = self.limits.step(
            self.low, self.high, self.position if self.encoder_ok else None, acknowledge=around.acknowledge
        )
        self._choose(around)
        safe = around.emergency_ok and self.drives_ok
        self.up_allowed = safe and around.up_ok and self.allowed.high > 0
        self.down_allowed = safe and around.down_ok and self.allowed.low > 0
        wanted = self.allowed.limit(asked.speed)
        if (wanted > 0 and not around.up_ok) or (wanted < 0 and not around.down_ok):
            wanted = 0.0
        self.setpoint = wanted
        self._drive(asked.run and (wanted != 0 or not asked.speed), wanted, around, dt)

    @property
    def awake(self) -> bool:
        """Something of it changes from scan to scan: not with drives that are off, or energised behind closed brakes."""
        return (
            self.axis.speed != 0.0
            or self.axis.brake > 0
            or any(self.brakes_open)
            or any(motor.control.state not in RESTS for motor in self.motors)
        )

    def _read(self, fault: int) -> None:
        """Switches, encoder and brakes."""
        places, at = self._switch_places, self.axis.position
        first = 2 * (self.number - 1)
        slow_dead, stop_dead = fault - training.SLOW_DEAD - first, fault - training.STOP_DEAD - first
        self.low = Switches(at <= places.low_slow and slow_dead != 0, at <= places.low_stop and stop_dead != 0)
        self.high = Switches(at >= places.high_slow and slow_dead != 1, at >= places.high_stop and stop_dead != 1)
        self.encoder_ok = fault != training.ENCODER + self.number - 1
        if self.encoder_ok:
            self.position = floor(at / self._resolution) * self._factor
        real = [self.axis.is_open, *([self.axis.second.is_open] if self.axis.second else [])]
        lost = fault - training.FEEDBACK_LOST
        self.brakes_open = tuple(there and n != lost for n, there in zip(self._brake_numbers, real, strict=True))
        sticks = fault - training.BRAKE_STICKS
        self.axis.stuck = sticks == self._brake_numbers[0]
        if self.axis.second:
            self.axis.second.stuck = sticks == self._brake_numbers[1]

    @property
    def _brake_numbers(self) -> Sequence[int]:
        return [motor.number - 1 for motor in self.motors]

    def _choose(self, around: Surroundings) -> None:
        """Which drives work."""
        for motor in self.motors:
            motor.silent = around.fault == training.SILENT + motor.number - 1
            motor.drive.cause = Reaction.OFF2 if around.fault == training.TRIP + motor.number - 1 else None
        if len(self.motors) == 1:
            self.motors[0].selected = True
            return
        one, two = self.motors
        chosen = self._select.step(
            self.selection,
            (one.hours.hours, two.hours.hours),
            (not one.silent and not one.control.alarms, not two.silent and not two.control.alarms),
            moving=self.moving,
        )
        one.selected, two.selected = chosen.active
        self.active = [motor for motor in self.motors if motor.selected]
        self._permissive = chosen.permissive

    def _drive(self, run: bool, wanted: float, around: Surroundings, dt: float) -> None:
        axis, before = self.axis, self.axis.speed
        failed = any(motor.control.alarms for motor in self.active)
        for motor in self.motors:
            control, drive, mine = motor.control, motor.drive, motor.selected
            partner = failed and not control.alarms and len(self.active) > 1
            inputs = DriveInputs(
                None if motor.silent else drive.status,
                before,
                self.brakes_open if mine else (False,) * len(self.brakes_open),
                run and mine and not failed,
                wanted,
                around.emergency_ok and not partner,
                mine,
                motor.temperature < HOT,
                around.acknowledge,
            )
            state = control.state
            motor.out = control.step(inputs, dt)
            motor.starts += control.state is State.MAGNETISING and state is not State.MAGNETISING
        opens = bool(self.active) and all(motor.out.open_brakes for motor in self.active)
        torque = quick_stop = False
        setpoint = inf
        for motor in self.motors:
            word = 0 if motor.silent else motor.out.control
            # of two on one drum, none pulls before the other has its brakes open
            raw = motor.out.setpoint if self.running else 0
            driven = motor.drive.step(word, raw, before, dt)
            motor.reference = driven.setpoint
            if motor.selected and driven.torque:
                torque, quick_stop = True, quick_stop or driven.quick_stop
                setpoint = driven.setpoint if abs(driven.setpoint) < abs(setpoint) else setpoint
        axis.step(setpoint if torque else 0.0, opens, dt, torque=torque, quick_stop=quick_stop)
        if around.fault == training.OVER_SPEED and abs(axis.speed) > AT_REST:
            self.trip(SafetyTrip.OVER_SPEED)
        self._count(around, dt)

    def _count(self, around: Surroundings, dt: float) -> None:
        working = [motor for motor in self.motors if motor.out.running]
        push = min(1.0, abs(self.axis.speed) / self.max_speed) * 0.2
        torque = (around.load + push if self.name == "hoist" else 0.1 + push) / max(1, len(working))
        for motor in self.motors:
            motor.count(torque, around.fault == training.HOT + motor.number - 1, dt)
