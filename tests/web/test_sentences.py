"""Sentences of the grammar as people read them."""

from types import SimpleNamespace

import pytest

from app.plant import expression
from app.web.sentences import told

WORDS = {
    "sentence.and": "and", "sentence.or": "or", "sentence.not": "not ({what})",
    "sentence.good": "{what}: value good", "sentence.bad": "{what}: value bad", "sentence.age": "age of {what}, s",
}  # fmt: skip
POINTS = {
    "guard_1": ("Guard 1", SimpleNamespace(texts={"0": "Open", "1": "Closed"}, decimals=0, unit="")),
    "mandrel": ("Mandrel", SimpleNamespace(texts={"0": "Collapsed", "2": "Expanded"}, decimals=0, unit="")),
    "pressure": ("Pressure", SimpleNamespace(texts={}, decimals=1, unit="bar")),
    "least_pressure": ("Least pressure", SimpleNamespace(texts={}, decimals=1, unit="bar")),
    "m1.speed": ("Fan 1 · Speed", SimpleNamespace(texts={}, decimals=0, unit="rpm")),
}


@pytest.mark.parametrize(
    ("sentence", "words"),
    [
        ("", ""),
        ("guard_1 == 1", "Guard 1: Closed"),
        ("guard_1 != 1", "Guard 1 ≠ Closed"),
        ("guard_1", "Guard 1: Closed"),
        ("not guard_1", "not (Guard 1: Closed)"),
        ("pressure > 80", "Pressure > 80.0\xa0bar"),
        ("pressure >= least_pressure", "Pressure ≥ Least pressure"),
        ("pressure > -1.5", "Pressure > −1.5\xa0bar"),
        ("10 < pressure <= 2 * least_pressure", "10.0\xa0bar < Pressure ≤ 2 × Least pressure"),
        ("mandrel in (0, 2)", "Mandrel: Collapsed / Expanded"),
        ("mandrel not in (0, 2)", "not (Mandrel: Collapsed / Expanded)"),
        (
            "guard_1 == 1 and (mandrel == 2 or pressure > 80)",
            "Guard 1: Closed and (Mandrel: Expanded or Pressure > 80.0\xa0bar)",
        ),
        ("abs(m1.speed) < 5 and good(pressure)", "|Fan 1 · Speed| < 5 and Pressure: value good"),
        ("age(pressure) > 3 or max(pressure, 2) == 4", "age of Pressure, s > 3 or max(Pressure; 2) = 4"),
    ],
)
def test_names_stand_for_points_and_words_for_numbers(sentence: str, words: str) -> None:
    if sentence:
        expression.parse(sentence, machines=True)

    def text(key: str, **params: str) -> str:
        return WORDS[key].format(**params)

    assert told(sentence, lambda name: POINTS.get(name, (name, None)), text, "en") == words  # type: ignore[arg-type,return-value]
