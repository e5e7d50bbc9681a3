"""The ladle and what hangs on the hook: stands, the carrier's lock, rope, scale, swing."""

from dataclasses import dataclass, field
from math import nan

from app.sim.crane import training
from app.sim.crane.configuration import STAND_NUMBERS, Places
from app.sim.crane.figures import HOIST
from app.sim.crane.pendulum import Pendulum
from app.sim.crane.rope import Rope

NEAR_BRIDGE, NEAR_TROLLEY = 50.0, 30.0
"""The carrier finds its lock when bridge and trolley are so near [mm]."""
CATCH, RELEASE = 20.0, 60.0
"""It locks when the hook is no farther below, and is free of it when it is so far below [mm]."""
TAKES_UP = 500.0
"""Way over which the ladle comes off its stand [mm]."""
FULL = 354.0
"""Load that stretches the rope as its figure says [t]."""
CALM = 0.2
"""Swing that is not worth a step [mm]."""


@dataclass(slots=True)
class Load:
    """What the crane carries; the ladle stands on one of the stands or hangs on the crane."""

    places: Places
    weight: float
    """Of the ladle [t]."""
    stand: int
    """Where it stands, 0 = on the crane."""
    locked: bool = False
    """The carrier is in its lock."""
    at: int = 0
    """Stand that it was locked at, or was set down on, last."""
    share: float = 0.0
    """Part of the ladle that hangs on the rope."""
    rope: Rope = field(init=False)
    swings: dict[str, Pendulum] = field(init=False)
    swing: dict[str, float] = field(init=False)
    """Of the load ahead of trolley and bridge [mm]."""

    def __post_init__(self) -> None:
        top = HOIST["max_position"].value + HOIST["rope_length_at_top"].value
        self.rope = Rope(0.0, HOIST["rope_strain"].value, top)
        self.swings = {axis: Pendulum(damping=0.02) for axis in ("trolley", "bridge")}
        self.swing = {"trolley": 0.0, "bridge": 0.0}

    @property
    def hanging(self) -> float:
        """[t]"""
        return self.share * self.weight

    def scale(self, fault: int, limit: float) -> float:
        """What the scale says [t]; NaN while it is bad."""
        if fault == training.SCALE:
            return nan
        return max(self.hanging, limit + 10) if fault == training.OVERLOAD else self.hanging

    def sway(self, hoist: float) -> float:
        """How far the load swings to one side with the hoist at `hoist` [mm], in the direction in which it swings farther [mm]."""
        length = self.rope.top - hoist
        return max(pendulum.amplitude(length) for pendulum in self.swings.values())

    def step(self, position: dict[str, float], speed: dict[str, float], change: dict[str, float], dt: float) -> None:
        """`dt` [s]; positions [mm], speeds [mm/s] and how much the speeds changed in it."""
        self._hook(position)
        self.rope.load = self.hanging / FULL
        if self.rope.load:
            self.rope.step(position["hoist"], change["hoist"] / dt, dt)
        else:
            self.rope.settle(position["hoist"])
        length = self.rope.top - position["hoist"]
        for axis, pendulum in self.swings.items():
            if change[axis] or abs(self.swing[axis]) > CALM or abs(pendulum.rate) * length > CALM:
                self.swing[axis] = pendulum.step(change[axis] / dt, length, -speed["hoist"], dt)
            else:
                pendulum.angle = pendulum.rate = self.swing[axis] = 0.0

    def _hook(self, position: dict[str, float]) -> None:
        """Lock, lift and set down, by where the hook is."""
        if not self.locked:
            if self.stand and self._in_lock(self.stand, position, CATCH):
                self.locked, self.at = True, self.stand
            return
        height = self._over(position)
        if height is None:  # away from any stand
            self.share, self.stand = 1.0, 0
            return
        self.share = min(1.0, max(0.0, height / TAKES_UP))
        if self.share >= 1.0:
            self.stand = 0
        elif not self.share:
            self.stand = self.at
            if height < -RELEASE:
                self.locked = False

    def _over(self, position: dict[str, float]) -> float | None:
        """Height of the hook over the lock of a stand below it [mm]; None = none is there."""
        for n in STAND_NUMBERS:
            lock = self.places.stand(n)
            if abs(position["bridge"] - lock["bridge"]) > 2 * NEAR_BRIDGE:
                continue
            height = position["hoist"] - lock["hoist"]
            if abs(position["trolley"] - lock["trolley"]) <= 8 * NEAR_TROLLEY and height < TAKES_UP:
                self.at = n
                return height
        return None

    def _in_lock(self, stand: int, position: dict[str, float], below: float) -> bool:
        lock = self.places.stand(stand)
        return (
            abs(position["bridge"] - lock["bridge"]) <= NEAR_BRIDGE
            and abs(position["trolley"] - lock["trolley"]) <= NEAR_TROLLEY
            and -below <= position["hoist"] - lock["hoist"] <= RELEASE
        )
