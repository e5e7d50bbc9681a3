"""Training registers of the coil car (app/sim/training.py tells those that all devices have).

0xE020 strip arrives (1) or not (0) · 0xE021 growth of the coil [0.1 mm/s] · 0xE022 the crane takes a coil so many seconds
after it was laid, 0 = never; machine faults in `register_map`.
"""

from collections.abc import Mapping

from app.sim.training import COMMON_LIMITS, REG_POWER

TYPE_CODE = 30
"""0xE003"""
REG_STRIP = 0xE020
REG_GROWTH = 0xE021
REG_CRANE = 0xE022

LIMITS: Mapping[int, tuple[int, int]] = {
    **COMMON_LIMITS,
    REG_POWER: (1, 1),
    REG_STRIP: (0, 1),
    REG_GROWTH: (1, 60000),
    REG_CRANE: (0, 6000),
}
"""Lowest and highest word per register."""
