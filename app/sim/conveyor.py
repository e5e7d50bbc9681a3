"""A virtual PLC that runs the conveyor: its register table and its program, 10 ms a scan, over `conveyor_machine`.

Written from the map's description (issue 3) and the thesis' program, never from the equipment type's points. Decided here:

| subject | rule |
| --- | --- |
| emergency stop | cuts the drives at once; after it is released the line stays held until a reset |
| jam | driven with the drive at its torque limit and without a pulse for the jam time; the belt's drive goes off, the others ramp down |
| jam, position | what lies on the jammed belt and the next one is uncertain |
| encoder | what it counted differs from what the ramp must have moved; the products on its belt are uncertain from 1 mm on |
| faults | stay until reset, which tries again: a fault whose cause is still there comes back |
| gap stop, automatic | released when the belts stood for the restart delay (reset: at once) and a start would not bring a pair too near |
| gap stop, manual | released when nothing is held |
| buffer full | in automatic belt 1 waits until a slot is free |
| host silent | ends automatic with a ramp; a start is refused as long as it lasts |
| length | two sensors that differ by more than the sensor tolerance leave a product uncertain until one agrees with the record |
| sensor that was suspected, S1 when it missed a product | the product of its first edge stays uncertain until the next sensor |
| first-out | the first of gap stop, emergency stop, jam, encoder, host; stays until reset; a gap stop that ended by itself for 10 s |
| unloading | the unloader takes the product when tracking lets it go; an empty grip is told as lost, source 0 |
| slip | deviation of a head as part of the way from the sensor before, of a tail as part of the length; warning 0 = off |
| edit, insert | only while the belts stand |
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import exp, inf, isfinite, nan
from random import Random
from struct import Struct
from types import MappingProxyType

from app.blocks import product_tracking as tracking
from app.blocks.mode_control import Mode, ModeControl, ModeInputs
from app.blocks.product_tracking import EditRefused, Product, ProductState, ProductTracking, TrackingEvent
from app.blocks.s_ramp import SRamp
from app.blocks.speed_selector import SpeedSelector
from app.registers.plc_map import AnswerState, Request, long_words, real, real_of
from app.sim import training
from app.sim.conveyor_machine import (
    BELTS,
    DRIVE_TIME,
    EMERGENCY_STOP,
    FAULTS,
    HOST_OFF,
    SENSORS,
    Conveyor,
    Geometry,
)
from app.sim.device import DT
from app.sim.plc import EVENT_CAPACITY, REASON_UNKNOWN, REASON_WRONG_STATE, Image, Setting, Table, Verdict, VirtualPlc
from app.sim.plc import rejected as no

STATUS, CONFIGURATION, SETTINGS_AT, STAGING, TABLE = 0x0100, 0x0180, 0x0200, 0x0240, 0x0800
BELT_AT, BELT_WORDS = STATUS + 48, 14
ROW_WORDS = 24

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


class Command(IntEnum):
    """Command codes."""

    START = 1
    STOP = 2
    MANUAL = 3
    RESET = 4
    DELETE = 5
    EDIT = 6
    CONFIRM = 7
    INSERT = 8


class Reason(IntEnum):
    """Why a command is refused; 7–11 come from tracking, 20–22 from the base."""

    UNKNOWN = REASON_UNKNOWN
    WRONG_STATE = REASON_WRONG_STATE
    EMERGENCY_STOP = 3
    FAULT = 4
    NO_SUCH_PRODUCT = 7
    OUTSIDE_LINE = 9
    LENGTH = 11
    MOVING = 12


class Event(IntEnum):
    """Codes of the ring that the program gives; tracking has its own (`product_tracking.Code`)."""

    LOST = 11
    EMERGENCY_STOP, EMERGENCY_STOP_OFF = 22, 23
    JAM, JAM_OFF = 24, 25
    ENCODER, ENCODER_OK = 26, 27
    AUTOMATIC, AUTOMATIC_ENDED = 30, 31
    MANUAL, STOP, POWER_UP = 32, 33, 34
    HOST_SILENT, HOST_BACK = 35, 36
    SETTINGS, RESET, SLIP = 38, 39, 40


class State(IntEnum):
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


SELECTIONS = (Source.NONE, Source.STOP, Source.GAP, Source.UNLOADING, Source.MANUAL, Source.AUTOMATIC)
"""Selection of SEL_5R → source; the first wins always."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a value lies and how its words become a number."""

    address: int
    type: str = "u16"
    """u16, u32, i32, f32 or u64."""
    shift: int = 0
    mask: int = 0
    """After the shift; 0 = the whole word."""


def _places() -> Mapping[str, Place]:
    u32, i32, f32 = "u32", "i32", "f32"
    places = {
        "config_crc": Place(4, u32),
        "boots": Place(7),
        "scan_time": Place(16),
        "scan_time_max": Place(17),
        "overruns": Place(18),
        "state": Place(STATUS + 1),
        "mode": Place(STATUS + 2),
        "products": Place(STATUS + 8),
        "next_id": Place(STATUS + 10, u32),
        "smallest_gap": Place(STATUS + 12, f32),
        "gap_limit": Place(STATUS + 14, f32),
        "gap_rear": Place(STATUS + 16, u32),
        "gap_front": Place(STATUS + 18, u32),
        "first_out": Place(STATUS + 20),
        "first_out_source": Place(STATUS + 21),
        "first_out_rear": Place(STATUS + 22, u32),
        "first_out_front": Place(STATUS + 24, u32),
        "first_out_time": Place(STATUS + 26, "u64"),
        "first_out_value": Place(STATUS + 30, f32),
        "entered": Place(STATUS + 32, u32),
        "unloaded": Place(STATUS + 34, u32),
        "lost": Place(STATUS + 36, u32),
        "unexpected": Place(STATUS + 38, u32),
        "corrections": Place(STATUS + 40, u32),
        "line_speed": Place(STATUS + 42, f32),
        "greatest_correction": Place(STATUS + 44, f32),
        "device_belts": Place(CONFIGURATION + 1),
        "device_sensors": Place(CONFIGURATION + 2),
        "device_areas": Place(CONFIGURATION + 3),
        "device_line_length": Place(CONFIGURATION + 26, f32),
        "device_roller_radius": Place(CONFIGURATION + 28, f32),
        "device_rated_speed": Place(CONFIGURATION + 30, f32),
        "device_resolution": Place(CONFIGURATION + 32, u32),
        "device_intact_is_one": Place(CONFIGURATION + 34),
        "slots": Place(CONFIGURATION + 35),
        "pulse_length": Place(CONFIGURATION + 36, f32),
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
        places |= {name: Place(STATUS + word, shift=bit, mask=1) for bit, name in enumerate(names.split())}
    for n in range(1, BELTS + 1):
        at = BELT_AT + BELT_WORDS * (n - 1)
        places |= {
            f"speed_setpoint_{n}": Place(at, f32),
            f"speed_{n}": Place(at + 2, f32),
            f"stop_distance_{n}": Place(at + 4, f32),
            f"encoder_{n}": Place(at + 6, i32),
            f"belt_speed_{n}": Place(at + 8, f32),
            f"motor_{n}": Place(at + 10),
            f"speed_source_{n}": Place(at + 11),
        }
        places[f"belt_end_{n}"] = Place(CONFIGURATION + 2 + 2 * n, f32)
    for n in range(1, SENSORS + 1):
        places[f"sensor_position_{n}"] = Place(CONFIGURATION + 8 + 2 * n, f32)
        places[f"area_end_{n}"] = Place(CONFIGURATION + 16 + 2 * n, f32)
    for n, setting in enumerate(SETTINGS):
        places[setting.name] = Place(SETTINGS_AT + 2 + 2 * n, f32)
    return MappingProxyType(places)


REGISTERS: Mapping[str, Place] = _places()
"""Every value that is no cell of the product table, by name."""
ROW: Mapping[str, Place] = MappingProxyType(
    {
        "id": Place(0, "u32"),
        "state": Place(3),
        "head": Place(4, "f32"),
        "tail": Place(6, "f32"),
        "length": Place(8, "f32"),
        "area": Place(10),
        "corrected_at": Place(11),
        "correction": Place(12, "f32"),
        "age": Place(14, "u32"),
        "displacement": Place(16, "f32"),
        "direction": Place(18),
        "entered": Place(19, "u64"),
    }
)
"""Cells of a row of the product table, from its first word."""

FORWARD, REVERSE, BELT_BITS = 1, 2, 4
"""Hold-to-run: bits 0 and 1, then a bit per belt from bit 4."""

DOUBT = 1.0
"""A product on a belt whose encoder differs by more from the ramp is uncertain [mm]."""
IMPLAUSIBLE, PULSES_OFF = 0.6, 0.3
"""An encoder has failed when it differs by more than this part of the way in the jam time, and this [mm]."""
DRIVEN = 1.0
"""A drive with a setpoint above this must turn [%]."""
FORGOTTEN = 10_000_000
"""A first-out that ended by itself is shown for so long [µs]."""
SPEED_SCANS = 10
"""Scans over which speeds are measured."""


@dataclass(slots=True)
class FirstOut:
    """What stopped the line first."""

    code: int = 0
    source: int = 0
    rear: int = 0
    front: int = 0
    time: int = 0
    value: float = 0.0
    ended: int = 0
    """When it ended by itself; 0 = it has not."""


class _Belt:
    """Of one belt: ramp, selector, measured speed and the supervision of drive and encoder."""

    __slots__ = (
        "_distance",
        "_distance_of",
        "active",
        "differs",
        "encoder_fault",
        "history",
        "jam_age",
        "jammed",
        "model",
        "moved",
        "pulses",
        "ramp",
        "selector",
        "source",
        "target",
    )

    def __init__(self, pulses: int, acceleration: float, jerk: float) -> None:
        self.ramp = SRamp(acceleration, jerk)
        self.selector = SpeedSelector()
        self.active: tuple[bool, ...] = ()
        self.source = Source.NONE
        self.target = 0.0
        self.pulses = pulses
        self.history = [pulses] * SPEED_SCANS
        self.moved = 0.0
        """In this scan [mm]."""
        self.model = 0.0
        """Speed that the ramp must have given by now [mm/s]."""
        self.differs = 0.0
        """Way that the encoder lacks, fading with the jam time [mm]."""
        self.jam_age = 0.0
        self.jammed = False
        self.encoder_fault = False
        self._distance_of: tuple[float, ...] = ()
        self._distance = 0.0

    def stop_distance(self) -> float:
        """[% s], signed."""
        ramp = self.ramp
        if ramp.speed == 0.0 and ramp.acceleration == 0.0:
            return 0.0
        now = (ramp.speed, ramp.acceleration, ramp.acceleration_limit, ramp.jerk)
        if now != self._distance_of:
            self._distance_of, self._distance = now, ramp.stop_distance()
        return self._distance


class VirtualConveyor(VirtualPlc):
    """The PLC of one line."""

    type = "conveyor"
    TYPE_CODE = training.TYPE_CODES["conveyor"]

    machine: Conveyor
    """The line as it really is; only tests and screens of the class room look here."""
    tracking: ProductTracking
    _belts: tuple[_Belt, ...]
    _modes: ModeControl
    _setpoints: list[float]
    """Of the drives [%]."""
    _enabled: bool
    """The drives have supply."""
    _unload: bool
    """The unloader may take a product now."""
    _unloading: int
    _taken: int
    _first_out: FirstOut
    _start: bool
    _start_automatic: bool
    _select_manual: bool
    _stopping: bool
    _pressed: bool
    _held: bool
    """After an emergency stop, until reset."""
    _faulty: bool
    _silent: bool
    _moving: bool
    _direction: int
    _gap_age: float
    _entry_doubted: bool
    """Something was at S2 that S1 had not seen."""
    _length_doubted: set[int]
    """Ids of products of which two sensors measured different lengths."""
    _restart_speed: float
    _restart_way: float

    def __init__(
        self,
        geometry: Geometry | None = None,
        *,
        seed: int = 1,
        slots: int = 20,
        start: str = "stopped",
        arrivals: bool = True,
        interval: float = 6.0,
        shortest: float = 20.0,
        longest: float = 60.0,
        settings: Mapping[str, float] | None = None,
    ) -> None:
        """A line just switched on for the first time. `slots` 5–250; `start`: automatic or stopped; `arrivals`, `interval` [s], `shortest`,
        `longest` [mm]: what the infeed gives; `settings`: initial setpoints by name.

        Raises:
            ValueError: a measure of the line that cannot be, or settings that do not go together.
        """
        self.geometry = geometry or Geometry()
        self.line = tracking.Line(self.geometry.belt_ends, self.geometry.sensors, self.geometry.area_ends, slots)
        self._seed, self._start_in = seed, start
        given = dict(settings or {})
        _require_settings(given)
        self._table = Table(TABLE, ROW_WORDS, slots, self._row)
        self._millimetres = self.geometry.full_speed / 100
        self._follow = 1 - exp(-DT / DRIVE_TIME)
        self._machine_options = {"shortest": shortest, "longest": longest, "interval": interval}
        super().__init__(
            settings=[Setting(s.name, given.get(s.name, s.default), s.low, s.high) for s in SETTINGS],
            settings_at=SETTINGS_AT,
            staging_at=STAGING,
            images=(Image(STATUS, 96, self._status), Image(CONFIGURATION, 64, self._configuration)),
            configuration=CONFIGURATION,
            tables=(self._table,),
            capacities=(BELTS, SENSORS, slots, EVENT_CAPACITY, len(SETTINGS)),
            faults=FAULTS,
            words={
                training.REG_ARRIVALS: int(arrivals),
                training.REG_INTERVAL: round(interval * 10),
                training.REG_SHORTEST: round(shortest),
                training.REG_LONGEST: round(longest),
            },
            limits=training.CONVEYOR_LIMITS,
            triggers=(training.REG_REMOVE, training.REG_PUT),
        )
        self._start_up()

    # ---- one scan

    def _scan(self) -> None:
        machine = self.machine
        machine.step(self._setpoints, self._enabled, self._unload, self.dt)
        if self._unload:
            self._unload = False
            self._look_at_the_grip()
        self._emergency(machine.fault == EMERGENCY_STOP)
        self._host()
        self._measure()
        self._track()
        self._supervise()
        self._modes_and_gaps()
        self._drive()

    def _measure(self) -> None:
        """Read the encoders."""
        at, length = self.steps % SPEED_SCANS, self.geometry.pulse_length
        for belt, pulses in zip(self._belts, self.machine.pulses, strict=True):
            belt.moved = (pulses - belt.pulses) * length
            belt.pulses = pulses
            belt.history[at] = pulses

    def _speed(self, belt: _Belt) -> float:
        """Measured over the last scans [mm/s]."""
        oldest = belt.history[(self.steps + 1) % SPEED_SCANS]
        return (belt.pulses - oldest) * self.geometry.pulse_length / ((SPEED_SCANS - 1) * self.dt)

    def _track(self) -> None:
        first, second, third = self._belts
        scale, beams = self._millimetres, self.machine.beams
        happened = self.tracking.scan(
            (first.moved, second.moved, third.moved),
            (bool(beams & 1), bool(beams & 2), bool(beams & 4), bool(beams & 8)),
            (first.stop_distance() * scale, second.stop_distance() * scale, third.stop_distance() * scale),
            self.time,
        )
        for event in happened:
            self._tell(event)
            if event.code == tracking.Code.GAP_STOP:
                self._first(event.code, 0, event.value, rear=event.id, front=event.second)
            elif event.code == tracking.Code.UNLOADED:
                self._unload, self._unloading = True, event.id
            elif event.source > 1 and event.code in _AT_SENSOR:
                self._watch_slip(event)
        if happened:
            self._doubt_lengths(happened)
            self._doubt_first_edges(happened)
            self._renew_table()

    def _doubt_lengths(self, happened: Sequence[TrackingEvent]) -> None:
        """Two sensors that disagree on a length leave the product uncertain until a third agrees with one of them."""
        differing = {
            event.id
            for event in happened
            if event.code == tracking.Code.LENGTH_DIFFERS and abs(event.value) > self._values["sensor_tolerance"]
        }
        agreeing = {event.id for event in happened if event.code == tracking.Code.TAIL_AT_SENSOR} - differing
        self._length_doubted = (self._length_doubted | differing) - agreeing
        if self._length_doubted:
            doubted = [product for product in self.tracking.products if product.id in self._length_doubted]
            self._length_doubted = {product.id for product in doubted}
            for product in doubted:
                _make_uncertain(product)

    def _doubt_first_edges(self, happened: Sequence[TrackingEvent]) -> None:
        """A sensor that has just begun to work again may have done so in the middle of a product; so may S1 after it missed one."""
        again = {event.source for event in happened if event.code == tracking.Code.SENSOR_OK}
        for event in happened:
            if event.code == tracking.Code.UNEXPECTED and event.source == 2:
                self._entry_doubted = True
            elif event.code == tracking.Code.ARRIVED and self._entry_doubted:
                self._entry_doubted = False
                again.add(1)
        if not again:
            return
        seen = {event.id for event in happened if event.source in again and event.id}
        for product in self.tracking.products:
            if product.id in seen:
                _make_uncertain(product)

    def _watch_slip(self, event: TrackingEvent) -> None:
        product = next((product for product in self.tracking.slots if product and product.id == event.id), None)
        warning = self._values["slip_warning"]
        if product is None or product.entered_us == self.time or not warning:
            return
        sensors = self.geometry.sensors
        end = sensors[event.source - 1]
        if event.code == tracking.Code.TAIL_AT_SENSOR:
            end += product.length
            way = product.length
        else:
            way = end - sensors[event.source - 2]
        slip = 100 * abs(event.value) / way
        if slip > warning:
            belt = next((n for n, last in enumerate(self.geometry.belt_ends, 1) if end - way / 2 <= last), BELTS)
            self.event(Event.SLIP, belt, slip, _words(event.id))

    def _look_at_the_grip(self) -> None:
        if self.machine.unloaded == self._taken:
            self.event(Event.LOST, 0, self.geometry.length, _words(self._unloading))
            self.tracking.lost += 1
            self.tracking.unloaded -= 1
        self._taken = self.machine.unloaded

    def _emergency(self, pressed: bool) -> None:
        if pressed == self._pressed:
            return
        self._pressed = pressed
        if not pressed:
            self.event(Event.EMERGENCY_STOP_OFF)
            return
        self.event(Event.EMERGENCY_STOP)
        self._first(Event.EMERGENCY_STOP)
        self._held = True
        self._enabled = False

    def _host(self) -> None:
        if self.host_silent == self._silent:
            return
        self._silent = self.host_silent
        self.event(Event.HOST_SILENT if self._silent else Event.HOST_BACK)
        if self._silent and self._modes.mode is Mode.AUTOMATIC:
            self._first(Event.HOST_SILENT)
            self._stopping = True

    def _supervise(self) -> None:
        """Driven at the torque limit without a pulse: jam. Other than the ramp says: the encoder."""
        jam_time, limited = self._values["jam_time"], self.machine.limited
        dt, scale = self.dt, self._millimetres
        for number, belt in enumerate(self._belts):
            way = belt.moved
            speed = belt.ramp.speed * scale
            if not speed and not way and not belt.model and not belt.differs:
                continue
            if way:
                belt.jam_age = 0.0
            if limited[number] or not self._enabled or belt.jammed:
                belt.model, belt.differs = way / dt, 0.0
                if limited[number] and not way and abs(belt.ramp.speed) >= DRIVEN:
                    # not from zero after a stop: a gap stop in between must not hide a jam
                    belt.jam_age += dt
                if belt.jam_age >= jam_time and not belt.jammed:
                    belt.jammed = True
                    self._doubt(number, across=True)
                    self._fail(Event.JAM, number)
                continue
            belt.model += (self._setpoints[number] * scale - belt.model) * self._follow
            if abs(belt.model) < 1e-4:
                belt.model = 0.0
            belt.differs += belt.model * dt - way - belt.differs * dt / jam_time
            off = abs(belt.differs)
            if off < 1e-4 and not belt.model:
                belt.differs = 0.0
            if off > DOUBT:
                self._doubt(number)
            if off > IMPLAUSIBLE * abs(belt.model) * jam_time + PULSES_OFF and not belt.encoder_fault:
                belt.encoder_fault = True
                self._doubt(number)
                self._fail(Event.ENCODER, number)

    def _fail(self, code: Event, belt: int) -> None:
        value = self._belts[belt].ramp.speed
        self.event(code, belt + 1, value)
        self._first(code, belt + 1, value)
        self._faulty = True

    def _doubt(self, belt: int, *, across: bool = False) -> None:
        """Nobody knows where the products on this belt are until a sensor sees them; `across`: those that lie on the next one too."""
        ends = self.geometry.belt_ends
        begin, end = ends[belt - 1] if belt else 0.0, ends[belt]
        for product in self.tracking.products:
            on_it = product.right > begin and product.left < end
            if on_it and not (across and begin <= product.left and product.right <= end):
                _make_uncertain(product)

    def _modes_and_gaps(self) -> None:
        bits = self.hold
        inputs = ModeInputs(
            self._start,
            self._select_manual,
            self._stopping or self._held or self._faulty,
            bool(bits & FORWARD),
            bool(bits & REVERSE),
        )
        self._start = self._select_manual = False
        before = self._modes.mode
        out = self._modes.step(inputs)
        if out.mode is not before:
            if before is Mode.AUTOMATIC:
                self.event(Event.AUTOMATIC_ENDED)
            if out.mode is Mode.AUTOMATIC:
                self.event(Event.AUTOMATIC)
            elif out.mode is Mode.MANUAL:
                self.event(Event.MANUAL)
        self._direction = out.forward - out.reverse
        oldest = (self.steps + 1) % SPEED_SCANS
        self._moving = any(
            belt.ramp.speed or belt.ramp.acceleration or belt.history[oldest] != belt.pulses for belt in self._belts
        )
        if self._stopping and not self._moving:
            self._stopping = False
        if self._first_out.ended and self.time - self._first_out.ended > FORGOTTEN:
            self._first_out = FirstOut()
        if self.tracking.gap_stop:
            self._hold_the_gap()

    def _hold_the_gap(self) -> None:
        if self._moving:
            self._gap_age = 0.0
            return
        self._gap_age += self.dt
        if self._modes.mode is Mode.AUTOMATIC:
            speed = self._values["automatic_speed"]
            if speed != self._restart_speed:
                ramp = SRamp(self._values["acceleration"], self._values["jerk"], speed)
                self._restart_speed, self._restart_way = speed, ramp.stop_distance() * self._millimetres
            way = self._restart_way
            if self._gap_age + 1e-9 < self._values["restart_delay"]:
                return
            ways = (0.0 if self.tracking.buffer_full else way, way, 0.0 if self.tracking.brake else way)
            gap = self.tracking.gap_with(ways)
            if gap is not None and gap.stop:
                return
        elif self._direction:
            return
        self._release_gap()

    def _release_gap(self) -> None:
        self._gap_age = 0.0
        for event in self.tracking.release_gap_stop():
            self._tell(event)
        if self._first_out.code == tracking.Code.GAP_STOP:
            self._first_out.ended = self.time

    def _drive(self) -> None:
        """Choose every belt's speed and follow it with the ramp."""
        values, follow = self._values, self.tracking
        stop = self._stopping or self._held or self._faulty
        automatic = self._modes.mode is Mode.AUTOMATIC and not stop
        gap = follow.gap_stop
        manual = 0.0
        if self._direction:
            asked = self.hold_argument
            manual = self._direction * (min(asked, 50.0) if asked > 0 else values["manual_speed"])
        chosen = self.hold // (1 << BELT_BITS) & 7 or 7
        waits = (follow.buffer_full, False, follow.brake)
        for number, belt in enumerate(self._belts):
            ramp = belt.ramp
            hold = automatic and waits[number]
            by_hand = manual if chosen >> number & 1 else 0.0
            active = (stop, gap, hold, by_hand != 0.0, automatic and not gap and not hold)
            selected = belt.selector.step(active, (0.0, 0.0, 0.0, by_hand, values["automatic_speed"]))
            belt.source, belt.target = SELECTIONS[selected.selection], selected.value
            if not self._enabled or belt.jammed:
                ramp.reset()
            elif ramp.speed != belt.target or ramp.acceleration:
                ramp.step(belt.target, self.dt)
            self._setpoints[number] = ramp.speed

    # ---- commands

    @property
    def state(self) -> int:
        """State word."""
        if self._held:
            return State.EMERGENCY_STOP
        if self._faulty:
            return State.FAULT
        if self.tracking.gap_stop:
            return State.GAP
        if self._stopping:
            return State.STOPPING
        if self._modes.mode is Mode.AUTOMATIC:
            return State.AUTOMATIC if all(belt.target for belt in self._belts) else State.WAITING
        if self._moving:
            return State.MANUAL if self._direction else State.STOPPING
        return State.STOPPED

    def _execute(self, request: Request) -> Verdict:
        code, first = request.code, request.arguments[0]
        if code == Command.STOP:
            return self._stop()
        if code == Command.RESET:
            return self._reset()
        if code in (Command.START, Command.MANUAL):
            return self._change_mode(code)
        if code not in (Command.DELETE, Command.EDIT, Command.CONFIRM, Command.INSERT):
            return no(Reason.UNKNOWN)
        if code in (Command.EDIT, Command.INSERT) and self._moving:
            return no(Reason.MOVING)
        try:
            if code == Command.DELETE:
                event = self.tracking.delete(first)
            elif code == Command.CONFIRM:
                event = self.tracking.confirm(first)
            else:
                at = 1 if code == Command.EDIT else 0
                head, length = real_of(request.arguments[at]), real_of(request.arguments[at + 1])
                if not isfinite(length):
                    return no(Reason.LENGTH)
                if not isfinite(head):
                    return no(Reason.OUTSIDE_LINE)
                edit = code == Command.EDIT
                event = self.tracking.edit(first, head, length) if edit else self._insert(head, length)
        except EditRefused as refusal:
            return no(refusal.reason)
        self._tell(event)
        self._length_doubted = set() if code == Command.CONFIRM and not first else self._length_doubted - {first}
        self._renew_table()
        return Verdict(detail=event.id)

    def _insert(self, head: float, length: float) -> TrackingEvent:
        return self.tracking.insert(head, length, self.time)

    def _stop(self) -> Verdict:
        self.event(Event.STOP)
        if not self._moving and self._modes.mode is not Mode.AUTOMATIC:
            return Verdict()
        self._stopping = True

        def standing() -> AnswerState:
            return AnswerState.RUNNING if self._stopping else AnswerState.DONE

        return Verdict(AnswerState.RUNNING, until=standing)

    def _reset(self) -> Verdict:
        self.event(Event.RESET)
        if self._held and not self._pressed:
            self._held, self._enabled = False, True
        for number, belt in enumerate(self._belts, 1):
            if belt.jammed:
                self.event(Event.JAM_OFF, number)
            if belt.encoder_fault:
                self.event(Event.ENCODER_OK, number)
            belt.jammed = belt.encoder_fault = False
            belt.jam_age = belt.differs = 0.0
            belt.model = belt.ramp.speed * self._millimetres
        self._faulty = False
        if self.tracking.gap_stop:
            self._gap_age = inf
            if self._modes.mode is not Mode.AUTOMATIC:
                self._release_gap()
        self._first_out = FirstOut()
        if self._pressed:
            self._first(Event.EMERGENCY_STOP)
        elif self.tracking.gap_stop and (gap := self.tracking.gap):
            self._first(tracking.Code.GAP_STOP, 0, gap.gap, rear=gap.rear, front=gap.front)
        return Verdict()

    def _change_mode(self, code: int) -> Verdict:
        if self._held:
            return no(Reason.EMERGENCY_STOP)
        if self._faulty:
            return no(Reason.FAULT)
        if code == Command.START and self._modes.mode is Mode.AUTOMATIC and not self._stopping:
            return Verdict()
        if self._moving or self._stopping or self.hold:
            return no(Reason.MOVING)
        if code == Command.START:
            if self.host_silent:
                return no(Reason.WRONG_STATE, self.state)
            self._start = True
        else:
            self._select_manual = True
        return Verdict()

    def _tell(self, event: TrackingEvent) -> None:
        self.event(event.code, event.source, event.value, _words(event.id, event.second, event.value2))

    def _first(self, code: int, source: int = 0, value: float = 0.0, *, rear: int = 0, front: int = 0) -> None:
        if not self._first_out.code or self._first_out.ended:
            self._first_out = FirstOut(code, source, rear, front, self.time, value)

    # ---- settings, training, power

    @property
    def host_timeout(self) -> float:
        return self._values["host_timeout"]

    def _host_deaf(self) -> bool:
        return self.machine.fault == HOST_OFF

    def _settings_fault(self, values: Mapping[str, float]) -> int:
        names = [setting.name for setting in SETTINGS]
        if values["longest"] < values["shortest"]:
            return names.index("longest") + 1
        return 0

    def _settings_changed(self) -> None:
        self._take_settings()
        self.event(Event.SETTINGS)

    def _take_settings(self) -> None:
        values = self._values
        self.tracking.settings = tracking.Settings(
            **{
                name: values[name]
                for name in (
                    "sensor_tolerance",
                    "alarm_tolerance",
                    "gap_margin",
                    "shortest",
                    "longest",
                    "lost_after",
                    "unload_dwell",
                )
            }
        )
        for belt in self._belts:
            belt.ramp.acceleration_limit, belt.ramp.jerk = values["acceleration"], values["jerk"]
        self._restart_speed = nan

    def _trained(self, address: int, word: int) -> None:
        machine, words = self.machine, self.training
        if address == training.REG_REMOVE:
            machine.remove(word)
        elif address == training.REG_PUT:
            machine.place(float(word), float(words[training.REG_SHORTEST]))
        elif address == training.REG_ARRIVALS:
            machine.arrivals = bool(word)
        elif address == training.REG_INTERVAL:
            machine.interval = word / 10
        elif address == training.REG_SHORTEST:
            machine.shortest = float(word)
        elif address == training.REG_LONGEST:
            machine.longest = float(word)
        elif address == training.REG_SENSORS:
            machine.pressed = word
        elif address == training.REG_MACHINE_FAULT:
            machine.fault = word

    def _forget(self) -> None:
        self.machine = Conveyor(
            self.geometry,
            Random(self._seed),
            arrivals=bool(self.training[training.REG_ARRIVALS]),
            **self._machine_options,
        )
        self.tracking = ProductTracking(self.line)
        self._start_automatic = self._start_in == "automatic"

    def _power_up(self) -> None:
        retained = self.tracking.snapshot()
        self.tracking = ProductTracking(self.line)
        self.tracking.restore(retained)
        self.tracking.power_up()
        values = self._values
        self._belts = tuple(_Belt(pulses, values["acceleration"], values["jerk"]) for pulses in self.machine.pulses)
        self._modes = ModeControl()
        self._modes.step(ModeInputs())
        self._setpoints = [0.0] * BELTS
        self._enabled = True
        self._first_out = FirstOut()
        self._start, self._start_automatic = self._start_automatic, False
        self._select_manual = self._stopping = self._held = self._faulty = False
        self._pressed = self._silent = self._moving = self._unload = False
        self._direction = self._unloading = 0
        self._taken = self.machine.unloaded
        self._gap_age = 0.0
        self._entry_doubted = False
        self._length_doubted = set()
        self._restart_speed = nan
        self._restart_way = 0.0
        self._take_settings()
        self._renew_table()
        self.event(Event.POWER_UP, value=self.boots)

    # ---- the register images

    def _renew_table(self) -> None:
        ids = [product.id if product else 0 for product in self.tracking.slots]
        if ids != self._table.ids:
            self._table.ids = ids
            self._table.generation = self._table.generation + 2 & 0xFFFE

    def _row(self, slot: int) -> bytes:
        product: Product | None = self.tracking.slots[slot]
        mark = self.generation
        if product is None:
            return _ROW.pack(0, mark, 0, nan, nan, nan, 0, 0, nan, 0, nan, 0, 0, mark)
        return _ROW.pack(
            product.id,
            mark,
            product.state,
            product.head,
            product.tail,
            product.length,
            product.area,
            product.corrected_at,
            product.correction,
            min(max(0, self.time - product.entered_us) // 1000, 0xFFFFFFFF),
            product.displacement,
            product.swapped,
            product.entered_us,
            mark,
        )

    def _bits(self) -> int:
        return _bits(
            self._modes.mode is Mode.AUTOMATIC,
            self._moving,
            self._stopping or self._held or self._faulty,
            self._pressed,
            self.tracking.gap_stop,
            self.tracking.brake,
            self.host_silent,
            self.tracking.uncertain,
            self.tracking.buffer_full,
            any(belt.ramp.speed < 0 for belt in self._belts),
            self.training[training.REG_SENSORS] != 0,
        )

    def _alarms(self) -> int:
        faults = self.tracking.sensor_faults
        return _bits(
            *(belt.jammed for belt in self._belts),
            *(belt.encoder_fault for belt in self._belts),
            self.tracking.outside_present,
            self.tracking.lost_present,
            self.tracking.buffer_full,
            *(faults >> sensor & 1 for sensor in range(SENSORS)),
        )

    def _motor(self, belt: _Belt) -> Motor:
        if belt.jammed:
            return Motor.JAMMED
        if belt.encoder_fault:
            return Motor.ENCODER
        speed = belt.ramp.speed
        if speed and not belt.target:
            return Motor.STOPPING
        return Motor.FORWARD if speed > 0 else Motor.REVERSE if speed < 0 else Motor.STOPPED

    def _status(self) -> bytes:
        follow, machine, first = self.tracking, self.machine, self._first_out
        gap = follow.gap
        speeds = [self._speed(belt) for belt in self._belts]
        belts = [
            number
            for belt, speed in zip(self._belts, speeds, strict=True)
            for number in (
                belt.target,
                speed / self._millimetres,
                abs(belt.stop_distance()) * self._millimetres,
                belt.pulses,
                speed,
                self._motor(belt),
                belt.source,
                0,
                0,
            )
        ]
        return _STATUS.pack(
            self.state,
            self._modes.mode,
            self._bits(),
            self._alarms(),
            machine.beams,
            machine.raw_inputs,
            follow.areas,
            len(follow.products),
            0,
            follow.next_id,
            gap.gap if gap else nan,
            gap.limit if gap else nan,
            gap.rear if gap else 0,
            gap.front if gap else 0,
            first.code,
            first.source,
            first.rear,
            first.front,
            first.time,
            first.value,
            follow.entered,
            follow.unloaded,
            follow.lost,
            follow.unexpected,
            follow.corrections,
            speeds[0],
            follow.greatest_correction,
            0,
            *belts,
            0,
            0,
            0,
            0,
            0,
        )

    def _configuration(self) -> bytes:
        measures = self.geometry
        return _CONFIGURATION.pack(
            BELTS,
            SENSORS,
            len(self.line.area_ends),
            *measures.belt_ends,
            *measures.sensors,
            *measures.area_ends,
            measures.length,
            measures.roller_radius,
            measures.rated_speed,
            measures.resolution,
            measures.intact_is_one,
            self.line.slots,
            measures.pulse_length,
        )


_STATUS = Struct(">9HIffIIHHIIQfIIIIIffI" + 3 * "fffif4H" + "5H")
_CONFIGURATION = Struct(">3H3f4f4ffffIHHf50x")
_ROW = Struct(">IHHfffHHfIfHQH")
_CERTAIN = (ProductState.TRACKED, ProductState.OUTSIDE)
_AT_SENSOR = (tracking.Code.HEAD_AT_SENSOR, tracking.Code.TAIL_AT_SENSOR, tracking.Code.UNEXPECTED)


def _make_uncertain(product: Product) -> None:
    if product.state in _CERTAIN:
        product.state = ProductState.UNCERTAIN
    elif product.state is not ProductState.LOST:
        product.settled = ProductState.UNCERTAIN


def _require_settings(given: Mapping[str, float]) -> None:
    limits = {setting.name: setting for setting in SETTINGS}
    for name, value in given.items():
        if name not in limits:
            raise ValueError(f"setting {name}: expected one of {', '.join(limits)}")
        if not limits[name].low <= value <= limits[name].high:
            raise ValueError(f"{name} takes {limits[name].low:g} to {limits[name].high:g}, not {value:g}")


def _bits(*flags: bool | int) -> int:
    return sum(1 << bit for bit, flag in enumerate(flags) if flag)


def _words(id: int, second: int = 0, value: float = 0.0) -> tuple[int, ...]:
    """Snapshot words of an event: product, second product, second value."""
    return (*long_words(id), *long_words(second), *long_words(real(value)))
