"""The pages for whoever keeps Pogon name commands, options, settings, tests and figures that exist; the class room works in its order."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from app.backup.archive import MOST_BYTES, MOST_FILES, RESERVE
from app.cli import cli
from app.cli_access import LARGEST_LIST, MOST_PEOPLE
from app.logs import MOST_WAITING, PAUSE
from app.plant.loader import read_plant
from app.plant.plant_files.machines import MOST_MACHINES, MOST_POINTS
from app.plant.tables import MOST_PROBLEMS, STOP_AT
from app.plant.toml import DEEPEST, LARGEST_FILE, LONGEST_TEXT, MOST_VALUES
from app.settings import Settings
from tests.conftest import ROOT

PAGES = ("operations", "security", "reliability", "class-room", "connect-e800", "second-motor", "sinamics", "epos")
TEXTS = {name: (ROOT / "docs" / f"{name}.md").read_text("utf-8") for name in PAGES}
COMMANDS = typer.main.get_group(cli)


def spoken(text: str) -> list[list[str]]:
    """Every `pogon …` of a page, split as a shell does."""
    fences = re.findall(r"^ *```(\w*)\n(.*?)^ *```$", text, re.DOTALL | re.MULTILINE)
    lines = [
        line.strip() for kind, block in fences if kind in ("", "sh") for line in block.replace("\\\n", " ").splitlines()
    ]
    found = [*lines, *re.findall(r"`([^`\n]*\bpogon [^`\n]+)`", text)]
    calls = [call for line in found for call in re.split(r"&&|\|", line) if re.search(r"(?<![\w-])pogon ", call)]
    inside = re.compile(r"^ *docker compose (exec|run)( -\S+( /\S+)?)* pogon ")  # the service has the command's name
    calls = [inside.sub("", call) for call in calls]
    return [shlex.split(call.partition("pogon ")[2].partition(">")[0], comments=True) for call in calls]


@pytest.mark.parametrize("name", PAGES)
def test_every_command_and_option_exists(name: str) -> None:
    for words in spoken(TEXTS[name]):
        command: Any = COMMANDS
        options = {option for one in COMMANDS.params for option in one.opts}
        for word in words:
            if hasattr(command, "commands") and not word.startswith("-"):
                assert word in command.commands or word == "…", f"pogon {' '.join(words)}"
                command = command.commands.get(word, command)
                options = {option for one in command.params for option in (*one.opts, *one.secondary_opts)} | {"--help"}
            elif word.startswith("--"):
                assert word.partition("=")[0] in options, f"pogon {' '.join(words)}"


@pytest.mark.parametrize("name", PAGES)
def test_every_setting_test_and_link_exists(name: str) -> None:
    known = {f"POGON_{field.upper()}" for field in Settings.model_fields}
    assert set(re.findall(r"\bPOGON_[A-Z_]+", TEXTS[name])) <= known
    for path, test in re.findall(r"`(tests/[\w/.]+\.py)(?:::(\w+))?`", TEXTS[name]):
        assert (ROOT / path).is_file(), path
        assert not test or f"def {test}(" in (ROOT / path).read_text("utf-8"), f"{path}::{test}"
    for link in re.findall(r"\]\(([^)#:]+)\)", TEXTS[name]):
        assert (ROOT / "docs" / link).exists(), link


def test_the_limits_of_the_page_are_those_of_the_program() -> None:
    counts = (MOST_VALUES, LONGEST_TEXT, MOST_MACHINES, MOST_POINTS, STOP_AT, MOST_PEOPLE, MOST_FILES, MOST_WAITING)
    for count in counts:
        assert f"{count:,}".replace(",", " ") in TEXTS["operations"], count
    for said in (
        f"{LARGEST_FILE >> 20} MiB",
        f"{LARGEST_LIST >> 20} MiB",
        f"{MOST_BYTES >> 30} GiB",
        f"{RESERVE >> 20} MB of free space",
        f"{DEEPEST} levels",
        f"| mistakes told | {MOST_PROBLEMS}",
    ):
        assert said in TEXTS["operations"], said
    assert f"tried again after {PAUSE:g} s" in TEXTS["reliability"]


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The files of the class-room page in a folder, and a data folder nobody has used."""
    blocks = dict(re.findall(r"```(toml|csv)\n(.*?)```", TEXTS["class-room"], re.DOTALL))
    (tmp_path / "plants" / "class").mkdir(parents=True)
    (tmp_path / "plants" / "class" / "plant.toml").write_text(blocks["toml"], "utf-8")
    rows = "\n".join(line.strip() for line in blocks["csv"].splitlines())
    (tmp_path / "class.csv").write_text(rows, "utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("POGON_DATA", str(tmp_path / "data"))
    return tmp_path


def test_the_class_room_works_in_its_order(room: Path) -> None:
    plant, problems = read_plant(room / "plants" / "class")
    assert plant and len(plant.equipment) == 30, problems
    added = CliRunner().invoke(cli, ["user", "add", "--file", "class.csv"])
    assert (added.exit_code, added.stderr) == (0, ""), "before the first start, and with somebody who may do everything"
    listed = CliRunner().invoke(cli, ["user", "list"]).stdout
    assert re.search(r"^teacher .*admin, engineer, operator", listed, re.MULTILINE)
    assert re.search(r"^ana .* operator ", listed, re.MULTILINE)


def test_a_class_without_a_teacher_is_told_what_is_missing(room: Path) -> None:
    without = "\n".join(line for line in (room / "class.csv").read_text().splitlines() if "teacher" not in line)
    (room / "class.csv").write_text(without)
    added = CliRunner().invoke(cli, ["user", "add", "--file", "class.csv"])
    assert added.exit_code == 0
    (said,) = added.stderr.splitlines()
    assert said.startswith("pogon: nobody is an administrator")
    command = shlex.split(said.partition("any more: pogon ")[2])
    assert CliRunner().invoke(cli, command).exit_code == 0
    assert "admin" in CliRunner().invoke(cli, ["user", "list"]).stdout
    again = CliRunner().invoke(cli, ["user", "add", "eva"])
    assert (again.exit_code, again.stderr) == (0, "")
