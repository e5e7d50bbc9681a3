"""Training registers of the crane (app/sim/training.py tells those that all devices have), and its machine faults.

0xE020 the crane orders its own cycles (1) or not (0) · 0xE021 pause between them [s] · 0xE022 weight of the ladle [0.1 t].

| fault (0xE010) | what |
| --- | --- |
| 1–4 | drive trips: hoist 1, hoist 2, trolley, bridge |
| 11–14 | drive does not answer |
| 21–24 | brake sticks: hoist 1, hoist 2, trolley, bridge |
| 31–34 | feedback of the brake lost: it says closed |
| 41–43 | encoder fails: hoist, trolley, bridge |
| 51–56 | stop switch does not answer: hoist lower, upper, trolley, bridge |
| 61–66 | slow-down switch does not answer |
| 71–74 | rope overlaps, rope slack, overload, scale fails |
| 81–84 | motor too hot |
| 90, 91, 92 | emergency stop pressed, hoist over-speed, the host's heartbeat does not arrive |
| 93 | retained memory takes nothing: a set of settings that has arrived whole is not kept |
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from app.sim.training import COMMON_LIMITS, REG_POWER

TYPE_CODE = 40
"""0xE003"""
REG_ORDERS = 0xE020
REG_PAUSE = 0xE021
REG_LADLE = 0xE022

LIMITS: Mapping[int, tuple[int, int]] = MappingProxyType(
    {**COMMON_LIMITS, REG_POWER: (1, 1), REG_ORDERS: (0, 1), REG_PAUSE: (0, 3600), REG_LADLE: (0, 4000)}
)
"""Lowest and highest word per register."""

TRIP, SILENT, BRAKE_STICKS, FEEDBACK_LOST, ENCODER, STOP_DEAD, SLOW_DEAD, HOT = 1, 11, 21, 31, 41, 51, 61, 81
"""First code of each row."""
ROPE_OVERLAP, SLACK_ROPE, OVERLOAD, SCALE = 71, 72, 73, 74
EMERGENCY_STOP, OVER_SPEED, HOST_OFF, MEMORY = 90, 91, 92, 93
FAULTS: Sequence[int] = (
    *(first + n for first in (TRIP, SILENT, BRAKE_STICKS, FEEDBACK_LOST) for n in range(4)),
    *(ENCODER + n for n in range(3)),
    *(first + n for first in (STOP_DEAD, SLOW_DEAD) for n in range(6)),
    *(ROPE_OVERLAP, SLACK_ROPE, OVERLOAD, SCALE),
    *(HOT + n for n in range(4)),
    *(EMERGENCY_STOP, OVER_SPEED, HOST_OFF, MEMORY),
)
