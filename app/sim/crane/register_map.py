"""The register map of the ladle crane's virtual PLC: where every value lies, what words, bits and codes mean.

All axes and all drives have the same words. `up` is the way to greater positions: hoist up, trolley right, bridge forward; `upper` and
`lower` are the ends there. Positions in mm, the hoist's over its lowest position, loads in t, speeds in mm/s.

Header words 23-31: 3 axes · 4 drives · settings · 4 stands · 59 events.

| registers | content |
| --- | --- |
| 0x0100, 64 words | status image: `STATUS_WORDS_OF`, `STATUS_BITS_OF`, `STATUS_REALS`, `STATUS_COUNTS`, `SAFETY_TRIP` |
| 0x0180, 64 words | configuration image: +1 stands, then f32 in the order of `PLACES` |
| 0x0200, 104 words | settings image: generation · count · f32 in the order of `SETTINGS` · spare · generation; staged at 0x0280 |
| 0x0300, 0x0320, 0x0380, 0x0400 | commands, answers, hold-to-run, events (registers/plc_map.py) |
| 0x0900, 0x0980, 0x0A00, 92 words each | image of hoist, trolley, bridge: axis, drive 1 at +32, the hoist's drive 2 at +60 |

A permissive's bit is 1 when it is met, an alarm's when it stands.

Hold-to-run: bits 0 hoist up, 1 down, 2 trolley up (right), 3 down (left), 4 bridge up (forward), 5 down (backward); two axes at a time =
none. Retained: settings, selections, hours, starts, counters, a cycle that was suspended, events.
"""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from types import MappingProxyType

from app.blocks.drive_control import DriveAlarm, Missing
from app.profidrive.words import Control, Status
from app.sim.crane.configuration import AXES, PLACES, SETTINGS
from app.sim.plc import HEADER_PLACES, REASON_UNKNOWN, REASON_WRONG_STATE, RegisterPlace

STATUS, CONFIGURATION, SETTINGS_AT, STAGING = 0x0100, 0x0180, 0x0200, 0x0280
STATUS_WORDS, CONFIGURATION_WORDS, AXIS_WORDS = 64, 64, 92
AXIS_AT: Mapping[str, int] = MappingProxyType(dict(zip(AXES, (0x0900, 0x0980, 0x0A00), strict=True)))
DRIVE_AT = (32, 60)
"""Offsets of the drives in the image of their axis."""

DRIVES: Sequence[str] = ("hoist_1", "hoist_2", "trolley_1", "bridge_1")
"""By number from 1, as events and commands name them."""


class CraneCommand(IntEnum):
    """Command codes."""

    AUTOMATIC = 1
    STOP = 2
    MANUAL = 3
    RESET = 4
    START_CYCLE = 5
    SUSPEND = 6
    RESUME = 7
    ABORT = 8
    CONFIRM_WEIGHT = 9
    SELECT_STEP = 10
    SELECT_DRIVES = 11
    RESET_HOURS = 12
    SELECT_PATH = 13


class CraneReason(IntEnum):
    """Why a command is refused; 20 to 22 come from the base."""

    UNKNOWN = REASON_UNKNOWN
    WRONG_STATE = REASON_WRONG_STATE
    EMERGENCY_STOP = 3
    HELD = 4
    MOVING = 5
    NO_SUCH_STAND = 6
    SAME_STAND = 7
    NO_LADLE = 8
    STAND_OCCUPIED = 9
    LOADED = 10
    NOT_ALLOWED = 11
    OUT_OF_PLACE = 12
    NO_WEIGHT_ASKED = 13
    OTHER_WEIGHT = 14
    NO_SUCH_DRIVE = 15
    NO_CYCLE = 16
    CYCLE_RUNS = 17
    OVERLOAD = 18
    NOT_KEPT = 19


class CraneEvent(IntEnum):
    """Codes of the ring. Source of a drive: its number in `DRIVES` from 1; of an end: 1 hoist lower, 2 upper, 3, 4 trolley, 5, 6 bridge."""

    AUTOMATIC, MANUAL, STOP, RESET = 1, 2, 3, 4
    EMERGENCY_STOP, EMERGENCY_STOP_OFF = 5, 6
    CYCLE_STARTED, STEP_ENTERED, STEP_ENDED = 7, 8, 9
    SUSPENDED, RESUMED, CYCLE_DONE, CYCLE_ABORTED = 10, 11, 12, 13
    WEIGHT_CHECKED, WEIGHT_CONFIRMED, PATH_DONE = 14, 15, 16
    LOCKED, UNLOCKED, LIFTED, SET_DOWN = 17, 18, 19, 20
    DRIVE_COMMUNICATION, DRIVE_TRIPPED, MAGNETISING_TIMEOUT, BRAKE_OPEN_TIMEOUT = 21, 22, 23, 24
    BRAKE_FEEDBACK_LOST, BRAKE_CLOSE_TIMEOUT, START_TIMEOUT, STOP_TIMEOUT = 25, 26, 27, 28
    STOP_HIT, SWITCH_FAILED, SWITCH_STUCK = 29, 30, 31
    OVERLOAD, OVERLOAD_OVER = 32, 33
    ROPE_OVERLAP, ROPE_OVERLAP_OVER = 34, 35
    SLACK_ROPE, SLACK_ROPE_OVER = 36, 37
    SCALE_FAULT, SCALE_BACK = 38, 39
    ENCODER_FAULT, ENCODER_BACK = 40, 41
    SAFETY_BRAKE = 42
    PATH_FAULT = 43
    HOT, COOL = 44, 45
    POWER_UP = 46
    HOST_SILENT, HOST_BACK = 47, 48
    SETTINGS = 49
    DRIVES_SELECTED, HOURS_RESET, PATH_SELECTED, SWAY_LEFT = 50, 51, 52, 53
    SAFETY_BRAKE_STOP = 54
    """The safety brakes fell in with the emergency stop: what came of it, not an alarm of its own."""


DRIVE_EVENTS: Mapping[DriveAlarm, CraneEvent] = MappingProxyType(
    {
        DriveAlarm.COMMUNICATION: CraneEvent.DRIVE_COMMUNICATION,
        DriveAlarm.DRIVE_TRIPPED: CraneEvent.DRIVE_TRIPPED,
        DriveAlarm.MAGNETISING_TIMEOUT: CraneEvent.MAGNETISING_TIMEOUT,
        DriveAlarm.BRAKE_OPEN_TIMEOUT: CraneEvent.BRAKE_OPEN_TIMEOUT,
        DriveAlarm.BRAKE_FEEDBACK_LOST: CraneEvent.BRAKE_FEEDBACK_LOST,
        DriveAlarm.BRAKE_CLOSE_TIMEOUT: CraneEvent.BRAKE_CLOSE_TIMEOUT,
        DriveAlarm.START_TIMEOUT: CraneEvent.START_TIMEOUT,
        DriveAlarm.STOP_TIMEOUT: CraneEvent.STOP_TIMEOUT,
    }
)
"""Alarm of a drive's control → the event that tells it."""


class CraneState(IntEnum):
    """State word."""

    OFF = 0
    MANUAL = 1
    MANUAL_MOVING = 2
    AUTOMATIC = 3
    RUNNING = 4
    SUSPENDED = 5
    STOPPING = 6
    EMERGENCY_STOP = 7
    HELD = 8


class Mode(IntEnum):
    """Mode word."""

    OFF = 0
    AUTOMATIC = 1
    MANUAL = 2


class Step(IntEnum):
    """Step word: the steps of the thesis by their numbers."""

    NONE = 0
    INIT = 1
    START = 2
    SAFE_HEIGHT = 100
    TO_PICK_UP = 102
    BELOW_LOCK = 200
    TO_LOCK = 201
    INTO_LOCK = 202
    ARC_LIFT = 220
    WEIGHT_CHECK = 221
    WEIGHT_CONFIRMATION = 222
    LOADED_SAFE_HEIGHT = 300
    TO_SET_DOWN = 302
    LOWER = 400
    ARC_LOWERING = 420
    BELOW_LOCK_AGAIN = 421
    OUT_OF_LOCK = 422
    SAFE_HEIGHT_AGAIN = 423


class SafetyTrip(IntEnum):
    """What made the hoist's safety brakes fall in, of several the first."""

    NONE = 0
    OVER_SPEED = 1
    EMERGENCY_STOP = 2
    POWER = 3
    """The crane lost its supply."""


class StepState(IntEnum):
    """What becomes of the step."""

    NONE = 0
    RUNNING = 1
    WAITING = 2
    """For a person."""
    SUSPENDED = 3
    DONE = 4
    """With it the cycle."""
    ABORTED = 5


class Suspension(IntEnum):
    """Why a cycle is suspended."""

    NONE = 0
    OPERATOR = 1
    JOG = 2
    STOP = 3
    EMERGENCY_STOP = 4
    DRIVE = 5
    LIMIT = 6
    ENCODER = 7
    PATH = 8
    MISSED = 9
    """A position was not reached."""
    SCALE = 10
    OVERLOAD = 11
    ROPE = 12
    HOST = 13
    POWER_UP = 14


class DriveChoice(IntEnum):
    """Which of the hoist's drives work."""

    NONE = 0
    FIRST = 1
    SECOND = 2
    BOTH = 3
    BY_HOURS = 4


class DriveState(IntEnum):
    """State of a drive's control."""

    BLOCKED = 0
    READY = 1
    MAGNETISING = 2
    PRESET = 3
    OPENING = 4
    RUNNING = 5
    STOPPING = 6
    QUICK_STOP = 7
    CLOSING = 8


class PathPhase(IntEnum):
    """What the circular move does."""

    OFF = 0
    BRAKES = 1
    MOVING = 2
    HELD = 3
    STOPPING = 4
    DONE = 5
    FAULT = 6


class PathFault(IntEnum):
    """Why it ended."""

    NONE = 0
    NO_CIRCLE = 1
    OFF_THE_PATH = 2
    PATH_ERROR = 3
    BRAKE_LOST = 4
    STOP_SWITCH = 5


STATUS_WORDS_OF: Sequence[str] = (
    *("state", "mode", "", "step", "step_state", "suspension", "from_stand", "to_stand", "speed_step"),
    *("drives_selected", "path_mode", "path_phase", "path_fault", "start_permissives", "ladle_stand"),
)
"""u16 from +1 on; `ladle_stand`: where the ladle stands, 0 = on the crane; `path_mode`: 0 ours, 1 the original's formulas."""
FLAGS = 3
"""Word of the status image with `STATUS_BITS_OF`."""
STATUS_BITS_OF: Sequence[str] = (
    *("moving", "emergency_stop", "scale_ok", "overload", "rope_overlap", "slack_rope", "locked", "loaded"),
    *("weight_asked", "weight_confirmed", "weight_fits", "cycle_open", "held", "host_silent", "safety_brake"),
    "emergency_latched",
)
"""From bit 0."""
START_PERMISSIVES: Sequence[str] = (
    *("emergency_ok", "acknowledged", "drives_ok", "encoders_ok", "limits_ok", "scale_ok", "rope_ok"),
    *("not_overloaded", "host_heard", "standstill"),
)
"""Bits of `start_permissives`: what a cycle needs to start and to go on; points `start_<bit>`."""
STATUS_REALS: Sequence[str] = (
    *("load", "planned_load", "confirmed_load", "angle", "target_angle", "path_error", "radial_error"),
    *("worst_path_error", "step_time", "cycle_time", "circle_x", "circle_y", "load_height", "plan_x", "plan_y"),
)
"""f32 from +16 on; NaN without a circle or a plan."""
STATUS_COUNTS: Sequence[str] = ("cycles_done", "cycles_aborted", "cycle")
"""u32 from +46 on; `cycle` is the number of the last one."""
SAFETY_TRIP = 52
"""Word of the status image with `SafetyTrip`."""

AXIS_BITS: Mapping[int, Sequence[str]] = MappingProxyType(
    {
        2: (
            *("moving", "energised", "upper_stop", "upper_slow", "lower_slow", "lower_stop", "encoder_ok"),
            *("limits_healthy", "brake_1_command", "brake_1_feedback", "brake_2_command", "brake_2_feedback"),
            *("fan_1", "fan_2", "up_allowed", "down_allowed"),
        ),
        3: (
            *("upper_stop_hit", "upper_switch_failed", "upper_switch_stuck"),
            *("lower_stop_hit", "lower_switch_failed", "lower_switch_stuck"),
            *("acknowledge_away", "motor_1_cool", "motor_2_cool", "brakes_agree"),
        ),
    }
)
"""Word of the image of an axis → its bits from 0; those with a 2 are the hoist's only. `acknowledge_away`: an alarm of the limits can be
acknowledged now, the axis has moved away; `brakes_agree`: every feedback says what its brake is commanded."""
UP_PERMISSIVES: Mapping[str, Sequence[str]] = MappingProxyType(
    {
        "hoist": (
            *("stop_free", "scale_ok", "not_overloaded", "rope_ok", "drive_selected", "limits_healthy"),
            *("emergency_ok", "drives_ok"),
        ),
        "trolley": ("stop_free", "limits_healthy", "emergency_ok", "drives_ok"),
        "bridge": ("stop_free", "limits_healthy", "emergency_ok", "drives_ok"),
    }
)
"""Bits of `<axis>_up_permissives` (+4); points `<axis>_up_<bit>`. The hoist's first six are the thesis'."""
DOWN_PERMISSIVES: Mapping[str, Sequence[str]] = MappingProxyType(
    {
        "hoist": ("stop_free", "rope_tight", "drive_selected", "limits_healthy", "emergency_ok", "drives_ok"),
        "trolley": UP_PERMISSIVES["trolley"],
        "bridge": UP_PERMISSIVES["bridge"],
    }
)
"""Bits of `<axis>_down_permissives` (+5)."""
AXIS_REALS: Sequence[str] = (
    "position",
    "speed",
    "speed_setpoint",
    "target",
    "percent",
    "stop_distance",
    "swing",
)
"""f32 from +8 on; `percent` of the greatest speed, signed; `target` NaN without one; `swing`: of the load before trolley or bridge, of the
hoist the stretch of its rope [mm]."""

DRIVE_WORDS: Sequence[str] = ("status_word", "control_word", "state", "alarms", "permissives", "fault_code")
"""u16 from the drive's offset on."""
DRIVE_REALS: Sequence[str] = (
    *("speed", "speed_setpoint", "percent", "torque", "temperature", "hours", "hours_before", "fan_left"),
    "hold_left",
)
"""f32 from +6 on: rpm, rpm, %, %, °C, h, h that the last reset took, s of the fan's run-on, s of the preset."""
DRIVE_COUNT = ("starts", 24)
"""u32 and its offset."""
DRIVE_ALARMS: Sequence[str] = tuple(alarm.value for alarm in DriveAlarm)
"""Bits of `<drive>_alarms`; points `<drive>_alarm_<bit>`."""
DRIVE_PERMISSIVES: Sequence[str] = (*(missing.value for missing in Missing), "selected")
"""Bits of `<drive>_permissives`; points `<drive>_permit_<bit>`."""
DRIVE_STATUS: Sequence[str] = tuple(bit.name.lower() for bit in Status)
"""Bits of `<drive>_status_word`; points `<drive>_zsw_<bit>`."""
DRIVE_CONTROL: Sequence[str] = tuple(bit.name.lower() for bit in Control)
"""Bits of `<drive>_control_word`; points `<drive>_stw_<bit>`."""


def drives_of(axis: str) -> Sequence[str]:
    """The drives of `axis`, in order."""
    return tuple(drive for drive in DRIVES if drive.startswith(axis))


def axis_bits(axis: str, word: int) -> Sequence[str]:
    """Names of the bits in `word` of an axis; empty where a single motor and brake have none."""
    single = len(drives_of(axis)) == 1
    return tuple("" if single and "_2" in bit else bit for bit in AXIS_BITS[word])


def _bits(address: int, names: Sequence[str], prefix: str = "") -> Mapping[str, RegisterPlace]:
    return {f"{prefix}{name}": RegisterPlace(address, shift=bit, mask=1) for bit, name in enumerate(names) if name}


def _axis(axis: str) -> Mapping[str, RegisterPlace]:
    at = AXIS_AT[axis]
    places = {f"{axis}_state": RegisterPlace(at + 1)}
    for word in AXIS_BITS:
        places |= _bits(at + word, axis_bits(axis, word), f"{axis}_")
    for word, way, names in ((4, "up", UP_PERMISSIVES), (5, "down", DOWN_PERMISSIVES)):
        places[f"{axis}_{way}_permissives"] = RegisterPlace(at + word)
        places |= _bits(at + word, names[axis], f"{axis}_{way}_")
    places |= {f"{axis}_{name}": RegisterPlace(at + 8 + 2 * n, "f32") for n, name in enumerate(AXIS_REALS)}
    for drive, offset in zip(drives_of(axis), DRIVE_AT, strict=False):
        places |= _drive(drive, at + offset)
    return places


def _drive(drive: str, at: int) -> Mapping[str, RegisterPlace]:
    places = {f"{drive}_{name}": RegisterPlace(at + n) for n, name in enumerate(DRIVE_WORDS)}
    places |= _bits(at, DRIVE_STATUS, f"{drive}_zsw_")
    places |= _bits(at + 1, DRIVE_CONTROL, f"{drive}_stw_")
    places |= _bits(at + 3, DRIVE_ALARMS, f"{drive}_alarm_")
    places |= _bits(at + 4, DRIVE_PERMISSIVES, f"{drive}_permit_")
    places |= {f"{drive}_{name}": RegisterPlace(at + 6 + 2 * n, "f32") for n, name in enumerate(DRIVE_REALS)}
    places[f"{drive}_{DRIVE_COUNT[0]}"] = RegisterPlace(at + DRIVE_COUNT[1], "u32")
    return places


def _places() -> Mapping[str, RegisterPlace]:
    places = {
        **HEADER_PLACES,
        "device_stands": RegisterPlace(CONFIGURATION + 1),
        "safety_trip": RegisterPlace(STATUS + SAFETY_TRIP),
    }
    places |= {name: RegisterPlace(STATUS + n) for n, name in enumerate(STATUS_WORDS_OF, 1) if name}
    places |= _bits(STATUS + FLAGS, STATUS_BITS_OF)
    places |= _bits(STATUS + 1 + STATUS_WORDS_OF.index("start_permissives"), START_PERMISSIVES, "start_")
    places |= {name: RegisterPlace(STATUS + 16 + 2 * n, "f32") for n, name in enumerate(STATUS_REALS)}
    places |= {name: RegisterPlace(STATUS + 46 + 2 * n, "u32") for n, name in enumerate(STATUS_COUNTS)}
    for axis in AXES:
        places |= _axis(axis)
    places |= {f"device_{name}": RegisterPlace(CONFIGURATION + 2 + 2 * n, "f32") for n, name in enumerate(PLACES)}
    places |= {setting.name: RegisterPlace(SETTINGS_AT + 2 + 2 * n, "f32") for n, setting in enumerate(SETTINGS)}
    return MappingProxyType(places)


REGISTERS: Mapping[str, RegisterPlace] = _places()
"""Every value of the map by name."""
