"""TOML within limits: what nobody writes by hand is refused before it costs time or memory, and in one line.

`tomli` alone takes minutes for keys of a hundred thousand parts, falls over at deep nesting, and over a number of five thousand digits.
"""

import re
from functools import lru_cache
from typing import Any

import tomli

from app.plant.said import said

LARGEST_FILE = 2 * 1024 * 1024
"""[bytes]"""
MOST_VALUES = 50_000
"""Keys and members of lists in one file."""
DEEPEST = 16
"""Lists and tables in each other, and parts of a dotted key."""
LONGEST_WORD = 200
"""Of a key or a number [characters]."""
LONGEST_TEXT = 4_000
"""Of one text [characters]."""
WHOLE_NUMBERS = range(-(2**63), 2**63)
"""As TOML promises them."""

_TEXT = r'''"""(?:[^"\\]|\\.|"(?!""))*+(?:"{3,5})?|\'\'\'(?:[^']|'(?!''))*+(?:'{3,5})?|"(?:[^"\\\n]|\\.)*+"?|'[^'\n]*+'?|\#[^\n]*+'''
"""A text or a comment; one that does not end goes to the end of its line or of all, as it would else be looked for at each of its signs."""
TOKEN = re.compile(
    _TEXT + r"|(?P<word>[\w+-]++)|(?P<open>[\[{])|(?P<close>[\]}])|(?P<count>[,=])|(?P<dot>\.)|[^\S\n]++|.", re.S
)
_TEXTS = re.compile(_TEXT, re.S)
_FLAT = re.compile(r"[^\[\]{}]++")
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff]")


PARSER = {
    "Invalid value": "parser_value",
    "Invalid statement": "parser_statement",
    "Expected '=' after a key": "parser_equals",
    "Expected newline or end of document": "parser_newline",
    "Expected ']'": "parser_bracket",
    "Unclosed array": "parser_array",
    "Unclosed inline table": "parser_inline",
    "Unterminated string": "parser_string",
    "Illegal character": "parser_character",
    "Found invalid character": "parser_character",
    "Invalid initial character for a key": "parser_key",
    "Cannot overwrite a value": "parser_twice",
    "Cannot declare": "parser_twice",
    "Duplicate inline table key": "parser_twice",
    "Invalid date or datetime": "parser_value",
    "Cannot mutate immutable namespace": "parser_twice",
    "Cannot redefine namespace": "parser_twice",
    "Expected ']]'": "parser_brackets",
    "Unescaped": "parser_escape",
    "Invalid hex value": "parser_hex",
    "Escaped character is not": "parser_scalar",
}
"""How what `tomli` says begins → the text of ours."""


class TomlRefused(Exception):
    """No TOML, or more of it than anybody writes: what was found, what was expected, on which line (from 1, 0 = unknown)."""

    def __init__(self, found: str, expected: str, line: int) -> None:
        super().__init__(f"{found}, expected {expected}")
        self.found = found
        self.expected = expected
        self.line = line


@lru_cache(maxsize=128)
def parse(text: str) -> dict[str, Any]:
    """The tables of `text`, which nobody changes: machines of one type, and a reload, read the same files again.

    Raises:
        TomlRefused: `text` is no TOML, or beyond the limits above.
    """
    if not is_plain(text):
        check_outline(text)
    try:
        tables = tomli.loads(text)
    except RecursionError as error:
        raise TomlRefused(said("mistake.tables_in_tables"), said("mistake.in_each_other", most=DEEPEST), 0) from error
    except ValueError as error:  # also of what Python makes of its numbers and times
        raise _not_toml(text, str(error)) from error
    _check_values(text, tables)
    return tables


def is_plain(text: str) -> bool:
    """`text` is certainly within the limits of its outline, as nearly every file is; seen without a look at its single words."""
    bare = _TEXTS.sub("", text)
    brackets = _FLAT.sub("", bare).replace("{", "[").replace("}", "]")
    for _ in range(DEEPEST):
        brackets = brackets.replace("[]", "")
    return not (
        brackets
        or bare.count(",") + bare.count("=") > MOST_VALUES
        or any(line.count(".") > DEEPEST for line in bare.split("\n"))
        or any(len(word) > LONGEST_WORD for word in bare.split())
    )


def check_outline(text: str) -> None:
    """One pass over the signs of `text`, before anything is built of them.

    Raises:
        TomlRefused: lists or tables too deep in each other, a key of too many parts, a word too long, too many values.
    """
    depth = dots = values = 0
    after_dot = False
    for token in TOKEN.finditer(text):
        kind = token.lastgroup
        if kind == "open":
            depth += 1
            if depth > DEEPEST:
                found, most = said("mistake.lists_in_lists"), said("mistake.in_each_other", most=DEEPEST)
                raise _refused(text, token.start(), found, most)
        elif kind == "close":
            depth = max(0, depth - 1)
        elif kind == "count":
            values += 1
        elif kind == "dot":
            dots += 1
            if dots > DEEPEST:
                raise _refused(text, token.start(), said("mistake.key_of_parts"), said("mistake.parts", most=DEEPEST))
            after_dot = True
            continue
        elif kind == "word" and token.end() - token.start() > LONGEST_WORD:
            what = said("mistake.long_word", length=token.end() - token.start())
            raise _refused(text, token.start(), what, said("mistake.characters", most=LONGEST_WORD))
        elif kind is None and not token[0].strip():
            continue  # around a dot may be spaces
        if not after_dot:
            dots = 0
        after_dot = False
    if values > MOST_VALUES:
        raise TomlRefused(said("mistake.values", number=values), said("mistake.in_one_file", most=MOST_VALUES), 0)


def _check_values(text: str, tables: dict[str, Any]) -> None:
    """What is TOML and yet nothing that a plant says."""
    rest: list[tuple[str, Any]] = list(tables.items())
    while rest:
        key, value = rest.pop()
        if _CONTROL.search(key) or len(key) > LONGEST_WORD:
            raise TomlRefused(said("mistake.odd_key"), said("mistake.letters", most=LONGEST_WORD), 0)
        if isinstance(value, dict):
            rest += value.items()
        elif isinstance(value, list):
            rest += ((key, item) for item in value)
        elif isinstance(value, str) and (len(value) > LONGEST_TEXT or (_CONTROL.search(value))):
            long = len(value) > LONGEST_TEXT
            what = said("mistake.long_text", key=key, length=len(value)) if long else said("mistake.odd_text", key=key)
            raise TomlRefused(what, said("mistake.printable", most=LONGEST_TEXT), _line_of(text, key))
        elif isinstance(value, int) and value not in WHOLE_NUMBERS:
            found = said("mistake.large_number", key=key, bits=value.bit_length())
            raise TomlRefused(found, said("mistake.whole_of_64"), _line_of(text, key))


def _not_toml(text: str, parser: str) -> TomlRefused:
    lines = text.split("\n")
    where = re.search(r"at line (\d+)", parser)
    line = int(where[1]) if where else len(lines)
    shown = lines[line - 1].strip() if 0 < line <= len(lines) else ""
    return TomlRefused(shown or said("mistake.end_of_file"), said("mistake.toml", why=_why(parser)), line)


def _why(parser: str) -> str:
    """What `tomli` said, as a text of ours where it is one of its common ones."""
    what, _, place = parser.partition(" (at ")
    known = next((key for begin, key in PARSER.items() if what.startswith(begin)), "")
    at = re.match(r"line (\d+), column (\d+)", place)
    where = said("mistake.at", line=at[1], column=at[2]) if at else said("mistake.at_end")
    return said(f"mistake.{known}", where=where) if known else parser


def _refused(text: str, position: int, found: str, expected: str) -> TomlRefused:
    return TomlRefused(found, expected, text.count("\n", 0, position) + 1)


def _line_of(text: str, key: str) -> int:
    """The first line that names `key`; 0 when it is written otherwise."""
    place = text.find(key)
    return text.count("\n", 0, place) + 1 if place >= 0 else 0
