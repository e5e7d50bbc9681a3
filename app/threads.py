"""Threads for work that would hold up the loop: databases and password hashes."""

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor

Threads = Callable[[int, str], Executor]
"""Makes a pool: how many threads, and what they are called."""


def threads(count: int, name: str) -> Executor:
    """A pool of `count` threads called `name`."""
    return ThreadPoolExecutor(count, thread_name_prefix=name)
