"""Whose turn it is on the wire: jobs by priority before scans by deadline.

A scan's deadline is its due time plus its period, so fast blocks go before slow ones, and slow ones still get their turn on a line that is
too short for all. A block has one place at most: late scans are counted, never queued up.
"""

import asyncio
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from enum import IntEnum
from heapq import heappop, heappush
from itertools import count

from app.links.contract import Block
from app.links.scan_block import ScanBlock

PATIENCE = 2.0
"""What is read only once may be overtaken by other scans for so long [s]."""


PERMIT: ContextVar[Callable[[], bool] | None] = ContextVar("permit", default=None)
"""Whether what is being asked for, with all its telegrams, may still be sent: set by whoever asks on behalf of a person."""


class Priority(IntEnum):
    """Order of jobs; all of them go before scans, but those that are no hurry."""

    URGENT = 0
    """Stop."""
    WRITE = 1
    REFRESH = 2
    """Reads that somebody waits for."""


@dataclass(slots=True)
class Job:
    """One telegram that somebody waits for."""

    unit: int
    timeout: float
    done: asyncio.Future[list[int]]
    read: Block | None = None
    scan: ScanBlock | None = None
    """The block that `read` belongs to: its values are published."""
    address: int = 0
    """First register to write."""
    words: Sequence[int] = ()
    """Written, when there is no `read`."""
    function: int = 6
    own: Sequence[int] = ()
    """Bits of each word that are written; empty = all. The others are read in the same turn, and sent as they are."""
    urgent: bool = False
    machine: str = ""
    """Equipment that is written to; empty = whatever the unit has."""
    overtaken: bool = False
    """Whether a Stop came while the other bits of `own` were read: it is not sent."""
    permit: Callable[[], bool] | None = None
    """Asked when it is its turn; a write that may no more is never sent."""
    sent: bool = False
    """Whether a transport was given it: from then on nobody knows whether the device acted, until it says so."""
    liveness: bool = field(default=True)
    """Whether an answer shows that the unit is there; training registers answer with the cable pulled."""
    quiet: bool = False
    """A refusal is an answer like any other: the question is ours, no fault of the device."""

    def yields_to(self, machine: str) -> bool:
        """Whether a Stop of `machine` of this unit (empty = of all that is there) comes before it, and it is not sent at all."""
        return not self.urgent and (not machine or self.machine in ("", machine))


class Schedule:
    """Jobs, and scan blocks with their due times. Pure: it is told the time."""

    def __init__(self) -> None:
        self._jobs: list[tuple[float, int, Job]] = []
        self._waiting: list[tuple[float, int, int, ScanBlock]] = []
        self._ready: list[tuple[float, int, int, ScanBlock]] = []
        self._sequence = count()

    def add(self, job: Job, priority: Priority) -> None:
        """Let `job` wait for its turn."""
        heappush(self._jobs, (priority, next(self._sequence), job))

    def overtake(self, unit: int, machine: str = "") -> list[Job]:
        """Take the writes to `unit` that are not urgent out of the queue, but those to another machine than `machine` there."""
        writes = (job for _, _, job in self._jobs if job.unit == unit and job.read is None)
        overtaken = [job for job in writes if job.yields_to(machine)]
        if overtaken:
            self._jobs = sorted(entry for entry in self._jobs if not any(entry[2] is job for job in overtaken))
        return overtaken

    def at(self, block: ScanBlock, due: float, *, first: bool = False) -> None:
        """Give `block` its place at `due` [s], instead of the one that it had; `first`: before all other scans.

        A block that is not wanted gets none, nor one whose machine is no longer there: what was written to it came back after it went.
        """
        block.ticket += 1
        if not (block.wanted and block.alive):
            block.queued = False
            return
        block.due = due
        block.queued = True
        if first:
            heappush(self._ready, (float("-inf"), next(self._sequence), block.ticket, block))
        else:
            heappush(self._waiting, (due, next(self._sequence), block.ticket, block))

    def drop(self, block: ScanBlock) -> None:
        """Take `block` its place."""
        block.ticket += 1
        block.queued = False

    def take(self, now: float) -> Job | ScanBlock | None:
        """What is to be sent at `now` [s], if anything."""
        while self._jobs:
            job = heappop(self._jobs)[2]
            if not job.done.done():
                return job
        while self._waiting and self._waiting[0][0] <= now:
            due, sequence, ticket, block = heappop(self._waiting)
            if ticket == block.ticket:
                heappush(self._ready, (due + min(block.period, PATIENCE), sequence, ticket, block))
        while self._ready:
            _, _, ticket, block = heappop(self._ready)
            if ticket == block.ticket:
                block.queued = False
                return block
        return None

    def next_due(self) -> float | None:
        """When the next scan is due [s]; None when there is none."""
        while self._waiting and self._waiting[0][2] != self._waiting[0][3].ticket:
            heappop(self._waiting)
        return self._waiting[0][0] if self._waiting else None

    def clear(self) -> list[Job]:
        """Forget everything; the jobs that were waiting."""
        jobs = [job for _, _, job in self._jobs]
        for _, _, _, block in (*self._waiting, *self._ready):
            self.drop(block)
        self._jobs, self._waiting, self._ready = [], [], []
        return jobs
