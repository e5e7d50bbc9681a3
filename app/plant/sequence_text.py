"""The definition file of a sequence as an editor sees it: its sections, and what a form over one of them changes in the text.

A section is what stands together in the file: the head with the abort conditions (0), each step (1 …), what follows the last step
(`tests`). A form names its fields as the file does, from the step on (`minimum`, `label.hr`, `permissives.3.when`,
`orders.0.values.frequency`); in the head from the outside (`sequence.stall_after`, `abort.0.when`). Keys that no field names stay as they
are in the text.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.plant.sequences import ABORT
from app.plant.toml_text import Change, KeyPath, Put, Rename, pieces, span

STEPS = "steps"
TESTS = "tests"
"""The section behind the last step."""
LARGEST_TEXT = 512 * 1024
"""Of a definition that is edited [bytes]."""
NUMBERS = frozenset({"minimum", "maximum", "stall_after", "longest_force", "default", "decimals", "times"})
VALUES = "values"
"""Of an order."""
LISTS = frozenset({"paths"})
"""Keys that hold several names, which a field shows with commas between."""
ROWS = ("recipe", "branches", "loops")
"""Lists of tables of the whole sequence that a form over the head has."""
FLAGS = frozenset({"loss_aborts", "forceable", "output_while_suspended", "keep_forces"})
HEAD_TABLE = "sequence"
"""Of the whole sequence."""
HEAD = (
    "output_while_suspended",
    "stall_after",
    "keep_forces",
    "longest_force",
    "start_when",
    "suspend_when",
    "advance_when",
    "abort_to",
)
"""Keys of `[sequence]` that a form has, beside its label."""
STEP = ("key", "label", "minimum", "maximum", "loss_aborts", "actions", "orders", "permissives")
"""Keys of a step that a form has; others are told and left to the text."""


@dataclass(frozen=True, slots=True)
class Section:
    """A part of the text."""

    key: str
    """`0`, the number of a step, or `tests`."""
    text: str
    line: int
    """Its first one, from 1."""

    @property
    def last(self) -> int:
        """Its last line."""
        return self.line + max(self.text.count("\n") - (1 if self.text.endswith("\n") else 0), 0)


def sections(text: str) -> list[Section]:
    """The sections of `text` in their order; together they are the text."""
    found = pieces(text)
    rows = [n for n, piece in enumerate(found) if piece.row and piece.path[:-1] == (STEPS,)]
    starts = [span(found, found[n].path) for n in rows]
    cuts = [0, *(place.start for place in starts)]
    if starts:
        cuts.append(starts[-1].stop)
    parts, line = list[Section](), 1
    for number, begin in enumerate(cuts):
        end = cuts[number + 1] if number + 1 < len(cuts) else len(found)
        part = "".join(piece.text for piece in found[begin:end])
        parts.append(Section(str(number) if number <= len(rows) else TESTS, part, line))
        line += part.count("\n")
    if not starts:
        parts.append(Section(TESTS, "", line))
    return parts


def with_section(text: str, key: str, written: str) -> str:
    """`text` with `written` in place of the section `key`.

    Raises:
        LookupError: there is no such section.
    """
    parts = sections(text)
    if key not in [part.key for part in parts]:
        raise LookupError(key)
    written = written.replace("\r\n", "\n")
    if written and not written.endswith("\n"):
        written += "\n"
    return "".join(written if part.key == key else part.text for part in parts)


def table_of(data: Mapping[str, Any], section: str) -> Mapping[str, Any]:
    """The table that a form over `section` shows; the whole file for the head.

    Raises:
        LookupError: there is no such step.
    """
    if section == "0":
        return data
    rows = data.get(STEPS, [])
    if not _counted(section) or not isinstance(rows, list) or not 0 < int(section) <= len(rows):
        raise LookupError(section)
    row = rows[int(section) - 1]
    if not isinstance(row, Mapping):
        raise LookupError(section)
    return row


def above(section: str) -> KeyPath:
    """The path of the table of `section`."""
    return () if section == "0" else (STEPS, str(int(section) - 1))


def number_of(text: str) -> float | str:
    """A number as people write it; what is none stays a text, which the check then names."""
    plain = text.strip().replace(",", ".").replace("\u2212", "-")
    if not re.fullmatch(r"[+-]?\d{1,15}(\.\d{1,9})?", plain):
        return text
    value = float(plain)
    return int(value) if value.is_integer() else value


def changes(
    data: Mapping[str, Any], section: str, given: Mapping[str, str], shown: Collection[str], languages: Sequence[str]
) -> list[Change]:
    """What the fields `given` of a form over `section` change. `shown`: fields that are boxes to tick; those not given are not ticked.

    Raises:
        LookupError: there is no such section, or a field of something that is not there.
    """
    table, base = table_of(data, section), above(section)
    found: list[Change] = []
    flags = {name: name in given for name in shown}
    labels: dict[KeyPath, dict[str, str]] = {}
    values: dict[KeyPath, dict[str, str]] = {}
    actions: dict[str, bool] = {}
    for name, value in [*((key, text) for key, text in given.items() if key not in flags), *flags.items()]:
        path = tuple(name.split("."))
        if path[0] == "actions" and len(path) == 2:
            actions[path[1]] = bool(value)
        elif len(path) > 1 and path[-2] == "label":
            labels.setdefault(path[:-1], {})[path[-1]] = str(value)
        elif len(path) > 1 and path[-2] == VALUES:
            values.setdefault(path[:-1], {})[path[-1]] = str(value)
        elif path[-1] == "bit":
            found += _moved(table, base, path, str(value))
        elif (change := _changed(table, base, path, value)) is not None:
            found.append(change)
    for path, texts in labels.items():
        if (change := _relabelled(table, base, path, texts, languages)) is not None:
            found.insert(0, change)
    for path, numbers in values.items():
        if (change := _revalued(table, base, path, numbers)) is not None:
            found.append(change)
    if actions:
        before = table.get("actions", [])
        kept = (
            [one for one in before if not isinstance(one, str) or actions.get(one, True)]
            if isinstance(before, list)
            else []
        )
        after = [*kept, *(name for name, on in actions.items() if on and name not in kept)]
        if after != before:
            found.append(Put((*base, "actions"), after or None))
    # a permissive that gets another bit goes last: its fields are named by the one that it has
    return sorted(found, key=lambda one: isinstance(one, Rename))


def free_bit(table: Mapping[str, Any], section: str) -> int | None:
    """The lowest bit that nobody names; None = all 16 are named."""
    word = table.get(ABORT if section == "0" else "permissives", {})
    return next((bit for bit in range(16) if not isinstance(word, Mapping) or str(bit) not in word), None)


def free_key(taken: Collection[str], wanted: str) -> str:
    """`wanted` as a key, with a number if there is one already."""
    key = re.sub(r"[^a-z0-9]+", "_", wanted.lower()).strip("_")[:24] or "step"
    key = key if key[0].isalpha() else f"k_{key}"
    return next(one for one in (key, *(f"{key}_{n}" for n in range(2, 1000))) if one not in taken)


def unnamed(table: Mapping[str, Any], section: str) -> list[str]:
    """Keys that no form has: they are in the text alone."""
    if section == "0":
        head = table.get("sequence", {})
        own = [f"sequence.{key}" for key in head if key not in (*HEAD, "label")] if isinstance(head, Mapping) else []
        return [*own, *(key for key in table if key not in ("sequence", STEPS, ABORT, TESTS, *ROWS))]
    return [key for key in table if key not in STEP]


def mask(word: object) -> int:
    """The bits that a word of permissives names."""
    bits = [int(bit) for bit in word if _counted(str(bit))] if isinstance(word, Mapping) else []
    return sum(1 << bit for bit in set(bits) if bit < 16)


def _changed(table: Mapping[str, Any], base: KeyPath, path: KeyPath, value: object) -> Change | None:
    parent = _at(table, path[:-1])
    before = parent.get(path[-1]) if isinstance(parent, Mapping) else None
    after: object = value
    if path[-1] in FLAGS and not isinstance(value, str):
        default = path[-1] == "forceable" and path[0] != ABORT
        if (before if isinstance(before, bool) else default) == value:
            return None
    elif path[-1] in NUMBERS:
        after = number_of(str(value)) if str(value).strip() else None
    elif path[-1] in LISTS:
        after = [name for one in str(value).split(",") if (name := one.strip())] or None
    else:
        after = str(value).replace("\r\n", " ").strip() or None
    return Put((*base, *path), after) if after != before else None


def _relabelled(
    table: Mapping[str, Any], base: KeyPath, path: KeyPath, texts: Mapping[str, str], languages: Sequence[str]
) -> Change | None:
    parent = _at(table, path[:-1])
    before = parent.get(path[-1]) if isinstance(parent, Mapping) else None
    was = dict.fromkeys(languages, before) if isinstance(before, str) else _table(before)
    now = {**was, **{language: text.strip() for language, text in texts.items()}}
    now = {language: text for language, text in now.items() if text}
    return None if now == was else Put((*base, *path), now or None)


def _revalued(table: Mapping[str, Any], base: KeyPath, path: KeyPath, given: Mapping[str, str]) -> Change | None:
    """The values of an order stand in one line as a rule, and are written anew as a whole."""
    was = _table(_at(table, path))
    now = {**was, **{name: number_of(text) if text.strip() else None for name, text in given.items()}}
    now = {name: value for name, value in now.items() if value is not None}
    return None if now == was else Put((*base, *path), now or None)


def _moved(table: Mapping[str, Any], base: KeyPath, path: KeyPath, value: str) -> Iterator[Change]:
    """A permissive has another bit: the table under it gets another number."""
    old, new = path[-2], value.strip()
    word = _at(table, path[:-2])
    if new == old or not isinstance(word, Mapping) or old not in word or new in word or not _counted(new):
        return
    yield Rename((*base, *path[:-1]), new)


def _counted(text: str) -> bool:
    """Whether `text` is a number of a row."""
    return text.isascii() and text.isdecimal() and len(text) < 6


def _table(value: object) -> dict[str, Any]:
    return dict(value) if isinstance(value, Mapping) else {}


def _at(table: Mapping[str, Any], path: KeyPath) -> Any:
    at: Any = table
    for key in path:
        if isinstance(at, list):
            if not _counted(key) or int(key) >= len(at):
                raise LookupError(".".join(path))
            at = at[int(key)]
        elif isinstance(at, Mapping) and (key in at or key in ("values", "sequence", "label")):
            at = at.get(key, {})
        else:
            raise LookupError(".".join(path))
    return at
