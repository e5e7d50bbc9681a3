"""A loop whose clock jumps to the next timer as soon as nothing is left to do: an hour of a simulated plant costs what happens in it."""

import asyncio
import math
import selectors
from collections.abc import Callable
from typing import Any

from app.clock import ManualClock

GRID = 1e-6
"""What its clock counts in [s]: a timer is never early."""


class _Waiting(selectors.DefaultSelector):
    """Where the loop waits: for a timer it does not wait at all but moves the clock."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__()
        self._clock = clock

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        events: list[tuple[selectors.SelectorKey, int]] = super().select(0)
        if events or timeout == 0:
            return events
        if timeout is None:
            raise RuntimeError("nothing is left to do and no timer is set: this would wait for ever")
        self._clock.advance(max(timeout, GRID))
        return events


class VirtualLoop(asyncio.SelectorEventLoop):
    """A loop in virtual time; everything happens on its thread, work for a pool where it is asked for."""

    def __init__(self, clock: ManualClock) -> None:
        self._manual = clock
        super().__init__(_Waiting(clock))
        self._clock_resolution = GRID / 2

    def time(self) -> float:
        return self._manual.monotonic()

    def call_at(self, when: float, callback: Any, *args: Any, context: Any = None) -> asyncio.TimerHandle:  # type: ignore[override]
        """On the grid of the clock, never early: who is called finds that it is time."""
        if math.isfinite(when):
            micros = math.ceil(when * 1e6)
            when = micros / 1e6 if micros / 1e6 >= when else (micros + 1) / 1e6
        return super().call_at(when, callback, *args, context=context)

    def run_in_executor(self, executor: Any, func: Callable[..., Any], *args: Any) -> Any:  # type: ignore[override]
        future = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:
            future.set_exception(error)
        return future
