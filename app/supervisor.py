"""The supervisor of long tasks: an error is logged, counted and shown, and the task is started again; its neighbours never notice."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

log = logging.getLogger(__name__)

FIRST_PAUSE = 0.5
LONGEST_PAUSE = 10.0
"""Pauses before a failed task is started again [s], doubling from the first to the longest."""


@dataclass(slots=True)
class SupervisedTask:
    """One long task."""

    name: str
    alive: bool = True
    failures: int = 0
    error: str = ""
    task: asyncio.Task[None] | None = field(default=None, repr=False)


class Supervisor:
    """Starts long tasks and keeps them running until `close`."""

    def __init__(self, changed: Callable[[SupervisedTask], None] = lambda task: None) -> None:
        self.tasks: dict[str, SupervisedTask] = {}
        self._changed = changed

    def start(self, name: str, factory: Callable[[], Awaitable[None]]) -> None:
        """Run `factory()` for ever; a task that returns is finished, one that raises is started again."""
        self.tasks[name] = task = SupervisedTask(name)
        task.task = asyncio.create_task(self._run(task, factory), name=name)

    async def end(self, name: str) -> None:
        """End the task `name`, if there is one, and wait for it."""
        task = self.tasks.pop(name, None)
        if task and task.task:
            task.task.cancel()
            await asyncio.gather(task.task, return_exceptions=True)

    async def close(self) -> None:
        """End all tasks and wait for them."""
        for name in list(self.tasks):
            await self.end(name)

    async def _run(self, task: SupervisedTask, factory: Callable[[], Awaitable[None]]) -> None:
        pause = FIRST_PAUSE
        loop = asyncio.get_running_loop()
        while True:
            started = loop.time()
            task.alive = True
            self._changed(task)
            try:
                await factory()
                return
            except Exception as error:
                task.alive, task.failures, task.error = False, task.failures + 1, f"{type(error).__name__}: {error}"
                log.exception("task failed task=%s failures=%d", task.name, task.failures)
                self._changed(task)
            if loop.time() - started > 60:
                pause = FIRST_PAUSE
            await asyncio.sleep(pause)
            pause = min(pause * 2, LONGEST_PAUSE)
