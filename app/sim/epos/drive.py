"""A virtual servo drive with the basic positioner (EPOS) on telegram 111: registers, states, position control, faults, parameters.

What no source confirms, beyond `positioner.py`, `registers.py` and `sinamics/adjustment.py`:

| subject | taken here |
| --- | --- |
| position controller | proportional (p2538) with pre-control of the speed (p2534) |
| F07452 | following error above p2546 |
| F07481, F07482 | an adjusted axis more than 1 mm beyond a software limit that counts |
| OFF1 | brakes with p2573; OFF3 with p1135 from p1082 |
| monitoring p2040 | any access to the process data, from the first one on; F01910 only while the pulses are on |
| `start = "blocks"` | it runs its traversing blocks as if a control had started it, until a control writes its words |
"""

from collections.abc import Mapping, Sequence

from app.profidrive.parameter_access.parameter import DriveParameter
from app.profidrive.position_words import POS_STW2, STW1, word_of
from app.profidrive.state_machine import Inputs, State, StateMachine
from app.profidrive.words import Control
from app.sim import training
from app.sim.device import DT
from app.sim.epos import messages, signals
from app.sim.epos import registers as map
from app.sim.epos import training as own
from app.sim.epos.axis import LU_PER_TURN, Axis
from app.sim.epos.axis_state import AxisState
from app.sim.epos.messages import ALARMS, FAULTS
from app.sim.epos.parameters import commissioned
from app.sim.epos.positioner import BasicPositioner, Block
from app.sim.epos.signals import STANDSTILL
from app.sim.sinamics.adjustment import MODULO, OFFSET, STATE, Adjustment
from app.sim.sinamics.adjustment import State as Adjusted
from app.sim.sinamics.bus_side import BusSide
from app.sim.sinamics.fault_buffer import AlarmBuffer, FaultBuffer
from app.sim.sinamics.gateway import GatewayMailbox
from app.sim.sinamics.mailbox import Mailbox
from app.sim.sinamics.parameter_model import CLEARS, ParameterModel
from app.sim.sinamics.permanent import PermanentParameters
from app.sim.sinamics.registers import CONTROL, FIRST_NUMBER, STATUS, TYPE_CONTROL_UNIT, TYPE_SERVO
from app.sim.sinamics.requests import Requests
from app.sim.training import TrainingRegisters, is_training
from app.sim.watchdog import Watchdog

MOTOR_HOT, MOTOR_RESET = 145.0, 110.0
"""[°C]"""
BEYOND = 1000.0
"""Over a software limit by so much is a fault [LU]."""
OBJECTS = (1, 2)
RUNS = word_of(
    STW1,
    [
        *("on", "no_coast_stop", "no_quick_stop", "enable_operation", "do_not_reject_task", "no_intermediate_stop"),
        *("activate_task", "by_plc"),
    ],
)
LIMITS_COUNT = word_of(POS_STW2, ["software_limits"])
SLOW = 6000
"""MDI_VELOCITY before a control writes one [1000 LU/min]."""


class VirtualPositioningAxis(BusSide, PermanentParameters, AxisState):
    """A slide on a ball screw with a servo motor and an absolute encoder."""

    type: str = "epos"
    dt: float = DT
    tempo: float = 1.0
    """Simulated time per real time; a host is waited for in real time."""
    _acknowledge: bool
    """Asked for by a parameter."""

    def __init__(
        self,
        *,
        seed: int = 1,
        start: str = "",
        adjusted: bool = True,
        blocks: Sequence[float] = (100_000.0, 700_000.0, 400_000.0),
        block_velocity: float = 20_000.0,
        pause: float = 2.0,
        parameters: Mapping[str, float] | None = None,
        behind_mailbox: Mapping[str, DriveParameter] | None = None,
        gateway: bool = False,
    ) -> None:
        """An axis that was just powered up, or runs its traversing blocks when `start` is `blocks`.

        `adjusted`: its encoder is; `blocks`: their positions [LU], reached with
        `block_velocity` [1000 LU/min] and followed by `pause` [s]; `parameters`: as `DEFAULTS`;
        `behind_mailbox`: parameters that its mailbox knows; `gateway`: that is the mailbox of a PLC between.

        Raises:
            ConfigurationError: a parameter is unknown or out of range.
        """
        self._factory = commissioned(parameters or {})
        self._zero = 10_000.0 * (1 + seed % 97)
        """What the encoder counts at the lower end of the travel [LU]."""
        self._factory[STATE] = Adjusted.ADJUSTED if adjusted else Adjusted.NOT_ADJUSTED
        self._factory[OFFSET] = (self._factory["p2580"] - self._zero) % MODULO if adjusted else 0.0
        self._start = start
        self._box = GatewayMailbox if gateway else Mailbox
        self._blocks = tuple(Block(position, block_velocity * 1000 / 60, pause) for position in blocks)
        self._behind_mailbox = behind_mailbox or {}
        self._requests = Requests(map.WORDS, map.REGISTERS)
        self._training = TrainingRegisters(
            own.TYPE_CODE,
            {*FAULTS, *ALARMS},
            {
                **dict.fromkeys((own.REG_LOAD, own.REG_JAMMED, own.REG_ADJUSTMENT), 0),
                own.REG_AMBIENT: 25,
                **dict.fromkeys((own.REG_INTERLOCK, own.REG_EMERGENCY, own.REG_LOCAL, own.REG_MAILBOX), 0),
            },
            limits=own.LIMITS,
            triggers=(training.REG_POWER,),
        )
        self._pending: list[tuple[int, int]] = []
        self._to_initial_state()

    # ---- the bus side

    def _words(self, numbers: range) -> list[int]:
        shown = self._shown()
        sent = signals.telegram(shown)
        return [self._word(number, shown, sent) for number in numbers]

    def _watch(self, numbers: range) -> None:
        """An access to process data is a sign of life."""
        if numbers.start < STATUS + map.WORDS and numbers.stop > CONTROL:
            self._watchdog.telegram()

    # ---- one step

    def step(self) -> None:
        """Advance by 10 ms: writes act, the program and the physics move, the words are new."""
        self._uptime += self.dt / self.tempo
        self.buffer.now = round(1000 * self._uptime)
        if self._pending:
            self._take_writes()
        if self._watchdog.step(self._value["p2040"] / 1000, self.dt / self.tempo) and self.machine.pulses:
            self.buffer.enter(messages.TIMEOUT)
        self._run_machine()
        self._position()
        for number in self._trips():
            self.buffer.enter(number)
        self.axis.warm(self._training[own.REG_AMBIENT], self.dt)
        self._alarm_buffer.step(self.alarms, self.buffer.now)
        self.model.step(self.dt)
        self._mailbox.step(self.dt, self._training[own.REG_MAILBOX])

    def _take_writes(self) -> None:
        initial = power = False
        for address, word in self._pending:
            if is_training(address):
                initial |= self._training.act(address, word)
                power |= address == training.REG_POWER
                continue
            number = address + FIRST_NUMBER
            if number >= map.DECELERATION:
                self._output[number - map.DECELERATION + map.WORDS] = word
            else:
                self._output[number - CONTROL] = word
        self._pending.clear()
        if power:
            self._power_up()
        if initial:
            self._to_initial_state()

    def _run_machine(self) -> None:
        word = Control.BY_PLC | 0x3E if self._training[own.REG_LOCAL] else self._output[0]
        before = self.machine.control
        now = word if word & Control.BY_PLC else before
        acknowledged, self._acknowledge = self._acknowledge, False
        if acknowledged or now & ~before & Control.ACKNOWLEDGE:
            self.buffer.acknowledge()
            self.positioner.refused = 0
        causes = [self._injected] if self._injected else []
        if self.axis.temperature > MOTOR_RESET and messages.MOTOR_HOT in self.buffer.present:
            causes.append(messages.MOTOR_HOT)
        for number in causes:
            self.buffer.enter(number)
        reactions = [FAULTS[number].reaction for number in (*self.buffer.take_new(), *causes)]
        self.machine.step(
            Inputs(
                word,
                abs(self.axis.rpm) < STANDSTILL and not self.positioner.speed,
                cause=max(reactions) if reactions else None,
                pulses_released=not self._training[own.REG_INTERLOCK],
                no_emergency_stop=not self._training[own.REG_EMERGENCY],
                acknowledged=acknowledged,
            )
        )

    def _position(self) -> None:
        """Set-point, position controller, axis, encoder."""
        value, axis, positioner, dt = self._value, self.axis, self.positioner, self.dt
        load, jammed = self._training[own.REG_LOAD] / 100, bool(self._training[own.REG_JAMMED])
        if self._injected != messages.ENCODER:
            self._raw = axis.position + self._zero
        before = self.actual
        self._adjustment.step(self._encoder, dt)
        positioner.position += self.actual - before  # a new coordinate moves nothing
        wanted, limits = self._wanted(), self._limits()
        state = self.machine.state
        if state is State.OPERATION:
            positioner.step(wanted, limits, self.adjusted, dt)
        elif self.machine.pulses:
            quick = value["p1082"] / 60 * LU_PER_TURN / max(value["p1135"], dt)
            positioner.brake(quick if state is State.QUICK_STOP else limits.deceleration, dt)
        else:
            positioner.follow(self.actual, wanted.stw1)
            axis.coast(load, jammed, dt)
            return
        gain = value["p2538"] * 1000 / 60
        command = gain * (positioner.position - self.actual) + value["p2534"] / 100 * positioner.speed
        most = value["p1082"] / 60 * LU_PER_TURN
        axis.drive(min(max(command, -most), most), load, jammed, dt)

    def _trips(self) -> list[int]:
        """Faults that come in this step."""
        value, pulses = self._value, self.machine.pulses
        following = abs(self.positioner.position - self.actual) if pulses else 0.0
        bounded = self.adjusted and pulses and self._output[map.POS_STW2] & LIMITS_COUNT
        return [
            number
            for number, there in (
                (messages.MOTOR_HOT, self.axis.temperature > MOTOR_HOT),
                (messages.FOLLOWING, following > value["p2546"]),
                (messages.BEYOND_LOW, bounded and self._outside < -BEYOND),
                (messages.BEYOND_HIGH, bounded and self._outside > BEYOND),
            )
            if there
        ]

    # ---- states to begin with

    def _to_initial_state(self) -> None:
        """As constructed."""
        self._training.reset()
        self._value = dict(self._factory)
        self._pending.clear()
        travel = self._value["p2581"] - self._value["p2580"]
        self.axis = Axis(travel, travel / 2)
        self.buffer = FaultBuffer()
        self.model = ParameterModel(
            self._behind_mailbox,
            self._value,
            lambda code: signals.shown(self._shown(), code),
            pulses=lambda: self.machine.pulses,
            act=self._act,
            objects=OBJECTS,
            initial={"p0101": OBJECTS, "p0107": (TYPE_CONTROL_UNIT, TYPE_SERVO)},
        )
        self._off()
        self._begin()

    def _power_up(self) -> None:
        """Off and on again: parameters as saved, the fault buffer as it was, the axis where it is."""
        self.model.power_up()
        self._off()

    def _off(self) -> None:
        self._output = [0] * (map.WORDS + 2)
        self._output[map.OVERRIDE] = self._output[map.ACCELERATION] = self._output[map.WORDS] = map.FULL
        self._output[map.VELOCITY + 1] = SLOW
        self._watchdog, self.machine, self._uptime = Watchdog(), StateMachine(), 0.0
        self._mailbox, self._alarm_buffer = self._box(self.model.serve), AlarmBuffer()
        self._adjustment = Adjustment(self._value)
        self._adjustment.power_up()
        self._raw = self.axis.position + self._zero
        self.positioner = BasicPositioner(blocks=self._blocks)
        self.positioner.follow(self.actual, 0)
        self._acknowledge = False
        self._requests.access_error = 0

    def _begin(self) -> None:
        if not self._start:
            return
        self._output[0], self._output[map.POS_STW2] = RUNS, LIMITS_COUNT
        self.machine = StateMachine(state=State.OPERATION, control=RUNS)

    def _act(self, code: str) -> None:
        """What writing a parameter has the drive do."""
        if code == CLEARS:
            self.buffer.clear()
        else:
            self._acknowledge = True
