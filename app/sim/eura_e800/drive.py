"""A virtual EURA E800: the drive's registers, commands, ramps and faults over the motor model.

Written from the maker's map (reference/eura-e800.md), never from the equipment type's points. What no source confirms:

| subject | taken here |
| --- | --- |
| status code of CE | 0x1A: in no source, an assumption |
| high byte of 0x1005 | 0x01, opaque, so that a client that does not mask it is found out |
| high / low byte of 0x1003 | F804 (poles) / F200 (0 = keypad); one manual example could mean pole pairs |
| ranges and defaults of parameters; F124–F126, F431, F432, F902 as a whole | remembered from the makers' manuals |
| function 16; limits per read | exception 01; 25 registers from 0x1000, 6 parameters, else exception 03; all three switchable |
| a drive that does not listen (F200, F201) or is locked | echoes the telegram, nothing happens; parameters are still written |
| a run command during a fault, a jog start while running | echoed, nothing happens |
| unlock (0x2001 = 1) while the cause of a fault persists | exception 04 like the reset |
| parameters while running | all are taken; the real drive may refuse some |
| F900–F904 | take effect at the next power-up only (`communication`, `power_cycle`) |
| start into a coasting motor | no speed search (flying start): a motor of the drive's full size trips OC, a smaller one is braked first |
| trip levels, overload curves, capacity of the DC bus, no brake chopper, no stall prevention | usual values of 230 V, scaled to 400 V |
| vector control (F106 = 0, 3) | V/f with slip and IR compensation; F106 = 6 and user points (F137 = 2) run as plain V/f |
| speed while the motor coasts | 0: without encoder and output the drive sees none; `shaft_speed` is the truth |
"""

from collections.abc import Mapping, Sequence

from app.errors import ConfigurationError, DeviceException
from app.plant.said import any_of, not_as, said
from app.sim import training
from app.sim.device import DT, check_room
from app.sim.eura_e800 import training as own
from app.sim.eura_e800.commands import RemoteCommands
from app.sim.eura_e800.dc_bus import DRIVE_RATED_CURRENT
from app.sim.eura_e800.faults import CE, FAULTS
from app.sim.eura_e800.heat import Heat
from app.sim.eura_e800.image import Readings, encode
from app.sim.eura_e800.memory import Communication, ParameterMemory
from app.sim.eura_e800.parameters import BY_ADDRESS, PARAMETERS, commissioned
from app.sim.eura_e800.power import PowerSection
from app.sim.eura_e800.protection import Protection
from app.sim.eura_e800.ramp import Ramp
from app.sim.eura_e800.registers import AO1, AO2, COMMAND, DO1, DO2, FIRST, LOCK, RELAY
from app.sim.eura_e800.requests import check_function, check_output, check_read, is_status
from app.sim.induction_motor import MOTOR_SETS, InductionMotor
from app.sim.training import LineFault, TrainingRegisters, is_training
from app.sim.watchdog import Watchdog

STANDBY, FORWARD, REVERSE = 0, 1, 2


class VirtualE800:
    """An E800 with a motor in delta at its output, of 230 V or another class."""

    type: str = "eura_e800"
    dt: float = DT
    tempo: float = 1.0
    """Simulated time per real time; a host is waited for in real time."""

    outputs: dict[int, int]
    """Words last written for the outputs (0x2002–0x2007)."""
    _ramp: Ramp
    _protection: Protection
    _power: PowerSection
    _commands: RemoteCommands
    _watchdog: Watchdog
    _image: list[int] | None

    def __init__(
        self,
        *,
        seed: int = 1,
        rated_current: float = 4.5,
        rated_voltage: float = 230.0,
        drive_current: float | None = None,
        pole_pairs: int = 2,
        rated_frequency: float = 50.0,
        parameters: Mapping[str, float] | None = None,
        start: str = "",
        motor: str = "A",
        block_limit: int = 25,
        parameter_limit: int = 6,
        multiple_writes: bool = False,
        load: float = 15.0,
        quadratic_load: float = 50.0,
        disturbance: float = 6.0,
        inertia_ratio: float = 9.0,
    ) -> None:
        """A drive that has just been powered up, or has been running for long when `start` is `forward` or `reverse`.

        `rated_current`: of the motor in delta at `rated_voltage` [A, V], which size it and become F803 and F802;
        `drive_current`: rated output of the drive [A], if not the motor's or 4.5 A; `pole_pairs`, `rated_frequency` [Hz]: of the motor;
        `parameters`: values by code, kept in EEPROM; `motor`: A legacy, B modern; `block_limit`, `parameter_limit`: most registers per
        read from 0x1000 and of parameters; `multiple_writes`: whether function 16 is known; `load`, `quadratic_load`, `disturbance` [% of
        rated torque]; `inertia_ratio`: of the load to the rotor.

        Raises:
            ConfigurationError: one of them is unknown or out of range.
        """
        _check(motor, start, rated_current, rated_voltage, drive_current, inertia_ratio)
        self.block_limit = block_limit
        self.parameter_limit = parameter_limit
        self.multiple_writes = multiple_writes
        self._seed = seed
        self._start = start
        self._inertia_ratio = inertia_ratio
        self.motor_data = MOTOR_SETS[motor].sized(rated_current, rated_voltage).wound(pole_pairs, rated_frequency)
        self._rated_voltage = rated_voltage
        self.drive_current = drive_current or max(DRIVE_RATED_CURRENT, rated_current)
        """Rated output current of the drive [A]."""
        self.memory = ParameterMemory(commissioned(self.motor_data, rated_current, rated_voltage, parameters or {}))
        self._training = TrainingRegisters(
            own.TYPE_CODE,
            FAULTS,
            {
                own.REG_LOAD: _percent("load", load, own.REG_LOAD),
                own.REG_LOAD_QUADRATIC: _percent("quadratic_load", quadratic_load, own.REG_LOAD_QUADRATIC),
                own.REG_DISTURBANCE: _percent("disturbance", disturbance, own.REG_DISTURBANCE),
                own.REG_AMBIENT: 25,
                own.REG_SUPPLY: round(rated_voltage),
            },
            limits=own.LIMITS,
        )
        self._pending: list[tuple[int, int]] = []
        self._to_initial_state()

    # ---- the bus side

    @property
    def line_fault(self) -> LineFault:
        """What the instructor did to the line of this unit; only kept here."""
        return self._training.line_fault

    def telegram_seen(self) -> None:
        """Feed the communication watchdog (F905) at the next step border."""
        self._watchdog.telegram()

    def read(self, function: int, address: int, count: int) -> list[int]:
        """Function 03 of 0x1000–0x1018, of parameters and of training registers.

        Raises:
            DeviceException: 01 other function, 02 unknown or write-only address, 03 more registers than the drive gives.
        """
        if is_training(address):
            return self._training.read(function, address, count)
        check_read(function, address, count, most_status=self.block_limit, most_parameters=self.parameter_limit)
        if is_status(address):
            if self._image is None:
                self._image = self._encode()
            return self._image[address - FIRST : address - FIRST + count]
        wanted = (BY_ADDRESS[at] for at in range(address, address + count))
        return [parameter.encode(self.parameter(parameter.code)) for parameter in wanted]

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """Function 06 (16 where switched on) to 0x2000–0x2007, parameters and training registers.

        Raises:
            DeviceException: 01 other function, 02 unknown or read-only address, 03 value, 04 reset or unlock refused because
                the cause of the fault persists, 06 too many writes wait. Nothing of a refused request acts.
        """
        check_room("E800", len(self._pending))
        if is_training(address):
            self._training.check(function, address, words)
            self._pending += enumerate(words, address)
            return
        check_function(function, len(words), multiple_writes=self.multiple_writes)
        staged = self.memory.staged()
        for at, word in enumerate(words, address):
            self._check(at, word, staged)
        self.memory.stage(staged)
        self._pending += enumerate(words, address)

    def _check(self, address: int, word: int, staged: dict[str, float]) -> None:
        if not 0 <= word <= 0xFFFF:
            raise DeviceException(3, f"E800: {word} is not a word")
        if (parameter := BY_ADDRESS.get(address)) is not None:
            self.memory.check(parameter, word, staged)
        elif address == COMMAND:
            self._commands.check(word)
        else:
            check_output(address, word)
            if address == LOCK:
                self._commands.check_lock(word)

    # ---- what one sees from outside

    @property
    def motor(self) -> InductionMotor:
        """With its speed and what it draws."""
        return self._power.motor

    @property
    def heat(self) -> Heat:
        """Temperatures and overload images."""
        return self._power.heat

    @property
    def fault(self) -> int:
        """Status code of the fault that stands, 0 = none."""
        return self._protection.fault

    @property
    def status(self) -> int:
        """Status code, as in the low byte of 0x1005."""
        if self.fault:
            return self.fault
        if not self._ramp.on:
            return STANDBY
        return FORWARD if self._ramp.sense > 0 else REVERSE

    @property
    def frequency(self) -> float:
        """Output of the ramp [Hz], negative in reverse."""
        return self._ramp.frequency

    @property
    def voltage(self) -> float:
        """Output, line to line [V rms]."""
        return self._power.inverter.voltage

    @property
    def bus_voltage(self) -> float:
        """[V DC]"""
        return self._power.bus.voltage

    @property
    def shaft_speed(self) -> float:
        """True speed of the shaft [rpm], negative in reverse, also while it coasts."""
        return self._power.shaft_speed

    @property
    def communication(self) -> Communication:
        """Line settings in force; F900–F904 act at the next power-up."""
        return self.memory.communication

    def parameter(self, code: str) -> float:
        """Present value of a parameter [its unit]."""
        return self.memory.value[code]

    def output_voltage(self, frequency: float) -> float:
        """The V/f curve: line voltage [V] that the drive would give at `frequency` [Hz, 0 or above], the bus permitting."""
        return self._power.inverter.curve(frequency, self.memory.value)

    def power_cycle(self) -> None:
        """Supply off and on: faults, lock and RAM values are gone, EEPROM stays, the shaft keeps turning, nothing runs."""
        self.memory.power_up()
        self._power_up()

    def stood(self, seconds: float) -> None:
        """So much real time passed without a step; it has no clock that would tell."""

    # ---- one step

    def step(self) -> None:
        """Advance by 10 ms: writes act, the program and the physics move, the image is new."""
        values = self.memory.value
        if self._pending:
            self._take_writes()
            values = self.memory.value
        if self._watchdog.step(values["F905"], self.dt / self.tempo) and self._ramp.on:
            self._commands.trip(CE)
        if self._ramp.step(values, self.dt):
            self._commands.output_off()
        self._power.step(values, self.dt)
        if code := self._protection.step(self._power.measured(), self.dt):
            self._commands.trip(code)
        self._image = None

    def _take_writes(self) -> None:
        initial = False
        for address, word in self._pending:
            if is_training(address):
                initial |= self._training.act(address, word)
                if address == training.REG_MACHINE_FAULT:
                    self._begin_injection()
            elif address == COMMAND:
                self._commands.execute(word)
            elif address == LOCK:
                self._commands.take_lock(word)
            elif (parameter := BY_ADDRESS.get(address)) is not None:
                self.memory.write(parameter, word)
            else:
                self.outputs[address] = word
        self._pending.clear()
        self._power.take_world()
        if initial:
            self._to_initial_state()

    def _begin_injection(self) -> None:
        injected = self._training[training.REG_MACHINE_FAULT]
        self._protection.inject(injected)
        self._power.overload(injected)

    # ---- states to begin with

    def _power_up(self) -> None:
        self._pending = [(address, word) for address, word in self._pending if is_training(address)]
        self._ramp.off()
        self._ramp.direction = 1
        self._power.power_up()
        self._protection.fault = 0
        self._commands.locked = False
        self.outputs = {AO1: 0, AO2: 0, DO1: 0, DO2: 0, RELAY: 0}
        self._watchdog = Watchdog()
        self._image = None

    def _to_initial_state(self) -> None:
        """As constructed, the random sequence included."""
        self._training.reset()
        self.memory.reset()
        self._ramp = Ramp()
        self._protection = Protection()
        self._power = PowerSection(
            self._training,
            self.motor_data,
            self.drive_current,
            self._rated_voltage,
            inertia=self._inertia_ratio * self.motor_data.inertia,
            seed=self._seed,
            ramp=self._ramp,
            protection=self._protection,
        )
        self._commands = RemoteCommands(self.memory, self._ramp, self._protection, self._power)
        self._power_up()
        self._power.settle(self.memory.value)
        if self._start:
            values = self.memory.value
            self._ramp.begin(1 if self._start == "forward" else -1, values)
            self._power.settle(values)

    # ---- the register image

    def _encode(self) -> list[int]:
        return encode(
            Readings(
                status=self.status,
                faulted=bool(self.fault),
                on=self._ramp.on,
                frequency=self.frequency,
                voltage=self.voltage,
                bus_voltage=self.bus_voltage,
                heat_sink=self.heat.heat_sink,
                shaft_speed=self.shaft_speed,
                point=self.motor.point,
                rated_torque=self.motor_data.rated_torque,
                pole_pairs=self.motor_data.pole_pairs,
                drive_current=self.drive_current,
            ),
            self.memory.value,
            self.outputs,
        )


def _check(
    motor: str,
    start: str,
    rated_current: float,
    rated_voltage: float,
    drive_current: float | None,
    inertia_ratio: float,
) -> None:
    if motor not in MOTOR_SETS:
        raise ConfigurationError(not_as(f"motor {motor!r}", any_of(MOTOR_SETS)))
    if start not in ("", "forward", "reverse"):
        raise ConfigurationError(
            not_as(f"start {start!r}", said("mistake.nothing_or", first="forward", second="reverse"))
        )
    limits = PARAMETERS["F803"]
    if not limits.low <= rated_current <= limits.high:
        raise ConfigurationError(
            said("mistake.takes", what="rated_current", low=limits.low, high=f"{limits.high} A", value=rated_current)
        )
    limits = PARAMETERS["F802"]
    if not max(1.0, limits.low) <= rated_voltage <= limits.high:
        raise ConfigurationError(
            said(
                "mistake.takes",
                what="rated_voltage",
                low=f"{limits.low:g}",
                high=f"{limits.high:g} V",
                value=f"{rated_voltage:g}",
            )
        )
    if drive_current is not None and not drive_current > 0:
        raise ConfigurationError(
            said("mistake.takes_above", what="drive_current", low="0 A", value=f"{drive_current:g}")
        )
    if not inertia_ratio >= 0:
        raise ConfigurationError(said("mistake.takes_from", what="inertia_ratio", low=0, value=inertia_ratio))


def _percent(name: str, value: float, address: int) -> int:
    low, high = own.LIMITS[address]
    if not low <= value <= high:
        raise ConfigurationError(said("mistake.takes", what=name, low=low, high=f"{high} %", value=value))
    return round(value)
