"""Small types for the tests: a sequence with the map of register-map.md in short, a press that it works on; a definition and a plant."""

import re
from pathlib import Path

from app.plant.definitions import Equipment, Plant
from app.plant.loader import read_plant
from app.plant.plant_files.languages import LANGUAGES
from app.plant.problems import Problem

TYPES = {
    "sequence": {
        "device.toml": """
label = "type"
sequence = true
[device]
max_write = 123
write_functions = [6, 16]
[plc]
type_code = 20
status = "state"
images = [{ address = 0x0100, words = 64 }]
""",
        "points.toml": """
[state]
address = 0x0101
kind = "enum"
texts = [0, 1, 2, 3, 4, 5]
[step]
address = 0x0102
kind = "step"
high = "steps"
""",
        "tables.toml": """
[step]
address = 0x0800
row = 32
capacity = "steps"
[step.columns.id]
offset = 0
type = "u32"
"""
        + "".join(f"[step.columns.word_{n}]\noffset = {n}\n" for n in range(3, 18)),
        "commands.toml": """
[start]
code = 1
feedback = "state == 1"
[suspend]
code = 2
feedback = "state != 1"
stop = true
moves = false
[force]
code = 12
arguments = [{ name = "bit", type = "u32" }]
""",
    },
    "press": {
        "device.toml": """
label = "type"
[device]
[actions]
names = ["lower", "lift"]
[presets_of_simulation]
pressure = [0, 250]
coil = [0, 1]
""",
        "points.toml": """
[pressure]
address = 0x0001
[at_top]
address = 0x0002
kind = "bool"
[at_bottom]
address = 0x0003
kind = "bool"
[name]
address = 0x0010
type = "string"
kind = "text"
[moving_hours]
derived = { kind = "running_hours", when = "at_top == 0" }
""",
    },
}

PLANT = """[plant]
name = "Hall"
timezone = "UTC"
languages = ["hr", "en"]
[links.hall]
transport = "memory"
writes = true
[equipment.seq1]
type = "sequence"
link = "hall"
unit = 21
definition = "stroke"
machine = "p1"
label = "Stroke"
[equipment.p1]
type = "press"
link = "hall"
unit = 20
"""

STROKE = """[sequence]
label = { hr = "Hod", en = "Stroke", de = "Hub", cs = "Zdvih" }
stall_after = 2
[[steps]]
key = "lower"
label = { hr = "Spusti", en = "Lower", de = "Senken", cs = "Spustit" }
minimum = 1
maximum = 30
loss_aborts = true
actions = ["lower"]
[steps.permissives.3]
key = "pressure_ok"
label = { hr = "Tlak je dobar", en = "Pressure ok", de = "Druck in Ordnung", cs = "Tlak v pořádku" }
when = "pressure > 80"
value = "pressure"
[steps.permissives.0]
label = { en = "At the top" }
when = "at_top == 1"
forceable = false
[[steps]]
key = "lift"
label = "Lift"
actions = ["lift"]
[steps.permissives.1]
label = "At the bottom"
when = "at_bottom == 1"
[abort.0]
key = "pressure_there"
label = "Pressure is there"
when = "pressure > 20"
[[tests]]
name = "one stroke"
given = { pressure = 100, coil = 1 }
when = [{ at = 15, set = { pressure = 20 } }, { at = 0, command = "start" }, { at = 9, fault = 3 },
    { at = 11, command = "force", arguments = { bit = 3 } }]
then = [
    { within = 120, state = "done" },
    { step = "lift", within = 30 },
    { never = "pressure > 300" },
    { first_out = "pressure_ok" },
    { at = 20, expect = "at_top == 1" },
]
"""


def write_types(folder: Path, **changed: str) -> Path:
    """Both types under `folder`; a file is `press_device=…`. The folder of types."""
    for name, files in TYPES.items():
        own = folder / "types" / name
        own.mkdir(parents=True, exist_ok=True)
        for file, text in {**files, **{f"texts.{lang}.toml": 'type = "T"\n' for lang in LANGUAGES}}.items():
            (own / file).write_text(changed.get(f"{name}_{file.removesuffix('.toml')}", text), "utf-8")
    return folder / "types"


def write_plant(folder: Path, plant: str = PLANT, **definitions: str) -> Path:
    """The plant folder with its definition files; `stroke` is there unless given otherwise."""
    own = folder / "plant"
    (own / "sequences").mkdir(parents=True, exist_ok=True)
    (own / "plant.toml").write_text(plant, "utf-8")
    for name, text in {"stroke": STROKE, **definitions}.items():
        (own / "sequences" / f"{name}.toml").write_text(text, "utf-8")
    return own


def load(folder: Path, plant: str = PLANT, **definitions: str) -> tuple[Plant | None, list[Problem]]:
    """Read it with the small types."""
    return read_plant(write_plant(folder, plant, **definitions), type_folder=write_types(folder))


def loaded(folder: Path, plant: str = PLANT, **definitions: str) -> Plant:
    """Read it; it has no mistakes."""
    found, problems = load(folder, plant, **definitions)
    assert problems == []
    assert found is not None
    return found


ALONE = PLANT.replace('machine = "p1"\n', "")


OF_A_MACHINE = re.compile(r"^(when|value|actions) = .*\n", re.MULTILINE)
"""Lines of a definition that nobody evaluates without a machine."""


def sequence(folder: Path, plant: str = PLANT, **definitions: str) -> Equipment:
    return loaded(folder, plant, **definitions).equipment["seq1"]


def one(folder: Path, plant: str = PLANT, **definitions: str) -> Problem:
    plant_read, problems = load(folder, plant, **definitions)
    assert plant_read is None
    assert len(problems) == 1, problems
    return problems[0]


def changed(old: str, new: str, text: str = STROKE) -> str:
    assert old in text
    return text.replace(old, new, 1)
