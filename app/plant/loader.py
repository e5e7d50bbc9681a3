"""A plant folder → (definitions, problems). All mistakes at once, each with file, line, key, value and what was expected; never raises."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo, available_timezones

from app.errors import ConfigurationError
from app.plant import expression, plc, types
from app.plant.definitions import (
    Alarm,
    Equipment,
    Link,
    MoreProblems,
    Plant,
    Point,
    Problem,
    SequenceDefinition,
    TableMap,
    Texts,
)
from app.plant.derive import order_problem
from app.plant.sequences import FOLDER as SEQUENCES
from app.plant.sequences import SequenceFiles
from app.plant.sequences import options as definition_options
from app.plant.tables import MISSING, MOST_PROBLEMS, NONE, STOP_AT, Enough, Plain, Source, Table, one_of, read_label
from app.plant.type_files.alarms import read_alarm, sentences_of
from app.plant.type_files.data import PointData, TypeData
from app.plant.type_files.names import KEY, KEY_EXPECTED
from app.plant.type_files.options import BY_DEFINITION
from app.plant.type_files.sentences import check_expression

PLANT_FILE = "plant.toml"
LOCALE = Path(__file__).resolve().parent.parent / "locale"
LANGUAGES = ("hr", "en", "de", "cs")
TRANSPORTS = ("memory", "tcp", "rtu")
BAUD = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)
PARITY = ("none", "even", "odd")
ID = r"[a-z][a-z0-9_]{0,31}"
ID_EXPECTED = "small letters, digits and _, beginning with a letter, at most 32"
RESERVED_IDS = ("sys",)
LARGEST_UNIT = 247
MOST_REPEATS = 1000
MOST_MACHINES = 2000
MOST_POINTS = 200_000
"""Of one plant: what a program of one process can carry, and a reading takes a few seconds."""


def languages() -> tuple[str, ...]:
    """Languages the product speaks: a folder of app/locale each."""
    found = [path.name for path in LOCALE.iterdir() if path.is_dir()] if LOCALE.is_dir() else []
    return tuple(dict.fromkeys((*LANGUAGES, *sorted(found))))


def read_plant(
    folder: Path, *, type_folder: Path = types.EQUIPMENT, transports: Sequence[str] = TRANSPORTS
) -> tuple[Plant | None, list[Problem]]:
    """Read `folder`/plant.toml with the equipment types and the sequences (plant/sequences.py) it names.

    The plant is None exactly when there are problems. A text that lacks a language is no problem: it is shown with its language mark.
    """
    try:
        reader = _PlantReader(Path(folder), type_folder, transports)
        try:
            plant = reader.read()
        except Enough:
            plant = None
    except (OSError, RecursionError) as error:
        return None, [Problem(PLANT_FILE, "(file)", str(folder), f"a plant folder ({error})")]
    problems = reader.problems
    return (None if problems else plant), shortened(problems)


def shortened(problems: list[Problem]) -> list[Problem]:
    """The first `MOST_PROBLEMS`, and a line that says how many more there are."""
    if len(problems) <= MOST_PROBLEMS:
        return problems
    return [*problems[:MOST_PROBLEMS], MoreProblems(len(problems) - MOST_PROBLEMS, stopped=len(problems) >= STOP_AT)]


class _PlantReader:
    def __init__(self, folder: Path, type_folder: Path, transports: Sequence[str]) -> None:
        self.folder = folder
        self.type_folder = type_folder
        self.transports = transports
        self.source = Source(folder / PLANT_FILE, PLANT_FILE, inside=folder)
        self.type_names = types.names(type_folder)
        self.known_languages = languages()
        self.languages: Sequence[str] = self.known_languages
        self.spoken: Sequence[str] = LANGUAGES
        """Languages in which a type must have its texts: those that the plant names, else the product's own."""
        self.types: dict[str, TypeData | None] = {}
        self.type_problems: list[Problem] = []
        self.equipment: dict[str, Equipment] = {}
        self.unread: set[str] = set()
        """Machines whose type or definition has mistakes: what names them has none for that."""
        self.texts: dict[str, dict[str, str]] = {}
        self.units: dict[tuple[str, int], str] = {}
        self.points = 0
        """Of all machines so far."""
        self.ids: dict[str, str] = {}
        self.sequences = SequenceFiles(folder, lambda table, key: self._label(table, key, required=True))
        self.runs: dict[str, tuple[Table, str, int]] = {}
        """Equipment that runs a sequence → its table, the machine as named there, its number under `repeat`."""

    @property
    def problems(self) -> list[Problem]:
        return [*self.source.problems, *self.sequences.problems, *self.type_problems]

    def read(self) -> Plant | None:
        if self.source.problems:
            return None
        root = self.source.table()
        head = root.table("plant", required=True, expected="[plant] with name, timezone, languages")
        timezone, name = "UTC", {}
        if root.has("plant"):
            self.languages = self._languages(head)
            self.spoken = self.languages if head.has("languages") else LANGUAGES
            name = self._label(head, "name", required=True)
            timezone = self._timezone(head)
            head.done()
        areas = {key: self._area(key, table) for key, table in root.tables("areas")}
        links = {key: self._link(key, table) for key, table in root.tables("links")}
        if not links:
            root.note("links", NONE, "at least one [links.<name>]")
        for key, table in root.tables("equipment"):
            self._equipment(key, table, links, areas)
            if self.is_too_large:
                found = f"more than {MOST_MACHINES} machines or {MOST_POINTS} points"
                root.note("equipment", Plain(found), "no more in one plant")
                return None
        if not root.data.get("equipment"):
            root.note("equipment", NONE, "at least one [equipment.<id>]")
        for id, (table, machine, number) in self.runs.items():
            self._couple(id, table, machine, number, links)
        for row in root.rows("alarms"):
            self._alarm(row)
        root.done()
        used = {name: data.type for name, data in self.types.items() if data is not None}
        for item in self.equipment.values():
            if item.area not in areas:
                areas[item.area] = _type_texts(item.type.texts, "area") or {
                    language: item.area for language in self.languages
                }
        return Plant(self.folder, name, timezone, tuple(self.languages), areas, links, self.equipment, used, self.texts)

    @property
    def is_too_large(self) -> bool:
        """Whether there are more machines or points than one plant may have."""
        return len(self.equipment) > MOST_MACHINES or self.points > MOST_POINTS

    def _languages(self, head: Table) -> Sequence[str]:
        given = head.items("languages", list(self.known_languages), "a list of languages")
        for index, language in enumerate(given):
            if language not in self.known_languages:
                head.note(f"languages.{index}", language, one_of(self.known_languages, language))
            elif language in given[:index]:
                head.note(f"languages.{index}", language, "each language once")
        if not given:
            head.note("languages", given, "at least one language")
        return [language for language in given if language in self.known_languages] or self.known_languages

    def _timezone(self, head: Table) -> str:
        name = head.text("timezone")
        if not name:
            return "UTC"
        zones = available_timezones()
        try:
            if name not in zones:
                raise ValueError(name)
            ZoneInfo(name)
        except (ValueError, OSError):
            near = one_of(sorted(zones), name).partition("(perhaps ")[2].rstrip(")")
            head.note("timezone", name, "a time zone such as Europe/Zagreb" + (f" (perhaps {near})" if near else ""))
            return "UTC"
        return name

    def _label(self, table: Table, key: str, *, required: bool = False, default: str = "") -> dict[str, str]:
        return read_label(table, key, self.languages, self.known_languages, required=required, default=default)

    def _area(self, key: str, table: Table) -> Texts:
        self._check_id(key, table)
        label = self._label(table, "label", default=key)
        table.done()
        return label

    def _check_id(self, key: str, table: Table) -> None:
        if not re.fullmatch(ID, key) or key in RESERVED_IDS:
            table.note("", key, ID_EXPECTED + f"; not {', '.join(RESERVED_IDS)}")

    def _link(self, key: str, table: Table) -> Link:
        self._check_id(key, table)
        transport = table.text("transport", choices=self.transports)
        serial, network = transport == "rtu", transport == "tcp"
        if network:
            port: str = ""
            tcp_port = table.whole("port", 502, 1, 65535)
        else:
            tcp_port = 502
            port = table.text("port", *([] if serial else [""]), expected="a serial device such as /dev/ttyUSB0")
        baud = table.raw("baud", 9600)
        if isinstance(baud, bool) or baud not in BAUD:
            table.note("baud", baud, "one of " + ", ".join(map(str, BAUD)))
            baud = 9600
        parity = table.text("parity", "even", choices=PARITY)
        writes = table.flag("writes")
        link = Link(
            name=key,
            transport=transport,
            host=table.text("host", *([] if network else [""]), expected="a host name or an address"),
            tcp_port=tcp_port,
            port=port,
            baud=baud,
            parity=parity,
            stop_bits=table.whole("stop_bits", 2 if parity == "none" else 1, 1, 2),
            writes=writes if table.has("writes") else None,
            believe_simulated=table.flag("simulated"),
            fast=table.number("fast", None, 0.01, 3600),
            slow=table.number("slow", None, 0.01, 3600),
            timeout=table.number("timeout", None, 0.01, 60),
            label=self._label(table, "label", default=key),
        )
        table.done()
        return link

    def _type(self, name: str) -> TypeData | None:
        if name not in self.types:
            data, problems = types.read_type(name, self.known_languages, self.type_folder, spoken=self.spoken)
            circle = "" if problems else order_problem(data.type.points)
            if circle:
                problems = [
                    Problem(f"{name}/points.toml", "derived", circle, "derived points that do not depend on each other")
                ]
            self.type_problems += problems
            self.types[name] = None if problems else data
        return self.types[name]

    def _equipment(self, key: str, table: Table, links: Mapping[str, Link], areas: Mapping[str, Texts]) -> None:
        self._check_id(key, table)
        kind_name = table.text("type", choices=self.type_names)
        data = self._type(kind_name) if table.data.get("type") == kind_name and kind_name else None
        link = table.text("link", choices=sorted(links))
        unit = table.whole("unit", low=1, high=LARGEST_UNIT)
        count = table.whole("repeat", 0, 1, MOST_REPEATS) if table.has("repeat") else 0
        label = self._label(table, "label", default=key)
        area = table.text("area", (data.type.area if data else "") or kind_name)
        if table.has("area") and area not in areas:
            table.note("area", area, "an area of this file: " + one_of(sorted(areas), area))
        was = table.text("was", "", pattern=ID, expected="the former id of the equipment")
        if data is None:
            self.unread.add(key)
            return  # its other keys cannot be judged before its type is known
        preset = table.text("preset", "", choices=list(data.type.presets)) if data.type.presets else ""
        definition, machine = self._sequence(table) if data.type.sequence else (None, "")
        if data.type.sequence and definition is None:
            self.unread.add(key)
            return  # nor without its steps
        if definition and not table.has("label"):
            label = dict(definition.label)
        options = self._options(table, data, data.type.presets.get(preset, {}), definition)
        overrides = self._overrides(table, data, count)
        table.done()
        if count and unit + count - 1 > LARGEST_UNIT:
            table.note(
                "repeat",
                count,
                f"at most {LARGEST_UNIT - unit + 1}: units count up from {unit} and end at {LARGEST_UNIT}",
            )
            count = LARGEST_UNIT - unit + 1
        width = max(2, len(str(count)))
        for number in range(1, count + 1) if count else (0,):
            if self.is_too_large:
                return
            suffix = f"_{number:0{width}d}" if number else ""
            self._instance(
                table,
                data,
                id=key + suffix,
                was=was + suffix if was else "",
                link=link,
                unit=unit + max(number - 1, 0),
                label={language: _numbered(text, number) for language, text in label.items()},
                area=area,
                options=options,
                overrides=overrides,
                preset=preset,
                sequence=definition,
            )
            if definition:
                self.runs[key + suffix] = (table, machine, number)

    def _sequence(self, table: Table) -> tuple[SequenceDefinition | None, str]:
        """Its definition, None when there is none to be had; and the name of its machine, empty = none."""
        known = self.sequences.names()
        expected = "a file of sequences/: " + one_of(known, table.data.get("definition", ""))
        name = table.text("definition", choices=known, expected=expected)
        machine = table.text(
            "machine", "", expected="the id of an equipment, or no `machine` for a sequence on its own"
        )
        return (self.sequences.read(name) if name and table.data.get("definition") == name else None), machine

    def _couple(self, id: str, table: Table, name: str, number: int, links: Mapping[str, Link]) -> None:
        """Give a sequence its machine, and judge its definition by it. Of repeated ones each has its own."""
        item = self.equipment[id]
        if table.data.get("machine", "") != name:
            return  # told already
        own = id.removeprefix(table.path[-1])
        machine = self.equipment.get(name + own) if number else None
        machine = machine or self.equipment.get(name)
        if name and machine is None:
            if name not in self.source.data["equipment"]:  # else its own mistakes are told
                known = sorted(key for key, other in self.equipment.items() if not other.type.sequence)
                table.note("machine", name, "an equipment: " + one_of(known, name))
            elif any(key.startswith(f"{name}_") for key in self.equipment):
                table.note("machine", name, f"one machine: {name} is repeated, and has none with the number of {id}")
            return
        if machine is not None:
            if machine.type.sequence:
                table.note("machine", name, "a machine; this is itself a sequence")
                return
            steps = item.sequence.steps if item.sequence else ()
            if not machine.type.actions and any(step.actions for step in steps):
                table.note("machine", name, f"a machine that takes actions; {machine.type.name} takes none")
            if {item.link, machine.link} <= set(links) and links[item.link].simulated != links[machine.link].simulated:
                table.note("machine", name, "a machine that is simulated like its sequence, or real like it")
            self.equipment[id] = replace(item, machine=machine.id)
        forgotten = machine is None and item.link in links and links[item.link].simulated
        unread = self.sequences.unread_without_machine(item) if forgotten else []
        if unread and number <= 1:
            self._note_forgotten(table, unread)
        self.sequences.check(item, machine, forgotten=bool(unread))

    def _note_forgotten(self, table: Table, unread: Sequence[str]) -> None:
        """A simulated sequence without a machine asks for what only a machine could answer, at the keys `unread`."""
        more = f" and {len(unread) - 1} more" if len(unread) > 1 else ""
        expected = f"the id of an equipment: only its machine gives {unread[0]}{more} a meaning on a simulated link"
        table.note("machine", MISSING, f"{expected}; else take them out of {SEQUENCES}/{table.data['definition']}.toml")

    def _instance(
        self,
        table: Table,
        data: TypeData,
        *,
        id: str,
        was: str,
        link: str,
        unit: int,
        label: Texts,
        area: str,
        options: Mapping[str, object],
        overrides: Mapping[str, Mapping[str, Any]],
        preset: str,
        sequence: SequenceDefinition | None = None,
    ) -> None:
        if id in self.equipment:
            table.note("repeat", id, "ids that no other equipment has")
            return
        if link and (other := self.units.setdefault((link, unit), id)) != id:
            table.note("unit", unit, f"a unit that no other equipment on {link} has; {other} has it")
        points: dict[str, Point] = {}
        shared = False
        for key, item in data.points.items():
            given = overrides.get(key, {})
            lasting = given.get("was") or f"{was or id}.{item.point.id}"
            owner = self.ids.setdefault(lasting, f"{id}.{key}")
            if owner != f"{id}.{key}" and given.get("was"):
                table.note(f"points.{key}.was", lasting, f"an id that no other point has; {owner} has it")
            elif owner != f"{id}.{key}" and not shared:
                shared = True  # one mistake, not one for every point
                table.note(
                    "was" if was else "", was or id, f"an id that no other equipment has or had; {owner} is of it"
                )
            fields = {name: value for name, value in given.items() if name != "was"}
            points[key] = replace(_bounded(item, options), name=f"{id}.{key}", id=lasting, equipment=id, **fields)
        tables = {key: plc.capacity_of(map, options) for key, map in data.type.tables.items()}
        for key, slots in tables.items():
            for cell in _cells(data.columns[key], data.type.tables[key], slots, options):
                lasting = f"{was or id}.{cell.id}"
                self.ids.setdefault(lasting, f"{id}.{cell.key}")
                points[cell.key] = replace(cell, name=f"{id}.{cell.key}", id=lasting, equipment=id)
        self.points += len(points)
        alarms = tuple(data.type.alarms)
        self.equipment[id] = Equipment(
            id, data.type, link, unit, label, area, points, alarms, options, tables, sequence, preset=preset, was=was
        )

    def _options(
        self,
        table: Table,
        data: TypeData,
        preset: Mapping[str, float],
        sequence: SequenceDefinition | None = None,
    ) -> dict[str, object]:
        options = {**data.type.options, **preset}
        if sequence:
            options |= definition_options(sequence)
        counts = {map.capacity for map in data.type.tables.values()}
        for name, default in options.items():
            if sequence and name in BY_DEFINITION:
                continue  # the definition says it
            if isinstance(default, float):
                low, high = data.type.ranges[name]
                options[name] = value = float(table.number(name, default, low, high))
                if name in counts and not value.is_integer():
                    table.note(name, value, "a whole number")
            elif table.has(name):
                options[name] = self._option_table(table.table(name), name, data)
        numbers = {name: value for name, value in options.items() if isinstance(value, float)}
        for check in data.checks:
            if not check.holds(numbers):
                shown = {name: f"{value:g}" for name, value in numbers.items()}
                table.note(check.option, Plain(shown[check.option]), check.expected.format(**shown))
        return options

    def _option_table(self, table: Table, name: str, data: TypeData) -> dict[str, object]:
        words, codes, numbers = data.choices[name], data.parameters[name], data.numbers[name]
        known = {setpoint.code: setpoint for setpoint in data.type.setpoints.values()}
        values: dict[str, object] = {}
        for key in table.data:
            if key in words:
                values[key] = table.text(key, choices=words[key])
            elif key in codes:
                low, high = known[key].low, known[key].high
                values[key] = table.number(key, low=_limit(low, 0.0), high=_limit(high, 6553.5))
            elif key in numbers:
                values[key] = float(table.number(key, low=numbers[key][0], high=numbers[key][1]))
        for key in (*sorted(codes), *words, *numbers):
            table.raw(key)
        table.done()
        return values

    def _overrides(self, table: Table, data: TypeData, count: int) -> dict[str, dict[str, Any]]:
        """`[equipment.m1.points.speed]`: what differs on this machine."""
        found: dict[str, dict[str, Any]] = {}
        for key, row in table.tables("points"):
            if key not in data.points:
                row.note("", key, f"a point of {data.type.name}: " + one_of(sorted(data.points), key))
                continue
            values: dict[str, Any] = {}
            if row.has("was"):
                pattern = rf"{ID}\.{KEY}"
                values["was"] = row.text(
                    "was", pattern=pattern, expected="the former name of the point, such as m1.speed"
                )
                if count:
                    row.note("was", row.raw("was"), "no former name of one point where `repeat` makes many")
            for name in ("scale_low", "scale_high"):
                if row.has(name):
                    values[name] = float(row.number(name))
            low = values.get("scale_low", data.points[key].point.scale_low)
            high = values.get("scale_high", data.points[key].point.scale_high)
            given = "scale_high" if row.has("scale_high") else "scale_low" if row.has("scale_low") else ""
            if given and low is not None and high is not None and low >= high:
                row.note(given, row.raw(given), f"scale_low < scale_high; they are {low:g} and {high:g}")
            if row.has("dead_band"):
                values["dead_band"] = float(row.number("dead_band", low=0))
            if row.has("decimals"):
                values["decimals"] = row.whole("decimals", low=0, high=6)
            if row.has("history"):
                values["history"] = row.flag("history")
            if row.has("normal"):
                match row.items("normal", expected="[low, high]"):
                    case [int() | float() as low, int() | float() as high] if low <= high:
                        values["normal"] = (float(low), float(high))
                    case band:
                        row.note("normal", band, "[low, high] with low <= high")
            for name in ("was", "scale_low", "scale_high", "dead_band", "decimals", "history", "normal"):
                row.raw(name)
            row.done()
            found[key] = values
        return found

    def _alarm(self, row: Table) -> None:
        given = row.data.get("equipment")
        if isinstance(given, str) and (given in self.unread or given.rpartition("_")[0] in self.unread):
            return  # told already, where its type or its definition is
        name = row.text("equipment", choices=sorted(self.equipment))
        item = self.equipment.get(name) if row.data.get("equipment") == name else None
        key = row.text("key", pattern=KEY, expected=KEY_EXPECTED)
        prefix = f"plant.{name}.{key}."
        for field in ("label", "consequence", "cause", "response"):
            given = self._label(row, field, required=field == "label", default="–")
            for language in self.known_languages:
                if language in given:
                    self.texts.setdefault(language, {})[prefix + field] = given[language]
        plain = Table(
            row.source,
            row.path,
            {k: v for k, v in row.data.items() if k not in ("label", "consequence", "cause", "response")},
        )
        for known in ("equipment", "key"):
            plain.raw(known)
        ring = item.type.device.plc if item else None
        alarm: Alarm = read_alarm(key, plain, prefix, item.type.events if item and ring and ring.events else {})
        plain.done()
        if item is None:
            return
        if any(other.key == key for other in item.alarms):
            row.note("key", key, f"a key that no other alarm of {name} has")
        for field, text in sentences_of(alarm):
            check_expression(row, field, text, item.points, name)
        self.equipment[name] = replace(item, alarms=(*item.alarms, alarm))


def _cells(
    columns: Mapping[str, PointData], map: TableMap, slots: int, options: Mapping[str, object]
) -> Iterator[Point]:
    """The cells of a table, slot by slot; their key and id lack only the machine."""
    first = [_bounded(data, options) for data in columns.values()]
    for slot in range(1, slots + 1):
        for point in first:
            assert point.register
            register = replace(point.register, address=point.register.address + (slot - 1) * map.row)
            key, id = plc.cell_key(map.key, slot, point.key), plc.cell_key(map.key, slot, point.id)
            yield replace(point, key=key, id=id, register=register, row=slot - 1)


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
            normal[int(name[-1])] = 0.0 if value is None else round(value, 6)
            computed["normal"] = (normal[0], normal[1])
        else:
            computed[name] = None if value is None else round(value, 6)
    return replace(data.point, **computed)


def _limit(text: str, otherwise: float) -> float:
    """A limit that is a plain number; `otherwise` when other parameters decide."""
    try:
        return float(text)
    except ValueError:
        return otherwise


def _numbered(text: str, number: int) -> str:
    if not number:
        return text
    return text.replace("{n}", str(number)) if "{n}" in text else f"{text} {number}"


def _type_texts(texts: Mapping[str, Mapping[str, str]], key: str) -> dict[str, str]:
    return {language: own[key] for language, own in texts.items() if key in own}
