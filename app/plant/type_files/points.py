"""points.toml: the values of a type; setpoints and cells of tables are points too, and are built here."""

import math
import re
from dataclasses import replace
from typing import Any

from app.plant import expression
from app.plant.definitions import Derived, Kind, Point, Register, Scan, TableMap, Type
from app.plant.derive import KINDS, TIME_UNIT
from app.plant.said import said
from app.plant.tables import MISSING, NONE, Table, is_number, span
from app.plant.type_files.data import PointData
from app.plant.type_files.names import KEY
from app.plant.type_files.options import Options
from app.plant.type_files.registers import read_register
from app.plant.type_files.sentences import Sentences
from app.registers.codec import raw_limits
from app.registers.plc_map import TABLE_HEAD
from app.registers.register import REALS


class Points:
    """The points of a type as far as they are read; their bounds may be expressions over `options`."""

    def __init__(self, owner: str, options: Options, sentences: Sentences) -> None:
        self.found: dict[str, PointData] = {}
        self._owner = owner
        self._options = options
        self._sentences = sentences

    def read(self, file: Table) -> None:
        """Each table of `file` is a point."""
        for key, table in file.tables():
            self.add(key, table)
            table.done()

    def add(self, key: str, table: Table, **given: Any) -> None:
        """The point that `table` describes, `given` in place of the usual defaults; the caller is `done` with the table."""
        data = self._build(key, table, **given)
        if key in self.found:
            table.note("", key, said("mistake.point_twice"))
        self.found[key] = data

    def add_head(self, table: Table, key: str, label: str, address: int) -> None:
        """A word in the head of a table."""
        if key in self.found:
            table.note("", key, said("mistake.table_taken"))
            return
        point = Point("", key, "", key, label, Kind.STEP, register=Register(address), history=False)
        self.found[key] = PointData(point)

    def cell(self, key: str, table: Table, map: TableMap) -> PointData:
        """A column as the cell of slot 1."""
        address = map.address + TABLE_HEAD + table.whole("offset", low=0, high=map.row - 1)
        kind = "enum" if table.has("texts") else "analog" if table.data.get("type") in REALS else "step"
        data = self._build(f"{map.key}.{key}", table, kind=kind, history=False, address=address)
        data.point = replace(data.point, key=key, id=table.text("was", key, pattern=KEY), table=map.key)
        table.done()
        return data

    def normal(self, table: Table, bounds: dict[str, str]) -> tuple[float, float] | None:
        """The band `normal = [low, high]`; what of it is an expression goes to `bounds`."""
        if not table.has("normal"):
            return None
        band = table.items("normal", expected=said("mistake.as_is", what="[low, high]"))
        values: list[float] = []
        for index, item in enumerate(band):
            if isinstance(item, str):
                self._options.check_expression(table, f"normal.{index}", item)
                bounds[f"normal.{index}"] = item
            elif not is_number(item):
                table.note(f"normal.{index}", item, said("mistake.number_or_options"))
            values.append(float(item) if isinstance(item, int | float) else 0.0)
        if len(values) != 2 or (not bounds and values[0] > values[1]):
            table.note("normal", band, said("mistake.pair", pair="[low, high]", order="low <= high"))
            return None
        return values[0], values[1]

    def _build(self, key: str, table: Table, **given: Any) -> PointData:
        register = self._part(table) if table.has("part_of") else None
        if "address" in given or table.has("address"):
            register = read_register(table, writable=given.get("writable", False), address=given.get("address"))
        usual = given.get("kind", "analog")
        if register is not None and register.type is Type.BIT and "kind" not in given:
            usual = "enum" if table.has("texts") else "step"
        kind = Kind(table.text("kind", usual, choices=[kind.value for kind in Kind]))
        derived = self._derived(table.table("derived")) if table.has("derived") else None
        bounds: dict[str, str] = {}
        point = Point(
            name="",
            id=table.text("was", key, pattern=KEY, expected=said("mistake.former_key")),
            equipment="",
            key=key,
            label=table.text("label", f"point.{key}"),
            kind=kind,
            unit=table.text("unit", TIME_UNIT if derived and derived.kind == "since" else ""),
            decimals=table.whole("decimals", 0, 0, 6),
            register=register,
            derived=derived,
            scan=Scan(table.text("scan", given.get("scan", "fast"), choices=[scan.value for scan in Scan])),
            low=given["low"] if "low" in given else self._bound(table, "low", bounds),
            high=given["high"] if "high" in given else self._bound(table, "high", bounds),
            plausible=_plausible(table),
            normal=self.normal(table, bounds),
            scale_low=self._bound(table, "scale_low", bounds),
            scale_high=self._bound(table, "scale_high", bounds),
            dead_band=self._bound(table, "dead_band", bounds) or 0.0,
            history=table.flag("history", given.get("history", True)),
            opens_trends=table.flag("opens_trends", False),
            texts=read_choices(table, key, "texts"),
            certainty=table.text("certainty", ""),
        )
        name = key.rpartition(".")[2]
        if not re.fullmatch(KEY, name) or key in expression.RESERVED:  # a column may be called age: its cells are not
            table.note("", name, said("mistake.key_no_word"))
        if register is not None and derived is not None:
            table.note(
                "derived", said("mistake.given"), said("mistake.either_lies", first="`address`", second="`derived`")
            )
        _check_kind(table, point, takes_texts=given.get("kind") == Kind.ENUM, bounded="low" in given)
        if register is None and derived is None and not table.has("part_of"):  # else it is told why
            table.raw("address")
            read_register(table, writable=False, address=0)  # its keys are known ones: it is only nowhere
            table.note("", NONE, said("mistake.point_lies", first="`address`", second="`part_of`", third="`derived`"))
        return PointData(point, bounds, part=table.has("part_of"))

    def _part(self, table: Table) -> Register | None:
        """`part_of = "status_word"`: bits of a point that is whole before it; what is written is always the whole."""
        of = table.text("part_of")
        whole = self.found[of].point.register if of in self.found else None
        if table.has("address"):
            table.note("address", table.raw("address"), said("mistake.no_address"))
        mask, shift = table.whole("mask", 1, 1, 0xFFFF), table.whole("shift", 0, 0, 15)
        if whole is None or whole.mask is not None or whole.type is not Type.U16 or not whole.readable:
            table.note("part_of", of, said("mistake.part_of"))
            return None
        if mask << shift > 0xFFFF:
            table.note("mask" if table.has("mask") else "shift", mask, said("mistake.bits_of", bits=16, type=Type.U16))
        return Register(whole.address, order=whole.order, table=whole.table, mask=mask, shift=shift, none=whole.none)

    def _derived(self, table: Table) -> Derived:
        kind = table.text("kind", choices=KINDS)
        derived = Derived(kind, table.text("of", ""), table.text("when", ""))
        needs_of, needs_when = KINDS.get(kind, (False, False))
        if needs_of != bool(derived.of):
            table.note(
                "of",
                derived.of,
                _needed("point", needs_of, kind),
            )
        if needs_when != bool(derived.when):
            table.note(
                "when",
                derived.when,
                _needed("a_condition", needs_when, kind),
            )
        if derived.of and kind == "option":
            if derived.of not in self._options.defaults:
                table.note("of", derived.of, said("mistake.number_option", owner=self._owner))
        elif derived.of:
            self._sentences.add(table, "of", derived.of)
        if derived.when:
            self._sentences.add(table, "when", derived.when)
        table.done()
        return derived

    def _bound(self, table: Table, key: str, bounds: dict[str, str]) -> float | None:
        value = table.raw(key)
        if isinstance(value, str):
            self._options.check_expression(table, key, value)
            bounds[key] = value
            return None
        given = table.number(key, None)
        return None if given is None else float(given)


def _plausible(table: Table) -> tuple[float, float] | None:
    """The range `plausible = [low, high]`: two numbers, as it must hold whatever the options of a machine are."""
    if not table.has("plausible"):
        return None
    ends = table.items("plausible", expected=said("mistake.as_is", what="[low, high]"))
    if len(ends) != 2 or not all(is_number(end) for end in ends) or not ends[0] < ends[1]:
        table.note("plausible", ends, said("mistake.pair", pair="[low, high]", order="low < high"))
        return None
    return float(ends[0]), float(ends[1])


def _check_kind(table: Table, point: Point, *, takes_texts: bool, bounded: bool) -> None:
    """What a point says of itself and cannot be. `takes_texts`: another key of its row has its texts; `bounded`: its limits are checked."""
    register = point.register
    if point.kind is Kind.ENUM and not point.texts and not takes_texts and "texts" not in table.data:
        table.note("texts", MISSING, said("mistake.enum_texts"))
    if register is not None and (register.type is Type.STRING) != (point.kind is Kind.TEXT):
        table.note("kind", point.kind, said("mistake.text_string", kind=Kind.TEXT, type=Type.STRING))
    if register is not None and not (register.readable or register.writable):
        table.note("readable", "false", said("mistake.read_or_written"))
    if register is not None and register.type not in (*REALS, Type.STRING) and register.scale == 1:
        least, most = raw_limits(register)
        for value in point.texts:
            if not least <= value - register.offset <= most:
                ends = {"low": f"{least + register.offset:g}", "high": f"{most + register.offset:g}"}
                table.note(f"texts.{value}", value, said("mistake.text_never", **ends))
    limits = () if bounded else ((point.low, point.high, True),)
    for low, high, equal in (*limits, (point.scale_low, point.scale_high, False)):
        if low is not None and high is not None and (low > high or (low == high and not equal)):
            name = "low" if equal else "scale_low"
            order = f"{name} {'<=' if equal else '<'} {name.replace('low', 'high')}"
            table.note(name, low, said("mistake.pair", pair=f"{name}, {name.replace('low', 'high')}", order=order))
    if point.plausible is not None and (register is None or register.type is Type.STRING):
        table.note("plausible", list(point.plausible), said("mistake.plausible_read"))
    elif point.plausible is not None:
        for name, bound in (("low", point.low), ("high", point.high)):
            if bound is not None and not point.plausible[0] <= bound <= point.plausible[1]:
                table.note(name, bound, span("number", *point.plausible))
    if point.dead_band < 0:
        table.note("dead_band", point.dead_band, span("number", 0, math.inf))


def _needed(what: str, needed: bool, kind: str) -> str:
    return said("mistake.for_type", what=said(f"mistake.{what if needed else 'nothing'}"), type=kind)


def read_choices(table: Table, key: str, name: str) -> dict[int, str]:
    """`name = [0, 1]` or `name = { 0 = "text.key" }`: a value → the key of its text."""
    given = table.raw(name)
    if given is None:
        return {}
    if given in ([], {}):
        table.note(name, given, said("mistake.enum_texts"))
        return {}
    if isinstance(given, list) and all(isinstance(item, int) and not isinstance(item, bool) for item in given):
        twice = next((item for index, item in enumerate(given) if item in given[:index]), None)
        if twice is not None:
            table.note(name, twice, said("mistake.value_once"))
        return {item: f"choice.{key}.{item}" for item in given}
    if isinstance(given, dict) and all(
        re.fullmatch(r"\d+", item) and isinstance(text, str) for item, text in given.items()
    ):
        return {int(item): text for item, text in given.items()}
    table.note(name, given, said("mistake.value_texts"))
    return {}
