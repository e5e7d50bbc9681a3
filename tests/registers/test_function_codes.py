"""F-codes and their registers."""

import pytest

from app.registers.function_codes import address_of, code_of


@pytest.mark.parametrize(
    ("code", "address"),
    [("F111", 267), ("F112", 268), ("F113", 269), ("F114", 270), ("F200", 0x200), ("F203", 0x203), ("F277", 0x24D),
     ("F280", 0x250), ("F801", 0x801), ("F810", 0x80A), ("F900", 0x900), ("F905", 0x905), ("FA00", 0xA00)],
)  # fmt: skip
def test_codes_stand_where_the_reference_says(code: str, address: int) -> None:
    assert address_of(code) == address
    assert code_of(address) == code


def test_every_code_has_a_register_of_its_own_and_comes_back() -> None:
    codes = [f"F{group}{number:02d}" for group in "123456789A" for number in range(100)]
    assert [code_of(address_of(code) or 0) for code in codes] == codes


@pytest.mark.parametrize("text", ["", "F000", "FB00", "F1", "F1000", "f114", "F10D", "P114", "F1１4", "F-14"])
def test_what_is_no_code_has_no_register(text: str) -> None:
    assert address_of(text) is None


@pytest.mark.parametrize("address", [0x0000, 0x0063, 0x0164, 0x01FF, 0x0B00, 0x1000, 0x2000, -1])
def test_other_registers_have_no_code(address: int) -> None:
    assert code_of(address) == ""
