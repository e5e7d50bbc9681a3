"""Slaves on a serial line that do what no good slave does: late, out of order, deaf, damaged, echoing."""

import asyncio
import os
import tty
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from random import Random

from app.links.rtu import RtuTransport
from app.plant.definitions import Link
from app.registers.pdu import Request, build_answer, parse_request
from app.registers.rtu import build_frame, parse_frame, request_length
from app.sim.bus import Bus
from app.sim.server import SerialServer
from tests.wires import SerialLine, serve_line


class Terminal:
    """A pseudo-terminal; masters open its `path`."""

    def __init__(self) -> None:
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.path = os.ttyname(self._theirs)

    def fileno(self) -> int:
        return self._ours

    def close(self) -> None:
        os.close(self._ours)
        os.close(self._theirs)


class BadSlave:
    """All units of a line. The word at an address tells which request it answers, so a shifted answer shows."""

    def __init__(self, *, seed: int = 1, terminal: bool = False) -> None:
        """`terminal`: on a pseudo-terminal of this machine, else on a wire of this process."""
        self.random = Random(seed)
        self.late = self.deaf = self.dumb = self.damaged = 0.0
        """Probabilities: answers late, does not hear, hears and does not answer, answers with a wrong check sum."""
        self.latest = 3.0
        """Longest delay of a late answer [s]."""
        self.in_order = False
        """Whether a late answer holds up those behind it."""
        self.echo = False
        self.number = 0
        """Requests heard."""
        self.writes: list[tuple[int, Request]] = []
        self.gaps: list[float] = []
        """Silence between the last byte written and the next request [s]."""
        self.lates = 0
        self._busy_until = 0.0
        self._wrote = 0.0
        self._heard = bytearray()
        self._line = Terminal() if terminal else SerialLine()
        self._ours, self.path = self._line.fileno(), self._line.path
        self._timers: set[asyncio.TimerHandle] = set()
        asyncio.get_running_loop().add_reader(self._ours, self._readable)

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._ours)
        for timer in self._timers:
            timer.cancel()
        self._line.close()

    def word(self, address: int, number: int | None = None) -> int:
        return ((self.number if number is None else number) + 7 * address) & 0xFFFF

    def number_of(self, word: int, address: int) -> int:
        return (word - 7 * address) & 0xFFFF

    def say(self, data: bytes) -> None:
        self._wrote = asyncio.get_running_loop().time()
        os.write(self._ours, data)

    def _readable(self) -> None:
        if not self._heard and self._wrote:
            self.gaps.append(asyncio.get_running_loop().time() - self._wrote)
        self._heard += os.read(self._ours, 4096)
        length = request_length(self._heard)
        while length and len(self._heard) >= length:
            frame = bytes(self._heard[:length])
            del self._heard[:length]
            self._answer(frame)
            length = request_length(self._heard)

    def _answer(self, frame: bytes) -> None:
        if self.echo:
            self.say(frame)
        parsed = parse_frame(frame)
        if parsed is None or self.random.random() < self.deaf:
            return
        unit, pdu = parsed
        request = parse_request(pdu)
        self.number += 1
        if request.words:
            self.writes.append((unit, request))
        if self.random.random() < self.dumb:
            return
        words = [self.word(address) for address in range(request.address, request.address + request.count)]
        answer = build_frame(unit, build_answer(request, words))
        if self.random.random() < self.damaged:
            answer = answer[:-1] + bytes((answer[-1] ^ 0xFF,))
        loop = asyncio.get_running_loop()
        delay = 0.0
        if self.random.random() < self.late:
            delay, self.lates = self.random.uniform(0.0, self.latest), self.lates + 1
        if self.in_order:
            self._busy_until = max(self._busy_until, loop.time()) + delay
            delay = self._busy_until - loop.time()
        if delay <= 0:
            self.say(answer)
        else:
            self._timers.add(loop.call_later(delay, self.say, answer))


@asynccontextmanager
async def bad_slave(*, seed: int = 1, terminal: bool = False) -> AsyncIterator[BadSlave]:
    slave = BadSlave(seed=seed, terminal=terminal)
    try:
        yield slave
    finally:
        slave.close()


def rtu(path: str, baud: int = 115200, **fields: object) -> Link:
    """A serial link over a pseudo-terminal, which knows no parity."""
    return Link("hall", "rtu", port=path, baud=baud, parity="none", stop_bits=2, writes=True, **fields)  # type: ignore[arg-type]


@asynccontextmanager
async def opened(link: Link) -> AsyncIterator[RtuTransport]:
    transport = RtuTransport(link)
    await transport.connect()
    try:
        yield transport
    finally:
        await transport.close()


@asynccontextmanager
async def paced(bus: Bus, baud: int) -> AsyncIterator[SerialServer]:
    line = await serve_line(bus, baud)
    try:
        yield line
    finally:
        await line.close()
