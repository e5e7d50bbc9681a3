"""What the words and parameters of the virtual axis show.

Bits that always stand: those of MELDW for no warning and no deviation; the stop cams are not wired.

Source: reference/profidrive.md sections 2, 6 and 7.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from app.profidrive import position_words as words
from app.profidrive.position_words import word_of
from app.profidrive.state_machine import State, StateMachine
from app.profidrive.telegrams import TELEGRAMS
from app.profidrive.words import Status
from app.sim.epos.axis import LU_PER_TURN, RATED_SPEED, RATED_TORQUE, TORQUE_PER_AMPERE, Axis
from app.sim.epos.messages import MOTOR_WARM
from app.sim.epos.positioner import BasicPositioner, Task
from app.sim.epos.registers import FULL_SPEED
from app.sim.sinamics.fault_buffer import AlarmBuffer, FaultBuffer, Message
from app.sim.sinamics.image import FIRMWARE, POWER_UNIT
from app.sim.sinamics.live_parameters import PROFILE, SIEMENS

BUS_VOLTAGE = 540.0
"""[V]"""
STANDSTILL = 20.0
"""Below it the motor stands, p1226 [rpm]."""
POWER = RATED_TORQUE * RATED_SPEED * 0.10472 / 1000
"""[kW]"""
TURNING = 1.0
"""From here on it moves forward or backward [LU/s]."""


@dataclass(frozen=True, slots=True)
class Shown:
    """The axis at one moment."""

    machine: StateMachine
    axis: Axis
    positioner: BasicPositioner
    values: Mapping[str, float]
    """Parameters by code."""
    actual: float
    """Position as the drive knows it [LU]."""
    adjusted: bool
    buffer: FaultBuffer
    alarms: AlarmBuffer
    warnings: Sequence[int]
    local: bool
    inputs: tuple[bool, bool]
    """Run interlock closed, emergency stop not pressed."""
    output: Sequence[int]
    uptime: int
    """[ms]"""

    @property
    def following(self) -> float:
        """Following error [LU]."""
        return self.positioner.position - self.actual if self.machine.pulses else 0.0

    @property
    def reached(self) -> bool:
        """The axis is at the target of its task."""
        there = self.positioner
        return there.arrived and abs(there.target - self.actual) <= self.values["p2544"]


def status(it: Shown) -> int:
    """ZSW1 of telegram 111: bits 8 and 10 to 15 are the positioner's."""
    word = it.machine.status & 0xFF | Status.CONTROL_REQUESTED
    if it.local:
        word &= ~Status.CONTROL_REQUESTED
    positioner = it.positioner
    on = {
        "alarm": bool(it.warnings),
        "following_error_within_tolerance": abs(it.following) <= it.values["p2546"],
        "target_position_reached": it.reached,
        "home_position_set": it.adjusted,
        "task_acknowledged": positioner.acknowledged,
        "drive_stopped": abs(it.axis.rpm) < STANDSTILL,
        "accelerates": positioner.acceleration * positioner.speed > 0,
        "decelerates": positioner.acceleration * positioner.speed < 0,
    }
    return word | word_of(words.ZSW1, [name for name, there in on.items() if there])


def position_status(it: Shown) -> tuple[int, int]:
    """(POS_ZSW1, POS_ZSW2)"""
    positioner, low, high = it.positioner, it.values["p2580"], it.values["p2581"]
    task, moves = positioner.task, it.axis.speed
    one = {
        "jogging": task is Task.JOG,
        "traversing_blocks": task is Task.BLOCKS,
        "set_up": task is Task.SET_UP,
        "mdi": task in (Task.MDI, Task.SET_UP),
    }
    two = {
        "velocity_limited": positioner.limited,
        "setpoint_static": not positioner.speed,
        "within_position_window": it.reached,
        "moves_forward": moves > TURNING,
        "moves_backward": moves < -TURNING,
        "software_limit_minus": it.adjusted and it.actual <= low,
        "software_limit_plus": it.adjusted and it.actual >= high,
        "traversing_command": task is not Task.NONE and not positioner.arrived,
    }
    block = positioner.block if task is Task.BLOCKS else 0
    return (
        block | word_of(words.POS_ZSW1, [name for name, there in one.items() if there]),
        word_of(words.POS_ZSW2, [name for name, there in two.items() if there]),
    )


def message_word(it: Shown) -> int:
    """MELDW"""
    on = {
        "ramp_finished": not it.positioner.acceleration,
        "torque_below_threshold": abs(it.axis.torque) < 0.9 * RATED_TORQUE,
        "speed_below_3": abs(it.axis.rpm) < STANDSTILL,
        "no_motor_overtemperature": MOTOR_WARM not in it.warnings,
        "no_power_unit_overload": True,
        "speed_within_tolerance": not it.axis.limited,
        "controller_enabled": it.machine.pulses,
        "drive_ready": it.machine.state is not State.INHIBITED,
        "pulses_enabled": it.machine.pulses,
    }
    return word_of(words.MELDW, [name for name, there in on.items() if there])


def telegram(it: Shown) -> tuple[int, ...]:
    """The twelve words from the drive."""
    one, two = position_status(it)
    faults = it.buffer.active
    sent = {
        "ZSW1": status(it),
        "POS_ZSW1": one,
        "POS_ZSW2": two,
        "ZSW2": word_of(words.ZSW2, ["pulses_enabled"] if it.machine.pulses else []) | it.output[3] & 0xF000,
        "MELDW": message_word(it),
        "XIST_A": _fits(it.actual),
        "NIST_B": _fits(it.axis.rpm / it.values["p2000"] * FULL_SPEED),
        "FAULT_CODE": faults[-1] if faults else 0,
        "WARN_CODE": it.warnings[-1] if it.warnings else 0,
    }
    return TELEGRAMS[111].into.pack(sent)


def shown(it: Shown, code: str) -> Sequence[float] | None:
    """What parameter or register `code` shows, from its first element on; None = nothing of the drive's own."""
    of = _SHOWN.get(code)
    if of is None:
        return None
    value = of(it)
    return (value,) if isinstance(value, int | float) else value


def _fits(value: float) -> int:
    return round(min(max(value, -0x8000_0000), 0x7FFF_FFFF))


def _messages(of: str, pick: Callable[[Message], float]) -> Callable[[Shown], Sequence[float]]:
    return lambda it: [pick(message) for message in getattr(it, of).flat]


def _rate(it: Shown, speed: float) -> float:
    """[1000 LU/min]"""
    return speed * 60 / 1000


_SHOWN: Mapping[str, Callable[[Shown], float | Sequence[float]]] = MappingProxyType(
    {
        "r0018": lambda it: FIRMWARE * 10000,
        "r0020": lambda it: it.positioner.speed / LU_PER_TURN * 60,
        "r0021": lambda it: it.axis.rpm,
        "r0022": lambda it: it.axis.rpm,
        "r0026": lambda it: BUS_VOLTAGE,
        "r0027": lambda it: it.axis.current,
        "r0030": lambda it: it.axis.torque / TORQUE_PER_AMPERE,
        "r0031": lambda it: it.axis.torque,
        "r0032": lambda it: it.axis.power,
        "r0035": lambda it: it.axis.temperature,
        "r0039": lambda it: it.axis.energy,
        "r0052": status,
        "r0054": lambda it: it.machine.control,
        "r0063": lambda it: it.axis.rpm,
        "r0068": lambda it: it.axis.current,
        "r0070": lambda it: BUS_VOLTAGE,
        "r0079": lambda it: it.axis.torque,
        "r0080": lambda it: it.axis.torque,
        "r0082": lambda it: it.axis.power,
        "r0102": lambda it: 2,
        "r0200": lambda it: POWER_UNIT,
        "r0206": lambda it: POWER,
        "r0722": lambda it: it.inputs[0] | it.inputs[1] << 1,
        "r0807": lambda it: float(not it.local),
        "r0944": lambda it: it.buffer.changes,
        "r0945": _messages("buffer", lambda m: m.number),
        "r0947": _messages("buffer", lambda m: m.number),
        "r0948": _messages("buffer", lambda m: m.came),
        "r0949": _messages("buffer", lambda m: m.value),
        "p0952": lambda it: it.buffer.count,
        "r0964": lambda it: (SIEMENS, 0, FIRMWARE, 0, 0, 2, 0),
        "r0965": lambda it: PROFILE,
        "p0969": lambda it: it.uptime,
        "r0898": lambda it: it.machine.control,
        "r2050": lambda it: [word - 0x10000 if word >= 0x8000 else word for word in it.output],
        "r2053": lambda it: telegram(it)[:10],
        "r2109": _messages("buffer", lambda m: m.gone),
        "r2110": lambda it: list(it.warnings),
        "r2121": lambda it: it.alarms.changes,
        "r2122": _messages("alarms", lambda m: m.number),
        "r2123": _messages("alarms", lambda m: m.came),
        "r2124": _messages("alarms", lambda m: m.value),
        "r2125": _messages("alarms", lambda m: m.gone),
        "r2131": lambda it: it.buffer.active[-1] if it.buffer.active else 0,
        "r2132": lambda it: it.warnings[-1] if it.warnings else 0,
        "r2133": _messages("buffer", lambda m: m.value),
        "r2139": lambda it: status(it) & (Status.FAULT | Status.ALARM),
        "r2521": lambda it: it.actual,
        "r2522": lambda it: _rate(it, it.axis.speed),
        "r2556": lambda it: it.positioner.position,
        "r2562": lambda it: _rate(it, it.positioner.speed),
        "r2563": lambda it: it.following,
        "r2665": lambda it: it.positioner.position,
    }
)
