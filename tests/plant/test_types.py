"""Equipment types as their folders: each is read without a mistake, a file that must be there is asked for, and texts are complete."""

import shutil
from pathlib import Path

import pytest

from app.plant import types
from app.plant.plant_files.languages import LANGUAGES


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
