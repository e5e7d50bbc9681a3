"""Virtual time: a loop whose clock jumps to the next timer as soon as nothing is left to do: an hour costs what happens in it.

Everything happens on one thread: work for a pool is done at once, where it is asked for. So a run depends on nothing but its seed.
"""

import asyncio
import heapq
import itertools
import math
import selectors
from collections.abc import Callable
from typing import Any, ClassVar

from app.clock import ManualClock

GRID = 1e-6
"""What its clock counts in [s]: a timer is never early."""

Events = list[tuple[selectors.SelectorKey, int]]


class Waiting(selectors.DefaultSelector):
    """Where the loop waits: for a timer it does not wait at all but moves the clock."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__()
        self._clock = clock

    def select(self, timeout: float | None = None) -> Events:
        events: Events = super().select(0)
        if events or timeout == 0:
            return events
        if timeout is None:
            return self.idle()
        self._clock.advance(max(timeout, GRID))
        return events

    def idle(self) -> Events:
        """What comes when nothing is left to do and no timer is set."""
        raise RuntimeError("nothing is left to do and no timer is set: this would wait for ever")


class _InTurn(asyncio.TimerHandle):
    """Of timers for the same moment the one that was set first is the first one: a heap alone has no order among equals."""

    turn = 0
    _when: float
    _scheduled: bool

    def __lt__(self, other: asyncio.TimerHandle) -> bool:
        if not isinstance(other, _InTurn):
            return super().__lt__(other)
        return (self._when, self.turn) < (other._when, other.turn)


class VirtualLoop(asyncio.SelectorEventLoop):
    """A loop in virtual time; `clock` is what the house that runs in it gets."""

    waiting: ClassVar[type[Waiting]] = Waiting

    def __init__(self, clock: ManualClock | None = None) -> None:
        self._turns = itertools.count()
        self.clock = clock or ManualClock()
        super().__init__(self.waiting(self.clock))
        self._clock_resolution = GRID / 2

    def time(self) -> float:
        return self.clock.monotonic()

    def call_at(self, when: float, callback: Any, *args: Any, context: Any = None) -> asyncio.TimerHandle:  # type: ignore[override]
        """On the grid of the clock, never early: who is called finds that it is time."""
        if math.isfinite(when):
            micros = math.ceil(when * 1e6)
            when = micros / 1e6 if micros / 1e6 >= when else (micros + 1) / 1e6
        self._check_closed()  # type: ignore[attr-defined]
        timer = _InTurn(when, callback, args, self, context)
        timer.turn = next(self._turns)
        heapq.heappush(self._scheduled, timer)  # type: ignore[attr-defined]
        timer._scheduled = True
        return timer

    def run_in_executor(self, executor: Any, func: Callable[..., Any], *args: Any) -> Any:  # type: ignore[override]
        """At once, on this thread."""
        future = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:
            future.set_exception(error)
        return future
