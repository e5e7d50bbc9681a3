"""A drive on a pseudo-terminal that keeps the time of a serial line, in a process of its own.

`serial_line BAUD`; it says the path, and to `log` the moment of every telegram, with address and word of a write.
"""

import asyncio
import sys
import time
from collections.abc import Sequence

from app.sim.bus import Bus
from app.sim.eura_e800.drive import VirtualE800
from app.sim.server import serve_pty
from benchmarks.common import lines_in, say


class _Drive(VirtualE800):
    """Notes what is written to it."""

    def __init__(self) -> None:
        super().__init__(seed=1, start="forward", parameters={"F113": 40.0})
        self.noted: list[tuple[float, int, int]] = []
        """Moment, address and word of a write; of a read the address is -1."""

    def read(self, function: int, address: int, count: int) -> list[int]:
        self.noted.append((time.monotonic(), -1, address))
        return super().read(function, address, count)

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        super().write(function, address, words)
        self.noted.append((time.monotonic(), address, words[0]))


async def _serve(baud: int) -> None:
    drive = _Drive()
    server = await serve_pty(Bus({1: drive}), baud)

    async def move() -> None:
        while True:
            drive.step()
            await asyncio.sleep(drive.dt)

    moving = asyncio.create_task(move())
    say(server.path)
    async for line in lines_in():
        if line == "log":
            say(drive.noted)
    moving.cancel()


def main() -> None:
    asyncio.run(_serve(int(sys.argv[1])))
