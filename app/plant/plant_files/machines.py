"""`[equipment.<id>]`: the machines of a plant, one row of the file or many by `repeat`."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.errors import ConfigurationError
from app.plant import expression, plc
from app.plant.definitions import Equipment, Link, Point, TableMap, Texts
from app.plant.plant_files.languages import PlantLanguages
from app.plant.plant_files.links import line_of
from app.plant.plant_files.names import ID, check_id
from app.plant.plant_files.options import read_options, read_overrides
from app.plant.plant_files.shared_units import Units, moved, read_base
from app.plant.plant_files.types_used import TypesUsed
from app.plant.said import said
from app.plant.sequence_definition import SequenceDefinition
from app.plant.sequence_recipe import with_recipe
from app.plant.sequences import SequenceFiles
from app.plant.tables import MISSING, Table, one_of
from app.plant.type_files.data import PointData, TypeData

LARGEST_UNIT = 247
TCP_UNITS = (0, 255)
"""Over TCP, of a device that has no units behind it (reference/modbus.md section 2); there 0 is no broadcast."""
MOST_REPEATS = 1000
MOST_MACHINES = 2000
MOST_POINTS = 200_000
"""Of one plant: what a program of one process can carry, and a reading takes a few seconds."""


@dataclass(frozen=True, slots=True)
class NamedMachine:
    """The machine that a sequence uses, as its row names it."""

    table: Table
    name: str
    """Empty = none."""
    number: int
    """Of the sequence under `repeat`; 0 = it is not repeated."""


class Machines:
    """Every machine read so far; no two share registers, an id, or the lasting id of a point."""

    def __init__(self, types: TypesUsed, sequences: SequenceFiles, languages: PlantLanguages) -> None:
        self.found: dict[str, Equipment] = {}
        self.unread: set[str] = set()
        """Rows whose type or definition has mistakes: what names them has none for that."""
        self.named: dict[str, NamedMachine] = {}
        """Equipment that runs a sequence → the machine that it names."""
        self._types = types
        self._sequences = sequences
        self._languages = languages
        self._points = 0
        self._units = Units()
        self._ids: dict[str, str] = {}

    @property
    def too_many(self) -> bool:
        """Whether there are more machines or points than one plant may have."""
        return len(self.found) > MOST_MACHINES or self._points > MOST_POINTS

    def is_unread(self, name: str) -> bool:
        """Whether `name` is a machine of a row that has mistakes, which are told there."""
        return name in self.unread or name.rpartition("_")[0] in self.unread

    def read(self, key: str, table: Table, links: Mapping[str, Link], areas: Mapping[str, Texts]) -> None:
        """The row `key` and all machines that it makes."""
        check_id(key, table)
        kind_name = table.text("type", choices=self._types.names)
        data = self._types.get(kind_name) if table.data.get("type") == kind_name and kind_name else None
        link = table.text("link", choices=sorted(links))
        unit = self._unit(table, links.get(link))
        count = table.whole("repeat", 0, 1, MOST_REPEATS) if table.has("repeat") else 0
        label = self._languages.label(table, "label", default=key)
        area = table.text("area", (data.type.area if data else "") or kind_name)
        if data and not table.has("area") and not data.type.area:
            table.doubt("area", MISSING, said("mistake.doubt_area", type=kind_name))
        if table.has("area") and area not in areas:
            table.note("area", area, said("mistake.area_of_file", known=one_of(sorted(areas), area)))
        was = table.text("was", "", pattern=ID, expected=said("mistake.former_id"))
        if data is None:
            self.unread.add(key)
            return  # its other keys cannot be judged before its type is known
        data = self._types.variant(data, table)
        if data is None:
            self.unread.add(key)
            return
        preset = table.text("preset", "", choices=list(data.type.presets)) if data.type.presets else ""
        definition, machine = self._sequence(table) if data.type.sequence else (None, "")
        if data.type.sequence and definition is None:
            self.unread.add(key)
            return  # nor without its steps
        if definition and not table.has("label"):
            label = dict(definition.label)
        options = read_options(table, data, data.type.presets.get(preset, {}), definition)
        overrides = read_overrides(table, data, repeated=bool(count))
        base, step = read_base(table, data.type, links.get(link))
        table.done()
        alarms, tables = (
            tuple(data.type.alarms),
            {name: plc.capacity_of(map, options) for name, map in data.type.tables.items()},
        )
        one = Equipment(
            key,
            data.type,
            link,
            unit,
            label,
            area,
            {},
            alarms,
            options,
            tables,
            definition,
            preset=preset,
            was=was,
            base=base,
        )
        for number, item in _repeated(one, count if step else self._within_units(table, unit, count), step):
            if self.too_many:
                return
            if not self._add(table, data, item, overrides, links):
                self.unread.add(key)
                return  # the next ones of the row would say the same
            if definition:
                self.named[item.id] = NamedMachine(table, machine, number)

    def _sequence(self, table: Table) -> tuple[SequenceDefinition | None, str]:
        """Its definition, None when there is none to be had; and the name of its machine, empty = none."""
        known = self._sequences.names()
        expected = said("mistake.file_of", folder="sequences/", known=one_of(known, table.data.get("definition", "")))
        name = table.text("definition", choices=known, expected=expected)
        expected = said("mistake.equipment_or_none")
        machine = table.text("machine", "", expected=expected)
        return (self._sequences.read(name) if name and table.data.get("definition") == name else None), machine

    @staticmethod
    def _unit(table: Table, link: Link | None) -> int:
        number, tcp = table.raw("unit"), link is not None and link.transport == "tcp"
        if tcp and type(number) is int and number in TCP_UNITS:
            return number
        expected = said("mistake.unit_over_tcp", high=LARGEST_UNIT) if tcp else ""
        return int(table.whole("unit", low=1, high=LARGEST_UNIT, expected=expected))

    @staticmethod
    def _within_units(table: Table, unit: int, count: int) -> int:
        """`count`, as far as there are units for it."""
        most = 1 if unit in TCP_UNITS else LARGEST_UNIT - unit + 1
        if count > most:
            expected = said("mistake.units_end", most=most, first=unit, last=LARGEST_UNIT)
            table.note("repeat", count, expected)
        return min(count, most)

    def _add(
        self,
        table: Table,
        data: TypeData,
        item: Equipment,
        overrides: Mapping[str, Mapping[str, Any]],
        links: Mapping[str, Link],
    ) -> bool:
        """`item`, which lacks only its points. False = its id or its registers are another one's."""
        if item.id in self.found:
            table.note("repeat", item.id, said("mistake.ids_taken"))
            return False
        points = {point.key: point for point in self._own_points(table, data, item, overrides)}
        for key, slots in item.tables.items():
            for cell in _cells(data.columns[key], data.type.tables[key], slots, item):
                self._ids.setdefault(cell.id, cell.name)
                points[cell.key] = cell
        self._points += len(points)
        whole = with_recipe(replace(item, points=points))
        self.found[item.id] = whole
        return item.link not in links or self._units.take(table, whole, line_of(links[item.link]))

    def _own_points(
        self, table: Table, data: TypeData, item: Equipment, overrides: Mapping[str, Mapping[str, Any]]
    ) -> Iterator[Point]:
        """Those of the type, with what differs on this machine; every lasting id is of one point."""
        shared = False
        for key, point in data.points.items():
            given = overrides.get(key, {})
            name, lasting = f"{item.id}.{key}", given.get("was") or f"{item.was or item.id}.{point.point.id}"
            owner = self._ids.setdefault(lasting, name)
            if owner != name and given.get("was"):
                table.note(f"points.{key}.was", lasting, said("mistake.point_id_taken", owner=owner))
            elif owner != name and not shared:
                shared = True  # one mistake, not one for every point
                expected = said("mistake.id_taken", owner=owner)
                table.note("was" if item.was else "", item.was or item.id, expected)
            fields = {field: value for field, value in given.items() if field != "was"}
            found = replace(
                moved(_bounded(point, item.options), item.base), name=name, id=lasting, equipment=item.id, **fields
            )
            blamed = next((field for field in ("high", "low") if field in given), "")
            if blamed and found.low is not None and found.high is not None and found.low >= found.high:
                ends = said("mistake.less_than", order="low < high", low=f"{found.low:g}", high=f"{found.high:g}")
                table.note(f"points.{key}.{blamed}", given[blamed], ends)
            elif wrong := next(_unbounded(point, found), ""):
                table.note("", item.id, wrong)
            yield found


def _repeated(one: Equipment, count: int, step: int) -> Iterator[tuple[int, Equipment]]:
    """`one` itself as number 0, or `count` of them from number 1: on units that count up, or on one unit, each `step` registers on."""
    if not count:
        yield 0, one
    width = max(2, len(str(count)))
    for number in range(1, count + 1):
        suffix = f"_{number:0{width}d}"
        label = {language: _numbered(text, number) for language, text in one.label.items()}
        was = one.was + suffix if one.was else ""
        unit = one.unit if step else one.unit + number - 1
        yield (
            number,
            replace(one, id=one.id + suffix, was=was, unit=unit, base=one.base + step * (number - 1), label=label),
        )


def _numbered(text: str, number: int) -> str:
    return text.replace("{n}", str(number)) if "{n}" in text else f"{text} {number}"


def _cells(columns: Mapping[str, PointData], map: TableMap, slots: int, item: Equipment) -> Iterator[Point]:
    """The cells of a table of `item`, slot by slot."""
    first = [_bounded(data, item.options) for data in columns.values()]
    former = item.was or item.id
    for slot in range(1, slots + 1):
        for point in first:
            assert point.register
            register = replace(point.register, address=point.register.address + (slot - 1) * map.row)
            key, id = plc.cell_key(map.key, slot, point.key), f"{former}.{plc.cell_key(map.key, slot, point.id)}"
            name = f"{item.id}.{key}"
            yield replace(point, name=name, id=id, equipment=item.id, key=key, register=register, row=slot - 1)


def _unbounded(data: PointData, point: Point) -> Iterator[str]:
    """What was expected of the options of a machine with which a limit of `point` comes to nothing, or is beyond the other one."""
    for name in ("low", "high", "scale_low", "scale_high"):
        if name in data.bounds and getattr(point, name) is None:
            yield said("mistake.bound_known", key=name, point=point.key, text=data.bounds[name])
    band = point.normal or (None, None)
    for index, end in enumerate(band):
        if end is not None and math.isnan(end):
            key = f"normal.{index}"
            yield said("mistake.bound_known", key=key, point=point.key, text=data.bounds[key])
    pairs = (
        ("low", "high", "<=", point.low, point.high),
        ("normal.0", "normal.1", "<=", *band),
        ("scale_low", "scale_high", "<", point.scale_low, point.scale_high),
    )
    for first, second, sign, low, high in pairs:
        if low is None or high is None or not {first, second} & set(data.bounds):
            continue
        if low > high or (low == high and sign == "<"):
            order, ends = f"{first} {sign} {second}", {"low": f"{low:g}", "high": f"{high:g}"}
            yield said("mistake.bounds_of", order=order, point=point.key, **ends)


def _bounded(data: PointData, options: Mapping[str, object]) -> Point:
    """The point with its bounds computed from the options of the machine."""
    if not data.bounds:
        return data.point
    numbers = {name: value for name, value in options.items() if isinstance(value, float)}
    computed: dict[str, Any] = {}
    normal = list(data.point.normal or (0.0, 0.0))
    for name, text in data.bounds.items():
        try:
            value = expression.number(text, numbers)
        except ConfigurationError:
            value = None
        if name.startswith("normal."):
            normal[int(name[-1])] = math.nan if value is None else round(value, 6)
            computed["normal"] = (normal[0], normal[1])
        else:
            computed[name] = None if value is None else round(value, 6)
    return replace(data.point, **computed)
