"""The parameters of a drive behind its mailbox: parameters.toml of its type.

    p1120 = { group = "ramp", type = "f32", unit = "s", low = 0, high = 650, default = 5, certainty = "M" }
    r0945 = { group = "messages", objects = [1, 2], type = "u16", count = 64, certainty = "M" }

p is written and has `low`, `high` and `default`, r is only read. `when` = always, stopped or commissioning; `allowed` = the only values;
`options` = values that have a text; `kind` = binector or connector for what names a source (BICO), bits for a word of bits;
`trigger = true` where writing makes the drive do something; `individual = true` where it belongs to one drive alone (an address) and is
not copied to another one. Texts are `parameter.<code>`, `parameter.group.<group>` and, of an option,
`parameter.option.<code>_<value>`.
"""

import re
from collections.abc import Iterator, Mapping

from app.plant.said import said
from app.plant.tables import Table
from app.profidrive.parameter_access.formats import INTEGERS, LARGEST_FLOAT, LAYOUTS, Format
from app.profidrive.parameter_access.parameter import DriveParameter, Kind, When

TYPES: Mapping[str, Format] = {
    "i8": Format.INTEGER8,
    "i16": Format.INTEGER16,
    "i32": Format.INTEGER32,
    "u8": Format.UNSIGNED8,
    "u16": Format.UNSIGNED16,
    "u32": Format.UNSIGNED32,
    "f32": Format.FLOAT32,
}
KEY = r"[a-z][a-z0-9_]*"
CODE = r"[pr]\d{4,5}"
CERTAINTIES = "MTCXG"
MOST_ELEMENTS = 0x10000


def read_parameters(file: Table) -> dict[str, DriveParameter]:
    """Every parameter of the file by its code; what is wrong is noted."""
    found: dict[str, DriveParameter] = {}
    for code, row in file.tables():
        parameter = _parameter(file, code, row)
        row.done()
        other = next((one for one in found.values() if one.number == parameter.number), None)
        if other is not None:
            file.note(code, code, said("mistake.parameter_number", code=other.code))
        found[code] = parameter
    return found


def text_keys(parameters: Mapping[str, DriveParameter]) -> Iterator[str]:
    """The texts that they ask for."""
    for parameter in parameters.values():
        yield parameter.text_key
        yield f"parameter.group.{parameter.group}"
        yield from parameter.options.values()


def _parameter(file: Table, code: str, row: Table) -> DriveParameter:
    number = int(code[1:]) if re.fullmatch(CODE, code) else 0
    if not 1 <= number <= 0xFFFF or (len(code) > 5 and code[1] == "0"):
        file.note(code, code, said("mistake.parameter_code"))
    writable = code.startswith("p")
    format = TYPES.get(row.text("type", choices=TYPES), Format.UNSIGNED16)
    layout = LAYOUTS[format].code
    least, most = INTEGERS.get(layout, (-LARGEST_FLOAT, LARGEST_FLOAT))
    low = row.number("low", low=least, high=most) if writable else 0.0
    high = row.number("high", low=max(least, low), high=most) if writable else 0.0
    default = row.number("default", low=low, high=max(low, high)) if writable else 0.0
    allowed = row.items("allowed", ()) if row.has("allowed") else []
    if any(not isinstance(value, int | float) or not low <= value <= high for value in allowed):
        row.note("allowed", allowed, said("mistake.values_within"))
        allowed = []
    objects = row.items("objects", (2,))
    if not objects or any(not isinstance(one, int) or not 0 <= one <= 255 for one in objects):
        row.note("objects", objects, said("mistake.drive_objects"))
        objects = [2]
    certainty = row.text(
        "certainty", pattern=f"[{CERTAINTIES}]+", expected=said("mistake.letters_of", letters=CERTAINTIES)
    )
    return DriveParameter(
        number=number,
        writable=writable,
        format=format,
        group=row.text("group", pattern=KEY, expected=said("mistake.key")),
        objects=tuple(objects),
        count=row.whole("count", 0, high=MOST_ELEMENTS),
        unit=row.text("unit", ""),
        low=low,
        high=high,
        default=default,
        allowed=tuple(allowed),
        options=_options(row, code, low, high) if writable else {},
        kind=Kind(row.text("kind", Kind.NUMBER, choices=[str(one) for one in Kind])),
        trigger=row.flag("trigger", False) if writable else False,
        individual=row.flag("individual", False) if writable else False,
        when=When(row.text("when", When.ALWAYS, choices=[str(one) for one in When])),
        certainty=certainty,
    )


def _options(row: Table, code: str, low: float, high: float) -> dict[int, str]:
    values = row.items("options", ()) if row.has("options") else []
    if any(not isinstance(value, int) or not low <= value <= high for value in values):
        row.note("options", values, said("mistake.whole_within"))
        return {}
    return {value: f"parameter.option.{code}_{value}" for value in values}
