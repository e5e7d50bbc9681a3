"""Threads for work that would hold up the loop: databases and password hashes."""

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor

Threads = Callable[[int, str], Executor]
"""Makes a pool: how many threads, and what they are called."""
GIVES_WAY = frozenset({"argon2"})
"""Pools that compute for long: before them comes the loop, which carries Stop."""
NICENESS = 10
"""Of theirs: beside one of them the loop has nine tenths of a processor."""


def threads(count: int, name: str) -> Executor:
    """A pool of `count` threads called `name`."""
    return ThreadPoolExecutor(count, thread_name_prefix=name, initializer=_give_way if name in GIVES_WAY else None)


def _give_way() -> None:
    """Let this thread, and those that it starts, come after others; elsewhere than on Linux that counts for whole processes only."""
    if sys.platform == "linux":
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
