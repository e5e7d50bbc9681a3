"""What a reload says beforehand: each difference once, with what follows from it."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from app import bundled
from app.plant.changes import compare, digest, renamed, same_line
from app.plant.definitions import Alarm, Plant
from app.plant.loader import read_plant

DEMO = (bundled("plants/demo") / "plant.toml").read_text("utf-8")


@pytest.fixture
def demo(tmp_path: Path) -> Plant:
    return read(tmp_path, DEMO)


def read(folder: Path, text: str) -> Plant:
    shutil.copytree(bundled("plants/demo"), folder, dirs_exist_ok=True)
    (folder / "plant.toml").write_text(text, "utf-8")
    plant, problems = read_plant(folder)
    assert plant is not None, problems
    return plant


def effects(old: Plant, new: Plant) -> list[tuple[str, str, str, tuple[str, ...]]]:
    return [(c.what, c.kind, c.name, tuple(effect.key for effect in c.effects)) for c in compare(old, new)]


def test_the_same_files_read_twice_are_no_change(demo: Plant, tmp_path: Path) -> None:
    assert compare(demo, read(tmp_path, DEMO + "\n# a comment\n")) == []


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('en = "Fan 1"', 'en = "Fan West"', ("equipment", "changed", "m1", ("texts",))),
        ("unit = 2", "unit = 9", ("equipment", "changed", "m2", ("elsewhere",))),
        ("F905 = 0.0", "F905 = 2.0", ("equipment", "changed", "m1", ("options",))),
        ("writes = true", "writes = false", ("link", "changed", "hall", ("link_restarts",))),
        ("[links.hall]", '[links.hall]\nlabel = "Hall"', ("link", "changed", "hall", ("texts",))),
        ("Europe/Zagreb", "Europe/Prague", ("plant", "changed", "plant", ("texts", "timezone"))),
        (
            'Europe/Zagreb"',
            'Europe/Zagreb"\nshifts = ["07:00", "19:00"]',
            ("plant", "changed", "plant", ("texts", "shifts")),
        ),
        (
            "[equipment.m2]",
            '[equipment.west]\nwas = "m2"',
            ("equipment", "renamed", "west", ("renamed", "alarms_closed")),
        ),
        ("[equipment.m2]", "[equipment.west]", ("equipment", "added", "west", ("added",))),
    ],
)
def test_a_difference_is_told_with_what_follows(
    demo: Plant, tmp_path: Path, old: str, new: str, expected: tuple[str, str, str, tuple[str, ...]]
) -> None:
    assert old in DEMO
    assert effects(demo, read(tmp_path, DEMO.replace(old, new)))[0] == expected


def test_another_type_is_no_matter_of_labels(demo: Plant, tmp_path: Path) -> None:
    """It said: labels and places only; nothing is interrupted."""
    head, _, rest = DEMO.partition("[equipment.m2]")
    rest = rest.replace("rated_current = 2.5\n", "", 1).replace('type = "eura_e800"', 'type = "conveyor"', 1)
    (change,) = [one for one in compare(demo, read(tmp_path, f"{head}[equipment.m2]{rest}")) if one.name == "m2"]
    told = [effect.key for effect in change.effects]
    assert told[0] == "other_type" and not {"texts", "elsewhere"} & set(told), told
    rest = rest.replace("unit = 2\n", "unit = 77\n", 1)
    (change,) = [one for one in compare(demo, read(tmp_path, f"{head}[equipment.m2]{rest}")) if one.name == "m2"]
    assert [effect.key for effect in change.effects][:2] == ["elsewhere", "other_type"]


def test_a_removed_machine_keeps_its_history_by_the_lasting_id(demo: Plant, tmp_path: Path) -> None:
    renamed_first = read(tmp_path, DEMO.replace("[equipment.m2]", '[equipment.west]\nwas = "m2"'))
    gone = read(tmp_path, DEMO.replace(DEMO[DEMO.index("# Hold-to-run works") : DEMO.index("# The wooden model")], ""))
    (change,) = compare(renamed_first, gone)
    assert (change.kind, change.name) == ("removed", "west")
    assert dict(change.effects[0].params) == {"id": "m2"}


def test_a_rename_without_its_former_name_loses_the_history_and_says_so(demo: Plant, tmp_path: Path) -> None:
    plain = read(tmp_path, DEMO.replace("[equipment.m2]", "[equipment.west]"))
    assert renamed(demo, plain) == {}
    assert [(c.kind, c.name) for c in compare(demo, plain)] == [("added", "west"), ("removed", "m2")]
    owned = read(tmp_path, DEMO.replace("[equipment.m2]", '[equipment.west]\nwas = "m2"'))
    assert renamed(demo, owned) == {"west": "m2"}
    forgotten = compare(owned, plain)
    assert [effect.key for effect in forgotten[0].effects] == ["history_anew"]


def test_points_and_alarms_of_a_machine_are_named(demo: Plant) -> None:
    item = demo.equipment["m1"]
    point = replace(item.points["speed"], dead_band=99.0)
    points = {key: point if key == "speed" else each for key, each in item.points.items() if key != "torque"}
    alarms = [*item.alarms[1:], Alarm("too_hot", "x", "heatsink_temperature > 70", 2)]
    other = replace(demo, equipment={**demo.equipment, "m1": replace(item, points=points, alarms=alarms)})
    (change,) = compare(demo, other)
    assert "points − torque" in change.details and "points ≠ speed" in change.details
    assert "alarms + too_hot" in change.details and f"alarms − {item.alarms[0].key}" in change.details
    assert [effect.key for effect in change.effects] == ["history_kept", "alarms_closed"]


@pytest.mark.sweep(8)
def test_the_digest_stands_for_exactly_these_changes(demo: Plant, tmp_path: Path) -> None:
    one = compare(demo, read(tmp_path, DEMO.replace("unit = 2", "unit = 9")))
    other = compare(demo, read(tmp_path, DEMO.replace("unit = 2", "unit = 8")))
    assert digest(one) == digest(list(one)) != digest(other)
    for moving in ((), ("m2",), ("m2", "c1")):
        told = compare(demo, read(tmp_path, DEMO.replace("unit = 2", "unit = 9")), (), moving)
        assert digest(told) == digest(one), "what runs comes and goes"


def test_a_line_is_the_same_whatever_it_is_called(demo: Plant) -> None:
    link = demo.links["hall"]
    assert same_line(link, replace(link, label={"en": "Hall"}))
    assert not same_line(link, replace(link, timeout=3.0))


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("old", "new", "warned"),
    [
        (DEMO[DEMO.index("# Hold-to-run works") : DEMO.index("# The wooden model")], "", True),
        (DEMO[DEMO.index("[equipment.c1]") : DEMO.index("# A coil is wound")], "", True),
        ("unit = 2", "unit = 9", True),
        ("unit = 11", "unit = 12", True),
        ('en = "Fan 2"', 'en = "Fan West"', False),
        ("[equipment.m2]", '[equipment.west]\nwas = "m2"', False),
    ],
)
def test_who_takes_away_the_hold_on_a_machine_that_runs_is_warned(
    demo: Plant, tmp_path: Path, old: str, new: str, warned: bool
) -> None:
    assert old in DEMO
    other = read(tmp_path, DEMO.replace(old, new))
    for moving in ((), ("m2", "c1")):
        told = [e.params["id"] for c in compare(demo, other, (), moving) for e in c.effects if e.key == "machine_runs"]
        assert bool(told) is (warned and bool(moving))
