"""The register of a point, and which points may lie on the same words."""

from pathlib import Path

import pytest

from app.plant.definitions import Order, Register, Type
from app.plant.problems import Problem
from app.plant.tables import Source
from app.plant.type_files.registers import WORDS, read_register
from tests.plant.type_files.parts import read


def described(folder: Path, text: str) -> tuple[Register, list[Problem]]:
    file = folder / "points.toml"
    file.write_text("address = 5\n" + text)
    source = Source(file, "points.toml")
    return read_register(source.table(), writable=False), source.problems


@pytest.mark.parametrize("kind", [kind for kind in Type if kind is not Type.BIT])
def test_a_type_has_its_number_of_words_and_no_other(tmp_path: Path, kind: Type) -> None:
    register, problems = described(tmp_path, f'type = "{kind.value}"')
    assert (register.words, register.type, problems) == (WORDS[kind], kind, [])
    register, problems = described(tmp_path, f'type = "{kind.value}"\nwords = 7')
    assert [one.key for one in problems] == ([] if kind is Type.STRING else ["words"])


def test_everything_that_can_be_said_of_a_register_is_kept(tmp_path: Path) -> None:
    text = 'type = "u32"\norder = "cdab"\ntable = "input"\nmask = 0xFF\nshift = 8\nscale = 0.1\noffset = -40\nnone = 0x8000'
    register, problems = described(tmp_path, text + "\nwritable = true\nreadable = false")
    assert problems == []
    assert register == Register(
        5, Type.U32, Order.CDAB, "input", 0xFF, 8, 0.1, -40.0, words=2, writable=True, readable=False, none=0x8000
    )


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ('type = "u8"', "type"),
        ('order = "dabc"', "order"),
        ('table = "coils"', "table"),
        ("mask = 0", "mask"),
        ("shift = 64", "shift"),
        ("scale = 0", "scale"),
        ("scale = inf", "scale"),
        ("none = -1", "none"),
        ("writable = 1", "writable"),
    ],
)
def test_what_a_register_cannot_be_is_told(tmp_path: Path, text: str, key: str) -> None:
    register, problems = described(tmp_path, text)
    assert [one.key for one in problems] == [key]
    assert register.scale, "a reader that goes on divides by it"


LOW, HIGH = "mask = 0x0F", "mask = 0x0F\nshift = 4"


@pytest.mark.parametrize(
    ("one", "other", "told"),
    [
        (LOW, HIGH, []),
        (LOW, LOW, ["b.address"]),
        (LOW, "mask = 0x10", []),
        (LOW, "", ["b.address"]),
        (LOW, 'type = "i16"\n' + HIGH, ["b.address"]),
        ('type = "u32"', "address = 10", ["b.address"]),
        ('type = "u32"', "address = 11", []),
        (LOW, 'table = "input"', []),
    ],
)
def test_two_points_share_words_only_in_parts(tmp_path: Path, one: str, other: str, told: list[str]) -> None:
    place = "" if "address" in other else "address = 9\n"
    _, problems = read(tmp_path, f'[a]\naddress = 9\nlabel = "x"\n{one}\n[b]\nlabel = "x"\n{place}{other}', "")
    assert [problem.key for problem in problems] == told
