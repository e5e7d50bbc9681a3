"""The bare loop of live pages: bytes of the same size to the same number of sockets, by nothing but asyncio.

`broadcast PORT SIZE RATE`; it answers with `ready`.
"""

import asyncio
import sys
from typing import ClassVar

from benchmarks.common import lines_in, say


class _Listener(asyncio.Protocol):
    open: ClassVar[set[asyncio.Transport]] = set()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.open.add(transport)  # type: ignore[arg-type]

    def connection_lost(self, exc: Exception | None) -> None:
        self.open.clear()


async def _broadcast(port: int, size: int, rate: float) -> None:
    await asyncio.get_running_loop().create_server(_Listener, "127.0.0.1", port)
    frame = b"x" * size

    async def send() -> None:
        while True:
            for transport in _Listener.open:
                transport.write(frame)
            await asyncio.sleep(1 / rate)

    sending = asyncio.create_task(send())
    say("ready")
    async for _ in lines_in():
        pass
    sending.cancel()


def main() -> None:
    asyncio.run(_broadcast(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])))
