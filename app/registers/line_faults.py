"""What an instructor can do to a line, as training registers know it (reference/register-map.md)."""

from collections.abc import Mapping

SLOW_DELAY = 1500
"""Delay of a slow answer when none is named [ms]: longer than any time-out of an equipment type."""

LINE_FAULTS: Mapping[str, int] = {
    "cable": 1,
    "slow": 2,
    "silent": 3,
    "wrong-unit": 4,
    "wrong-length": 5,
    "wrong-answer": 6,
    "exception": 7,
}
"""Name on the command line → mode of 0xE011."""
