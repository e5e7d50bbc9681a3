"""Every key that the gate can say exists in every language, and every text is one that it can say."""

import re
import string
import tomllib
from pathlib import Path

import pytest

from app.commands.hold import CAUSES
from app.commands.lifecycle import ProgressState
from app.plant.type_files.texts import flatten
from tests.commands.stand import ROOT

LANGUAGES = ("hr", "en", "de", "cs")
SOURCES = [path.read_text("utf-8") for room in ("commands", "running") for path in (ROOT / "app" / room).glob("*.py")]


def texts(language: str) -> dict[str, str]:
    path = Path(ROOT / "app" / "locale" / language / "commands.toml")
    return dict(flatten(tomllib.loads(path.read_text("utf-8"))))


def said() -> set[str]:
    keys = {key for source in SOURCES for key in re.findall(r'"((?:why|ask|hold)\.[a-z_]+)"', source)}
    causes = {found for source in SOURCES for found in re.findall(r'(?:end|drop)\([\w.]+, "([a-z_]+)"', source)}
    causes |= {found for source in SOURCES for found in re.findall(r'return "([a-z]+)"', source)} & {
        "reload", "token", "values", "permissive"
    }  # fmt: skip
    causes |= CAUSES | {"session", "fault", "unconfirmed"}
    return keys | {f"fb.{state}" for state in ProgressState} | {f"hold.cause.{cause}" for cause in causes}


@pytest.mark.parametrize("language", LANGUAGES)
def test_everything_the_gate_says_has_a_text(language: str) -> None:
    assert said() - set(texts(language)) == set()


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_text_has_the_same_places_in_every_language(language: str) -> None:
    def places(text: str) -> set[str | None]:
        return {name for _, name, _, _ in string.Formatter().parse(text) if name}

    english, other = texts("en"), texts(language)
    assert {key: places(text) for key, text in english.items()} == {key: places(text) for key, text in other.items()}


def test_no_reason_is_left_over() -> None:
    unsaid = {key for key in texts("en") if key.startswith("why.")} - said()
    assert unsaid == {"why.title"}
