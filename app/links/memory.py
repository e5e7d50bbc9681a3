"""The memory transport: telegrams to virtual devices in this process, silence and delays included."""

import asyncio
from collections.abc import Sequence

from app.errors import BadAnswer, ConfigurationError, NoAnswer, NotConnected
from app.links.contract import Block, Counts, Exchange
from app.links.patience import Patience
from app.plant.definitions import Link
from app.registers.pdu import WRITE_MULTIPLE, Request, build_request, parse_answer

TURN = 0.001
"""So long it goes on without a pause for others [s]: where the loop is slow to come round, several telegrams are carried each time."""


class MemoryTransport:
    """Hands each PDU to `exchange` and waits for what the virtual device answers, at most until the time-out."""

    parallel = True

    def __init__(self, link: Link, exchange: Exchange | None = None) -> None:
        """
        Raises:
            ConfigurationError: there is no simulated line behind the link.
        """
        if exchange is None:
            raise ConfigurationError(f"link {link.name}: transport memory needs a simulated line, there is none")
        self.counts = Counts()
        self._exchange = exchange
        self._open = False
        self._turn = 0.0
        """When it last let others go on [s]."""

    @property
    def connected(self) -> bool:
        """Between `connect` and `close`."""
        return self._open

    async def connect(self) -> None:
        """Memory is always there."""
        self._open = True

    async def read(self, unit: int, block: Block, patience: float) -> list[int]:
        """Exactly `block.count` words."""
        return await self._ask(unit, Request(block.function, block.address, block.count), patience)

    async def write(self, unit: int, address: int, words: Sequence[int], patience: float, function: int = 6) -> None:
        """Write `words`; returns when the echo equals the request."""
        await self._ask(unit, Request(function, write_address=address, words=tuple(words)), patience)

    async def close(self) -> None:
        """Nothing is answered any more."""
        self._open = False

    async def _ask(self, unit: int, request: Request, patience: float) -> list[int]:
        if not self._open:
            raise NotConnected(f"unit {unit}: the simulated line is closed")
        try:
            pdu = build_request(request)
        except ValueError as error:
            raise BadAnswer(f"unit {unit}: {error}") from error
        loop = asyncio.get_running_loop()
        if loop.time() - self._turn >= TURN:  # a device that answers at once must not keep the loop from others
            await asyncio.sleep(0)
            self._turn = loop.time()
        try:
            async with Patience(patience):
                answer = await self._exchange(unit, pdu)
                if answer is None:
                    await loop.create_future()
        except TimeoutError:
            answer = None
        if answer is None:
            verb = "write" if request.function >= WRITE_MULTIPLE or request.words else "read"
            raise NoAnswer(
                f"unit {unit}: no answer to {verb} {request.write_address or request.address:#06x} in {patience:g} s"
            )
        return parse_answer(request, answer)
