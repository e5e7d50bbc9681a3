"""The keeper of long tasks: an error is logged, counted and shown, and the task is started again; its neighbours never notice."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

log = logging.getLogger(__name__)

FIRST_PAUSE = 0.5
LONGEST_PAUSE = 10.0
"""Pauses before a failed task is started again [s], doubling from the first to the longest."""


@dataclass(slots=True)
class Kept:
    """One kept task."""

    name: str
    alive: bool = True
    failures: int = 0
    error: str = ""
    task: asyncio.Task[None] | None = field(default=None, repr=False)


class Keeper:
    """Starts long tasks and keeps them running until `close`."""

    def __init__(self, changed: Callable[[Kept], None] = lambda kept: None) -> None:
        self.kept: dict[str, Kept] = {}
        self._changed = changed

    def keep(self, name: str, factory: Callable[[], Awaitable[None]]) -> None:
        """Run `factory()` for ever; a task that returns is finished, one that raises is started again."""
        kept = Kept(name)
        self.kept[name] = kept
        kept.task = asyncio.create_task(self._run(kept, factory), name=name)

    async def drop(self, name: str) -> None:
        """End the task `name`, if there is one, and wait for it."""
        kept = self.kept.pop(name, None)
        if kept and kept.task:
            kept.task.cancel()
            await asyncio.gather(kept.task, return_exceptions=True)

    async def close(self) -> None:
        """End all tasks and wait for them."""
        for name in list(self.kept):
            await self.drop(name)

    @property
    def all_alive(self) -> bool:
        """Whether every task runs now."""
        return all(kept.alive for kept in self.kept.values())

    async def _run(self, kept: Kept, factory: Callable[[], Awaitable[None]]) -> None:
        pause = FIRST_PAUSE
        loop = asyncio.get_running_loop()
        while True:
            started = loop.time()
            kept.alive = True
            self._changed(kept)
            try:
                await factory()
                return
            except Exception as error:
                kept.alive, kept.failures, kept.error = False, kept.failures + 1, f"{type(error).__name__}: {error}"
                log.exception("task failed task=%s failures=%d", kept.name, kept.failures)
                self._changed(kept)
            if loop.time() - started > 60:
                pause = FIRST_PAUSE
            await asyncio.sleep(pause)
            pause = min(pause * 2, LONGEST_PAUSE)
