"""What a plant consists of, after its files were read: the vocabulary that every other part speaks.

Texts are keys: of `equipment/<type>/texts.<lang>.toml`, then of `locale/<lang>/`. Conditions name points without equipment (`speed`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from app.plant.actions import Action
from app.plant.alarm_class import AlarmClass
from app.plant.argument import Argument as Argument
from app.plant.condition import Condition as Condition
from app.plant.drawing import Part
from app.plant.lesson_definition import Lesson
from app.plant.picture import PictureData
from app.plant.problems import Problem
from app.plant.sequence_definition import SequenceDefinition
from app.plant.simulation import Simulation
from app.plant.today import Figures
from app.profidrive.parameter_access.parameter import DriveParameter
from app.records.kind import RecordKind, joined
from app.records.snapshot import Layout
from app.registers.register import Order as Order
from app.registers.register import Register as Register
from app.registers.register import Type as Type

Texts = Mapping[str, str]  # language → text, for what the plant file itself names (labels)


class Kind(StrEnum):
    """What a value is, which decides how it is drawn, stored and interpolated."""

    ANALOG = "analog"
    STEP = "step"
    """A number that holds until it changes: a setpoint, a counter."""
    ENUM = "enum"
    BOOL = "bool"
    TEXT = "text"


class Scan(StrEnum):
    """How often a point is read."""

    FAST = "fast"
    SLOW = "slow"
    PAGE = "page"
    """Only while a page that shows it is open (and once after connecting)."""
    ONCE = "once"
    """After connecting and after each write."""


@dataclass(frozen=True, slots=True)
class Derived:
    """A value computed from others of the same equipment; `kind` is one of the closed list in plant/derive.py."""

    kind: str
    of: str = ""
    when: str = ""
    """Name of the point it is computed from, and condition that steers it."""


@dataclass(frozen=True, slots=True)
class Point:
    """One value of one equipment."""

    name: str
    """`<equipment>.<key>`."""
    id: str
    """Lasting identity of its history."""
    equipment: str
    key: str
    label: str
    """Text key."""
    kind: Kind = Kind.ANALOG
    unit: str = ""
    """Unit key (`Hz`, `rpm`); drawn per language."""
    decimals: int = 0
    register: Register | None = None
    derived: Derived | None = None
    scan: Scan = Scan.FAST
    low: float | None = None
    high: float | None = None
    plausible: tuple[float, float] | None = None
    """Beyond `low`, `high`, what the device can report, the quality is uncertain; beyond the plausible range bad [EU]."""
    normal: tuple[float, float] | None = None
    """Normal band [EU]."""
    scale_low: float | None = None
    """Ends of a drawn scale [EU]."""
    scale_high: float | None = None
    dead_band: float = 0.0
    """Change too small to store [EU]."""
    history: bool = True
    opens_trends: bool = False
    """It tells how fast a drive runs: a pen of who opens the trends the first time."""
    texts: Mapping[int, str] = field(default_factory=dict)
    """Value → text key, for enumerations and booleans."""
    certainty: str = ""
    """Marks of the reference sheet: M, T, C, X confirmed; G unconfirmed."""
    reason: str = ""
    """Why the plant file gives it other limits than its type."""
    table: str = ""
    row: int = 0
    """Table that it is a cell of (empty = none) and row (slot) of that, from 0."""


@dataclass(frozen=True, slots=True)
class Effect:
    """What a command will do, as the question before it tells it."""

    text: str
    """Text key."""
    when: str = ""
    """Sentence: it is told only while that holds; empty = always."""
    values: Mapping[str, str] = field(default_factory=dict)
    """Numbers that the text names: name → expression over points."""


@dataclass(frozen=True, slots=True)
class Write:
    """One telegram of a command: a point of the equipment and what it gets."""

    point: str
    value: str
    """A number; `argument`: what the person entered; `option:<name>`: of the equipment; `previous`: what the point held before."""
    when: str = ""
    """Sentence: it is left out unless that holds as the command is sent; empty = always written."""
    after: str = ""
    """Sentence that must hold before it is written, by values read after the write before it; empty = at once."""
    within: float = 2.0
    """How long that is waited for [s]; then the command has failed."""


@dataclass(frozen=True, slots=True)
class Command:
    """Something a person may ask of an equipment."""

    key: str
    label: str
    writes: Sequence[Write]
    feedback: str
    """Condition that proves it happened; `argument` is what was asked."""
    timeout: str
    """Seconds within which the feedback must come, a number or an expression over points (ramp times)."""
    level: str = "C1"
    """Confirmation level C0–C4 of hmi-design.md section 10."""
    level_when: tuple[str, str] | None = None
    """(condition, level): a higher level while the condition holds (reverse while running)."""
    role: str = "operator"
    stop: bool = False
    """The Stop of the machine: no token, no nonce, no confirmation, repeated until read back or 10 s."""
    hold: bool = False
    """Hold-to-run; `release` is written when it ends."""
    release: Sequence[Write] = ()
    released: str = ""  # condition that proves that a hold-to-run is over; empty = what the Stop is confirmed by
    moves: bool = True
    """False for what does not make the machine move (reset, setpoint)."""
    argument: str = ""  # point whose range, unit and decimals the argument has
    symbol: str = ""
    code: int = 0
    """Of a Pogon PLC: sent as one command telegram with this code (registers/plc_map.py) instead of `writes`."""
    arguments: Sequence[Argument] = ()
    """What goes with the code, in order; the person enters them."""
    hold_bits: int = 0
    """Of a hold-to-run on such a machine: the request bits that are sent, with a rising counter, while the button is held."""
    needs_reason: bool = False
    """The person gives a reason, which goes into the audit trail."""
    refused: Mapping[int, str] = field(default_factory=dict)
    """Modbus exception with which the device refuses it → text key of what it means by that."""
    effects: Sequence[Effect] = ()
    """What it will do; the first one counts whose `when` holds and whose numbers are known."""
    aside: bool = False  # it stands with all values of the machine (page/values), not among its commands

    @property
    def puts_back(self) -> bool:
        """Whether it gives points back what they held before a hold-to-run that nobody ended."""
        return not self.hold and any(write.value == "previous" for write in self.writes)


@dataclass(frozen=True, slots=True)
class Setpoint:
    """A value that a person may change: a parameter or the working setpoint."""

    key: str
    """Key of its point; the point carries register, unit, decimals."""
    low: str
    """Least value: a number or an expression over points (F112)."""
    high: str
    normal: tuple[float, float] | None = None
    role: str = "engineer"
    group: str = ""
    code: str = ""
    """The maker's name: F114."""
    options: Mapping[int, str] = field(default_factory=dict)
    """Value → text key, for choices."""
    stopped_only: bool = False
    warning: str = ""
    """Text key shown before writing."""
    default: float | None = None
    certainty: str = ""


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm of an equipment."""

    key: str
    label: str
    """Text key: "Object: condition"."""
    expression: str
    """When it is active; empty for the kinds that need no sentence."""
    priority: int
    clear: str = ""
    """When it is over; empty = when `expression` is false (a dead-band needs its own sentence)."""
    kind: str = "expression"
    """expression, high, low, deviation, rate or bad_quality (alarms/conditions.py); the others work on `value` and `limit`."""
    dead_band: float = 0.0
    """How far it must go back before it is over [EU]."""
    reference: str = ""
    """Point from which a deviation is measured."""
    window: float = 1.0
    """Time over which a rate is taken [s]."""
    realarm: float = 0.0
    """An acknowledged alarm asks for attention again after this [s]; 0 = never."""
    on_delay: float = 0.0
    off_delay: float = 0.0
    latching: bool = False
    ack_required: bool = True
    audible: bool = True
    alarm_class: str = "process"
    value: str = ""  # point whose value is kept with the alarm
    limit: float | None = None
    consequence: str = ""
    cause: str = ""
    response: str = ""
    event: int = 0
    """Code of the device's event that raises it, with the event's own time, order and value; 0 = none. `expression`, when there is one,
    still says whether it stands and raises it `on_delay` later should the event be lost; without one it is over at once."""
    event_clear: int = 0
    """Code of the event that ends it."""
    source: int | None = None
    """Only events with this source; None = any."""


@dataclass(frozen=True, slots=True)
class Image:
    """Registers that the device swaps as one; the first is a generation word that the last repeats. Read in one telegram."""

    address: int
    words: int
    since: int = 0  # least minor version of the map that has it


class UnitService:
    """What a unit offers beside plain registers; each kind is a table of `device.toml` and is served in links/services.py."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class PlcMap(UnitService):
    """What a Pogon PLC has beyond registers/plc_map.py."""

    type_code: int
    """Word 3 of the header."""
    images: Sequence[Image] = ()
    settings: Image | None = None
    """Setpoints in effect: generation, count, values, generation. A write to a point inside goes through `staging` as a whole set."""
    staging: int = 0
    """First register of the staged values."""
    status: str = ""
    """Point whose value is the state that a command expects; empty = none."""
    events: bool = False
    """Whether it has an event ring."""


@dataclass(frozen=True, slots=True)
class MailboxMap(UnitService):
    """Where a drive has its mailbox for parameter requests (profidrive/parameter_access/mailbox.py)."""

    address: int
    """First of its 122 registers."""
    error: int = 0
    """Register that tells why a telegram was refused with exception 04; 0 = none."""
    timeout: float = 5.0
    """Longest time for an answer [s]."""


@dataclass(frozen=True, slots=True)
class ParameterMap(UnitService):
    """The parameters of a drive are registers of one word, found by their codes (registers/function_codes.py)."""

    most: int = 1
    """Registers per read."""
    permanent: tuple[int, int] | None = None
    """(register, word) written before parameters, so that they go to permanent memory; None = they do."""
    ranges: Sequence[tuple[str, str]] = ()
    """Codes that a drive may have: first and last of each group."""
    individual: frozenset[str] = frozenset()
    """Codes that belong to one drive alone."""


@dataclass(frozen=True, slots=True)
class Interventions:
    """The rows of a table are interventions of people in a machine: each stands until its time is over or somebody takes it back.

    One page lists them for the whole plant (web/forces.py): what, who, why, how long still.
    """

    count: str
    """Point: how many stand."""
    remaining: str
    """Column: time left [s]."""
    owner: str
    """Column: number of the person who asked, as it went with the command."""
    record: str
    """Kind of record that tells why; its number is the row's (web/screens, `row_name`)."""
    release: str
    """Command that takes one back; each of its arguments is the column of its name."""
    release_all: str
    """Command that takes all of them back."""


@dataclass(frozen=True, slots=True)
class TableMap:
    """A table of the device: fixed slots, of which the first `count` are read. Each cell is a point `<key>_<slot>_<column>`, slots from 1.

    A row of `row` words begins with its id (u32), its generation and its state, and ends with the generation again. The three words of its
    head are points, too. `capacity`: a number, or an option of the equipment; `since`: least minor version of the map that has it.
    """

    key: str
    address: int
    row: int
    capacity: str
    columns: Sequence[str] = ()
    scan: Scan = Scan.FAST
    since: int = 0
    interventions: Interventions | None = None
    """What its rows are, if they are that."""


@dataclass(frozen=True, slots=True)
class Device:
    """What a device of this type can take (reference sheets)."""

    max_read: int = 125
    """Registers per read."""
    max_read_bits: int = 2000
    """Coils, or discrete inputs, per read."""
    fallback_read: int = 0
    """Registers per read after exception 02/03 or silence at the larger size; 0 = none."""
    group_read: Mapping[str, int] = field(default_factory=dict)
    """Smaller limits by scan class (`once`: parameters)."""
    max_write: int = 1
    read_functions: Sequence[int] = (3,)
    write_functions: Sequence[int] = (6,)
    turnaround: float = 0.02
    """Typical time between request and answer [s]."""
    timeout: float = 0.25
    """On top of the wire time [s]."""
    connections: int = 1
    """TCP connections it allows."""
    pipelining: int = 1
    keeps: bool = True
    """What is written to it is kept when it is switched off."""
    fast: float = 0.1
    """Default scan periods [s]."""
    slow: float = 1.0
    holes: Sequence[tuple[int, int]] = ()
    """Address ranges (first, last) that it does not answer."""
    write_only: Sequence[tuple[int, int]] = ()
    training: int = 0xE000
    """Address of the training registers of its virtual device."""
    makers_map: bool = False
    """Whether its registers are its maker's: a unit that shows the header of a Pogon PLC is another device."""
    services: Sequence[UnitService] = ()
    """What its unit offers beside plain registers; at most one of a kind."""

    @property
    def plc(self) -> PlcMap | None:
        """Of a Pogon PLC (reference/register-map.md)."""
        return next((service for service in self.services if isinstance(service, PlcMap)), None)

    @property
    def parameters(self) -> ParameterMap | None:
        """Of a drive whose parameters are registers."""
        return next((service for service in self.services if isinstance(service, ParameterMap)), None)


@dataclass(frozen=True, slots=True)
class TrainingWord:
    """A training register of a type of machine."""

    register: int
    low: int
    high: int
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Training:
    """What an instructor may do to a simulated machine of a type besides breaking its line (plant/training.py)."""

    faults: Mapping[str, int] = field(default_factory=dict)
    """Name of a machine fault → code."""
    names: str = ""
    """Point whose texts name the faults; empty = the texts of the type do."""
    live: Sequence[str] = ()
    """Points that are shown beside it."""
    world: Mapping[str, TrainingWord] = field(default_factory=dict)
    """What is set and kept; limits of 0 and 1 make a switch."""
    acts: Mapping[str, TrainingWord] = field(default_factory=dict)
    """What acts once and reads 0."""
    switches: Mapping[str, TrainingWord] = field(default_factory=dict)
    """Bits, of which one is turned over."""


@dataclass(frozen=True, slots=True)
class EquipmentType:
    """A folder of app/equipment, read."""

    name: str
    folder: Path
    label: str
    device: Device
    points: Mapping[str, Point]
    """By key, with `equipment` and `name` still empty."""
    commands: Mapping[str, Command]
    permissives: Sequence[Condition]
    interlocks: Sequence[Condition]
    setpoints: Mapping[str, Setpoint]
    alarms: Sequence[Alarm]
    texts: Mapping[str, Mapping[str, str]]
    """Language → key → text."""
    options: Mapping[str, object] = field(default_factory=dict)
    """What a plant file may set for an instance, with its default (`rated_current = 4.5`)."""
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Least and greatest value of an option that is a number."""
    area: str = ""
    """Area of its machines when the plant file names none; empty = the name of the type."""
    tables: Mapping[str, TableMap] = field(default_factory=dict)
    presets: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Name of a preset (`preset = "model"` in the plant file) → defaults of options."""
    events: Mapping[int, str] = field(default_factory=dict)
    """Code of an event of the device → its key; the text is `event.<key>`."""
    snapshot: Layout = field(default_factory=dict)
    """What the snapshot words of its events say; texts are `snapshot.<name>`."""
    reasons: Mapping[int, str] = field(default_factory=dict)
    """Reason in an answer of the device → its key; the text is `reason.<key>`."""
    checks: Sequence[Condition] = ()
    """What must hold between setpoints: a value that breaks one is not written."""
    ratings: Sequence[Condition] = ()
    """What the device says of itself and its motor, against the options of the plant file: what does not hold is told as a doubt."""
    sequence: bool = False
    """Whether its equipment runs a sequence of the plant: `definition` and `machine` in the plant file, `steps` as an option."""
    actions: Sequence[str] = ()
    """What its own sequence may ask of such a machine."""
    orders: Mapping[str, Action] = field(default_factory=dict)
    """What any sequence may have such a machine do, through the gate."""
    simulation_presets: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """What a test of a sequence may set on the simulated machine → least and greatest value."""
    records: Mapping[str, RecordKind] = field(default_factory=dict)
    """What it keeps of its history, by name, in the order of records.toml."""
    training: Training = field(default_factory=Training)
    simulation: Simulation | None = None  # what its virtual device does, when its data says it (simulation.toml)
    kin: str = ""
    """Type whose texts, drive parameters and style sheets it has, too."""
    drive_parameters: Mapping[str, DriveParameter] = field(default_factory=dict)
    """What is known of the parameters of its drives, by code."""
    symbol: str = "e-machine"  # what its machines are drawn as, in static/symbols.svg
    tile: frozenset[str] = frozenset()
    """Keys of the points that its tile on the overview draws: of the others a page of many machines is not told."""
    today: Figures = field(default_factory=dict)  # what is told of a day of its machines
    picture: PictureData | None = None  # None: the picture of the plant shows names and alarms only

    @property
    def interventions(self) -> Mapping[str, Interventions]:
        """Tables whose rows are interventions of people, by key."""
        return {key: table.interventions for key, table in self.tables.items() if table.interventions}


@dataclass(frozen=True, slots=True)
class Equipment:
    """One machine of the plant."""

    id: str
    type: EquipmentType
    link: str
    unit: int
    label: Texts
    area: str
    points: Mapping[str, Point]
    """By key."""
    alarms: Sequence[Alarm]
    options: Mapping[str, object] = field(default_factory=dict)
    tables: Mapping[str, int] = field(default_factory=dict)
    """Table of the type → slots that this machine has."""
    sequence: SequenceDefinition | None = None
    """Of an equipment that runs one."""
    machine: str = ""
    """Equipment whose signals and actions its sequence uses; empty = none."""
    preset: str = ""  # of the type, that its options come from; empty = none
    was: str = ""
    """Its first name, where it has another one now; empty = it still has it."""
    base: int = 0
    """What is added to the addresses of its type; its points have it already."""

    @property
    def lasting(self) -> str:
        """What stays when it is renamed: the first part of the lasting ids of its points."""
        return self.was or self.id


@dataclass(frozen=True, slots=True)
class Link:
    """A connection to devices."""

    name: str
    transport: str
    """memory, tcp or rtu."""
    host: str = ""
    tcp_port: int = 502
    port: str = ""
    """Serial device."""
    baud: int = 9600
    parity: str = "even"
    stop_bits: int = 1
    writes: bool | None = None
    """Whether commands may be sent; None when the plant file says nothing: then only to what is simulated in this process."""
    believe_simulated: bool = False
    """`simulated = true`: a device of this link that says it is simulated counts as such. Anybody on the wire can say so."""
    fast: float | None = None
    slow: float | None = None
    timeout: float | None = None
    label: Texts = field(default_factory=dict)

    @property
    def simulated(self) -> bool:
        """Whether the plant file itself says that nothing real is behind it."""
        return self.transport == "memory"

    @property
    def may_write(self) -> bool:
        """Whether anything may be sent that writes; whatever a device says of itself does not count."""
        return self.simulated if self.writes is None else self.writes


@dataclass(frozen=True, slots=True)
class PlantScreen:
    """A screen that the plant folder brings (plant_files/screens.py)."""

    name: str
    label: Texts
    picture: Part | None
    """None exactly when there are problems."""
    problems: Sequence[Problem] = ()
    place: int | None = None
    """Among the tabs of screens; None: after those that have one, by name."""

    @property
    def tags(self) -> Sequence[str]:
        """Names of the points that it shows, each once."""
        return self.picture.tags if self.picture else ()


@dataclass(frozen=True, slots=True)
class Plant:
    """A plant folder, read."""

    folder: Path
    name: Texts
    timezone: str
    languages: Sequence[str]  # the first is the plant's default
    areas: Mapping[str, Texts]
    links: Mapping[str, Link]
    equipment: Mapping[str, Equipment]
    types: Mapping[str, EquipmentType]
    texts: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # language → key → text, for its alarm rows
    flow: Sequence[tuple[str, str]] = ()  # material flows from the first machine of each to the second
    lessons: Mapping[str, Lesson] = field(default_factory=dict)  # by name (plant/lessons.py)
    shifts: Sequence[int] = (6 * 60, 14 * 60, 22 * 60)  # when they begin [minutes of the local day]
    alarm_classes: Mapping[str, AlarmClass] = field(default_factory=dict)  # what it says of them itself
    screens: Mapping[str, PlantScreen] = field(default_factory=dict)  # its own, by name (plant_files/screens.py)
    doubts: Sequence[Problem] = field(default=(), compare=False)  # what is no mistake in its files, and seldom meant
    records: Mapping[str, RecordKind] = field(init=False, compare=False)  # by name: no two types name a kind alike

    def __post_init__(self) -> None:
        kinds = (kind for item in self.equipment.values() for kind in item.type.records.values())
        object.__setattr__(self, "records", joined(kinds))

    @property
    def points(self) -> Mapping[str, Point]:
        """Every point of every equipment by name."""
        return {point.name: point for item in self.equipment.values() for point in item.points.values()}

    def on_link(self, name: str) -> list[Equipment]:
        """The equipment behind the link `name`."""
        return [item for item in self.equipment.values() if item.link == name]
