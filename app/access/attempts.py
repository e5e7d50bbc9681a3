"""Attempts to sign in side by side: a class comes from one address at the same moment, and leaves a stranger there no more guesses.

An attempt takes one of those that its address has (`Throttle.take`) before it is looked at, and whoever was let in gives it back. So when
all are taken, those that are being looked at decide whether one is left: the next waits in line for their answers.
"""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from app.access.throttle import Throttle
from app.addresses import client_of
from app.errors import Refused

IN_LINE = 60.0
"""So long an attempt waits for those before it at its address before it is one too many [s]: those of a class are looked at meanwhile."""


class Attempts:
    """Those that are being looked at, by client."""

    def __init__(self, throttle: Throttle) -> None:
        self._throttle = throttle
        self._answered = asyncio.Condition()
        self._looked_at: Counter[str] = Counter()

    def __len__(self) -> int:
        return self._looked_at.total()

    @asynccontextmanager
    async def one(self, address: str) -> AsyncIterator[None]:
        """One attempt of `address`, which ends with the block.

        Raises:
            Refused: 429, none was left when those before it were answered, or they were not in time.
        """
        client = client_of(address)
        if not self._throttle.take(address):
            await self._in_line(client, address)
        self._looked_at[client] += 1
        try:
            yield
        finally:
            self._looked_at[client] -= 1
            if not self._looked_at[client]:
                del self._looked_at[client]
            async with self._answered:
                self._answered.notify_all()

    async def _in_line(self, client: str, address: str) -> None:
        try:
            async with asyncio.timeout(IN_LINE), self._answered:
                while self._looked_at[client]:
                    await self._answered.wait()
                    if self._throttle.take(address):
                        return
        except TimeoutError:
            pass
        raise Refused("access.too_many", 429)
