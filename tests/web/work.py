"""How much one turn of the loop does, counted in calls of functions: the same on every machine, however busy it is."""

import asyncio
import sys
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
