"""Texts of a type by dotted key, in every language alike."""

import tomllib
from pathlib import Path

import pytest

from app.plant import types
from app.plant.type_files.texts import flatten


@pytest.mark.parametrize(
    ("table", "texts"),
    [
        ({}, {}),
        ({"type": "Fan"}, {"type": "Fan"}),
        ({"a": {"b": {"c": "x"}}, "d": "y"}, {"a.b.c": "x", "d": "y"}),
        ({"rows": {"one": "{n} row", "few": "{n} rows"}}, {"rows.one": "{n} row", "rows.few": "{n} rows"}),
        ({"a": {}, "n": 7}, {"n": "7"}),
    ],
)
def test_tables_become_dotted_keys(table: dict[str, object], texts: dict[str, str]) -> None:
    assert dict(flatten(table)) == texts


@pytest.mark.parametrize("name", types.names())
def test_the_languages_of_a_type_say_the_same_things(name: str) -> None:
    plural = {"zero", "one", "two", "few", "many", "other"}

    def keys(language: str) -> set[str]:
        text = (Path("app/equipment") / name / f"texts.{language}.toml").read_text()
        flat = dict(flatten(tomllib.loads(text)))
        return {key.rpartition(".")[0] if key.rpartition(".")[2] in plural else key for key in flat}

    english = keys("en")
    for language in ("hr", "de", "cs"):
        assert keys(language) == english, language
