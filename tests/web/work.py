"""How much one turn of the loop does, counted in calls of functions: the same on every machine, however busy it is."""

import asyncio
import gc
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import pytest

from tests import virtual


@dataclass
class Work:
    """Of the turns of the loop while `counted` runs. What a thread of its own would do is left out."""

    turn: int = 0
    most: int = 0
    """Calls in the turn that had most of them since it was last set to 0."""

    def _count(self, frame: Any, event: str, argument: Any) -> None:
        if event in ("call", "c_call"):
            self.turn += 1

    @contextmanager
    def elsewhere(self) -> Iterator[None]:
        """What is done inside costs the loop nothing."""
        before = sys.getprofile()
        sys.setprofile(None)
        try:
            yield
        finally:
            sys.setprofile(before)


@contextmanager
def counted() -> Iterator[Work]:
    """Count from now on."""
    work, run = Work(), asyncio.Handle._run  # type: ignore[attr-defined]

    def turn(handle: Any) -> Any:
        work.turn = 0
        sys.setprofile(work._count)
        try:
            return run(handle)
        finally:
            sys.setprofile(None)
            work.most = max(work.most, work.turn)

    def aside(call: Callable[..., Any]) -> Callable[..., Any]:
        def there(*given: Any, **named: Any) -> Any:
            with work.elsewhere():
                return call(*given, **named)

        return there

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(asyncio.Handle, "_run", turn)
        patch.setattr(virtual.VirtualLoop, "run_in_executor", aside(virtual.VirtualLoop.run_in_executor))
        patch.setattr(virtual.Inline, "submit", aside(virtual.Inline.submit))
        yield work


TURNS = 1_000_000
"""Of the bare loop that everything is measured by."""


@dataclass
class Spent:
    """Processor time of the turns of the loop while `timed` runs; what a thread of its own would do is left out."""

    longest: float = 0.0
    """[s]; of the turn that took most since it was last set to 0."""
    aside: float = 0.0


def bare_loop() -> float:
    """Processor time of counting to a million, here and now [s]: on a machine that is not busy some 20 ms."""
    began = time.thread_time()
    for _ in range(TURNS):
        pass
    return time.thread_time() - began


class BareLoops:
    """Measures in times of counting to a million. The fastest seen decides on what is clearly short; what is not has one of its own."""

    def __init__(self) -> None:
        self._fastest = min(bare_loop() for _ in range(5))

    def of(self, seconds: float, most: float) -> float:
        """How many bare loops `seconds` of a processor are; the one in question runs here and now if they may be `most` or more."""
        if seconds >= most * self._fastest:
            now = bare_loop()
            self._fastest = min(self._fastest, now)
            return seconds / now
        return seconds / self._fastest


@contextmanager
def frozen() -> Iterator[None]:
    """What was built so far is left alone by the collector, as in a server that has started (app/web/serve.py)."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


@contextmanager
def timed() -> Iterator[Spent]:
    """Measure from now on."""
    spent, run = Spent(), asyncio.Handle._run  # type: ignore[attr-defined]

    def turn(handle: Any) -> Any:
        spent.aside, began = 0.0, time.thread_time()
        try:
            return run(handle)
        finally:
            spent.longest = max(spent.longest, time.thread_time() - began - spent.aside)

    def aside(call: Callable[..., Any]) -> Callable[..., Any]:
        def there(*given: Any, **named: Any) -> Any:
            began = time.thread_time()
            try:
                return call(*given, **named)
            finally:
                spent.aside += time.thread_time() - began

        return there

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(asyncio.Handle, "_run", turn)
        patch.setattr(virtual.VirtualLoop, "run_in_executor", aside(virtual.VirtualLoop.run_in_executor))
        patch.setattr(virtual.Inline, "submit", aside(virtual.Inline.submit))
        yield spent
