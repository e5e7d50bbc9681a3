"""Training registers of the drive (app/sim/training.py tells those that all devices have).

| address | access | content |
| --- | --- | --- |
| 0xE020 | rw | load, constant part [% of rated torque] |
| 0xE021 | rw | load, part that grows with the square of speed [% of rated torque at rated speed] |
| 0xE022 | rw | disturbance of the load [% of rated torque] |
| 0xE023 | rw | ambient temperature [°C] |
| 0xE024 | rw | supply voltage [V rms] |
"""

from collections.abc import Mapping

from app.sim.training import COMMON_LIMITS

TYPE_CODE = 1
"""0xE003"""
REG_LOAD = 0xE020
REG_LOAD_QUADRATIC = 0xE021
REG_DISTURBANCE = 0xE022
REG_AMBIENT = 0xE023
REG_SUPPLY = 0xE024

LIMITS: Mapping[int, tuple[int, int]] = {
    **COMMON_LIMITS,
    REG_LOAD: (0, 500),
    REG_LOAD_QUADRATIC: (0, 500),
    REG_DISTURBANCE: (0, 100),
    REG_AMBIENT: (0, 60),
    REG_SUPPLY: (0, 500),
}
"""Lowest and highest word per register."""
