"""Every condition is told by what holds while it is met, and by what is wrong while it is not, in every language."""

from pathlib import Path

import pytest

from app.plant import types
from app.plant.loader import read_plant

LANGUAGES = ("en", "hr", "de", "cs")
TYPES = sorted(folder.parent.name for folder in Path("app/equipment").glob("*/device.toml"))
SEQUENCES = sorted(file.parent.parent for file in Path("plants").glob("*/sequences/*.toml"))


@pytest.mark.sweep(8)
@pytest.mark.parametrize("name", TYPES)
def test_every_condition_of_a_type_has_a_text_for_what_holds_and_one_for_what_is_missing(name: str) -> None:
    type = types.read_type(name, LANGUAGES)[0].type
    conditions = [*type.permissives, *type.interlocks]
    for condition in conditions:
        for language in LANGUAGES:
            texts = type.texts[language]
            assert condition.missing and texts[condition.missing], (
                f"{name}: {condition.label} has no text for what is missing"
            )
            assert texts[condition.missing] != texts[condition.label], (
                f"{name}: {condition.label} says the same of both in {language}"
            )


@pytest.mark.sweep(8)
def test_there_are_conditions() -> None:
    assert sum(len(types.read_type(name, LANGUAGES)[0].type.permissives) for name in TYPES) > 50


@pytest.mark.parametrize("folder", sorted(set(SEQUENCES)), ids=lambda folder: folder.name)
def test_every_condition_of_a_sequence_that_we_ship_says_what_is_so_while_it_is_not_met(folder: Path) -> None:
    plant, problems = read_plant(folder)
    assert plant and not problems
    for item in plant.equipment.values():
        definition = item.sequence
        for one in (
            [*definition.abort, *(bit for step in definition.steps for bit in step.permissives)] if definition else ()
        ):
            assert set(one.missing) == set(one.label) == set(LANGUAGES), f"{folder.name}: {one.key}"
            assert all(one.missing[language] != one.label[language] for language in LANGUAGES)
