"""The numbers of a manual and the addresses of the protocol are one to one."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.registers.pdu import FUNCTIONS
from app.registers.references import DIGITS, place, reference


@given(st.sampled_from(list(FUNCTIONS)), st.integers(0, 0xFFFF))
def test_every_place_has_one_number(table: str, address: int) -> None:
    number = reference(address, table)
    assert place(number) == (table, address) and len(number) in (5, 6)


@pytest.mark.parametrize(
    ("number", "found"),
    [
        ("40001", ("holding", 0)), ("400001", ("holding", 0)), ("44097", ("holding", 4096)), ("404097", ("holding", 4096)),
        ("30010", ("input", 9)), ("10017", ("discrete", 16)), ("00001", ("coil", 0)), ("000001", ("coil", 0)),
        ("49999", ("holding", 9998)), ("410000", ("holding", 9999)), ("465536", ("holding", 65535)),
    ],
)  # fmt: skip
def test_five_and_six_digits_count_from_one(number: str, found: tuple[str, int]) -> None:
    assert place(number) == found


@pytest.mark.parametrize(
    "number", ["", "1", "4001", "40000", "00000", "20001", "50001", "465537", "4000001", "4x001", "40001 ", "٤٠٠٠١"]
)
def test_what_is_no_such_number_is_no_place(number: str) -> None:
    assert place(number) is None


def test_every_table_has_its_digit() -> None:
    assert DIGITS.keys() == FUNCTIONS.keys()
