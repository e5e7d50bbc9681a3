"""What the history keeps of a definition: names that stay when the plant file changes."""

from app.plant.kept import ABORT, Definition, Kept, kept
from app.plant.sequence_definition import SequenceDefinition, SequencePermissive, SequenceStep


def permissive(bit: int, key: str, value: str = "") -> SequencePermissive:
    return SequencePermissive(key, bit, {"en": key.title()}, "pressure > 80", value, True)


def definition(*, label: str = "Lift", when: float = 5.0) -> SequenceDefinition:
    steps = (
        SequenceStep("lower", {"en": "Lower"}, 0.5, when, True, (), (permissive(0, "down"),)),
        SequenceStep("lift", {"en": label}, 0.5, 60.0, True, (), (permissive(3, "pressure_ok", "pressure"),)),
    )
    return SequenceDefinition("stroke", {"en": "Stroke"}, steps, abort=(permissive(1, "guards"),))


def test_steps_and_bits_have_their_keys_and_unknown_ones_their_numbers() -> None:
    found = kept(definition())
    assert [found.part(number) for number in (0, 1, 2, 3)] == ["0", "lower", "lift", "3"]
    assert [found.bit(*place) for place in ((0, 1), (1, 0), (2, 3), (2, 4), (3, 0), (0, 9))] == [
        "abort.guards", "lower.down", "lift.pressure_ok", "lift.bit_4", "3.bit_0", "abort.bit_9",
    ]  # fmt: skip
    assert Kept().part(1) == "1" and Kept().bit(0, 2) == "abort.bit_2"


def test_the_same_text_has_the_same_id_and_another_label_another() -> None:
    one = kept(definition())
    assert kept(definition()).id == one.id and len(one.id) == 16
    assert kept(definition(label="Raise")).id != one.id
    assert kept(definition(when=9.0)).id == one.id, "times are no words of it"


def test_a_definition_that_was_kept_says_what_it_said() -> None:
    read = Definition(kept(definition()).text)
    assert (read.name, read.label) == ("stroke", {"en": "Stroke"})
    assert list(read.parts) == ["lower", "lift"] and read.part(2) == {"en": "Lift"}
    assert read.part(0) == read.part(3) == {}
    assert (read.key(2, 3), read.bit(2, 3), read.value(2, 3)) == ("lift.pressure_ok", {"en": "Pressure_Ok"}, "pressure")
    assert (read.key(0, 1), read.bit(0, 1), read.value(0, 1)) == (f"{ABORT}.guards", {"en": "Guards"}, "")


def test_what_was_not_kept_is_a_number() -> None:
    for read in (Definition(), Definition(kept(definition()).text)):
        assert read.key(9, 4) == "9.bit_4" and read.bit(9, 4) == {} and read.value(9, 4) == ""
