"""What a virtual positioning axis is at one moment: its parts, and what telegrams, registers and parameters show of them."""

from collections.abc import Sequence

from app.profidrive.state_machine import State, StateMachine
from app.profidrive.telegrams import TELEGRAMS
from app.sim import training
from app.sim.epos import messages, signals
from app.sim.epos import registers as map
from app.sim.epos import training as own
from app.sim.epos.axis import Axis
from app.sim.epos.messages import ALARMS, FAULTS
from app.sim.epos.positioner import BasicPositioner, Limits, Wanted
from app.sim.epos.signals import STANDSTILL, Shown
from app.sim.epos.training import Trouble
from app.sim.sinamics.adjustment import STATE, Adjustment, Encoder
from app.sim.sinamics.adjustment import State as Adjusted
from app.sim.sinamics.fault_buffer import AlarmBuffer, FaultBuffer
from app.sim.sinamics.gateway import GatewayMailbox
from app.sim.sinamics.mailbox import Mailbox
from app.sim.sinamics.registers import ACCESS_ERROR, CONTROL, MAILBOX, STATUS
from app.sim.sinamics.requests import Requests
from app.sim.training import TrainingRegisters

MOTOR_WARM = 120.0
"""[°C]"""


class AxisState:
    """The parts of an axis; what moves them is `drive.py`."""

    machine: StateMachine
    axis: Axis
    positioner: BasicPositioner
    buffer: FaultBuffer
    _alarm_buffer: AlarmBuffer
    _adjustment: Adjustment
    _mailbox: Mailbox | GatewayMailbox
    _raw: float
    """What the encoder counts [LU]."""
    _value: dict[str, float]
    """Parameters by code [their unit]."""
    _output: list[int]
    """Words to the drive, those of the extension behind the ten of the map."""
    _requests: Requests
    _training: TrainingRegisters

    @property
    def state(self) -> State:
        """State of the drive."""
        return self.machine.state

    @property
    def actual(self) -> float:
        """Position as the drive knows it [LU]."""
        return self._adjustment.position(self._encoder)

    @property
    def adjusted(self) -> bool:
        """Whether the encoder is."""
        return self._value[STATE] == Adjusted.ADJUSTED

    @property
    def faults(self) -> list[int]:
        """Numbers that stand."""
        return self.buffer.active

    @property
    def alarms(self) -> list[int]:
        """Numbers of alarms that are there now."""
        injected, warm = self._training[training.REG_MACHINE_FAULT], self.axis.temperature > MOTOR_WARM
        found = [self.positioner.refused] if self.positioner.refused else []
        found += [messages.MOTOR_WARM] if warm else []
        return found + [injected] * (injected in ALARMS and injected not in found)

    def parameter(self, code: str) -> float:
        """Present value of a parameter [its unit]."""
        return self._value[code]

    @property
    def _injected(self) -> int:
        number = self._training[training.REG_MACHINE_FAULT]
        return number if number in FAULTS else 0

    @property
    def _encoder(self) -> Encoder:
        trouble = self._training[own.REG_ADJUSTMENT]
        still = not self.machine.pulses and abs(self.axis.rpm) < STANDSTILL and trouble != Trouble.NEVER_ENDS
        healthy = messages.ENCODER not in (self._injected, *self.buffer.present) and trouble != Trouble.FAILS
        return Encoder(self._raw, still, healthy, trouble != Trouble.REFUSED)

    @property
    def _outside(self) -> float:
        """How far the axis moves on beyond a software limit [LU]; on the way back nothing is wrong."""
        over, under = self.actual - self._value["p2581"], self.actual - self._value["p2580"]
        if over > 0:
            return over if self.axis.speed > 0 else 0.0
        return under if under < 0 and self.axis.speed < 0 else 0.0

    def _wanted(self) -> Wanted:
        words = TELEGRAMS[111].out.unpack(self._output)
        return Wanted(
            words["STW1"],
            words["POS_STW1"],
            words["POS_STW2"],
            min(max(words["OVERRIDE"] / map.FULL, 0.0), 1.0),
            words["MDI_TARPOS"],
            abs(words["MDI_VELOCITY"]) * 1000 / 60,
            words["MDI_ACC"] / map.FULL,
            words["MDI_DEC"] / map.FULL,
        )

    def _limits(self) -> Limits:
        value = self._value
        return Limits(
            value["p2571"] * 1000 / 60,
            value["p2572"] * 1000,
            value["p2573"] * 1000,
            value["p2580"],
            value["p2581"],
            (value["p2585"] * 1000 / 60, value["p2586"] * 1000 / 60),
            (value["p2587"], value["p2588"]),
        )

    def _shown(self) -> Shown:
        return Shown(
            machine=self.machine,
            axis=self.axis,
            positioner=self.positioner,
            values=self._value,
            actual=self.actual,
            adjusted=self.adjusted,
            buffer=self.buffer,
            alarms=self._alarm_buffer,
            warnings=self.alarms,
            local=bool(self._training[own.REG_LOCAL]),
            inputs=(not self._training[own.REG_INTERLOCK], not self._training[own.REG_EMERGENCY]),
            output=self._output,
            uptime=self.buffer.now,
        )

    def _word(self, number: int, shown: Shown, sent: Sequence[int]) -> int:
        if number in MAILBOX:
            return self._mailbox.words[number - MAILBOX.start]
        if CONTROL <= number < CONTROL + map.WORDS:
            return self._output[number - CONTROL]
        if STATUS <= number < STATUS + map.WORDS:
            return sent[number - STATUS]
        if number >= map.DECELERATION and number < map.DECELERATION + 4:
            return (self._output[10], self._output[11], sent[10], sent[11])[number - map.DECELERATION]
        if number == ACCESS_ERROR:
            return self._requests.access_error
        register = map.REGISTERS[number]
        code, _, element = register.parameter.partition("[")
        values = signals.shown(shown, code) or ()
        place = int(element.rstrip("]") or 0)
        return register.encode(values[place] if place < len(values) else 0.0)
