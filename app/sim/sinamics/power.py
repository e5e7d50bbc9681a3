"""The power unit of a SINAMICS drive and what it drives: shaft with load, DC link, energy, and how warm all that gets."""

from math import sqrt
from random import Random

from app.sim.induction_motor import MotorData
from app.sim.load import Load
from app.sim.sinamics.shaft import RPM, Resistance, Shaft, Supply
from app.sim.sinamics.training import REG_AMBIENT, REG_DISTURBANCE, REG_LOAD, REG_LOAD_QUADRATIC, REG_SUPPLY
from app.sim.training import TrainingRegisters

CHOPPER = 750.0
"""Where the brake chopper holds the DC link [V]."""
BUS_TIME = 0.05
"""[s]"""
MOTOR_TIME, SINK_TIME = 480.0, 240.0
"""[s]"""
MOTOR_RISE, SINK_RISE = 80.0, 35.0
"""At rated current [K]."""
OVERLOAD_TIME, OVERLOAD_AT = 60.0, 1.5
"""Image full after so long [s] at that multiple of the rated current."""


class PowerUnit:
    """Physics; load, supply and ambient are the instructor's (`training`)."""

    def __init__(
        self, training: TrainingRegisters, data: MotorData, rated_current: float, *, inertia: float, seed: int
    ) -> None:
        """At rest and cold. `rated_current`: of the motor [A]; `inertia`: of motor and load [kg m²]."""
        self._training = training
        self.data = data
        self._rated_current = rated_current
        self._load = Load(
            Random(seed),
            training[REG_LOAD] / 100,
            training[REG_LOAD_QUADRATIC] / 100,
            training[REG_DISTURBANCE] / 100,
        )
        self.shaft = Shaft(data, inertia)
        self.bus_voltage = sqrt(2) * training[REG_SUPPLY]
        """[V DC]"""
        self.motor_temperature = self.sink_temperature = float(training[REG_AMBIENT])
        """[°C]"""
        self.overload = 0.0
        """Image of the I²t, trips at 1."""
        self.energy = 0.0
        """[kWh]"""
        self.forward = True
        """The way that it turns, or turned last."""

    @property
    def speed(self) -> float:
        """Of the shaft [rpm], negative in reverse."""
        return self.shaft.speed * RPM

    def step(self, supply: Supply, dt: float, *, excited: bool, blocked: bool) -> None:
        """Advance by `dt` [s]; `excited`: magnetising without pulses; `blocked`: the instructor holds the shaft."""
        self._load.constant = self._training[REG_LOAD] / 100
        self._load.quadratic = self._training[REG_LOAD_QUADRATIC] / 100
        self._load.disturbance = self._training[REG_DISTURBANCE] / 100
        self._load.step(dt)
        self.shaft.step(supply, self._resistance(20 * self.data.rated_torque if blocked else 0.0), dt)
        if excited and supply.flux:
            self.shaft.current = supply.flux * self.shaft.magnetising_current
        if abs(self.speed) > 1:
            self.forward = self.speed > 0
        self._move_bus(dt)
        self._warm_up(dt)

    def settle(self, speed: float, supply: Supply) -> None:
        """It turns at `speed` [rpm] since long: warm, and with the current that the load takes."""
        self.shaft.settle(speed / RPM, supply, self._resistance(0.0))
        ratio, ambient = self.shaft.current / self._rated_current, self._training[REG_AMBIENT]
        self.motor_temperature = ambient + MOTOR_RISE * ratio**2
        self.sink_temperature = ambient + SINK_RISE * ratio**2

    def _resistance(self, blocked: float) -> Resistance:
        rated, speed = self.data.rated_torque, self.data.rated_angular_speed
        friction = self.data.friction_power / speed
        return Resistance(
            self._load.torque * rated + friction + blocked,
            self._load.breakaway * rated + friction + blocked,
            self._load.quadratic * rated / (speed * speed),
        )

    def _move_bus(self, dt: float) -> None:
        power = max(0.0, self.shaft.power)
        self.energy += power * dt / 3.6e6
        supplied = self._training[REG_SUPPLY] * sqrt(2)
        sag = 0.01 * supplied * power / max(self.data.rated_power, 1.0)
        wanted = supplied - sag
        if self.shaft.power < 0:
            wanted = max(wanted, min(CHOPPER, wanted + 300 * -self.shaft.power / self.data.rated_power))
        self.bus_voltage += (wanted - self.bus_voltage) * min(1.0, dt / BUS_TIME)

    def _warm_up(self, dt: float) -> None:
        ratio = self.shaft.current / self._rated_current
        ambient = self._training[REG_AMBIENT]
        self.motor_temperature += (ambient + MOTOR_RISE * ratio**2 - self.motor_temperature) * dt / MOTOR_TIME
        self.sink_temperature += (ambient + SINK_RISE * ratio**2 - self.sink_temperature) * dt / SINK_TIME
        free = 1.1 * 1.1
        self.overload += (ratio**2 - free) / (OVERLOAD_AT**2 - free) * dt / OVERLOAD_TIME
        self.overload = min(max(self.overload, 0.0), 1.2)
