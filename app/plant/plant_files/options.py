"""What a machine says of itself beside its type: options, and what differs on its points."""

from collections.abc import Iterator, Mapping
from typing import Any

from app.plant import expression
from app.plant.plant_files.names import ID
from app.plant.said import Plain, said
from app.plant.sequence_definition import SequenceDefinition
from app.plant.sequences import options as definition_options
from app.plant.tables import NONE, Table, is_number, one_of
from app.plant.type_files.data import TypeData
from app.plant.type_files.names import KEY
from app.plant.type_files.options import BY_DEFINITION, SPAN_EXPECTED


def read_options(
    table: Table, data: TypeData, preset: Mapping[str, float], sequence: SequenceDefinition | None = None
) -> dict[str, object]:
    """The options of a machine: its own, else those of its preset, else those of its type, which may follow from others; a sequence's are
    its definition's."""
    options = {**data.type.options, **preset}
    if sequence:
        options |= definition_options(sequence)
    usual = dict(options)
    counts = {map.capacity for map in data.type.tables.values()} | data.counted | data.whole
    for name, default in options.items():
        if sequence and name in BY_DEFINITION:
            continue  # the definition says it
        if isinstance(default, float):
            low, high = data.type.ranges[name]
            if name in data.follows and name not in preset:
                told = {key: number for key, number in options.items() if isinstance(number, float)}
                followed = expression.number(data.follows[name], told)
                default = default if followed is None else followed
            options[name] = value = float(table.number(name, default, low, high))
            if name in counts and not value.is_integer():
                table.note(name, value, said("mistake.whole"))
        elif table.has(name):
            options[name] = _option_table(table.table(name), name, data)
    numbers = {name: value for name, value in options.items() if isinstance(value, float)}
    for check in data.checks:
        if not check.holds(numbers):
            shown = {name: f"{value:g}" for name, value in numbers.items()}
            table.note(check.option, Plain(shown[check.option]), check.told(shown))
            # what follows from them is no mistake of its own
            options |= {name: usual[name] for name in expression.parse(check.expression).names}
    return options


def read_overrides(table: Table, data: TypeData, *, repeated: bool) -> dict[str, dict[str, Any]]:
    """`[equipment.m1.points.speed]`: what differs on this machine; point → field → value."""
    found: dict[str, dict[str, Any]] = {}
    for key, row in table.tables("points"):
        if key not in data.points:
            row.note("", key, said("mistake.point_of", owner=data.type.name, known=one_of(sorted(data.points), key)))
            continue
        found[key] = dict(_override(key, row, data, repeated=repeated))
        row.done()
    return found


def _override(key: str, row: Table, data: TypeData, *, repeated: bool) -> Iterator[tuple[str, Any]]:
    if row.has("was"):
        pattern = rf"{ID}\.{KEY}"
        yield "was", row.text("was", pattern=pattern, expected=said("mistake.former_name"))
        if repeated:
            row.note("was", row.raw("was"), said("mistake.no_former"))
    yield from _scale(key, row, data)
    yield from _limits(key, row, data)
    if row.has("dead_band"):
        yield "dead_band", float(row.number("dead_band", low=0))
    if row.has("decimals"):
        yield "decimals", row.whole("decimals", low=0, high=6)
    if row.has("history"):
        yield "history", row.flag("history")
    if row.has("normal"):
        match row.items("normal", expected=said("mistake.as_is", what="[low, high]")):
            case [low, high] if is_number(low) and is_number(high) and low <= high:
                yield "normal", (float(low), float(high))
            case band:
                row.note("normal", band, SPAN_EXPECTED)
    for name in (
        "was",
        "scale_low",
        "scale_high",
        "low",
        "high",
        "dead_band",
        "decimals",
        "history",
        "normal",
        "reason",
    ):
        row.raw(name)


def _limits(key: str, row: Table, data: TypeData) -> Iterator[tuple[str, Any]]:
    """Where a value begins to be doubtful on this machine, and why there: whoever reads the file later should know."""
    before = len(row.source.problems)
    given = {name: float(row.number(name)) for name in ("low", "high") if row.has(name)}
    if not given:
        if row.has("reason"):
            row.note("reason", row.raw("reason"), said("mistake.no_reason"))
        return
    blamed = next(iter(given))
    if key in data.type.setpoints:
        row.note(blamed, given[blamed], said("mistake.no_limits"))
    expected = said("mistake.why_differs", key=blamed)
    reason = row.text("reason", "", expected=expected)
    if not row.has("reason"):
        row.note("reason", NONE, expected)
    if len(row.source.problems) == before:
        yield from given.items()
        yield "reason", reason


def _scale(key: str, row: Table, data: TypeData) -> Iterator[tuple[str, float]]:
    """The ends of a bar, which stay in order when only one of them is given."""
    given = {name: float(row.number(name)) for name in ("scale_low", "scale_high") if row.has(name)}
    low = given.get("scale_low", data.points[key].point.scale_low)
    high = given.get("scale_high", data.points[key].point.scale_high)
    blamed = next(reversed(given), "")
    if blamed and low is not None and high is not None and low >= high:
        ends = said("mistake.less_than", order="scale_low < scale_high", low=f"{low:g}", high=f"{high:g}")
        row.note(blamed, row.raw(blamed), ends)
    yield from given.items()


def _option_table(table: Table, name: str, data: TypeData) -> dict[str, object]:
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


def _limit(text: str, otherwise: float) -> float:
    """A limit that is a plain number; `otherwise` when other parameters decide."""
    try:
        return float(text)
    except ValueError:
        return otherwise
