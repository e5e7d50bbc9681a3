"""The power section of an E800 and what it drives: mains, DC bus, inverter, motor, load, and how warm all that gets."""

from collections.abc import Mapping
from math import pi
from random import Random

from app.sim.eura_e800.dc_bus import DRIVE_RATED_CURRENT, DcBus
from app.sim.eura_e800.faults import LU, OC, OE, OH, OL1, OL2
from app.sim.eura_e800.heat import Heat, Loading
from app.sim.eura_e800.inverter import LOWEST_OUTPUT, ROOT2, Inverter
from app.sim.eura_e800.protection import OH_LEVEL, Measured, Protection
from app.sim.eura_e800.ramp import Ramp
from app.sim.eura_e800.training import REG_AMBIENT, REG_DISTURBANCE, REG_LOAD, REG_LOAD_QUADRATIC, REG_SUPPLY
from app.sim.induction_motor import DELTA_VOLTAGE, InductionMotor, MotorData, rated_point
from app.sim.load import Load
from app.sim.training import TrainingRegisters


class PowerSection:
    """Physics under a `ramp` and a `protection`, which it asks only. `values` in its calls: the parameters by code.

    Load, mains and ambient are the instructor's (`training`). What an injected fault does to the physics is here: a locked rotor (OC),
    too much load (OL1, OL2), a wrong supply (OE, LU), a lost fan (OH).
    """

    def __init__(
        self,
        training: TrainingRegisters,
        data: MotorData,
        drive_current: float,
        rated_voltage: float,
        *,
        inertia: float,
        seed: int,
        ramp: Ramp,
        protection: Protection,
    ) -> None:
        """At rest and cold. `drive_current`: rated output [A]; `rated_voltage`: of the motor [V]; `inertia`: of the load [kg m²]."""
        random = Random(seed)
        self._training = training
        self.drive_current = drive_current
        self._rated_losses = rated_point(data, rated_voltage).losses
        self._ramp, self._protection = ramp, protection
        self._load = Load(random)
        self.take_world()
        self.motor = InductionMotor(data, load_inertia=inertia)
        self.inverter = Inverter(self.motor)
        self._level = rated_voltage / DELTA_VOLTAGE
        self.bus = DcBus(random, drive_current / DRIVE_RATED_CURRENT, self._level, ROOT2 * training[REG_SUPPLY])
        self.heat = Heat(0.0, 0.0)

    def take_world(self) -> None:
        """The load is as the instructor wrote it."""
        self._load.constant = self._training[REG_LOAD] / 100
        self._load.quadratic = self._training[REG_LOAD_QUADRATIC] / 100
        self._load.disturbance = self._training[REG_DISTURBANCE] / 100

    @property
    def shaft_speed(self) -> float:
        """Of the shaft [rpm], negative in reverse, also while it coasts."""
        return self.motor.speed * 30 / pi

    def measured(self) -> Measured:
        """What the protection looks at."""
        heat = self.heat
        current = self.motor.point.current / self.drive_current
        return Measured(
            current,
            self.bus.voltage / self._level,
            heat.heat_sink,
            heat.drive_overload,
            heat.motor_overload,
            self._ramp.on,
        )

    def power_up(self) -> None:
        """The output is off and nothing overloaded; what is warm stays so, and the shaft keeps turning."""
        self.inverter.off()
        self.inverter.reset()
        self.heat.forget_overloads()

    def overload(self, code: int) -> None:
        """An instructor causes OL1 or OL2: its image is nearly full, so that the load soon fills it."""
        if code == OL1 and self._ramp.on:
            self.heat.drive_overload = max(self.heat.drive_overload, 0.97)
        elif code == OL2 and self._ramp.on:
            self.heat.motor_overload = max(self.heat.motor_overload, 0.97)

    def step(self, values: Mapping[str, float], dt: float) -> None:
        """Advance by `dt` [s]."""
        self._move_motor(values, dt)
        power = self.motor.point.power_in
        drawn = power + 15.0 + (10.0 + 0.02 * abs(power) if self._ramp.on else 0.0)
        disturbed = {OE: 1.3, LU: 0.45}.get(self._protection.injected, 1.0)
        self.bus.step(self._training[REG_SUPPLY], disturbed, drawn, dt)
        self.heat.step(self._loading(values), dt)

    def settle(self, values: Mapping[str, float]) -> None:
        """As if it had been like this for hours: at rest, or turning as the ramp does."""
        if self._ramp.on:
            data = self.motor.data
            magnitude = max(LOWEST_OUTPUT, abs(self._ramp.frequency))
            self.bus.voltage -= 5.0
            self.inverter.limit(magnitude, self.bus.voltage, values)
            self.motor.settle(
                self.inverter.voltage,
                self._ramp.direction * magnitude,
                self._load.torque * data.rated_torque,
                self._quadratic_torque(),
            )
        self.heat = Heat.settled(self._loading(values))

    def _move_motor(self, values: Mapping[str, float], dt: float) -> None:
        motor, rated = self.motor, self.motor.data.rated_torque
        self._load.step(dt)
        injected = self._protection.injected if not self._protection.fault else 0
        constant = self._load.torque * rated
        breakaway = self._load.breakaway * rated
        quadratic = self._quadratic_torque()
        if not self._ramp.on:
            motor.step(0.0, 1.0, constant, quadratic, dt, breakaway=breakaway)
            return
        supplied = self.inverter.supply(abs(self._ramp.frequency), self.bus.voltage, values, dt)
        voltage = self.inverter.voltage
        if injected == OC:
            constant = breakaway = 8 * rated
        elif injected in (OL1, OL2):
            limit = 0.85 * motor.pull_out_torque(voltage, supplied) if voltage > 0 else 0.0
            constant, quadratic = max(constant, min(1.6 * rated, limit)), 0.0
        motor.step(
            voltage, supplied if self._ramp.sense > 0 else -supplied, constant, quadratic, dt, breakaway=breakaway
        )

    def _quadratic_torque(self) -> float:
        """[Nm s²]"""
        data = self.motor.data
        return self._load.quadratic * data.rated_torque / (data.rated_angular_speed * data.rated_angular_speed)

    def _loading(self, values: Mapping[str, float]) -> Loading:
        point = self.motor.point
        fan_lost = self._protection.injected == OH and not (self._protection.fault and self.heat.heat_sink >= OH_LEVEL)
        return Loading(
            ambient=self._training[REG_AMBIENT],
            on=self._ramp.on,
            drive=point.current / self.drive_current,
            drive_limit=values["F706"] / 100,
            motor=point.current / (values["F803"] * values["F707"] / 100),
            losses=point.losses / self._rated_losses if self._ramp.on else 0.0,
            fan_lost=fan_lost,
        )
