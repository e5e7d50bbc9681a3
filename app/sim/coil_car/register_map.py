"""The register map of the coil car's virtual PLC: where every value lies, what words and codes mean, what a sequence may ask.

`horizontal` is the middle of the car [mm] from the recoiler's wall: the mandrel sticks out from there to `mandrel_reach`, then comes the free
zone, then the saddles; saddle 1 is the farthest and is filled first. A car with a coil does not pass a coil on a saddle. `vertical` is the
height of the car's table [mm], 0 = lowered; a coil on it has its lowest point there.

Header words 23–31: 3 saddles · settings · 59 events.

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
"""  # noqa: E501

from collections.abc import Mapping, Sequence
from enum import IntEnum
from types import MappingProxyType

from app.sim.coil_car.machine import MEASURES
from app.sim.plc import HEADER_PLACES, REASON_UNKNOWN, REASON_WRONG_STATE, RegisterPlace, Setting

STATUS, CONFIGURATION, SETTINGS_AT, STAGING = 0x0100, 0x0180, 0x0200, 0x0240

STATUS_WORDS, CONFIGURATION_WORDS = 64, 64

SADDLES = 3

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

FORWARD, BACK, UP, DOWN, EXPAND, COLLAPSE, WIND = range(7)
"""Movements, by their places in `MOVEMENTS`."""


class CoilCarCommand(IntEnum):
    """Command codes."""

    AUTOMATIC = 1
    STOP = 2
    MANUAL = 3
    RESET = 4
    TARGET = 5
    REMOVED = 6
    WIND = 7
    STOP_WINDING = 8


class CoilCarReason(IntEnum):
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


class CoilCarEvent(IntEnum):
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


class CoilCarState(IntEnum):
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


def _places() -> Mapping[str, RegisterPlace]:
    places = {
        **HEADER_PLACES,
        "device_saddles": RegisterPlace(CONFIGURATION + 1),
    }
    for word, names in BITS.items():
        places |= {name: RegisterPlace(STATUS + word, shift=bit, mask=1) for bit, name in enumerate(names)}
    places |= {name: RegisterPlace(STATUS + word) for name, word in WORDS.items()}
    places |= {name: RegisterPlace(STATUS + word, "f32") for name, word in REALS.items()}
    places |= {name: RegisterPlace(STATUS + word, "u32") for name, word in COUNTS.items()}
    places |= {f"device_{name}": RegisterPlace(CONFIGURATION + 2 + 2 * n, "f32") for n, name in enumerate(MEASURES)}
    places |= {setting.name: RegisterPlace(SETTINGS_AT + 2 + 2 * n, "f32") for n, setting in enumerate(SETTINGS)}
    return MappingProxyType(places)


REGISTERS: Mapping[str, RegisterPlace] = _places()
"""Every value of the map by name; those of the status image are the signals that a sequence reads."""

SIGNALS: Sequence[str] = tuple(
    name for name, place in REGISTERS.items() if STATUS <= place.address < STATUS + STATUS_WORDS
) + tuple(setting.name for setting in SETTINGS)
"""What a sequence's sentences may name."""

STARTS: Mapping[str, Mode] = MappingProxyType({"stopped": Mode.OFF, "automatic": Mode.AUTOMATIC, "manual": Mode.MANUAL})
"""Mode that a line may be switched on in for the first time."""
