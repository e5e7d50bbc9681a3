"""A table whose rows are interventions says so with what is there; the whole plant then knows them without knowing the machine."""

from pathlib import Path

import pytest

from app.plant.definitions import Interventions
from app.plant.loader import read_plant
from app.running.page_tags import force_names, page_tags
from tests.plant.line import FILES, PLANT, write_type

SAID = """
[product.interventions]
count = "count"
remaining = "head"
owner = "state"
record = "stay"
release = "take_back"
release_all = "clear"
"""
TAKE_BACK = """
[take_back]
code = 9
timeout = 2
arguments = [{ name = "left", type = "u32" }]
"""
RECORDS = """
[stay]
number = "product"
begin = ["arrived"]
[[stay.end]]
outcome = "gone"
events = ["jam"]
"""


def read(folder: Path, said: str = SAID, take_back: str = TAKE_BACK) -> tuple[object, list[tuple[str, str, str]]]:
    types = write_type(folder, tables=FILES["tables.toml"] + said, commands=FILES["commands.toml"] + take_back)
    (types / "line" / "records.toml").write_text(RECORDS)
    (folder / "plant.toml").write_text(PLANT + '[equipment.k2]\ntype = "line"\nlink = "hall"\nunit = 2\n')
    plant, problems = read_plant(folder, type_folder=types)
    return plant, [(problem.file, problem.key, problem.expected) for problem in problems]


def test_what_its_rows_are_is_read_and_their_tags_are_on_the_page_of_forces(tmp_path: Path) -> None:
    plant, problems = read(tmp_path)
    assert problems == [] and plant is not None
    found = plant.types["line"].interventions  # type: ignore[attr-defined]
    assert found == {"product": Interventions("count", "head", "state", "stay", "take_back", "clear")}
    assert force_names(plant) == ["k1.count", "k2.count"]  # type: ignore[arg-type]
    names = page_tags("forces", plant, {"sys.events.k1"})  # type: ignore[arg-type]
    assert {"k1.product_3_head", "k2.product_1_id", "sys.commands.k2", "sys.events.k1"} <= set(names)
    assert "k1.length" not in names and "sys.events.k2" not in names


def test_a_machine_without_such_a_table_has_none(tmp_path: Path) -> None:
    plant, problems = read(tmp_path, "")
    assert problems == [] and plant is not None
    assert force_names(plant) == []  # type: ignore[arg-type]
    assert not [name for name in page_tags("forces", plant, ()) if name.startswith(("k1", "k2"))]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("key", "wrong", "expected"),
    [
        ("count", "counts", "a point: one of"),
        ("remaining", "count", "a column of product: one of"),
        ("owner", "heads", "a column of product: one of"),
        ("record", "passage", "a kind of record: one of"),
        ("release", "stopp", "a command: one of"),
        ("release", "edit", "a command whose arguments are columns of product; product is none"),
        ("release_all", "take", "a command: one of"),
    ],
)
def test_what_is_not_there_is_told_with_its_line(tmp_path: Path, key: str, wrong: str, expected: str) -> None:
    former = next(line for line in SAID.splitlines() if line.startswith(f"{key} ="))
    _, problems = read(tmp_path, SAID.replace(former, f'{key} = "{wrong}"'))
    assert [(file, name) for file, name, _ in problems] == [("line/tables.toml", f"product.interventions.{key}")]
    assert problems[0][2].startswith(expected)


@pytest.mark.parametrize("key", ["count", "remaining", "owner", "record", "release", "release_all"])
def test_everything_of_it_must_be_said(tmp_path: Path, key: str) -> None:
    lines = [line for line in SAID.splitlines() if not line.startswith(f"{key} =")]
    _, problems = read(tmp_path, "\n".join(lines))
    assert [name for _, name, _ in problems] == [f"product.interventions.{key}"]


def test_a_word_that_it_does_not_know_is_told(tmp_path: Path) -> None:
    _, problems = read(tmp_path, SAID + 'why = "stay"\n')
    assert [name for _, name, _ in problems] == ["product.interventions.why"]
