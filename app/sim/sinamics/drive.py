"""A virtual SINAMICS drive on standard telegram 1: Modbus registers, PROFIdrive's states, ramps, faults and alarms over a motor with load.

Written from the maker's map (reference/sinamics-modbus.md, reference/profidrive.md), never from the equipment type's points. What no source
confirms:

| subject | taken here |
| --- | --- |
| p1082 | p2000 unless the plant file says otherwise |
| fault and alarm numbers, reactions | as `messages.py` marks them |
| writes of one step to one register | the last one counts, as in a drive that samples its words: an edge that fits into 10 ms is lost |
| set-point while bit 10 or bit 6 is missing | without bit 10 the last one holds, without bit 6 it is 0 |
| ramps p1120, p1121 | from 0 to the greatest speed p1082; OFF3 by p1135; the generator begins at the speed that the shaft has |
| bit 4 or 5 of STW1 missing | the ramp's output is 0 at once, or stands still; a stop goes on regardless |
| magnetising p0346, de-magnetising p0347 | linear; with the word ON and enabled the flux builds up in S3 |
| bit 10 of ZSW1 | actual speed at or above p2155, the comparison value |
| bit 8 | within p2163 of the set-point; outside for 2 s while operating: A07903 |
| bit 12 | open 0.1 s after the pulses came, closed with them; no brake torque is simulated |
| bit 14 | kept at standstill |
| monitoring p2040 | any access to 40100, 40101, 40110, 40111; from the first one on; F01910 only while the pulses are on |
| local control | the word from the control is replaced by OFF1, bit 9 is 0, r0807 is 0 |
| braking energy | a chopper holds the DC link at 750 V |
| current above p0640, blocked motor | the torque is limited, the ramp waits, bit 11 goes; 1 s at the limit near standstill: F07900 |
| technology controller, digital and analog outputs | kept and read back, without effect |
| a fault whose cause persists when it is acknowledged | moves to the history and is entered again |
| without the basic positioner (`positioning`) | its parameters do not exist |
"""

from collections.abc import Mapping, Sequence

from app.errors import ConfigurationError
from app.plant.said import not_as, said
from app.profidrive.parameter_access.parameter import DriveParameter
from app.profidrive.scaling import Scaling
from app.profidrive.state_machine import Inputs, State, StateMachine
from app.profidrive.words import ENABLES, RUN, Control
from app.sim import training
from app.sim.device import DT
from app.sim.induction_motor import MOTOR_SETS, SQRT3
from app.sim.sinamics import messages
from app.sim.sinamics import registers as map
from app.sim.sinamics import training as own
from app.sim.sinamics.adjustment import DEFAULTS, SCALE, Adjustment, Encoder
from app.sim.sinamics.bus_side import BusSide
from app.sim.sinamics.drive_state import DriveState
from app.sim.sinamics.excitation import BRAKE_TIME, Excitation
from app.sim.sinamics.fault_buffer import AlarmBuffer, FaultBuffer
from app.sim.sinamics.gateway import GatewayMailbox
from app.sim.sinamics.live_parameters import shown
from app.sim.sinamics.mailbox import Mailbox
from app.sim.sinamics.messages import ALARMS, FAULTS
from app.sim.sinamics.monitoring import Monitoring, Watched
from app.sim.sinamics.parameter_model import CLEARS, ParameterModel
from app.sim.sinamics.parameters import commissioned
from app.sim.sinamics.permanent import PermanentParameters
from app.sim.sinamics.power import PowerUnit
from app.sim.sinamics.ramp import RampGenerator
from app.sim.sinamics.requests import Requests
from app.sim.sinamics.shaft import RPM, Supply
from app.sim.sinamics.shaft_encoder import ShaftEncoder
from app.sim.training import TrainingRegisters, is_training
from app.sim.watchdog import Watchdog

POSITIONING, POSITION = "positioning", "r2521"
"""Group of the parameters of the basic positioner; its actual position, for the controller and for encoder 1."""


class VirtualSinamics(BusSide, PermanentParameters, DriveState):
    """A drive with an induction motor in star at 400 V."""

    type: str = "sinamics"
    dt: float = DT
    tempo: float = 1.0
    """Simulated time per real time; a host is waited for in real time."""

    def __init__(
        self,
        *,
        seed: int = 1,
        rated_current: float = 15.0,
        start: str = "",
        setpoint: float = 0.0,
        process_words: int = 10,
        parameters: Mapping[str, float] | None = None,
        load: float = 15.0,
        quadratic_load: float = 40.0,
        disturbance: float = 4.0,
        inertia_ratio: float = 9.0,
        behind_mailbox: Mapping[str, DriveParameter] | None = None,
        positioning: bool = False,
        gateway: bool = False,
    ) -> None:
        """A drive that was just powered up, or runs since long when `start` is `forward` or `reverse`.

        `rated_current`: of the motor [A], which sizes it; `setpoint`: [% of p2000] that it begins with; `process_words`: 2 of a G120,
        10 of an S120; `parameters`: as `DEFAULTS`; `load`, `quadratic_load`, `disturbance` [% of rated torque]; `inertia_ratio`: of
        the load to the rotor; `behind_mailbox`: parameters that its mailbox knows; `positioning`: it has the basic positioner, and an
        absolute encoder on its shaft; `gateway`: its mailbox is that of a PLC between.

        Raises:
            ConfigurationError: one of them is unknown or out of range.
        """
        _check(start, rated_current, setpoint, process_words, inertia_ratio)
        self._requests = Requests(process_words)
        self.rated_current = rated_current
        self.data = MOTOR_SETS["B"].sized(rated_current * SQRT3)
        self._seed, self._start, self._setpoint, self._inertia_ratio = seed, start, setpoint, inertia_ratio
        self._positioning = positioning
        self._box = GatewayMailbox if gateway else Mailbox
        known = (behind_mailbox or {}).items()
        self._behind_mailbox = {code: one for code, one in known if positioning or one.group != POSITIONING}
        self._objects = (1,) if process_words == map.G120_WORDS else (1, 2)
        self._factory = commissioned(rated_current, parameters or {}) | DEFAULTS
        world = _world(load, quadratic_load, disturbance)
        self._training = TrainingRegisters(
            own.TYPE_CODE,
            {*FAULTS, *ALARMS},
            {
                **world,
                own.REG_AMBIENT: 25,
                own.REG_SUPPLY: 400,
                own.REG_INTERLOCK: 0,
                own.REG_EMERGENCY: 0,
                own.REG_LOCAL: 0,
                own.REG_MAILBOX: 0,
            },
            limits=own.LIMITS,
            triggers=(training.REG_POWER,),
        )
        self._pending: list[tuple[int, int]] = []
        self._to_initial_state()

    # ---- the bus side

    def _words(self, numbers: range) -> list[int]:
        readings = self._readings()
        return [self._word(number, readings) for number in numbers]

    def _watch(self, numbers: range) -> None:
        """An access to these: a sign of life where the monitoring counts them."""
        if not map.WATCHED.isdisjoint(numbers):
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
        self._excitation.step(self.machine, self._value, self.dt)
        self._ramp.step(self.machine, self._value, self._excitation, self.power, self.dt)
        excited, blocked = self.state is State.SWITCHED_ON, self._injected == messages.BLOCKED
        self.power.step(self._supply(), self.dt, excited=excited, blocked=blocked)
        for number in self._monitoring.step(self.power, self._watched(), self.dt):
            self.buffer.enter(number)
        self._alarm_buffer.step(self.alarms, self.buffer.now)
        self._turning.step(self.speed, self.dt)
        self._adjustment.step(self._encoder, self.dt)
        self.model.step(self.dt)
        self._mailbox.step(self.dt, self._training[own.REG_MAILBOX])

    def _take_writes(self) -> None:
        initial = power = False
        for address, word in self._pending:
            if is_training(address):
                initial |= self._training.act(address, word)
                power |= address == training.REG_POWER
                if address == training.REG_MACHINE_FAULT:
                    self._monitoring.forgive()
                continue
            number = address + map.FIRST_NUMBER
            if number < map.PROCESS_OUT_END:
                self._output[number - map.CONTROL] = word
            else:
                register = map.REGISTERS[number]
                self._value[register.parameter] = register.decode(word)
        self._pending.clear()
        if power:
            self._power_up()
        if initial:
            self._to_initial_state()

    @property
    def _injected(self) -> int:
        return self._training[training.REG_MACHINE_FAULT]

    def _run_machine(self) -> None:
        word = self._output[0]
        if self.local:
            word = ENABLES
        machine, before = self.machine, self.machine.control
        now = word if word & Control.BY_PLC else before
        causes = self._monitoring.causes(self.power, self._injected, self.buffer.present)
        acknowledged, self._acknowledge = self._acknowledge, False
        if acknowledged or now & ~before & Control.ACKNOWLEDGE:
            self.buffer.acknowledge()
        for number in causes:
            self.buffer.enter(number)
        reactions = [FAULTS[number].reaction for number in (*self.buffer.take_new(), *causes)]
        standstill = self._standstill
        machine.step(
            Inputs(
                word,
                abs(self.speed) < standstill and abs(self.ramp) < standstill,
                self._excitation.complete,
                max(reactions) if reactions else None,
                not self._training[own.REG_INTERLOCK],
                not self._training[own.REG_EMERGENCY],
                acknowledged,
            )
        )
        if word & Control.BY_PLC:
            self._ramp.take(self._output[1])

    @property
    def _standstill(self) -> float:
        """Below it the motor stands [rpm]."""
        return max(self._value["p1226"], 1.0)

    @property
    def _encoder(self) -> Encoder:
        still = not self.machine.pulses and abs(self.speed) < self._standstill
        healthy = messages.ENCODER not in (self._injected, *self.buffer.present)
        return Encoder(self._turning.position(self._value[SCALE]), still, healthy)

    def _supply(self) -> Supply:
        return Supply(self.machine.pulses, self.ramp / RPM, self._excitation.flux, self._value["p0640"])

    def _watched(self) -> Watched:
        return Watched(
            pulses=self.machine.pulses,
            operating=self.state is State.OPERATION,
            ramp=self.ramp,
            tolerance=self._value["p2163"],
            standstill=self._standstill,
            greatest_speed=self._value["p1082"],
            injected=self._injected,
        )

    # ---- states to begin with

    def _to_initial_state(self) -> None:
        """As constructed, the random sequence included."""
        self._training.reset()
        self._value = dict(self._factory)
        self._turning, self._adjustment = ShaftEncoder(), Adjustment(self._value)
        self._output = [0] * 10
        self._output[1] = Scaling(100.0).raw(self._setpoint) & 0xFFFF
        self._pending.clear()
        self._watchdog = Watchdog()
        self.machine = StateMachine()
        inertia = self.data.inertia * (1 + self._inertia_ratio)
        self.power = PowerUnit(self._training, self.data, self.rated_current, inertia=inertia, seed=self._seed)
        self.buffer, self._alarm_buffer = FaultBuffer(), AlarmBuffer()
        self._uptime, self._acknowledge = 0.0, False
        self.model = self._commissioned_model()
        self._mailbox = self._box(self.model.serve)
        self._ramp, self._excitation, self._monitoring = RampGenerator(), Excitation(), Monitoring()
        self._requests.access_error = 0
        self._begin()

    def _power_up(self) -> None:
        """Off and on again: parameters as saved, the fault buffer as it was; motor and heat sink stay as warm as they are."""
        self.model.power_up()
        self._adjustment.power_up()
        self._output = [0] * 10
        self._watchdog, self.machine, self._uptime = Watchdog(), StateMachine(), 0.0
        self._mailbox, self._alarm_buffer = self._box(self.model.serve), AlarmBuffer()
        self._ramp, self._excitation, self._monitoring = RampGenerator(), Excitation(), Monitoring()
        self._requests.access_error = 0

    def _commissioned_model(self) -> ParameterModel:
        motor = self.data
        kinds = {1: (map.TYPE_CONTROL_UNIT,), 2: (map.TYPE_CONTROL_UNIT, map.TYPE_SERVO)}[len(self._objects)]
        return ParameterModel(
            self._behind_mailbox,
            self._value,
            self._live,
            pulses=lambda: self.machine.pulses,
            act=self._act,
            objects=self._objects,
            initial={
                "p0101": self._objects,
                "p0107": kinds,
                "p0305": (self.rated_current,),
                "p0307": (motor.rated_power / 1000,),
            },
        )

    def _live(self, code: str) -> Sequence[float] | None:
        if code == POSITION:
            return (self._adjustment.position(self._encoder),) * 2
        return shown(self._shown(), code)

    def _act(self, code: str) -> None:
        """What writing a parameter has the drive do."""
        if code == CLEARS:
            self.buffer.clear()
        else:
            self._acknowledge = True

    def _begin(self) -> None:
        if not self._start:
            return
        reverse = self._start == "reverse"
        self._output[0] = RUN | (Control.INVERT if reverse else 0)
        self._ramp.take(self._output[1])
        self.machine = StateMachine(state=State.OPERATION, control=self._output[0])
        self._excitation = Excitation(1.0, BRAKE_TIME + self.dt)
        self._ramp.output = self._ramp.reference(self.machine, self._value)
        self.power.settle(self.ramp, self._supply())
        self.power.forward = not reverse


def _check(start: str, rated_current: float, setpoint: float, process_words: int, inertia_ratio: float) -> None:
    if start not in ("", "forward", "reverse"):
        raise ConfigurationError(
            not_as(f"start {start!r}", said("mistake.nothing_or", first="forward", second="reverse"))
        )
    if not 1 <= rated_current <= 400:
        raise ConfigurationError(said("mistake.takes", what="rated_current", low=1, high="400 A", value=rated_current))
    if not 0 <= setpoint <= 199.9:
        raise ConfigurationError(said("mistake.takes", what="setpoint", low=0, high="199.9 %", value=setpoint))
    if process_words not in (2, 10):
        raise ConfigurationError(
            said("mistake.is_either", what="process_words", first=2, second=10, value=process_words)
        )
    if not inertia_ratio >= 0:
        raise ConfigurationError(said("mistake.takes_from", what="inertia_ratio", low=0, value=inertia_ratio))


def _world(load: float, quadratic: float, disturbance: float) -> dict[int, int]:
    """The load as training registers [% of rated torque]."""
    world = {own.REG_LOAD: load, own.REG_LOAD_QUADRATIC: quadratic, own.REG_DISTURBANCE: disturbance}
    for address, value in world.items():
        low, high = own.LIMITS[address]
        if not low <= value <= high:
            raise ConfigurationError(said("mistake.takes", what="load", low=low, high=f"{high} %", value=value))
    return {address: round(value) for address, value in world.items()}
