"""The numbers of older manuals: coils from 00001, discrete inputs from 10001, input registers from 30001, holding registers from 40001.

The first digit names the table, the others count from 1: four of them, or five above 9999 (reference/modbus.md section 2).
"""

import re

DIGITS = {"coil": "0", "discrete": "1", "input": "3", "holding": "4"}
"""Table → first digit."""
_TABLES = {digit: table for table, digit in DIGITS.items()}
_FORM = re.compile(r"([0134])(\d{4,5})", re.ASCII)


def reference(address: int, table: str) -> str:
    """The number of the 0-based `address`; six digits above 9999."""
    return f"{DIGITS[table]}{address + 1:0{4 if address < 9999 else 5}d}"


def place(number: str) -> tuple[str, int] | None:
    """Table and 0-based address of such a number; None when it is none."""
    found = _FORM.fullmatch(number)
    address = int(found[2]) - 1 if found else -1
    return (_TABLES[found[1]], address) if found and 0 <= address <= 0xFFFF else None
