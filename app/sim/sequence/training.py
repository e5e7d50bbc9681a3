"""Training registers of a sequence (app/sim/training.py tells those that all devices have).

Machine fault 1 = inputs frozen; without a machine moreover its permissive words, 1 = there:

| address | access | content |
| --- | --- | --- |
| 0xE100 | rw | abort conditions |
| 0xE101–0xE1C8 | rw | words of steps 1 to 200, as many as it has steps; one telegram reads or writes up to 125 or 123 of them |
| 0xE020–0xE02E | rw | the first 15 of these once more |
"""

from collections.abc import Mapping

from app.sim.training import COMMON_LIMITS, MORE, MORE_END, REG_POWER

TYPE_CODE = 20
"""0xE003"""
REG_PERMISSIVES = 0xE020
"""The first of its permissive words, abort conditions first."""
PERMISSIVE_WORDS = 15
REG_WORDS = MORE
"""The first of all its permissive words."""

LIMITS: Mapping[int, tuple[int, int]] = {
    **COMMON_LIMITS,
    REG_POWER: (1, 1),
    **{REG_PERMISSIVES + n: (0, 0xFFFF) for n in range(PERMISSIVE_WORDS)},
    **{address: (0, 0xFFFF) for address in range(REG_WORDS, MORE_END)},
}
"""Lowest and highest word per register of one with 200 steps."""


def limits_of(steps: int) -> Mapping[int, tuple[int, int]]:
    """Lowest and highest word per register of a sequence of so many steps."""
    return {address: span for address, span in LIMITS.items() if address <= REG_WORDS + steps}
