"""The register map of the conveyor's virtual PLC: where every value lies, what words and codes mean.

Written from the map's description, never from the equipment type's points; a test compares both.
"""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from struct import Struct
from types import MappingProxyType

from app.registers.plc_map import long_words, real
from app.sim.conveyor.machine import BELTS, SENSORS
from app.sim.plc import HEADER_PLACES, REASON_UNKNOWN, REASON_WRONG_STATE, RegisterPlace, Setting

STATUS, CONFIGURATION, SETTINGS_AT, STAGING, RAMPS, TABLE = 0x0100, 0x0180, 0x0200, 0x0240, 0x0260, 0x0800
BELT_AT, BELT_WORDS = STATUS + 48, 14
ROW_WORDS, RAMP_WORDS = 24, 25

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


class ConveyorReason(IntEnum):
    """Why a command is refused; 7–11 come from tracking, 20–22 from the base."""

    UNKNOWN = REASON_UNKNOWN
    WRONG_STATE = REASON_WRONG_STATE
    EMERGENCY_STOP = 3
    FAULT = 4
    NOT_AUTOMATIC = 6
    NO_SUCH_PRODUCT = 7
    OUTSIDE_LINE = 9
    LENGTH = 11
    MOVING = 12


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


class Motor(IntEnum):
    """Motor state of a belt."""

    STOPPED = 0
    FORWARD = 1
    REVERSE = 2
    STOPPING = 3
    JAMMED = 4
    ENCODER = 5


def _places() -> Mapping[str, RegisterPlace]:
    u32, i32, f32 = "u32", "i32", "f32"
    places = {
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
    }
    for word, names in (
        (
            3,
            "automatic moving stop_active emergency_stop gap_stop unloading host_silent uncertain buffer_full reverse "
            "sensors_forced",
        ),
        (
            4,
            "jam_1 jam_2 jam_3 encoder_fault_1 encoder_fault_2 encoder_fault_3 tolerance_present lost_present buffer_alarm "
            "sensor_fault_1 sensor_fault_2 sensor_fault_3 sensor_fault_4",
        ),
        (5, "beam_1 beam_2 beam_3 beam_4"),
        (6, "input_1 input_2 input_3 input_4"),
        (7, "area_1 area_2 area_3 area_4"),
    ):
        places |= {name: RegisterPlace(STATUS + word, shift=bit, mask=1) for bit, name in enumerate(names.split())}
    for n in range(1, BELTS + 1):
        at = BELT_AT + BELT_WORDS * (n - 1)
        places |= {
            f"speed_setpoint_{n}": RegisterPlace(at, f32),
            f"speed_{n}": RegisterPlace(at + 2, f32),
            f"stop_distance_{n}": RegisterPlace(at + 4, f32),
            f"encoder_{n}": RegisterPlace(at + 6, i32),
            f"belt_speed_{n}": RegisterPlace(at + 8, f32),
            f"motor_{n}": RegisterPlace(at + 10),
            f"speed_source_{n}": RegisterPlace(at + 11),
        }
        places[f"belt_end_{n}"] = RegisterPlace(CONFIGURATION + 2 + 2 * n, f32)
    for n in range(1, SENSORS + 1):
        places[f"sensor_position_{n}"] = RegisterPlace(CONFIGURATION + 8 + 2 * n, f32)
        places[f"area_end_{n}"] = RegisterPlace(CONFIGURATION + 16 + 2 * n, f32)
    for n, setting in enumerate(SETTINGS):
        places[setting.name] = RegisterPlace(SETTINGS_AT + 2 + 2 * n, f32)
    return MappingProxyType(places)


REGISTERS: Mapping[str, RegisterPlace] = _places()
"""Every value that is no cell of the product table, by name."""
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

FORWARD, REVERSE, BELT_BITS = 1, 2, 4
"""Hold-to-run: bits 0 and 1, then a bit per belt from bit 4."""

STATUS_IMAGE = Struct(">9HIffIIHHIIQfIIIIIffI" + 3 * "fffif4H" + "5H")
CONFIGURATION_IMAGE = Struct(">3H3f4f4ffffIHHf50x")
ROW_IMAGE = Struct(">IHHfffHHfIfHQH")
RAMP_IMAGE = Struct(">IHHQ8fH")
"""How the images, without their generations, and a row are packed."""


def require_settings(given: Mapping[str, float]) -> None:
    """Initial setpoints by name.

    Raises:
        ValueError: no such setting, or a value outside its limits.
    """
    limits = {setting.name: setting for setting in SETTINGS}
    for name, value in given.items():
        if name not in limits:
            raise ValueError(f"setting {name}: expected one of {', '.join(limits)}")
        if not limits[name].low <= value <= limits[name].high:
            raise ValueError(f"{name} takes {limits[name].low:g} to {limits[name].high:g}, not {value:g}")


def words_of(id: int, second: int = 0, value: float = 0.0) -> tuple[int, ...]:
    """Snapshot words of an event: product, second product, second value."""
    return (*long_words(id), *long_words(second), *long_words(real(value)))
