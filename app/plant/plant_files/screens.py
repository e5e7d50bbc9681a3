"""`screens/<name>.svg` of a plant folder, with `<name>.toml` beside it that may say what it is called:

    label = { hr = "Hala", en = "Hall", de = "Halle", cs = "Hala" }
    place = 1        # among the screens, 1 to 99; those without one come after the others, by name

A screen with mistakes is no mistake of the plant: it is there without a picture, and says what is wrong.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from app.errors import MissingFile, UnusableFile
from app.files import ORDINARY, read_bytes
from app.plant.definitions import Equipment, PlantScreen, Scan
from app.plant.drawing import LARGEST_DRAWING, Drawn, read_drawing
from app.plant.file_words import file_words
from app.plant.plant_files.languages import PlantLanguages
from app.plant.problems import Problem
from app.plant.said import Plain, printable, said
from app.plant.tables import LONGEST_SHOWN, Source

FOLDER = "screens"
NAME = re.compile(r"[a-z][a-z0-9_]{0,31}", re.ASCII)
MOST_SCREENS = 24
LAST = 99
"""Place of a screen."""


def read_screens(
    folder: Path, machines: Mapping[str, Equipment], languages: PlantLanguages
) -> tuple[dict[str, PlantScreen], list[Problem]]:
    """The screens of the plant in `folder` by name, in the order of their tabs, and what is wrong or left out in any of them."""
    paths, told = _drawings(folder / FOLDER)
    found: list[PlantScreen] = []
    points = {
        point.name: point  # what is read once after connecting is for the page of parameters
        for item in machines.values()
        for point in item.points.values()
        if point.scan is not Scan.ONCE
    }
    for path in paths[:MOST_SCREENS]:
        shown = f"{FOLDER}/{path.name}"
        if not NAME.fullmatch(path.stem) or path.suffix != ".svg":
            told.append(Problem(shown, "(file)", path.name, said("mistake.svg_name")))
            continue
        try:
            drawn = read_drawing(read_bytes(path, LARGEST_DRAWING, inside=folder), shown, points, machines)
        except (MissingFile, UnusableFile) as error:
            expected = said("mistake.svg_file") if error.expected == ORDINARY else file_words(error.expected)
            mistake = Problem(shown, "(file)", Plain(file_words(error.found)), expected, error.line)
            drawn = Drawn(None, (mistake,))
        source = Source(path.with_suffix(".toml"), f"{FOLDER}/{path.stem}.toml", optional=True, inside=folder)
        table = source.table()
        label = languages.label(table, "label", default=path.stem)
        place = table.whole("place", None, 1, LAST)
        table.done()
        problems = (*drawn.problems, *source.problems)
        found.append(PlantScreen(path.stem, label, drawn.picture if not problems else None, problems, place))
        told += [*problems, *drawn.doubts]
    if len(paths) > MOST_SCREENS:
        number, most = said("mistake.files", number=len(paths)), said("mistake.at_most", most=MOST_SCREENS)
        told.append(Problem(FOLDER, "(file)", number, most))
    found.sort(key=lambda screen: (screen.place or LAST + 1, screen.name))
    return {screen.name: screen for screen in found}, told


def _drawings(folder: Path) -> tuple[list[Path], list[Problem]]:
    """The drawings in `folder`, and what is there that nobody would read and somebody may have meant."""
    told: list[Problem] = []
    try:
        paths = sorted(folder.iterdir())
    except FileNotFoundError:
        return [], []
    except OSError as error:
        found = said("mistake.a_file") if isinstance(error, NotADirectoryError) else file_words(error.strerror or "")
        return [], [Problem(FOLDER, "(file)", Plain(found), said("mistake.svg_folder"))]
    drawings = [path for path in paths if path.suffix.lower() == ".svg"]
    named = {path.stem for path in drawings}
    for path in paths:
        read = path.suffix == ".toml"
        if path.suffix.lower() == ".toml" and not (read and path.stem in named):
            expected = said("mistake.svg_beside", file=f"{path.stem}.svg") if read else said("mistake.file_name")
            told.append(Problem(f"{FOLDER}/{path.name}", "(file)", printable(path.name, LONGEST_SHOWN), expected))
        elif path not in drawings and path.is_dir() and any(path.glob("*.svg")):
            shown = f"{FOLDER}/{path.name}"
            told.append(Problem(shown, "(file)", said("mistake.a_folder"), said("mistake.svg_here")))
    return drawings, told
