"""Equipment types: the folders of app/equipment, read once.

`device.toml` limits of the device, options of an instance, presets and checks of them; `points.toml` values; `setpoints.toml` parameters
(each is a point too); `checks.toml` what must hold between them (`[key]` with `expression`); `commands.toml`; `interlocks.toml` with
`[permissives.…]` and `[interlocks.…]`; `alarms.toml`; `training.toml` (plant/training.py); `texts.<lang>.toml`; of a machine with a map of
ours also `tables.toml` and `events.toml` (plant/plc.py), `records.toml` (plant/record_kinds.py).

Of a type whose equipment runs a sequence, and of a machine that one may use, device.toml says:

    sequence = true                                     takes `definition` and `machine`; `BY_DEFINITION` are options it gives
    [actions]
    names = ["lower", "lift"]                           what the steps of a sequence may ask of the machine
    [presets_of_simulation]
    pressure = [0, 250]                                 what a test of a sequence may set on the simulated machine: least, greatest

A missing file but device.toml and points.toml means: there are none of these. Names of text keys follow the keys: `point.speed`,
`command.stop`, `alarm.overcurrent.label`, `argument.head`, of all cells of a column `point.product.head`; what stands under `label` in the
data wins.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from app.errors import ConfigurationError
from app.plant import expression, plc, record_kinds
from app.plant.definitions import (
    Alarm,
    Argument,
    Command,
    Condition,
    Derived,
    Device,
    EquipmentType,
    Kind,
    Order,
    PlcMap,
    Point,
    Problem,
    Register,
    Scan,
    Setpoint,
    TableMap,
    Type,
    Write,
)
from app.plant.derive import KINDS
from app.plant.services import read_services
from app.plant.tables import MISSING, NONE, Source, Table, one_of
from app.plant.training import read_training
from app.plant.training import text_keys as training_keys
from app.registers.plc_map import TABLE_HEAD

EQUIPMENT = Path(__file__).resolve().parent.parent / "equipment"
PACKAGE = "app.equipment"
"""Where the Python of a type is imported from."""
KEY = r"[a-z][a-z0-9_]*"
WORDS: Mapping[Type, int] = {
    Type.U16: 1,
    Type.I16: 1,
    Type.U32: 2,
    Type.I32: 2,
    Type.F32: 2,
    Type.U64: 4,
    Type.STRING: 16,
}
LEVELS = ("C0", "C1", "C2", "C3", "C4")
ROLES = ("viewer", "operator", "engineer", "admin")
SPECIAL_VALUES = ("argument", "previous")
ARGUMENT_TYPES = (Type.F32, Type.U32, Type.I32)
MOST_ARGUMENTS = 4
STEPS = "steps"
"""Option of a type whose equipment runs a sequence: its number of steps."""
MOST_STEPS = 200
BY_DEFINITION: Mapping[str, tuple[float, float, float]] = {
    STEPS: (8.0, 1.0, float(MOST_STEPS)),
    "program": (0.0, 0.0, float(2**32 - 1)),
    "longest_force": (28_800.0, 1.0, 7 * 86_400.0),
    "keep_forces": (0.0, 0.0, 1.0),
}
"""Options that no plant file sets, as the definition of the sequence gives them (`sequences.options`) → default, lowest, highest."""
ALARM_KINDS = ("expression", "high", "low", "deviation", "rate", "bad_quality")


@dataclass(slots=True)
class PointData:
    """A point of a type as its data stands; bounds may still be expressions over options."""

    point: Point
    bounds: dict[str, str] = field(default_factory=dict)
    """Field of the point (`low`, `high`, `scale_low`, `scale_high`, `dead_band`, `normal.0`, `normal.1`) → expression."""


@dataclass(frozen=True, slots=True)
class Check:
    """What must hold between the options of a machine: `[[checks]]` of device.toml."""

    expression: str
    """A sentence over options that are numbers."""
    option: str
    """The one that is blamed."""
    expected: str
    """What was expected of it; `{name}` is an option's value."""


@dataclass(frozen=True, slots=True)
class TypeData:
    """An equipment type with what only the loader needs."""

    type: EquipmentType
    points: Mapping[str, PointData]
    choices: Mapping[str, Mapping[str, Sequence[str]]]
    """Options that are tables (`simulation`): key → allowed words."""
    parameters: Mapping[str, frozenset[str]]
    """Options that are tables: codes of parameters that may stand in them."""
    numbers: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    """Options that are tables: key → least and greatest number."""
    columns: Mapping[str, Mapping[str, PointData]] = field(default_factory=dict)
    """Table → column → the cell of slot 1, its key still that of the column."""
    checks: Sequence[Check] = ()


def names(folder: Path = EQUIPMENT) -> list[str]:
    """Equipment types that exist."""
    return sorted(path.parent.name for path in folder.glob("*/device.toml"))


def read_type(
    name: str, languages: Sequence[str], folder: Path = EQUIPMENT, *, spoken: Sequence[str] | None = None
) -> tuple[TypeData, list[Problem]]:
    """Read the folder of type `name`; the data is only of use when there are no problems.

    Of `languages` its texts are read where it has them; of those `spoken` (else of all) it must have them.
    """
    reader = _TypeReader(folder / name, name, languages, languages if spoken is None else spoken)
    return reader.read(), reader.problems


class _TypeReader:
    def __init__(self, folder: Path, name: str, languages: Sequence[str], spoken: Sequence[str]) -> None:
        self.folder = folder
        self.name = name
        self.languages = languages
        self.spoken = spoken
        self.sources: list[Source] = []
        self.points: dict[str, PointData] = {}
        self.options: dict[str, object] = {}
        self.ranges: dict[str, tuple[float, float]] = {}
        self.numbers: dict[str, dict[str, tuple[float, float]]] = {}
        self.map: PlcMap | None = None
        self.events: dict[int, str] = {}
        self.expressions: list[tuple[Table, str, str, bool]] = []

    @property
    def problems(self) -> list[Problem]:
        return [problem for source in self.sources for problem in source.problems]

    def read(self) -> TypeData:
        head = self._file("device.toml")
        device = self._device(head.table("device"))
        label, area = head.text("label", "type"), head.text("area", "")
        symbol = head.text(
            "symbol", "e-machine", pattern=r"[ei]-[a-z0-9-]+", expected="a symbol of static/symbols.svg: e-…"
        )
        choices, parameters = self._options(head)
        presets = self._presets(head)
        sequence = head.flag("sequence")
        if sequence:
            self._add_definition(head)
        actions, simulation_presets = self._sequence_words(head, sequence)
        checks = tuple(self._checks(head, presets))
        device = replace(device, services=read_services(head, device))
        self.map = device.plc
        head.done()
        names = self._file("events.toml", optional=True)
        self.events, reasons = plc.read_names(names, "events"), plc.read_names(names, "reasons")
        snapshot = plc.read_snapshot(names)
        names.done()
        kinds = record_kinds.read_kinds(
            self._file("records.toml", optional=True), self.folder, PACKAGE, self.events, list(snapshot)
        )
        for key, table in self._file("points.toml").tables():
            self._point(key, table)
        tables, columns = self._tables(self._file("tables.toml", optional=True))
        for counting in {map.capacity for map in tables.values()} & set(self.ranges):
            self._check_whole(head, counting, presets)
        setpoints = dict(self._setpoints(self._file("setpoints.toml", optional=True)))
        commands = {
            key: self._command(key, table) for key, table in self._file("commands.toml", optional=True).tables()
        }
        guards = self._file("interlocks.toml", optional=True)
        permissives = [self._condition("permissive", key, table) for key, table in guards.tables("permissives")]
        interlocks = [self._condition("interlock", key, table) for key, table in guards.tables("interlocks")]
        guards.done()
        relations = self._file("checks.toml", optional=True)
        checked = [self._condition("check", key, table) for key, table in relations.tables()]
        for check in checked:
            points = self._names(check.expression)
            if points is not None and points.isdisjoint(setpoints):
                relations.note(f"{check.key}.expression", check.expression, "a sentence over at least one setpoint")
            if check.commands:
                relations.note(
                    f"{check.key}.commands", ", ".join(check.commands), "no commands: a check is about values"
                )
        alarms = [self._alarm(key, table) for key, table in self._file("alarms.toml", optional=True).tables()]
        for guard, conditions in (("permissives", permissives), ("interlocks", interlocks)):
            for condition in conditions:
                for command in condition.commands:
                    if command not in commands:
                        guards.note(f"{guard}.{condition.key}.commands", command, f"a command of {self.name}")
        training = read_training(self._file("training.toml", optional=True), tuple(self.points))
        codes = frozenset(setpoint.code for setpoint in setpoints.values() if setpoint.code)
        texts = {language: self._texts(language) for language in self.languages}
        self._check_expressions()
        self._check_registers()
        if self.map:
            registers = {key: data.point.register for key, data in self.points.items()}
            plc.check_points(head, self.map, registers, tuple(self.events))
        kind = EquipmentType(
            name=self.name,
            folder=self.folder,
            label=label,
            device=device,
            points={key: data.point for key, data in self.points.items()},
            commands=commands,
            permissives=permissives,
            interlocks=interlocks,
            setpoints=setpoints,
            alarms=alarms,
            texts=texts,
            options=self.options,
            ranges=self.ranges,
            area=area,
            tables=tables,
            presets=presets,
            events=self.events,
            reasons=reasons,
            snapshot=snapshot,
            checks=checked,
            sequence=sequence,
            actions=actions,
            simulation_presets=simulation_presets,
            records=kinds,
            training=training,
            symbol=symbol,
        )
        return TypeData(
            kind,
            self.points,
            choices,
            {key: codes if takes else frozenset() for key, takes in parameters.items()},
            self.numbers,
            columns,
            checks,
        )

    def _file(self, name: str, *, optional: bool = False) -> Table:
        source = Source(self.folder / name, f"{self.name}/{name}", optional=optional)
        self.sources.append(source)
        return source.table()

    def _device(self, table: Table) -> Device:
        device = Device(
            max_read=table.whole("max_read", 125, 1, 125),
            fallback_read=table.whole("fallback_read", 0, 0, 125),
            group_read={
                key: table.table("group_read").whole(key, low=1, high=125) for key in table.raw("group_read", {})
            },
            max_write=table.whole("max_write", 1, 1, 123),
            read_functions=tuple(table.items("read_functions", (3,))),
            write_functions=tuple(table.items("write_functions", (6,))),
            turnaround=float(table.number("turnaround", 0.02, 0, 10)),
            timeout=float(table.number("timeout", 0.25, 0, 60)),
            connections=table.whole("connections", 1, 1, 64),
            pipelining=table.whole("pipelining", 1, 1, 64),
            fast=float(table.number("fast", 0.1, 0.01, 3600)),
            slow=float(table.number("slow", 1.0, 0.01, 3600)),
            holes=tuple(self._ranges(table, "holes")),
            write_only=tuple(self._ranges(table, "write_only")),
            training=table.whole("training", 0xE000),
        )
        table.done()
        return device

    def _ranges(self, table: Table, key: str) -> Iterator[tuple[int, int]]:
        for index, item in enumerate(table.items(key, [])):
            match item:
                case [int() as first, int() as last] if 0 <= first <= last <= 0xFFFF:
                    yield first, last
                case _:
                    table.note(f"{key}.{index}", item, "[first, last] with 0 <= first <= last <= 65535")

    def _options(self, head: Table) -> tuple[dict[str, Mapping[str, Sequence[str]]], dict[str, bool]]:
        choices: dict[str, Mapping[str, Sequence[str]]] = {}
        parameters: dict[str, bool] = {}
        for key, table in head.tables("options"):
            if table.has("default"):
                low, high = float(table.number("low")), float(table.number("high"))
                self.ranges[key] = (low, high)
                self.options[key] = float(table.number("default", low=low, high=high))
            else:
                self.options[key] = {}
                words = table.table("words")
                choices[key] = {word: words.items(word) for word in words.data}
                parameters[key] = table.flag("parameters")
                numbers = table.table("numbers")
                self.numbers[key] = {name: self._span(name, numbers) for name in numbers.data}
            table.done()
        return choices, parameters

    def _span(self, name: str, table: Table) -> tuple[float, float]:
        match table.raw(name):
            case [int() | float() as low, int() | float() as high] if low <= high:
                return float(low), float(high)
            case other:
                table.note(name, other, "[low, high] with low <= high")
                return 0.0, 0.0

    def _add_definition(self, head: Table) -> None:
        """The options that no plant file sets: a sequence has as many steps as its definition."""
        for key, (default, low, high) in BY_DEFINITION.items():
            if key in self.options:
                head.note(
                    f"options.{key}",
                    "given",
                    "no option of this name where `sequence` is true: the definition gives it",
                )
            self.options[key] = default
            self.ranges[key] = (low, high)

    def _sequence_words(self, head: Table, sequence: bool) -> tuple[tuple[str, ...], dict[str, tuple[float, float]]]:
        """`[actions]` and `[presets_of_simulation]`: what a sequence may ask of this machine, and its tests may set."""
        table = head.table("actions")
        actions: list[str] = []
        for index, name in enumerate(table.items("names") if head.has("actions") else []):
            if not isinstance(name, str) or not _matches(KEY, name):
                table.note(f"names.{index}", name, "a name of small letters, digits and _")
            elif name in actions:
                table.note(f"names.{index}", name, "each action once")
            else:
                actions.append(name)
        table.done()
        if sequence and head.has("actions"):
            head.note("actions", "given", "no actions where `sequence` is true: a sequence asks, it is not asked")
        table = head.table("presets_of_simulation")
        for name in table.data:
            if not _matches(KEY, name):
                table.note(name, name, "a name of small letters, digits and _")
        return tuple(actions), {name: self._span(name, table) for name in table.data}

    def _presets(self, head: Table) -> dict[str, dict[str, float]]:
        """`[presets.model]`: other defaults of options that are numbers."""
        presets: dict[str, dict[str, float]] = {}
        for name, table in head.tables("presets"):
            if not _matches(KEY, name):
                table.note("", name, "a name of small letters, digits and _")
            for key in self.ranges:
                table.raw(key)
            presets[name] = {
                key: float(table.number(key, low=low, high=high))
                for key, (low, high) in self.ranges.items()
                if table.has(key)
            }
            table.done()
        return presets

    def _check_whole(self, head: Table, option: str, presets: Mapping[str, Mapping[str, float]]) -> None:
        """An option that counts slots has whole numbers only."""
        given = {f"options.{option}.default": self.options[option]}
        given |= {f"presets.{name}.{option}": values[option] for name, values in presets.items() if option in values}
        for key, value in given.items():
            if isinstance(value, float) and not value.is_integer():
                head.note(key, value, "a whole number: it is the capacity of a table")

    def _checks(self, head: Table, presets: Mapping[str, Mapping[str, float]]) -> Iterator[Check]:
        """`[[checks]]`: what must hold between options; the defaults, and every preset, must meet them."""
        defaults = {key: value for key, value in self.options.items() if isinstance(value, float)}
        for row in head.rows("checks"):
            check = Check(row.text("expression"), row.text("option", choices=list(defaults)), row.text("expected"))
            self._option_expression(row, "expression", check.expression)
            try:
                check.expected.format(**defaults)
            except (LookupError, ValueError) as error:
                row.note("expected", check.expected, f"options in braces only ({error})")
                continue
            for name, given in {"default": {}, **presets}.items():
                if not row.source.problems and not holds(check, {**defaults, **given}):
                    row.note("expression", check.expression, f"a sentence that holds for the options of {name}")
            row.done()
            yield check

    def _tables(self, file: Table) -> tuple[dict[str, TableMap], dict[str, dict[str, PointData]]]:
        tables: dict[str, TableMap] = {}
        columns: dict[str, dict[str, PointData]] = {}
        if file.data and self.map is None:
            file.note("", ", ".join(file.data), "[plc] in device.toml: only a Pogon PLC has tables")
        for key, table in file.tables():
            if not _matches(KEY, key):
                table.note("", key, "a key of small letters, digits and _")
            mistakes = len(table.source.problems)
            map = plc.read_table(key, table, self.options, self.ranges)
            columns[key] = {}
            for name, column in table.tables("columns"):
                columns[key][name] = self._cell(name, column, map)
            registers = {name: data.point.register for name, data in columns[key].items()}
            if len(table.source.problems) == mistakes:
                plc.check_columns(table, map, {name: register for name, register in registers.items() if register})
            for name, word in plc.HEAD_POINTS.items():
                self._head_point(table, f"{key}_{name}", name, map.address + word)
            table.done()
            tables[key] = map
        for key in self.points:
            if plc.is_cell(key, tables):
                file.note(key, "points.toml", "no point whose key is that of a cell")
        return tables, columns

    def _head_point(self, table: Table, key: str, name: str, address: int) -> None:
        if key in self.points:
            table.note("", key, "a table whose points no point of points.toml has")
            return
        register = Register(address)
        point = Point("", key, "", key, f"table.{name}", Kind.STEP, register=register, history=False)
        self.points[key] = PointData(point)

    def _point(self, key: str, table: Table, **given: Any) -> Point:
        data = self._build(key, table, **given)
        if key in self.points:
            table.note("", key, "a key that no other point of the type has")
        self.points[key] = data
        if not given:
            table.done()
        return data.point

    def _cell(self, key: str, table: Table, map: TableMap) -> PointData:
        """A column as the cell of slot 1."""
        address = map.address + TABLE_HEAD + table.whole("offset", low=0, high=map.row - 1)
        kind = "enum" if table.has("texts") else "analog" if table.data.get("type") == Type.F32 else "step"
        data = self._build(f"{map.key}.{key}", table, kind=kind, history=False, address=address)
        data.point = replace(data.point, key=key, id=table.text("was", key, pattern=KEY), table=map.key)
        table.done()
        return data

    def _build(self, key: str, table: Table, **given: Any) -> PointData:
        kind = Kind(table.text("kind", given.get("kind", "analog"), choices=[kind.value for kind in Kind]))
        register = None
        if "address" in given or table.has("address"):
            register = self._register(table, writable=given.get("writable", False), address=given.get("address"))
        derived = self._derived(table.table("derived")) if table.has("derived") else None
        bounds: dict[str, str] = {}
        point = Point(
            name="",
            id=table.text("was", key, pattern=KEY, expected="the former key of the point"),
            equipment="",
            key=key,
            label=table.text("label", f"point.{key}"),
            kind=kind,
            unit=table.text("unit", ""),
            decimals=table.whole("decimals", 0, 0, 6),
            register=register,
            derived=derived,
            scan=Scan(table.text("scan", given.get("scan", "fast"), choices=[scan.value for scan in Scan])),
            low=given["low"] if "low" in given else self._bound(table, "low", bounds),
            high=given["high"] if "high" in given else self._bound(table, "high", bounds),
            normal=self._normal(table, bounds),
            scale_low=self._bound(table, "scale_low", bounds),
            scale_high=self._bound(table, "scale_high", bounds),
            dead_band=self._bound(table, "dead_band", bounds) or 0.0,
            history=table.flag("history", given.get("history", True)),
            texts=self._choices(table, key, "texts"),
            certainty=table.text("certainty", ""),
        )
        name = key.rpartition(".")[2]
        if not _matches(KEY, name) or key in expression.RESERVED:  # a column may be called age: its cells are not
            table.note("", name, "a key of small letters, digits and _, not a word of the grammar")
        if register is None and derived is None:
            table.note("", NONE, "a point with `address` or with `derived`")
        return PointData(point, bounds)

    def _register(self, table: Table, *, writable: bool, address: int | None = None) -> Register:
        kind = Type(table.text("type", "u16", choices=[kind.value for kind in Type]))
        length = table.whole("words", WORDS[kind], 1, 125)
        if kind is not Type.STRING and length != WORDS[kind]:
            table.note("words", length, f"{WORDS[kind]} for {kind}")
        mask, none = table.raw("mask"), table.raw("none")
        scale = float(table.number("scale", 1.0))
        if scale == 0:
            table.note("scale", 0, "a number other than 0")
        return Register(
            address=table.whole("address", low=0, high=0xFFFF) if address is None else address,
            type=kind,
            order=Order(table.text("order", "abcd", choices=[order.value for order in Order])),
            table=table.text("table", "holding", choices=("holding", "input")),
            mask=None if mask is None else table.whole("mask", low=1, high=0xFFFF_FFFF),
            shift=table.whole("shift", 0, 0, 63),
            scale=scale or 1.0,
            offset=float(table.number("offset", 0.0)) if address is None else 0.0,
            words=length,
            writable=table.flag("writable", writable),
            readable=table.flag("readable", True),
            none=None if none is None else table.whole("none", low=0, high=0xFFFF_FFFF),
        )

    def _derived(self, table: Table) -> Derived:
        kind = table.text("kind", choices=KINDS)
        derived = Derived(kind, table.text("of", ""), table.text("when", ""))
        needs_of, needs_when = KINDS.get(kind, (False, False))
        if needs_of != bool(derived.of):
            table.note("of", derived.of, f"{'a point' if needs_of else 'nothing'} for {kind}")
        if needs_when != bool(derived.when):
            table.note("when", derived.when, f"{'a condition' if needs_when else 'nothing'} for {kind}")
        if derived.of and kind == "option":
            if not isinstance(self.options.get(derived.of), float):
                table.note("of", derived.of, f"an option of {self.name} that is a number")
        elif derived.of:
            self.expressions.append((table, "of", derived.of, False))
        if derived.when:
            self.expressions.append((table, "when", derived.when, False))
        table.done()
        return derived

    def _bound(self, table: Table, key: str, bounds: dict[str, str]) -> float | None:
        value = table.raw(key)
        if isinstance(value, str):
            self._option_expression(table, key, value)
            bounds[key] = value
            return None
        given = table.number(key, None)
        return None if given is None else float(given)

    def _normal(self, table: Table, bounds: dict[str, str]) -> tuple[float, float] | None:
        if not table.has("normal"):
            return None
        band = table.items("normal", expected="[low, high]")
        values: list[float] = []
        for index, item in enumerate(band):
            if isinstance(item, str):
                self._option_expression(table, f"normal.{index}", item)
                bounds[f"normal.{index}"] = item
            elif isinstance(item, bool) or not isinstance(item, int | float):
                table.note(f"normal.{index}", item, "a number or an expression over options")
            values.append(float(item) if isinstance(item, int | float) else 0.0)
        if len(values) != 2 or (not bounds and values[0] > values[1]):
            table.note("normal", band, "[low, high] with low <= high")
            return None
        return values[0], values[1]

    def _option_expression(self, table: Table, key: str, text: str) -> None:
        try:
            unknown = expression.parse(text).names - {
                name for name, value in self.options.items() if isinstance(value, float)
            }
        except ConfigurationError as error:
            table.note(key, text, str(error))
        else:
            for name in sorted(unknown):
                table.note(key, text, f"options of {self.name} only; {name} is none")

    def _choices(self, table: Table, key: str, name: str) -> dict[int, str]:
        given = table.raw(name)
        if given is None:
            return {}
        if isinstance(given, list) and all(isinstance(item, int) and not isinstance(item, bool) for item in given):
            return {item: f"choice.{key}.{item}" for item in given}
        if isinstance(given, dict) and all(
            _matches(r"\d+", item) and isinstance(text, str) for item, text in given.items()
        ):
            return {int(item): text for item, text in given.items()}
        table.note(name, given, "a list of values, or a table value = text key")
        return {}

    def _setpoints(self, table: Table) -> Iterator[tuple[str, Setpoint]]:
        for key, row in table.tables():
            low, high = row.raw("low", 0), row.raw("high", 65535)
            options = self._choices(row, key, "options")
            for name, bound in (("low", low), ("high", high)):
                if isinstance(bound, str):
                    self.expressions.append((row, name, bound, False))
                elif isinstance(bound, bool) or not isinstance(bound, int | float):
                    row.note(name, bound, "a number or an expression over points")
            normal: dict[str, str] = {}
            setpoint = Setpoint(
                key=key,
                low=str(low),
                high=str(high),
                normal=self._normal(row, normal),
                role=row.text("role", "engineer", choices=ROLES),
                group=row.text("group", ""),
                code=row.text("code", ""),
                options=options,
                stopped_only=row.flag("stopped_only"),
                warning=row.text("warning", ""),
                default=row.number("default", None),
                certainty=row.text("certainty", ""),
            )
            if row.has("address"):
                self._point(
                    key,
                    row,
                    kind="enum" if options else "step",
                    scan="once",
                    writable=True,
                    history=False,
                    low=float(low) if isinstance(low, int | float) else None,
                    high=float(high) if isinstance(high, int | float) else None,
                )
                if options:
                    data = self.points[key]
                    data.point = _with_texts(data.point, options)
            elif key not in self.points:
                row.note("address", MISSING, "an address, or a key of points.toml")
            elif self.map and plc.inside(self.map.settings, self.points[key].point.register):
                data = self.points[key]
                assert data.point.register
                data.point = replace(data.point, register=replace(data.point.register, writable=True))
            row.done()
            yield key, setpoint

    def _command(self, key: str, table: Table) -> Command:
        timeout = table.raw("timeout", 5)
        if isinstance(timeout, str):
            self.expressions.append((table, "timeout", timeout, True))
        elif isinstance(timeout, bool) or not isinstance(timeout, int | float) or not timeout > 0:
            table.note("timeout", timeout, "seconds above 0, or an expression over points")
        higher = table.table("level_when")
        level_when = None
        if table.has("level_when"):
            level_when = (higher.text("condition"), higher.text("level", choices=LEVELS))
            self.expressions.append((higher, "condition", level_when[0], False))
            higher.done()
        arguments = tuple(self._arguments(table))
        code, hold_bits = table.whole("code", 0, 1), table.whole("hold_bits", 0, 1)
        told = bool(code or hold_bits)
        command = Command(
            key=key,
            label=table.text("label", f"command.{key}"),
            writes=tuple(self._writes(table, "writes")),
            feedback=table.text("feedback", *([""] if code else [])),
            timeout=str(timeout),
            level=table.text("level", "C1", choices=LEVELS),
            level_when=level_when,
            role=table.text("role", "operator", choices=ROLES),
            stop=table.flag("stop"),
            hold=table.flag("hold"),
            release=tuple(self._writes(table, "release")),
            moves=table.flag("moves", True),
            argument=table.text("argument", ""),
            symbol=table.text("symbol", ""),
            code=code,
            arguments=arguments,
            hold_bits=hold_bits,
            needs_reason=table.flag("needs_reason"),
        )
        if command.feedback:
            self.expressions.append((table, "feedback", command.feedback, not told))
        if told:
            self._check_order(table, command)
        elif not command.writes:
            table.note("writes", MISSING, "a list of { point, value }" + " or a `code`" * (self.map is not None))
        if not told and command.hold != bool(command.release):
            table.note(
                "release", command.release, "what is written when the button is released, for a hold-to-run only"
            )
        if arguments and not code:
            table.note("arguments", [argument.name for argument in arguments], "a `code` that they go with")
        if command.needs_reason and (command.hold or command.stop):
            table.note("needs_reason", "true", "no reason for what stops or is held: nobody has the time")
        if command.argument and command.argument not in self.points:
            table.note("argument", command.argument, f"a point of {self.name}")
        table.done()
        return command

    def _check_order(self, table: Table, command: Command) -> None:
        """A command that is sent as a code or as request bits."""
        name = "code" if command.code else "hold_bits"
        if self.map is None:
            table.note(name, getattr(command, name), "[plc] in device.toml: only a Pogon PLC takes it")
        if command.code and command.hold_bits:
            table.note("hold_bits", command.hold_bits, "either `code` or `hold_bits`")
        if bool(command.hold_bits) != command.hold:
            table.note(
                "hold", str(command.hold).lower(), "hold = true with `hold_bits`, and only with them on such a machine"
            )
        for given in ("writes", "release", "argument"):
            if getattr(command, given):
                instead = "`arguments`" if given == "argument" else "nothing"
                table.note(given, "given", f"{instead} where there is `{name}`: that is what is sent")
        if command.stop and command.arguments:
            table.note("arguments", [argument.name for argument in command.arguments], "none for a Stop")

    def _arguments(self, table: Table) -> Iterator[Argument]:
        seen: set[str] = set()
        for index, row in enumerate(table.rows("arguments")):
            name = row.text("name", pattern=KEY, expected="a name of small letters, digits and _")
            if index == MOST_ARGUMENTS:
                row.note("name", name, f"at most {MOST_ARGUMENTS} arguments")
            if name in seen or name in expression.RESERVED:
                row.note("name", name, "a name that no other argument has and that is no word of the grammar")
            seen.add(name)
            kind = Type(row.text("type", Type.F32.value, choices=[kind.value for kind in ARGUMENT_TYPES]))
            limits: dict[str, str] = {}
            for bound in ("low", "high"):
                value = row.raw(bound)
                if isinstance(value, str):
                    self.expressions.append((row, bound, value, False))
                elif value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
                    row.note(bound, value, "a number or an expression over points")
                limits[bound] = "" if value is None else str(value)
            decimals = row.whole("decimals", 0, 0, 6)
            if decimals and kind is not Type.F32:
                row.note("decimals", decimals, f"0 for {kind}")
            argument = Argument(
                name,
                kind,
                limits["low"],
                limits["high"],
                row.text("unit", ""),
                decimals,
                row.text("label", f"argument.{name}"),
            )
            row.done()
            yield argument

    def _writes(self, table: Table, key: str) -> Iterator[Write]:
        for row in table.rows(key):
            point, value = row.text("point"), row.raw("value")
            if point and (point not in self.points or not _is_writable(self.points[point].point)):
                row.note("point", point, f"a point of {self.name} with a writable register")
            option = value.removeprefix("option:") if isinstance(value, str) and value.startswith("option:") else None
            if option is not None and option not in self.options:
                row.note("value", value, f"an option of {self.name}")
            elif (
                option is None
                and value not in SPECIAL_VALUES
                and (isinstance(value, bool) or not isinstance(value, int | float))
            ):
                row.note("value", value, "a number, argument, option:<name> or previous")
            row.done()
            yield Write(point, str(value))

    @staticmethod
    def _names(text: str) -> frozenset[str] | None:
        """What a sentence reads; None when it is none, which is told elsewhere."""
        try:
            return expression.parse(text).names
        except ConfigurationError:
            return None

    def _condition(self, group: str, key: str, table: Table) -> Condition:
        condition = Condition(
            key=key,
            label=table.text("label", f"{group}.{key}"),
            expression=table.text("expression"),
            commands=tuple(table.items("commands", [])),
        )
        if condition.expression:
            self.expressions.append((table, "expression", condition.expression, group != "check"))
        table.done()
        return condition

    def _alarm(self, key: str, table: Table) -> Alarm:
        alarm = read_alarm(key, table, f"alarm.{key}.", self.events if self.map and self.map.events else {})
        sentences = {
            "expression": alarm.expression,
            "clear": alarm.clear,
            "value": alarm.value,
            "reference": alarm.reference,
        }
        for name, text in sentences.items():
            if text:
                self.expressions.append((table, name, text, False))
        table.done()
        return alarm

    def _texts(self, language: str) -> dict[str, str]:
        return dict(flatten(self._file(f"texts.{language}.toml", optional=language not in self.spoken).data))

    def _check_expressions(self) -> None:
        for table, key, text, argument in self.expressions:
            check_expression(table, key, text, self.points, self.name, argument=argument)

    def _check_registers(self) -> None:
        """Two points may share words only when they split the same words into parts."""
        taken: dict[tuple[str, int], PointData] = {}
        for data in self.points.values():
            register = data.point.register
            for address in range(register.address, register.address + register.words) if register else ():
                other = taken.setdefault((register.table if register else "", address), data)
                if other is not data and register and not _splits(other.point.register, register):
                    table = next((s for s in self.sources if data.point.key in s.data), self.sources[0]).table()
                    table.note(
                        f"{data.point.key}.address",
                        f"0x{register.address:04X}",
                        f"words that {other.point.key} does not use, or a mask that leaves its bits alone",
                    )
                    break


def read_alarm(key: str, table: Table, prefix: str, events: Mapping[int, str]) -> Alarm:
    """An alarm row; its texts are the keys `prefix` + label, consequence, cause, response unless the row names others.

    `events`: what the device's ring can say, code → the key by which a row names it.
    """
    event, event_clear = _event(table, "event", events), _event(table, "event_clear", events)
    source = table.whole("source") if table.has("source") else None
    for name in ("event_clear", "source"):
        if table.has(name) and not table.has("event"):
            table.note(name, table.raw(name), "an `event` that it belongs to")
    limit = table.number("limit", None)
    kind = table.text("kind", "expression", choices=ALARM_KINDS)
    if kind not in ("expression", "bad_quality") and limit is None:
        table.note("limit", MISSING, f"a number: an alarm of the kind {kind} compares with it")
    if kind != "expression" and not table.has("value"):
        table.note("value", MISSING, f"the point that an alarm of the kind {kind} watches")
    if kind != "expression" and event:
        table.note("event", table.raw("event"), f"no event for an alarm of the kind {kind}")
    if event and event == event_clear:
        table.note("event_clear", table.raw("event_clear"), "another event than the one that raises it")
    if event and table.has("clear") and not table.has("expression"):
        table.note("clear", table.raw("clear"), "an `expression`, whose end it is; an event ends with `event_clear`")
    return Alarm(
        key=key,
        label=table.text("label", f"{prefix}label"),
        expression=table.text("expression", *([""] if table.has("event") else [])) if kind == "expression" else "",
        kind=kind,
        dead_band=float(table.number("dead_band", 0.0, 0)),
        reference=table.text("reference") if kind == "deviation" else table.text("reference", ""),
        window=float(table.number("window", 1.0, 0.1, 3600)),
        realarm=float(table.number("realarm", 0.0, 0, 86400)),
        priority=table.whole("priority", low=1, high=4),
        clear=table.text("clear", ""),
        on_delay=float(table.number("on_delay", 0.0, 0, 86400)),
        off_delay=float(table.number("off_delay", 0.0, 0, 86400)),
        latching=table.flag("latching"),
        ack_required=table.flag("ack_required", True),
        audible=table.flag("audible", True),
        alarm_class=table.text("class", "process"),
        value=table.text("value", ""),
        limit=None if limit is None else float(limit),
        consequence=table.text("consequence", f"{prefix}consequence"),
        cause=table.text("cause", f"{prefix}cause"),
        response=table.text("response", f"{prefix}response"),
        event=event,
        event_clear=event_clear,
        source=source,
    )


def _event(table: Table, key: str, events: Mapping[int, str]) -> int:
    """Code of the event that a row names by its key; 0 = it names none."""
    if not table.has(key):
        return 0
    name, codes = table.raw(key), {name: code for code, name in events.items()}
    if not isinstance(name, str) or name not in codes:
        numbered = isinstance(name, int) and not isinstance(name, bool) and name in events
        meant = f'the key of the event, "{events[name]}", not its number' if numbered else ""
        known = f"the key of an event in events.toml: {one_of(sorted(codes), str(name))}"
        table.note(key, name, (meant or known) if codes else "a machine with an event ring (plc.events)")
        return 0
    return codes[name]


def text_keys(data: TypeData) -> Iterator[str]:
    """Every text that the data of a type ask for; each stands in the type's own texts or in the product's."""
    kind = data.type
    yield kind.label
    cells = [cell for columns in data.columns.values() for cell in columns.values()]
    for point in (item.point for item in (*data.points.values(), *cells)):
        yield point.label
        yield from point.texts.values()
    for setpoint in kind.setpoints.values():
        yield from setpoint.options.values()
        yield from [setpoint.warning] if setpoint.warning else []
    for command in kind.commands.values():
        yield command.label
        yield from (argument.label for argument in command.arguments)
    for condition in (*kind.permissives, *kind.interlocks, *kind.checks):
        yield condition.label
    for alarm in kind.alarms:
        yield from (alarm.label, alarm.consequence, alarm.cause, alarm.response)
    yield from training_keys(kind.training)
    yield from plc.text_keys(kind.events, kind.reasons, kind.snapshot)
    yield from record_kinds.text_keys(kind.records)


def holds(check: Check, options: Mapping[str, float]) -> bool:
    """Whether `options` meet `check`."""
    return expression.parse(check.expression).true(options) is True


def check_expression(
    table: Table, key: str, text: str, points: Mapping[str, object], owner: str, *, argument: bool = False
) -> None:
    """Note a problem when `text` is no sentence of the grammar or reads what `owner` has not."""
    try:
        parsed = expression.parse(text)
    except ConfigurationError as error:
        table.note(key, text, str(error))
        return
    for name in sorted(parsed.names - set(points)):
        table.note(key, text, f"names of points of {owner}; it has no {name}")
    if parsed.needs_argument and not argument:
        table.note(key, text, "no `argument` here: nobody enters one")


def flatten(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Texts by dotted key; plural forms keep their category as last part (`rows.few`)."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", str(value)


def _is_writable(point: Point) -> bool:
    return point.register is not None and point.register.writable


def _splits(one: Register | None, other: Register) -> bool:
    if one is None or (one.address, one.words, one.type, one.order) != (
        other.address,
        other.words,
        other.type,
        other.order,
    ):
        return False
    if one.mask is None or other.mask is None:
        return False
    return one.mask << one.shift & other.mask << other.shift == 0


def _matches(pattern: str, text: str) -> bool:
    return re.fullmatch(pattern, text) is not None


def _with_texts(point: Point, texts: Mapping[int, str]) -> Point:
    return replace(point, texts=texts)
