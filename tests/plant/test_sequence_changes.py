"""What a reload says of a sequence beforehand: what differs, and that one which runs is not torn without a word."""

from dataclasses import replace
from pathlib import Path

import pytest

from app.plant.changes import MOST_LINES, Change, compare, digest
from app.plant.texts import read_product
from tests.plant.transport import PLANT, STROKE, loaded


def after(folder: Path, old: str, new: str, *, running: bool = False, plant: str = PLANT) -> Change:
    assert old in STROKE or plant != PLANT
    before = loaded(folder)
    (change,) = compare(before, loaded(folder, plant, stroke=STROKE.replace(old, new, 1)), ["seq1"] if running else [])
    assert (change.what, change.kind, change.name) == ("equipment", "changed", "seq1")
    return change


def keys(change: Change) -> list[str]:
    return [effect.key for effect in change.effects]


@pytest.mark.parametrize(
    ("old", "new", "detail"),
    [
        ("maximum = 30", "maximum = 45", "lower.maximum: 30.0 → 45.0"),
        ("loss_aborts = true", "loss_aborts = false", "lower.loss_aborts: true → false"),
        ("pressure > 80", "pressure > 90", 'lower.3.when: "pressure > 80" → "pressure > 90"'),
        ("forceable = false", "forceable = true", "lower.0.forceable: false → true"),
        ('["lift"]', "[]", 'lift.actions: ["lift"] → []'),
        ("pressure > 20", "pressure > 30", 'abort.0.when: "pressure > 20" → "pressure > 30"'),
        ("stall_after = 2", "stall_after = 3", "stall_after: 2.0 → 3.0"),
        ("stall_after = 2", "output_while_suspended = true", "output_while_suspended: false → true"),
    ],
)
def test_what_a_device_acts_on_is_told_with_what_follows(tmp_path: Path, old: str, new: str, detail: str) -> None:
    change = after(tmp_path, old, new)
    assert detail in change.details
    assert keys(change) == ["sequence"] and change.effects[0].params == {"id": "seq1"}


def test_labels_and_tests_interrupt_nothing(tmp_path: Path) -> None:
    label = after(tmp_path, 'de = "Senken"', 'de = "Absenken"', running=True)
    assert label.details == ('lower.label: { de = "Senken" } → { de = "Absenken" }',)
    test = after(tmp_path, "within = 120", "within = 60", running=True)
    assert len(test.details) == 1 and test.details[0].startswith("tests.one stroke: ")
    assert keys(label) == keys(test) == ["texts"]


def test_steps_that_come_and_go_are_named_once(tmp_path: Path) -> None:
    change = after(tmp_path, "[abort.0]", '[[steps]]\nkey = "rest"\nlabel = "Rest"\n[abort.0]')
    assert change.details[0] == "steps: lower, lift → lower, lift, rest"
    assert not [detail for detail in change.details if detail.startswith("rest.")]
    assert keys(change) == ["sequence"]
    assert change.details[1].startswith("CRC: ")


def test_a_sequence_that_runs_says_that_it_is_broken_off(tmp_path: Path) -> None:
    assert keys(after(tmp_path, "maximum = 30", "maximum = 45", running=True)) == ["sequence_runs", "sequence"]
    before = loaded(tmp_path)
    gone = loaded(tmp_path, PLANT[: PLANT.index("[equipment.seq1]")] + PLANT[PLANT.index("[equipment.p1]") :])
    removed = [change for change in compare(before, gone, ["seq1"]) if change.name == "seq1"]
    assert keys(removed[0])[0] == "sequence_runs"


def test_a_machine_whose_sequence_runs_says_so(tmp_path: Path) -> None:
    before = loaded(tmp_path)
    item = before.equipment["p1"]
    other = replace(before, equipment={**before.equipment, "p1": replace(item, options={"length": 2.0})})
    (change,) = compare(before, other, ["seq1"])
    assert change.name == "p1" and keys(change) == ["options", "sequence_runs"]
    assert change.effects[1].params == {"id": "seq1"}
    moved = replace(before, equipment={**before.equipment, "p1": replace(item, label={"en": "Press"})})
    assert keys(compare(before, moved, ["seq1"])[0]) == ["texts"], "the label alone stops nothing"


def test_another_machine_or_another_definition_is_told(tmp_path: Path) -> None:
    second = '[equipment.p2]\ntype = "press"\nlink = "hall"\nunit = 30\n'
    one = loaded(tmp_path, PLANT + second)
    other = loaded(tmp_path, PLANT.replace('machine = "p1"', 'machine = "p2"') + second)
    (change,) = compare(one, other)
    assert (change.details, keys(change)) == (('machine: "p1" → "p2"',), ["sequence"])
    named = loaded(tmp_path, PLANT.replace('"stroke"', '"copy"') + second, copy=STROKE)
    (change,) = compare(one, named)
    assert (change.details, keys(change)) == (('definition: "stroke" → "copy"',), ["texts"])


def test_the_digest_stands_for_exactly_one_definition(tmp_path: Path) -> None:
    before = loaded(tmp_path)

    def told(*pairs: tuple[str, str]) -> str:
        text = STROKE
        for old, new in pairs:
            text = text.replace(old, new, 1)
        return digest(compare(before, loaded(tmp_path, stroke=text)))

    assert told(("pressure > 80", "pressure > 90")) == told(("pressure > 80", "pressure > 90"))
    assert told(("pressure > 80", "pressure > 90")) != told(("pressure > 80", "pressure > 95"))
    steps = "".join(f'[[steps]]\nkey = "s{n}"\nlabel = "S"\nmaximum = 5\n' for n in range(3 * MOST_LINES))
    long = loaded(tmp_path, stroke=STROKE + steps)
    slower = loaded(tmp_path, stroke=STROKE + steps.replace("= 5", "= 6"))
    last = loaded(tmp_path, stroke=STROKE + steps.replace("= 5", "= 6")[:-2] + "9\n")
    (change,) = compare(long, slower)
    assert len(change.details) == MOST_LINES + 1 and change.details[-1].startswith(f"… +{2 * MOST_LINES} (")
    assert digest(compare(long, slower)) != digest(compare(long, last)), "what is not shown counts, too"


def test_a_comment_in_a_definition_changes_nothing(tmp_path: Path) -> None:
    assert compare(loaded(tmp_path), loaded(tmp_path, stroke="# new\n" + STROKE)) == []


def test_every_language_says_what_follows(tmp_path: Path) -> None:
    product = read_product()
    for language in ("hr", "en", "de", "cs"):
        for key in ("sequence", "sequence_runs"):
            assert "{id}" in product[language][f"plant.effect.{key}"]
