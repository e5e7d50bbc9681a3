"""`pogon check` on a plant with sequences: mistakes with their place, and the tests of the definition files run on the simulator."""

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from app.cli import cli
from app.plant.definitions import Plant
from app.plant.loader import read_plant
from app.plant.problems import Problem
from app.sim import plant as sim_plant
from tests.demo_plant import plant_folder
from tests.own_types import write_own
from tests.plant.transport import PLANT, TYPES, write_plant, write_types
from tests.test_selftest import CLASH, SECOND, SERIAL

ALONE = PLANT.replace('machine = "p1"\n', 'area = "hall"\n').partition("[equipment.p1]")[0] + "[areas.hall]\n"
BLINK = """
[sequence]
label = "Blink"
[[steps]]
key = "bright"
label = "On"
minimum = 5
maximum = 6
[[steps]]
key = "dark"
label = "Off"
maximum = 3
[steps.permissives.2]
key = "allowed"
label = "Allowed"
[[tests]]
name = "it goes on"
when = [{ at = 0, command = "start" }]
then = [{ within = 1, step = "bright" }, { within = 8, step = "dark" }, { never = "state == 5" }]
[[tests]]
name = "it waits for its permissive"
given = { word_2 = 0xFFFB }
when = [{ at = 0, command = "start" }]
then = [{ within = 8, first_out = "allowed" }, { at = 8, state = "timed_out" }]
[[tests]]
name = "a force lets it go on"
given = { word_2 = 0xFFFB }
when = [{ at = 0, command = "start" }, { at = 1, command = "force", arguments = { step = 2, bit = 2, duration = 60 } }]
then = [{ at = 5.5, state = "done" }]
"""
FORCE = """
[force]
code = 12
arguments = [{ name = "step", type = "u32" }, { name = "bit", type = "u32" }, { name = "duration" }]
"""


@pytest.fixture
def check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> "Checked":
    commands = TYPES["sequence"]["commands.toml"].partition("[force]")[0] + FORCE
    types = write_types(tmp_path, sequence_commands=commands)

    def read(folder: Path) -> tuple[Plant | None, list[Problem]]:
        return read_plant(folder, type_folder=types)

    monkeypatch.setattr(sim_plant, "read_simulated", read)
    return Checked(tmp_path)


class Checked:
    """`pogon check` on a plant of the small types."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __call__(self, *options: str, plant: str = ALONE, **definitions: str) -> Result:
        self.plant = write_plant(self.folder, plant, **{"stroke": BLINK, **definitions})
        return CliRunner().invoke(cli, ["check", str(self.plant), *options])


def test_every_test_of_a_sequence_is_a_line(check: Checked) -> None:
    done = check()
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert lines[0].endswith("languages: hr, en")
    assert lines[1].startswith("seq1, stroke: it goes on: ok, 5.")
    assert lines[2].startswith("seq1, stroke: it waits for its permissive: ok, 8.0 s in ")
    assert lines[3].startswith("seq1, stroke: a force lets it go on: ok, ")
    assert lines[4] == "Tests: 3, failed: 0"


def test_a_test_that_fails_says_what_happened_and_fails_the_check(check: Checked) -> None:
    done = check(stroke=BLINK.replace('within = 8, step = "dark"', 'within = 2, step = "dark"'))
    assert done.exit_code == 1
    assert "seq1, stroke: it goes on: FAILED: step dark within 2 s: it was not; at 2.00 s running" in done.stdout
    assert "it waits for its permissive: ok" in done.stdout, "the others are run, too"
    assert done.stdout.splitlines()[-1] == "Tests: 3, failed: 1"


def test_the_tests_can_be_left_out(check: Checked) -> None:
    done = check("--no-tests", stroke=BLINK.replace("within = 8", "within = 2"))
    assert (done.exit_code, len(done.stdout.splitlines())) == (0, 1)


def test_a_definition_that_several_share_is_tested_once(check: Checked) -> None:
    second = '[equipment.seq2]\ntype = "sequence"\nlink = "hall"\nunit = 22\ndefinition = "stroke"\n'
    done = check(plant=ALONE + second)
    assert done.stdout.splitlines()[-1] == "Tests: 3, failed: 0"


def test_a_sequence_that_cannot_be_simulated_fails_the_check(check: Checked) -> None:
    text = (
        BLINK.replace("[steps.permissives.2]", "[steps.permissives.2]\nwhen = 'pressure > 1'").partition("[[tests]]")[0]
        + '[[tests]]\nname = "a"\nthen = [{ within = 1, state = "idle" }]\n'
    )
    done = check(plant=PLANT, stroke=text)
    assert done.exit_code == 1
    assert "press has no virtual device" in done.stderr
    assert done.stdout.splitlines()[-1] == "Tests: 0, failed: 1"


def test_mistakes_of_a_screen_are_no_warnings_and_the_last_line_says_that_there_are_some(tmp_path: Path) -> None:
    folder = write_own(tmp_path)
    (folder / "screens").mkdir()
    (folder / "screens" / "hall.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><rekt/></svg>'
    )
    done = CliRunner().invoke(cli, ["check", str(folder), "--no-tests"])
    assert done.exit_code == 1
    assert done.stderr.startswith("pogon: screens/hall.svg:1: <rekt> = rekt: expected one of ")
    assert done.stderr.count("pogon: warning: ") == 1
    assert done.stdout.startswith(f"{folder}: mistakes in /screens/hall, which say so; the plant starts. Equipment: 7,")


def test_a_file_that_nobody_uses_is_named_and_is_no_mistake(check: Checked) -> None:
    done = check("--no-tests", spare=BLINK)
    assert (done.exit_code, done.stderr) == (0, f"pogon: {check.plant}/sequences/spare.toml: no equipment uses it\n")


def test_a_mistake_in_a_definition_is_told_with_its_path_and_line(check: Checked) -> None:
    done = check(stroke=BLINK.replace("maximum = 3", "maximum = -3"))
    assert done.exit_code == 2
    assert done.stderr == (
        f"pogon: {check.plant}/sequences/stroke.toml:12: steps.1.maximum = -3: expected a number from 0 to 36000\n"
    )


def test_a_plant_without_sequences_says_nothing_of_tests(tmp_path: Path) -> None:
    folder = plant_folder(tmp_path / "plant", "m1", "c1")
    done = CliRunner().invoke(cli, ["check", str(folder), "--tests"])
    assert done.exit_code == 0 and len(done.stdout.splitlines()) == 1
    assert done.stdout.startswith(f"{folder}: no problems. Equipment: 2, links: 2,")


@pytest.mark.sweep(8)
def test_the_demo_plant_has_no_problems_and_its_sequence_passes_its_tests() -> None:
    done = CliRunner().invoke(cli, ["check", "plants/demo", "--tests"])
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert lines[0].startswith("plants/demo: no problems.") and lines[-1].endswith(", failed: 0")
    assert len(lines) > 10


def test_machines_that_cannot_be_served_on_one_port_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The start said so, and only it."""
    (tmp_path / "plant.toml").write_text(CLASH)
    said = (
        f"pogon: {tmp_path}: unit 1 is m1 on link a and m2 on link b: POGON_SERVE_MODBUS cannot serve them on one port"
    )
    done = CliRunner().invoke(cli, ["check", str(tmp_path)])
    assert (done.exit_code, done.stderr.splitlines()) == (0, [said]), "nobody has to serve them"
    monkeypatch.setenv("POGON_SERVE_MODBUS", "127.0.0.1:5020")
    done = CliRunner().invoke(cli, ["check", str(tmp_path)])
    assert (done.exit_code, done.stderr.splitlines(), done.stdout) == (2, [said], "")


@pytest.mark.parametrize("plugged_in", [True, False])
def test_two_names_of_one_serial_device_are_told(tmp_path: Path, plugged_in: bool) -> None:
    """The second link found out when it was started: in use by another program."""
    device, lasting = tmp_path / "ttyUSB0", tmp_path / "by-id"
    device.touch()
    if plugged_in:
        lasting.symlink_to(device)
    (tmp_path / "plant.toml").write_text(SERIAL.format(port=device) + SECOND.format(port=lasting))
    done = CliRunner().invoke(cli, ["check", str(tmp_path)])
    said = (
        f"pogon: {tmp_path}/plant.toml: links.other.port = {lasting}: "
        f"expected another device than that of line, {device}: they are one here"
    )
    assert (done.exit_code, done.stderr.splitlines()) == ((2, [said]) if plugged_in else (0, []))


def test_a_warning_fails_nothing_unless_that_is_asked_for(tmp_path: Path) -> None:
    folder = write_own(tmp_path)
    done = CliRunner().invoke(cli, ["check", str(folder)])
    assert done.exit_code == 0
    assert done.stderr.startswith(
        "pogon: warning: equipment/pumps/commands.toml:2: start_1.moves = true: expected a Stop "
    )
    assert done.stdout.startswith(f"{folder}: no mistakes, warnings: 1. Equipment: 7, links: 1,")
    assert CliRunner().invoke(cli, ["check", str(folder), "--strict"]).exit_code == 1
    done = CliRunner().invoke(cli, ["check", "plants/demo", "--no-tests", "--strict"])
    assert (done.exit_code, done.stdout.startswith("plants/demo: no problems. ")) == (0, True), done.stderr


def test_a_file_that_nobody_uses_is_a_warning_too(check: Checked) -> None:
    assert check("--no-tests", "--strict").exit_code == 0
    assert check("--no-tests", "--strict", spare=BLINK).exit_code == 1
