"""The plant that the stored events are of: two conveyors, a coil car, its transport sequence and a short one."""

from pathlib import Path

from tests.web import sequence_plant

LINE = """
[links.line]
transport = "memory"
label = { hr = "Traka", en = "Line", de = "Band", cs = "Pás" }
[equipment.c1]
type = "conveyor"
link = "line"
unit = 10
label = { hr = "Traka 1", en = "Conveyor 1", de = "Band 1", cs = "Pás 1" }
[equipment.c2]
type = "conveyor"
link = "line"
unit = 11
label = { hr = "Traka 2", en = "Conveyor 2", de = "Band 2", cs = "Pás 2" }
"""


def write(folder: Path) -> Path:
    """Its folder."""
    sequence_plant.write(folder)
    with (folder / "plant.toml").open("a", encoding="utf-8") as file:
        file.write(LINE)
    return folder
