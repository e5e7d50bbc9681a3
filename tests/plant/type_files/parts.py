"""A type whose points are parts of a word."""

from pathlib import Path

from app.plant import types
from app.plant.definitions import EquipmentType
from app.plant.problems import Problem

POINTS = """
[word]
address = 10
writable = true
label = "x"
[ready]
part_of = "word"
shift = 3
kind = "bool"
label = "x"
[state]
part_of = "word"
mask = 0x0F
label = "x"
"""


COMMANDS = """
[go]
writes = [
    { point = "word", value = 1, when = "ready == 0" },
    { point = "word", value = 2, after = "ready == 1", within = 3 },
]
feedback = "state == 2"
label = "x"
"""


def read(folder: Path, points: str = POINTS, commands: str = COMMANDS) -> tuple[EquipmentType, list[Problem]]:
    kind = folder / "thing"
    kind.mkdir()
    (kind / "device.toml").write_text('label = "x"\n[device]\nread_functions = [3, 4]\n')
    (kind / "points.toml").write_text(points)
    (kind / "commands.toml").write_text(commands)
    data, problems = types.read_type("thing", (), folder)
    return data.type, problems
