"""Threads for work that would hold up the loop: databases and password hashes."""

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from functools import partial
from typing import ParamSpec, TypeVar

T = TypeVar("T")
P = ParamSpec("P")

Threads = Callable[[int, str], Executor]
"""Makes a pool: how many threads, and what they are called."""
GIVES_WAY = frozenset({"argon2"})
"""Pools that compute for long: before them comes the loop, which carries Stop."""
NICENESS = 10
"""Of theirs: beside one of them the loop has nine tenths of a processor."""


def threads(count: int, name: str) -> Executor:
    """A pool of `count` threads called `name`."""
    return ThreadPoolExecutor(count, thread_name_prefix=name, initializer=_give_way if name in GIVES_WAY else None)


class Turns(Executor):
    """One thread whose work is numbered: who looks sees whether it goes on."""

    def __init__(self, thread: Executor) -> None:
        self.at_work = 0
        """Number of the work that is being done; 0 = none is."""
        self._thread = thread
        self._number = 0

    def submit(self, work: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Have `work` done after all that was submitted before."""
        return self._thread.submit(self._do, partial(work, *args, **kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more work."""
        self._thread.shutdown(wait=wait, cancel_futures=cancel_futures)

    def _do(self, work: Callable[[], T]) -> T:
        self._number += 1
        self.at_work = self._number
        try:
            return work()
        finally:
            self.at_work = 0


def _give_way() -> None:
    """Let this thread, and those that it starts, come after others; elsewhere than on Linux that counts for whole processes only."""
    if sys.platform == "linux":
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
