"""What the read-only parameters of the virtual drive show, by code."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from types import MappingProxyType

from app.profidrive.state_machine import State, StateMachine
from app.profidrive.words import Control, Status
from app.sim.sinamics.fault_buffer import AlarmBuffer, FaultBuffer, Message
from app.sim.sinamics.image import FIRMWARE, POWER_UNIT
from app.sim.sinamics.power import PowerUnit
from app.sim.sinamics.training import REG_EMERGENCY, REG_INTERLOCK, REG_LOCAL
from app.sim.training import TrainingRegisters

PROFILE, SIEMENS = 0x0329, 42
"""r0965, r0964[0]."""
INPUTS = 0b11
"""Digital inputs that are wired: 0 run interlock, 1 emergency stop, both closed = 1."""
PULSE_FREQUENCY = 4.0
"""[kHz]"""
_DISPLAY = {
    State.OPERATION: 0,
    State.RAMP_STOP: 16,
    State.QUICK_STOP: 17,
    State.SWITCHED_ON: 21,
    State.READY_TO_SWITCH_ON: 31,
}
"""r0002 by state; numbers remembered from makers' lists and unconfirmed."""
FAULTED, NO_COAST, NO_QUICK, WAITS_FOR_OFF = 45, 42, 43, 41
"""r0002 while switching on is inhibited."""


@dataclass(frozen=True, slots=True)
class Shown:
    """The drive at one moment."""

    machine: StateMachine
    power: PowerUnit
    training: TrainingRegisters
    buffer: FaultBuffer
    alarms: AlarmBuffer
    status: int
    setpoint: float
    """In effect, before the ramp [rpm]."""
    ramp: float
    """Output of the ramp generator [rpm], 0 without pulses."""
    rated_current: float
    """[A]"""
    objects: int
    uptime: int
    """[ms]"""
    output: Sequence[int]
    """Words that it was sent."""
    words: int
    """Process data each way."""
    reference: float
    """p2000 [rpm]"""


def shown(it: Shown, code: str) -> Sequence[float] | None:
    """What parameter `code` shows, from its first element on; None = nothing of the drive's own."""
    of = _SHOWN.get(code)
    if of is None:
        return None
    value = of(it)
    return (value,) if isinstance(value, int | float) else value


def display(it: Shown) -> int:
    """Operating display, r0002."""
    if it.machine.state in _DISPLAY:
        return _DISPLAY[it.machine.state]
    if it.machine.faulted:
        return FAULTED
    if not it.status & Status.NO_COAST_STOP:
        return NO_COAST
    return NO_QUICK if not it.status & Status.NO_QUICK_STOP else WAITS_FOR_OFF


def _missing(it: Shown) -> int:
    """r0046: a bit per enable that is missing; 0 OFF1, 1 OFF2, 2 OFF3, 3 operation, others unconfirmed and not shown."""
    word = it.machine.control
    enables = (Control.ON, Control.NO_COAST_STOP, Control.NO_QUICK_STOP, Control.ENABLE_OPERATION)
    return sum(1 << bit for bit, enable in enumerate(enables) if not word & enable)


def _inputs(it: Shown) -> int:
    return int(not it.training[REG_INTERLOCK]) | int(not it.training[REG_EMERGENCY]) << 1


def _torque_current(it: Shown) -> float:
    shaft = it.power.shaft
    return sqrt(max(0.0, shaft.current**2 - _field_current(it) ** 2)) * (1 if shaft.torque >= 0 else -1)


def _field_current(it: Shown) -> float:
    return min(it.power.shaft.current, it.power.shaft.magnetising_current)


def _power_factor(it: Shown) -> float:
    shaft = it.power.shaft
    apparent = sqrt(3) * shaft.voltage * shaft.current
    return min(1.0, abs(shaft.power) / apparent) if apparent > 1 else 0.0


def _messages(of: str, pick: Callable[[Message], float]) -> Callable[[Shown], Sequence[float]]:
    def values(it: Shown) -> Sequence[float]:
        return [pick(message) for message in getattr(it, of).flat]

    return values


def _sent(it: Shown) -> Sequence[float]:
    speed = round(it.power.speed / it.reference * 0x4000) & 0xFFFF
    return [it.status, speed, *(0,) * (it.words - 2)]


def _received(it: Shown) -> Sequence[float]:
    return [word - 0x10000 if word >= 0x8000 else word for word in it.output[: it.words]]


_FAULT_NUMBERS, _ALARM_NUMBERS = _messages("buffer", lambda m: m.number), _messages("alarms", lambda m: m.number)
_SHOWN: Mapping[str, Callable[[Shown], float | Sequence[float]]] = MappingProxyType(
    {
        "r0002": display,
        "r0018": lambda it: FIRMWARE * 10000,
        "r0020": lambda it: it.setpoint,
        "r0021": lambda it: it.power.speed,
        "r0022": lambda it: it.power.speed,
        "r0024": lambda it: it.power.shaft.frequency,
        "r0025": lambda it: it.power.shaft.voltage,
        "r0026": lambda it: it.power.bus_voltage,
        "r0027": lambda it: it.power.shaft.current,
        "r0028": lambda it: 100 * it.power.shaft.voltage / max(it.power.bus_voltage / sqrt(2), 1.0),
        "r0029": _field_current,
        "r0030": _torque_current,
        "r0031": lambda it: it.power.shaft.torque,
        "r0032": lambda it: it.power.shaft.power / 1000,
        "r0035": lambda it: it.power.motor_temperature,
        "r0036": lambda it: 100 * it.power.overload,
        "r0037": lambda it: it.power.sink_temperature,
        "r0038": _power_factor,
        "r0039": lambda it: it.power.energy,
        "r0046": _missing,
        "r0052": lambda it: it.status,
        "r0054": lambda it: it.machine.control,
        "r0060": lambda it: it.ramp,
        "r0062": lambda it: it.ramp,
        "r0063": lambda it: it.power.speed,
        "r0066": lambda it: it.power.shaft.frequency,
        "r0068": lambda it: it.power.shaft.current,
        "r0070": lambda it: it.power.bus_voltage,
        "r0072": lambda it: it.power.shaft.voltage,
        "r0079": lambda it: it.power.shaft.torque,
        "r0080": lambda it: it.power.shaft.torque,
        "r0082": lambda it: it.power.shaft.power / 1000,
        "r0102": lambda it: it.objects,
        "r0200": lambda it: POWER_UNIT,
        "r0206": lambda it: it.power.data.rated_power / 1000,
        "r0207": lambda it: it.rated_current,
        "r0208": lambda it: 400,
        "r0720": lambda it: (INPUTS.bit_count(), 0),
        "r0722": _inputs,
        "r0723": lambda it: ~_inputs(it) & INPUTS,
        "r0807": lambda it: int(not it.training[REG_LOCAL]),
        "r0898": lambda it: it.machine.control,
        "r0899": lambda it: it.status & 0x7F | it.status & (Status.CONTROL_REQUESTED | Status.BRAKE_OPEN),
        "r0944": lambda it: it.buffer.changes,
        "r0945": _FAULT_NUMBERS,
        "r0947": _FAULT_NUMBERS,
        "r0948": _messages("buffer", lambda m: m.came),
        "r0949": _messages("buffer", lambda m: m.value),
        "p0952": lambda it: it.buffer.count,
        "r0964": lambda it: (SIEMENS, 0, FIRMWARE, 0, 0, it.objects, 0),
        "r0965": lambda it: PROFILE,
        "p0969": lambda it: it.uptime,
        "r1078": lambda it: it.setpoint,
        "r1119": lambda it: it.setpoint,
        "r1150": lambda it: it.ramp,
        "r1170": lambda it: it.ramp,
        "r1438": lambda it: it.ramp,
        "r1407": lambda it: 0 if it.status & Status.LIMIT_NOT_REACHED else 1 << 7,
        "r1801": lambda it: PULSE_FREQUENCY if it.machine.pulses else 0.0,
        "r2004": lambda it: it.power.data.rated_power / 1000,
        "r2050": _received,
        "r2053": _sent,
        "r2109": _messages("buffer", lambda m: m.gone),
        "r2110": _ALARM_NUMBERS,
        "r2121": lambda it: it.alarms.changes,
        "r2122": _ALARM_NUMBERS,
        "r2123": _messages("alarms", lambda m: m.came),
        "r2124": _messages("alarms", lambda m: m.value),
        "r2125": _messages("alarms", lambda m: m.gone),
        "r2131": lambda it: it.buffer.active[-1] if it.buffer.active else 0,
        "r2132": lambda it: it.alarms.present[-1].number if it.alarms.present else 0,
        "r2133": _messages("buffer", lambda m: m.value),
        "r2139": lambda it: it.status & (Status.FAULT | Status.ALARM),
        "r2197": lambda it: 1 << 7 if it.status & Status.SPEED_WITHIN_TOLERANCE else 0,
        "r2199": lambda it: 1 << 1 if it.status & Status.COMPARISON_REACHED else 0,
    }
)
"""What is not here shows what was written, or 0."""
