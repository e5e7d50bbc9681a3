"""How texts are set: quotation marks as each language has them, a sign of multiplication, courtesy in small letters."""

import re

import pytest

from tools.check_words import LANGUAGES, collect

TEXTS = collect()
QUOTES = {"en": "“”", "hr": "„”", "de": "„“", "cs": "„“"}


def said(language: str) -> dict[str, str]:
    """Every text of one language; those about plant files keep the marks that TOML has."""
    return {
        place: text[language] for place, text in TEXTS.items() if language in text and not place.startswith("mistake.")
    }


@pytest.mark.parametrize("language", LANGUAGES)
def test_quotation_marks_are_those_of_the_language(language: str) -> None:
    opening, closing = QUOTES[language]
    whole = re.compile(f'[^„“”"]*(?:{opening}[^„“”"]*{closing}[^„“”"]*)*')
    assert [(place, text) for place, text in said(language).items() if not whole.fullmatch(text)] == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_times_is_no_letter(language: str) -> None:
    assert [(place, text) for place, text in said(language).items() if re.search(r"\bx \d|\d x\b", text)] == []


@pytest.mark.parametrize(("language", "capital"), [("hr", r"V(?:i|as|am|aš\w*)"), ("cs", r"V(?:y|ás|ám|áš|aš\w*)")])
def test_whoever_is_addressed_has_a_small_letter_within_a_sentence(language: str, capital: str) -> None:
    within = re.compile(rf"[^.:?!„ –] {capital}\b")
    assert [(place, text) for place, text in said(language).items() if within.search(text)] == []
