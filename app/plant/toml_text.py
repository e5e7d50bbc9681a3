"""Changes to a TOML text that keep what they do not touch as it was written: comments, order, spaces, keys that nobody here knows.

A text is cut into pieces, each a header, a key with its whole value, or what stands between them. Every change is made in the pieces and in
the tables that they mean; when the text read anew does not mean the same, it is written in a way that only a person can change.
"""

import re
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from datetime import date, time
from typing import Any

import tomli

from app.plant.toml import TOKEN, parse

KeyPath = tuple[str, ...]
"""Keys from the outside inwards; rows of a list of tables by their number: `("steps", "2", "label")`."""
BARE = r"[A-Za-z0-9_-]+"
LONGEST_LINE = 118
"""A list or a table that would be longer is broken after each of its members [characters]."""
_ASSIGNED = re.compile(rf"""\s*((?:{BARE}|"[^"\n]*"|'[^'\n]*')(?:\s*\.\s*(?:{BARE}|"[^"\n]*"|'[^'\n]*'))*)\s*=""")
_HEADER = re.compile(r"\s*(\[{1,2})\s*([^\]\n]+?)\s*\]")


class CannotEdit(Exception):
    """The text is written in a way that this module does not change: `where` stands it."""

    def __init__(self, where: Sequence[str]) -> None:
        super().__init__(".".join(where))
        self.where = ".".join(where)


@dataclass(frozen=True, slots=True)
class Piece:
    """A part of a text, with its line ends."""

    text: str
    path: KeyPath = ()
    """Of a header or a key; empty = comments and empty lines."""
    header: bool = False
    row: bool = False
    """Whether the header is one of a list, `[[steps]]`."""


@dataclass(frozen=True, slots=True)
class Put:
    """Give `path` a value; None takes it away."""

    path: KeyPath
    value: Any


@dataclass(frozen=True, slots=True)
class Insert:
    """A new row of the list `path` before row `at`."""

    path: KeyPath
    at: int
    value: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Remove:
    """Take row `at` of the list `path` away, with everything under it."""

    path: KeyPath
    at: int


@dataclass(frozen=True, slots=True)
class Swap:
    """Row `at` of the list `path` and the next one change places."""

    path: KeyPath
    at: int


@dataclass(frozen=True, slots=True)
class Rename:
    """The table `path` is called `name`."""

    path: KeyPath
    name: str


Change = Put | Insert | Remove | Swap | Rename


def edited(text: str, changes: Sequence[Change]) -> str:
    """`text` with `changes`, one after the other.

    Raises:
        TomlRefused: `text` is no TOML.
        CannotEdit: a change does not come out in the text as it should.
        LookupError: there is no such row.
    """
    for change in changes:
        wanted = deepcopy(parse(text))
        _change_tables(wanted, change)
        found = "".join(piece.text for piece in _change_pieces(pieces(text), change))
        try:
            same = tomli.loads(found) == wanted
        except ValueError:
            same = False
        if not same:
            raise CannotEdit(change.path)
        text = found
    return text


def pieces(text: str) -> list[Piece]:
    """The pieces of `text`, which need not be TOML: together they are the text again."""
    found: list[Piece] = []
    table: KeyPath = ()
    counts: dict[KeyPath, int] = {}
    for line in _logical_lines(text):
        if line.lstrip().startswith("[") and (header := _HEADER.match(line)):
            table = headed(header[2], counts, row=(row := header[1] == "[["))
            found.append(Piece(line, table, header=True, row=row))
        elif assigned := _ASSIGNED.match(line):
            found.append(Piece(line, (*table, *split(assigned[1]))))
        else:
            found.append(Piece(line))
    return found


def headed(dotted: str, counts: dict[KeyPath, int], *, row: bool) -> KeyPath:
    """The table that the header `dotted` begins; `counts`: rows of each list of tables so far, this one included from now on."""
    *parents, last = split(dotted) or ("",)
    table: KeyPath = ()
    for part in parents:  # a table inside a list of tables is of the list's latest row
        table = (*table, part)
        table = (*table, str(counts[table] - 1)) if table in counts else table
    table = (*table, last)
    if row:
        counts[table] = counts.get(table, 0) + 1
        table = (*table, str(counts[table] - 1))
    return table


def span(found: Sequence[Piece], path: KeyPath) -> range:
    """The pieces of the table `path` and of all under it, with the comments before it; empty when it has no header of its own."""
    inside = [n for n, piece in enumerate(found) if piece.header and piece.path[: len(path)] == path]
    if not inside or found[inside[0]].path != path:
        return range(0)
    end = inside[0]
    while end + 1 < len(found) and not (found[end + 1].header and found[end + 1].path[: len(path)] != path):
        end += 1
    while end > inside[0] and not found[end].path:  # what stands before the next header is of that one
        end -= 1
    return range(_lead(found, inside[0]), end + 1)


def literal(value: object, indent: str = "") -> str:
    """`value` as TOML writes it."""
    match value:
        case bool():
            return "true" if value else "false"
        case int():
            return str(value)
        case float():
            return str(int(value)) if value.is_integer() and abs(value) < 2**53 else repr(value)
        case date() | time():
            return value.isoformat()
        case str():
            return _text(value)
        case Mapping():
            inside = ", ".join(f"{key_literal(name)} = {literal(item)}" for name, item in value.items())
            return f"{{ {inside} }}" if inside else "{}"
    assert isinstance(value, Sequence)
    line = f"[{', '.join(literal(item) for item in value)}]"
    if len(line) <= LONGEST_LINE or not value:
        return line
    return "[\n" + "".join(f"{indent}    {literal(item)},\n" for item in value) + f"{indent}]"


def key_literal(name: str) -> str:
    """One part of a key as TOML writes it: bare where it can be."""
    return name if re.fullmatch(BARE, name) else _text(name)


# ---- the tables ----------------------------------------------------------------------------------------------


def _change_tables(root: dict[str, Any], change: Change) -> None:
    *above, last = change.path
    at: Any = root
    for key in above:
        at = at[int(key)] if isinstance(at, list) else at.setdefault(key, {})
    match change:
        case Put(value=None):
            at.pop(last, None)
            _drop_empty(root, tuple(above))
        case Put(value=value):
            at[last] = deepcopy(value)
        case Rename(name=name):
            if name in at:
                raise LookupError(".".join(change.path))
            at[name] = at.pop(last)
        case Insert(at=row, value=value):
            rows = at.setdefault(last, [])
            if not 0 <= row <= len(rows):
                raise LookupError(f"{'.'.join(change.path)}.{row}")
            rows.insert(row, deepcopy(dict(value)))
        case Remove(at=row):
            del at[last][row]
            if not at[last]:
                del at[last]
        case Swap(at=row):
            rows = at[last]
            rows[row], rows[row + 1] = rows[row + 1], rows[row]


def _drop_empty(root: dict[str, Any], path: KeyPath) -> None:
    """Tables that a removed one leaves empty have no header either: `[abort]` is nowhere written when it has no bit."""
    while path and not path[-1].isdecimal():
        at: Any = root
        for key in path[:-1]:
            at = at[int(key)] if isinstance(at, list) else at[key]
        if at.get(path[-1]) != {}:
            return
        del at[path[-1]]
        path = path[:-1]


# ---- the pieces ----------------------------------------------------------------------------------------------


def _change_pieces(found: list[Piece], change: Change) -> list[Piece]:
    match change:
        case Put(path=path, value=value):
            return _put(found, path, value)
        case Rename(path=path, name=name):
            return [_renamed(piece, path, name) if piece.header else piece for piece in found]
        case Insert(path=path, at=at, value=value):
            return _insert(found, path, at, value)
        case Remove(path=path, at=at):
            place = _row(found, (*path, str(at)))
            return _joined(found[: place.start], found[place.stop :])
        case Swap(path=path, at=at):
            first, second = _row(found, (*path, str(at))), _row(found, (*path, str(at + 1)))
            between = found[first.stop : second.start]
            moved = [*found[second.start : second.stop], *between, *found[first.start : first.stop]]
            return [*found[: first.start], *moved, *found[second.stop :]]


def _renamed(piece: Piece, path: KeyPath, name: str) -> Piece:
    """Of the header of `path` and of those under it, the part that is its name."""
    if piece.path[: len(path)] != path:
        return piece
    after = len(piece.path) - len(path)
    inside = _HEADER.match(piece.text)
    if inside is None or after:
        raise CannotEdit(path)
    parts = inside[2].rsplit(".", 1)
    text = f"{piece.text[: inside.start(2)]}{'.'.join([*parts[:-1], key_literal(name)])}{piece.text[inside.end(2) :]}"
    return Piece(text, (*path[:-1], name), piece.header, piece.row)


def _put(found: list[Piece], path: KeyPath, value: Any) -> list[Piece]:
    here = next((n for n, piece in enumerate(found) if piece.path == path and not piece.header), None)
    if here is not None:
        if value is None:
            return [*found[:here], *found[here + 1 :]]
        return [*found[:here], Piece(_with_value(found[here].text, value), path), *found[here + 1 :]]
    own = span(found, path)
    if value is None:
        return _joined(found[: own.start], found[own.stop :]) if own else found
    if isinstance(value, Mapping):
        under = [piece.path for piece in found if not piece.header and piece.path[: len(path)] == path]
        if own or under:  # key by key, as they are written
            names = dict.fromkeys([*(one[len(path)] for one in under), *value])
            for name in names:
                found = _put(found, (*path, name), value.get(name))
            return found
        if any(isinstance(one, Mapping) for one in value.values()):
            return _add_block(found, path, _block(path, value))
        if path[-1].isdecimal():
            return _add_block(found, path, _block(path, value))
    return _add_key(found, path, value)


def _add_key(found: list[Piece], path: KeyPath, value: Any) -> list[Piece]:
    """A key that its table does not have yet, behind the last one that it has."""
    table = path[:-1]
    begin = next((n for n, piece in enumerate(found) if piece.header and piece.path == table), None)
    name = key_literal(path[-1])
    if begin is None:
        siblings = [n for n, piece in enumerate(found) if not piece.header and table and piece.path[:-1] == table]
        if not siblings:
            raise CannotEdit(path)
        begin = siblings[-1]  # label.hr = …
        written = _ASSIGNED.match(found[begin].text)
        name = f"{written[1].rpartition('.')[0]}.{name}" if written else name
    place = begin
    for n in range(begin + 1, len(found)):
        if found[n].header:
            break
        if found[n].path:
            place = n
    before = found[place].text
    end = "" if before.endswith("\n") else "\n"
    return [
        *found[:place],
        Piece(before + end, found[place].path, found[place].header, found[place].row),
        Piece(f"{name} = {literal(value)}\n", path),
        *found[place + 1 :],
    ]


def _insert(found: list[Piece], path: KeyPath, at: int, value: Mapping[str, Any]) -> list[Piece]:
    next_one = span(found, (*path, str(at)))
    if next_one:
        block = _block((*path, str(at)), value, row=True)
        return [*found[: next_one.start], Piece(block + "\n"), *found[next_one.start :]]
    return _add_block(found, (*path, str(at)), _block((*path, str(at)), value, row=True))


def _add_block(found: list[Piece], path: KeyPath, block: str) -> list[Piece]:
    """A table behind those beside it, else behind the one around it, else at the end."""
    place = 0
    for around in (path[:-1], path[:-2]):
        inside = [n for n, piece in enumerate(found) if around and piece.path[: len(around)] == around]
        if inside:
            place = inside[-1] + 1
            break
    else:
        place = len(found)
    before = "".join(piece.text for piece in found[:place])
    gap = "" if not before or before.endswith("\n\n") else "\n" if before.endswith("\n") else "\n\n"
    return [*found[:place], Piece(gap + block), *found[place:]]


def _block(path: KeyPath, value: Mapping[str, Any], *, row: bool = False) -> str:
    """A table with its header; tables of tables and lists of tables in it have headers of their own."""
    written = ".".join(
        key_literal(part) for n, part in enumerate(path) if not (part.isdecimal() and _is_row(path, n, last_is_row=row))
    )
    lines, blocks = [f"[[{written}]]" if row else f"[{written}]"], list[str]()
    for name, item in value.items():
        inside = (*path, name)
        if isinstance(item, Mapping) and item and all(isinstance(one, Mapping) for one in item.values()):
            blocks += [_block((*inside, key), one) for key, one in item.items()]
        elif isinstance(item, list) and item and all(isinstance(one, Mapping) for one in item):
            blocks += [_block((*inside, str(n)), one, row=True) for n, one in enumerate(item)]
        else:
            lines.append(f"{key_literal(name)} = {literal(item)}")
    return "\n".join([*lines, ""]) + "".join("\n" + one for one in blocks)


def _is_row(path: KeyPath, n: int, *, last_is_row: bool) -> bool:
    """Whether part `n` of a path is the number of a row and not a name: in our files rows are those of steps, orders and tests."""
    if n == len(path) - 1:
        return last_is_row
    return n > 0 and path[n - 1] in ROWS


ROWS = frozenset({"steps", "orders", "tests", "when", "then"})


def _row(found: Sequence[Piece], path: KeyPath) -> range:
    place = span(found, path)
    if not place:
        raise CannotEdit(path)
    return place


def _joined(before: list[Piece], after: list[Piece]) -> list[Piece]:
    """Without what stood between them; of the empty lines around it one stays."""
    while after and before and not before[-1].text.strip() and not after[0].text.strip():
        after = after[1:]
    return [*before, *after]


def _lead(found: Sequence[Piece], header: int) -> int:
    """Where what belongs to a header begins: with its comments, but not with what the file says of itself at its top."""
    begin = header
    while begin > 0 and not found[begin - 1].path:
        begin -= 1
    if begin == 0:
        begin = header
        while begin > 0 and found[begin - 1].text.strip():
            begin -= 1
    while begin < header and not found[begin].text.strip():
        begin += 1
    return begin


def _with_value(line: str, value: Any) -> str:
    """`key = value` with another value and the comment that it has."""
    assigned = _ASSIGNED.match(line)
    assert assigned
    start = assigned.end()
    end, depth = start, 0
    for token in TOKEN.finditer(line, start):
        depth += {"open": 1, "close": -1}.get(token.lastgroup or "", 0)
        if (token[0].startswith("#") and not depth) or (token[0] == "\n" and not line[token.end() :].strip()):
            break
        if token[0].strip():
            end = token.end()
    indent = line[: len(line) - len(line.lstrip())]
    return f"{line[:start]} {literal(value, indent)}{line[end:]}"


def _logical_lines(text: str) -> list[str]:
    """Lines, those of one value together."""
    found, begin, depth = list[str](), 0, 0
    for token in TOKEN.finditer(text):
        if token.lastgroup == "open":
            depth += 1
        elif token.lastgroup == "close":
            depth = max(0, depth - 1)
        elif token[0] == "\n" and not depth:
            found.append(text[begin : token.end()])
            begin = token.end()
    if begin < len(text):
        found.append(text[begin:])
    return found


def split(dotted: str) -> KeyPath:
    """The parts of a key with dots, without their quotation marks."""
    return tuple(part.strip("\"'") for part in re.findall(r"""[^."'\s]+|"[^"]*"|'[^']*'""", dotted))


_SIGNS = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r", "\b": "\\b", "\f": "\\f"}


def _text(value: str) -> str:
    def sign(one: str) -> str:
        return _SIGNS.get(one) or (one if one.isprintable() or one == " " else f"\\U{ord(one):08X}")

    return '"' + "".join(sign(one) for one in value) + '"'
