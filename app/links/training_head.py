"""The head of the training registers: only a virtual device has one, and it says that nothing real is there (reference/register-map.md)."""

import asyncio
import logging

from app.errors import GATEWAY, BadAnswer, DeviceException, NoAnswer
from app.links.contract import Block, LateAnswerDue
from app.links.line import Line
from app.links.schedule import Priority
from app.links.station import Station

log = logging.getLogger(__name__)

BUSY_PAUSE = 0.05
"""Before a device that is busy is asked again [s]."""
WORDS = 4
SPARE = 12
"""Registers behind the head that may be read with it."""
MAGIC = 0x5047
SIMULATED = 0x0001
VERSION = 1
"""Of its words: magic, flags, version, type."""
UNTOLD = (5, 6, *GATEWAY)
"""Refusals that say nothing of the registers that were asked for: the device has no time, or a gateway speaks in its place."""


async def look_at_head(line: Line, station: Station) -> bool | None:
    """Whether the device is one to talk to, by one look, which marks a virtual one; None: it said nothing of these registers, or nothing.

    Raises:
        NotConnected: the connection is lost.
    """
    try:
        magic, flags, version, _ = await read_head(line, station, station.device.training, WORDS)
    except DeviceException as error:
        if error.code not in UNTOLD:
            return True
        await asyncio.sleep(BUSY_PAUSE)
        return None
    except (NoAnswer, BadAnswer):
        return None
    if magic != MAGIC:
        return True
    if version != VERSION or not flags & SIMULATED:
        fault = f"flags={flags:#x} version={version} expected={VERSION}"
        if station.faults.new(fault, line.clock.monotonic()):
            log.error("training registers not understood link=%s unit=%d %s", line.link.name, station.number, fault)
        return False
    station.marked = True
    return True


async def read_head(line: Line, station: Station, address: int, words: int) -> list[int]:
    """The first `words` of a head at `address`, in the shortest telegram that no earlier answer can be taken for: more follow behind it.

    Raises:
        LinkError: as the transport.
    """
    for more in range(SPARE):
        try:
            job = line.job(station.number, Block(address, words + more), liveness=False)
            job.quiet = True
            read = await line.ask(job, Priority.REFRESH)
        except LateAnswerDue:
            continue
        return read[:words]
    return await line.read(station, Block(address, words), liveness=False, quiet=True)
