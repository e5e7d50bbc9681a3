"""Training registers of the conveyor (app/sim/training.py tells those that all devices have).

| address | access | content |
| --- | --- | --- |
| 0xE020 | rw | products arrive (1) or not (0) |
| 0xE021 | rw | mean interval of arrivals [0.1 s] |
| 0xE022, 0xE023 | rw | shortest and longest product [mm] |
| 0xE024, 0xE027 | rw | sensors pressed by hand: bit n = beam of sensor n+1, n+17 interrupted while set |
| 0xE025 | w | k = take the k-th product off the line (1 = front-most) without telling the PLC |
| 0xE028 | rw | mean interval of the products of each lane that joins the line [0.1 s], 0 = none comes by itself |
| 0xE029 | w | n = put a product into lane n, to wait at its stop |
| 0xE026 | w | mm = put a product of 0xE022 mm by hand, its head there, without telling the PLC |

Machine faults of a conveyor (0xE010, one at a time): 1–3 belt n jammed · 11–13 belt n slips · 21–24 sensor n blind (never interrupted) ·
31–34 sensor n stuck (always interrupted) · 41–43 encoder of belt n dead · 50 emergency stop pressed ·
60 the host's heartbeat does not arrive. Of more belts and sensors 104–116, 204–216, 305–332, 405–432 and 504–516.
"""

from collections.abc import Mapping

from app.sim.conveyor.machine import Conveyor
from app.sim.training import COMMON_LIMITS, REG_MACHINE_FAULT, REG_POWER, TrainingRegisters

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
REG_LANE_INTERVAL = 0xE028
REG_LANE_PUT = 0xE029

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


def limits(sensors: int, merges: int = 0) -> dict[int, tuple[int, int]]:
    """Lowest and highest word per register of a line with so many sensors."""
    pressed = {REG_SENSORS: (0, (1 << min(sensors, 16)) - 1)}
    lanes = {REG_LANE_INTERVAL: (0, 6000), REG_LANE_PUT: (1, merges)} if merges else {}
    return {**LIMITS, **pressed, **lanes, **({REG_MORE_SENSORS: (0, (1 << sensors - 16) - 1)} if sensors > 16 else {})}


def trained(machine: Conveyor, words: TrainingRegisters, address: int, word: int) -> None:
    """What an instructor wrote takes effect."""
    if address == REG_REMOVE:
        machine.remove(word)
    elif address == REG_PUT:
        machine.place(float(word), float(words[REG_SHORTEST]))
    elif address == REG_LANE_PUT:
        machine.lanes.put(word - 1)
    elif address == REG_LANE_INTERVAL:
        machine.lanes.interval = word / 10
    elif address == REG_ARRIVALS:
        machine.arrivals = bool(word)
    elif address == REG_INTERVAL:
        machine.interval = word / 10
    elif address == REG_SHORTEST:
        machine.shortest = machine.lanes.shortest = float(word)
    elif address == REG_LONGEST:
        machine.longest = machine.lanes.longest = float(word)
    elif address in (REG_SENSORS, REG_MORE_SENSORS):
        machine.pressed = words[REG_SENSORS] | words[REG_MORE_SENSORS] << 16
    elif address == REG_MACHINE_FAULT:
        machine.fault = word
