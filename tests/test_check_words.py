"""The glossary: a second word for one thing is found in every language and every form, what is excused is excused for a reason."""

import tomllib

import pytest

from tools import check_words
from tools.check_words import GLOSSARY, collect, main, read_glossary, two_words

ENTRIES, WRONG = read_glossary(tomllib.loads(GLOSSARY.read_text("utf-8")))
TEXTS = collect()


def found(place: str, language: str, text: str) -> list[str]:
    planted = {place: {**TEXTS[place], language: text}}
    return [problem for problem in two_words(planted, ENTRIES) if problem.startswith(place)]


@pytest.mark.sweep(8)
def test_the_house_has_one_word_for_one_thing() -> None:
    assert WRONG == [] and main() == 0


def test_texts_of_all_kinds_are_looked_at() -> None:
    kinds = (
        "alarm.list",
        "conveyor.help.what",
        "app/equipment/conveyor/lessons/conveyor.toml lesson.title",
        "plants/demo/plant.toml plant.name",
    )
    assert [set(TEXTS[place]) for place in kinds] == [{"en", "hr", "de", "cs"}] * 4
    assert any(place.startswith("plants/demo/sequences/") for place in TEXTS)


@pytest.mark.parametrize(
    ("place", "language", "text"),
    [
        ("conveyor.screen.fact.unloaded", "en", "Unloaded"),
        ("conveyor.screen.fact.unloaded", "hr", "Izašlo"),
        ("conveyor.screen.fact.unloaded", "de", "Entladen"),
        ("conveyor.screen.fact.unloaded", "cs", "Vyloženo"),
        ("conveyor.screen.first.22", "hr", "Zaustavilo isklapanje u nuždi"),
        ("conveyor.event.encoder_ok", "cs", "Snímač otáček opět pracuje"),
        (
            "sequence.alarm.aborted.response",
            "de",
            "Erstmeldung und Maschine ansehen. Erst quittieren, dann in Grundstellung bringen.",
        ),
        ("why.no_such_command", "cs", "Takový stroj nebo příkaz neexistuje"),
        ("communication.trouble", "hr", "Pogreške"),
        ("epos.command.jog_plus", "hr", "Koračno +"),
        ("editor.mistakes", "hr", "pogrešaka"),
        ("crane.point.hoist_upper_slow", "de", "Hubwerk: oberer Endschalter Langsamfahrt"),
        ("selftest.port.free", "hr", "mrežna vrata {address} su slobodna"),
        ("conveyor.event.power_up", "cs", "PLC zapnut"),
    ],
)
def test_a_planted_second_word_is_found(place: str, language: str, text: str) -> None:
    assert found(place, language, TEXTS[place][language]) == []
    assert [
        problem
        for problem in found(place, language, text)
        if f"{place}: {language} says '" in problem and repr(text) in problem
    ]


@pytest.mark.parametrize(
    ("place", "language", "text"),
    [
        ("conveyor.event.encoder_ok", "hr", "Brojač impulsa opet radi"),
        ("coil_car.event.guard_opened", "de", "Schutztür geöffnet"),
        ("alarm.answer.shelved", "cs", "Schováno: {text}"),
        ("fbuf.title", "de", "Fehlerspeicher"),
    ],
)
def test_a_word_that_nobody_thought_of_is_found_beside_the_english_one(place: str, language: str, text: str) -> None:
    (problem,) = found(place, language, text)
    assert f"{place}: {language} says none of" in problem


def test_inflected_and_compound_forms_are_the_same_word() -> None:
    for language, text in {"hr": "Bez enkodera", "de": "Ohne Absolutwertgebers", "cs": "Bez snímačů polohy"}.items():
        assert found("conveyor.event.encoder_ok", language, text) == []


def test_an_excuse_that_excuses_nothing_and_a_wrong_entry_are_told() -> None:
    entries, problems = read_glossary(
        {
            "encoder": {"en": "encoder", "hr": "enkoder", "de": "Drehgeber", "stem": {}},
            "brake": {
                "en": "brake",
                "hr": "k",
                "de": "b",
                "cs": "b",
                "except": [{"text": "a.*", "language": "hr", "why": ""}],
            },
        }
    )
    assert len(problems) == 3
    assert (
        "[encoder] has ['stem']" in problems[0]
        and "[encoder] lacks the word in ['cs']" in problems[1]
        and "[brake]" in problems[2]
    )
    assert list(two_words({}, entries)) == [
        f"{GLOSSARY.relative_to(check_words.ROOT)}: [brake] excuses ('a.*', 'hr'), which needs no excuse"
    ]
