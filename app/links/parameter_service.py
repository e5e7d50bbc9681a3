"""What the services that carry a drive's parameters have in common: nothing of them is scanned, no point is written through them, and
whoever asks waits in turn.
"""

import asyncio
from collections.abc import Sequence

from app.errors import LinkError
from app.links.bus_access import BusAccess
from app.links.scan_block import ScanBlock
from app.links.services import Seen, SetWrite
from app.links.station import Station
from app.plant.definitions import Register


class ParameterService:
    """What the link asks of such a service (`services.Service`), but for `adopt`."""

    def __init__(self, bus: BusAccess, station: Station) -> None:
        self._bus = bus
        self._station = station
        self._turn = asyncio.Lock()

    async def identify(self) -> bool:
        """Parameters say nothing by themselves."""
        return True

    def begin(self) -> None:
        """The unit is there."""

    async def end(self) -> None:
        """The link ends; whoever waits hears it from their telegrams."""

    def reads(self, block: ScanBlock) -> bool:
        """Nothing of it is scanned."""
        return False

    def seen(self, block: ScanBlock, words: list[int], started: float) -> Seen:
        """Nothing of it is scanned."""
        return Seen.WHOLE

    def worth_reading(self, blocks: Sequence[ScanBlock]) -> list[ScanBlock]:
        """`blocks`."""
        return list(blocks)

    def takes(self, register: Register) -> bool:
        """Points are not written through it."""
        return False

    async def write(self, writes: Sequence[SetWrite]) -> int:
        """Never asked for: it takes no registers.

        Raises:
            LinkError: always.
        """
        raise LinkError(f"unit {self._station.number}: {len(writes)} points, parameters take none")
