"""The lanes that join a conveyor as they really are: products that queue there, and a stop that lets them onto the line one by one.

| subject | taken here; no source gives it |
| --- | --- |
| lane | takes a product now and then, eight at most; it moves by itself while the line has supply |
| stop | the first one stands at it, the next one 0.8 s after the last of the one before has gone in |
| way in | a product that is let go is carried in by the belt that it comes onto, while that runs forward |
| eyes | one at the stop: a product is there, and how long it is, as the lane measured it; one behind it: a product goes in |
| backwards | what has not come in whole goes back into the lane, to its stop |
"""

from collections.abc import Sequence
from enum import IntEnum
from random import Random
from typing import NamedTuple, Protocol

MOST_MERGES = 4
MOST_WAITING = 8
"""Products that a lane holds."""
MOVE_UP = 0.8
"""From the place behind to the stop [s]."""
MERGE_FAULTS = 700
"""The machine fault "stop of lane n stuck" is this code and n."""


class Mode(IntEnum):
    """Who goes first where a lane joins the line."""

    LINE = 0
    LANE = 1
    IN_TURN = 2


class MergePlan(NamedTuple):
    """A merging gate as it is built."""

    at: float
    """Where the lane joins the line [mm]."""
    mode: int = Mode.LINE
    gap: float = 15.0
    """Left free before and behind a product that comes in [mm]."""
    limit: float = 60.0
    """A product that has waited longer is told [s]."""


class Coming(Protocol):
    """A product that comes in, as it really is."""

    head: float
    length: float
    away: float
    coming: int


def come_in(product: Coming, x: float) -> None:
    """After a movement: its tail is at the gate at `x` [mm] until the whole of it is on the line; backwards it goes into the lane."""
    whole, on_line = product.length + product.away, product.head - x
    if on_line >= whole:
        product.length, product.away, product.coming = whole, 0.0, 0
    else:
        product.length = max(0.0, on_line)
        product.away = whole - product.length


class Lanes:
    """The lanes of one line."""

    def __init__(
        self, plans: Sequence[MergePlan], random: Random, interval: float, shortest: float, longest: float
    ) -> None:
        """`interval`: mean time between two products of a lane [s], 0 = none comes by itself; `shortest`, `longest` [mm]."""
        self.interval, self.shortest, self.longest = interval, shortest, longest
        self.waiting: list[list[float]] = [[] for _ in plans]
        """Lengths of those in each lane, first the one at its stop [mm]."""
        self.arrived = [0] * len(plans)
        """Products that came into each lane."""
        self.started = [0] * len(plans)
        """Products that began to go in, less those that went back: an input of the PLC."""
        self.stuck = -1
        """Index of the one whose stop does not open; −1 = none."""
        self._random = random
        self._next = [self._pause() for _ in plans]
        self._up = [0.0] * len(plans)

    def step(self, dt: float, *, supplied: bool, busy: Sequence[bool]) -> None:
        """`dt` [s]; `busy`: something of the last one is still on its way in."""
        for n, queue in enumerate(self.waiting):
            if self.interval > 0:
                self._next[n] -= dt
                if self._next[n] <= 0 and len(queue) < MOST_WAITING:
                    self._next[n] = self._pause()
                    self.put(n)
            if supplied and queue and not busy[n]:
                self._up[n] = max(0.0, self._up[n] - dt)

    def put(self, n: int) -> bool:
        """Another product into a lane (index); False when it is full."""
        queue = self.waiting[n]
        if len(queue) >= MOST_WAITING:
            return False
        if not queue:
            self._up[n] = MOVE_UP
        queue.append(round(self._random.uniform(self.shortest, max(self.shortest, self.longest)), 1))
        self.arrived[n] += 1
        return True

    @property
    def present(self) -> list[bool]:
        """Something is in the lane: an input of the PLC."""
        return [bool(queue) for queue in self.waiting]

    def measured(self, n: int) -> float:
        """Length of what stands at the stop [mm], an input of the PLC; 0 = nobody is there."""
        queue = self.waiting[n]
        return queue[0] if queue and self._up[n] <= 0.0 else 0.0

    def let_go(self, n: int) -> float:
        """The stop opens: the length of the product that goes in now [mm], 0 = none does."""
        length = self.measured(n)
        if not length or n == self.stuck:
            return 0.0
        del self.waiting[n][0]
        self._up[n] = MOVE_UP
        self.started[n] += 1
        return length

    def take_back(self, n: int, length: float) -> None:
        """What has not come in whole is at the stop again."""
        self.waiting[n].insert(0, length)
        self._up[n] = 0.0
        self.started[n] -= 1

    def _pause(self) -> float:
        return self.interval * self._random.uniform(0.5, 1.5)
