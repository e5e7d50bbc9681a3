"""today.toml: what is told of a machine's day."""

from collections.abc import Iterator, Mapping

from app.plant.definitions import Kind, Point
from app.plant.said import said
from app.plant.tables import Table, one_of
from app.plant.today import Figure, How
from app.records.kind import RecordKind

ONCE = (How.TIME, How.ENERGY, How.MEAN)
"""Of these a machine has one at most; counters may be several."""
FITS: Mapping[How, str] = {
    How.TIME: said("mistake.figure_time"),
    How.COUNT: said("mistake.figure_count"),
    How.ENERGY: said("mistake.figure_energy"),
}


def read_today(file: Table, points: Mapping[str, Point], records: Mapping[str, RecordKind]) -> dict[str, Figure]:
    """The figures by name, in the order of the file."""
    found: dict[str, Figure] = {}
    for name, table in file.tables():
        figure = _figure(name, table, points, records)
        if figure.how in ONCE and any(one.how is figure.how for one in found.values()):
            table.note("how", str(figure.how), said("mistake.one_figure", name=name))
        found[name] = figure
        table.done()
    file.done()
    return found


def _figure(name: str, table: Table, points: Mapping[str, Point], records: Mapping[str, RecordKind]) -> Figure:
    how = How(table.text("how", choices=[str(one) for one in How]) or How.COUNT)
    if how is not How.MEAN:
        fitting = [key for key, point in points.items() if _fits(how, point)]
        return Figure(name, how, of=table.text("of", choices=fitting, expected=FITS[how]))
    kind = table.text("record", choices=list(records))
    outcomes = records[kind].outcomes if kind in records else ()
    expected = said("mistake.outcome_of", kind=kind, known=one_of(outcomes, table.raw("outcome", "")))
    return Figure(name, how, record=kind, outcome=table.text("outcome", choices=outcomes, expected=expected))


def _fits(how: How, point: Point) -> bool:
    if not point.history:
        return False
    match how:
        case How.TIME:
            return point.kind is Kind.BOOL
        case How.ENERGY:
            return point.kind is Kind.ANALOG and point.unit == "kW"
    return point.kind is Kind.STEP


def text_keys(figures: Mapping[str, Figure]) -> Iterator[str]:
    """Every text that these figures ask for: what is counted; the others are called alike for all types."""
    return (f"today.{one.name}" for one in figures.values() if one.how is How.COUNT)
