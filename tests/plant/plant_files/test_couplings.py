"""Which machine a sequence uses: only one that can give what its definition asks for."""

from pathlib import Path

from app.plant.loader import read_plant
from app.plant.problems import Problem
from tests.plant.transport import (
    ALONE,
    OF_A_MACHINE,
    PLANT,
    STROKE,
    TYPES,
    changed,
    load,
    loaded,
    one,
    sequence,
    write_plant,
    write_types,
)


def test_repeated_sequences_have_repeated_machines(tmp_path: Path) -> None:
    many = PLANT.replace("unit = 21", "unit = 21\nrepeat = 3").replace("unit = 20", "unit = 50\nrepeat = 3")
    plant = loaded(tmp_path, many)
    assert [plant.equipment[f"seq1_0{n}"].machine for n in (1, 2, 3)] == ["p1_01", "p1_02", "p1_03"]
    shared = loaded(tmp_path, PLANT.replace("unit = 21", "unit = 21\nrepeat = 2"))
    assert [shared.equipment[f"seq1_0{n}"].machine for n in (1, 2)] == ["p1", "p1"]
    found = one(tmp_path, PLANT.replace("unit = 20", "unit = 50\nrepeat = 3"))
    assert found.key == "equipment.seq1.machine" and "p1 is repeated" in found.expected


def test_a_sequence_without_a_machine_needs_no_sentences(tmp_path: Path) -> None:
    plain = STROKE.partition("[[tests]]")[0].replace('when = "at_top == 1"\n', "")
    alone = OF_A_MACHINE.sub("", plain)
    item = sequence(tmp_path, ALONE, stroke=alone)
    assert item.machine == "" and item.sequence and item.sequence.steps[0].permissives[0].when == ""
    problem = one(tmp_path, stroke=plain)
    assert (problem.key, problem.value) == ("steps.0.permissives.0.when", "missing")
    assert problem.expected == "a sentence over points of p1 that says when it is there"
    words = alone + '[[tests]]\nname = "a"\ngiven = { word_2 = 0xFFFF }\nthen = [{ at = 1, expect = "state == 0" }]\n'
    assert sequence(tmp_path, ALONE, stroke=words).sequence
    assert "word_0, word_1, word_2" in one(tmp_path, ALONE, stroke=words.replace("word_2", "word_3")).expected


def test_a_forgotten_machine_is_told_where_nobody_else_evaluates_the_sentences(tmp_path: Path) -> None:
    plain = STROKE.partition("[[tests]]")[0]
    found = one(tmp_path, ALONE, stroke=plain)
    assert (found.file, found.key, found.value) == ("plant.toml", "equipment.seq1.machine", "missing")
    assert found.expected == (
        "the id of an equipment: only its machine gives steps.0.permissives.3.when and 6 more a meaning on a simulated link; "
        "else take them out of sequences/stroke.toml"
    )
    assert one(tmp_path, ALONE, stroke=STROKE) == found, "what its tests ask of the machine follows from it"
    _, problems = load(tmp_path, ALONE, stroke=changed('command = "start"', 'command = "stert"'))
    assert [problem.key for problem in problems] == [found.key, "tests.0.when.1.command"]
    bare = OF_A_MACHINE.sub("", plain)
    for line in ('actions = ["fly"]', '[steps.permissives.0]\nlabel = "A"\nvalue = "nix"'):
        rest = f'[[steps]]\nkey = "rest"\nlabel = "Rest"\n{line}\n[abort.0]'
        told = one(tmp_path, ALONE, stroke=bare.replace("[abort.0]", rest))
        assert told.key == "equipment.seq1.machine" and " and " not in told.expected, told


def test_of_a_real_plc_without_a_machine_the_sentences_say_what_its_program_does(tmp_path: Path) -> None:
    plain = STROKE.partition("[[tests]]")[0]
    real = ALONE.replace('type = "sequence"\nlink = "hall"', 'type = "sequence"\nlink = "real"')
    real += '[links.real]\ntransport = "tcp"\nhost = "10.0.0.1"\n'
    item = sequence(tmp_path, real, stroke=plain)
    assert item.machine == "" and item.sequence and item.sequence.steps[0].permissives[1].when == "pressure > 80"
    other = sequence(tmp_path, real, stroke=plain.replace("pressure > 80", "pressure > 90"))
    assert item.options["program"] != other.options["program"], "they are part of the program's check sum"
    assert one(tmp_path, real, stroke=plain.replace("pressure > 80", "pressure >")).key == "steps.0.permissives.3.when"


def test_a_machine_that_takes_no_actions_is_told(tmp_path: Path) -> None:
    device = TYPES["press"]["device.toml"].partition("[actions]")[0]

    def read(definition: str) -> list[Problem]:
        folder = write_plant(tmp_path, stroke=definition)
        return read_plant(folder, type_folder=write_types(tmp_path, press_device=device))[1]

    plain = STROKE.partition("[[tests]]")[0]
    (found,) = read(plain)
    assert (found.key, found.expected) == ("equipment.seq1.machine", "a machine that takes actions; press takes none")
    assert read(plain.replace('actions = ["lower"]', "").replace('actions = ["lift"]', "")) == []


def test_a_real_machine_has_no_simulated_sequence(tmp_path: Path) -> None:
    real = PLANT.replace('type = "press"\nlink = "hall"', 'type = "press"\nlink = "real"')
    real += '[links.real]\ntransport = "tcp"\nhost = "10.0.0.1"\n'
    assert one(tmp_path, real).expected == "a machine that is simulated like its sequence, or real like it"


def test_a_sequence_does_not_blame_a_machine_that_has_its_own_mistakes(tmp_path: Path) -> None:
    found = one(tmp_path, changed('type = "press"', 'type = "pres"', PLANT))
    assert found.key == "equipment.p1.type"
