"""Devices in a process of their own: they answer at once, change as told, and know when what was written.

`flat`: registers 0 … that walk by ±1 at every read. `e800`: as many drives as units are asked, their values walking; register 0x1014 of
unit 1 counts. Lines in: `log` (answers changes and writes so far).
"""

import asyncio
import contextlib
import sys
import time
from random import Random
from struct import Struct

from app.errors import DeviceException
from app.sim import training
from app.sim.eura_e800.drive import VirtualE800
from benchmarks.common import lines_in, say

MBAP = Struct(">HHHB")
REQUEST = Struct(">BHH")
WALK = 64
"""Steps of the walk before it turns round."""
COUNTER = 0x1014
GOLDEN = 0.1618034
"""Between two counts [s]."""
SETTLED = range(0x1000, 0x1019)
VARYING = [at for at in SETTLED if at not in (0x1005, COUNTER)]
"""All but the status."""


class Devices:
    """All units of one port."""

    def __init__(self, kind: str, share: float) -> None:
        """`share` of the registers changes at each read."""
        self.kind = kind
        self.random = Random(1)
        self.changes: list[tuple[float, int]] = []
        self.writes: list[tuple[float, int, int, int]] = []
        self.at: dict[tuple[int, int], int] = {}
        self.written: dict[tuple[int, int], int] = {}
        self.counter = 0
        if kind == "flat":
            self.walk = self._walk([1000 + 3 * n for n in range(125)], range(125), share)
        else:
            drive = VirtualE800(seed=1, start="forward", parameters={"F113": 40.0})
            for _ in range(2000):
                drive.step()
            self.image = {at: drive.read(3, at, 1)[0] for at in SETTLED}
            for at in range(0x0100, 0x0A00):
                with contextlib.suppress(DeviceException):
                    self.image[at] = drive.read(3, at, 1)[0]
            base = [self.image[at] for at in SETTLED]
            self.walk = self._walk(base, [at - 0x1000 for at in VARYING], share)

    def _walk(self, words: list[int], varying: "list[int] | range", share: float) -> list[list[int]]:
        steps = [list(words)]
        for _ in range(WALK):
            now = list(steps[-1])
            for n in varying:
                if self.random.random() < share:
                    now[n] += self.random.choice((-1, 1)) if now[n] > 0 else 1
            steps.append(now)
        return steps + steps[-2:0:-1]

    def answer(self, unit: int, pdu: bytes) -> bytes:
        function, address, count = REQUEST.unpack_from(pdu)
        if function == 6:
            self.writes.append((time.monotonic(), unit, address, count))
            self.written[unit, address] = count
            return pdu
        if function != 3:
            return bytes((function | 0x80, 1))
        words = self.words(unit, address, count)
        return bytes((3, 2 * count)) + Struct(f">{count}H").pack(*words) if words else bytes((0x83, 2))

    def words(self, unit: int, address: int, count: int) -> list[int]:
        if address >= training.BASE:
            return [training.MAGIC, training.SIMULATED, training.VERSION, 1][:count] if self.kind == "e800" else []
        if self.kind == "flat" or address >= 0x1000:
            key = (unit, address)
            step = self.at[key] = (self.at.get(key, -1) + 1) % len(self.walk)
            words = self.walk[step]
            if self.kind == "flat":
                return words[:count]
            words = list(words)
            words[COUNTER - 0x1000] = self.counter if unit == 1 else 0
            return words[address - 0x1000 : address - 0x1000 + count]
        if any(at not in self.image for at in range(address, address + count)):
            return []
        return [self.written.get((unit, at), self.image[at]) for at in range(address, address + count)]

    async def count_on(self) -> None:
        """Change the counter at moments that are spread evenly over the scan's period of 100 ms."""
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            await asyncio.sleep(max(0.0, due - loop.time()))
            due += GOLDEN
            self.counter += 1
            self.changes.append((time.monotonic(), self.counter))


class _Connection(asyncio.Protocol):
    def __init__(self, devices: Devices) -> None:
        self.devices = devices
        self.heard = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport: asyncio.Transport = transport  # type: ignore[assignment]

    def data_received(self, data: bytes) -> None:
        self.heard += data
        while len(self.heard) >= 7:
            transaction, _, length, unit = MBAP.unpack_from(self.heard)
            if len(self.heard) < 6 + length:
                return
            body = self.devices.answer(unit, self.heard[7 : 6 + length])
            self.heard = self.heard[6 + length :]
            self.transport.write(MBAP.pack(transaction, 0, len(body) + 1, unit) + body)


async def _serve(kind: str, share: float) -> None:
    devices = Devices(kind, share)
    server = await asyncio.get_running_loop().create_server(lambda: _Connection(devices), "127.0.0.1", 0)
    counting = asyncio.create_task(devices.count_on())
    say(server.sockets[0].getsockname()[1])
    async for line in lines_in():
        if line == "log":
            say({"changes": devices.changes, "writes": devices.writes})
    counting.cancel()


def main() -> None:
    """`devices KIND SHARE`"""
    asyncio.run(_serve(sys.argv[1], float(sys.argv[2])))
