"""What the crane's PLC shows: status image, configuration image, an image per axis, packed as the map says."""

from collections.abc import Mapping, Sequence
from dataclasses import astuple
from math import nan
from struct import Struct
from types import MappingProxyType

from app.blocks.arc_positioner.following import ArcPhase, Fault
from app.blocks.drive_control import DriveAlarm, Missing, State
from app.blocks.limit_switches import End, LimitAlarm
from app.sim.crane.configuration import PLACES, STANDS, Places
from app.sim.crane.plc_axis import FAULT_CODE, HOT, Motor, PlcAxis
from app.sim.crane.register_map import (
    AXIS_WORDS,
    CONFIGURATION_WORDS,
    START_PERMISSIVES,
    STATUS_BITS_OF,
    STATUS_REALS,
    STATUS_WORDS,
    DriveState,
    PathFault,
    PathPhase,
)
from app.sim.crane.state import CraneView

_STATUS = Struct(">15H15f3IH")
_CONFIGURATION = Struct(f">H{len(PLACES)}f")
_AXIS = Struct(">5H4x7f")
_DRIVE = Struct(">6H9fI")
_STATES: Mapping[State, int] = MappingProxyType({state: DriveState[state.name] for state in State})
_PHASES: Mapping[ArcPhase, int] = MappingProxyType({phase: PathPhase[phase.name] for phase in ArcPhase})
FAULT_WORDS: Mapping[Fault, int] = MappingProxyType({fault: PathFault[fault.name] for fault in Fault})
_ALARMS: Sequence[DriveAlarm] = tuple(DriveAlarm)
_MISSING: Sequence[Missing] = tuple(Missing)
_FAILED = frozenset({LimitAlarm.SLOW_FAILED, LimitAlarm.STOP_FAILED})


def status(crane: CraneView) -> bytes:
    """The status image."""
    cycle, travel, load = crane.cycle, crane.travel, crane.load
    planned, measured = travel.planned, crane.load_at
    circle = travel.circle
    words = (
        crane.state,
        crane.mode,
        _bits(crane.facts, STATUS_BITS_OF),
        cycle.step,
        cycle.state,
        cycle.suspension,
        cycle.start,
        cycle.end,
        crane.speed_step,
        crane.drives_selected,
        crane.path_mode,
        _PHASES[travel.phase],
        FAULT_WORDS[travel.fault],
        _bits(crane.start_permissives, START_PERMISSIVES),
        load.stand,
    )
    reals = (
        crane.weight,
        cycle.planned,
        cycle.confirmed,
        travel.angle,
        travel.goal,
        travel.path_error,
        travel.radial_error,
        travel.worst,
        cycle.in_step,
        cycle.seconds,
        circle.x if circle else nan,
        circle.y if circle else nan,
        measured.y,
        planned.x,
        planned.y,
    )
    assert len(reals) == len(STATUS_REALS)
    packed = _STATUS.pack(*words, *reals, crane.cycles_done, crane.cycles_aborted, cycle.number, crane.safety_trip)
    return packed.ljust(2 * (STATUS_WORDS - 2), b"\0")


def configuration(places: Places) -> bytes:
    """The configuration image."""
    return _CONFIGURATION.pack(STANDS, *astuple(places)).ljust(2 * (CONFIGURATION_WORDS - 2), b"\0")


def axis(crane: CraneView, one: PlcAxis) -> bytes:
    """The image of an axis."""
    two = len(one.motors) > 1
    commanded = any(motor.out.open_brakes for motor in one.motors)
    low, high = one.limits.alarms[End.LOW], one.limits.alarms[End.HIGH]
    flags = _word(
        one.moving,
        one.energised,
        one.high.stop,
        one.high.slow,
        one.low.slow,
        one.low.stop,
        one.encoder_ok,
        one.allowed.healthy,
        commanded,
        one.brakes_open[0],
        two and commanded,
        two and one.brakes_open[-1],
        one.motors[0].fan_on,
        two and one.motors[-1].fan_on,
        one.up_allowed,
        one.down_allowed,
    )
    alarms = _word(
        LimitAlarm.STOP_HIT in high,
        bool(high & _FAILED),
        LimitAlarm.SWITCH_STUCK in high,
        LimitAlarm.STOP_HIT in low,
        bool(low & _FAILED),
        LimitAlarm.SWITCH_STUCK in low,
        bool(low | high) and not (one.low.stop or one.high.stop),
        one.motors[0].temperature < HOT,
        two and one.motors[-1].temperature < HOT,
        one.brakes_agree,
    )
    up, down = crane.permissives(one)
    swing = crane.load.rope.stretch if one.name == "hoist" else crane.load.swing[one.name]
    packed = _AXIS.pack(
        _STATES[one.state],
        flags,
        alarms,
        _word(*up),
        _word(*down),
        one.position,
        one.speed,
        one.setpoint,
        one.target,
        100 * one.speed / one.max_speed,
        one.stop_distance,
        swing,
    )
    packed = packed.ljust(62, b"\0") + b"".join(_drive(one, motor) for motor in one.motors)
    return packed.ljust(2 * (AXIS_WORDS - 2), b"\0")


def _drive(one: PlcAxis, motor: Motor) -> bytes:
    control = motor.control
    rpm = one.max_rpm / one.max_speed
    missing = control.missing
    return _DRIVE.pack(
        0 if motor.silent else motor.drive.status,
        motor.out.control,
        _STATES[control.state],
        _word(*(alarm in control.alarms for alarm in _ALARMS)),
        _word(*(name not in missing for name in _MISSING), motor.selected),
        FAULT_CODE if motor.drive.cause else 0,
        one.speed * rpm,
        motor.out.reference * rpm,
        100 * one.speed / one.max_speed,
        100 * motor.torque,
        motor.temperature,
        motor.hours.hours,
        motor.hours.before / 3600,
        motor.fan.left,
        motor.hold_left,
        motor.starts & 0xFFFFFFFF,
    ).ljust(56, b"\0")


def _bits(values: Mapping[str, bool], names: Sequence[str]) -> int:
    return sum(1 << bit for bit, name in enumerate(names) if values[name])


def _word(*bits: object) -> int:
    return sum(1 << bit for bit, there in enumerate(bits) if there)
