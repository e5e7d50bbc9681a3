"""The server under examination: its registers, one telegram at a time, and how long it takes for each."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from struct import pack
from typing import NamedTuple

from app.errors import BadAnswer
from app.registers.pdu import READ_HOLDING, WRITE_MULTIPLE, Request, build_request, parse_answer

Exchange = Callable[[bytes], Awaitable[bytes]]
"""Request PDU → answer PDU.

Raises:
    NoAnswer: silence.
    NotConnected: the connection is gone.
"""

EXCEPTION = 0x80
"""Set in the function of an answer that refuses."""


class Refusal(NamedTuple):
    """What came to a request that has to be refused."""

    code: int
    """Exception code; 0 = it was no refusal of this request."""
    answered: bool
    """It was taken as any other."""
    answer: bytes
    """The PDU that came."""


class Server:
    """Asks and keeps what the wire tells: the slowest answer and those that were no answer to their request."""

    def __init__(self, exchange: Exchange) -> None:
        self._exchange = exchange
        self.slowest = 0.0
        """Of all answers [s]."""
        self.slowest_at = 0
        """Address that it was asked for."""
        self.malformed = ""
        """The first answer that was none to its request."""

    async def read(self, address: int, count: int) -> list[int]:
        """Exactly `count` words from `address` on, with one function 03.

        Raises:
            LinkError: silence, a refusal, or an answer that is none to this request.
        """
        return await self._ask(Request(READ_HOLDING, address, count), address)

    async def write(self, address: int, words: Sequence[int], function: int = WRITE_MULTIPLE) -> None:
        """Write `words` with one telegram; returns when the echo equals the request.

        Raises:
            LinkError: as `read`.
        """
        await self._ask(Request(function, write_address=address, words=tuple(words)), address)

    async def refusal_of(self, pdu: bytes) -> Refusal:
        """What a request earns that no well-behaved host sends.

        Raises:
            NoAnswer: silence.
        """
        answer = await self._exchange(pdu)
        refused = len(answer) == 2 and answer[0] == pdu[0] | EXCEPTION
        return Refusal(answer[1] if refused else 0, answer[:1] == pdu[:1], answer)

    async def refusal_of_read(self, address: int, count: int) -> Refusal:
        """The same of a read of any `count`, one that is not allowed included."""
        return await self.refusal_of(pack(">BHH", READ_HOLDING, address, count))

    async def _ask(self, request: Request, address: int) -> list[int]:
        loop = asyncio.get_running_loop()
        began = loop.time()
        answer = await self._exchange(build_request(request))
        took = loop.time() - began
        if took > self.slowest:
            self.slowest, self.slowest_at = took, address
        try:
            return parse_answer(request, answer)
        except BadAnswer as error:
            self.malformed = self.malformed or f"0x{address:04X}: {error}"
            raise
