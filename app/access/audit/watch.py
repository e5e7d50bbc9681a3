"""What the audit does by itself: it writes again what waits, anchors every hour, verifies every day, notes steps of the clock."""

import asyncio
import logging

from app.access.audit.audit import Audit
from app.clock import Clock
from app.errors import StorageError

log = logging.getLogger(__name__)

PERIOD = 1.0
RETRY_PERIOD = 5.0
VERIFY_FIRST, VERIFY_PERIOD = 60.0, 86_400.0
"""The chain is verified a minute after start and once a day [s]."""
CLOCK_STEP = 1.0
"""A wall clock that moves by more than this against the monotonic one is written down [s]."""


class AuditWatch:
    """Looks after the audit while the server runs."""

    def __init__(self, audit: Audit, clock: Clock) -> None:
        self._audit = audit
        self._clock = clock
        self._apart = self._now_apart()

    async def run(self) -> None:
        """Look each second, for ever."""
        self._apart = self._now_apart()
        retry = self._clock.monotonic() + RETRY_PERIOD
        verify = self._clock.monotonic() + VERIFY_FIRST
        while True:
            await asyncio.sleep(PERIOD)
            now = self._clock.monotonic()
            await self.note_clock()
            if now >= retry:
                retry = now + RETRY_PERIOD
                await self._audit.replay()
                await self._audit.anchor_if_due()
            if now >= verify:
                verify = now + VERIFY_PERIOD
                try:
                    await self._audit.check()
                except StorageError as error:
                    verify = now + VERIFY_FIRST
                    log.error("audit not verified reason=%s", error)

    async def note_clock(self) -> None:
        """Write a line when the wall clock was set: when it moved against the monotonic one since the last look."""
        apart = self._now_apart()
        if abs(apart - self._apart) > CLOCK_STEP:
            await self._audit.record("clock.stepped", None, seconds=round(apart - self._apart, 3))
            self._apart = apart

    def _now_apart(self) -> float:
        """Wall clock less monotonic clock [s]."""
        return self._clock.micros() / 1e6 - self._clock.monotonic()
