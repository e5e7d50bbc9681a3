"""Training registers of the conveyor (app/sim/training.py tells those that all devices have).

| address | access | content |
| --- | --- | --- |
| 0xE020 | rw | products arrive (1) or not (0) |
| 0xE021 | rw | mean interval of arrivals [0.1 s] |
| 0xE022, 0xE023 | rw | shortest and longest product [mm] |
| 0xE024, 0xE027 | rw | sensors pressed by hand: bit n = beam of sensor n+1, n+17 interrupted while set |
| 0xE025 | w | k = take the k-th product off the line (1 = front-most) without telling the PLC |
| 0xE026 | w | mm = put a product of 0xE022 mm by hand, its head there, without telling the PLC |

Machine faults of a conveyor (0xE010, one at a time): 1–3 belt n jammed · 11–13 belt n slips · 21–24 sensor n blind (never interrupted) ·
31–34 sensor n stuck (always interrupted) · 41–43 encoder of belt n dead · 50 emergency stop pressed ·
60 the host's heartbeat does not arrive. Of more belts and sensors 104–116, 204–216, 305–332, 405–432 and 504–516.
"""

from collections.abc import Mapping

from app.sim.training import COMMON_LIMITS, REG_POWER

TYPE_CODE = 10
"""0xE003"""
REG_ARRIVALS = 0xE020
REG_INTERVAL = 0xE021
REG_SHORTEST = 0xE022
REG_LONGEST = 0xE023
REG_SENSORS = 0xE024
REG_REMOVE = 0xE025
REG_PUT = 0xE026
REG_MORE_SENSORS = 0xE027

LIMITS: Mapping[int, tuple[int, int]] = {
    **COMMON_LIMITS,
    REG_POWER: (1, 1),
    REG_ARRIVALS: (0, 1),
    REG_INTERVAL: (5, 6000),
    REG_SHORTEST: (10, 400),
    REG_LONGEST: (10, 400),
    REG_REMOVE: (1, 250),
    REG_SENSORS: (0, 15),
    REG_PUT: (0, 5000),
}
"""Lowest and highest word per register, with four sensors."""


def limits(sensors: int) -> dict[int, tuple[int, int]]:
    """Lowest and highest word per register of a line with so many sensors."""
    pressed = {REG_SENSORS: (0, (1 << min(sensors, 16)) - 1)}
    return {**LIMITS, **pressed, **({REG_MORE_SENSORS: (0, (1 << sensors - 16) - 1)} if sensors > 16 else {})}
