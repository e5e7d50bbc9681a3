"""Whatever mistake a test of this folder provokes is told in words that every language of the product has."""

import re
from collections.abc import Iterator, Sequence

import pytest

from app.plant.plant_files.languages import LANGUAGES
from app.plant.said import Plain, Said
from app.plant.tables import Source


@pytest.fixture(autouse=True)
def no_mistake_is_english_alone(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What was expected, and a value that is a word of ours, is a `Said`, whose key test_said.py finds in every language."""
    found: set[str] = set()
    note = Source.note

    def noted(self: Source, path: Sequence[str], value: object, expected: str, *, line: int | None = None) -> None:
        found.update(english(expected) if re.search("[A-Za-z]", expected) else [])
        if isinstance(value, Plain) and re.search("[a-z] [a-z]", value):
            found.update(english(value))
        note(self, path, value, expected, line=line)

    monkeypatch.setattr(Source, "note", noted)
    yield
    assert sorted(found) == [], "expected said(…) of app/plant/said.py"


def english(text: str) -> list[str]:
    """`text` where it has no words in other languages."""
    if not isinstance(text, Said):
        return [text]
    return [] if text.key or set(LANGUAGES) <= set(text.own) else [f"{text} in {sorted(text.own)} only"]
