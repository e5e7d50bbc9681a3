"""One wrong value in a file is one mistake: what only follows from it is none of the file, and nobody could mend it."""

import re
import shutil
from collections import Counter
from pathlib import Path

import pytest

from app.plant.loader import read_plant
from tests.conftest import ROOT
from tests.plant.test_own_types import written
from tests.plant.type_files.test_lies import WORDS
from tests.plant.type_files.test_orders import COMMANDS, POINTS

ASSIGNED = re.compile(r"^([\w.\"-]+\s*=\s*)(.+)$")
WRONG = ('"zz"', "true", "1e9", "[]", "-1", "{}")
ALARM = """
[hot]
label = "type"
consequence = "type"
cause = "type"
response = "type"
priority = 2
expression = "motor == 1"
"""
ROW = """
[x]
address = 10
kind = "enum"
texts = [0, 1, 2]
normal = [0, 1]
[y]
address = 11
scale = 0.1
unit = "mm"
low = 0
high = 100
history = false
"""


@pytest.mark.sweep(8)
@pytest.mark.parametrize("wrong", WRONG)
def test_one_wrong_value_of_an_own_type_is_told_once(tmp_path: Path, wrong: str) -> None:
    words = WORDS + 'point.y = "Y"\nalarm.hot.label = "H"\n'
    files = {"points": POINTS + ROW, "commands": COMMANDS, "alarms": ALARM, "texts_en": words}
    assert read_plant(written(tmp_path, **files))[1] == []
    bad = []
    for name in ("points", "commands", "alarms"):
        lines = files[name].splitlines()
        for number, line in enumerate(lines):
            if found := ASSIGNED.match(line):
                changed = "\n".join([*lines[:number], found[1] + wrong, *lines[number + 1 :]])
                (tmp_path / "equipment" / "scale" / f"{name}.toml").write_text(changed, "utf-8")
                told = read_plant(tmp_path)[1]
                if twice := _twice(told):
                    bad.append((name, line, [str(one) for one in told if one.key in twice]))
        (tmp_path / "equipment" / "scale" / f"{name}.toml").write_text(files[name], "utf-8")
    assert bad == []


def test_a_machine_of_no_known_type_is_told_and_not_what_a_sequence_asks_of_it(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "plants" / "feeding", tmp_path / "plant")
    file = tmp_path / "plant" / "plant.toml"
    file.write_text(file.read_text("utf-8").replace('type = "conveyor"', 'type = "conveyer"'), "utf-8")
    (told,) = read_plant(tmp_path / "plant")[1]
    assert (told.key, told.value) == ("equipment.c1.type", '"conveyer"')


@pytest.mark.parametrize("missing", ["", "adress = 10\n"])
def test_a_point_without_a_place_is_told_and_not_every_key_of_it(tmp_path: Path, missing: str) -> None:
    row = f'[x]\n{missing}type = "i32"\norder = "cdab"\nscale = 0.1\nunit = "mm"\nlow = 0\nhigh = 9\n'
    told = [str(one) for one in read_plant(written(tmp_path, points=POINTS + row, texts_en=WORDS))[1]]
    assert len(told) == 1 + bool(missing) and any("a point with `address`" in one for one in told), told
    assert not missing or any("(perhaps address)" in one for one in told)


def test_a_point_that_is_part_of_none_is_told_once(tmp_path: Path) -> None:
    row = '[x]\npart_of = "mottor"\nmask = 1\nshift = 3\n'
    (told,) = read_plant(written(tmp_path, points=POINTS + row, texts_en=WORDS))[1]
    assert (told.key, told.value) == ("x.part_of", '"mottor"')


def _twice(told: list[object]) -> list[object]:
    counts = Counter((one.file, one.key) for one in told)  # type: ignore[attr-defined]
    return [key for (_, key), number in counts.items() if number > 1]
