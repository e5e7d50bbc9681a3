"""The shortest list that still fails: delta debugging (Zeller, Hildebrandt: Simplifying and Isolating Failure-Inducing Input, 2002)."""

from collections.abc import Callable, Sequence
from typing import TypeVar

T = TypeVar("T")


def shortest(items: Sequence[T], fails: Callable[[Sequence[T]], bool], tries: int) -> Sequence[T]:
    """Of `items`, which fail, as few as `tries` calls of `fails` find."""
    items, parts = list(items), 2
    while tries > 0 and len(items) > 1:
        size = max(1, len(items) // parts)
        for begin in range(0, len(items), size):
            fewer = items[:begin] + items[begin + size :]
            tries -= 1
            if tries < 0:
                break
            if fails(fewer):
                items, parts = fewer, max(2, parts - 1)
                break
        else:
            if size == 1:
                break
            parts = min(len(items), parts * 2)
    return items
