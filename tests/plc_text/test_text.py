"""The structured text of docs/plc: a parser that others wrote takes it, SCL says the same, and it is what the data say, today."""

import re
from pathlib import Path

import pytest
from blark.parse import parse_source_code

from tests.links.conformance.servers import KINDS
from tests.plc_pages.page import read_page
from tests.plc_text.plc import FOLDER, program
from tools import plc_text


@pytest.mark.sweep(8)
def test_no_file_is_stale_and_none_is_left_over() -> None:
    """Red? `make registers`."""
    wanted = plc_text.files()
    for path, text in wanted.items():
        assert path.read_text("utf-8") == text, f"{path.name} is stale: make registers"
    hand = {FOLDER / "codesys" / f"{name}.st" for name in plc_text.HAND}
    assert {*FOLDER.glob("*/*.st"), *FOLDER.glob("*/*.scl")} == {*wanted, *hand}


def names(text: str) -> list[str]:
    return re.findall(r"^(?:TYPE|FUNCTION|FUNCTION_BLOCK) (\w+)", text, re.MULTILINE)


def units(path: Path) -> list[str]:
    """Types and blocks of a file, one by one."""
    return [one[0] for one in plc_text._UNIT.finditer(path.read_text("utf-8"))]


@pytest.mark.sweep(8)
@pytest.mark.slow
@pytest.mark.parametrize("name", [*plc_text.HAND, "sequence"])
def test_it_is_structured_text(name: str) -> None:
    """All that is written by hand; of what is made from data, all of one form, the shortest block of one type: that parser is slow."""
    path = FOLDER / "codesys" / f"{name}.st"
    written = units(path)
    assert names(path.read_text("utf-8")) == [names(unit)[0] for unit in written]
    for unit in written if path.stem in plc_text.HAND else [min(written, key=len)]:
        parsed = parse_source_code(unit)
        assert parsed.exception is None, unit[:80]
        assert len(parsed.transform().items) == 1


@pytest.mark.sweep(8)
def test_the_parser_can_say_no() -> None:
    unit = units(FOLDER / "codesys" / "PogonMap.st")[0]
    assert parse_source_code(unit).exception is None
    assert parse_source_code(unit.replace("END_STRUCT", "")).exception is not None


@pytest.mark.parametrize("path", sorted((FOLDER / "s7").glob("*.scl")), ids=lambda path: path.name)
def test_scl_is_the_same_text_in_its_own_clothes(path: Path) -> None:
    """Undressed it is structured text again, and word for word that of CODESYS; only the two conversions are of its own."""
    text = path.read_text("utf-8")
    assert (
        text.count("VERSION : 0.1")
        == text.count("END_FUNCTION") + text.count("END_TYPE")
        == len(names(text.replace('"', "")))
    )
    assert text.count("BEGIN\n") == text.count("END_FUNCTION")
    plain = undressed(text)
    source = (FOLDER / "codesys" / f"{path.stem}.st").read_text("utf-8")
    assert [word for word in words(plain) if word] == [word for word in words(without_union(source)) if word]


def undressed(text: str) -> str:
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r"^BEGIN\n|^VERSION : 0.1\n|^\{.*\}\n", "", text, flags=re.MULTILINE)
    text = re.sub(r'^TYPE "(\w+)"', r"TYPE \1 :", text, flags=re.MULTILINE)
    text = re.sub(r"\b(IN|IN1|IN2|N) := ", "", text)
    return (
        text.replace('"', "")
        .replace("#Regs", "Regs")
        .replace("END_STRUCT;", "END_STRUCT")
        .replace(" #", " ")
        .replace("(#", "(")
        .replace("[#", "[")
        .replace("-#", "-")
        .replace("\n#", "\n")
    )


def without_union(text: str) -> str:
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r"TYPE \w+ :\nUNION.*?END_TYPE\n", "", text, flags=re.DOTALL)
    for name, body in plc_text.BITS_IN_SCL.items():
        text = re.sub(
            rf"(FUNCTION {name} .*?END_VAR\n).*?(END_FUNCTION)",
            lambda one, body=body: f"{one[1]}{body}\n{one[2]}",
            text,
            count=1,
            flags=re.DOTALL,
        )
    return text


def words(text: str) -> list[str]:
    return re.split(r"\s+", text)


def test_every_name_that_is_used_is_declared_and_none_is_a_word_of_the_language() -> None:
    """The interpreter refuses a name that is not declared; it has read everything."""
    assert len(program().blocks) >= 25
    reserved = {
        "at",
        "on",
        "to",
        "by",
        "of",
        "action",
        "program",
        "type",
        "end",
        "task",
        "with",
        "read_only",
        "interval",
        "priority",
    }
    for block in program().blocks.values():
        assert not {name.lower() for name in block.kinds} & reserved, block.name


def test_the_page_names_the_words_that_each_type_needs_and_files_that_are_there() -> None:
    told = (FOLDER / "README.md").read_text("utf-8")
    for kind in KINDS:
        page = read_page(kind)
        slots = {"product": 20, "ramp": 6, "step": 64, "fall": 16, "force": 32}
        ends = [at + words for at, words in page.covered()]
        ends += [page.rows_at + 59 * page.row_words - 0]
        ends += [table.address + 4 + slots[table.name] * table.words for table in page.tables]
        assert f"| {kind} | {max(ends)} |" in told, max(ends)
    for path in re.findall(r"`(codesys/\w+\.st)`", told):
        assert (FOLDER / path).is_file()
    for name in re.findall(r"`(Pogon[A-Z]\w+)`", told):
        assert name in program().blocks or name in program().types or f"{name}.scl" in told, name
