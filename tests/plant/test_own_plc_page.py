"""The machine of docs/own-plc.md is what the page says: a type with the map of this house, without a mistake or a doubt."""

import re
from pathlib import Path

from app.plant.definitions import Image, Plant, PlcMap
from app.plant.loader import read_plant
from app.plant.problems import Problem
from app.registers import plc_map
from tests.conftest import ROOT

PAGE = (ROOT / "docs" / "own-plc.md").read_text("utf-8")
FOLDER = "equipment/tank/"
PLANT = """
[plant]
name = "Waterworks"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.line]
transport = "tcp"
host = "127.0.0.1"
[equipment.t1]
type = "tank"
link = "line"
unit = 1
label = "Tank 1"
"""


def files() -> dict[str, str]:
    """File → text, as the page has them: named in the paragraph before, in the order of the blocks."""
    names = re.findall(rf"`{FOLDER}([\w.]+)`", PAGE)
    blocks = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert len(names) == len(blocks)
    return dict(zip(names, blocks, strict=True))


def read(folder: Path, written: dict[str, str]) -> tuple[Plant | None, list[Problem]]:
    (folder / FOLDER).mkdir(parents=True)
    for name, text in written.items():
        (folder / FOLDER / name).write_text(text, "utf-8")
    (folder / "plant.toml").write_text(PLANT, "utf-8")
    return read_plant(folder)


def test_it_has_no_mistake_and_no_doubt(tmp_path: Path) -> None:
    plant, found = read(tmp_path, files())
    assert plant and not plant.doubts, found
    kind = plant.types["tank"]
    assert kind.device.plc == PlcMap(77, (Image(0x100, 48),), Image(0x200, 7), 0x240, "state", events=True)
    assert [command.code or command.hold_bits for command in kind.commands.values()] == [1, 3, 2, 1]


def test_the_fixed_registers_are_those_of_the_map() -> None:
    ranges = re.findall(r"0x([0-9A-F]{4})–0x([0-9A-F]{4})", PAGE)
    assert [(int(first, 16), int(last, 16) + 1) for first, last in ranges] == [
        (plc_map.HEADER, plc_map.HEADER_WORDS),
        (plc_map.COMMAND, plc_map.COMMAND + plc_map.COMMAND_WORDS),
        (plc_map.ANSWERS, plc_map.ANSWERS + plc_map.ANSWERS_WORDS),
        (plc_map.HOLD, plc_map.HOLD + plc_map.HOLD_WORDS),
        (plc_map.EVENTS, plc_map.EVENTS_END),
    ]


def test_a_set_of_settings_without_its_count_is_told(tmp_path: Path) -> None:
    written = files()
    written["device.toml"] = written["device.toml"].replace("words = 7", "words = 6")
    _, found = read(tmp_path, written)
    assert [(one.file, one.key) for one in found] == [("equipment/tank/setpoints.toml", "flow.address")]
