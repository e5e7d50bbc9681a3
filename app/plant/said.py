"""What is said of a mistake in a plant file: in English as a terminal prints it, with its key and its values for a page in other languages.

The texts are `mistake.<key>` of the product (`app/locale/<lang>/mistake.toml`), or an equipment type brings them along; a value may be
such a text itself.
"""

from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from pathlib import Path

import tomli

ENGLISH = Path(__file__).resolve().parents[1] / "locale" / "en" / "mistake.toml"
LONGEST = 400
"""Of what was expected [characters]."""


class Plain(str):
    """A word of ours in place of a value: shown without quotation marks."""


class Said(Plain):
    """A text of ours in English, which knows how it is said in other languages."""

    key: str
    params: Mapping[str, object]
    own: Mapping[str, str]
    """Language → text of an equipment type, in place of the product's `key`; else empty."""


def said(key: str, /, **params: object) -> Said:
    """The text `key` with its values.

    Raises:
        KeyError: there is no such text.
    """
    return _made(_english()[key].format(**params), key, params, {})


def not_as(found: str, expected: str, key: str = "found_expected") -> Said:
    """`found: expected …` in one text."""
    return said(f"mistake.{key}", found=found, expected=expected)


def any_of(choices: Iterable[str]) -> Said:
    """`one of a, b`."""
    return said("mistake.one_of", choices=", ".join(choices), more="", near="")


def said_by(texts: Mapping[str, str], /, **params: object) -> Said:
    """A text that an equipment type has in these languages, English or the first of them for a terminal, with its values."""
    return _made(texts[_first(texts)].format(**params), "", params, texts)


def in_words(text: Callable[..., str], message: str, language: str = "en") -> str:
    """`message` as `text` (of the reader's `language`: key, values) says it; what is none of ours stays as it is."""
    if not isinstance(message, Said):
        return message
    if message.own:
        first = language if language in message.own else _first(message.own)
        told = message.own[first].format(**message.params)
        return printable(told if first == language else f"[{first}] {told}", LONGEST)
    values = {
        name: in_words(text, value, language) if isinstance(value, str) else value
        for name, value in message.params.items()
    }
    return printable(text(message.key, **values), LONGEST)


def printable(text: str, longest: int) -> str:
    """`text` on one line of a terminal, cut; a text of ours stays one."""
    cut = text if len(text) <= longest else text[: longest - 3] + "…"
    shown = "".join(sign if sign.isprintable() else f"\\x{ord(sign):02x}" for sign in cut)
    return _made(shown, text.key, text.params, text.own) if isinstance(text, Said) else shown


def _made(english: str, key: str, params: Mapping[str, object], own: Mapping[str, str]) -> Said:
    made = Said(english)
    made.key, made.params, made.own = key, params, own
    return made


def _first(texts: Mapping[str, str]) -> str:
    return "en" if "en" in texts else next(iter(texts))


@lru_cache(maxsize=1)
def _english() -> Mapping[str, str]:
    table = tomli.loads(ENGLISH.read_text("utf-8"))["mistake"]
    return {f"mistake.{key}": text for key, text in table.items()}
