"""The plant file of the design page, and what becomes of it when it is changed."""

from pathlib import Path

from app.plant.definitions import Plant
from app.plant.loader import read_plant
from app.plant.problems import Problem

DESIGN = """
[plant]
name = "Press shop"
timezone = "Europe/Zagreb"
languages = ["hr", "en", "de", "cs"]

[links.press_shop]
transport = "rtu"            # memory | tcp | rtu
port = "/dev/ttyUSB0"
baud = 9600
parity = "even"
writes = false               # a live link sends commands only when this says so

[equipment.m2]
type = "eura_e800"
link = "press_shop"
unit = 1
label = { hr = "Ventilator 2", en = "Fan 2", de = "Lüfter 2", cs = "Ventilátor 2" }
rated_current = 2.5
"""


def write(folder: Path, text: str | bytes) -> Path:
    (folder / "plant.toml").write_bytes(text.encode() if isinstance(text, str) else text)
    return folder


def loaded(folder: Path, text: str) -> Plant:
    plant, problems = read_plant(write(folder, text))
    assert problems == []
    assert plant is not None
    return plant


def mistakes(folder: Path, text: str | bytes) -> list[Problem]:
    plant, problems = read_plant(write(folder, text))
    assert plant is None
    assert problems
    return problems


def changed(old: str, new: str, text: str = DESIGN) -> str:
    assert old in text
    return text.replace(old, new, 1)
