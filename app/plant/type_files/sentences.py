"""Expressions in the files of a type: they may name points that are read later, so they are checked when all are known."""

import re
from collections.abc import Callable, Collection, Mapping

from app.errors import ConfigurationError
from app.plant import expression
from app.plant.actions import BEFORE
from app.plant.definitions import Kind, Point
from app.plant.said import said
from app.plant.tables import Table

_OF_QUALITY = re.compile(r"\b(?:good|bad|age)\s*\([^)]*\)")
"""What a sentence may ask of a text, too."""


class Sentences:
    """Every expression over points that the files of one type hold, and where it stands."""

    def __init__(self) -> None:
        self._found: list[tuple[Table, str, str, bool, Collection[str] | None]] = []

    def add(
        self, table: Table, key: str, text: str, *, argument: bool = False, given: Collection[str] | None = None
    ) -> None:
        """Remember the expression at `key`; `argument`: whether it may say `argument`; `given`: values of an action that it may name, too,
        beside what points said before that (`before.speed`)."""
        self._found.append((table, key, text, argument, given))

    def check(self, points: Mapping[str, Point], owner: str) -> None:
        """Note every one that is no sentence, or that reads what `owner` has not among its `points`, what is only written, or a number of
        what is a text; and what is compared with a choice that its point does not have."""
        unread = {key for key, point in points.items() if point.register and not point.register.readable}
        texts = {key for key, point in points.items() if point.kind is Kind.TEXT}
        for table, key, text, argument, given in self._found:
            check_expression(table, key, text, points, owner, argument=argument, given=given)
            for name in sorted((names_in(text) or frozenset()) & unread) if key != "feedback" else ():
                table.note(key, text, said("mistake.read_point", point=name))
            for name in sorted((names_in(_OF_QUALITY.sub("0", text)) or frozenset()) & texts):
                table.note(key, text, said("mistake.point_is_text", point=name))


def check_expression(
    table: Table,
    key: str,
    text: str,
    points: Mapping[str, Point],
    owner: str,
    *,
    argument: bool = False,
    given: Collection[str] | None = None,
) -> None:
    """Note a problem when `text` is no sentence of the grammar, reads what `owner` has not, or compares with a choice that is none."""
    try:
        parsed = expression.parse(text, machines=given is not None)
    except ConfigurationError as error:
        table.note(key, text, error.args[0])
        return
    for name in sorted(parsed.names & set(given or ()) & set(points)):
        table.note(key, text, said("mistake.both_named", name=name))
    for name in sorted(parsed.names - set(given or ())):
        if (name.removeprefix(BEFORE) if given is not None else name) in points:
            continue
        table.note(key, text, said("mistake.points_of_type", owner=owner, point=name))
    if parsed.needs_argument and not argument:
        table.note(key, text, said("mistake.no_argument"))
    check_choices(table, key, text, points.get, machines=given is not None)


def check_choices(
    table: Table, key: str, text: str, find: Callable[[str], Point | None], *, machines: bool = False
) -> None:
    """Note what of a sentence can never be so: a point that is compared with a choice which it does not have. `find`: the point that a name
    means; None when there is none, which is told elsewhere."""
    try:
        compared = expression.parse(text, machines=machines).compared
    except ConfigurationError:
        return
    for name, number in sorted(compared):
        point = find(name.removeprefix(BEFORE) if machines else name)
        choices = choices_of(point) if point else frozenset()
        if choices and number not in choices:
            known = ", ".join(f"{one}" for one in sorted(choices))
            table.note(key, text, said("mistake.choice_of_point", point=name, number=f"{number:g}", known=known))


def choices_of(point: Point) -> frozenset[int]:
    """Numbers that `point` can be; empty when it is none of a few."""
    if point.kind is Kind.BOOL:
        return frozenset((0, 1))
    return frozenset(point.texts) if point.kind is Kind.ENUM else frozenset()


def read_values(table: Table, sentences: Sentences) -> dict[str, str]:
    """`values` of a row: the numbers that its text names, each an expression over points."""
    given = table.table("values")
    values = {name: given.text(name) for name in given.data}
    for name, text in values.items():
        sentences.add(given, name, text)
    given.done()
    return values


def names_in(text: str, *, machines: bool = False) -> frozenset[str] | None:
    """What a sentence reads; None when it is none, which `check` tells."""
    try:
        return expression.parse(text, machines=machines).names
    except ConfigurationError:
        return None


def needs_argument(text: str) -> bool:
    """Whether a sentence says `argument`; False when it is none, which `check` tells."""
    try:
        return bool(text) and expression.parse(text).needs_argument
    except ConfigurationError:
        return False
