"""Chance: every jitter, id, nonce and key comes from one source, so that a run can be repeated from a seed.

The source is the operating system's. `use` puts another one in its place, which only tests and simulations of a whole plant do.
"""

from base64 import urlsafe_b64encode
from collections.abc import Sequence
from random import Random, SystemRandom
from typing import TypeVar

T = TypeVar("T")

_source: Random = SystemRandom()


def use(source: Random | None = None) -> None:
    """From now on chance comes from `source`; without one, from the operating system."""
    global _source
    _source = source or SystemRandom()


def uniform(low: float, high: float) -> float:
    """A number between `low` and `high`."""
    return _source.uniform(low, high)


def randrange(low: int, high: int) -> int:
    """An integer from `low` up to, not including, `high`."""
    return _source.randrange(low, high)


def choice(items: Sequence[T]) -> T:
    """One of `items`, which are not empty."""
    return _source.choice(items)


def token_bytes(count: int) -> bytes:
    """`count` bytes that nobody can guess."""
    return _source.randbytes(count)


def token_hex(count: int) -> str:
    """`count` bytes that nobody can guess [hex]."""
    return token_bytes(count).hex()


def token_urlsafe(count: int) -> str:
    """`count` bytes that nobody can guess, in letters that fit an address and a cookie."""
    return urlsafe_b64encode(token_bytes(count)).rstrip(b"=").decode()
