"""device.toml: what the device bears, what a sequence may ask of it, and what its tile draws."""

from pathlib import Path

import pytest

from app.plant.definitions import Device
from app.plant.problems import Problem
from app.plant.tables import Source, Table
from app.plant.type_files.device import read_actions, read_device, read_picture, read_simulation_presets, read_tile


def file(folder: Path, text: str) -> tuple[Table, list[Problem]]:
    path = folder / "device.toml"
    path.write_text(text)
    source = Source(path, "device.toml")
    return source.table(), source.problems


def test_what_nothing_is_said_of_is_what_most_devices_are(tmp_path: Path) -> None:
    table, problems = file(tmp_path, "# nothing\n")
    assert read_device(table) == Device() and problems == []


def test_all_of_it_is_read(tmp_path: Path) -> None:
    text = """
    max_read = 25
    fallback_read = 9
    group_read = { fast = 6 }
    write_functions = [16]
    timeout = 0.5
    keeps = false
    holes = [[5, 9]]
    """
    table, problems = file(tmp_path, text)
    device = read_device(table)
    assert problems == []
    assert (device.max_read, device.fallback_read, device.group_read, device.write_functions) == (
        25,
        9,
        {"fast": 6},
        (16,),
    )
    assert (device.timeout, device.keeps, device.holes) == (0.5, False, ((5, 9),))


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("max_read = 126", "max_read"),
        ("max_read = 0", "max_read"),
        ("max_write = 124", "max_write"),
        ("timeout = 61", "timeout"),
        ("timeout = nan", "timeout"),
        ("timeout = 0", "timeout"),
        ("connections = 0", "connections"),
        ("fast = 0", "fast"),
        ("fast = 2\nslow = 1", "fast"),
        ("holes = [[9, 5]]", "holes.0"),
        ("holes = [[1, 2], 3]", "holes.1"),
        ("group_read = { fast = 126 }", "group_read.fast"),
        ("speed = 1", "speed"),
    ],
)
def test_what_no_device_bears_is_told(tmp_path: Path, text: str, key: str) -> None:
    table, problems = file(tmp_path, text)
    read_device(table)
    assert [one.key for one in problems] == [key]


@pytest.mark.parametrize("text", ["fast = 1\nslow = 1", "fast = 2", "slow = 0.05"])
def test_what_is_read_at_one_pace_may_be_as_slow_as_one_likes(tmp_path: Path, text: str) -> None:
    table, problems = file(tmp_path, text)
    read_device(table)
    assert problems == []


@pytest.mark.parametrize(
    ("names", "read", "keys"),
    [
        ('["lower", "lift"]', ("lower", "lift"), []),
        ('["lower", "lower"]', ("lower",), ["actions.names.1"]),
        ('["Lower", 5]', (), ["actions.names.0", "actions.names.1"]),
    ],
)
def test_actions_are_names_each_once(tmp_path: Path, names: str, read: tuple[str, ...], keys: list[str]) -> None:
    table, problems = file(tmp_path, f"[actions]\nnames = {names}")
    assert read_actions(table, sequence=False) == read
    assert [one.key for one in problems] == keys


def test_a_sequence_is_asked_for_nothing(tmp_path: Path) -> None:
    table, problems = file(tmp_path, '[actions]\nnames = ["lower"]')
    read_actions(table, sequence=True)
    assert [one.key for one in problems] == ["actions"]
    assert read_actions(file(tmp_path, "")[0], sequence=True) == ()


def test_presets_have_a_least_and_a_greatest_value(tmp_path: Path) -> None:
    table, problems = file(tmp_path, "[presets_of_simulation]\npressure = [0, 250]\nPump = [0, 1]\noil = [9, 1]")
    assert read_simulation_presets(table)["pressure"] == (0, 250)
    assert sorted(one.key for one in problems) == ["presets_of_simulation.Pump", "presets_of_simulation.oil"]


def test_a_tile_draws_points_of_the_machine_and_not_of_its_tables(tmp_path: Path) -> None:
    table, problems = file(tmp_path, "tile = []")
    assert read_tile(table, ["speed", "state"], ("speed", "state", "count")) == {"speed", "state"}
    assert problems == []
    read_tile(table, ["speed", "head", 5], ("speed",))
    assert [one.key for one in problems] == ["tile.1", "tile.2"]


def test_the_picture_shows_points_that_the_overview_is_told_of(tmp_path: Path) -> None:
    table, problems = file(tmp_path, 'state = "state"\nmoving = "state"\nwhen = "1,2"\nfigure = "speed"')
    shown = read_picture(table, ["speed", "state"])
    assert (shown.state, shown.moving, shown.when, shown.figure) == ("state", "state", "1,2", "speed")
    assert not problems
    read_picture(table, ["state"])
    assert [(one.key, one.expected) for one in problems] == [("figure", "a point of `tile`")]
