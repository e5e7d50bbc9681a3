"""Rows of a type that there are as many of as an option says: `[repeats]` of device.toml, and how every file of the type uses them.

    [repeats]                                           device.toml
    belt = { to = "belts" }                             1, 2 … as many as the option `belts` says
    inner = { to = "belts - 1" }                        an expression over options; less than 1: there is none
    later = { from = 2, to = "sensors" }

    ["speed_{belt}"]                                    a key with its name in braces: speed_1, speed_2 …; in all that stands below it
    expression = "motor_{belt} == 1"                    {belt} is the number, {belt-1} the one before
    source = "{belt}"                                   alone it is a number
    address = { by = [[1, 0x0132, 14], [4, 0x200E, 12]] }       from number 1 on 0x0132 and 14 more each, from 4 on others
    bits = [[1, 0x0104, 0], [4, 0x2001, 3]]             address and shift alike: from number 1 on bits from 0, and on into the next word

    tile = ["state", "motor_{belt}"]                    in a list without a number: an item for each
    expression = "every(belt: jam_{belt} == 0)"         … and …; `any(belt: …)`: … or …
    capacity = { of = "belt", by = [[1, 6, 0], [4, 8, 2]] }     by how many there are
    each = ["later", "final"]                           in a list of tables: such a table for each number of these
    only = "inner"                                      in a table: it is there only when there is at least one of these

Options, points, commands, alarms, tables and texts are written once; a machine has as many as its plant file says.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.errors import ConfigurationError
from app.plant import expression
from app.plant.said import said

_PLACE = re.compile(r"\{([a-z]\w*)(?:([+-])(\d+))?\}")
_GROUP = re.compile(r"\b(every|any)\((\w+): ")
_WORD = 16
_JOINS = {"every": " and ", "any": " or "}
_NONE = {"every": "1 == 1", "any": "1 == 0"}
"""What is said of none at all."""

MOST = 1000
"""Rows of one kind."""
_STEERING = ("only", "each")

Scope = Mapping[str, int]
"""Name of a repeat → the number that is written now; the last one is the innermost."""


@dataclass(frozen=True, slots=True)
class Repeats:
    """How often each named row is there on one machine, and how often at most."""

    numbers: Mapping[str, range]
    most: Mapping[str, range]
    options: frozenset[str] = frozenset()
    """Options that they count with: another value is another set of rows."""

    def __bool__(self) -> bool:
        return bool(self.numbers)


def read_repeats(data: Mapping[str, Any], given: Mapping[str, float]) -> Repeats:
    """`[repeats]` of what stands in device.toml, for a machine whose options are `given`.

    Raises:
        ConfigurationError: one is no table of `from` and `to`, or counts with what is no option.
    """
    options = {
        name: one
        for name, one in _table(data.get("options", {})).items()
        if isinstance(one, Mapping)
        and all(isinstance(one.get(key, 0), int | float) for key in ("default", "low", "high"))
        and "default" in one
        and "{" not in name
    }
    usual = {name: float(given.get(name, one["default"])) for name, one in options.items()}
    lowest, highest = (
        {name: float(one.get(end, one["default"])) for name, one in options.items()} for end in ("low", "high")
    )
    numbers: dict[str, range] = {}
    most: dict[str, range] = {}
    used: set[str] = set()
    if not isinstance(data.get("repeats", {}), Mapping):
        raise ConfigurationError(said("mistake.repeats_table", found=repr(data["repeats"])))
    for name, row in data.get("repeats", {}).items():
        if not isinstance(row, Mapping) or not all(isinstance(row.get(key, "1"), str) for key in ("from", "to")):
            raise ConfigurationError(said("mistake.repeats_row", name=name, found=repr(row)))
        first, last = str(row.get("from", "1")), str(row.get("to", "0"))
        used |= expression.parse(first).names | expression.parse(last).names
        numbers[name] = range(_limit(name, first, usual, 1), _limit(name, last, usual, 0) + 1)
        # among the numbers of all machines: of every one that it may ever have been
        least = 1 if expression.parse(first).names else _limit(name, first, highest, 1)
        most[name] = range(least, max(_limit(name, last, highest, 0), _limit(name, last, lowest, 0)) + 1)
    return Repeats(numbers, most, frozenset(used))


def _limit(name: str, text: str, values: Mapping[str, float], least: int) -> int:
    value = expression.number(text, values)
    if value is None:
        raise ConfigurationError(said("mistake.repeats_with", name=name, text=text))
    if not value <= MOST:
        raise ConfigurationError(said("mistake.repeats_to", name=name, number=f"{value:g}", most=MOST))
    return max(least, int(value))


def _table(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


@dataclass(slots=True)
class Written:
    """A file with every repeated row written out."""

    data: dict[str, Any]
    names: dict[tuple[str, ...], str]
    """Path of a key that was written out → the key as it stands in the file."""
    mistakes: Sequence[tuple[tuple[str, ...], object, str]] = ()
    """Path, value, what was expected."""


def written_out(data: Mapping[str, Any], numbers: Mapping[str, range]) -> Written:
    """`data` with every repeated row once for each number."""
    writer = _Writer(numbers)
    return Written(writer.table(data, {}, ()), writer.names, writer.mistakes)


class _Writer:
    def __init__(self, numbers: Mapping[str, range]) -> None:
        self.names: dict[tuple[str, ...], str] = {}
        self.mistakes: list[tuple[tuple[str, ...], object, str]] = []
        self._numbers = numbers
        self._told: set[tuple[str, ...]] = set()

    def table(self, data: Mapping[str, Any], scope: Scope, path: tuple[str, ...]) -> dict[str, Any]:
        """`path`: of this table as it is written out."""
        found: dict[str, Any] = {}
        for key, value in data.items():
            if key == "bits" and scope and isinstance(value, list):
                row = self._row(value, _last(scope), (*path, key), "[[from, address, bit], …]")
                found["address"], found["shift"] = _bit(row, _last(scope))
                continue
            if isinstance(value, dict) and not self._wanted(value, (*path, key)):
                continue
            for inner in self._scopes(key, scope):
                name = _filled(key, inner)
                if name != key:
                    self.names[*path, name] = key
                found[name] = self.value(value, inner, (*path, name))
        return found

    def value(self, value: Any, scope: Scope, path: tuple[str, ...]) -> Any:
        if isinstance(value, dict):
            if "by" in value and not set(value) - {"by", "of"}:
                number = self._count(value["of"], (*path, "of")) if "of" in value else _last(scope)
                return _by(self._row(value["by"], number, (*path, "by"), "[[from, first, step], …]"), number)
            return self.table({key: one for key, one in value.items() if key not in _STEERING}, scope, path)
        if isinstance(value, list):
            return [
                self.value(item, inner, (*path, str(index)))
                for index, item in enumerate(value)
                if not isinstance(item, dict) or self._wanted(item, (*path, str(index)))
                for inner in self._items(item, scope, (*path, str(index)))
            ]
        if isinstance(value, str):
            text = _filled(self._groups(value, scope), scope)
            alone = _PLACE.fullmatch(value)
            return int(text) if alone and alone[1] in scope else text
        return value

    def _wrong(self, path: tuple[str, ...], value: object, expected: str) -> None:
        """Note a mistake, once of all rows that are written out of it."""
        written = tuple(self.names.get(path[: at + 1], part) for at, part in enumerate(path))
        if written not in self._told:
            self._told.add(written)
            self.mistakes.append((path, value, expected))

    def _named(self, value: object, path: tuple[str, ...]) -> bool:
        if isinstance(value, str) and value in self._numbers:
            return True
        self._wrong(path, value, said("mistake.repeat_known", known=", ".join(self._numbers)))
        return False

    def _count(self, of: object, path: tuple[str, ...]) -> int:
        return self._numbers[str(of)].stop - 1 if self._named(of, path) else MOST

    def _row(self, rows: object, number: int, path: tuple[str, ...], form: str) -> Sequence[float]:
        """The row of three numbers that holds at `number`: the last that begins there or before."""
        begun: Sequence[float] | None = None
        for row in rows if isinstance(rows, list) else ():
            match row:
                case [int() as begin, int() | float(), int() | float()] if begin <= number:
                    begun = row
                case [int(), int() | float(), int() | float()]:
                    pass
                case _:
                    begun = None
                    break
        if begun is None:
            self._wrong(path, rows, said("mistake.repeat_row", form=form, number=number))
        return begun or (0, 0, 0)

    def _items(self, item: Any, scope: Scope, path: tuple[str, ...]) -> Iterator[Scope]:
        """The scopes in which an item of a list stands."""
        if isinstance(item, str):
            yield from self._scopes(item, scope)
            return
        scopes = [scope]
        each = item.get("each", []) if isinstance(item, dict) else []
        if not isinstance(each, list):
            self._wrong((*path, "each"), each, said("mistake.repeat_list", known=", ".join(self._numbers)))
            return
        for at, name in enumerate(each):
            known = self._named(name, (*path, "each", str(at)))
            scopes = [{**one, name: number} for one in scopes for number in self._numbers[name]] if known else []
        yield from scopes

    def _wanted(self, table: Mapping[str, Any], path: tuple[str, ...]) -> bool:
        """Whether the machine has what `table` describes, as far as `only` says."""
        return "only" not in table or (
            self._named(table["only"], (*path, "only")) and bool(self._numbers[table["only"]])
        )

    def _scopes(self, text: str, scope: Scope) -> Iterator[Scope]:
        """`scope` with every number of a repeat that `text` names and that has none yet; `scope` alone when there is none."""
        name = next((place[1] for place in _PLACE.finditer(text) if place[1] in self._numbers), "")
        if _GROUP.search(text) or not name or name in scope:
            yield scope
            return
        for number in self._numbers[name]:
            yield {**scope, name: number}

    def _groups(self, text: str, scope: Scope) -> str:
        while group := _GROUP.search(text):
            word, name, begin = group[1], group[2], group.end()
            depth, end = 1, begin
            while depth and end < len(text):
                depth += {"(": 1, ")": -1}.get(text[end], 0)
                end += 1
            inside = text[begin : end - 1]
            parts = [_filled(inside, {**scope, name: number}) for number in self._numbers.get(name, range(0))]
            joined = _JOINS[word].join(parts) or _NONE[word]
            whole = group.start() == 0 and end == len(text)
            text = text[: group.start()] + (joined if whole else f"({joined})") + text[end:]
        return text


def _last(scope: Scope) -> int:
    return next(reversed(list(scope.values())), 0)


def _filled(text: str, scope: Scope) -> str:
    def number(place: re.Match[str]) -> str:
        name, sign, by = place.groups()
        return str(scope[name] + int(f"{sign}{by}" if sign else 0)) if name in scope else place[0]

    return _PLACE.sub(number, text)


def _by(row: Sequence[float], number: int) -> float:
    """Of `[from, first, step]` the value at `number`."""
    begin, first, step = row
    return first + (number - begin) * step


def _bit(row: Sequence[float], number: int) -> tuple[int, int]:
    """Of `[from, address, bit]` the word and the bit at `number`."""
    begin, address, first = (int(one) for one in row)
    bit = first + number - begin
    return address + bit // _WORD, bit % _WORD
