"""The register map of the conveyor's virtual PLC: where every value lies, what words and codes mean.

Written from the map's description, never from the equipment type's points; a test compares both.
"""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from struct import Struct
from types import MappingProxyType

from app.registers.plc_map import long_words, real
from app.sim.conveyor.machine import FEW_BELTS, FEW_SENSORS
from app.sim.plc import HEADER_PLACES, REASON_UNKNOWN, REASON_WRONG_STATE, RegisterPlace, Setting

STATUS, CONFIGURATION, SETTINGS_AT, STAGING, RAMPS, TABLE = 0x0100, 0x0180, 0x0200, 0x0240, 0x0260, 0x0800
BELT_AT, BELT_WORDS = STATUS + 48, 14
ROW_WORDS, RAMP_WORDS = 24, 25
MORE_STATUS, MORE_BELTS, MORE_CONFIGURATION, SHARES, MORE_RAMPS = 0x2000, 0x2080, 0x2100, 0x2180, 0x2200
"""What a line of more than three belts or four sensors has beside it."""
READINGS, READING_WORDS = 0x2800, 16
"""What a line with a scanner has beside it."""
GATES, GATE_PLANS, GATE_WORDS = 0x2600, 0x2680, 8
"""What a line with diverting gates has beside it: how they stand, and how they are built."""
MERGES, MERGE_PLANS, MERGE_WORDS = 0x2700, 0x2740, 8
ORIGINS, ORIGIN_WORDS = 0x3800, 8
"""What a line with merging gates has beside it: how they stand, how they are built, and a table of who came in where."""
MORE_WORDS, MORE_FIRST = 12, 11
"""Words of a belt there; belts up to this one are in the first image, the others in the second."""

SETTINGS: Sequence[Setting] = (
    Setting("automatic_speed", 30.0, 5.0, 100.0),
    Setting("manual_speed", 10.0, 5.0, 50.0),
    Setting("acceleration", 60.0, 5.0, 500.0),
    Setting("jerk", 240.0, 10.0, 5000.0),
    Setting("sensor_tolerance", 5.0, 0.5, 20.0),
    Setting("alarm_tolerance", 2.0, 0.2, 20.0),
    Setting("gap_margin", 5.0, 0.0, 100.0),
    Setting("shortest", 10.0, 5.0, 100.0),
    Setting("longest", 150.0, 20.0, 400.0),
    Setting("lost_after", 10.0, 2.0, 100.0),
    Setting("restart_delay", 1.0, 0.0, 60.0),
    Setting("slip_warning", 20.0, 0.0, 100.0),
    Setting("unload_dwell", 2.0, 0.0, 60.0),
    Setting("jam_time", 0.5, 0.1, 10.0),
    Setting("host_timeout", 0.0, 0.0, 60.0),
)
"""In the order of the settings image; %, %, %/s, %/s², mm x 6, s, %, s x 3."""


class ConveyorCommand(IntEnum):
    """Command codes."""

    START = 1
    STOP = 2
    MANUAL = 3
    RESET = 4
    DELETE = 5
    EDIT = 6
    CONFIRM = 7
    INSERT = 8
    AUTOMATIC = 9


GATE_COMMANDS = 20
"""Gate n straight on: this + 2(n − 1); into the lane: one more."""


MERGE_COMMANDS = 40
"""Merging gate n automatic: this + 3(n − 1); open: one more; closed: two more."""


class ConveyorReason(IntEnum):
    """Why a command is refused; 7–11 come from tracking, 20–22 from the base."""

    UNKNOWN = REASON_UNKNOWN
    WRONG_STATE = REASON_WRONG_STATE
    EMERGENCY_STOP = 3
    FAULT = 4
    NOT_MANUAL = 5
    NOT_AUTOMATIC = 6
    NO_SUCH_PRODUCT = 7
    OUTSIDE_LINE = 9
    LENGTH = 11
    MOVING = 12
    GATE_OCCUPIED = 13


class ConveyorEvent(IntEnum):
    """Codes of the ring that the program gives; tracking has its own (`product_tracking.Code`)."""

    LOST = 11
    EMERGENCY_STOP, EMERGENCY_STOP_OFF = 22, 23
    JAM, JAM_OFF = 24, 25
    ENCODER, ENCODER_OK = 26, 27
    STARTED, ENDED = 30, 31
    """Automatic."""
    MANUAL, STOP, POWER_UP = 32, 33, 34
    HOST_SILENT, HOST_BACK = 35, 36
    SETTINGS, RESET, SLIP = 38, 39, 40
    AUTOMATIC = 41
    """The mode is chosen."""
    READ, NOT_READ = 42, 43
    """By the scanner."""
    GATE_FAULT, GATE_OK = 44, 45
    GATE_STRAIGHT, GATE_LANE = 46, 47
    """By hand."""
    MISROUTED = 48
    """A product has not gone where the gate was to send it; value 1 = into the lane."""
    MERGE_BLOCKED, MERGE_FREE = 49, 50
    MERGE_AUTOMATIC, MERGE_OPEN, MERGE_CLOSED = 51, 52, 53


class ConveyorState(IntEnum):
    """State word."""

    STOPPED = 0
    AUTOMATIC = 1
    WAITING = 2
    MANUAL = 3
    STOPPING = 4
    GAP = 5
    EMERGENCY_STOP = 6
    FAULT = 7


class Source(IntEnum):
    """Where a belt's setpoint comes from."""

    NONE = 0
    AUTOMATIC = 1
    MANUAL = 2
    STOP = 3
    GAP = 4
    UNLOADING = 5
    GATE = 6
    """Waits for a gate."""


class Motor(IntEnum):
    """Motor state of a belt."""

    STOPPED = 0
    FORWARD = 1
    REVERSE = 2
    STOPPING = 3
    JAMMED = 4
    ENCODER = 5


def is_wide(belts: int, sensors: int) -> bool:
    """Whether a line needs more than the map of three belts and four sensors."""
    return belts > FEW_BELTS or sensors > FEW_SENSORS


def places(
    belts: int = FEW_BELTS, sensors: int = FEW_SENSORS, gates: int = 0, merges: int = 0
) -> Mapping[str, RegisterPlace]:
    """Every value of such a line that is no cell of a table, by name."""
    u32, i32, f32 = "u32", "i32", "f32"
    found = {
        **HEADER_PLACES,
        "state": RegisterPlace(STATUS + 1),
        "mode": RegisterPlace(STATUS + 2),
        "products": RegisterPlace(STATUS + 8),
        "next_id": RegisterPlace(STATUS + 10, u32),
        "smallest_gap": RegisterPlace(STATUS + 12, f32),
        "gap_limit": RegisterPlace(STATUS + 14, f32),
        "gap_rear": RegisterPlace(STATUS + 16, u32),
        "gap_front": RegisterPlace(STATUS + 18, u32),
        "first_out": RegisterPlace(STATUS + 20),
        "first_out_source": RegisterPlace(STATUS + 21),
        "first_out_rear": RegisterPlace(STATUS + 22, u32),
        "first_out_front": RegisterPlace(STATUS + 24, u32),
        "first_out_time": RegisterPlace(STATUS + 26, "u64"),
        "first_out_value": RegisterPlace(STATUS + 30, f32),
        "entered": RegisterPlace(STATUS + 32, u32),
        "unloaded": RegisterPlace(STATUS + 34, u32),
        "lost": RegisterPlace(STATUS + 36, u32),
        "unexpected": RegisterPlace(STATUS + 38, u32),
        "corrections": RegisterPlace(STATUS + 40, u32),
        "line_speed": RegisterPlace(STATUS + 42, f32),
        "greatest_correction": RegisterPlace(STATUS + 44, f32),
        "device_belts": RegisterPlace(CONFIGURATION + 1),
        "device_sensors": RegisterPlace(CONFIGURATION + 2),
        "device_areas": RegisterPlace(CONFIGURATION + 3),
        "device_line_length": RegisterPlace(CONFIGURATION + 26, f32),
        "device_roller_radius": RegisterPlace(CONFIGURATION + 28, f32),
        "device_rated_speed": RegisterPlace(CONFIGURATION + 30, f32),
        "device_resolution": RegisterPlace(CONFIGURATION + 32, u32),
        "device_intact_is_one": RegisterPlace(CONFIGURATION + 34),
        "slots": RegisterPlace(CONFIGURATION + 35),
        "pulse_length": RegisterPlace(CONFIGURATION + 36, f32),
        "device_scanner": RegisterPlace(CONFIGURATION + 38),
        "device_gates": RegisterPlace(CONFIGURATION + 39),
        "device_merges": RegisterPlace(CONFIGURATION + 40),
    }
    for word, names in (
        (
            3,
            "automatic moving stop_active emergency_stop gap_stop unloading host_silent uncertain buffer_full reverse "
            "sensors_forced",
        ),
        (
            4,
            "- - - - - - tolerance_present lost_present buffer_alarm",
        ),
    ):
        found |= {
            name: RegisterPlace(STATUS + word, shift=bit, mask=1)
            for bit, name in enumerate(names.split())
            if name != "-"
        }
    for name, count, few, word, first, more in (
        ("jam", belts, FEW_BELTS, 4, 0, 1),
        ("encoder_fault", belts, FEW_BELTS, 4, 3, 2),
        ("sensor_fault", sensors, FEW_SENSORS, 4, 9, 3),
        ("beam", sensors, FEW_SENSORS, 5, 0, 5),
        ("input", sensors, FEW_SENSORS, 6, 0, 7),
        ("area", belts + 1, FEW_BELTS + 1, 7, 0, 9),
    ):
        for n in range(count):
            at, bit = (STATUS + word, first + n) if n < few else (MORE_STATUS + more + n // 16, n % 16)
            found[f"{name}_{n + 1}"] = RegisterPlace(at, shift=bit, mask=1)
    for n in range(1, belts + 1):
        at = BELT_AT + BELT_WORDS * (n - 1)
        if n > MORE_FIRST:
            at = MORE_BELTS + 2 + MORE_WORDS * (n - MORE_FIRST - 1)
        elif n > FEW_BELTS:
            at = MORE_STATUS + 12 + MORE_WORDS * (n - FEW_BELTS - 1)
        found |= {
            f"speed_setpoint_{n}": RegisterPlace(at, f32),
            f"speed_{n}": RegisterPlace(at + 2, f32),
            f"stop_distance_{n}": RegisterPlace(at + 4, f32),
            f"encoder_{n}": RegisterPlace(at + 6, i32),
            f"belt_speed_{n}": RegisterPlace(at + 8, f32),
            f"motor_{n}": RegisterPlace(at + 10),
            f"speed_source_{n}": RegisterPlace(at + 11),
        }
    for name, count, few, first, more in (
        ("belt_end", belts, FEW_BELTS, 4, 2),
        ("sensor_position", sensors, FEW_SENSORS, 10, 28),
        ("area_end", belts + 1, FEW_BELTS + 1, 18, 84),
    ):
        for n in range(count):
            at = CONFIGURATION + first + 2 * n if n < few else MORE_CONFIGURATION + more + 2 * (n - few)
            found[f"{name}_{n + 1}"] = RegisterPlace(at, f32)
    if is_wide(belts, sensors):
        found |= {f"device_belt_{n}_share": RegisterPlace(SHARES + n) for n in range(1, belts + 1)}
    for n in range(1, gates + 1):
        at, plan = GATES + 2 + GATE_WORDS * (n - 1), GATE_PLANS + 2 + GATE_WORDS * (n - 1)
        found |= {
            f"gate_position_{n}": RegisterPlace(at),
            f"gate_target_{n}": RegisterPlace(at + 1),
            f"gate_fault_{n}": RegisterPlace(at + 2),
            f"gate_waiting_{n}": RegisterPlace(at + 3),
            f"diverted_{n}": RegisterPlace(at + 4, u32),
            f"misrouted_{n}": RegisterPlace(at + 6, u32),
            f"device_gate_{n}_at": RegisterPlace(plan, f32),
            f"device_gate_{n}_rule": RegisterPlace(plan + 2),
            f"device_gate_{n}_value": RegisterPlace(plan + 4, f32),
            f"device_gate_{n}_time": RegisterPlace(plan + 6, f32),
        }
    for n in range(1, merges + 1):
        at, plan = MERGES + 2 + MERGE_WORDS * (n - 1), MERGE_PLANS + 2 + MERGE_WORDS * (n - 1)
        found |= {
            f"merge_state_{n}": RegisterPlace(at),
            f"merge_gate_{n}": RegisterPlace(at + 1),
            f"merge_ready_{n}": RegisterPlace(at + 2),
            f"merge_holds_{n}": RegisterPlace(at + 3),
            f"merged_{n}": RegisterPlace(at + 4, u32),
            f"merge_waited_{n}": RegisterPlace(at + 6, f32),
            f"device_merge_{n}_at": RegisterPlace(plan, f32),
            f"device_merge_{n}_mode": RegisterPlace(plan + 2),
            f"device_merge_{n}_gap": RegisterPlace(plan + 4, f32),
            f"device_merge_{n}_limit": RegisterPlace(plan + 6, f32),
        }
    for n, setting in enumerate(SETTINGS):
        found[setting.name] = RegisterPlace(SETTINGS_AT + 2 + 2 * n, f32)
    return MappingProxyType(found)


REGISTERS: Mapping[str, RegisterPlace] = places()
"""Those of the line of the thesis."""
ROW: Mapping[str, RegisterPlace] = MappingProxyType(
    {
        "id": RegisterPlace(0, "u32"),
        "state": RegisterPlace(3),
        "head": RegisterPlace(4, "f32"),
        "tail": RegisterPlace(6, "f32"),
        "length": RegisterPlace(8, "f32"),
        "area": RegisterPlace(10),
        "corrected_at": RegisterPlace(11),
        "correction": RegisterPlace(12, "f32"),
        "age": RegisterPlace(14, "u32"),
        "displacement": RegisterPlace(16, "f32"),
        "direction": RegisterPlace(18),
        "entered": RegisterPlace(19, "u64"),
    }
)
"""Cells of a row of the product table, from its first word."""
RAMP: Mapping[str, RegisterPlace] = MappingProxyType(
    {
        "id": RegisterPlace(0, "u32"),
        "state": RegisterPlace(3),
        "began": RegisterPlace(4, "u64"),
        "speed": RegisterPlace(8, "f32"),
        "acceleration": RegisterPlace(10, "f32"),
        "duration_1": RegisterPlace(12, "f32"),
        "jerk_1": RegisterPlace(14, "f32"),
        "duration_2": RegisterPlace(16, "f32"),
        "jerk_2": RegisterPlace(18, "f32"),
        "duration_3": RegisterPlace(20, "f32"),
        "jerk_3": RegisterPlace(22, "f32"),
    }
)
"""Cells of a row of the table of ramps: slot 2n − 1 is the last start of belt n, slot 2n its last stop; the id is the slot."""

READING: Mapping[str, RegisterPlace] = MappingProxyType(
    {
        "id": RegisterPlace(0, "u32"),
        "state": RegisterPlace(3),
        "order": RegisterPlace(4, "u32"),
        "category": RegisterPlace(6),
        "weight": RegisterPlace(8, "f32"),
        "time": RegisterPlace(10, "u64"),
    }
)
"""Cells of a row of the table of readings: that of a product is in the slot of the product."""

ORIGIN: Mapping[str, RegisterPlace] = MappingProxyType({"id": RegisterPlace(0, "u32"), "lane": RegisterPlace(3)})
"""Cells of a row of the table of origins: that of a product is in the slot of the product."""

FORWARD, REVERSE, BELT_BITS, BELT_NUMBER = 1, 2, 4, 8
"""Hold-to-run: bits 0 and 1, then a bit for each of belts 1–3 from bit 4, and the number of another belt from bit 8."""

STATUS_IMAGE = Struct(">9HIffIIHHIIQfIIIIIffI" + 3 * "fffif4H" + "5H")
CONFIGURATION_IMAGE = Struct(">3H3f4f4ffffIHHfHHH44x")
ROW_IMAGE = Struct(">IHHfffHHfIfHQH")
RAMP_IMAGE = Struct(">IHHQ8fH")
READING_IMAGE = Struct(">IHHIHxxfQxxH")
"""How the images, without their generations, and a row are packed."""
MORE_STATUS_IMAGE = Struct(">11H" + 8 * "fffifHH" + "H")
MORE_BELTS_IMAGE = Struct(">H" + 5 * "fffifHH" + "H")
MORE_CONFIGURATION_IMAGE = Struct(">H13f28f13fH")
SHARES_IMAGE = Struct(">16H32x")
MERGES_IMAGE = Struct(">H" + 4 * "4HIf" + "H")
MERGE_PLANS_IMAGE = Struct(">H" + 4 * "fHxxff" + "H")
ORIGIN_IMAGE = Struct(">IHH6xH")
GATES_IMAGE = Struct(">H" + 8 * "4H2I" + "H")
GATE_PLANS_IMAGE = Struct(">H" + 8 * "fHxxff" + "H")


def words_of(id: int, second: int = 0, value: float = 0.0) -> tuple[int, ...]:
    """Snapshot words of an event: product, second product, second value."""
    return (*long_words(id), *long_words(second), *long_words(real(value)))


def reading_words(id: int, order: int, category: int) -> tuple[int, ...]:
    """Snapshot words of what the scanner read: product, order, class."""
    return (*long_words(id), *long_words(order), category, 0)
