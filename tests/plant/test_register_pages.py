"""docs/registers is what the data say, today."""

import re

import pytest

from app.plant import types
from app.plant.plant_files.languages import LANGUAGES
from app.plant.texts import Texts
from app.registers import plc_map
from app.sim.plc import header
from tools import registers


@pytest.mark.sweep(8)
def test_no_page_is_stale_and_no_type_lacks_one() -> None:
    """Red? `make registers`."""
    wanted = registers.pages()
    assert {path.name for path in registers.FOLDER.glob("*.md")} == {path.name for path in wanted}
    for path, text in wanted.items():
        assert path.read_text("utf-8") == text, f"{path.name} is stale: make registers"


@pytest.mark.sweep(8)
def test_the_same_data_make_the_same_page() -> None:
    assert registers.pages() == registers.pages()


def test_a_page_names_every_register_command_event_and_reason() -> None:
    data, _ = types.read_type("conveyor", LANGUAGES)
    page = registers.page(data)
    rows = [line for line in page.splitlines() if line.startswith("|")]
    of_tables = tuple(f"{name}_" for name in data.columns)
    for key, point in data.type.points.items():
        if point.register and point.register.address >= 32 and not key.startswith(of_tables):
            where = f"0x{point.register.address:04X}"
            assert any(f"`{key}`" in row and where in row for row in rows), key
    for key in (*data.type.commands, *data.type.events.values(), *data.type.reasons.values()):
        assert any(f"`{key}`" in row for row in rows), key
    for column in (column for columns in data.columns.values() for column in columns):
        assert any(f"`{column}`" in row for row in rows), column


def test_a_flag_of_the_header_is_named_by_the_number_of_its_bit() -> None:
    """`bits 1 simulated, 2 writable` was read as bit 2, which says local: nothing was written to such a PLC."""
    page = registers.page(types.read_type("conveyor", LANGUAGES)[0])
    (row,) = re.findall(r"^\| 6 \| u16 \| (bit 0 .*) \|$", page, re.MULTILINE)
    told = {name: 1 << int(bit) for bit, name in re.findall(r"bit (\d+) (\w+)", row)}
    assert told == {"simulated": plc_map.SIMULATED, "writable": plc_map.WRITABLE, "local": plc_map.LOCAL}
    for language in LANGUAGES:
        place = re.findall(r"\(\w+ (\d+), \w+ (\d+)\)", Texts.read().text(language, "conform.why.not_writable"))
        assert place == [(str(plc_map.AT_FLAGS), str(plc_map.WRITABLE.bit_length() - 1))], language


def test_every_word_of_an_image_is_said_to_be_something() -> None:
    page = registers.page(types.read_type("conveyor", LANGUAGES)[0])
    for begin, words in ((0x0100, 96), (0x0180, 64)):
        part = page.split(f"## Image 0x{begin:04X}")[1].split("\n## ")[0]
        said: set[int] = set()
        for row in part.splitlines():
            if row.startswith("| 0x"):
                place, kind = (cell.strip() for cell in row.split("|")[1:3])
                first, _, last = place.partition("–")
                end = (
                    int(last, 16)
                    if last
                    else int(first, 16) + registers.TAKES.get(kind.split()[0] if kind else "", 1) - 1
                )
                said |= set(range(int(first, 16), end + 1))
        assert said == set(range(begin, begin + words))


@pytest.mark.sweep(8)
def test_the_header_has_the_words_and_types_that_a_device_sends() -> None:
    sent = {"H": ("u16", 1), "I": ("u32", 2), "Q": ("u64", 4)}
    at, device = 0, {}
    for count, code in re.findall(r"(\d*)([HIQ])", header._HEADER.format):
        for _ in range(int(count or 1)):
            device[at] = sent[code][0]
            at += sent[code][1]
    told = {}
    for first, form, _ in registers.HEADER:
        count, _, kind = form.rpartition(" × ")
        for n in range(int(count or 1)):
            told[first + n] = kind
    assert at == plc_map.HEADER_WORDS and told == device
    for page in (text for path, text in registers.pages().items() if not path.stem.endswith("_more")):
        assert "| 19–22 | u64 | step number" in page
