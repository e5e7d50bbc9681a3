"""docs/conveyor.md, what a PLC programmer builds by, against the map itself."""

import re
from pathlib import Path
from struct import pack
from textwrap import dedent
from zlib import crc32

from app.plant import types
from app.plant.loader import read_plant
from app.plant.plant_files.languages import LANGUAGES
from app.registers import plc_map

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "conveyor.md").read_text("utf-8")
_data, _problems = types.read_type("conveyor", LANGUAGES)


def test_its_plant_file_is_read_and_is_the_preset_of_the_model(tmp_path: Path) -> None:
    (block,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    head = '[plant]\nname = "Hall"\ntimezone = "Europe/Zagreb"\n'
    (tmp_path / "plant.toml").write_text(head + dedent(block), "utf-8")
    plant, problems = read_plant(tmp_path)
    assert plant, problems
    assert not plant.links["line"].writes
    options = plant.equipment["c1"].options
    assert {key: options[key] for key in _data.type.presets["model"]} == dict(_data.type.presets["model"])


def test_it_says_how_many_connections_are_opened() -> None:
    (word,) = re.findall(r"^Up to (\w+) TCP connections", PAGE, re.MULTILINE)
    assert ("none", "one", "two", "three", "four", "five").index(word) == _data.type.device.connections
    assert f"Pogon opens up to {word} and works with one" in PAGE


def test_bytes_are_twice_the_registers_and_these_are_the_ones_of_the_map() -> None:
    rows = {
        int(register, 16): int(byte) for register, byte in re.findall(r"^\| 0x(\w{4}) \| (\d+) \|", PAGE, re.MULTILINE)
    }
    plc = _data.type.device.plc
    assert plc and plc.settings
    assert set(rows) == {
        plc_map.HEADER,
        *(image.address for image in plc.images),
        plc.settings.address,
        plc.staging,
        plc_map.COMMAND,
        plc_map.ANSWERS,
        plc_map.HOLD,
        plc_map.EVENTS,
        plc_map.EVENT_ROWS,
        *(table.address for table in _data.type.tables.values()),
    }
    assert all(byte == 2 * register for register, byte in rows.items())


def test_the_end_of_the_block_is_the_end_of_the_table() -> None:
    table = _data.type.tables["product"]
    end = table.address + plc_map.TABLE_HEAD + 20 * table.row
    assert f"register 0x{end - 1:04X}, {2 * end // 1000} {2 * end % 1000:03d} bytes" in PAGE


def test_the_ring_does_not_reach_into_the_table() -> None:
    (events,) = re.findall(r"event ring, (\d+) rows", PAGE)
    assert plc_map.EVENT_ROWS + int(events) * plc_map.EVENT_WORDS <= _data.type.tables["product"].address
    assert f"sequence MOD {events}" in PAGE


def test_its_check_sum_is_ours() -> None:
    """The lines of the page, done in Python, give the value that the page and zlib give."""

    def page(data: bytes) -> int:
        crc = 0xFFFF_FFFF
        for byte in data:
            crc ^= byte
            for _ in range(8):
                crc = crc >> 1 ^ 0xEDB8_8320 if crc & 1 else crc >> 1
        return crc ^ 0xFFFF_FFFF

    assert f"16#{crc32(b'123456789') >> 16:04X}_{crc32(b'123456789') & 0xFFFF:04X}" in PAGE
    for data in (b"123456789", b"", pack(">3f", 215.0, 445.0, 660.0)):
        assert page(data) == crc32(data)
