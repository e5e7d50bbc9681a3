"""One axis: ramp and lag of its drive, brake, motion, encoder."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import exp, floor
from typing import Self

from app.blocks.ramp import Ramp, approach
from app.sim.crane.figures import Figure


@dataclass(frozen=True, slots=True)
class AxisData:
    """What an axis is made of."""

    max_speed: float
    """[mm/s]"""
    acceleration: float
    """Of the drive's ramp [mm/s²]."""
    deceleration: float
    """[mm/s²]"""
    resolution: float
    """Of the encoder [mm per pulse]; 0 = ideal."""
    lag: float = 0.0
    """First-order, from the ramp to the speed [s]."""
    dead_time: float = 0.0
    """From the set-point to the ramp [s]."""
    brake_release: float = 0.0
    """From the command to the open brake [s]."""
    brake_close: float = 0.0
    """From the command to the closed brake [s]."""
    brake_deceleration: float = 1000.0
    """Of a closed brake [mm/s²]."""
    quick_stop: float = 2.0
    """Deceleration of a quick stop as a multiple of the ramp's (assumed)."""
    coast: float = 20.0
    """Deceleration without torque and brake [mm/s²], friction (assumed)."""
    fall: float = 0.0
    """Acceleration downwards without torque and brake [mm/s²]: the load on a hoist; 0 = none."""
    safety_speed: float = 0.0
    """Above it the safety brake falls in, whatever the control does [mm/s]; 0 = none."""

    @classmethod
    def of(cls, figures: Mapping[str, Figure]) -> Self:
        """From the crane's figures."""
        value = {name: figure.value for name, figure in figures.items()}
        speed = value["max_speed"]
        return cls(
            speed,
            speed / value["speed_up_time"],
            speed / value["slow_down_time"],
            value["resolution"],
            lag=value["drive_lag"],
            brake_release=value["brake_release"],
            brake_close=value["brake_close"],
            brake_deceleration=value["brake_deceleration"],
            fall=value.get("fall", 0.0),
            safety_speed=value.get("over_speed", 0.0) * speed,
        )

    def with_(self, **changes: float) -> Self:
        """The same with other values."""
        return replace(self, **changes)


@dataclass(slots=True)
class Brake:
    """A brake beside the first one, for a hoist that has two."""

    position: float = 0.0
    """0 closed, 1 open."""
    stuck: bool = False
    """Fault: it stays as it is."""
    holds: bool = True

    def step(self, open_brake: bool, data: AxisData, dt: float) -> None:
        """`dt` [s] with this command."""
        if not self.stuck:
            self.position, self.holds = _moved(self.position, self.holds, open_brake, data, dt)

    @property
    def is_open(self) -> bool:
        """Feedback: fully open."""
        return self.position >= 1.0


@dataclass(slots=True)
class Axis:
    """Moves by what the drive is told while the brake is open; a closed brake holds it, or brings it to a stop.

    The brake holds until it is fully open, and again from when it is fully closed. The safety brake is the crane's own: it falls in at
    over-speed, or when its circuit is cut (`safety_brake` set), and stays until somebody lifts it.
    """

    data: AxisData
    position: float = 0.0
    """Of the mechanics [mm]."""
    speed: float = 0.0
    """[mm/s], signed."""
    brake: float = 0.0
    """0 closed, 1 open."""
    stuck: bool = False
    """Fault: the brake stays as it is."""
    strain: float = 0.0
    """How long the drive has worked against a closed brake [s]: has to stay 0."""
    safety_brake: bool = False
    """Has fallen in."""
    second: Brake | None = None
    """The other brake of a hoist; one that holds is enough."""
    holds: bool = field(init=False)
    """A brake does."""
    _ramp: Ramp = field(init=False)
    _waiting: deque[float] = field(init=False, default_factory=deque)

    def __post_init__(self) -> None:
        self._ramp = Ramp(self.data.acceleration, self.data.deceleration)
        self.holds = self.brake < 1.0

    def step(
        self, setpoint: float, open_brake: bool, dt: float, *, torque: bool = True, quick_stop: bool = False
    ) -> None:
        """Move for `dt` [s] at `setpoint` [mm/s]; without `torque` the axis coasts."""
        data = self.data
        self._waiting.append(setpoint)
        setpoint = self._waiting.popleft() if len(self._waiting) > round(data.dead_time / dt) else 0.0
        self._move_brake(open_brake, dt)
        before = self.speed
        self.safety_brake |= 0 < data.safety_speed < abs(before)
        if not torque:
            self._ramp.speed = 0.0
            self.speed = before - data.fall * dt if data.fall else approach(before, 0.0, 0.0, data.coast * dt)
        else:
            if self._ramp.speed == 0.0 and not setpoint and not before:
                pass
            elif quick_stop:
                self._ramp.speed = approach(self._ramp.speed, 0.0, 0.0, data.quick_stop * data.deceleration * dt)
            else:
                self._ramp.step(min(max(setpoint, -data.max_speed), data.max_speed), dt)
            keep = exp(-dt / data.lag) if data.lag else 0.0
            self.speed = self._ramp.speed + (before - self._ramp.speed) * keep
            if abs(self.speed) < 1e-4 and not self._ramp.speed:
                self.speed = 0.0
        if self.held:
            if torque and abs(self._ramp.speed) > 0.5 and not before:
                self.strain += dt
            self.speed = approach(before, 0.0, 0.0, data.brake_deceleration * dt)
            if quick_stop:  # the ramp of a quick stop does not pull on what a brake has stopped
                self._ramp.speed = self.speed
        self.position += (before + self.speed) / 2 * dt

    @property
    def is_open(self) -> bool:
        """Feedback of the brake: fully open."""
        return self.brake >= 1.0

    @property
    def measured(self) -> float:
        """What the encoder shows [mm]."""
        resolution = self.data.resolution
        return floor(self.position / resolution) * resolution if resolution else self.position

    @property
    def held(self) -> bool:
        """Any brake holds it."""
        return self.holds or self.safety_brake or (self.second is not None and self.second.holds)

    def take(self, data: AxisData) -> None:
        """Go on with other ramps, speeds or times."""
        self.data = data
        self._ramp.acceleration, self._ramp.deceleration = data.acceleration, data.deceleration

    def _move_brake(self, open_brake: bool, dt: float) -> None:
        if self.second is not None:
            self.second.step(open_brake, self.data, dt)
        if not self.stuck:
            self.brake, self.holds = _moved(self.brake, self.holds, open_brake, self.data, dt)


def _moved(brake: float, holds: bool, open_brake: bool, data: AxisData, dt: float) -> tuple[float, bool]:
    """(position, whether it holds) of a brake after `dt` [s]."""
    time = data.brake_release if open_brake else data.brake_close
    change = dt / time if time else 1.0
    brake = min(1.0, brake + change + 1e-9) if open_brake else max(0.0, brake - change - 1e-9)
    return brake, brake <= 0.0 or (holds and brake < 1.0)
