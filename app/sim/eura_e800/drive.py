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
| trip levels, overload curves, capacity of the DC bus, no brake chopper, no stall prevention | usual values of the 230 V class |
| vector control (F106 = 0, 3) | V/f with slip and IR compensation; F106 = 6 and user points (F137 = 2) run as plain V/f |
| speed while the motor coasts | 0: without encoder and output the drive sees none; `shaft_speed` is the truth |
"""

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from math import pi, sqrt
from random import Random
from typing import NamedTuple

from app.errors import ConfigurationError, DeviceException
from app.sim import training
from app.sim.device import DT
from app.sim.eura_e800 import training as own
from app.sim.eura_e800.faults import CE, FAULTS, LU, OC, OE, OH, OL1, OL2, PATIENCE
from app.sim.eura_e800.parameters import BY_ADDRESS, PARAMETERS, commissioned, limits
from app.sim.eura_e800.registers import AO1, AO2, COMMAND, DO1, DO2, FIRST, LAST, LOCK, REGISTERS, RELAY
from app.sim.induction_motor import MOTOR_SETS, SQRT3, InductionMotor, rated_point
from app.sim.load import Load
from app.sim.training import LineFault, TrainingRegisters, is_training

STANDBY, FORWARD, REVERSE = 0, 1, 2

DRIVE_RATED_CURRENT = 4.5
"""E800-0007S2 [A]; a bigger motor gets a drive of its own size."""
OC_LEVEL = 2.0
"""Over-current trip [1 = rated current of the drive]."""
OE_LEVEL, OE_RESET = 400.0, 385.0
"""Over-voltage trip, and below what it can be reset [V DC]."""
LU_LEVEL, LU_RESET = 190.0, 210.0
OH_LEVEL, OH_RESET = 85.0, 80.0
"""[°C]"""
OVERLOAD_FREE = 1.1
"""Multiple of the rated current that is carried for ever."""
OVERLOAD_TIME = 60.0
"""Time to trip at 150 % (OL2) or at F706 (OL1) [s]."""
OVERLOAD_RESET = 0.95
"""Part of the overload image below which the trip can be reset; 2.6 s at standstill."""
SINK_RISE, SINK_TIME, FAN_LOST_TIME = 30.0, 240.0, 20.0
"""Heat sink: rise at rated current [K], time constant with and without fan [s]."""
WINDING_RISE, WINDING_TIME = 75.0, 360.0
"""Winding: rise at rated losses [K], time constant [s]."""
BUS_CAPACITY = 470e-6
"""[F], for the drive of 4.5 A."""
LOWEST_OUTPUT = 0.05
"""Lowest frequency the output makes, also while it passes zero [Hz]."""


class Communication(NamedTuple):
    """The line settings in force since the last power-up (F900, F901, F902, F903, F904)."""

    address: int
    mode: int
    stop_bits: int
    parity: int
    baud: int


class _Phase(Enum):
    STOPPED = "stopped"
    RUNNING = "running"
    STOPPING = "stopping"
    JOGGING = "jogging"
    JOG_STOPPING = "jog stopping"


class VirtualE800:
    """An E800 with a motor in delta at its 230 V output."""

    type: str = "eura_e800"
    dt: float = DT

    motor: InductionMotor
    fault: int
    """Status code of the fault that stands, 0 = none."""
    locked: bool
    """Remote commands are not valid (0x2001 = 2)."""
    eeprom_enabled: bool
    """Parameter writes also go to EEPROM (0x2001 = 3; 4 = RAM only)."""
    outputs: dict[int, int]
    """Words last written for the outputs (0x2002–0x2007)."""
    voltage: float
    """Output, line to line [V rms]."""
    bus_voltage: float
    """[V DC]"""
    heat_sink: float
    """[°C]"""
    winding: float
    """Of the motor [°C]; the drive has no register for it."""
    drive_overload: float
    """Overload image of the drive, trips at 1."""
    motor_overload: float
    """Overload image of the motor, trips at 1."""
    _phase: _Phase
    _direction: int
    _frequency: float
    _slip_compensation: float
    _value: dict[str, float]
    _staged: dict[str, float]
    _eeprom: dict[str, float]
    _communication: Communication
    _image: list[int] | None
    _armed: bool
    _silent: int
    _injected: int
    _injected_for: float
    _mains: float
    _ticks: int
    _load: Load
    _random: Random

    def __init__(
        self,
        *,
        seed: int = 1,
        rated_current: float = 4.5,
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

        `rated_current`: of the motor in delta at 230 V [A], which sizes it and becomes F803; `parameters`: values by code, kept
        in EEPROM; `motor`: A legacy, B modern; `block_limit`, `parameter_limit`: most registers per read from 0x1000 and of
        parameters; `multiple_writes`: whether function 16 is known; `load`, `quadratic_load`, `disturbance` [% of rated
        torque]; `inertia_ratio`: of the load to the rotor.

        Raises:
            ConfigurationError: one of them is unknown or out of range.
        """
        if motor not in MOTOR_SETS:
            raise ConfigurationError(f"motor {motor!r}: expected one of {', '.join(MOTOR_SETS)}")
        if start not in ("", "forward", "reverse"):
            raise ConfigurationError(f"start {start!r}: expected nothing, forward or reverse")
        limits = PARAMETERS["F803"]
        if not limits.low <= rated_current <= limits.high:
            raise ConfigurationError(f"rated_current takes {limits.low} to {limits.high} A, not {rated_current}")
        if not inertia_ratio >= 0:
            raise ConfigurationError(f"inertia_ratio takes 0 or more, not {inertia_ratio}")
        self.block_limit = block_limit
        self.parameter_limit = parameter_limit
        self.multiple_writes = multiple_writes
        self._seed = seed
        self._start = start
        self._inertia_ratio = inertia_ratio
        self.motor_data = MOTOR_SETS[motor].sized(rated_current)
        self._rated_losses = rated_point(self.motor_data, 230.0).losses
        self.drive_current = max(DRIVE_RATED_CURRENT, rated_current)
        """Rated output current of the drive [A]."""
        self._factory = commissioned(self.motor_data, rated_current, parameters or {})
        self._training = TrainingRegisters(
            own.TYPE_CODE,
            FAULTS,
            {
                own.REG_LOAD: _percent("load", load, own.REG_LOAD),
                own.REG_LOAD_QUADRATIC: _percent("quadratic_load", quadratic_load, own.REG_LOAD_QUADRATIC),
                own.REG_DISTURBANCE: _percent("disturbance", disturbance, own.REG_DISTURBANCE),
                own.REG_AMBIENT: 25,
                own.REG_SUPPLY: 230,
            },
            limits=own.LIMITS,
        )
        self._command_table: Mapping[int, Callable[[], None]] = {
            1: lambda: self._run(1),
            2: lambda: self._run(-1),
            3: self._stop,
            4: self._free_stop,
            5: self._jog_forward,
            6: lambda: self._jog_stop(1),
            8: lambda: self._run(-1 if self._value["F202"] == 1 else 1),
            9: self._reset,
            10: lambda: self._jog_stop(1),
            11: lambda: self._jog_stop(-1),
        }
        self._pending: list[tuple[int, int]] = []
        self._heard = False
        self.eeprom_writes = 0
        """Wear of the EEPROM since construction: parameter writes that went to it."""
        self._to_initial_state()

    # ---- the bus side

    @property
    def line_fault(self) -> LineFault:
        """What the instructor did to the line of this unit; only kept here."""
        return self._training.line_fault

    def telegram_seen(self) -> None:
        """Feed the communication watchdog (F905) at the next step border."""
        self._heard = True

    def read(self, function: int, address: int, count: int) -> list[int]:
        """Function 03 of 0x1000–0x1018, of parameters and of training registers.

        Raises:
            DeviceException: 01 other function, 02 unknown or write-only address, 03 more registers than the drive gives.
        """
        if is_training(address):
            return self._training.read(function, address, count)
        if function != 3:
            raise DeviceException(1, f"E800: function {function:02d}, expected 03")
        status = FIRST <= address <= LAST
        if not status and address not in BY_ADDRESS:
            raise DeviceException(2, f"E800: register 0x{address:04X} is not read")
        limit = self.block_limit if status else self.parameter_limit
        if not 1 <= count <= limit:
            raise DeviceException(3, f"E800: {count} registers from 0x{address:04X}, expected 1 to {limit}")
        if status:
            if address + count - 1 > LAST:
                raise DeviceException(2, f"E800: 0x{address:04X} + {count} goes beyond 0x{LAST:04X}")
            if self._image is None:
                self._image = self._encode()
            return self._image[address - FIRST : address - FIRST + count]
        wanted = [BY_ADDRESS.get(at) for at in range(address, address + count)]
        words = [parameter.encode(self._value[parameter.code]) for parameter in wanted if parameter is not None]
        if len(words) != count:
            raise DeviceException(2, f"E800: not all of 0x{address:04X} + {count} are parameters")
        return words

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """Function 06 (16 where switched on) to 0x2000–0x2007, parameters and training registers.

        Raises:
            DeviceException: 01 other function, 02 unknown or read-only address, 03 value, 04 reset or unlock refused because
                the cause of the fault persists. Nothing of a refused request acts.
        """
        if is_training(address):
            self._training.check(function, address, words)
            self._pending += enumerate(words, address)
            return
        if function != 6 and not (function == 16 and self.multiple_writes):
            raise DeviceException(1, f"E800: function {function:02d}, expected 06")
        if not words or (function == 6 and len(words) != 1):
            raise DeviceException(3, f"E800: {len(words)} words with function {function:02d}")
        staged = dict(self._staged)
        for at, word in enumerate(words, address):
            self._check(at, word, staged)
        self._staged = staged
        self._pending += enumerate(words, address)

    def _check(self, address: int, word: int, staged: dict[str, float]) -> None:
        if not 0 <= word <= 0xFFFF:
            raise DeviceException(3, f"E800: {word} is not a word")
        parameter = BY_ADDRESS.get(address)
        if parameter is not None:
            value = parameter.decode(word)
            low, high = limits(parameter, staged)
            if not (parameter.accepts(value) and low <= value <= high):
                raise DeviceException(3, f"{parameter.code} takes {low:g} to {high:g} {parameter.unit}, not {value:g}")
            staged[parameter.code] = value
        elif address == COMMAND:
            if word not in self._command_table:
                raise DeviceException(3, f"E800: command {word}, expected one of {sorted(self._command_table)}")
            if word == 9 and not self.locked and self._listens("F200", "F201") and self._cause_persists():
                raise DeviceException(4, f"reset refused: the cause of {FAULTS[self.fault][0]} persists")
        elif address == LOCK:
            if not 1 <= word <= 4:
                raise DeviceException(3, f"E800: lock word {word}, expected 1 to 4")
            if word == 1 and self._cause_persists():
                raise DeviceException(4, f"unlock refused: the cause of {FAULTS[self.fault][0]} persists")
        elif address in (AO1, AO2):
            if word > 1000:
                raise DeviceException(3, f"E800: analog output {word}, expected 0 to 1000")
        elif address in (DO1, DO2, RELAY):
            if word > 1:
                raise DeviceException(3, f"E800: token output {word}, expected 0 or 1")
        else:
            raise DeviceException(2, f"E800: register 0x{address:04X} is not written")

    # ---- what one sees from outside

    @property
    def status(self) -> int:
        """Status code, as in the low byte of 0x1005."""
        if self.fault:
            return self.fault
        if self._phase is _Phase.STOPPED:
            return STANDBY
        return FORWARD if (self._frequency or self._direction) > 0 else REVERSE

    @property
    def output_on(self) -> bool:
        """Whether the inverter feeds the motor."""
        return self._phase is not _Phase.STOPPED

    @property
    def frequency(self) -> float:
        """Output of the ramp [Hz], negative in reverse."""
        return self._frequency

    @property
    def shaft_speed(self) -> float:
        """True speed of the shaft [rpm], negative in reverse, also while it coasts."""
        return self.motor.speed * 30 / pi

    @property
    def communication(self) -> Communication:
        """Line settings in force; F900–F904 act at the next power-up."""
        return self._communication

    def parameter(self, code: str) -> float:
        """Present value of a parameter [its unit]."""
        return self._value[code]

    def power_cycle(self) -> None:
        """Supply off and on: faults, lock and RAM values are gone, EEPROM stays, the shaft keeps turning, nothing runs."""
        self._power_up()

    # ---- one step

    def step(self) -> None:
        """Advance by 10 ms: writes act, the program and the physics move, the image is new."""
        self._take_writes()
        self._watch_communication()
        self._ramp()
        self._move_motor()
        self._move_bus()
        self._warm_up()
        self._protect()
        self._image = None

    def _take_writes(self) -> None:
        if not self._pending:
            return
        initial = False
        for address, word in self._pending:
            if is_training(address):
                initial |= self._training.act(address, word)
                if address == training.REG_MACHINE_FAULT:
                    self._begin_injection()
            elif address == COMMAND:
                if not self.locked:
                    self._command_table[word]()
            elif address == LOCK:
                self._take_lock(word)
            elif (parameter := BY_ADDRESS.get(address)) is not None:
                self._value[parameter.code] = parameter.decode(word)
                if self.eeprom_enabled:
                    self._eeprom[parameter.code] = parameter.decode(word)
                    self.eeprom_writes += 1
            else:
                self.outputs[address] = word
        self._pending.clear()
        self._load.constant = self._training[own.REG_LOAD] / 100
        self._load.quadratic = self._training[own.REG_LOAD_QUADRATIC] / 100
        self._load.disturbance = self._training[own.REG_DISTURBANCE] / 100
        if initial:
            self._to_initial_state()

    def _take_lock(self, word: int) -> None:
        if word <= 2:
            self.locked = word == 2
        else:
            self.eeprom_enabled = word == 3

    def _watch_communication(self) -> None:
        if self._heard:
            self._heard = False
            self._armed = True
            self._silent = 0
            return
        self._silent += 1
        limit = self._value["F905"]
        if self._armed and limit > 0 and self.output_on and self._silent * self.dt > limit + 1e-9:
            self._trip(CE)

    def _ramp(self) -> None:
        phase = self._phase
        if phase is _Phase.STOPPED:
            return
        value = self._value
        jog = phase is _Phase.JOGGING or phase is _Phase.JOG_STOPPING
        if phase is _Phase.RUNNING:
            reference = value["F113"] if value["F203"] in (0, 10) else 0.0
            target = self._direction * min(max(reference, value["F112"]), value["F111"])
        elif phase is _Phase.JOGGING:
            target = self._direction * min(max(value["F124"], value["F112"]), value["F111"])
        else:
            target = 0.0
        now = self._frequency
        slower = now * (target - now) < 0
        time = value[("F126" if jog else "F115") if slower else ("F125" if jog else "F114")]
        reach = (value["F111"] if value["F119"] == 1 else 50.0) / time * self.dt
        gap = target - now
        if slower and now * target < 0:
            # Zero is a stop on the way: from there on the other ramp counts.
            gap = -now
        # Rounded far below a raw step, so that ten ramps do not drift off their grid.
        self._frequency = now + gap if abs(gap) <= reach else round(now + (reach if gap > 0 else -reach), 9)
        if phase in (_Phase.STOPPING, _Phase.JOG_STOPPING) and (
            abs(self._frequency) < value["F112"] or self._frequency == 0
        ):
            self._output_off()

    def _move_motor(self) -> None:
        data = self.motor_data
        self._load.step(self.dt)
        injected = self._injected if not self.fault else 0
        constant = self._load.torque * data.rated_torque
        breakaway = self._load.breakaway * data.rated_torque
        quadratic = self._load.quadratic * data.rated_torque / (data.rated_angular_speed * data.rated_angular_speed)
        if not self.output_on:
            self.voltage = 0.0
            self.motor.step(0.0, 1.0, constant, quadratic, self.dt, breakaway=breakaway)
            return
        magnitude = abs(self._frequency)
        sense = self._frequency or self._direction
        vector = self._value["F106"] in (0, 3)
        supplied = max(LOWEST_OUTPUT, magnitude)
        if vector and magnitude > 1.0:
            wanted = data.rated_slip_frequency * min(max(self.motor.point.torque / data.rated_torque, -1.5), 1.5)
            self._slip_compensation += (wanted - self._slip_compensation) * self.dt / 0.2
            supplied = max(LOWEST_OUTPUT, magnitude + self._slip_compensation)
        else:
            self._slip_compensation = 0.0
        self.voltage = min(self.output_voltage(magnitude), self.bus_voltage / _ROOT2)
        if injected == OC:
            constant = breakaway = 8 * data.rated_torque
        elif injected in (OL1, OL2):
            limit = 0.85 * self.motor.pull_out_torque(self.voltage, supplied) if self.voltage > 0 else 0.0
            constant, quadratic = max(constant, min(1.6 * data.rated_torque, limit)), 0.0
        self.motor.step(
            self.voltage,
            supplied if sense > 0 else -supplied,
            constant,
            quadratic,
            self.dt,
            breakaway=breakaway,
        )

    def output_voltage(self, frequency: float) -> float:
        """The V/f curve: line voltage [V] that the drive would give at `frequency` [Hz, 0 or above], the bus permitting."""
        value = self._value
        nominal = value["F802"]
        part = frequency / value["F118"]
        if part >= 1:
            return nominal
        curve = value["F137"]
        if curve == 3 or value["F106"] in (0, 3):
            return min(nominal, nominal * part + self.motor_data.rs * self.motor.point.current / SQRT3)
        if curve == 1:
            boost = 0.01 * nominal * value["F139"]
            return boost + (nominal - boost) * part * part
        boost = 0.01 * nominal * value["F138"] if curve == 0 else 0.0
        return boost + (nominal - boost) * part

    def _move_bus(self) -> None:
        """Rectifier, capacitor and what the inverter takes out or, braking, puts in; there is no chopper."""
        if self._ticks % 10 == 0:
            self._mains = 0.97 * self._mains + 0.25 * self._random.gauss(0.0, 1.0)
        self._ticks += 1
        supply = (self._training[own.REG_SUPPLY] + self._mains) * {OE: 1.3, LU: 0.45}.get(self._injected, 1.0)
        power_in = self.motor.point.power_in
        power = power_in + 15.0 + (10.0 + 0.02 * abs(power_in) if self.output_on else 0.0)
        size = self.drive_current / DRIVE_RATED_CURRENT
        rectified = max(0.0, _ROOT2 * supply - 9.0 * max(0.0, power) / (750.0 * size))
        bus = self.bus_voltage
        if power < 0 or bus > rectified:
            left = sqrt(max(0.0, bus * bus - 2 * power * self.dt / (BUS_CAPACITY * size)))
            self.bus_voltage = max(left, min(rectified, bus))
        else:
            self.bus_voltage = bus + (rectified - bus) * self.dt / 0.03

    def _warm_up(self) -> None:
        point = self.motor.point
        ratio = point.current / self.drive_current
        ambient = self._training[own.REG_AMBIENT]
        aim, time = ambient + self._sink_rise(ratio), SINK_TIME
        if self._injected == OH and not (self.fault and self.heat_sink >= OH_LEVEL):
            aim, time = ambient + 125.0, FAN_LOST_TIME
        self.heat_sink += (aim - self.heat_sink) * self.dt / time
        losses = point.losses if self.output_on else 0.0
        warm = ambient + WINDING_RISE * losses / self._rated_losses
        self.winding += (warm - self.winding) * self.dt / WINDING_TIME
        value = self._value
        self.drive_overload = _overload(self.drive_overload, ratio, value["F706"] / 100, self.dt)
        motor_current = value["F803"] * value["F707"] / 100
        self.motor_overload = _overload(self.motor_overload, point.current / motor_current, 1.5, self.dt)

    def _sink_rise(self, ratio: float) -> float:
        return (2.0 if self.output_on else 1.0) + (SINK_RISE - 2.0) * (0.4 * ratio + 0.6 * ratio * ratio)

    def _protect(self) -> None:
        if self.fault:
            return
        if self.motor.point.current > OC_LEVEL * self.drive_current:
            self._trip(OC)
        elif self.bus_voltage > OE_LEVEL:
            self._trip(OE)
        elif self.bus_voltage < LU_LEVEL:
            self._trip(LU)
        elif self.heat_sink > OH_LEVEL:
            self._trip(OH)
        elif self.output_on and self.motor_overload >= 1.0 and self._injected != OL1:
            self._trip(OL2)
        elif self.output_on and self.drive_overload >= 1.0 and self._injected != OL2:
            self._trip(OL1)
        elif self._injected:
            self._injected_for += self.dt
            if not self.output_on or self._injected_for > PATIENCE.get(self._injected, 0.0):
                self._trip(self._injected)

    # ---- commands

    def _listens(self, *codes: str) -> bool:
        """Whether one of F200 (start), F201 (stop) lets Modbus command."""
        return any(self._value[code] in (3, 4) for code in codes)

    def _run(self, direction: int) -> None:
        if self._listens("F200") and not self.fault:
            self._phase = _Phase.RUNNING
            self._direction = direction

    def _stop(self) -> None:
        if not self._listens("F201") or self._phase is _Phase.STOPPED:
            return
        if self._value["F209"] == 1:
            self._output_off()
        else:
            self._phase = _Phase.STOPPING

    def _free_stop(self) -> None:
        if self._listens("F201"):
            self._output_off()

    def _jog_forward(self) -> None:
        if self._listens("F200") and not self.fault and self._phase is not _Phase.RUNNING:
            self._phase = _Phase.JOGGING
            self._direction = 1

    def _jog_stop(self, direction: int) -> None:
        if self._listens("F201") and self._phase is _Phase.JOGGING and self._direction == direction:
            self._phase = _Phase.JOG_STOPPING

    def _reset(self) -> None:
        if self._listens("F200", "F201") and not self._cause_persists():
            self.fault = 0

    def _cause_persists(self) -> bool:
        """Whether the fault that stands would come back at once."""
        fault = self.fault
        if not fault:
            return False
        if fault == self._injected:
            return True
        return (
            (fault == OE and self.bus_voltage >= OE_RESET)
            or (fault == LU and self.bus_voltage <= LU_RESET)
            or (fault == OH and self.heat_sink >= OH_RESET)
            or (fault == OL1 and self.drive_overload >= OVERLOAD_RESET)
            or (fault == OL2 and self.motor_overload >= OVERLOAD_RESET)
        )

    def _trip(self, code: int) -> None:
        self.fault = code
        self._output_off()

    def _output_off(self) -> None:
        self._phase = _Phase.STOPPED
        self._frequency = 0.0
        self.voltage = 0.0
        self.motor.step(0.0, 1.0, 0.0, 0.0, 0.0)

    def _begin_injection(self) -> None:
        self._injected = self._training[training.REG_MACHINE_FAULT]
        self._injected_for = 0.0
        if self._injected == OL1 and self.output_on:
            self.drive_overload = max(self.drive_overload, 0.97)
        elif self._injected == OL2 and self.output_on:
            self.motor_overload = max(self.motor_overload, 0.97)

    # ---- states to begin with

    def _power_up(self) -> None:
        self._value = dict(self._eeprom)
        self._staged = dict(self._eeprom)
        self._pending = [(address, word) for address, word in self._pending if is_training(address)]
        self._direction = 1
        self._slip_compensation = 0.0
        self._output_off()
        self.fault = 0
        self.locked = False
        self.eeprom_enabled = True
        self.outputs = {AO1: 0, AO2: 0, DO1: 0, DO2: 0, RELAY: 0}
        self._heard = False
        self._armed = False
        self._silent = 0
        self.drive_overload = 0.0
        self.motor_overload = 0.0
        self._communication = Communication(*(int(self._value[f"F90{digit}"]) for digit in range(5)))
        self._image = None

    def _to_initial_state(self) -> None:
        """As constructed, the random sequence included."""
        self._random = Random(self._seed)
        self._training.reset()
        area = self._training
        self._load = Load(
            self._random,
            area[own.REG_LOAD] / 100,
            area[own.REG_LOAD_QUADRATIC] / 100,
            area[own.REG_DISTURBANCE] / 100,
        )
        self.motor = InductionMotor(self.motor_data, load_inertia=self._inertia_ratio * self.motor_data.inertia)
        self._eeprom = dict(self._factory)
        self._ticks = 0
        self._mains = 0.0
        self._injected = 0
        self._injected_for = 0.0
        self._power_up()
        ambient = area[own.REG_AMBIENT]
        self.bus_voltage = _ROOT2 * area[own.REG_SUPPLY]
        self.heat_sink = ambient + self._sink_rise(0.0)
        self.winding = float(ambient)
        if self._start:
            self._already_running(1 if self._start == "forward" else -1)

    def _already_running(self, direction: int) -> None:
        data, value = self.motor_data, self._value
        self._phase = _Phase.RUNNING
        self._direction = direction
        reference = value["F113"] if value["F203"] in (0, 10) else 0.0
        self._frequency = direction * max(reference, value["F112"])
        magnitude = max(LOWEST_OUTPUT, abs(self._frequency))
        speed = data.rated_angular_speed
        self.bus_voltage -= 5.0
        self.voltage = min(self.output_voltage(magnitude), self.bus_voltage / _ROOT2)
        point = self.motor.settle(
            self.voltage,
            direction * magnitude,
            self._load.torque * data.rated_torque,
            self._load.quadratic * data.rated_torque / (speed * speed),
        )
        ambient = self._training[own.REG_AMBIENT]
        self.heat_sink = ambient + self._sink_rise(point.current / self.drive_current)
        self.winding = ambient + WINDING_RISE * point.losses / self._rated_losses

    # ---- the register image

    def _encode(self) -> list[int]:
        point, value, on = self.motor.point, self._value, self.output_on
        power = max(0.0, point.power_in) / 1000
        speed = abs(self.shaft_speed) * 2 * self.motor_data.pole_pairs / value["F804"] if on else 0.0
        words = dict.fromkeys(REGISTERS, 0)
        words |= {
            0x1000: round(abs(self._frequency) * 100),
            0x1001: round(self.voltage),
            0x1002: round(point.current * 100),
            0x1003: int(value["F804"]) << 8 | int(value["F200"]),
            0x1004: round(self.bus_voltage),
            0x1005: 0x0100 | self.status,
            0x1006: round(abs(point.torque) / self.motor_data.rated_torque * 100),
            0x1007: round(self.heat_sink),
            0x100A: int(power),
            0x100C: (1 if on else 0) | (4 if self.fault else 0),
            0x1015: self._analog_output("F431", AO1),
            0x1016: self._analog_output("F432", AO2),
            0x1017: round(speed),
            0x1018: round(power * 10),
        }
        return [min(max(word, 0), 0xFFFF) for word in words.values()]

    def _analog_output(self, function: str, token: int) -> int:
        """0–10000: 0 output frequency, 1 output current (200 % of the drive), 7 what the PLC wrote, other functions 0."""
        chosen = self._value[function]
        if chosen == 0:
            return min(10000, round(abs(self._frequency) / max(self._value["F111"], 1.0) * 10000))
        if chosen == 1:
            return min(10000, round(self.motor.point.current / (2 * self.drive_current) * 10000))
        return self.outputs[token] * 10 if chosen == 7 else 0


_ROOT2 = sqrt(2.0)


def _overload(image: float, ratio: float, at_limit: float, dt: float) -> float:
    """Inverse-time image: 1 after `OVERLOAD_TIME` at `at_limit` times the rated current, fades below `OVERLOAD_FREE`."""
    free = OVERLOAD_FREE * OVERLOAD_FREE
    image += (ratio * ratio - free) / (at_limit * at_limit - free) * dt / OVERLOAD_TIME
    return min(max(image, 0.0), 1.5)


def _percent(name: str, value: float, address: int) -> int:
    low, high = own.LIMITS[address]
    if not low <= value <= high:
        raise ConfigurationError(f"{name} takes {low} to {high} %, not {value}")
    return round(value)
