"""Codes of function parameters that are registers: F114 is 0x010E, group digit as high byte, the two digits behind it as low byte.

Source: reference/eura-e800.md section 5 [M][T][C]. Groups are 1 to 9 and A; the digits behind them are decimal, also where a manual
prints `F10DH` for F113.
"""

import re

GROUPS = "123456789A"
MOST = 99
"""Highest number within a group."""


def address_of(code: str) -> int | None:
    """Register of `code` (F114, FA05); None when it is no such code."""
    found = re.fullmatch(rf"F([{GROUPS}])(\d\d)", code, re.ASCII)
    return int(found[1], 16) << 8 | int(found[2]) if found else None


def code_of(address: int) -> str:
    """Code whose register `address` is; empty when there is none."""
    group, number = f"{address >> 8:X}", address & 0xFF
    return f"F{group}{number:02d}" if group in tuple(GROUPS) and number <= MOST else ""
