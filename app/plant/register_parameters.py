"""The parameters of a drive that are registers, one word each: `[parameters]` of device.toml, and what is known of them.

    [parameters]
    permanent = { address = 0x2001, value = 3 }     written before them, so that they go to permanent memory
    ranges = [["F100", "F160"], ["F200", "F230"]]   codes that a drive may have: first and last of each group
    individual = ["F900"]                           what belongs to one drive alone (its address) and is not copied to another one

What is known of a code stands once: in setpoints.toml where it is a setpoint (`code`), else in parameters.toml:

    F431 = { low = 0, high = 7, options = [7], certainty = "M" }

`low`, `high`, `default`, `unit`, `scale` and `decimals` may be missing: then nothing is known of them. Of every other code there is its
number and nothing else; it is written at standstill only. Texts are `parameter.<code>`, `parameter.group.f<digit>` and, of an option,
`parameter.option.<code>_<value>`.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

from app.plant.definitions import Device, ParameterMap, Point, Setpoint
from app.plant.said import said
from app.plant.tables import Table
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.parameter import DriveParameter, When
from app.registers.function_codes import address_of, code_of

WORD = 0xFFFF
UNKNOWN = "dpar.unknown"
"""Text of the name of a parameter of which nothing is known."""
OBJECT = 0
"""In place of a drive object: such a drive has none."""


def read_parameter_map(head: Table, device: Device) -> ParameterMap | None:
    """`[parameters]` of device.toml; None when there is none."""
    if not head.has("parameters"):
        return None
    table = head.table("parameters")
    permanent = None
    if table.has("permanent"):
        row = table.table("permanent")
        permanent = (row.whole("address"), row.whole("value"))
        row.done()
    ranges = [pair for pair in table.items("ranges") if _is_range(table, pair)]
    individual = table.items("individual", ())
    if any(not isinstance(code, str) or address_of(code) is None for code in individual):
        table.note("individual", individual, said("mistake.codes", example='["F900"]'))
        individual = []
    table.done()
    pairs = tuple((first, last) for first, last in ranges)
    return ParameterMap(device.group_read.get("once", 1), permanent, pairs, frozenset(individual))


def read_known(
    file: Table, setpoints: Mapping[str, Setpoint], points: Mapping[str, Point], individual: Collection[str] = ()
) -> dict[str, DriveParameter]:
    """What is known, by code: the setpoints that have one, and the rows of parameters.toml.

    A setpoint without its point, or its register, is a mistake that was told already.
    """
    keys = {setpoint.key: setpoint.code for setpoint in setpoints.values()}
    found = {
        setpoint.code: _of_setpoint(setpoint, point, keys)
        for key, setpoint in setpoints.items()
        if (point := points.get(key)) and point.register and address_of(setpoint.code) is not None
    }
    for code, row in file.tables():
        if address_of(code) is None or code in found:
            file.note(code, code, said("mistake.setpoint_code", example="F431"))
            continue
        found[code] = _of_row(code, row)
        row.done()
    found = {code: replace(one, individual=code in individual) for code, one in found.items()}
    return dict(sorted(found.items(), key=lambda one: one[1].number))


def unknown(code: str) -> DriveParameter | None:
    """A parameter of which nothing is known but its number; None when `code` is none."""
    address = address_of(code)
    if address is None:
        return None
    return DriveParameter(
        address, True, Format.UNSIGNED16, group_of(code), (OBJECT,), high=WORD, when=When.STOPPED, certainty="", name=code,
        label=UNKNOWN, has_default=False, known=False,
    )  # fmt: skip


def group_of(code: str) -> str:
    """f1 … f9, fa."""
    return code[:2].casefold()


def codes_in(ranges: ParameterMap) -> Iterator[str]:
    """Every code that a drive may have, in the order of the ranges."""
    for first, last in ranges.ranges:
        for address in range(address_of(first) or 0, (address_of(last) or -1) + 1):
            if code := code_of(address):
                yield code


def has_code(ranges: ParameterMap, code: str) -> bool:
    """Whether `code` is one of `codes_in`."""
    address = address_of(code)
    if address is None or code_of(address) != code:
        return False
    return any((address_of(first) or 0) <= address <= (address_of(last) or -1) for first, last in ranges.ranges)


def text_keys(map: ParameterMap) -> Iterator[str]:
    """The texts that the groups ask for."""
    yield from (f"parameter.group.{group_of(first)}" for first, _ in map.ranges)


def _is_range(table: Table, pair: object) -> bool:
    good = isinstance(pair, list) and len(pair) == 2 and all(isinstance(one, str) for one in pair)
    if good:
        first, last = (address_of(one) for one in pair)  # type: ignore[attr-defined]
        good = first is not None and last is not None and first <= last and first >> 8 == last >> 8
    if not good:
        table.note("ranges", pair, said("mistake.code_range", example='["F100", "F160"]'))
    return good


def _of_setpoint(setpoint: Setpoint, point: Point, codes: Mapping[str, str]) -> DriveParameter:
    """Bounds that are sentences stay names of what they depend on: the drive, and the checks of the type, judge them."""
    assert point.register is not None
    low, high = _number(setpoint.low), _number(setpoint.high)
    names = tuple("" if _number(one) is not None else codes.get(one, one) for one in (setpoint.low, setpoint.high))
    return DriveParameter(
        number=point.register.address,
        writable=True,
        format=Format.UNSIGNED16,
        group=group_of(setpoint.code),
        objects=(OBJECT,),
        unit=point.unit,
        low=0.0 if low is None else low,
        high=WORD * point.register.scale if high is None else high,
        default=setpoint.default or 0.0,
        has_default=setpoint.default is not None,
        allowed=tuple(setpoint.options),
        options=setpoint.options,
        when=When.STOPPED if setpoint.stopped_only else When.ALWAYS,
        certainty=setpoint.certainty,
        name=setpoint.code,
        point=setpoint.key,
        label=point.label,
        warning=setpoint.warning,
        scale=point.register.scale,
        decimals=point.decimals,
        bounds=(names[0], names[1]),
    )


def _of_row(code: str, row: Table) -> DriveParameter:
    scale = row.number("scale", 1.0, 0.0001, 1.0)
    default = row.number("default", None)
    low, high = row.number("low", 0.0, 0.0), row.number("high", WORD * scale, 0.0, WORD * scale)
    options = row.items("options", ()) if row.has("options") else []
    if any(not isinstance(value, int) or not low <= value <= high for value in options):
        row.note("options", options, said("mistake.whole_within"))
        options = []
    return DriveParameter(
        number=address_of(code) or 0,
        writable=True,
        format=Format.UNSIGNED16,
        group=group_of(code),
        objects=(OBJECT,),
        unit=row.text("unit", ""),
        low=low,
        high=high,
        default=default or 0.0,
        has_default=default is not None,
        options={value: f"parameter.option.{code}_{value}" for value in options},
        when=When.STOPPED,
        certainty=row.text("certainty", pattern="[MTCXG]+", expected=said("mistake.letters_of", letters="MTCXG")),
        name=code,
        scale=scale,
        decimals=row.whole("decimals", 0, high=4),
    )


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
