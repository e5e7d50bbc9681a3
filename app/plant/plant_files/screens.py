"""`screens/<name>.svg` of a plant folder, with `<name>.toml` beside it that may say what it is called:

    label = { hr = "Hala", en = "Hall", de = "Halle", cs = "Hala" }

A screen with mistakes is no mistake of the plant: it is there without a picture, and says what is wrong.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from app.errors import MissingFile, UnusableFile
from app.files import read_bytes
from app.plant.definitions import Equipment, PlantScreen, Scan
from app.plant.drawing import LARGEST_DRAWING, Drawn, read_drawing
from app.plant.file_words import file_words
from app.plant.plant_files.languages import PlantLanguages
from app.plant.problems import Problem
from app.plant.said import Plain, said
from app.plant.tables import Source

FOLDER = "screens"
NAME = re.compile(r"[a-z][a-z0-9_]{0,31}", re.ASCII)
MOST_SCREENS = 24


def read_screens(
    folder: Path, machines: Mapping[str, Equipment], languages: PlantLanguages
) -> tuple[dict[str, PlantScreen], list[Problem]]:
    """The screens of the plant in `folder` by name, in the order of their names, and what is wrong or left out in any of them."""
    paths = sorted((folder / FOLDER).glob("*.svg"))
    found: dict[str, PlantScreen] = {}
    told: list[Problem] = []
    points = {
        point.name: point  # what is read once after connecting is for the page of parameters
        for item in machines.values()
        for point in item.points.values()
        if point.scan is not Scan.ONCE
    }
    for path in paths[:MOST_SCREENS]:
        shown = f"{FOLDER}/{path.name}"
        if not NAME.fullmatch(path.stem):
            told.append(Problem(shown, "(file)", path.name, said("mistake.file_name")))
            continue
        try:
            drawn = read_drawing(read_bytes(path, LARGEST_DRAWING, inside=folder), shown, points, machines)
        except (MissingFile, UnusableFile) as error:
            mistake = Problem(shown, "(file)", Plain(file_words(error.found)), file_words(error.expected), error.line)
            drawn = Drawn(None, (mistake,))
        source = Source(path.with_suffix(".toml"), f"{FOLDER}/{path.stem}.toml", optional=True, inside=folder)
        table = source.table()
        label = languages.label(table, "label", default=path.stem)
        table.done()
        problems = (*drawn.problems, *source.problems)
        found[path.stem] = PlantScreen(path.stem, label, drawn.picture if not problems else None, problems)
        told += [*problems, *drawn.doubts]
    if len(paths) > MOST_SCREENS:
        number, most = said("mistake.files", number=len(paths)), said("mistake.at_most", most=MOST_SCREENS)
        told.append(Problem(FOLDER, "(file)", number, most))
    return found, told
