"""A small equipment type of a Pogon PLC, written as its files, for the tests."""

from pathlib import Path

from app.plant.definitions import Equipment, Plant
from app.plant.loader import read_plant
from app.plant.plant_files.languages import LANGUAGES
from app.plant.problems import Problem

FILES = {
    "device.toml": """
label = "type"

[device]
max_write = 123
write_functions = [6, 16]

[plc]
type_code = 10
status = "state"
events = true
images = [{ address = 0x0100, words = 16 }]
settings = { address = 0x0200, words = 8 }
staging = 0x0240

[options.slots]
default = 3
low = 1
high = 250

[options.length]
default = 660
low = 100
high = 5000

[options.simulation]
words = { start = ["automatic", "stopped"] }
numbers = { arrivals = [0, 60] }

[presets.model]
length = 660
[presets.long]
length = 4000
slots = 5
""",
    "points.toml": """
[state]
address = 0x0101
kind = "enum"
texts = [0, 1, 2]
[moving]
address = 0x0102
mask = 1
kind = "bool"
[count]
address = 0x0103
kind = "step"
[length]
address = 0x0104
type = "f32"
high = "length"
[delay]
address = 0x0204
type = "f32"
kind = "step"
scan = "once"
""",
    "setpoints.toml": """
[speed]
address = 0x0202
type = "f32"
unit = "%"
low = 5
high = 100
[delay]
low = 0
high = 60
role = "operator"
""",
    "tables.toml": """
[product]
address = 0x0800
row = 16
capacity = "slots"
[product.columns.id]
offset = 0
type = "u32"
[product.columns.state]
offset = 3
texts = [0, 1, 2]
[product.columns.head]
offset = 4
type = "f32"
unit = "mm"
decimals = 1
low = 0
high = "length"
scan = "slow"
[product.columns.left]
offset = 6
mask = 1
kind = "bool"
[product.columns.right]
offset = 6
mask = 1
shift = 1
kind = "bool"
""",
    "events.toml": """
[snapshot.product]
word = 0
type = "u32"
none = 0
all = "products"
[snapshot.second]
word = 2
type = "u32"
[events]
1 = "arrived"
20 = "jam"
21 = "jam_over"
[reasons]
2 = "wrong_state"
7 = "no_such_product"
""",
    "commands.toml": """
[start]
code = 1
feedback = "state == 1"
timeout = 2
[stop]
code = 2
feedback = "moving == 0"
timeout = 3
stop = true
moves = false
level = "C0"
[clear]
code = 4
moves = false
timeout = 2
[edit]
code = 6
moves = false
level = "C2"
needs_reason = true
timeout = 2
arguments = [
    { name = "product", type = "u32", low = 1 },
    { name = "head", low = 0, high = "length", unit = "mm", decimals = 1 },
]
[jog]
hold = true
hold_bits = 1
feedback = "moving == 1"
timeout = 2
""",
    "alarms.toml": """
[jam]
priority = 2
event = "jam"
event_clear = "jam_over"
source = 2
[late]
priority = 3
event = "arrived"
expression = "count > 4"
on_delay = 2
""",
    **{f"texts.{language}.toml": 'type = "Line"\n' for language in LANGUAGES},
}

PLANT = """
[plant]
name = "Line"
timezone = "UTC"
languages = ["en"]
[links.hall]
transport = "memory"
writes = true
[equipment.k1]
type = "line"
link = "hall"
unit = 1
"""


def write_type(folder: Path, **changed: str | None) -> Path:
    """The type `line` under `folder`; a file is `device=…` for device.toml, None leaves it out. The folder of types."""
    own = folder / "types" / "line"
    own.mkdir(parents=True, exist_ok=True)
    for name, text in FILES.items():
        given = changed.get(name.removesuffix(".toml").replace(".", "_"), text)
        if given is not None:
            (own / name).write_text(given, "utf-8")
    return own.parent


def load(folder: Path, plant: str = PLANT, **changed: str | None) -> tuple[Plant | None, list[Problem]]:
    (folder / "plant").mkdir(exist_ok=True)
    (folder / "plant" / "plant.toml").write_text(plant, "utf-8")
    return read_plant(folder / "plant", type_folder=write_type(folder, **changed))


def machine(folder: Path, more: str = "", **changed: str | None) -> Equipment:
    plant, problems = load(folder, PLANT + more, **changed)
    assert problems == []
    assert plant is not None
    return plant.equipment["k1"]


def problem(folder: Path, file: str, old: str, new: str) -> Problem:
    """The one mistake after `old` became `new` in a file of the type; what follows from it elsewhere comes after it."""
    name = file + ".toml"
    assert old in FILES[name]
    plant, problems = load(folder, **{file: FILES[name].replace(old, new, 1)})
    assert plant is None
    assert len(problems) <= 4, "what follows from one mistake is not to hide it"
    return problems[0]
