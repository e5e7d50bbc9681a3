"""A set of drive parameters as a file, CSV or JSON, and what two sets differ in. Pure.

CSV has a head of columns: `object`, `parameter`, `index`, `value`, then `unit`, `name` and `read_at` for people; JSON says the same:

    {"format": "pogon-drive-parameters", "version": 1, "type": "sinamics", "equipment": "d1",
     "parameters": [{"object": 2, "parameter": "p1120", "index": null, "value": 5.0, "unit": "s", "name": "…", "read_at": "…"}]}

A value is a number with a point, or a source (BICO) as people write it. Spreadsheet programs change files: semicolon, comma and tab
separate, a decimal comma is understood where no comma separates.
"""

import csv
import io
import json
import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.commands.parameter_change import element_name, wrong_value
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.parameter import DriveParameter
from app.profidrive.parameter_access.source import is_source, parse_source, source_text

FORMAT, VERSION = "pogon-drive-parameters", 1
NEEDED = ("object", "parameter", "value")
COLUMNS = ("object", "parameter", "index", "value", "unit", "name", "read_at")
LARGEST = 256 * 1024
"""Of a file [bytes]."""
MOST_ELEMENTS = 5000
MOST_WRONG = 50
"""Mistakes that are told; how many more there are is told, too."""
SHOWN = 40
"""Characters of what is wrong."""
SEPARATORS = ";\t,"

Known = Callable[[str], DriveParameter | None]
"""Code → parameter; None = the drive has none."""


@dataclass(frozen=True, slots=True)
class Element:
    """A value of a parameter set."""

    object: int
    parameter: DriveParameter
    index: int
    value: float
    """[its unit]"""

    @property
    def key(self) -> str:
        """2:p1120, 1:p0757[3]."""
        return f"{self.object}:{element_name(self.parameter, self.index)}"


@dataclass(frozen=True, slots=True)
class Wrong:
    """A mistake in a file."""

    line: int
    """From 1; of JSON the place in the list; 0 = the file as a whole."""
    reason: str
    """Text key."""
    params: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Read:
    """What a file holds."""

    elements: Sequence[Element] = ()
    wrong: Sequence[Wrong] = ()
    kind: str = ""
    """Type of the machine it is of; empty = it does not say."""


@dataclass(frozen=True, slots=True)
class Told:
    """An element with what a file says of it besides."""

    element: Element
    name: str
    read_at: str
    """ISO 8601."""


# ---- writing --------------------------------------------------------------------------------------------------


def value_word(parameter: DriveParameter, value: float, codes: Mapping[int, str]) -> float | int | str:
    """A value as a file has it: whole numbers without a point, the shortest number that is the same one, a source as text."""
    if is_source(parameter.kind):
        return source_text(parameter.kind, value, codes)
    if float(value).is_integer() and abs(value) < 2**53:
        return int(value)
    if parameter.format is Format.FLOAT32 and math.isfinite(value):
        shorter = (float(f"{value:.{digits}g}") for digits in range(1, 10))
        return next((one for one in shorter if _single(one) == _single(value)), value)
    return value


def _single(value: float) -> bytes:
    """As a Float32; empty = it is too large for one."""
    try:
        return struct.pack("<f", value)
    except OverflowError:
        return b""


def csv_text(rows: Sequence[Told], codes: Mapping[int, str], defused: Callable[[str], str]) -> str:
    """The set as CSV; `defused` makes a text harmless for spreadsheet programs."""
    out = io.StringIO()
    write = csv.writer(out, delimiter=";", lineterminator="\r\n").writerow
    write(COLUMNS)
    for row in rows:
        it = row.element
        index = it.index if it.parameter.count else ""
        word = value_word(it.parameter, it.value, codes)
        write([it.object, it.parameter.code, index, word, it.parameter.unit, defused(row.name), row.read_at])
    return out.getvalue()


def json_text(rows: Sequence[Told], codes: Mapping[int, str], kind: str, equipment: str) -> str:
    """The set as JSON, of the machine `equipment` of type `kind`."""
    told = [
        {
            "object": row.element.object,
            "parameter": row.element.parameter.code,
            "index": row.element.index if row.element.parameter.count else None,
            "value": value_word(row.element.parameter, row.element.value, codes),
            "unit": row.element.parameter.unit,
            "name": row.name,
            "read_at": row.read_at,
        }
        for row in rows
    ]
    head = {"format": FORMAT, "version": VERSION, "type": kind, "equipment": equipment, "parameters": told}
    return json.dumps(head, ensure_ascii=False, indent=1)


# ---- reading --------------------------------------------------------------------------------------------------


def read_file(data: bytes, known: Known, kind: str) -> Read:
    """What `data` holds for a machine of type `kind`; every mistake with its line, and nothing of a wrong line."""
    if len(data) > LARGEST:
        return _refused("dcmp.too_large", size=len(data), limit=LARGEST)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        return _refused("dcmp.encoding", place=error.start + 1)
    if not text.strip() or "\0" in text:
        return _refused("dcmp.no_file")
    return _read_json(text, known, kind) if text.lstrip().startswith("{") else _read_csv(text, known)


def _refused(reason: str, **params: object) -> Read:
    return Read((), (Wrong(0, reason, params),))


def _read_csv(text: str, known: Known) -> Read:
    head = text.split("\n", 1)[0]
    separator = max(SEPARATORS, key=head.count)
    try:
        lines = list(csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True))
    except csv.Error as error:
        return _refused("dcmp.no_csv", text=str(error)[:SHOWN])
    names = [name.strip().casefold() for name in lines[0]]
    missing = [name for name in NEEDED if name not in names]
    if missing or len(set(names)) != len(names):
        return _refused("dcmp.columns", text=", ".join(missing) or head.strip()[:SHOWN], columns=", ".join(NEEDED))
    rows = [
        (line, dict(zip(names, cells, strict=False)) if len(cells) == len(names) else None)
        for line, cells in enumerate(lines[1:], 2)
        if any(cell.strip() for cell in cells)
    ]
    return _read_rows(rows, known, decimal_comma=separator != ",")


def _read_json(text: str, known: Known, kind: str) -> Read:
    try:
        head = json.loads(text)
    except (ValueError, RecursionError) as error:
        return _refused("dcmp.no_json", text=str(error)[:SHOWN])
    if not isinstance(head, dict) or head.get("format") != FORMAT or not isinstance(head.get("parameters"), list):
        return _refused("dcmp.no_format", text=FORMAT)
    if head.get("version") != VERSION:
        return _refused("dcmp.version", text=str(head.get("version"))[:SHOWN], version=VERSION)
    of = head.get("type", "")
    if of not in ("", kind):
        return _refused("dcmp.other_type", text=str(of)[:SHOWN], type=kind)
    rows = [
        (place, {str(key): _text(value) for key, value in row.items()} if isinstance(row, dict) else None)
        for place, row in enumerate(head["parameters"], 1)
    ]
    return _read_rows(rows, known, decimal_comma=False, kind=of)


def _text(value: Any) -> str:
    return "" if value is None else str(value)


def _read_rows(
    rows: Sequence[tuple[int, dict[str, str] | None]], known: Known, *, decimal_comma: bool, kind: str = ""
) -> Read:
    if len(rows) > MOST_ELEMENTS:
        return _refused("dcmp.too_many", n=len(rows), limit=MOST_ELEMENTS)
    found: dict[str, Element] = {}
    wrong: list[Wrong] = []
    for line, row in rows:
        told = Wrong(line, "dcmp.cells", {}) if row is None else _element(line, row, known, decimal_comma)
        if isinstance(told, Element) and told.key in found:
            told = Wrong(line, "dcmp.twice", {"text": told.key})
        if isinstance(told, Wrong):
            wrong.append(told)
        else:
            found[told.key] = told
    if not rows:
        return _refused("dcmp.no_file")
    return Read(list(found.values()), wrong, kind)


def _element(line: int, row: Mapping[str, str], known: Known, decimal_comma: bool) -> Element | Wrong:
    code, typed = row.get("parameter", "").strip(), row.get("value", "").strip()
    parameter = known(code)
    if parameter is None:
        return Wrong(line, "dcmp.no_parameter", {"text": code[:SHOWN]})
    object, index = _whole(row.get("object", "")), _whole(row.get("index", "") or "0")
    if object is None or object > 255:
        return Wrong(line, "dcmp.no_object", {"text": row.get("object", "")[:SHOWN]})
    if index is None or index >= parameter.elements:
        named = {"text": row.get("index", "")[:SHOWN], "parameter": code, "most": parameter.elements - 1}
        return Wrong(line, "dcmp.no_index", named)
    value = _value(parameter, typed, decimal_comma)
    if value is None:
        return Wrong(line, "dcmp.no_value", {"text": typed[:SHOWN], "parameter": code})
    if parameter.writable and (wrong := wrong_value(parameter, value)) is not None:
        return Wrong(line, "dcmp.wrong", {"parameter": code, "why": wrong[0], **wrong[1]})
    return Element(object, parameter, index, value)


def _whole(text: str) -> int | None:
    typed = text.strip()
    return int(typed) if typed.isascii() and typed.isdecimal() and len(typed) < 7 else None


def _value(parameter: DriveParameter, typed: str, decimal_comma: bool) -> float | None:
    if is_source(parameter.kind):
        source = parse_source(typed)
        return None if source is None else float(source)
    plain = typed.replace("\u2212", "-")
    if decimal_comma and plain.count(",") == 1 and "." not in plain:
        plain = plain.replace(",", ".")
    try:
        value = float(int(plain, 16)) if plain.casefold().startswith("0x") else float(plain)
    except ValueError:
        return None
    return value if plain.isascii() and math.isfinite(value) and "_" not in plain else None


# ---- what differs ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Difference:
    """One element on both sides; None = that side does not have it, or was not read."""

    object: int
    parameter: DriveParameter
    index: int
    here: float | None
    there: float | None

    @property
    def key(self) -> str:
        """2:p1120, 1:p0757[3]."""
        return f"{self.object}:{element_name(self.parameter, self.index)}"

    @property
    def same(self) -> bool:
        """Whether both sides hold the same value."""
        return self.here is not None and self.here == self.there


def compared(here: Mapping[str, Element], there: Mapping[str, Element]) -> Iterator[Difference]:
    """Every element of either side, in the order of objects and numbers."""
    both = {**here, **there}
    order = sorted(both.values(), key=lambda one: (one.object, one.parameter.number, one.index))
    for one in order:
        values = (side[one.key].value if one.key in side else None for side in (here, there))
        yield Difference(one.object, one.parameter, one.index, *values)
