"""Numbers as people type them."""

import pytest

from app.commands.entry import parse_number
from app.errors import Refused


@pytest.mark.parametrize(
    ("text", "language", "value"),
    [
        ("30", "hr", 30.0),
        ("30,5", "hr", 30.5),
        ("30,5", "de", 30.5),
        ("30,5", "cs", 30.5),
        ("30.5", "en", 30.5),
        ("30.5", "hr", 30.5),  # the other sign, alone and unambiguous
        ("30,5", "en", 30.5),
        ("1.2345", "de", 1.2345),
        ("1,234", "hr", 1.234),  # the own sign is never a group
        ("1.234", "en", 1.234),
        ("1.234,5", "hr", 1234.5),
        ("1,234.5", "en", 1234.5),
        ("1 234,5", "cs", 1234.5),
        ("1\u00a0234\u202f567,5", "cs", 1234567.5),
        ("1.234.567", "hr", 1234567.0),
        ("-5,25", "hr", -5.25),
        ("\u22125,25", "hr", -5.25),
        ("\u20135.25", "en", -5.25),
        (" 40 Hz ", "en", 40.0),
        ("+7", "en", 7.0),
        (",5", "hr", 0.5),
        ("0", "en", 0.0),
    ],
)
def test_a_number_reads_as_its_language_writes_it(text: str, language: str, value: float) -> None:
    assert parse_number(text, language, "Hz") == value


@pytest.mark.parametrize(
    ("text", "language", "a", "b"),
    [
        ("1.234", "hr", 1234.0, 1.234),
        ("1.234", "de", 1234.0, 1.234),
        ("1.234", "cs", 1234.0, 1.234),
        ("1,234", "en", 1234.0, 1.234),
        ("-1.234", "hr", -1234.0, -1.234),
    ],
)
def test_what_can_mean_two_things_is_asked(text: str, language: str, a: float, b: float) -> None:
    with pytest.raises(Refused) as refused:
        parse_number(text, language)
    assert refused.value.reason == "why.ambiguous"
    assert (refused.value.params["a"], refused.value.params["b"]) == (a, b)


@pytest.mark.parametrize(
    "text",
    ["", " ", "-", "abc", "nan", "inf", "-inf", "1e3", "0x10", "1,2,3", "1 2", "12 34", "1.23.456", "5 kW", "5,", "--5",
     "1,234.5", "٣", "1_000", "1" * 60],
)  # fmt: skip
def test_anything_else_is_no_number(text: str) -> None:
    with pytest.raises(Refused) as refused:
        parse_number(text, "hr", "Hz")
    assert (refused.value.reason, refused.value.status) == ("why.not_a_number", 422)
