"""TOML tables read with all their mistakes noted: file, line, key, value, what was expected."""

import difflib
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import date, time
from functools import cached_property
from itertools import islice
from pathlib import Path
from reprlib import Repr
from typing import Any, TypeGuard

from app.errors import MissingFile, UnusableFile
from app.files import read_text
from app.plant.file_words import file_words
from app.plant.problems import Problem
from app.plant.said import LONGEST as LONGEST_EXPECTED
from app.plant.said import Plain, Said, printable, said
from app.plant.toml import LARGEST_FILE, TomlRefused, parse
from app.plant.toml_text import headed, key_literal, literal, split

REQUIRED: Any = object()
MOST_PROBLEMS = 200
"""Mistakes of one reading that are told; of the rest, their number."""
STOP_AT = 1000
"""Mistakes in one file after which it is not worth reading on."""
LONGEST_SHOWN = 120
"""Of a value [characters]."""
LONGEST_LINE = 1000
"""Of a line in which a key is looked for [characters]."""
MOST_CHOICES = 40
"""Choices that one line lists."""
COMPARED = 1000
"""Choices among which the one that was perhaps meant is looked for."""
LARGEST = 1e100
"""Of a number, up or down: far beyond what any register says, and differences of such numbers, which pages draw, are finite."""


MISSING, NONE = said("mistake.missing"), said("mistake.none")


def meant_as_toml(folder: Path) -> list[Path]:
    """Everything in `folder` that somebody meant to be read, sorted; one that ends in .TOML is not, and should not be so in silence."""
    return sorted(path for path in folder.glob("*") if path.suffix.lower() == ".toml")


class Enough(Exception):
    """A file has so many mistakes, `problems`, that its reading was stopped."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__()
        self.problems = problems


class Source:
    """One TOML file and the problems found in it. Reading never raises; noting more than `STOP_AT` mistakes does (`Enough`).

    `inside`: links may not lead out of this folder. `draft`: what somebody would write in the file, read in its place.
    """

    def __init__(
        self, path: Path, name: str, *, optional: bool = False, inside: Path | None = None, draft: str | None = None
    ) -> None:
        self.name = name
        self.path = path
        self.problems: list[Problem] = []
        self.doubts: list[Problem] = []
        """What is no mistake and still seldom meant."""
        self.data: dict[str, Any] = {}
        self.unread = False
        """It is there and cannot be read, or is no TOML: `data` is empty, and `problems` say why."""
        self.written: Mapping[tuple[str, ...], str] = {}
        """Path of a key that a reader made of another one → that one, as it stands in the file."""
        self._lines: list[str] = []
        self._told_of: set[tuple[str, ...]] = set()
        """Keys of which a mistake is told."""
        try:
            text = read_text(path, LARGEST_FILE, inside=inside) if draft is None else draft
        except MissingFile as error:
            if not optional:
                self.note((), file_words(error.found), said("mistake.toml_file"))
            return
        except UnusableFile as error:
            self.note((), file_words(error.found), file_words(error.expected), line=error.line)
            self.unread = True
            return
        self._lines = text.splitlines()
        if not text.strip():
            if not optional:
                self.note((), said("mistake.empty_file"), said("mistake.toml_tables"))
            return
        try:
            self.data = parse(text)
        except TomlRefused as refused:
            self.note((), refused.found, refused.expected, line=refused.line or None)
            self.unread = True

    def note(self, path: Sequence[str], value: object, expected: str, *, line: int | None = None) -> None:
        """Remember a mistake at the key `path`, once; of a value that was taken in place of a wrong one nothing is told.

        Raises:
            Enough: it is one of very many.
        """
        given, problem = self._value(path), self._told(path, value, expected, line)
        instead = given is not None and str(given) != str(value) and tuple(path) in self._told_of
        if instead or problem in self.problems:
            return
        self._told_of.add(tuple(path))
        self.problems.append(problem)
        if len(self.problems) >= STOP_AT:
            raise Enough(self.problems)

    def doubt(self, path: Sequence[str], value: object, expected: str) -> None:
        """Remember what is taken as it is at the key `path`, and is seldom meant."""
        self.doubts.append(self._told(path, value, expected, None))

    def _told(self, path: Sequence[str], value: object, expected: str, line: int | None) -> Problem:
        key = printable(".".join(path) if path else "(file)", LONGEST_SHOWN)
        text = isinstance(value, str) and bool(path) and not isinstance(value, Plain)
        shown = f'"{value}"' if text else value if isinstance(value, str) else _SHORT.repr(value)
        place = line if line is not None else self.line(path)
        return Problem(self.name, key, printable(shown, LONGEST_SHOWN), printable(expected, LONGEST_EXPECTED), place)

    def _value(self, path: Sequence[str]) -> object:
        """What the file gives at `path`; None: nothing."""
        found: object = self.data
        for part in path:
            found = found.get(part) if isinstance(found, Mapping) else None
        return found

    def line(self, path: Sequence[str]) -> int | None:
        """The line (from 1) on which the key `path` stands, or the nearest table around it."""
        if not path or not self._lines:
            return None
        whole, begun = self._places
        wanted = tuple(self.written.get(tuple(path[: at + 1]), part) for at, part in enumerate(path))
        if wanted in begun:
            return begun[wanted]
        return next(
            (whole[wanted[:length]] for length in range(len(wanted) - 1, 0, -1) if wanted[:length] in whole), None
        )

    @cached_property
    def _places(self) -> tuple[dict[tuple[str, ...], int], dict[tuple[str, ...], int]]:
        """The first line of each key that is written out; and of each that such a key begins with."""
        whole: dict[tuple[str, ...], int] = {}
        begun: dict[tuple[str, ...], int] = {}
        table: tuple[str, ...] = ()
        counts: dict[tuple[str, ...], int] = {}
        for number, raw in enumerate(self._lines, 1):
            text = raw.strip()[:LONGEST_LINE]
            if header := re.match(r"^(\[{1,2})\s*+([^\]\s][^\]]*+)\]", text):
                found = table = headed(header[2], counts, row=header[1] == "[[")
            elif assignment := re.match(
                r"""^((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""", text
            ):
                found = (*table, *split(assignment[1]))
            else:
                continue
            whole.setdefault(found, number)  # of `[[steps]]`, a list, the first row is where it begins
            for length in range(1, len(found) + 1):
                begun.setdefault(found[:length], number)
        return whole, begun

    def table(self) -> "Table":
        """The whole file as a table."""
        return Table(self, (), self.data)


class Table:
    """A table whose keys are asked for one by one; `done` reports the keys nobody asked for."""

    def __init__(self, source: Source, path: tuple[str, ...], data: Mapping[str, Any]) -> None:
        self.source = source
        self.path = path
        self.data = data
        self._asked: set[str] = set()

    def note(self, key: str, value: object, expected: str) -> None:
        """Remember a mistake at `key` (empty: the table itself)."""
        self.source.note((*self.path, *key.split(".")) if key else self.path, value, expected)

    def doubt(self, key: str, value: object, expected: str) -> None:
        """Remember what is no mistake at `key` and seldom meant."""
        self.source.doubt((*self.path, *key.split(".")) if key else self.path, value, expected)

    def has(self, key: str) -> bool:
        """Whether the file gives `key`."""
        return key in self.data

    def raw(self, key: str, default: Any = None) -> Any:
        """What stands there, unchecked."""
        self._asked.add(key)
        return self.data.get(key, default)

    def text(
        self,
        key: str,
        default: Any = REQUIRED,
        *,
        choices: Iterable[str] | None = None,
        pattern: str = "",
        expected: str = "",
    ) -> str:
        """A text that is not empty, one of `choices`, or matching `pattern`."""
        value = self._value(key, default, expected or said("mistake.text"))
        if key not in self.data:
            return "" if value is REQUIRED or value is None else str(value)
        if choices is not None:
            wanted = list(choices)
            if value not in wanted:
                self.note(key, value, expected or one_of(wanted, value))
                return wanted[0] if default is REQUIRED and wanted else "" if default is REQUIRED else str(default)
            return str(value)
        if not isinstance(value, str) or not value.strip() or (pattern and not re.fullmatch(pattern, value)):
            self.note(key, value, expected or said("mistake.text"))
            return "" if default is REQUIRED else str(default)
        return value

    def number(self, key: str, default: Any = REQUIRED, low: float = -math.inf, high: float = math.inf) -> Any:
        """A finite number `low <= value <= high`, at most `LARGEST`; the default as it is when there is none."""
        expected = span("number", low, high)
        value = self._value(key, default, expected)
        if key not in self.data:
            return 0.0 if value is REQUIRED else value
        if not is_number(value):
            huge = isinstance(value, float) and math.isfinite(value)
            self.note(key, value, span("number", max(low, -LARGEST), min(high, LARGEST)) if huge else expected)
        elif not low <= value <= high:
            self.note(key, value, expected)
        else:
            return value
        return 0.0 if default is REQUIRED else default

    def whole(self, key: str, default: Any = REQUIRED, low: int = 0, high: int = 65535, expected: str = "") -> Any:
        """A whole number `low <= value <= high`."""
        expected = expected or span("whole", low, high)
        value = self._value(key, default, expected)
        if key not in self.data:
            return low if value is REQUIRED else value
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            self.note(key, value, expected)
            return low if default is REQUIRED else default
        return value

    def flag(self, key: str, default: bool = False) -> bool:
        """true or false."""
        value = self._value(key, default, said("mistake.flag"))
        if not isinstance(value, bool):
            self.note(key, value, said("mistake.flag"))
            return default
        return value

    def items(self, key: str, default: Any = REQUIRED, expected: str = "") -> list[Any]:
        """A list, unchecked inside."""
        expected = expected or said("mistake.list")
        value = self._value(key, default, expected)
        if key not in self.data:
            return [] if value is REQUIRED else list(value)
        if not isinstance(value, list):
            self.note(key, value, expected)
            return []
        return value

    def table(self, key: str, *, required: bool = False, expected: str = "") -> "Table":
        """The table at `key`; empty when there is none."""
        expected = expected or said("mistake.table")
        value = self._value(key, REQUIRED if required else {}, expected)
        if key not in self.data:
            value = {}
        if not isinstance(value, dict):
            self.note(key, value, expected)
            value = {}
        return Table(self.source, (*self.path, key), value)

    def tables(self, key: str = "", expected: str = "") -> Iterator[tuple[str, "Table"]]:
        """Name and table of each table under `key` (empty: of this table)."""
        parent = self.table(key) if key else self
        for name, value in parent.data.items():
            parent._asked.add(name)
            if isinstance(value, dict):
                yield name, Table(self.source, (*parent.path, name), value)
            else:
                parent.note(name, value, expected or said("mistake.table"))

    def rows(self, key: str) -> Iterator["Table"]:
        """Each table of a list of tables (`[[alarms]]`)."""
        for index, value in enumerate(self.items(key, [], said("mistake.list_of_tables", key=f"[[{key}]]"))):
            if isinstance(value, dict):
                yield Table(self.source, (*self.path, key, str(index)), value)
            else:
                self.note(f"{key}.{index}", value, said("mistake.table"))

    def done(self) -> None:
        """Report the keys that nobody asked for."""
        for key in self.data:
            if key not in self._asked:
                self.source.note(
                    (*self.path, key),
                    self.data[key],
                    said("mistake.no_such_key", known=one_of(sorted(self._asked), key)),
                )

    def _value(self, key: str, default: Any, expected: str) -> Any:
        self._asked.add(key)
        if key in self.data:
            return self.data[key]
        if default is REQUIRED:
            self.source.note((*self.path, key), MISSING, expected)
        return default


def read_label(
    table: Table, key: str, languages: Sequence[str], known: Sequence[str], *, required: bool = False, default: str = ""
) -> dict[str, str]:
    """A text for every language, or one for each: `{ hr = …, en = … }`. One that lacks a language is no mistake.

    `languages`: those of the plant; `known`: those of the product.
    """
    value = table.raw(key)
    expected = said("mistake.label", example="{ hr = …, en = … }")
    if value is None:
        if required:
            table.note(key, MISSING, expected)
        return dict.fromkeys(languages, default)
    if isinstance(value, str) and value.strip():
        return dict.fromkeys(languages, value)
    if not isinstance(value, dict) or not value:
        table.note(key, value, expected)
        return dict.fromkeys(languages, default)
    texts: dict[str, str] = {}
    for language, text in value.items():
        if language not in known:
            table.note(f"{key}.{language}", text, said("mistake.language", known=one_of(known, language)))
        elif not isinstance(text, str) or not text.strip():
            table.note(f"{key}.{language}", text, said("mistake.text"))
        else:
            texts[language] = text
    return texts


def is_number(value: object) -> TypeGuard[float]:
    """Whether `value` is a finite number that is no flag and at most `LARGEST`."""
    return isinstance(value, int | float) and not isinstance(value, bool) and -LARGEST <= value <= LARGEST


def one_of(choices: Sequence[str], value: object = "") -> Said:
    """`one of a, b`, with the choice that was perhaps meant; of very many the first."""
    shown = ", ".join(choices[:MOST_CHOICES]) or NONE
    more = said("mistake.and_more", number=len(choices) - MOST_CHOICES) if len(choices) > MOST_CHOICES else ""
    return said("mistake.one_of", choices=shown, more=more, near=near_to(choices, value))


def near_to(choices: Sequence[str], value: object) -> str:
    """The choice that was perhaps meant, as `perhaps` says it."""
    meant = str(value)[:LONGEST_SHOWN] if isinstance(value, str) else ""
    near = difflib.get_close_matches(meant, choices[:COMPARED], n=1) if meant else []
    return perhaps(near[0] if near else "")


def perhaps(near: str) -> str:
    """`(perhaps …)`, behind a blank; nothing where nothing is near."""
    return said("mistake.perhaps", near=near) if near else ""


def span(what: str, low: float, high: float) -> str:
    """`a number from 1 to 247`; `what`: number or whole (a whole number)."""
    if math.isinf(low) and math.isinf(high):
        return said(f"mistake.{what}")
    if math.isinf(high):
        return said(f"mistake.{what}_from", low=f"{low:g}")
    if math.isinf(low):
        return said(f"mistake.{what}_up_to", high=f"{high:g}")
    return said(f"mistake.{what}_between", low=f"{low:g}", high=f"{high:g}")


class _Short(Repr):
    """Of what a file may hold, no more than one line, as TOML writes it."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 4
        self.maxdict = self.maxlist = 12
        self.maxstring = self.maxother = LONGEST_SHOWN

    def repr_bool(self, x: bool, level: int) -> str:
        return literal(x)

    def repr_str(self, x: str, level: int) -> str:
        return literal(x if len(x) <= self.maxstring else x[: self.maxstring] + self.fillvalue)

    def repr_dict(self, x: dict[str, Any], level: int) -> str:
        shown = list(islice(x.items(), self.maxdict if level > 0 else 0))
        rows = [f"{key_literal(name)} = {self.repr1(item, level - 1)}" for name, item in shown]
        rows += [self.fillvalue] * (len(x) > len(shown))
        return f"{{ {', '.join(rows)} }}" if rows else "{}"

    def repr_instance(self, x: object, level: int) -> str:
        return literal(x) if isinstance(x, date | time) else super().repr_instance(x, level)


_SHORT = _Short()
