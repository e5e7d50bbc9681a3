"""setpoints.toml: the parameters of a type; each is a point too, of its own or one of points.toml."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from app.plant import plc
from app.plant.definitions import PlcMap, Point, Setpoint, Type
from app.plant.said import said
from app.plant.tables import MISSING, Table, is_number, one_of, span
from app.plant.type_files.data import PointData
from app.plant.type_files.names import NUMBER_EXPECTED, ROLES
from app.plant.type_files.points import Points, read_choices
from app.plant.type_files.sentences import Sentences
from app.registers.codec import raw_limits
from app.registers.references import place
from app.registers.register import BIT_TABLES, REALS

TINY = 1e-9
"""How far a limit may lie beyond the register by the arithmetic of its scale [EU]."""


def read_setpoints(
    file: Table, points: Points, sentences: Sentences, map: PlcMap | None
) -> Iterator[tuple[str, Setpoint]]:
    """Each table of `file`; `points` get those that have an address, or are made writable within the settings of `map`."""
    codes = dict[str, str]()
    for key, row in file.tables():
        low, high = row.raw("low", 0), row.raw("high", 1 if _is_bit(row, points.found.get(key)) else 65535)
        options = read_choices(row, key, "options")
        for name, bound in (("low", low), ("high", high)):
            if isinstance(bound, str):
                sentences.add(row, name, bound)
            elif not is_number(bound):
                row.note(name, bound, NUMBER_EXPECTED)
        fixed = is_number(low) and is_number(high)
        if fixed and low > high:
            row.note("low", low, said("mistake.pair", pair="low, high", order="low <= high"))
            fixed = False
        bounds: dict[str, str] = {}
        normal = None if row.has("address") else points.normal(row, bounds)  # else its point has it
        if bounds:
            row.note("normal", row.raw("normal"), NUMBER_EXPECTED)
        setpoint = Setpoint(
            key=key,
            low=str(low),
            high=str(high),
            normal=normal,
            role=row.text("role", "engineer", choices=ROLES),
            group=row.text("group", ""),
            code=row.text("code", ""),
            options=options,
            stopped_only=row.flag("stopped_only"),
            warning=row.text("warning", ""),
            default=row.number("default", None, *((low, high) if fixed else ())),
            certainty=row.text("certainty", ""),
        )
        if row.has("address"):
            points.add(
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
                data = points.found[key]
                data.point = replace(data.point, texts=options)
        elif key not in points.found:
            row.note("address", MISSING, said("mistake.address_or_key"))
        elif map and plc.inside(map.settings, points.found[key].point.register):
            data = points.found[key]
            assert data.point.register
            data.point = replace(data.point, register=replace(data.point.register, writable=True))
        else:
            register = points.found[key].point.register
            if register is None or not (register.writable and register.readable):
                row.note("", key, said("mistake.settable", point=key))
        if map and key in points.found and plc.inside(map.settings, points.found[key].point.register):
            plc.check_setpoint(row, map, points.found[key].point.register)
        if key in points.found:
            _check_written(row, points.found[key].point, setpoint, low, high)
        if setpoint.code and (other := codes.setdefault(setpoint.code, key)) != key:
            row.note("code", setpoint.code, said("mistake.code_free", other=other))
        _doubt_limits(row, points.found.get(key), options)
        row.done()
        yield key, setpoint


def _doubt_limits(row: Table, data: PointData | None, options: Mapping[int, str]) -> None:
    """A number without limits takes whatever somebody types; a choice, a bit and a point that has its own are none."""
    register = data.point.register if data else None
    if data is None or register is None or options or register.type is Type.BIT or register.mask is not None:
        return
    for key in ("low", "high"):
        if not row.has(key):
            row.doubt(key, MISSING, said("mistake.doubt_limit", point=data.point.key, key=key))


def _is_bit(row: Table, known: PointData | None) -> bool:
    """Whether a parameter is a coil."""
    if not row.has("address"):
        return known is not None and known.point.register is not None and known.point.register.type is Type.BIT
    at = place(str(row.data["address"])) if isinstance(row.data["address"], str) else None
    return (at[0] if at else row.data.get("table")) in BIT_TABLES


def _check_written(row: Table, point: Point, setpoint: Setpoint, low: object, high: object) -> None:
    """A parameter is written and read back, and its register holds whatever its limits and options permit."""
    register = point.register
    if register is None:
        return
    for key in ("readable", "writable"):
        if row.has("address") and not getattr(register, key):
            row.note(key, "false", said("mistake.settable", point=setpoint.key))
    if register.type is Type.STRING:
        row.note("type" if row.has("type") else "", register.type, said("mistake.number_parameter", point=setpoint.key))
    elif register.type not in REALS:
        ends = sorted(raw * register.scale + register.offset for raw in raw_limits(register))
        for key, bound in (("low", low), ("high", high)):
            if row.has(key) and is_number(bound) and not ends[0] - TINY <= float(str(bound)) <= ends[1] + TINY:
                expected = said(
                    "mistake.fits_register", point=setpoint.key, low=f"{ends[0]:g}", high=f"{ends[1]:g}",
                    step=f"{abs(register.scale):g}",
                )  # fmt: skip
                row.note(key, bound, expected)
    for value in setpoint.options if is_number(low) and is_number(high) else ():
        if not float(str(low)) <= value <= float(str(high)):
            row.note(f"options.{value}", value, span("number", float(str(low)), float(str(high))))
    if setpoint.options and setpoint.default is not None and setpoint.default not in setpoint.options:
        row.note("default", setpoint.default, one_of([str(value) for value in setpoint.options]))
