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
"""

from collections.abc import Mapping, Sequence
from math import sqrt
from random import Random
from types import MappingProxyType

from app.errors import ConfigurationError, DeviceException
from app.profidrive.scaling import Scaling
from app.profidrive.state_machine import STOPPING, Inputs, State, StateMachine
from app.profidrive.words import ENABLES, RUN, Control, Status
from app.sim import training
from app.sim.device import DT
from app.sim.induction_motor import MOTOR_SETS, SQRT3
from app.sim.load import Load
from app.sim.sinamics import messages
from app.sim.sinamics import registers as map
from app.sim.sinamics import training as own
from app.sim.sinamics.messages import ALARMS, FAULTS
from app.sim.sinamics.shaft import RPM, Resistance, Shaft, Supply
from app.sim.training import LineFault, TrainingRegisters, is_training

DEFAULTS: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "p0346": (0.4, 0, 20),
        "p0347": (0.6, 0, 20),
        "p1082": (1500, 0, 16250),
        "p1120": (5, 0, 650),
        "p1121": (5, 0, 650),
        "p1135": (1, 0, 600),
        "p1226": (20, 0, 16250),
        "p2040": (1000, 0, 1999999),
        "p2155": (900, 0, 16250),
        "p2163": (90, 0, 16250),
        "p2000": (1500, 6, 32767),
    }
)
"""Parameters that a plant file may set → default, least, greatest; times [s], speeds [rpm], p2040 [ms]. Numbers and defaults other than of
p1120, p1121, p2000 and p2040 are unconfirmed."""

SITUATIONS, PLACES = 8, 8
"""The fault buffer: so many situations of so many faults."""
REACTION_PATIENCE = 1.0
"""Blocked at the limit for so long: F07900 [s]."""
DEVIATION_PATIENCE = 2.0
BRAKE_TIME = 0.1
"""[s]"""
CHOPPER, OVER, UNDER = 750.0, 820.0, 360.0
"""DC link: chopper, trip above, trip below [V]."""
MOTOR_WARM, MOTOR_HOT, MOTOR_RESET = 120.0, 145.0, 110.0
SINK_WARM, SINK_HOT, SINK_RESET = 75.0, 85.0, 70.0
"""[°C]"""
MOTOR_TIME, SINK_TIME = 480.0, 240.0
"""[s]"""
MOTOR_RISE, SINK_RISE = 80.0, 35.0
"""At rated current [K]."""
OVERLOAD_TIME, OVERLOAD_AT = 60.0, 1.5
"""Image full after so long [s] at that multiple of the rated current."""
FIRMWARE, POWER_UNIT = 470, 10001


class VirtualSinamics:
    """A drive with an induction motor in star at 400 V."""

    type: str = "sinamics"
    dt: float = DT

    machine: StateMachine
    shaft: Shaft
    flux: float
    """[1 = rated]"""
    ramp: float
    """Output of the ramp generator [rpm]."""
    bus_voltage: float
    """[V DC]"""
    motor_temperature: float
    sink_temperature: float
    """[°C]"""
    overload: float
    """Image of the I²t, trips at 1."""
    energy: float
    """[kWh]"""
    buffer: list[list[int]]
    """r0947: situations of faults, the present one first; 0 = none."""
    _alarms: list[int]
    _entered: list[int]
    _away_for: float
    _blocked_for: float
    _pulsing: float
    _load: Load

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
    ) -> None:
        """A drive that was just powered up, or runs since long when `start` is `forward` or `reverse`.

        `rated_current`: of the motor [A], which sizes it; `setpoint`: [% of p2000] that it begins with; `process_words`: 2 of a G120,
        10 of an S120; `parameters`: as `DEFAULTS`; `load`, `quadratic_load`, `disturbance` [% of rated torque]; `inertia_ratio`: of
        the load to the rotor.

        Raises:
            ConfigurationError: one of them is unknown or out of range.
        """
        if start not in ("", "forward", "reverse"):
            raise ConfigurationError(f"start {start!r}: expected nothing, forward or reverse")
        if not 1 <= rated_current <= 400:
            raise ConfigurationError(f"rated_current takes 1 to 400 A, not {rated_current}")
        if not 0 <= setpoint <= 199.9:
            raise ConfigurationError(f"setpoint takes 0 to 199.9 %, not {setpoint}")
        if process_words not in (2, 10):
            raise ConfigurationError(f"process_words is 2 or 10, not {process_words}")
        if not inertia_ratio >= 0:
            raise ConfigurationError(f"inertia_ratio takes 0 or more, not {inertia_ratio}")
        self.process_words = process_words
        self.rated_current = rated_current
        self.data = MOTOR_SETS["B"].sized(rated_current * SQRT3)
        self._seed, self._start, self._setpoint, self._inertia_ratio = seed, start, setpoint, inertia_ratio
        self._factory = self._commissioned(parameters or {})
        world = {own.REG_LOAD: load, own.REG_LOAD_QUADRATIC: quadratic_load, own.REG_DISTURBANCE: disturbance}
        for address, value in world.items():
            low, high = own.LIMITS[address]
            if not low <= value <= high:
                raise ConfigurationError(f"load takes {low} to {high} %, not {value}")
        self._training = TrainingRegisters(
            own.TYPE_CODE,
            {*FAULTS, *ALARMS},
            {
                **{address: round(value) for address, value in world.items()},
                own.REG_AMBIENT: 25,
                own.REG_SUPPLY: 400,
                own.REG_INTERLOCK: 0,
                own.REG_EMERGENCY: 0,
                own.REG_LOCAL: 0,
            },
            limits=own.LIMITS,
        )
        self._pending: list[tuple[int, int]] = []
        self._heard = False
        self._to_initial_state()

    # ---- the bus side

    @property
    def line_fault(self) -> LineFault:
        """What the instructor did to the line of this unit; only kept here."""
        return self._training.line_fault

    def telegram_seen(self) -> None:
        """No sign of life by itself: the drive counts accesses to its process data only (`read`, `write`)."""

    def read(self, function: int, address: int, count: int) -> list[int]:
        """Function 03 of what the map lists, and of training registers.

        Raises:
            DeviceException: 01 other function, 02 a register that is not there, 03 not 1 to 125 registers.
        """
        if is_training(address):
            return self._training.read(function, address, count)
        if function != 3:
            raise DeviceException(1, f"SINAMICS: function {function:02d}, expected 03")
        if not 1 <= count <= 125:
            raise DeviceException(3, f"SINAMICS: {count} registers, expected 1 to 125")
        numbers = range(address + map.FIRST_NUMBER, address + count + map.FIRST_NUMBER)
        missing = next((number for number in numbers if not self._exists(number)), None)
        if missing is not None:
            raise DeviceException(2, f"SINAMICS: register {missing} does not exist")
        self._heard |= not map.WATCHED.isdisjoint(numbers)
        return [self._word(number) for number in numbers]

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """Functions 06 and 16 to what the map lists as writable, and to training registers.

        Raises:
            DeviceException: 01 other function, 02 a register that is not there, 03 value, 04 read-only (40499 then tells why).
                Nothing of a refused request acts.
        """
        if is_training(address):
            self._training.check(function, address, words)
            self._pending += enumerate(words, address)
            return
        if function not in (6, 16):
            raise DeviceException(1, f"SINAMICS: function {function:02d}, expected 06 or 16")
        if not words or len(words) > 123 or (function == 6 and len(words) != 1):
            raise DeviceException(3, f"SINAMICS: {len(words)} words with function {function:02d}")
        for number, word in enumerate(words, address + map.FIRST_NUMBER):
            self._check(number, word)
        self._heard |= not map.WATCHED.isdisjoint(
            range(address + map.FIRST_NUMBER, address + len(words) + map.FIRST_NUMBER)
        )
        self._pending += enumerate(words, address)

    def _exists(self, number: int) -> bool:
        if number in map.REGISTERS:
            return True
        return any(first <= number < first + self.process_words for first in (map.CONTROL, map.STATUS))

    def _check(self, number: int, word: int) -> None:
        if not self._exists(number):
            raise DeviceException(2, f"SINAMICS: register {number} does not exist")
        if not 0 <= word <= 0xFFFF:
            raise DeviceException(3, f"SINAMICS: {word} is not a word")
        if map.CONTROL <= number < map.PROCESS_OUT_END:
            return
        register = map.REGISTERS.get(number)
        if register is None or not register.writable:
            self._access_error = 1
            raise DeviceException(4, f"SINAMICS: register {number} is read only")
        value = register.decode(word)
        if not register.low <= value <= register.high:
            self._access_error = 2
            allowed = f"{register.low:g} to {register.high:g} {register.unit}".rstrip()
            raise DeviceException(3, f"{register.parameter} takes {allowed}, not {value:g}")

    # ---- what one sees from outside

    @property
    def state(self) -> State:
        """State of the drive."""
        return self.machine.state

    @property
    def speed(self) -> float:
        """Of the shaft [rpm], negative in reverse."""
        return self.shaft.speed * RPM

    @property
    def faults(self) -> list[int]:
        """Numbers that stand."""
        return [number for number in self.buffer[0] if number]

    @property
    def alarms(self) -> list[int]:
        """Numbers of alarms that are there now, in the order in which they came."""
        return list(self._alarms)

    @property
    def status(self) -> int:
        """ZSW1."""
        word = self.machine.status
        if self.local:
            word &= ~Status.CONTROL_REQUESTED
        deviation = abs(self._reference - self.speed)
        for bit, on in (
            (Status.ALARM, bool(self._alarms)),
            (Status.SPEED_WITHIN_TOLERANCE, deviation <= self._value["p2163"]),
            (Status.COMPARISON_REACHED, abs(self.speed) >= self._value["p2155"]),
            (Status.LIMIT_NOT_REACHED, not self.shaft.limited),
            (Status.BRAKE_OPEN, self._pulsing >= BRAKE_TIME),
            (Status.NO_MOTOR_OVERTEMPERATURE, messages.MOTOR_WARM not in self._alarms),
            (Status.FORWARD, self._forward),
            (Status.NO_POWER_UNIT_OVERLOAD, messages.NEAR_OVERLOAD not in self._alarms),
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

    # ---- one step

    def step(self) -> None:
        """Advance by 10 ms: writes act, the program and the physics move, the words are new."""
        self._take_writes()
        self._watch_communication()
        self._run_machine()
        self._magnetise()
        self._ramp()
        self._move()
        self._warm_up()
        self._protect()

    def _take_writes(self) -> None:
        if not self._pending:
            return
        initial = False
        for address, word in self._pending:
            if is_training(address):
                initial |= self._training.act(address, word)
                if address == training.REG_MACHINE_FAULT:
                    self._blocked_for = 0.0
                continue
            number = address + map.FIRST_NUMBER
            if number < map.PROCESS_OUT_END:
                self._output[number - map.CONTROL] = word
            else:
                register = map.REGISTERS[number]
                self._value[register.parameter] = register.decode(word)
        self._pending.clear()
        if initial:
            self._to_initial_state()

    def _watch_communication(self) -> None:
        if self._heard:
            self._heard, self._armed, self._silent = False, True, 0
            return
        self._silent += 1
        limit = self._value["p2040"] / 1000
        if self._armed and limit > 0 and self.machine.pulses and self._silent * self.dt > limit + 1e-9:
            self._enter(messages.TIMEOUT)

    @property
    def _injected(self) -> int:
        return self._training[training.REG_MACHINE_FAULT]

    def _causes(self) -> list[int]:
        """Faults whose cause is there now, and that no acknowledgement takes away."""
        injected = self._injected
        found = [injected] if injected in FAULTS and injected != messages.BLOCKED else []
        for number, there in (
            (messages.MOTOR_HOT, self.motor_temperature >= MOTOR_RESET),
            (messages.SINK_HOT, self.sink_temperature >= SINK_RESET),
            (messages.UNDERVOLTAGE, self.bus_voltage < UNDER),
            (messages.OVERVOLTAGE, self.bus_voltage > OVER),
            (messages.OVERLOAD, self.overload >= 0.9),
        ):
            if there and number in self.buffer[0] and number not in found:
                found.append(number)
        return found

    def _run_machine(self) -> None:
        word = self._output[0]
        if self.local:
            word = ENABLES
        machine, before = self.machine, self.machine.control
        now = word if word & Control.BY_PLC else before
        causes = self._causes()
        if now & ~before & Control.ACKNOWLEDGE:
            self._acknowledge()
        for number in causes:
            self._enter(number)
        reactions = [FAULTS[number].reaction for number in (*self._entered, *causes)]
        self._entered.clear()
        machine.step(
            Inputs(
                word,
                abs(self.speed) < max(self._value["p1226"], 1.0) and abs(self.ramp) < max(self._value["p1226"], 1.0),
                self.flux >= 1.0,
                max(reactions) if reactions else None,
                not self._training[own.REG_INTERLOCK],
                not self._training[own.REG_EMERGENCY],
            )
        )
        if word & Control.BY_PLC:
            raw = self._output[1]
            self._held = raw - 0x10000 if raw >= 0x8000 else raw

    def _acknowledge(self) -> None:
        """Situations move on by one, the last is forgotten; what still has its cause is entered again."""
        if any(self.buffer[0]):
            self.buffer = [[0] * PLACES, *self.buffer[:-1]]

    def _enter(self, number: int) -> None:
        """A fault comes: into the next free place, or over the last one."""
        present = self.buffer[0]
        if number in present:
            return
        place = present.index(0) if 0 in present else PLACES - 1
        present[place] = number
        self._entered.append(number)

    def _magnetise(self) -> None:
        wanted = self.machine.pulses or (
            self.state is State.SWITCHED_ON and self.machine.control & Control.ENABLE_OPERATION
        )
        if wanted:
            self.flux = min(1.0, self.flux + (self.dt / self._value["p0346"] if self._value["p0346"] else 1.0))
        else:
            self.flux = max(0.0, self.flux - (self.dt / self._value["p0347"] if self._value["p0347"] else 1.0))
        self._pulsing = self._pulsing + self.dt if self.machine.pulses else 0.0

    @property
    def _reference(self) -> float:
        """Set-point before the ramp [rpm]."""
        word = self.machine.control
        if not self.machine.pulses or self.state in STOPPING or not word & Control.ENABLE_SETPOINT:
            return 0.0
        wanted = Scaling(self._value["p2000"]).value(self._held)
        wanted = -wanted if word & Control.INVERT else wanted
        return min(max(wanted, -self._value["p1082"]), self._value["p1082"])

    def _ramp(self) -> None:
        machine, word = self.machine, self.machine.control
        if not machine.pulses or self._pulsing <= self.dt + 1e-9:
            self.ramp = self.speed
            if not machine.pulses:
                return
        stopping = machine.state in STOPPING
        if not stopping and not word & Control.ENABLE_RAMP:
            self.ramp = 0.0
            return
        if not stopping and (not word & Control.CONTINUE_RAMP or self._pulsing < BRAKE_TIME):
            return
        target = self._reference
        slower = self.ramp * (target - self.ramp) < 0
        braking = "p1121" if slower else "p1120"
        time = self._value["p1135" if machine.state is State.QUICK_STOP else braking]
        if self.shaft.limited and not slower and abs(self.ramp - self.speed) > self._value["p2163"]:
            return
        reach = self._value["p1082"] / time * self.dt if time > 0 else float("inf")
        gap = -self.ramp if slower and self.ramp * target < 0 else target - self.ramp
        self.ramp = self.ramp + gap if abs(gap) <= reach else round(self.ramp + (reach if gap > 0 else -reach), 9)

    def _move(self) -> None:
        load, rated = self._load, self.data.rated_torque
        load.constant = self._training[own.REG_LOAD] / 100
        load.quadratic = self._training[own.REG_LOAD_QUADRATIC] / 100
        load.disturbance = self._training[own.REG_DISTURBANCE] / 100
        load.step(self.dt)
        supply = Supply(self.machine.pulses, self.ramp / RPM, self.flux, self._value["p0640"])
        self.shaft.step(supply, self._resistance(20 * rated if self._injected == messages.BLOCKED else 0.0), self.dt)
        if self.state is State.SWITCHED_ON and self.flux:
            self.shaft.current = self.flux * self.shaft.magnetising_current
        if abs(self.speed) > 1:
            self._forward = self.speed > 0
        power = max(0.0, self.shaft.power)
        self.energy += power * self.dt / 3.6e6
        supplied = self._training[own.REG_SUPPLY] * sqrt(2)
        sag = 0.01 * supplied * power / max(self.data.rated_power, 1.0)
        wanted = supplied - sag
        if self.shaft.power < 0:
            wanted = max(wanted, min(CHOPPER, wanted + 300 * -self.shaft.power / self.data.rated_power))
        self.bus_voltage += (wanted - self.bus_voltage) * min(1.0, self.dt / 0.05)

    def _resistance(self, blocked: float) -> Resistance:
        rated, speed = self.data.rated_torque, self.data.rated_angular_speed
        friction = self.data.friction_power / speed
        return Resistance(
            self._load.torque * rated + friction + blocked,
            self._load.breakaway * rated + friction + blocked,
            self._load.quadratic * rated / (speed * speed),
        )

    def _warm_up(self) -> None:
        ratio = self.shaft.current / self.rated_current
        ambient = self._training[own.REG_AMBIENT]
        self.motor_temperature += (ambient + MOTOR_RISE * ratio**2 - self.motor_temperature) * self.dt / MOTOR_TIME
        self.sink_temperature += (ambient + SINK_RISE * ratio**2 - self.sink_temperature) * self.dt / SINK_TIME
        free = 1.1 * 1.1
        self.overload += (ratio**2 - free) / (OVERLOAD_AT**2 - free) * self.dt / OVERLOAD_TIME
        self.overload = min(max(self.overload, 0.0), 1.2)

    def _protect(self) -> None:
        pulses = self.machine.pulses
        for number, there in (
            (messages.MOTOR_HOT, self.motor_temperature > MOTOR_HOT),
            (messages.SINK_HOT, self.sink_temperature > SINK_HOT),
            (messages.OVERLOAD, self.overload >= 1.0),
            (messages.OVERVOLTAGE, self.bus_voltage > OVER),
            (messages.UNDERVOLTAGE, pulses and self.bus_voltage < UNDER),
            (messages.OVERSPEED, pulses and abs(self.speed) > 1.2 * self._value["p1082"] + 30),
        ):
            if there:
                self._enter(number)
        blocked = pulses and self.shaft.limited and abs(self.speed) < max(self._value["p1226"], 1.0)
        self._blocked_for = self._blocked_for + self.dt if blocked else 0.0
        if self._blocked_for > REACTION_PATIENCE:
            self._enter(messages.BLOCKED)
        away = self.state is State.OPERATION and abs(self.ramp - self.speed) > self._value["p2163"]
        self._away_for = self._away_for + self.dt if away else 0.0
        wanted = {
            messages.MOTOR_WARM: self.motor_temperature > MOTOR_WARM,
            messages.SINK_WARM: self.sink_temperature > SINK_WARM,
            messages.NEAR_OVERLOAD: self.overload > 0.8,
            messages.DEVIATION: self._away_for > DEVIATION_PATIENCE,
        }
        if self._injected in ALARMS:
            wanted[self._injected] = True
        self._alarms = [number for number in self._alarms if wanted.get(number)]
        self._alarms += [number for number, there in wanted.items() if there and number not in self._alarms]

    # ---- states to begin with

    def _commissioned(self, given: Mapping[str, float]) -> dict[str, float]:
        values = {code: default for code, (default, _, _) in DEFAULTS.items()}
        values |= {one.parameter: 0.0 for one in map.REGISTERS.values() if one.writable and one.parameter not in values}
        values |= {"p2291": 100.0, "p2269": 100.0, "p2280": 1.0, "p2285": 30.0}
        current = map.REGISTERS[40321]
        values["p0640"] = min(max(round(1.5 * self.rated_current, 1), current.low), current.high)
        limits = {code: limit[1:] for code, limit in DEFAULTS.items()} | {"p0640": (current.low, current.high)}
        for code, value in given.items():
            if code not in limits:
                raise ConfigurationError(f"parameter {code}: expected one of {', '.join(limits)}")
            low, high = limits[code]
            if not low <= value <= high:
                raise ConfigurationError(f"parameter {code} takes {low:g} to {high:g}, not {value:g}")
            values[code] = value
        if "p1082" not in given:
            values["p1082"] = values["p2000"]
        return values

    def _to_initial_state(self) -> None:
        """As constructed, the random sequence included."""
        random = Random(self._seed)
        self._training.reset()
        area = self._training
        self._load = Load(
            random,
            area[own.REG_LOAD] / 100,
            area[own.REG_LOAD_QUADRATIC] / 100,
            area[own.REG_DISTURBANCE] / 100,
        )
        self._value = dict(self._factory)
        self._output = [0] * 10
        self._output[1] = Scaling(100.0).raw(self._setpoint) & 0xFFFF
        self._held = 0
        self._pending.clear()
        self._heard = self._armed = False
        self._silent = 0
        self.machine = StateMachine()
        self.shaft = Shaft(self.data, self.data.inertia * (1 + self._inertia_ratio))
        self.flux = self.ramp = self._pulsing = self._blocked_for = self._away_for = 0.0
        self.energy = self.overload = 0.0
        self.buffer = [[0] * PLACES for _ in range(SITUATIONS)]
        self._entered = []
        self._alarms = []
        self._forward = True
        self._access_error = 0
        self.bus_voltage = sqrt(2) * area[own.REG_SUPPLY]
        self.motor_temperature = self.sink_temperature = float(area[own.REG_AMBIENT])
        if self._start:
            self._already_running(self._start == "reverse")

    def _already_running(self, reverse: bool) -> None:
        self._output[0] = RUN | (Control.INVERT if reverse else 0)
        self._held = self._output[1]
        self.machine = StateMachine(state=State.OPERATION, control=self._output[0])
        self.flux, self._pulsing = 1.0, BRAKE_TIME + self.dt
        self.ramp = self._reference
        supply = Supply(True, self.ramp / RPM, self.flux, self._value["p0640"])
        self.shaft.settle(self.ramp / RPM, supply, self._resistance(0.0))
        self._forward = not reverse
        ratio, ambient = self.shaft.current / self.rated_current, self._training[own.REG_AMBIENT]
        self.motor_temperature = ambient + MOTOR_RISE * ratio**2
        self.sink_temperature = ambient + SINK_RISE * ratio**2

    # ---- the registers

    def _word(self, number: int) -> int:
        if number in map.REGISTERS:
            register = map.REGISTERS[number]
            return register.encode(self._reading(number, register.parameter))
        if number < map.PROCESS_OUT_END:
            return self._output[number - map.CONTROL]
        if number == map.STATUS:
            return self.status
        return Scaling(self._value["p2000"]).encode(self.speed)[0] if number == map.ACTUAL else 0

    def _reading(self, number: int, parameter: str) -> float:
        if parameter in self._value:
            return self._value[parameter]
        if 40400 <= number < 40408:
            return self.buffer[0][number - 40400]
        it = self.shaft
        match number:
            case 40240:
                return float(not self._training[own.REG_INTERLOCK])
            case 40241:
                return float(not self._training[own.REG_EMERGENCY])
            case 40300:
                return POWER_UNIT
            case 40301:
                return FIRMWARE
            case 40320:
                return self.data.rated_power / 1000
            case 40340:
                return self.ramp if self.machine.pulses else 0.0
            case 40341:
                return self.speed
            case 40342:
                return it.frequency
            case 40343:
                return it.voltage
            case 40344:
                return self.bus_voltage
            case 40345:
                return it.current
            case 40346:
                return it.torque
            case 40347:
                return max(0.0, it.power) / 1000
            case 40348:
                return self.energy
            case 40349:
                return float(not self.local)
            case 40408 | 40409:
                return self._alarms[0 if number == 40408 else -1] if self._alarms else 0
            case map.ACCESS_ERROR:
                return self._access_error
            case _:
                return 0.0
