"""What is said of a mistake in a plant file has words in every language, and is one line of English in a terminal."""

import ast
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from app.errors import ConfigurationError, UnusableFile
from app.files import read_text
from app.plant import expression
from app.plant import said as module
from app.plant.expression import PARSER as SENTENCES
from app.plant.file_words import WORDS, file_words
from app.plant.plant_files.languages import LANGUAGES
from app.plant.said import LONGEST, Said, in_words, printable, said, said_by
from app.plant.texts import Texts
from app.plant.toml import PARSER, TomlRefused, parse
from tests.conftest import ROOT

TEXTS = Texts.read()
READERS = [*sorted((ROOT / "app" / "plant").rglob("*.py")), ROOT / "app" / "sim" / "plant.py"]
"""Whose mistakes the page of the plant files tells."""


PLACES = {"note": 2, "_refused": 2, "_error": 2, "TomlRefused": 1, "_wrong": 1, "items": 2, "Problem": 3}
"""What tells a mistake → where among its arguments that begins which is said of what was expected."""
NAMES = ("expected", "EXPECTED", "ID_EXPECTED", "KEY_EXPECTED", "NAME_EXPECTED", "SPAN_EXPECTED")


def keys() -> list[str]:
    return list(module._english())


def spoken(lang: str, message: str) -> str:
    return in_words(partial(TEXTS.text, lang), message)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_mistake_has_a_text_in_every_language(language: str) -> None:
    for key in keys():
        names = set(re.findall(r"\{(\w+)\}", module._english()[key]))
        told = spoken(language, said(key, **{name: "~" for name in names}))
        assert told.count("~") == len(names), f"{key} in {language}: {told}"
        assert not told.startswith("["), f"{key} in {language}: {told}"
    inner = said("mistake.as_is", what=said("mistake.missing"))
    assert spoken(language, inner) == TEXTS.text(language, "mistake.missing")


def test_english_pages_say_what_the_terminal_says() -> None:
    for key in keys():
        message = said(key, **{name: "7" for name in re.findall(r"\{(\w+)\}", module._english()[key])})
        assert spoken("en", message) == str(message)


def literals(path: Path) -> Iterator[str]:
    """What a file says of a mistake in English alone: what `note` and its like are given as expected."""

    def plain(node: ast.expr) -> bool:
        if isinstance(node, ast.BinOp):
            return plain(node.left) or plain(node.right)
        if isinstance(node, ast.IfExp):
            return plain(node.body) or plain(node.orelse)
        parts = node.values if isinstance(node, ast.JoinedStr) else [node]
        texts = [part.value for part in parts if isinstance(part, ast.Constant) and isinstance(part.value, str)]
        return any(re.search("[A-Za-z] ?", text) for text in texts)

    for call in ast.walk(ast.parse(path.read_bytes())):
        if (
            isinstance(call, ast.Assign)
            and any(ast.unparse(one) in NAMES for one in call.targets)
            and plain(call.value)
        ):
            yield f"{path.name}:{call.lineno}: {ast.unparse(call.value)}"
        if not isinstance(call, ast.Call):
            continue
        name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
        told = [each.value for each in call.keywords if each.arg == "expected"]
        told += call.args[PLACES[name] :] if name in PLACES else []
        yield from (f"{path.name}:{one.lineno}: {ast.unparse(one)}" for one in told if plain(one))


@pytest.mark.sweep(8)
def test_nothing_of_it_is_english_alone() -> None:
    found = [one for path in READERS for one in literals(path)]
    assert found == []


@pytest.mark.parametrize(
    ("text", "german"),
    [
        ("a = ", "TOML (ungültiger Wert (am Ende der Datei))"),
        ("a 1", "TOML (nach dem Schlüssel fehlt '=' (Zeile 1, Spalte 3))"),
        ("a = [1", "TOML (eckige Klammer nicht geschlossen (am Ende der Datei))"),
        ('a = "x', "TOML (Text ohne schließendes Anführungszeichen (am Ende der Datei))"),
        ("a = 1\na = 2", "TOML (derselbe Schlüssel oder dieselbe Tabelle zweimal (am Ende der Datei))"),
        ("[[a]", "TOML (es fehlt ']]' (Zeile 1, Spalte))"),
        ("a = {b = 1}\n[a.c]", "TOML (derselbe Schlüssel oder dieselbe Tabelle zweimal (Zeile 2, Spalte))"),
        ('a = "\\q"', "TOML (ungültiges Zeichen nach '\\' im Text (Zeile 1, Spalte))"),
        ("[a]\n[a]\n", "TOML (derselbe Schlüssel oder dieselbe Tabelle zweimal (Zeile 2, Spalte 3))"),
    ],
)
def test_what_is_no_toml_is_told_in_the_language_too(text: str, german: str) -> None:
    with pytest.raises(TomlRefused) as refused:
        parse(text)
    told = spoken("de", refused.value.expected)
    assert re.sub(r"Spalte \d+", "Spalte", told) == re.sub(r"Spalte \d+", "Spalte", german)


def test_each_word_of_the_parsers_and_of_files_has_a_text() -> None:
    assert {f"mistake.{key}" for key in (*PARSER.values(), *SENTENCES.values(), *WORDS.values())} <= set(keys())


@pytest.mark.parametrize(
    ("sentence", "german"),
    [
        ("speed >", "ein Schreibfehler (ungültige Schreibweise)"),
        ("max(a b)", "ein Schreibfehler (ungültige Schreibweise; vielleicht fehlt ein Komma)"),
        ("(speed", "ein Schreibfehler ('(' wurde nie geschlossen)"),
        ("speed)", "ein Schreibfehler (')' ohne Gegenstück)"),
        ("1a > 2", "ein Schreibfehler (ungültig geschriebene Zahl)"),
        ("007 > 2", "ein Schreibfehler (eine Zahl darf nicht mit Nullen beginnen)"),
    ],
)
def test_what_is_no_sentence_is_told_in_the_language_too(sentence: str, german: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        expression.parse(sentence)
    assert german in spoken("de", refused.value.args[0])


def test_what_is_said_of_a_file_is_told_in_the_language_too(tmp_path: Path) -> None:
    (tmp_path / "large").write_bytes(b"x" * 10)
    (tmp_path / "odd").write_bytes(b"\xff")
    (tmp_path / "out").symlink_to("/etc/hostname")
    (tmp_path / "round").symlink_to(tmp_path / "round")
    for name, found, expected in (
        ("large", "10 Byte", "höchstens 9 Byte"),
        ("odd", "Byte 0xff", "Text in UTF-8"),
        ("out", "ein Link, der aus seinem Ordner hinausführt", f"eine gewöhnliche Datei in {tmp_path}"),
        ("round", "zu viele Ebenen symbolischer Links", "eine TOML-Datei"),
        (".", "ein Ordner", "eine TOML-Datei"),
    ):
        with pytest.raises(UnusableFile) as refused:
            read_text(tmp_path / name, 9, inside=tmp_path)
        told = [spoken("de", file_words(text)) for text in (refused.value.found, refused.value.expected)]
        assert told == [found, expected]
    assert file_words("anything else") == "anything else"


def test_what_is_cut_for_a_line_stays_a_text_of_ours() -> None:
    message = printable(said("mistake.text"), LONGEST)
    assert isinstance(message, Said) and spoken("hr", message) == "tekst"
    long = printable(said("mistake.step_of_file", keys="k\n" * LONGEST), LONGEST)
    assert len(long) <= LONGEST + 900 and "\n" not in long and "\n" not in spoken("cs", long)
    assert in_words(lambda key: "?", "a saying of somebody else") == "a saying of somebody else"


def test_a_type_brings_texts_of_its_own() -> None:
    texts = {"en": "more than {low} mm", "de": "mehr als {low} mm"}
    message = printable(said_by(texts, low="5"), LONGEST)
    assert message == "more than 5 mm"
    for language, told in (("en", message), ("de", "mehr als 5 mm"), ("hr", "[en] more than 5 mm")):
        assert in_words(partial(TEXTS.text, language), message, language) == told
        inner = said("mistake.needs", what="go", values=message)
        assert told in in_words(partial(TEXTS.text, language), inner, language)
    assert said_by({"de": "ja", "hr": "da"}) == "ja"
