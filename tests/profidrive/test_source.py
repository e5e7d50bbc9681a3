"""Interconnections: a source as people write it, and as the drive keeps it."""

import pytest

from app.profidrive.parameter_access.parameter import Kind
from app.profidrive.parameter_access.source import LARGEST, parse_source, source_text

CODES = {722: "r0722", 2050: "r2050"}


@pytest.mark.parametrize(
    ("kind", "value", "text"),
    [
        (Kind.BINECTOR, 0x02D2FC03, "r0722.3"),
        (Kind.CONNECTOR, 0x0802FC01, "r2050[1]"),
        (Kind.CONNECTOR, 0x08020401, "1:r2050[1]"),
        (Kind.BINECTOR, 0x082AFC00, "2090.0"),
        (Kind.BINECTOR, 0, "0"),
        (Kind.CONNECTOR, 1, "1"),
    ],
)
def test_a_source_is_written_and_read_back(kind: Kind, value: int, text: str) -> None:
    assert source_text(kind, value, CODES) == text and parse_source(text) == value
    assert parse_source(f" {text.upper()} ") == value


@pytest.mark.parametrize(
    "text", ["", "x", "2", "-1", "0722.3.1", "70000", "64:722", "722.1024", "r722[1", "722[1024]", "1:0", "r0", "७२२", "1e3", "0.5", "722"]
)  # fmt: skip
def test_what_is_no_source_is_none(text: str) -> None:
    assert parse_source(text) is None


def test_every_word_comes_back() -> None:
    for value in (1 << 16, LARGEST, 0x02D2FC03 + 0x3FF - 3, 722 << 16):
        for kind in (Kind.BINECTOR, Kind.CONNECTOR):
            assert parse_source(source_text(kind, value, CODES)) == value
    assert source_text(Kind.BINECTOR, 1.5, CODES) == "1.5"
