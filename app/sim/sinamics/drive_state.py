"""What a virtual SINAMICS drive is at one moment: its parts, and what telegrams, registers and parameters show of them."""

from app.profidrive.scaling import Scaling
from app.profidrive.state_machine import State, StateMachine
from app.profidrive.words import Status
from app.sim.sinamics import messages
from app.sim.sinamics import registers as map
from app.sim.sinamics import training as own
from app.sim.sinamics.excitation import Excitation
from app.sim.sinamics.fault_buffer import AlarmBuffer, FaultBuffer
from app.sim.sinamics.gateway import GatewayMailbox
from app.sim.sinamics.image import Readings, reading
from app.sim.sinamics.live_parameters import Shown
from app.sim.sinamics.mailbox import Mailbox
from app.sim.sinamics.monitoring import Monitoring
from app.sim.sinamics.parameter_model import ParameterModel
from app.sim.sinamics.power import PowerUnit
from app.sim.sinamics.ramp import RampGenerator
from app.sim.sinamics.requests import Requests
from app.sim.sinamics.shaft import Shaft
from app.sim.training import TrainingRegisters
from app.sim.watchdog import Watchdog


class DriveState:
    """The parts of a drive; what moves them is `drive.py`."""

    rated_current: float
    """Of the motor [A]."""
    machine: StateMachine
    power: PowerUnit
    buffer: FaultBuffer
    model: ParameterModel
    """What is behind the mailbox."""
    _alarm_buffer: AlarmBuffer
    _mailbox: Mailbox | GatewayMailbox
    _uptime: float
    """[s]"""
    _acknowledge: bool
    """Asked for by a parameter."""
    _ramp: RampGenerator
    _excitation: Excitation
    _monitoring: Monitoring
    _watchdog: Watchdog
    _value: dict[str, float]
    """Parameters by code [their unit]."""
    _output: list[int]
    """Process data to the drive."""
    _requests: Requests
    _training: TrainingRegisters
    _objects: tuple[int, ...]
    """Drive objects."""

    @property
    def state(self) -> State:
        """State of the drive."""
        return self.machine.state

    @property
    def speed(self) -> float:
        """Of the shaft [rpm], negative in reverse."""
        return self.power.speed

    @property
    def shaft(self) -> Shaft:
        """Motor, speed loop and rotating mass."""
        return self.power.shaft

    @property
    def ramp(self) -> float:
        """Output of the ramp generator [rpm]."""
        return self._ramp.output

    @property
    def faults(self) -> list[int]:
        """Numbers that stand."""
        return self.buffer.active

    @property
    def alarms(self) -> list[int]:
        """Numbers of alarms that are there now, in the order in which they came."""
        return list(self._monitoring.alarms)

    @property
    def status(self) -> int:
        """ZSW1."""
        word = self.machine.status
        if self.local:
            word &= ~Status.CONTROL_REQUESTED
        deviation, alarms = abs(self._ramp.reference(self.machine, self._value) - self.speed), self.alarms
        for bit, on in (
            (Status.ALARM, bool(alarms)),
            (Status.SPEED_WITHIN_TOLERANCE, deviation <= self._value["p2163"]),
            (Status.COMPARISON_REACHED, abs(self.speed) >= self._value["p2155"]),
            (Status.LIMIT_NOT_REACHED, not self.shaft.limited),
            (Status.BRAKE_OPEN, self._excitation.brake_open),
            (Status.NO_MOTOR_OVERTEMPERATURE, messages.MOTOR_WARM not in alarms),
            (Status.FORWARD, self.power.forward),
            (Status.NO_POWER_UNIT_OVERLOAD, messages.NEAR_OVERLOAD not in alarms),
        ):
            word |= bit if on else 0
        return word

    @property
    def local(self) -> bool:
        """Whether the panel at the drive has the control."""
        return bool(self._training[own.REG_LOCAL])

    def parameter(self, code: str) -> float:
        """Present value of a parameter [its unit]."""
        return self._value[code]

    def _shown(self) -> Shown:
        machine = self.machine
        return Shown(
            machine=machine,
            power=self.power,
            training=self._training,
            buffer=self.buffer,
            alarms=self._alarm_buffer,
            status=self.status,
            setpoint=self._ramp.reference(machine, self._value),
            ramp=self.ramp if machine.pulses else 0.0,
            rated_current=self.rated_current,
            objects=len(self._objects),
            uptime=self.buffer.now,
            output=self._output,
            words=self._requests.process_words,
            reference=self._value["p2000"],
        )

    def _word(self, number: int, readings: Readings) -> int:
        if number in map.MAILBOX:
            return self._mailbox.words[number - map.MAILBOX.start]
        if number in map.REGISTERS:
            register = map.REGISTERS[number]
            value = self._value.get(register.parameter)
            return register.encode(reading(readings, number) if value is None else value)
        if number < map.PROCESS_OUT_END:
            return self._output[number - map.CONTROL]
        if number == map.STATUS:
            return self.status
        return Scaling(self._value["p2000"]).encode(self.speed)[0] if number == map.ACTUAL else 0

    def _readings(self) -> Readings:
        return Readings(
            power=self.power,
            ramp=self.ramp if self.machine.pulses else 0.0,
            training=self._training,
            faults=self.buffer.present,
            alarms=self._monitoring.alarms,
            access_error=self._requests.access_error,
        )
