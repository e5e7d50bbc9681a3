"""Equipment types as their folders: each is read without a mistake, a file that must be there is asked for, and texts are complete."""

import shutil
from collections.abc import Mapping
from pathlib import Path

import pytest

from app.plant import types
from app.plant.definitions import Kind, Point, Type
from app.plant.loader import read_plant
from app.plant.plant_files.languages import LANGUAGES
from app.plant.tables import MOST_PROBLEMS, STOP_AT
from tests.plant.line import FILES, PLANT, load, write_type


@pytest.mark.parametrize("name", types.names())
def test_a_type_of_ours_has_no_mistake(name: str) -> None:
    data, problems = types.read_type(name, LANGUAGES)
    assert problems == []
    assert data.type.name == name and set(data.points) == set(data.type.points)
    assert len(set(types.text_keys(data))) > 5


@pytest.mark.parametrize(
    ("file", "told"),
    [
        ("device.toml", True),
        ("points.toml", True),
        ("texts.de.toml", True),
        ("training.toml", False),
        ("checks.toml", False),
    ],
)
def test_only_what_may_be_missing_may_be_missing(tmp_path: Path, file: str, told: bool) -> None:
    shutil.copytree(types.EQUIPMENT / "eura_e800", tmp_path / "eura_e800")
    (tmp_path / "eura_e800" / file).unlink(missing_ok=True)
    _, problems = types.read_type("eura_e800", LANGUAGES, tmp_path)
    assert any(problem.file == f"eura_e800/{file}" for problem in problems) is told


def test_a_language_that_nobody_speaks_need_not_be_there(tmp_path: Path) -> None:
    shutil.copytree(types.EQUIPMENT / "eura_e800", tmp_path / "eura_e800")
    (tmp_path / "eura_e800" / "texts.de.toml").unlink()
    data, problems = types.read_type("eura_e800", LANGUAGES, tmp_path, spoken=("hr",))
    assert problems == [] and data.type.texts["de"] == {} and data.type.texts["hr"]


def test_a_folder_without_device_is_no_type(tmp_path: Path) -> None:
    (tmp_path / "thing").mkdir()
    assert types.names(tmp_path) == []
    (tmp_path / "thing" / "device.toml").write_text('label = "x"\n[device]\n')
    assert types.names(tmp_path) == ["thing"]


DRAWN = 0.02
"""Part of a drawn scale that a dead-band may hide."""


def resolution(points: Mapping[str, Point], key: str) -> float:
    """The smallest step of a value [EU]; 0 of what has none."""
    point = points[key]
    if point.derived is not None:
        if point.derived.kind == "running_hours":
            return 10.0 ** -max(1, point.decimals)
        follows = point.derived.kind in ("signed", "min_today", "max_today")
        return resolution(points, point.derived.of) if follows else 0.0
    whole = point.register is not None and point.register.type is not Type.F32
    return abs(point.register.scale) if point.register and whole else 0.0


@pytest.mark.parametrize("name", types.names())
def test_no_dead_band_makes_a_ramp_of_a_step(name: str) -> None:
    """A band of one step to three swallows a step that is seen, and a line is drawn where none was; a wider one is for noise."""
    data, problems = types.read_type(name, ["en"])
    assert not problems
    points = {key: one.point for key, one in data.points.items()}
    for key, point in points.items():
        band, step = point.dead_band, resolution(points, key)
        assert point.kind is Kind.ANALOG or not band, f"{key}: a value that holds until the next has no dead-band"
        assert not band or band < step or band >= 3 * step, (key, band, step)
        if band >= step and isinstance(point.scale_low, int | float) and isinstance(point.scale_high, int | float):
            assert band <= DRAWN * (point.scale_high - point.scale_low), (key, band, point.scale_low, point.scale_high)


GUARD = '[permissives.a]\nlabel = "type"\nexpression = "state == 1"\n'


@pytest.mark.parametrize(
    ("file", "text", "key"),
    [
        ("interlocks", GUARD + 'commands = [["start"]]\n', "permissives.a.commands.0"),
        ("interlocks", GUARD + "commands = [{ a = 1 }]\n", "permissives.a.commands.0"),
        ("interlocks", GUARD + "values = 5\n", "permissives.a.values"),
        ("commands", "[go]\nrefused = 5\n", "go.refused"),
        ("commands", '[go]\nrefused = "all"\n', "go.refused"),
        ("device", FILES["device.toml"].replace("[device]", "[device]\ngroup_read = 5"), "device.group_read"),
        ("records", '[r]\nkey = "k"\nbegin = [["x"]]\n', "r.begin.0"),
        ("events", FILES["events.toml"].replace("word = 2", "word = 2\nevents = [[1]]"), "snapshot.second.events.0"),
    ],
)
def test_a_list_or_a_number_in_place_of_something_else_is_told_at_its_place(
    tmp_path: Path, file: str, text: str, key: str
) -> None:
    kinds = write_type(tmp_path)
    (kinds / "line" / f"{file}.toml").write_text(text, "utf-8")
    (tmp_path / "plant.toml").write_text(PLANT, "utf-8")
    plant, problems = read_plant(tmp_path, type_folder=kinds)
    assert plant is None
    assert (f"line/{file}.toml", key) in [(one.file, one.key) for one in problems], problems


def test_a_file_of_a_type_with_very_many_mistakes_is_told(tmp_path: Path) -> None:
    plant, problems = load(tmp_path, commands="".join(f"[c{number}]\nx = 1\n" for number in range(STOP_AT)))
    assert plant is None
    assert problems[0].file == "line/commands.toml" and len(problems) == MOST_PROBLEMS + 1


def test_a_symbol_that_nobody_drew_is_named(tmp_path: Path) -> None:
    kinds = write_type(tmp_path)
    file = kinds / "line" / "device.toml"
    file.write_text('symbol = "e-pmup"\n' + file.read_text("utf-8"), "utf-8")
    (problem,) = types.read_type("line", (), kinds)[1]
    assert (problem.key, problem.value) == ("symbol", '"e-pmup"')
    assert "e-machine" in problem.expected
