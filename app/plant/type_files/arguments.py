"""`arguments` of a command that is sent as a code, and of an action of a sequence: what is given with it, by name."""

from collections.abc import Iterator

from app.plant import expression
from app.plant.definitions import Argument, Type
from app.plant.said import said
from app.plant.tables import Table, is_number
from app.plant.type_files.names import KEY, NAME_EXPECTED, NUMBER_EXPECTED
from app.plant.type_files.sentences import Sentences

TYPES = (Type.F32, Type.U32, Type.I32)
MOST_ARGUMENTS = 4


def read_arguments(table: Table, sentences: Sentences) -> Iterator[Argument]:
    """The rows of `arguments`; a limit is a number or an expression over points."""
    seen: set[str] = set()
    for index, row in enumerate(table.rows("arguments")):
        name = row.text("name", pattern=KEY, expected=NAME_EXPECTED)
        if index == MOST_ARGUMENTS:
            row.note("name", name, said("mistake.arguments", most=MOST_ARGUMENTS))
        if name in seen or name in expression.RESERVED:
            row.note("name", name, said("mistake.argument_name"))
        seen.add(name)
        yield _argument(name, row, sentences)


def _argument(name: str, row: Table, sentences: Sentences) -> Argument:
    kind = Type(row.text("type", Type.F32.value, choices=[kind.value for kind in TYPES]))
    low, high = (_limit(row, bound, sentences) for bound in ("low", "high"))
    least, most = row.data.get("low"), row.data.get("high")
    if is_number(least) and is_number(most) and least > most:
        row.note("low", least, said("mistake.pair", pair="low, high", order="low <= high"))
    decimals = row.whole("decimals", 0, 0, 6)
    if decimals and kind is not Type.F32:
        row.note("decimals", decimals, said("mistake.for_type", what=0, type=kind))
    argument = Argument(name, kind, low, high, row.text("unit", ""), decimals, row.text("label", f"argument.{name}"))
    row.done()
    return argument


def _limit(row: Table, bound: str, sentences: Sentences) -> str:
    value = row.raw(bound)
    if isinstance(value, str):
        sentences.add(row, bound, value)
    elif value is not None and not is_number(value):
        row.note(bound, value, NUMBER_EXPECTED)
    return "" if value is None else str(value)
