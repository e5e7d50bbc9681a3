"""How a report writes registers, and how a rule is broken."""

import pytest

from app.errors import DeviceException, NoAnswer
from app.links.conformance.finding import Broken, Skipped, at, refusal, require, require_none, several, span


def test_registers_and_refusals_are_written_in_one_way() -> None:
    assert (at(0x100, 4), span(0x100, 96), span(9, 1)) == ("0x0100 = 4", "0x0100–0x015F", "0x0009")
    assert refusal(DeviceException(2)) == "exception 02"
    assert refusal(NoAnswer("silence")) == "{no_answer}"
    assert several("abc") == "a, b, c"
    assert several("abcdefg") == "a, b, c, d, … (7)"


def test_a_rule_says_what_was_seen_and_expected() -> None:
    require(True, "x", "y")
    require_none([])
    with pytest.raises(Broken, match="x, expected y"):
        require(0, "x", "y")
    with pytest.raises(Broken) as broken:
        require_none([("0x0001 = 2", "1"), ("0x0003 = 2", "1")])
    assert (broken.value.seen, broken.value.expected) == ("0x0001 = 2, 0x0003 = 2", "1")
    assert Skipped("needs", "header").needs == "header"
