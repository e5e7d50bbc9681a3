"""A sequence is a file of the plant: what it says is read, every mistake in it is told, its texts come in the person's language."""

import shutil
from dataclasses import replace
from pathlib import Path
from time import process_time

import pytest

from app.plant.loader import read_plant
from app.plant.sequence_definition import SequencePermissive
from app.plant.sequences import canonical, checksum, program, unused
from app.plant.texts import Texts
from app.plant.type_files.options import MOST_STEPS
from tests.plant.transport import (
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

# ---- what a file says ---------------------------------------------------------------------------------


def test_a_sequence_is_read_with_its_machine(tmp_path: Path) -> None:
    item = sequence(tmp_path)
    assert item.sequence is not None
    assert (item.machine, item.sequence.name, item.sequence.stall_after) == ("p1", "stroke", 2.0)
    lower, lift = item.sequence.steps
    assert (lower.key, lower.minimum, lower.maximum, lower.loss_aborts, lower.actions) == (
        "lower",
        1.0,
        30.0,
        True,
        ("lower",),
    )
    assert (lift.minimum, lift.maximum, lift.loss_aborts) == (0, 0, False)
    assert [each.bit for each in lower.permissives] == [0, 3], "in order of the bits, not of the file"
    assert lower.permissives[1] == SequencePermissive(
        "pressure_ok", 3, lower.permissives[1].label, "pressure > 80", "pressure", True
    )
    assert (lower.permissives[0].key, lower.permissives[0].forceable) == ("bit_0", False)


def test_an_abort_condition_may_be_forced_only_where_the_file_says_so(tmp_path: Path) -> None:
    plain = sequence(tmp_path).sequence
    told = sequence(tmp_path, stroke=changed("[abort.0]", "[abort.0]\nforceable = true")).sequence
    assert plain and told
    assert [each.forceable for each in (*plain.abort, *told.abort)] == [False, True]


def test_a_word_knows_which_bits_are_named(tmp_path: Path) -> None:
    definition = sequence(tmp_path).sequence
    assert definition
    assert [each.key for each in definition.permissives(0)] == ["pressure_there"]
    found = definition.permissive(1, 3)
    assert found and found.key == "pressure_ok"
    assert definition.permissive(1, 4) is None and definition.permissive(3, 0) is None
    assert definition.permissives(-1) == ()


def test_the_table_of_steps_has_a_row_for_each_step(tmp_path: Path) -> None:
    item = sequence(tmp_path)
    assert (item.options["steps"], item.tables, item.points["step"].high) == (2.0, {"step": 2}, 2.0)
    assert "step_2_word_4" in item.points and "step_3_word_4" not in item.points
    longer = sequence(tmp_path, stroke=changed("[abort.0]", '[[steps]]\nkey = "rest"\nlabel = "Rest"\n[abort.0]'))
    assert longer.tables == {"step": 3} and longer.points["step"].high == 3.0


def test_the_orders_of_a_test_stand_in_order_of_time(tmp_path: Path) -> None:
    definition = sequence(tmp_path).sequence
    assert definition
    (test,) = definition.tests
    assert (test.name, test.given) == ("one stroke", {"pressure": 100.0, "coil": 1.0})
    assert list(test.when) == [
        {"at": 0.0, "command": "start"},
        {"at": 9.0, "fault": 3},
        {"at": 11.0, "command": "force", "arguments": {"bit": 3.0}},
        {"at": 15.0, "set": {"pressure": 20.0}},
    ]
    assert test.then[1] == {"within": 30.0, "step": "lift"} and test.then[2] == {"never": "pressure > 300"}


def test_several_machines_share_a_definition(tmp_path: Path) -> None:
    more = """
[equipment.seq2]
type = "sequence"
link = "hall"
unit = 31
definition = "stroke"
machine = "p2"
[equipment.p2]
type = "press"
link = "hall"
unit = 30
"""
    plant = loaded(tmp_path, PLANT + more)
    one, other = plant.equipment["seq1"], plant.equipment["seq2"]
    assert one.sequence is other.sequence and (one.machine, other.machine) == ("p1", "p2")


def test_a_sequence_without_a_label_is_called_like_its_definition(tmp_path: Path) -> None:
    assert sequence(tmp_path).label == {"hr": "Stroke", "en": "Stroke"}
    plain = sequence(tmp_path, changed('label = "Stroke"\n', "", PLANT))
    assert plain.label == {"hr": "Hod", "en": "Stroke", "de": "Hub", "cs": "Zdvih"}


def test_labels_come_in_the_language_of_the_person_or_with_its_mark(tmp_path: Path) -> None:
    plant = loaded(tmp_path)
    texts, item = Texts({}, plant), plant.equipment["seq1"]
    assert (texts.step("hr", item, 1), texts.step("de", item, 1)) == ("Spusti", "Senken")
    assert texts.permissive("cs", item, 1, 3) == "Tlak v pořádku"
    assert texts.permissive("hr", item, 1, 0) == "[en] At the top"
    assert texts.permissive("en", item, 0, 0) == "Pressure is there"
    assert texts.step("en", item, 2) == "Lift", "one text counts for every language of the plant"
    assert [texts.step("en", item, n) for n in (0, 3, -1)] == ["", "", ""]
    assert texts.permissive("en", item, 1, 9) == "" == texts.step("en", plant.equipment["p1"], 1)


def test_the_check_sum_is_of_the_program_and_not_of_its_words(tmp_path: Path) -> None:
    first = sequence(tmp_path).sequence
    assert first
    worded = sequence(tmp_path, stroke=STROKE.replace("Senken", "Absenken").replace("one stroke", "a stroke")).sequence
    slower = sequence(tmp_path, stroke=changed("maximum = 30", "maximum = 40")).sequence
    other = sequence(tmp_path, stroke=changed("pressure > 80", "pressure > 90")).sequence
    assert worded and slower and other
    assert worded != first and checksum(worded) == checksum(first) and program(worded) == program(first)
    assert checksum(slower) == checksum(first) and program(slower) != program(first)
    assert checksum(other) != checksum(first) and program(other) != program(first)
    assert "\n  3 pressure_ok forceable=1 value=pressure when=pressure > 80\n" in canonical(first)


def test_a_file_that_nobody_uses_is_found(tmp_path: Path) -> None:
    assert unused(loaded(tmp_path)) == []
    assert unused(loaded(tmp_path, spare="nonsense")) == ["sequences/spare.toml"]
    (tmp_path / "plant" / "sequences" / ".spare2.toml").write_text("an editor's", "utf-8")
    assert unused(loaded(tmp_path)) == ["sequences/spare.toml"]
    (tmp_path / "plant" / "sequences" / "LOUD.TOML").write_text("nobody's", "utf-8")
    assert unused(loaded(tmp_path)) == ["sequences/LOUD.TOML", "sequences/spare.toml"]


def test_a_file_with_another_name_than_a_key_is_none(tmp_path: Path) -> None:
    problem = one(tmp_path, changed('"stroke"', '"Stroke 2"', PLANT), **{"Stroke 2": STROKE})
    assert problem.expected == "a file of sequences/: one of stroke (perhaps stroke)"


def test_a_plant_without_the_folder_says_that_it_has_none(tmp_path: Path) -> None:
    folder = write_plant(tmp_path)
    shutil.rmtree(folder / "sequences")
    _, problems = read_plant(folder, type_folder=write_types(tmp_path))
    assert [problem.expected for problem in problems] == ["a file of sequences/: one of none"]


@pytest.mark.sweep(8)
def test_fifty_sequences_of_eight_steps_are_read_quickly(tmp_path: Path) -> None:
    bits = "".join(
        f'[steps.permissives.{bit}]\nlabel = {{ hr = "a", en = "b" }}\nwhen = "pressure > {bit}"\n' for bit in range(16)
    )
    steps = "".join(f'[[steps]]\nkey = "more_{n}"\nlabel = "More"\n{bits}' for n in range(6))
    definitions = {f"d{n}": changed("[abort.0]", f"{steps}[abort.0]") for n in range(50)}
    machines = "".join(
        f'[equipment.s{n}]\ntype = "sequence"\nlink = "hall"\nunit = {n + 40}\ndefinition = "d{n}"\nmachine = "p1"\n'
        for n in range(50)
    )
    write_plant(tmp_path, PLANT + machines, **definitions)
    write_types(tmp_path)
    before = process_time()
    plant = loaded(tmp_path, PLANT + machines, **definitions)
    assert process_time() - before < 2.0
    found = plant.equipment["s49"].sequence
    assert found and len(found.steps) == 8


# ---- mistakes in the plant file -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        (
            'definition = "stroke"',
            'definition = "strok"',
            "definition",
            "a file of sequences/: one of stroke (perhaps stroke)",
        ),
        ('definition = "stroke"', 'definition = "../plant"', "definition", "a file of sequences/: one of stroke"),
        ('definition = "stroke"\n', "", "definition", "a file of sequences/: one of stroke"),
        ('machine = "p1"', 'machine = "p9"', "machine", "an equipment: one of p1"),
        ('machine = "p1"', 'machine = "seq1"', "machine", "a machine; this is itself a sequence"),
        ('machine = "p1"', "machine = 1", "machine", "the id of an equipment"),
        ('machine = "p1"', 'machine = "p1"\nsteps = 3', "steps", "no such key"),
    ],
)
def test_a_mistake_at_the_machine_is_told(tmp_path: Path, old: str, new: str, key: str, expected: str) -> None:
    found = one(tmp_path, changed(old, new, PLANT))
    assert (found.file, found.key) == ("plant.toml", f"equipment.seq1.{key}")
    assert found.expected.startswith(expected)
    assert found.line and found.line > 7


def test_a_definition_and_a_machine_are_for_a_sequence_only(tmp_path: Path) -> None:
    _, problems = load(tmp_path, PLANT + 'definition = "stroke"\nmachine = "p1"\n')
    assert [(found.key, found.expected.split(";")[0]) for found in problems] == [
        ("equipment.p1.definition", "no such key"),
        ("equipment.p1.machine", "no such key"),
    ]


# ---- mistakes in the definition -----------------------------------------------------------------------


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        ("[sequence]\n", "[sequenze]\n", "sequence", "[sequence] with label"),
        ("stall_after = 2", "stall_after = 0", "sequence.stall_after", "a number from 0.1 to 600"),
        ("stall_after = 2", "longest_force = 0", "sequence.longest_force", "a number from 1 to 604800"),
        ("stall_after = 2", "keep_forces = 1", "sequence.keep_forces", "true or false"),
        ("stall_after = 2", "stahl_after = 2", "sequence.stahl_after", "no such key"),
        ('hr = "Hod"', 'xx = "Hod"', "sequence.label.xx", "a language of the product"),
        ('key = "lower"', 'key = "Lower"', "steps.0.key", "a key of small letters"),
        ('key = "lower"', 'key = "abort"', "steps.0.key", "a key that no other step has; not abort"),
        ('key = "lower"\n', "", "steps.0.key", "a key of small letters"),
        ('label = "Lift"\n', "", "steps.1.label", "a text, or a text for each language"),
        ("minimum = 1", "minimum = -1", "steps.0.minimum", "a number from 0 to 36000"),
        ("maximum = 30", "maximum = 40000", "steps.0.maximum", "a number from 0 to 36000"),
        ("maximum = 30", "maximum = 0.5", "steps.0.maximum", "0 (stay), or at least the minimum, which is 1 s"),
        ("maximum = 30", "maximmum = 30", "steps.0.maximmum", "no such key"),
        ('["lower"]', '["lover"]', "steps.0.actions.0", "an action of press: one of lower, lift (perhaps lower)"),
        ('["lower"]', '["lower", "lower"]', "steps.0.actions.1", "each action once"),
        ('["lower"]', "[7]", "steps.0.actions.0", "an action of the machine"),
        ('["lower"]', '"lower"', "steps.0.actions", "a list of actions of the machine"),
        ("permissives.3]", "permissives.16]", "steps.0.permissives.16", "a bit from 0 to 15"),
        ("permissives.3]", "permissives.x]", "steps.0.permissives.x", "a bit from 0 to 15"),
        ("permissives.3]", "permissives.00]", "steps.0.permissives.0", "each bit once; bit 0 is there"),
        ('key = "pressure_ok"', 'key = "bit_0"', "steps.0.permissives.0", "a key that no other bit of this word has"),
        ('label = "At the bottom"\n', "", "steps.1.permissives.1.label", "a text, or a text for each language"),
        ("pressure > 80", "presure > 80", "steps.0.permissives.3.when", "names of points of p1; it has no presure (perhaps pressure)"),
        ("pressure > 80", "moving_hours > 8", "steps.0.permissives.3.when", "points that p1 itself has as numbers"),
        ("pressure > 80", "name == 1", "steps.0.permissives.3.when", "points that p1 itself has as numbers"),
        ("pressure > 80", "pressure >", "steps.0.permissives.3.when", 'expression "pressure >"'),
        ("pressure > 80", "pressure > argument", "steps.0.permissives.3.when", "no `argument` here"),
        ("pressure > 80", "age(pressure) < 3", "steps.0.permissives.3.when", "no age(…) here"),
        ("pressure > 80", " ", "steps.0.permissives.3.when", "a text"),
        ('value = "pressure"', 'value = "presure"', "steps.0.permissives.3.value", "a point that p1 itself has as a number"),
        ("forceable = false", 'forceable = "no"', "steps.0.permissives.0.forceable", "true or false"),
        ("[abort.0]", "[abort.16]", "abort.16", "a bit from 0 to 15"),
        ("pressure > 20", "pressure > heat", "abort.0.when", "names of points of p1"),
        ("[[tests]]", "[[testes]]", "testes", "no such key"),
        ('name = "one stroke"\n', "", "tests.0.name", "a text"),
        ("coil = 1 }", "coils = 1 }", "tests.0.given.coils", "a preset of press: one of coil, pressure (perhaps coil)"),
        ("coil = 1 }", "coil = 2 }", "tests.0.given.coil", "a number from 0 to 1"),
        ("coil = 1 }", 'coil = "yes" }', "tests.0.given.coil", "a number"),
        ('command = "start"', 'command = "stat"', "tests.0.when.1.command", "a command of sequence: one of force, start"),
        ('command = "start"', 'command = "force"', "tests.0.when.1.arguments.bit", "a number: force needs bit"),
        ("arguments = { bit = 3 }", "arguments = { bits = 3, bit = 3 }", "tests.0.when.3.arguments.bits", "an argument of force"),
        ("arguments = { bit = 3 }", "arguments = { bit = 3.5 }", "tests.0.when.3.arguments.bit", "a whole number"),
        ("arguments = { bit = 3 }", 'arguments = { bit = "3" }', "tests.0.when.3.arguments.bit", "a number"),
        ('{ at = 9, fault = 3 }', '{ at = 9, fault = 3, arguments = { bit = 3 } }', "tests.0.when.2.arguments", "no such key"),
        ('command = "start"', "fault = -1", "tests.0.when.1.fault", "a whole number from 0 to 65535"),
        ('command = "start"', "set = {}", "tests.0.when.1.set", "a table of presets"),
        ('command = "start"', "wait = 1", "tests.0.when.1", "exactly one of command, fault, set"),
        ("{ at = 9, fault = 3 }", '{ at = 9, fault = 3, command = "start" }', "tests.0.when.2", "exactly one of"),
        ("at = 9", "at = 3601", "tests.0.when.2.at", "a number from 0 to 3600"),
        ("{ at = 9, fault = 3 }", "{ fault = 3 }", "tests.0.when.2.at", "a number from 0 to 3600"),
        ("pressure = 20 }", "presure = 20 }", "tests.0.when.0.set.presure", "a preset of press"),
        ('state = "done"', 'state = "ready"', "tests.0.then.0.state", "one of idle, running, suspended, done"),
        ('within = 120, state', "state", "tests.0.then.0.within", "either `within` or `at`"),
        ("within = 120", "at = 9, within = 120", "tests.0.then.0.at", "either `within` or `at`"),
        ('step = "lift"', 'step = "left"', "tests.0.then.1.step", "one of lower, lift (perhaps lift)"),
        ("pressure > 300", "presure > 300", "tests.0.then.2.never", "names of points of p1"),
        ("pressure > 300", "pressure > argument", "tests.0.then.2.never", "no `argument` here"),
        ('{ never = "pressure', '{ at = 3, never = "pressure', "tests.0.then.2.at", "no time: never is all the time"),
        ('first_out = "pressure_ok"', 'first_out = "presure"', "tests.0.then.3.first_out", "one of pressure_there, bit_0"),
        ("at_top == 1\" },", "moving_hours\" },", "tests.0.then.4.expect", "points that p1 itself has as numbers"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_definition_is_told(tmp_path: Path, old: str, new: str, key: str, expected: str) -> None:
    _, problems = load(tmp_path, stroke=changed(old, new))
    assert problems, "nothing was told"
    assert (problems[0].file, problems[0].key) == ("sequences/stroke.toml", key), problems
    assert problems[0].expected.startswith(expected), problems[0]
    assert problems[0].line or key in ("sequence", "tests")
    assert len(problems) <= 2, "what follows from one mistake is not to hide it"


def test_mistakes_of_every_kind_are_told_at_once(tmp_path: Path) -> None:
    text = STROKE
    for old, new in (
        ("minimum = 1", "minimum = -1"),
        ('["lower"]', '["fly"]'),
        ("pressure > 80", "presure > 80"),
        ('value = "pressure"', 'value = "presure"'),
        ("pressure > 20", "pressure >"),
        ('command = "start"', 'command = "stert"'),
        ("coil = 1 }", "coil = 9 }"),
        ("pressure > 300", "heat > 300"),
    ):
        text = changed(old, new, text)
    _, problems = load(tmp_path, changed('label = "Stroke"', 'lable = "Stroke"', PLANT), stroke=text)
    assert {(found.file.rpartition("/")[2], found.key) for found in problems} == {
        ("plant.toml", "equipment.seq1.lable"),
        ("stroke.toml", "steps.0.minimum"),
        ("stroke.toml", "steps.0.actions.0"),
        ("stroke.toml", "steps.0.permissives.3.when"),
        ("stroke.toml", "steps.0.permissives.3.value"),
        ("stroke.toml", "abort.0.when"),
        ("stroke.toml", "tests.0.when.1.command"),
        ("stroke.toml", "tests.0.given.coil"),
        ("stroke.toml", "tests.0.then.2.never"),
    }
    assert len(problems) == 9


def test_a_mistake_is_told_with_the_line_of_its_own_row(tmp_path: Path) -> None:
    text = changed("pressure > 20", "pressure > heat", changed("at_bottom == 1", "bottom == 1"))
    _, problems = load(tmp_path, stroke=text)
    lines = text.splitlines()
    assert [lines[(found.line or 0) - 1] for found in problems] == [
        'when = "bottom == 1"',
        'when = "pressure > heat"',
    ]


def test_steps_are_one_to_two_hundred(tmp_path: Path) -> None:
    none = '[sequence]\nlabel = "Empty"\n'
    found = one(tmp_path, stroke=none)
    assert (found.key, found.value, found.expected) == ("steps", "missing", "at least one [[steps]]")
    many = none + "".join(f'[[steps]]\nkey = "s{n}"\nlabel = "S"\n' for n in range(MOST_STEPS))
    definition = sequence(tmp_path, stroke=many).sequence
    assert definition and len(definition.steps) == MOST_STEPS
    over = one(tmp_path, stroke=many + '[[steps]]\nkey = "one_more"\nlabel = "S"\n')
    assert (over.value, over.expected) == ("201 steps", "at most 200 steps")


def test_two_steps_or_two_tests_cannot_be_called_alike(tmp_path: Path) -> None:
    _, problems = load(tmp_path, stroke=changed('key = "lift"', 'key = "lower"'))
    assert [found.key for found in problems] == ["steps.1.key", "tests.0.then.1.step"]
    again = STROKE + '[[tests]]\nname = "one stroke"\nthen = [{ within = 1, state = "idle" }]\n'
    assert one(tmp_path, stroke=again).key == "tests.1.name"


def test_a_test_that_expects_nothing_is_told(tmp_path: Path) -> None:
    text = STROKE.partition("then = [")[0]
    assert one(tmp_path, stroke=text).expected == "at least one row: a test that expects nothing cannot fail"
    empty = one(tmp_path, stroke=text + "then = []\n")
    assert empty.key == "tests.0.then"


def test_a_file_that_is_no_toml_is_one_mistake(tmp_path: Path) -> None:
    twice = one(tmp_path, stroke=STROKE.replace("permissives.0]", "permissives.3]"))
    assert (twice.file, twice.key) == ("sequences/stroke.toml", "(file)") and "TOML" in twice.expected
    assert one(tmp_path, stroke="").value == "an empty file"


def test_a_mistake_in_a_shared_definition_is_told_once(tmp_path: Path) -> None:
    more = '[equipment.seq2]\ntype = "sequence"\nlink = "hall"\nunit = 31\ndefinition = "stroke"\nmachine = "p1"\n'
    _, problems = load(tmp_path, PLANT + more, stroke=changed("pressure > 80", "presure > 80"))
    assert [found.key for found in problems] == ["steps.0.permissives.3.when"]


# ---- what a type says ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("file", "old", "new", "key", "expected"),
    [
        ("press_device", '"lift"]', '"Lift"]', "actions.names.1", "a name of small letters"),
        ("press_device", '"lift"]', '"lower"]', "actions.names.1", "each action once"),
        ("press_device", "[0, 250]", "[250, 0]", "presets_of_simulation.pressure", "[low, high] with low <= high"),
        ("sequence_device", "[device]", "[actions]\nnames = []\n[device]", "actions", "no actions where"),
        (
            "sequence_device",
            "[device]",
            "[options.steps]\ndefault = 3\nlow = 1\nhigh = 9\n[device]",
            "options.steps",
            "no option of this name",
        ),
    ],
)
def test_a_mistake_of_a_type_is_told(tmp_path: Path, file: str, old: str, new: str, key: str, expected: str) -> None:
    name, _, part = file.partition("_")
    text = changed(old, new, TYPES[name][f"{part}.toml"])
    _, problems = read_plant(write_plant(tmp_path), type_folder=write_types(tmp_path, **{file: text}))
    assert (problems[0].key, problems[0].expected.startswith(expected)) == (key, True), problems
    assert problems[0].file == f"{name}/device.toml"


def test_a_machine_says_what_may_be_asked_of_it(tmp_path: Path) -> None:
    plant = loaded(tmp_path)
    press, own = plant.types["press"], plant.types["sequence"]
    assert (press.actions, press.sequence) == (("lower", "lift"), False)
    assert press.simulation_presets == {"pressure": (0.0, 250.0), "coil": (0.0, 1.0)}
    assert own.sequence and replace(own, sequence=False) != own
