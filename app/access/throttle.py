"""Brakes on guessing: growing delays per account, a token bucket per client of an address. Never a permanent lock: no shift is locked out.

Source: reference/security.md section 4.5 (1, 2, 4 … 60 s after 5 failures; 20 attempts per minute and address).
"""

from collections import OrderedDict
from dataclasses import dataclass

from app.addresses import client_of
from app.clock import Clock

FREE_FAILURES = 5
"""Failures of an account that cost nothing."""
FIRST_DELAY = 1.0
"""The delay after the first failure that costs something: from then on the account is locked for a while [s]."""
LONGEST_DELAY = 60.0
"""Longest delay of an account [s]."""
FORGET_AFTER = 3600.0
"""Quiet time after which the failures of an account are forgotten [s]."""
BUCKET = 20
"""Attempts that an address may make at once, and per minute; those that let somebody in do not count: a class comes from one address."""
MOST_KEPT = 10_000
"""Accounts and addresses remembered; the longest unused go first, so memory is bounded."""


@dataclass(slots=True)
class _Account:
    failures: int = 0
    last: float = 0.0
    until: float = 0.0


@dataclass(slots=True)
class _Bucket:
    tokens: float
    at: float


class Throttle:
    """Counts failures; names that no account has are counted alike, so a lock tells nothing."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._accounts: OrderedDict[str, _Account] = OrderedDict()
        self._buckets: OrderedDict[str, _Bucket] = OrderedDict()

    def wait(self, account: str) -> float:
        """Seconds until `account` may try again; 0 when it may now."""
        kept = self._accounts.get(account)
        return max(0.0, kept.until - self._clock.monotonic()) if kept else 0.0

    def failed(self, account: str, longest: float = LONGEST_DELAY) -> float:
        """Count a failure; returns the delay that it brings, at most `longest` [s]."""
        now = self._clock.monotonic()
        kept = self._accounts.setdefault(account, _Account())
        self._accounts.move_to_end(account)
        if now - kept.last > FORGET_AFTER:
            kept.failures = 0
        kept.failures += 1
        kept.last = now
        over = kept.failures - FREE_FAILURES
        delay = min(longest, 2.0 ** min(over, 10)) if over >= 0 else 0.0
        kept.until = now + delay
        while len(self._accounts) > MOST_KEPT:
            self._accounts.popitem(last=False)
        return delay

    def clear(self, account: str) -> None:
        """Forget the failures of `account`: it signed in, or an administrator freed it; those of its sessions (`name session`), too."""
        for key in [key for key in self._accounts if key == account or key.startswith(f"{account} ")]:
            del self._accounts[key]

    def take(self, address: str) -> bool:
        """Take one attempt of `address`; False when it has none left."""
        now, client = self._clock.monotonic(), client_of(address)
        bucket = self._buckets.setdefault(client, _Bucket(float(BUCKET), now))
        self._buckets.move_to_end(client)
        bucket.tokens = min(float(BUCKET), bucket.tokens + (now - bucket.at) * BUCKET / 60.0)
        bucket.at = now
        while len(self._buckets) > MOST_KEPT:
            self._buckets.popitem(last=False)
        if bucket.tokens < 1.0:
            return False
        bucket.tokens -= 1.0
        return True

    def give_back(self, address: str) -> None:
        """The attempt that `address` took was no guess: whoever comes from there after it has it again."""
        bucket = self._buckets.get(client_of(address))
        if bucket is not None:
            bucket.tokens = min(float(BUCKET), bucket.tokens + 1.0)
