"""A virtual PLC that runs a coil car under a recoiler: its register table and its program, 10 ms a scan, over `coil_car_machine`.

The transport itself is a sequence in another device (`VirtualSequence`, app/sim/sequence.py): it asks `ACTIONS` of this one and reads its
signals, which are the points of this map by name. Type code 30. Measures and numbers are taken here; thesis 001 gives the steps only.

`horizontal` is the middle of the car [mm] from the recoiler's wall: the mandrel sticks out from there to `mandrel_reach`, then comes the free
zone, then the saddles; saddle 1 is the farthest and is filled first. A car with a coil does not pass a coil on a saddle. `vertical` is the
height of the car's table [mm], 0 = lowered; a coil on it has its lowest point there.

Header words 23–31: 3 saddles · settings · 63 events.

| registers | content |
| --- | --- |
| 0x0100, 64 words | status image: generation · +1 state · +2 mode · +3 and +4 bits · +5 blocked bits · +6 mandrel · +7 target_saddle · +8 target_selected · +9 action · +10 action_state · +11 fault · f32: +12 horizontal [mm] · +14 vertical [mm] · +16 horizontal_speed [mm/s] · +18 vertical_speed [mm/s] · +20 horizontal_target [mm] · +22 vertical_target [mm] · +24 coil_diameter on the mandrel [mm] · +26 car_diameter · +28 +30 +32 saddle_1…3_diameter · +34 pressure [bar] · +36 oil_temperature [°C] · +38 mandrel_expansion [%] · u32: +40 coils_done · +42 coils_wound · u16: +44…+50 block_<movement> (why it is blocked) · +51 collision_kind · f32 +52 +54 horizontal_stop, vertical_stop (distance [mm], signed) · +56 contact_height [mm] · generation |
| 0x0180, 64 words | configuration image: +1 device_saddles, then f32 from +2: see `REGISTERS` |
| 0x0200, 30 words | settings image: generation · count · f32 in the order of `SETTINGS` · spare · generation; staged at 0x0240 |
| 0x0300, 0x0320, 0x0380, 0x0400 | commands, answers, hold-to-run, events (registers/plc_map.py) |

| word | bits |
| --- | --- |
| +3 | 0 automatic 1 moving 2 winding 3 coil_on_mandrel 4 coil_on_car 5 coil_ready 6–8 saddle_1…3 (occupied) 9 at_mandrel 10 at_saddle (any) 11 zone_mandrel 12 zone_free 13 zone_saddles 14 target_free (a saddle for the coil on the car, or the next one, and the way to it) 15 host_silent |
| +4 | 0–3 limit_left, _right, _up, _down 4 drive_horizontal 5 drive_vertical (ready) 6 pump 7–9 guard_1…3 (closed) 10 emergency_stop (pressed) 11 held (needs a reset) 12 collision 13 collision_possible (the interlock holds back what was asked) 14 coil_contact (the table touches the coil on the mandrel) 15 lowered |
| +5 | interlock_<movement> (1 = blocked): 0 forward 1 back 2 up 3 down 4 expand 5 collapse 6 winding · 7 at_target (car at its saddle) 8 at_out (in the free zone, where it lifts) 9 over_saddle (table high enough for the saddles) 10 coil_laid (coil on the target saddle, table below) 11 pressure_ok 12 oil_ok 13 drives_ok 14 guards_closed 15 limits_plausible |

| word | values |
| --- | --- |
| state | 0 off 1 automatic 2 automatic, moving 3 manual 4 manual, moving 5 stopping 6 emergency stop 7 held |
| mode | 0 off 1 automatic 2 manual |
| mandrel | 0 collapsed 1 moving 2 expanded |
| action | 0 none, else number in `ACTIONS` from 1; action_state 0 none 1 running 2 done 3 blocked |
| fault | what holds the machine: 0 none 1 emergency stop 2 guard 3 horizontal drive 4 vertical drive 5 mandrel does not move 6 collision |
| block_<movement> | 0 free 1 emergency stop 2 guard open 3 needs reset 4 drive not ready 5 pressure 6 oil cold 7 limit switch 8 end of travel 9 car is not lowered 10 coil in the way 11 mandrel in the eye of the coil 12 saddle in the way 13 mandrel not collapsed 14 other movement 15 coil not supported 16 winding 17 already there 18 no coil / coil there already 19 car in the way 20 coil not centred 21 mandrel in the way |
| collision_kind | 0 none 1 coil on the mandrel 2 mandrel 3 coil on a saddle 4 saddle 5 coil dropped 6 end stop |

Blocks of geometry (8–13, 20, 21) make `collision_possible` while they hold back what was asked.

Commands: 1 automatic · 2 stop (mode off, winding stops; stop=true, feedback `moving == 0`) · 3 manual · 4 reset · 5 target saddle (u32 0–3, 0 = the farthest
that is free and can be reached) · 6 coil removed from saddle (u32 1–3; the crane took it) · 7 start winding · 8 stop winding.
Hold-to-run, manual only, one bit at a time (two = none): 0 forward (away from the mandrel) 1 back 2 up 3 down 4 expand 5 collapse.

Reasons: 1 unknown 2 wrong state 3 emergency stop 4 needs reset 5 moving 6 no such saddle 7 saddle is empty 8 car in the way of the crane 9 a coil
is on the mandrel 10 mandrel not expanded 11 car in the way of winding 12 already winding 13 not winding 14 guard open 15 pressure or oil (they hold the mandrel)
20–22 settings.

Events (code · source · value): 1 automatic · 2 manual · 3 stop · 4 reset · 5/6 emergency stop on/off · 7/8 guard opened/closed · guard · 9/10 drive
tripped/ready · 1 horizontal 2 vertical · 11/12 pressure low/back · – · bar · 13 coil ready · – · mm · 14 coil on the car · 0 from the mandrel, saddle ·
mm · 15 coil on a saddle · saddle · mm · 16 coil removed by the crane · saddle · mm · 17/18 winding started/stopped · – · mm · 19 interlock
holds a movement · movement 1–7 · block · 20 collision · kind · mm · 21 action begun · action · 22 action done · action · seconds · 23 power up ·
– · boots · 24/25 host silent/back · 26 settings · 27 target · saddle · 28/29 mandrel expanded/collapsed · 30/31 limit switch implausible/plausible · 1–4 ·
position · 32/33 pump on/off · 34/35 oil cold/warm · – · °C · 36 mandrel does not move · 37 coil on the mandrel again · – · mm.

Retained: settings, target_selected, coils_done, coils_wound, events. Training registers: 0xE020 the recoiler winds by itself in automatic (1) or not ·
0xE021 growth of the coil [0.1 mm/s] · 0xE022 the crane takes a coil so many seconds after it was laid, 0 = never · 0xE031 power. Machine
faults (0xE010): 1/2 horizontal/vertical drive trips · 11–14 limit switch left, right, up, down stuck on · 21–24 stuck off · 31 pressure low ·
32 pump off · 33 oil cold · 41–43 guard n open · 50 emergency stop · 51 mandrel stuck · 60 host's heartbeat does not arrive.

| subject | rule |
| --- | --- |
| one movement at a time | an axis or the mandrel; another waits until it stands |
| interlock | an axis may go as far as its S-ramp can still stop before the next obstacle, in manual as in automatic; there is no override |
| emergency stop, guard, tripped drive, stuck mandrel | brake, mode off, held until the cause is gone and a reset |
| pressure, oil | block lifting, the mandrel and the begin of winding for as long as they last |
| limit switches | at the ends of the ways, where the PLC stops by its position; one that is actuated elsewhere blocks its direction |
| actions | only in automatic, for as long as they are asked; withdrawn = ramp to a stop |
| recoiler | in automatic, when `automatic_winding` is set, with an empty mandrel and no car in its zone it expands and winds to `order_diameter`; told to stop winding it waits for automatic or winding being commanded again; a stop, too, stops it |
"""  # noqa: E501

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from math import inf, isnan, nan
from struct import pack
from types import MappingProxyType

from app.blocks.s_ramp import SRamp
from app.registers.plc_map import AnswerState, Request
from app.sim import training
from app.sim.coil_car_machine import (
    BRAKE_X,
    CORRIDOR,
    FAULTS,
    HOST_OFF,
    LOWERED,
    MARGIN,
    MEASURES,
    RISE,
    TOUCH,
    CoilCar,
    Geometry,
    Hit,
    Obstacle,
)
from app.sim.plc import EVENT_CAPACITY, REASON_UNKNOWN, REASON_WRONG_STATE, Image, Setting, Verdict, VirtualPlc
from app.sim.plc import rejected as no

STATUS, CONFIGURATION, SETTINGS_AT, STAGING = 0x0100, 0x0180, 0x0200, 0x0240
STATUS_WORDS, CONFIGURATION_WORDS = 64, 64

SETTINGS: Sequence[Setting] = (
    Setting("automatic_horizontal", 400.0, 50.0, 600.0),
    Setting("manual_horizontal", 100.0, 10.0, 200.0),
    Setting("automatic_vertical", 100.0, 10.0, 150.0),
    Setting("manual_vertical", 40.0, 5.0, 100.0),
    Setting("acceleration_horizontal", 200.0, 50.0, 500.0),
    Setting("jerk_horizontal", 400.0, 50.0, 2000.0),
    Setting("acceleration_vertical", 100.0, 20.0, 300.0),
    Setting("jerk_vertical", 300.0, 20.0, 1000.0),
    Setting("order_diameter", 1300.0, 600.0, 1900.0),
    Setting("least_pressure", 80.0, 20.0, 150.0),
    Setting("least_oil_temperature", 15.0, 0.0, 40.0),
    Setting("automatic_winding", 1.0, 0.0, 1.0),
    Setting("host_timeout", 0.0, 0.0, 60.0),
)
"""In the order of the settings image; mm/s x 4, mm/s², mm/s³, mm/s², mm/s³, mm, bar, °C, 0 or 1, s."""

ACTIONS: Sequence[str] = (
    "lower",
    "drive_to_mandrel",
    "lift_to_coil",
    "collapse",
    "drive_out",
    "lift_over_saddle",
    "drive_to_saddle",
    "lower_onto_saddle",
    "expand",
)
"""What a sequence may ask: table to 0; under the mandrel; up to the coil; mandrel; to the free zone; over the saddles; to the target;
150 mm below the seat; mandrel."""

PRESETS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "diameter": (600, 1900),
        "mode": (0, 2),
        "horizontal": (0, 20000),
        "vertical": (0, 5000),
        "mandrel": (0, 2),
        "coil": (0, 1),
        "winding": (0, 1),
        "coil_on_car": (0, 1),
        "saddle_1": (0, 1),
        "saddle_2": (0, 1),
        "saddle_3": (0, 1),
        "target_saddle": (0, 3),
        "pressure": (-1, 250),
        "oil_temperature": (-1, 90),
        "pump": (0, 1),
        "guard_1": (0, 1),
        "guard_2": (0, 1),
        "guard_3": (0, 1),
        "emergency_stop": (0, 1),
        "automatic_winding": (0, 1),
        "crane": (0, 6000),
    }
)
"""What `given` and `set` of a test may put, with least and greatest value. mode 0 off, 1 automatic, 2 manual; coil: a finished one on the
mandrel; diameter [mm] of the coils that are put; winding: being wound; pressure [bar] and oil_temperature [°C]: held until −1; pump,
guard_n, emergency_stop: held until set back; crane [s]: takes coils so long after they were laid, 0 = never."""

MOVEMENTS: Sequence[str] = ("forward", "back", "up", "down", "expand", "collapse", "winding")
"""In the order of their interlock bits; the first six are also the bits of hold-to-run."""


class Command(IntEnum):
    """Command codes."""

    AUTOMATIC = 1
    STOP = 2
    MANUAL = 3
    RESET = 4
    TARGET = 5
    REMOVED = 6
    WIND = 7
    STOP_WINDING = 8


class Reason(IntEnum):
    """Why a command is refused; 20–22 come from the base."""

    UNKNOWN = REASON_UNKNOWN
    WRONG_STATE = REASON_WRONG_STATE
    EMERGENCY_STOP = 3
    HELD = 4
    MOVING = 5
    NO_SUCH_SADDLE = 6
    SADDLE_EMPTY = 7
    CRANE_BLOCKED = 8
    COIL_ON_MANDREL = 9
    NOT_EXPANDED = 10
    CAR_IN_THE_WAY = 11
    WINDING = 12
    NOT_WINDING = 13
    GUARD = 14
    HYDRAULICS = 15


class Event(IntEnum):
    """Codes of the ring."""

    AUTOMATIC, MANUAL, STOP, RESET = 1, 2, 3, 4
    EMERGENCY_STOP, EMERGENCY_STOP_OFF = 5, 6
    GUARD_OPENED, GUARD_CLOSED = 7, 8
    DRIVE_TRIPPED, DRIVE_READY = 9, 10
    PRESSURE_LOW, PRESSURE_BACK = 11, 12
    COIL_READY, COIL_ON_CAR, COIL_LAID, COIL_REMOVED = 13, 14, 15, 16
    WINDING, WINDING_STOPPED = 17, 18
    INTERLOCK, COLLISION = 19, 20
    ACTION_BEGUN, ACTION_DONE = 21, 22
    POWER_UP = 23
    HOST_SILENT, HOST_BACK = 24, 25
    SETTINGS, TARGET = 26, 27
    EXPANDED, COLLAPSED = 28, 29
    LIMIT_IMPLAUSIBLE, LIMIT_PLAUSIBLE = 30, 31
    PUMP_ON, PUMP_OFF = 32, 33
    OIL_COLD, OIL_WARM = 34, 35
    MANDREL_STUCK, COIL_ON_MANDREL = 36, 37


class State(IntEnum):
    """State word."""

    OFF = 0
    AUTOMATIC = 1
    AUTOMATIC_MOVING = 2
    MANUAL = 3
    MANUAL_MOVING = 4
    STOPPING = 5
    EMERGENCY_STOP = 6
    HELD = 7


class Mode(IntEnum):
    """Mode word."""

    OFF = 0
    AUTOMATIC = 1
    MANUAL = 2


class Fault(IntEnum):
    """What holds the machine until a reset."""

    NONE = 0
    EMERGENCY_STOP = 1
    GUARD = 2
    DRIVE_HORIZONTAL = 3
    DRIVE_VERTICAL = 4
    MANDREL = 5
    COLLISION = 6


class ActionState(IntEnum):
    """What becomes of the action that is asked."""

    NONE = 0
    RUNNING = 1
    DONE = 2
    BLOCKED = 3


@dataclass(frozen=True, slots=True)
class Place:
    """Where a value lies and how its words become a number."""

    address: int
    type: str = "u16"
    """u16, u32 or f32."""
    shift: int = 0
    mask: int = 0
    """After the shift; 0 = the whole word."""


BITS: Mapping[int, Sequence[str]] = MappingProxyType(
    {
        3: (
            *("automatic", "moving", "winding", "coil_on_mandrel", "coil_on_car", "coil_ready"),
            *("saddle_1", "saddle_2", "saddle_3", "at_mandrel", "at_saddle"),
            *("zone_mandrel", "zone_free", "zone_saddles", "target_free", "host_silent"),
        ),
        4: (
            *("limit_left", "limit_right", "limit_up", "limit_down", "drive_horizontal", "drive_vertical", "pump"),
            *("guard_1", "guard_2", "guard_3", "emergency_stop", "held"),
            *("collision", "collision_possible", "coil_contact", "lowered"),
        ),
        5: (
            *(f"interlock_{name}" for name in MOVEMENTS),
            *("at_target", "at_out", "over_saddle", "coil_laid", "pressure_ok", "oil_ok", "drives_ok"),
            *("guards_closed", "limits_plausible"),
        ),
    }
)
"""Word of the status image → the names of its bits from 0."""
WORDS: Mapping[str, int] = MappingProxyType(
    {
        **{"state": 1, "mode": 2, "mandrel": 6, "target_saddle": 7, "target_selected": 8},
        **{"action": 9, "action_state": 10, "fault": 11},
        **{f"block_{name}": 44 + n for n, name in enumerate(MOVEMENTS)},
        "collision_kind": 51,
    }
)
"""Name → word of the status image, u16."""
REALS: Mapping[str, int] = MappingProxyType(
    {
        **{"horizontal": 12, "vertical": 14, "horizontal_speed": 16, "vertical_speed": 18},
        **{"horizontal_target": 20, "vertical_target": 22, "coil_diameter": 24, "car_diameter": 26},
        **{f"saddle_{n}_diameter": 26 + 2 * n for n in (1, 2, 3)},
        **{"pressure": 34, "oil_temperature": 36, "mandrel_expansion": 38},
        **{"horizontal_stop": 52, "vertical_stop": 54, "contact_height": 56},
    }
)
"""Name → word of the status image, f32. A target without a movement and a contact height without a coil are NaN; a diameter without a
coil is 0."""
COUNTS: Mapping[str, int] = MappingProxyType({"coils_done": 40, "coils_wound": 42})
"""Name → word of the status image, u32."""


def _places() -> Mapping[str, Place]:
    places = {
        "config_crc": Place(4, "u32"),
        "boots": Place(7),
        "scan_time": Place(16),
        "scan_time_max": Place(17),
        "overruns": Place(18),
        "device_saddles": Place(CONFIGURATION + 1),
    }
    for word, names in BITS.items():
        places |= {name: Place(STATUS + word, shift=bit, mask=1) for bit, name in enumerate(names)}
    places |= {name: Place(STATUS + word) for name, word in WORDS.items()}
    places |= {name: Place(STATUS + word, "f32") for name, word in REALS.items()}
    places |= {name: Place(STATUS + word, "u32") for name, word in COUNTS.items()}
    places |= {f"device_{name}": Place(CONFIGURATION + 2 + 2 * n, "f32") for n, name in enumerate(MEASURES)}
    places |= {setting.name: Place(SETTINGS_AT + 2 + 2 * n, "f32") for n, setting in enumerate(SETTINGS)}
    return MappingProxyType(places)


REGISTERS: Mapping[str, Place] = _places()
"""Every value of the map by name; those of the status image are the signals that a sequence reads."""
SIGNALS: Sequence[str] = tuple(
    name for name, place in REGISTERS.items() if STATUS <= place.address < STATUS + STATUS_WORDS
) + tuple(setting.name for setting in SETTINGS)
"""What a sequence's sentences may name."""


class Block(IntEnum):
    """Why a movement is blocked."""

    FREE = 0
    EMERGENCY_STOP = 1
    GUARD = 2
    HELD = 3
    DRIVE = 4
    PRESSURE = 5
    OIL = 6
    LIMIT = 7
    END = 8
    NOT_LOWERED = 9
    COIL = 10
    IN_THE_EYE = 11
    SADDLE = 12
    NOT_COLLAPSED = 13
    OTHER_MOVEMENT = 14
    NOT_SUPPORTED = 15
    WINDING = 16
    THERE = 17
    COIL_THERE = 18
    CAR = 19
    NOT_CENTRED = 20
    MANDREL = 21


GEOMETRY = frozenset(
    {
        *(Block.END, Block.NOT_LOWERED, Block.COIL, Block.IN_THE_EYE, Block.SADDLE, Block.NOT_COLLAPSED),
        *(Block.NOT_CENTRED, Block.MANDREL),
    }
)
"""Blocks because of what is in the way."""
FORWARD, BACK, UP, DOWN, EXPAND, COLLAPSE, WIND = range(7)
"""Movements, by their places in `MOVEMENTS`."""
ARRIVED = 1.0
"""A positioned axis is there [mm]."""
MORE_ROOM = 5.0
"""A positioning that brakes goes on when there is this much more room [mm]."""
AT_REST = 1.0
"""A movement that has less room than this is blocked [mm]."""
DEPTH = 0.5
"""What a position may lie inside an obstacle of the interlock before it counts [mm]."""
STUCK_AFTER = 6.0
"""The mandrel must have arrived in this time [s]."""
IMPLAUSIBLE = 3.0
"""A limit switch contradicts the position by more than this [mm]."""
SADDLES = 3


class Move:
    """One axis: its ramp and whether it is braking."""

    __slots__ = ("braking", "cut", "ramp", "target")

    def __init__(self, acceleration: float, jerk: float) -> None:
        self.ramp = SRamp(acceleration, jerk)
        self.braking = False
        """A positioning that has begun to brake goes on to brake."""
        self.cut = False
        """The brake holds until the axis stands."""
        self.target = nan
        """[mm]"""

    def go(self, way: int, speed: float, room: float, dt: float) -> None:
        """One scan `way` (+1 or −1) at up to `speed` [mm/s] without coming to a stop beyond `room` [mm]."""
        ramp = self.ramp
        if not self.braking or ramp.stop_distance() * way < room - MORE_ROOM:
            trial = replace(ramp)
            out = trial.step(way * speed, dt)
            if ((ramp.speed + trial.speed) / 2 * dt + out.stop_distance) * way <= room:
                ramp.speed, ramp.acceleration = trial.speed, trial.acceleration
                self.braking = False
                return
        self.braking = True
        self.stop(dt)

    def stop(self, dt: float) -> None:
        """One scan of the ramp to standstill."""
        ramp = self.ramp
        if ramp.speed or ramp.acceleration:
            ramp.step(0.0, dt)
        else:
            self.braking = False


@dataclass(frozen=True, slots=True)
class Way:
    """How far an axis may go [mm], and what is at both ends."""

    low: float
    high: float
    below: Block
    above: Block


@dataclass(frozen=True, slots=True)
class Wish:
    """What is asked: a movement, and where an axis shall end."""

    movement: int
    speed: float = 0.0
    target: float = nan
    """NaN = as far as it may."""
    block: Block = Block.FREE
    """It makes no sense now."""


class VirtualCoilCar(VirtualPlc):
    """The PLC of one coil-car line."""

    type = "coil_car"
    TYPE_CODE = training.TYPE_CODES["coil_car"]
    signals: Sequence[str] = SIGNALS
    actions: Sequence[str] = ACTIONS

    machine: CoilCar
    """The line as it really is; only tests and screens of the class room look here."""
    mode: Mode
    fault: Fault
    action: int
    """Number in `ACTIONS`, from 1; 0 = none."""
    action_state: ActionState
    target_selected: int
    coils_done: int
    coils_wound: int
    _target: int
    _asked: tuple[str, ...]
    _wish: Wish | None
    _held_back: Block
    _action_block: Block
    _action_since: int
    _action_gone: tuple[int, int]
    _horizontal: Move
    _vertical: Move
    _mandrel: int
    _mandrel_age: float
    _stopping: bool
    _wind: bool
    _told_not_to_wind: bool
    _seen: dict[str, float]
    _told: tuple[int, int]
    _blocks: dict[int, Block]
    _start_mode: Mode
    _rectangles: list[Obstacle] | None
    _acting: int
    _silent: float
    _preset_diameter: float
    _getters: Mapping[str, Callable[[], float]]

    def __init__(
        self,
        geometry: Geometry | None = None,
        *,
        start: str = "stopped",
        coil: bool = False,
        growth: float = 20.0,
        crane: float = 0.0,
        settings: Mapping[str, float] | None = None,
    ) -> None:
        """A line just switched on for the first time: car in the free zone, mandrel expanded.

        `start`: automatic, manual or stopped; `coil`: a finished one is on the mandrel; `growth` of its diameter [mm/s]; `crane` [s], see
        the table above; `settings`: initial setpoints by name.

        Raises:
            ValueError: a measure, a number or a setting that cannot be.
        """
        self.geometry = geometry or Geometry()
        if start not in STARTS:
            raise ValueError(f"start = {start}: expected {', '.join(STARTS)}")
        for name, value, low, high in (("growth", growth, 0.1, 6000.0), ("crane", crane, 0.0, 6000.0)):
            if not low <= value <= high:
                raise ValueError(f"{name} = {value:g}: expected {low:g} to {high:g}")
        given = _settings(dict(settings or {}))
        self.interlocks = True
        """Only a test that wants to see collisions switches them off."""
        self._start_in, self._coil_there = STARTS[start], coil
        self._growth, self._crane = growth, crane
        super().__init__(
            settings=[Setting(s.name, given.get(s.name, s.default), s.low, s.high) for s in SETTINGS],
            settings_at=SETTINGS_AT,
            staging_at=STAGING,
            images=(
                Image(STATUS, STATUS_WORDS, self._status),
                Image(CONFIGURATION, CONFIGURATION_WORDS, self._configuration),
            ),
            configuration=CONFIGURATION,
            capacities=(SADDLES, len(SETTINGS), EVENT_CAPACITY),
            faults=FAULTS,
            words={
                training.REG_STRIP: 1,
                training.REG_GROWTH: round(growth * 10),
                training.REG_CRANE: round(crane),
            },
            limits=training.COIL_CAR_LIMITS,
        )
        self._start_up()

    # ---- what a sequence uses

    def signal(self, name: str) -> float:
        """The value of a point of the map now, as a sequence reads it.

        Raises:
            KeyError: no such signal.
        """
        return self._getters[name]()

    def ask(self, actions: Sequence[str]) -> None:
        """Ask for `actions` in the next scan; to be repeated in every scan for as long as they shall go on."""
        self._asked = (*self._asked, *actions)

    @property
    def takes_actions(self) -> bool:
        """Whether it does what a sequence asks."""
        return self.mode is Mode.AUTOMATIC

    def preset(self, values: Mapping[str, float]) -> None:
        """Put the line into a state, as `given` and `set` of a test do (`PRESETS`); all of them or none.

        Raises:
            ValueError: no such preset, a value out of its range, or values that would have the car touch something.
        """
        for name, value in values.items():
            if name not in PRESETS:
                raise ValueError(f"preset {name}: expected one of {', '.join(PRESETS)}")
            low, high = PRESETS[name]
            if not low <= value <= high:
                raise ValueError(f"preset {name} = {value:g}: expected {low:g} to {high:g}")
        before = self._picture()
        for name in sorted(values, key=list(PRESETS).index):
            self._put(name, values[name])
        machine = self.machine
        machine.look_for_a_hit()
        if machine.hit is not before[0]:
            kind = machine.hit.name.lower().replace("_", " ")
            machine.hit, machine.x, machine.v, machine.coil, machine.load, machine.expansion = before[:6]
            machine.saddles, machine.finished, machine.winding = before[6], before[7], before[8]
            said = ", ".join(f"{name} = {value:g}" for name, value in values.items())
            raise ValueError(f"preset {said}: there the car touches the {kind}")
        self._take_stock()
        self._choose_target()
        self._new_view()
        self._cached.clear()

    def _picture(self) -> tuple[Hit, float, float, float, float, float, list[float], bool, bool]:
        m = self.machine
        return m.hit, m.x, m.v, m.coil, m.load, m.expansion, list(m.saddles), m.finished, m.winding

    def _put(self, name: str, value: float) -> None:
        machine = self.machine
        if name == "mode":
            self.mode, self.fault = Mode(int(value)), Fault.NONE
        elif name == "horizontal":
            machine.x, machine.speed_x = value, 0.0
            self._horizontal.ramp.reset()
        elif name == "vertical":
            machine.v, machine.speed_v = value, 0.0
            self._vertical.ramp.reset()
        elif name == "mandrel":
            machine.expansion = value / 2
        elif name == "diameter":
            self._preset_diameter = value
        elif name == "coil":
            machine.coil, machine.finished, machine.winding = self._preset_diameter * value, value > 0, False
        elif name == "winding":
            machine.winding, machine.finished = value > 0, False
            if value and not machine.coil:
                machine.coil = self.geometry.coil_smallest
        elif name == "coil_on_car":
            machine.load = self._preset_diameter * value
        elif name.startswith("saddle_"):
            machine.saddles[int(name[-1]) - 1] = self._preset_diameter * value
        elif name == "target_saddle":
            self.target_selected = int(value)
        elif name == "automatic_winding":
            machine.strip = value > 0
        elif name == "crane":
            machine.crane = value
        elif name in ("pressure", "oil_temperature") and value < 0:
            machine.held.pop(name, None)
        else:
            machine.held[name] = value
            if name == "pressure":
                machine.pressure = value
            elif name == "oil_temperature":
                machine.oil = value

    # ---- one scan

    def _scan(self) -> None:
        machine = self.machine
        powered = (
            not self.fault and not self._horizontal.cut,
            not self.fault and not self._vertical.cut and self._oil_pressure() is Block.FREE,
        )
        machine.step(
            self._horizontal.ramp.speed,
            self._vertical.ramp.speed,
            powered,
            0 if self.fault else self._mandrel,
            self.dt,
        )
        if machine.winding and machine.coil >= self._values["order_diameter"]:
            machine.winding, machine.finished = False, True
        self._crane_takes()
        self._new_view()
        self._notice()
        self._hold_when_unsafe()
        self._host()
        self._choose_target()
        self._move()

    def _new_view(self) -> None:
        """What was judged before does not hold any more."""
        self._blocks.clear()
        self._rectangles = None

    def _crane_takes(self) -> None:
        machine = self.machine
        if machine.crane:
            for n, there in enumerate(machine.saddles):
                if there and machine.laid[n] >= machine.crane and not machine.below(n + 1):
                    machine.saddles[n] = 0.0

    def _take_stock(self) -> None:
        machine = self.machine
        self._seen = {
            "emergency_stop": float(machine.emergency_stop),
            **{f"guard_{n}": float(machine.guard(n)) for n in (1, 2, 3)},
            "drive_1": float(machine.drive_ready(1)),
            "drive_2": float(machine.drive_ready(2)),
            "pump": float(machine.pump),
            "pressure": float(machine.pressure >= self._values["least_pressure"]),
            "oil": float(machine.oil >= self._values["least_oil_temperature"]),
            "mandrel": float(machine.mandrel),
            "winding": float(machine.winding),
            "finished": float(machine.finished),
            "coil": machine.coil,
            "load": machine.load,
            **{f"saddle_{n}": there for n, there in enumerate(machine.saddles, 1)},
            "hit": float(machine.hit),
            **{f"limit_{n}": float(self._plausible(n)) for n in (1, 2, 3, 4)},
        }

    def _plausible(self, number: int) -> bool:
        machine = self.machine
        if machine.limit(number):
            return machine.limit_expected(number, -IMPLAUSIBLE)
        return not machine.limit_expected(number, IMPLAUSIBLE)

    def _notice(self) -> None:
        """Tell what has changed since the last scan."""
        before = self._seen
        self._take_stock()
        now, machine = self._seen, self.machine
        if now == before:
            return

        def edge(name: str, rise: Event, fall: Event, source: int = 0, value: float = 0.0) -> None:
            if now[name] != before[name]:
                self.event(rise if now[name] else fall, source, value)

        edge("emergency_stop", Event.EMERGENCY_STOP, Event.EMERGENCY_STOP_OFF)
        for n in (1, 2, 3):
            edge(f"guard_{n}", Event.GUARD_CLOSED, Event.GUARD_OPENED, n)
        for n in (1, 2):
            edge(f"drive_{n}", Event.DRIVE_READY, Event.DRIVE_TRIPPED, n)
        edge("pump", Event.PUMP_ON, Event.PUMP_OFF)
        edge("pressure", Event.PRESSURE_BACK, Event.PRESSURE_LOW, 0, machine.pressure)
        edge("oil", Event.OIL_WARM, Event.OIL_COLD, 0, machine.oil)
        for n in (1, 2, 3, 4):
            at = machine.x if n < 3 else machine.v
            edge(f"limit_{n}", Event.LIMIT_PLAUSIBLE, Event.LIMIT_IMPLAUSIBLE, n, at)
        if now["mandrel"] != before["mandrel"] and now["mandrel"] != 1:
            self.event(Event.EXPANDED if now["mandrel"] else Event.COLLAPSED)
        if now["winding"] != before["winding"]:
            if now["winding"]:
                self.event(Event.WINDING, 0, machine.coil)
            elif not machine.finished:
                self.event(Event.WINDING_STOPPED, 0, machine.coil)
        if now["finished"] and not before["finished"]:
            if before["load"] and not now["load"]:
                self.event(Event.COIL_ON_MANDREL, 0, machine.coil)
            else:
                self.coils_wound = self.coils_wound + 1 & 0xFFFFFFFF
                self.event(Event.COIL_READY, 0, machine.coil)
        self._notice_coils(before, now)
        if now["hit"] and not before["hit"]:
            self.event(Event.COLLISION, int(now["hit"]), machine.x)

    def _notice_coils(self, before: Mapping[str, float], now: Mapping[str, float]) -> None:
        gained = now["load"] and not before["load"]
        lost = before["load"] and not now["load"]
        source = 0
        for n in (1, 2, 3):
            name = f"saddle_{n}"
            if now[name] and not before[name] and lost:
                self.coils_done = self.coils_done + 1 & 0xFFFFFFFF
                self.event(Event.COIL_LAID, n, now[name])
            elif before[name] and not now[name]:
                if gained:
                    source = n
                else:
                    self.event(Event.COIL_REMOVED, n, before[name])
        if gained:
            self.event(Event.COIL_ON_CAR, source, now["load"])

    def _hold_when_unsafe(self) -> None:
        machine = self.machine
        if self.fault:
            return
        if machine.emergency_stop:
            self._trip(Fault.EMERGENCY_STOP)
        elif not all(machine.guard(n) for n in (1, 2, 3)):
            self._trip(Fault.GUARD)
        elif not machine.drive_ready(1):
            self._trip(Fault.DRIVE_HORIZONTAL)
        elif not machine.drive_ready(2):
            self._trip(Fault.DRIVE_VERTICAL)
        elif self.interlocks and machine.hit is not Hit.NONE:
            self._trip(Fault.COLLISION)

    def _trip(self, fault: Fault) -> None:
        """Brakes on, mode off, until a reset."""
        self.fault, self.mode = fault, Mode.OFF
        self.machine.winding = False

    def _host(self) -> None:
        silent, before = float(self.host_silent), self._silent
        if silent != before:
            self._silent = silent
            self.event(Event.HOST_SILENT if silent else Event.HOST_BACK)
            if silent:
                self.mode = Mode.OFF

    def _choose_target(self) -> None:
        machine, measures = self.machine, self.geometry
        if self.target_selected:
            self._target = self.target_selected
            return
        # Who stands at a saddle is at it, also when the coil lies there: the next target is that of who drives away.
        if self._target and (self._free(self._target) if machine.load else self._at(measures.saddle(self._target))):
            return
        free = [n for n in (1, 2, 3) if self._free(n)]
        self._target = free[0] if free else 1

    def _free(self, number: int) -> bool:
        """Whether a coil can be laid on saddle `number`: it is empty and so are those before it."""
        return number > 0 and not any(self.machine.saddles[n - 1] for n in range(number, SADDLES + 1))

    def _can_lay(self) -> bool:
        """Whether there is a saddle for the coil on the car, or for the next one."""
        if self.machine.load or self.target_selected:
            return self._free(self._target)
        return self._free(SADDLES)

    # ---- interlock

    def _obstacles(self) -> list[Obstacle]:
        """Of this scan."""
        if self._rectangles is None:
            self._rectangles = self._around()
        return self._rectangles

    def _around(self) -> list[Obstacle]:
        """Positions that the interlock keeps the car away from; `kind` is the block."""
        machine, m = self.machine, self.geometry
        half, near = m.coil_width / 2, m.position_tolerance
        free, middle = m.free_from, m.mandrel_position
        out: list[Obstacle] = []
        if machine.load:
            if machine.coil:
                out.append(Obstacle(-inf, free, -inf, inf, Block.COIL))
            elif machine.mandrel:
                out.append(Obstacle(-inf, free, -inf, inf, Block.NOT_COLLAPSED))
            else:
                centre, slack = m.contact(machine.load), (m.eye_diameter - m.collapsed_diameter) / 5
                out.append(Obstacle(-inf, free, -inf, centre - slack, Block.IN_THE_EYE))
                out.append(Obstacle(-inf, free, centre + slack, inf, Block.IN_THE_EYE))
            for n, there in enumerate(machine.saddles, 1):
                at = m.saddle(n)
                if there:
                    reach = m.coil_width + MARGIN
                    out.append(Obstacle(at - reach, at + reach, -inf, m.saddle_height + there + RISE, Block.COIL))
                else:
                    reach, seat = half + m.saddle_length / 2 + MARGIN, m.saddle_height + RISE
                    out.append(Obstacle(at - reach, at - near, -inf, seat, Block.SADDLE))
                    out.append(Obstacle(at + near, at + reach, -inf, seat, Block.SADDLE))
            return out
        out.append(Obstacle(-inf, middle - near, LOWERED, inf, Block.NOT_LOWERED))
        out.append(Obstacle(middle + near, free, LOWERED, inf, Block.NOT_LOWERED))
        if machine.winding:
            top, block = LOWERED, Block.WINDING
        elif machine.coil:
            top, block = m.contact(machine.coil) + TOUCH - 1, Block.COIL
        else:
            top, block = m.mandrel_height - m.eye_diameter / 2 - CORRIDOR, Block.MANDREL
        wide = near + 2 * DEPTH  # overlaps its neighbours, so that no position lies between them
        out.append(Obstacle(middle - wide, middle + wide, top, inf, block))
        reach = (m.coil_width + m.table_width) / 2 + MARGIN
        for n, there in enumerate(machine.saddles, 1):
            if there:
                at, seat = m.saddle(n), m.saddle_height - RISE
                out.append(Obstacle(at - reach, at - near, seat, inf, Block.COIL))
                out.append(Obstacle(at + near, at + reach, seat, inf, Block.COIL))
        return out

    def way(self, horizontal: bool) -> Way:
        """How far an axis may go while the other stands where it is."""
        machine, m = self.machine, self.geometry
        here, across = (machine.x, machine.v) if horizontal else (machine.v, machine.x)
        low, high = 0.0, m.travel if horizontal else m.lift
        below = above = Block.END
        for one in self._obstacles() if self.interlocks else ():
            begin, end, first, last = one.left, one.right, one.low, one.high
            if not horizontal:
                begin, end, first, last = first, last, begin, end
            if not first + DEPTH < across < last - DEPTH:
                continue
            if begin + DEPTH < here < end - DEPTH:
                return Way(here, here, Block(one.kind), Block(one.kind))
            if end - DEPTH <= here:
                if end > low:
                    low, below = end, Block(one.kind)
            elif begin < high:
                high, above = begin, Block(one.kind)
        first_switch, second_switch = (1, 2) if horizontal else (4, 3)
        if machine.limit(first_switch) and here > low and not machine.limit_expected(first_switch, -IMPLAUSIBLE):
            low, below = here, Block.LIMIT
        if machine.limit(second_switch) and here < high and not machine.limit_expected(second_switch, -IMPLAUSIBLE):
            high, above = here, Block.LIMIT
        return Way(min(low, here), max(high, here), below, above)

    def _oil_pressure(self) -> Block:
        machine, values = self.machine, self._values
        if machine.pressure < values["least_pressure"]:
            return Block.PRESSURE
        return Block.OIL if machine.oil < values["least_oil_temperature"] else Block.FREE

    @property
    def _safety(self) -> Block:
        machine = self.machine
        if machine.emergency_stop:
            return Block.EMERGENCY_STOP
        if not all(machine.guard(n) for n in (1, 2, 3)):
            return Block.GUARD
        return Block.HELD if self.fault else Block.FREE

    @property
    def _standing_x(self) -> bool:
        return not (self.machine.speed_x or self._horizontal.ramp.speed or self._horizontal.ramp.acceleration)

    @property
    def _standing_v(self) -> bool:
        return not (self.machine.speed_v or self._vertical.ramp.speed or self._vertical.ramp.acceleration)

    @property
    def _in_zone(self) -> bool:
        """The car is, or comes to a stop, where the mandrel matters to it."""
        machine = self.machine
        nearest = machine.x + min(0.0, self._horizontal.ramp.stop_distance(), -_braking(machine.speed_x))
        return nearest < self.geometry.free_from + DEPTH

    @property
    def moving(self) -> bool:
        """Whether anything of the car or the mandrel moves."""
        return not (self._standing_x and self._standing_v and not self._mandrel)

    def block(self, movement: int) -> Block:
        """Why a movement (place in `MOVEMENTS`) cannot begin or go on now."""
        found = self._blocks.get(movement)
        if found is None:
            found = self._blocks[movement] = self._judge(movement)
        return found

    def _judge(self, movement: int) -> Block:
        machine = self.machine
        safety = self._safety
        if safety is not Block.FREE:
            return safety
        if movement in (FORWARD, BACK):
            if not machine.drive_ready(1):
                return Block.DRIVE
            if not self._standing_v or (self._mandrel and self._in_zone):
                return Block.OTHER_MOVEMENT
        elif movement in (UP, DOWN):
            if not machine.drive_ready(2):
                return Block.DRIVE
            if (hydraulic := self._oil_pressure()) is not Block.FREE:
                return hydraulic
            if not self._standing_x or (self._mandrel and self._in_zone):
                return Block.OTHER_MOVEMENT
        elif movement == WIND:
            return self._judge_winding()
        else:
            if (hydraulic := self._oil_pressure()) is not Block.FREE:
                return hydraulic
            return self._judge_mandrel(movement)
        way = self.way(movement in (FORWARD, BACK))
        here = machine.x if movement in (FORWARD, BACK) else machine.v
        if movement in (FORWARD, UP):
            return way.above if way.high - here < AT_REST else Block.FREE
        return way.below if here - way.low < AT_REST else Block.FREE

    def _judge_mandrel(self, movement: int) -> Block:
        machine, m = self.machine, self.geometry
        if machine.expansion >= 1.0 if movement == EXPAND else machine.expansion <= 0.0:
            return Block.THERE
        if not self.interlocks:
            return Block.FREE
        if machine.winding:
            return Block.WINDING
        if self._in_zone and not (self._standing_x and self._standing_v):
            return Block.OTHER_MOVEMENT
        centred = abs(machine.x - m.mandrel_position) <= m.position_tolerance + DEPTH
        if movement == EXPAND:
            if machine.load and self._in_zone:
                at_height = abs(machine.v - m.contact(machine.load)) <= TOUCH - 1
                return Block.FREE if centred and at_height and not machine.coil else Block.NOT_CENTRED
            return Block.FREE
        if machine.coil and not (centred and machine.contact):
            return Block.NOT_SUPPORTED
        return Block.FREE

    def _judge_winding(self) -> Block:
        machine = self.machine
        if machine.winding:
            return Block.WINDING
        if machine.finished:
            return Block.COIL_THERE
        if (hydraulic := self._oil_pressure()) is not Block.FREE:
            return hydraulic
        if machine.expansion < 1.0:
            return Block.NOT_COLLAPSED if machine.coil else Block.MANDREL
        lowered = not machine.load and max(machine.v, machine.v + self._vertical.ramp.stop_distance()) <= LOWERED
        return Block.CAR if self.interlocks and self._in_zone and not lowered else Block.FREE

    # ---- movements

    def _move(self) -> None:
        self._judge_cut(self._horizontal, True)
        self._judge_cut(self._vertical, False)
        wish = self._wished()
        self._wish = wish
        self._held_back = Block.FREE
        mandrel = 0
        horizontal = vertical = False
        if wish is not None:
            block = wish.block or self._block_of(wish)
            if block not in (Block.FREE, Block.THERE):
                self._held_back = block
            elif wish.movement in (FORWARD, BACK):
                horizontal = self._go(self._horizontal, wish, True)
            elif wish.movement in (UP, DOWN):
                vertical = self._go(self._vertical, wish, False)
            elif block is Block.FREE:
                mandrel = 1 if wish.movement == EXPAND else -1
        if not horizontal:
            self._horizontal.stop(self.dt)
            self._horizontal.target = nan
        if not vertical:
            self._vertical.stop(self.dt)
            self._vertical.target = nan
        if not mandrel:
            mandrel = self._recoil()
        self._watch_mandrel(mandrel)
        self._mandrel = mandrel
        self._tell_blocks(wish)
        self._follow_action(wish)
        if self._stopping and not self.moving:
            self._stopping = False

    def _judge_cut(self, axis: Move, horizontal: bool) -> None:
        """Brake when there is no more supply, or less room than the ramp needs."""
        machine = self.machine
        speed = machine.speed_x if horizontal else machine.speed_v
        if self.fault or axis.cut or (not horizontal and self._oil_pressure() is not Block.FREE):
            axis.ramp.reset()
            axis.cut = axis.cut and speed != 0.0
            axis.braking = False
            return
        if not speed and not axis.ramp.speed:
            return
        way = self.way(horizontal)
        here = machine.x if horizontal else machine.v
        end = here + axis.ramp.stop_distance()
        if not way.low - 1 <= end <= way.high + 1:
            axis.cut = True
            axis.ramp.reset()

    def _block_of(self, wish: Wish) -> Block:
        block = self.block(wish.movement)
        if wish.movement >= EXPAND or isnan(wish.target) or self._oversees(block):
            return block
        horizontal = wish.movement in (FORWARD, BACK)
        here = self.machine.x if horizontal else self.machine.v
        if abs(wish.target - here) <= ARRIVED:
            return Block.THERE
        way = self.way(horizontal)
        if wish.target > way.high + ARRIVED:
            return way.above
        if wish.target < way.low - ARRIVED:
            return way.below
        return Block.FREE

    @staticmethod
    def _oversees(block: Block) -> bool:
        """A block that has nothing to do with how far it may go."""
        return block is not Block.FREE and block not in GEOMETRY and block not in (Block.LIMIT, Block.WINDING)

    def _go(self, axis: Move, wish: Wish, horizontal: bool) -> bool:
        """Move; False when there is nothing to move."""
        machine = self.machine
        here = machine.x if horizontal else machine.v
        way, up = self.way(horizontal), wish.movement in (FORWARD, UP)
        end = way.high if up else way.low
        if not isnan(wish.target):
            end = min(max(wish.target, way.low), way.high)
        axis.target = end
        standing = self._standing_x if horizontal else self._standing_v
        if axis.cut or (standing and abs(end - here) <= ARRIVED):
            return False
        axis.go(1 if up else -1, wish.speed, (end - here) * (1 if up else -1), self.dt)
        return True

    def _wished(self) -> Wish | None:
        asked, self._asked = self._asked, ()
        self._acting = 0
        if self.mode is Mode.MANUAL and not self._stopping:
            return self._jogged()
        if self.mode is Mode.AUTOMATIC and not self._stopping:
            for name in asked:
                if name in ACTIONS:
                    self._acting = ACTIONS.index(name) + 1
                    return self._act(name)
        return None

    def _jogged(self) -> Wish | None:
        """Of hold-to-run; two bits at a time are none."""
        bits = self.hold & (1 << EXPAND + 2) - 1
        if not bits or bits & bits - 1:
            return None
        movement = bits.bit_length() - 1
        return Wish(movement, self._values["manual_horizontal" if movement in (FORWARD, BACK) else "manual_vertical"])

    def _act(self, name: str) -> Wish | None:
        machine, m = self.machine, self.geometry
        if name == "expand":
            return Wish(EXPAND)
        if name == "collapse":
            return Wish(COLLAPSE)
        speed = self._values["automatic_vertical"]
        if name == "lift_to_coil" and not (machine.coil or machine.load):
            return Wish(UP, block=Block.COIL_THERE)
        target = {
            "lower": 0.0,
            "drive_to_mandrel": m.mandrel_position,
            "lift_to_coil": m.contact(machine.coil or machine.load),
            "drive_out": m.out_position,
            "lift_over_saddle": m.saddle_height + m.clearance,
            "drive_to_saddle": m.saddle(self._target),
            "lower_onto_saddle": m.saddle_height - m.clearance,
        }[name]
        if name.startswith("drive"):
            return Wish(FORWARD if target >= machine.x else BACK, self._values["automatic_horizontal"], target)
        return Wish(UP if target >= machine.v else DOWN, speed, target)

    def _recoil(self) -> int:
        """The recoiler by itself: what its mandrel does."""
        machine, values = self.machine, self._values
        if self._wind and self.block(WIND) is Block.FREE:
            self._begin_winding()
        self._wind = False
        if self.mode is not Mode.AUTOMATIC or not machine.strip or values["automatic_winding"] < 0.5:
            return 0
        if machine.finished or machine.winding or self._told_not_to_wind or self._stopping:
            return 0
        if machine.coil:
            if self.block(WIND) is Block.FREE:
                self._begin_winding()
            return 0
        if self._in_zone:
            return 0
        if machine.expansion < 1.0:
            return 1 if self.block(EXPAND) is Block.FREE else 0
        if self.block(WIND) is Block.FREE:
            self._begin_winding()
        return 0

    def _begin_winding(self) -> None:
        machine = self.machine
        machine.coil = machine.coil or self.geometry.coil_smallest
        machine.winding = True
        self._new_view()

    def _watch_mandrel(self, mandrel: int) -> None:
        if mandrel and mandrel == self._mandrel:
            self._mandrel_age += self.dt
            if self._mandrel_age > STUCK_AFTER and not self.fault:
                self.event(Event.MANDREL_STUCK)
                self._trip(Fault.MANDREL)
        else:
            self._mandrel_age = 0.0

    def _tell_blocks(self, wish: Wish | None) -> None:
        if wish is None:
            self._told = (-1, 0)
            return
        told = (wish.movement, int(self._held_back))
        if told != self._told:
            self._told = told
            if self._held_back is not Block.FREE:
                self.event(Event.INTERLOCK, wish.movement + 1, float(self._held_back))

    def _follow_action(self, wish: Wish | None) -> None:
        if self._acting != self.action:
            self.action, self._action_since = self._acting, self.time
            self.action_state = ActionState.RUNNING if self.action else ActionState.NONE
            if self.action:
                self.event(Event.ACTION_BEGUN, self.action)
        if not self.action or wish is None:
            return
        if self._held_back is not Block.FREE:
            self.action_state = ActionState.BLOCKED
        elif self._is_there(wish):
            if self.action_state is not ActionState.DONE:
                self.action_state = ActionState.DONE
                self.event(Event.ACTION_DONE, self.action, (self.time - self._action_since) / 1e6)
        else:
            self.action_state = ActionState.RUNNING

    def _is_there(self, wish: Wish) -> bool:
        machine = self.machine
        if wish.movement == EXPAND:
            return machine.expansion >= 1.0
        if wish.movement == COLLAPSE:
            return machine.expansion <= 0.0
        here = machine.x if wish.movement in (FORWARD, BACK) else machine.v
        standing = self._standing_x if wish.movement in (FORWARD, BACK) else self._standing_v
        return standing and abs(wish.target - here) <= ARRIVED

    # ---- commands

    @property
    def state(self) -> int:
        """State word."""
        if self.machine.emergency_stop or self.fault is Fault.EMERGENCY_STOP:
            return State.EMERGENCY_STOP
        if self.fault:
            return State.HELD
        moving = self.moving
        if self.mode is Mode.AUTOMATIC and not self._stopping:
            return State.AUTOMATIC_MOVING if moving else State.AUTOMATIC
        if self.mode is Mode.MANUAL and not self._stopping:
            return State.MANUAL_MOVING if moving else State.MANUAL
        return State.STOPPING if moving else State.OFF

    def _execute(self, request: Request) -> Verdict:
        code, first = request.code, request.arguments[0]
        self._new_view()
        if code == Command.STOP:
            return self._stop()
        if code == Command.RESET:
            return self._reset()
        if code in (Command.AUTOMATIC, Command.MANUAL):
            return self._change_mode(Mode.AUTOMATIC if code == Command.AUTOMATIC else Mode.MANUAL)
        if code == Command.TARGET:
            if not 0 <= first <= SADDLES:
                return no(Reason.NO_SUCH_SADDLE)
            if self.machine.load and self._asked_to_move():
                return no(Reason.MOVING)
            self.target_selected = first
            self._choose_target()
            self.event(Event.TARGET, first)
            return Verdict()
        if code == Command.REMOVED:
            return self._removed(first)
        if code in (Command.WIND, Command.STOP_WINDING):
            return self._winding(code)
        return no(Reason.UNKNOWN)

    def _asked_to_move(self) -> bool:
        return not self._standing_x

    def _stop(self) -> Verdict:
        self.event(Event.STOP)
        self.mode = Mode.OFF
        self.machine.winding = False
        if not self.moving:
            return Verdict()
        self._stopping = True

        def standing() -> AnswerState:
            return AnswerState.RUNNING if self.moving else AnswerState.DONE

        return Verdict(AnswerState.RUNNING, until=standing)

    def _reset(self) -> Verdict:
        machine = self.machine
        if machine.emergency_stop:
            return no(Reason.EMERGENCY_STOP)
        if not all(machine.guard(n) for n in (1, 2, 3)):
            return no(Reason.GUARD)
        if self.moving:
            return no(Reason.MOVING)
        if machine.hit is not Hit.NONE and self.interlocks:
            return no(Reason.HELD, Fault.COLLISION)
        self.event(Event.RESET)
        self.fault = Fault.NONE
        return Verdict()

    def _change_mode(self, mode: Mode) -> Verdict:
        machine = self.machine
        if machine.emergency_stop:
            return no(Reason.EMERGENCY_STOP)
        if not all(machine.guard(n) for n in (1, 2, 3)):
            return no(Reason.GUARD)
        if self.fault:
            return no(Reason.HELD, self.fault)
        if mode is self.mode and not self._stopping:
            return Verdict()
        if self.moving or self.hold:
            return no(Reason.MOVING)
        if mode is Mode.AUTOMATIC and self.host_silent:
            return no(Reason.WRONG_STATE, self.state)
        self.mode, self._told_not_to_wind = mode, False
        self.event(Event.AUTOMATIC if mode is Mode.AUTOMATIC else Event.MANUAL)
        return Verdict()

    def _removed(self, number: int) -> Verdict:
        machine = self.machine
        if not 1 <= number <= SADDLES:
            return no(Reason.NO_SUCH_SADDLE)
        if not machine.saddles[number - 1]:
            return no(Reason.SADDLE_EMPTY, number)
        if machine.below(number):
            return no(Reason.CRANE_BLOCKED, number)
        machine.saddles[number - 1] = 0.0
        return Verdict(detail=number)

    def _winding(self, code: int) -> Verdict:
        machine = self.machine
        if code == Command.STOP_WINDING:
            if not machine.winding:
                return no(Reason.NOT_WINDING)
            machine.winding, self._told_not_to_wind = False, True
            return Verdict()
        if self.mode is Mode.OFF and not self.fault:
            return no(Reason.WRONG_STATE, self.state)
        block = self.block(WIND)
        if block is not Block.FREE:
            return no(_WINDING_REASONS[block])
        self._wind, self._told_not_to_wind = True, False
        return Verdict()

    # ---- settings, training, power

    @property
    def host_timeout(self) -> float:
        return self._values["host_timeout"]

    def _host_deaf(self) -> bool:
        return self.machine.fault == HOST_OFF

    def _settings_fault(self, values: Mapping[str, float]) -> int:
        if not self.geometry.coil_smallest < values["order_diameter"] <= self.geometry.coil_largest:
            return [setting.name for setting in SETTINGS].index("order_diameter") + 1
        return 0

    def _settings_changed(self) -> None:
        self._take_settings()
        self.event(Event.SETTINGS)

    def _take_settings(self) -> None:
        values = self._values
        for axis, name in ((self._horizontal, "horizontal"), (self._vertical, "vertical")):
            axis.ramp.acceleration_limit = values[f"acceleration_{name}"]
            axis.ramp.jerk = values[f"jerk_{name}"]

    def _trained(self, address: int, word: int) -> None:
        machine = self.machine
        if address == training.REG_STRIP:
            machine.strip = bool(word)
        elif address == training.REG_GROWTH:
            machine.growth = word / 10
        elif address == training.REG_CRANE:
            machine.crane = float(word)
        elif address == training.REG_MACHINE_FAULT:
            machine.fault = word

    def _forget(self) -> None:
        machine = self.machine = CoilCar(self.geometry)
        machine.growth, machine.crane = self._growth, self._crane
        self._preset_diameter = self._values["order_diameter"]
        if self._coil_there:
            machine.coil, machine.finished = self._preset_diameter, True
        self.target_selected = self.coils_done = self.coils_wound = 0
        self._start_mode = self._start_in
        self._getters = self._name_signals()

    def _power_up(self) -> None:
        values = self._values
        self.mode, self._start_mode = self._start_mode, Mode.OFF
        self.fault = Fault.NONE
        self._horizontal = Move(values["acceleration_horizontal"], values["jerk_horizontal"])
        self._vertical = Move(values["acceleration_vertical"], values["jerk_vertical"])
        self._horizontal.cut = self._vertical.cut = True
        self.machine.winding = False
        self.action, self.action_state = 0, ActionState.NONE
        self._acting = self._action_since = self._target = self._mandrel = 0
        self._asked = ()
        self._wish = None
        self._held_back = Block.FREE
        self._mandrel_age = self._silent = 0.0
        self._stopping = self._wind = self._told_not_to_wind = False
        self._told = (-1, 0)
        self._blocks, self._rectangles = {}, None
        self._take_stock()
        self._choose_target()
        self.event(Event.POWER_UP, value=self.boots)

    # ---- the register images

    def _at_any_saddle(self) -> bool:
        m = self.geometry
        return any(abs(self.machine.x - m.saddle(n)) <= m.position_tolerance + DEPTH for n in (1, 2, 3))

    def _at(self, position: float) -> bool:
        return abs(self.machine.x - position) <= self.geometry.position_tolerance + DEPTH

    def _name_signals(self) -> Mapping[str, Callable[[], float]]:
        """What a point's value is, by name."""
        c, m = self.geometry, self.machine
        h, v = self._horizontal_stop, self._vertical_stop
        getters: dict[str, Callable[[], float]] = {
            "automatic": lambda: self.mode is Mode.AUTOMATIC,
            "moving": lambda: self.moving,
            "winding": lambda: m.winding,
            "coil_on_mandrel": lambda: m.coil > 0,
            "coil_on_car": lambda: m.load > 0,
            "coil_ready": lambda: m.finished,
            "at_mandrel": lambda: self._at(c.mandrel_position),
            "at_saddle": self._at_any_saddle,
            "zone_mandrel": lambda: m.x < c.free_from,
            "zone_free": lambda: c.free_from <= m.x <= c.saddles_from,
            "zone_saddles": lambda: m.x > c.saddles_from,
            "target_free": self._can_lay,
            "host_silent": lambda: self.host_silent,
            **{f"limit_{name}": _limit(m, n) for n, name in enumerate(("left", "right", "up", "down"), 1)},
            "drive_horizontal": lambda: m.drive_ready(1),
            "drive_vertical": lambda: m.drive_ready(2),
            "pump": lambda: m.pump,
            **{f"guard_{n}": _guard(m, n) for n in (1, 2, 3)},
            "emergency_stop": lambda: m.emergency_stop,
            "held": lambda: self.fault is not Fault.NONE,
            "collision": lambda: m.hit is not Hit.NONE,
            "collision_possible": lambda: self._held_back in GEOMETRY,
            "coil_contact": lambda: m.contact,
            "lowered": lambda: m.v <= LOWERED,
            "at_target": lambda: self._at(c.saddle(self._target)),
            "at_out": lambda: self._at(c.out_position),
            "over_saddle": lambda: m.v >= c.saddle_height + c.clearance - RISE,
            "coil_laid": lambda: m.saddles[self._target - 1] > 0 and not m.load and m.v < c.saddle_height,
            "pressure_ok": lambda: m.pressure >= self._values["least_pressure"],
            "oil_ok": lambda: m.oil >= self._values["least_oil_temperature"],
            "drives_ok": lambda: m.drive_ready(1) and m.drive_ready(2),
            "guards_closed": lambda: m.guard(1) and m.guard(2) and m.guard(3),
            "limits_plausible": lambda: all(self._plausible(n) for n in (1, 2, 3, 4)),
            "state": lambda: self.state,
            "mode": lambda: self.mode,
            "mandrel": lambda: m.mandrel,
            "target_saddle": lambda: self._target,
            "target_selected": lambda: self.target_selected,
            "action": lambda: self.action,
            "action_state": lambda: self.action_state,
            "fault": lambda: self.fault,
            "collision_kind": lambda: m.hit,
            "horizontal": lambda: m.x,
            "vertical": lambda: m.v,
            "horizontal_speed": lambda: m.speed_x,
            "vertical_speed": lambda: m.speed_v,
            "horizontal_target": lambda: self._horizontal.target,
            "vertical_target": lambda: self._vertical.target,
            "coil_diameter": lambda: m.coil,
            "car_diameter": lambda: m.load,
            "pressure": lambda: m.pressure,
            "oil_temperature": lambda: m.oil,
            "mandrel_expansion": lambda: 100 * m.expansion,
            "horizontal_stop": h,
            "vertical_stop": v,
            "contact_height": lambda: c.contact(m.coil) if m.coil else nan,
            "coils_done": lambda: self.coils_done,
            "coils_wound": lambda: self.coils_wound,
        }
        for n in (1, 2, 3):
            getters[f"saddle_{n}"], getters[f"saddle_{n}_diameter"] = _saddle(m, n)
        for n, name in enumerate(MOVEMENTS):
            getters[f"interlock_{name}"], getters[f"block_{name}"] = self._block_signals(n)
        for setting in SETTINGS:
            getters[setting.name] = self._setting_signal(setting.name)
        return MappingProxyType(getters)

    def _block_signals(self, movement: int) -> tuple[Callable[[], float], Callable[[], float]]:
        return lambda: self.block(movement) is not Block.FREE, lambda: self.block(movement)

    def _setting_signal(self, name: str) -> Callable[[], float]:
        return lambda: self._values[name]

    def _horizontal_stop(self) -> float:
        return self._horizontal.ramp.stop_distance()

    def _vertical_stop(self) -> float:
        return self._vertical.ramp.stop_distance()

    def _status(self) -> bytes:
        image = bytearray(2 * (STATUS_WORDS - 2))

        def put(word: int, packed: bytes) -> None:
            at = 2 * (word - 1)
            image[at : at + len(packed)] = packed

        signals = self._getters
        for word, names in BITS.items():
            put(word, pack(">H", sum(1 << bit for bit, name in enumerate(names) if signals[name]())))
        for name, word in WORDS.items():
            put(word, pack(">H", int(signals[name]())))
        for name, word in REALS.items():
            put(word, pack(">f", signals[name]()))
        for name, word in COUNTS.items():
            put(word, pack(">I", int(signals[name]())))
        return bytes(image)

    def _configuration(self) -> bytes:
        measures = [getattr(self.geometry, name) for name in MEASURES]
        packed = pack(f">H{len(measures)}f", SADDLES, *measures)
        return packed.ljust(2 * (CONFIGURATION_WORDS - 2), b"\0")


STARTS: Mapping[str, Mode] = MappingProxyType({"stopped": Mode.OFF, "automatic": Mode.AUTOMATIC, "manual": Mode.MANUAL})
"""Mode that a line may be switched on in for the first time."""
_WINDING_REASONS: Mapping[Block, Reason] = MappingProxyType(
    {
        Block.EMERGENCY_STOP: Reason.EMERGENCY_STOP,
        Block.GUARD: Reason.GUARD,
        Block.HELD: Reason.HELD,
        Block.PRESSURE: Reason.HYDRAULICS,
        Block.OIL: Reason.HYDRAULICS,
        Block.WINDING: Reason.WINDING,
        Block.COIL_THERE: Reason.COIL_ON_MANDREL,
        Block.NOT_COLLAPSED: Reason.NOT_EXPANDED,
        Block.MANDREL: Reason.NOT_EXPANDED,
        Block.CAR: Reason.CAR_IN_THE_WAY,
    }
)


def _limit(machine: CoilCar, number: int) -> Callable[[], float]:
    return lambda: machine.limit(number)


def _guard(machine: CoilCar, number: int) -> Callable[[], float]:
    return lambda: machine.guard(number)


def _saddle(machine: CoilCar, number: int) -> tuple[Callable[[], float], Callable[[], float]]:
    return lambda: machine.saddles[number - 1] > 0, lambda: machine.saddles[number - 1]


def _braking(speed: float) -> float:
    """Way to a stop of a car that moves back at `speed` [mm/s], not less than with its brake [mm]."""
    return speed * speed / (2 * BRAKE_X) if speed < 0 else 0.0


def _settings(given: Mapping[str, float]) -> Mapping[str, float]:
    limits = {setting.name: setting for setting in SETTINGS}
    for name, value in given.items():
        if name not in limits:
            raise ValueError(f"setting {name}: expected one of {', '.join(limits)}")
        if not limits[name].low <= value <= limits[name].high:
            raise ValueError(f"{name} takes {limits[name].low:g} to {limits[name].high:g}, not {value:g}")
    return given
