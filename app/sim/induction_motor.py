"""Squirrel-cage induction motor on a variable-frequency supply, quasi-static.

Per-phase T-circuit: Rs + jωLs, then Lm parallel to R_Fe, then Rr/s + jωLr. Electrical transients (milliseconds) are left out, speed is
integrated implicitly: with f and U fixed over a step the circuit is a Thevenin source for the rotor branch, so the torque is a
rational function of the slip frequency and its slope is exact; two to four Newton steps, held in a bracket, solve one time step.

Values of the two sets: reference/eura-e800.md section 7, fitted there to nameplates; resistances do not follow temperature here.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import copysign, pi, sqrt
from typing import Literal, NamedTuple

Connection = Literal["delta", "star"]

SQRT3 = sqrt(3.0)
DELTA_VOLTAGE = 230.0
"""Line voltage at which the sets below have their rated flux in delta [V]."""


@dataclass(frozen=True, slots=True)
class MotorData:
    """A motor as its circuit, its nameplate and its mechanics. Per-phase values; nameplate at 400 V star, 50 Hz."""

    name: str
    rs: float
    """Stator resistance [Ω]."""
    rr: float
    """Rotor resistance, referred [Ω]."""
    ls: float
    """Stator leakage inductance [H]."""
    lr: float
    """Rotor leakage inductance, referred [H]."""
    lm: float
    """Magnetising inductance [H]."""
    r_fe: float
    """Iron-loss resistance, parallel to `lm` [Ω]."""
    pole_pairs: int
    inertia: float
    """Of the rotor [kg m²]."""
    friction_power: float
    """Friction and windage at rated speed [W]."""
    rated_power: float
    """Shaft [W]."""
    rated_speed: float
    """[rpm]"""
    rated_current: float
    """Line current in star at 400 V [A]."""
    rated_torque: float
    """Shaft [Nm]."""
    efficiency: float
    cos_phi: float
    rated_frequency: float = 50.0
    """[Hz]"""

    @property
    def rated_current_delta(self) -> float:
        """Rated line current in delta at 230 V [A]."""
        return self.rated_current * SQRT3

    @property
    def rated_angular_speed(self) -> float:
        """[rad/s]"""
        return self.rated_speed * pi / 30

    @property
    def rated_slip_frequency(self) -> float:
        """[Hz]"""
        return self.rated_frequency - self.rated_speed * self.pole_pairs / 60

    def wound(self, pole_pairs: int, rated_frequency: float) -> "MotorData":
        """The same motor with other pole pairs, for another rated frequency [Hz] at the same voltage and current.

        Reactances, slip, losses and power at the rated point stay; torque goes as one over speed, inertia as one over its square.
        """
        f, n = (
            rated_frequency / self.rated_frequency,
            rated_frequency / self.rated_frequency * self.pole_pairs / pole_pairs,
        )
        return replace(
            self,
            ls=self.ls / f,
            lr=self.lr / f,
            lm=self.lm / f,
            pole_pairs=pole_pairs,
            inertia=self.inertia / (n * n),
            rated_speed=self.rated_speed * n,
            rated_torque=self.rated_torque / n,
            rated_frequency=rated_frequency,
        )

    def sized(self, rated_current: float, rated_voltage: float = DELTA_VOLTAGE) -> "MotorData":
        """The same motor, bigger or smaller, drawing `rated_current` [A] in delta at `rated_voltage` [V] with rated load.

        Impedances go as voltage over current; torque, power, losses and inertia as their product; slip, cos φ and efficiency stay.
        """
        k, v = rated_current / self.rated_current_delta, rated_voltage / DELTA_VOLTAGE
        z, p = v / k, v * k
        return replace(
            self,
            rs=self.rs * z,
            rr=self.rr * z,
            ls=self.ls * z,
            lr=self.lr * z,
            lm=self.lm * z,
            r_fe=self.r_fe * z,
            inertia=self.inertia * p,
            friction_power=self.friction_power * p,
            rated_power=self.rated_power * p,
            rated_current=self.rated_current * k,
            rated_torque=self.rated_torque * p,
        )


def _from_reactances(
    name: str, rs: float, rr: float, xs: float, xr: float, xm: float, r_fe: float, inertia: float, **plate: float
) -> MotorData:
    w = 100 * pi
    return MotorData(
        name=name,
        rs=rs,
        rr=rr,
        ls=xs / w,
        lr=xr / w,
        lm=xm / w,
        r_fe=r_fe,
        pole_pairs=2,
        inertia=inertia,
        friction_power=15.0,
        rated_power=750.0,
        **plate,
    )


MOTOR_SETS: Mapping[str, MotorData] = {
    "A": _from_reactances(
        "legacy (IE1-type) 0.75 kW",
        13.1,
        10.1,
        9.7,
        8.4,
        164.7,
        2500.0,
        0.0019,
        rated_speed=1395.0,
        rated_current=1.94,
        rated_torque=5.13,
        efficiency=0.738,
        cos_phi=0.755,
    ),
    "B": _from_reactances(
        "modern (IE3) 0.75 kW",
        9.0,
        6.4,
        12.7,
        3.2,
        198.9,
        3800.0,
        0.0030,
        rated_speed=1439.0,
        rated_current=1.71,
        rated_torque=4.98,
        efficiency=0.824,
        cos_phi=0.766,
    ),
}


class OperatingPoint(NamedTuple):
    """One instant of the motor. Signed by the direction of the field: all positive when motoring with it."""

    slip: float
    torque: float
    """Air gap [Nm]."""
    current: float
    """Line, rms [A]."""
    phase_current: float
    """Winding, rms [A]."""
    cos_phi: float
    power_in: float
    """Electrical, negative when it comes back [W]."""
    power_shaft: float
    """To load and inertia, after friction and windage [W]."""
    stator_loss: float
    iron_loss: float
    rotor_loss: float
    friction_loss: float
    """[W]"""

    @property
    def losses(self) -> float:
        """All of them [W]."""
        return self.stator_loss + self.iron_loss + self.rotor_loss + self.friction_loss


def operating_point(
    data: MotorData, line_voltage: float, frequency: float, slip: float, connection: Connection = "delta"
) -> OperatingPoint:
    """Solve the circuit at `line_voltage` [V rms], `frequency` [Hz, above 0] and `slip`."""
    w = 2 * pi * frequency
    ws = slip * w
    delta = connection == "delta"
    v = line_voltage if delta else line_voltage / SQRT3
    d = data.rr * data.rr + ws * ws * data.lr * data.lr
    k = slip / d
    y = complex(1 / data.r_fe + k * data.rr, -1 / (w * data.lm) - k * ws * data.lr)
    e = v / (1 + complex(data.rs, w * data.ls) * y)
    i = y * e
    i2 = i.real * i.real + i.imag * i.imag
    e2 = e.real * e.real + e.imag * e.imag
    phase_current = sqrt(i2)
    ir2 = e2 * slip * slip / d
    torque = 3 * data.pole_pairs * e2 * slip * data.rr / (d * w)
    speed = (w - ws) / data.pole_pairs
    friction = _friction_loss(data, speed)
    return OperatingPoint(
        slip=slip,
        torque=torque,
        current=phase_current * SQRT3 if delta else phase_current,
        phase_current=phase_current,
        cos_phi=i.real / phase_current if phase_current else 0.0,
        power_in=3 * v * i.real,
        power_shaft=torque * speed - friction,
        stator_loss=3 * data.rs * i2,
        iron_loss=3 * e2 / data.r_fe,
        rotor_loss=3 * data.rr * ir2,
        friction_loss=friction,
    )


def rated_point(data: MotorData, line_voltage: float, connection: Connection = "delta") -> OperatingPoint:
    """The operating point at rated speed and 50 Hz."""
    return operating_point(data, line_voltage, 50.0, data.rated_slip_frequency / 50.0, connection)


def _friction(data: MotorData) -> tuple[float, float]:
    """Bearing torque [Nm] and windage coefficient [Nm s²]; each takes half of `friction_power` at rated speed."""
    w = data.rated_angular_speed
    half = data.friction_power / w / 2
    return half, half / (w * w)


def _friction_loss(data: MotorData, speed: float) -> float:
    constant, quadratic = _friction(data)
    speed = abs(speed)
    return (constant + quadratic * speed * speed) * speed


class InductionMotor:
    """A motor with its rotating mass. State: `speed` [rad/s, mechanical, positive = forward]."""

    def __init__(self, data: MotorData, *, load_inertia: float = 0.0, connection: Connection = "delta") -> None:
        """`load_inertia` [kg m²] turns with the shaft."""
        self.data = data
        self.connection: Connection = connection
        self.inertia = data.inertia + load_inertia
        self.speed = 0.0
        self._bearing, self._windage = _friction(data)
        self.point = self._off()

    def pull_out_torque(self, line_voltage: float, frequency: float) -> float:
        """Largest motoring air-gap torque [Nm] at that supply."""
        a, b, c, d = self._torque_curve(line_voltage, frequency)
        return a / (c + 2 * sqrt(b * d))

    def step(
        self,
        line_voltage: float,
        frequency: float,
        load: float,
        quadratic: float,
        dt: float,
        *,
        breakaway: float | None = None,
    ) -> OperatingPoint:
        """Advance by `dt` [s] at `line_voltage` [V rms; 0 = output off] and `frequency` [Hz, negative = reverse, never 0].

        `load` [Nm, 0 or above] and `quadratic` [Nm s²] oppose the motion, whichever way it goes; from standstill the motor has
        to overcome `breakaway` [Nm] (default `load`). Explicit Euler is unstable at 10 ms, this is not at any step.
        """
        sense = -1.0 if frequency < 0 else 1.0
        on = line_voltage > 0
        w = 2 * pi * abs(frequency)
        curve = self._torque_curve(line_voltage, abs(frequency)) if on else (0.0, 1.0, 0.0, 0.0)
        x = self._solve(
            sense * self.speed,
            curve,
            w,
            load + self._bearing,
            quadratic + self._windage,
            (load if breakaway is None else breakaway) + self._bearing,
            dt,
        )
        self.speed = sense * x
        if on:
            slip = (w - self.data.pole_pairs * x) / w
            self.point = operating_point(self.data, line_voltage, abs(frequency), slip, self.connection)
        else:
            self.point = self._off()
        return self.point

    def settle(self, line_voltage: float, frequency: float, load: float, quadratic: float) -> OperatingPoint:
        """Jump to the steady state near synchronous speed, as if it had been running for long."""
        self.speed = 2 * pi * frequency / self.data.pole_pairs
        for _ in range(400):
            before = self.speed
            self.step(line_voltage, frequency, load, quadratic, 0.05)
            if abs(self.speed - before) < 1e-9:
                break
        return self.point

    def _off(self) -> OperatingPoint:
        friction = _friction_loss(self.data, self.speed)
        return OperatingPoint(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -friction, 0.0, 0.0, 0.0, friction)

    def _torque_curve(self, line_voltage: float, frequency: float) -> tuple[float, float, float, float]:
        """T(ωs) = a·ωs / (b + c·ωs + d·ωs²) [Nm], ωs electrical slip [rad/s]."""
        data = self.data
        w = 2 * pi * frequency
        v = line_voltage if self.connection == "delta" else line_voltage / SQRT3
        zs = complex(data.rs, w * data.ls)
        ratio = 1 / (1 + zs * complex(1 / data.r_fe, -1 / (w * data.lm)))
        z = zs * ratio
        x = z.imag + w * data.lr
        v2 = v * v * (ratio.real * ratio.real + ratio.imag * ratio.imag)
        return (
            3 * data.pole_pairs * v2 * data.rr,
            data.rr * data.rr * w * w,
            2 * z.real * data.rr * w,
            z.real * z.real + x * x,
        )

    def _solve(
        self,
        start: float,
        curve: tuple[float, float, float, float],
        w: float,
        load: float,
        quadratic: float,
        breakaway: float,
        dt: float,
    ) -> float:
        """Speed after `dt` in the frame of the field: root of J(x − start) − dt(T(x) ∓ resistance) [rad/s].

        The motor stops where the root lies beyond standstill, and then has to break away.
        """
        a, b, c, d = curve
        p = self.data.pole_pairs
        inertia = self.inertia
        if start == 0.0:
            if a * w / (b + c * w + d * w * w) <= breakaway:
                return 0.0
            side = 1.0
        else:
            side = copysign(1.0, start)
        if inertia * -start * side - dt * (side * a * w / (b + c * w + d * w * w) - load) >= 0:
            return 0.0

        x = start
        synchronous = w / p if a else 0.0
        if side > 0:
            low, high = 0.0, max(start, synchronous)
        else:
            low, high = start, 0.0
        for _ in range(60):
            ws = w - p * x
            below = b + c * ws + d * ws * ws
            torque = a * ws / below
            g = inertia * (x - start) - dt * (torque - side * (load + quadratic * x * x))
            slope = inertia + dt * (p * a * (b - d * ws * ws) / (below * below) + 2 * side * quadratic * x)
            if g > 0:
                high = x
            else:
                low = x
            guess = x - g / slope if slope > 0 else 0.5 * (low + high)
            if not low <= guess <= high:
                guess = 0.5 * (low + high)
            if abs(guess - x) < 1e-9:
                return guess
            x = guess
        return x
