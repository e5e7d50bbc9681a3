"""A definition knows the permissives of each of its words."""

import pytest

from app.plant.sequence_definition import SequenceDefinition, SequencePermissive, SequenceStep


def permissive(key: str, bit: int) -> SequencePermissive:
    return SequencePermissive(key, bit, {}, "")


STEPS = tuple(SequenceStep(f"s{n}", {}, permissives=(permissive(f"p{n}", n),)) for n in (1, 2, 3))
DEFINITION = SequenceDefinition("t", {}, STEPS, abort=(permissive("stop", 4), permissive("doors", 9)))


@pytest.mark.parametrize(
    ("step", "keys"), [(0, ["stop", "doors"]), (1, ["p1"]), (3, ["p3"]), (4, []), (-1, []), (99, [])]
)
def test_word_0_is_that_of_the_abort_conditions_and_beyond_the_last_there_is_none(step: int, keys: list[str]) -> None:
    assert [one.key for one in DEFINITION.permissives(step)] == keys


@pytest.mark.parametrize(
    ("step", "bit", "key"), [(0, 4, "stop"), (0, 9, "doors"), (0, 0, None), (2, 2, "p2"), (2, 1, None), (9, 1, None)]
)
def test_a_bit_has_the_name_that_the_file_gives_it_or_none(step: int, bit: int, key: str | None) -> None:
    found = DEFINITION.permissive(step, bit)
    assert (found.key if found else None) == key
