"""What those who care for one unit (links/plc.py, orders.py, events.py) need of the loop around the link."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Protocol

from app.clock import Clock
from app.errors import LinkError
from app.links.contract import Block
from app.links.host_event import EventTaker
from app.links.scan_block import ScanBlock
from app.links.schedule import Job, Priority
from app.links.station import Station
from app.links.statistics import LinkStatistics


class BusAccess(Protocol):
    """The loop around the link (links/runner.py)."""

    statistics: LinkStatistics
    clock: Clock
    events: EventTaker
    paused: Callable[[], bool]
    """Whether the simulation behind the link is paused."""

    async def ask(self, job: Job, priority: Priority) -> list[int]:
        """Send the telegram of `job` when it is its turn."""
        ...

    def job(self, unit: int, read: Block | None = None, *, liveness: bool = True, scan: ScanBlock | None = None) -> Job:
        """A read of `unit`, or the start of a write."""
        ...

    async def read(self, station: Station, block: Block, *, liveness: bool = True) -> list[int]:
        """One read for a task that can wait, also for the line to forget an earlier request."""
        ...

    def schedule(self, block: ScanBlock, due: float) -> None:
        """Scan `block` at `due` [s]."""
        ...

    def written(self, station: Station, address: int, count: int) -> None:
        """What holds these registers is read again now."""
        ...

    def drop(self, block: ScanBlock) -> None:
        """Scan `block` no more until it is given a place again."""
        ...

    def replan(self, station: Station) -> None:
        """Read it by a new plan from now on."""
        ...

    def later(self, station: Station, error: LinkError) -> None:
        """Count it as silent, outside the task that this ends."""
        ...

    def publish(self, station: Station, block: ScanBlock, words: list[int], started: float) -> None:
        """Publish `words` as read by a telegram sent at `started` [s]."""
        ...

    def halt(self, station: Station, *, halted: bool) -> None:
        """The program of the unit stands still, or goes on."""
        ...

    def refuse(self, station: Station, block: ScanBlock, reason: str) -> None:
        """What `block` holds is not what the plant file says: bad, and looked at again later."""
        ...

    def misconfigured(self, station: Station, reason: str) -> None:
        """The unit is not the device of the plant file."""
        ...

    def attend(self, station: Station, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Do `work` for a station beside its scans, until the connection or the unit is lost."""
        ...
