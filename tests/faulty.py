"""A Modbus slave that does everything wrong that a line, a gateway or a drive can do, and knows what really happened.

For each request a seeded plan draws a fault. Whatever the master is told, `Slave.changes` is the truth: which registers took which word,
and when. The honest part of an answer comes from the simulated bus; what is done to it, and the carriers (TCP, pseudo-terminal), are here,
because a line of ours never lies in most of these ways.
"""

import asyncio
import contextlib
import os
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from random import Random
from struct import Struct
from typing import Protocol

from app.errors import DeviceException
from app.registers.pdu import WRITES, exception_answer
from app.registers.rtu import build_frame, parse_frame, request_length
from app.sim.bus import Bus
from app.sim.training import BASE, LineFault
from tests.wires import SerialLine

MBAP = Struct(">HHHB")
EXCEPTIONS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 11)
MAY_HAVE_ACTED = (5, 11)
"""Refusals that say nothing about the act: "accepted, will take a while", and a gateway that lost the answer."""


class Fault(StrEnum):
    """What becomes of one request. Unless it says otherwise the device acts at once."""

    HONEST = "honest"
    DROPPED = "dropped"
    """The request never arrives."""
    UNANSWERED = "unanswered"
    LATE = "late"
    """The answer comes shortly after the master gave up."""
    VERY_LATE = "very late"
    """The answer comes seconds later."""
    STALLED = "stalled"
    """The request waits in a gateway: device and answer are late."""
    WRONG_LENGTH = "wrong length"
    WRONG_UNIT = "wrong unit"
    WRONG_FUNCTION = "wrong function"
    EXCEPTION = "exception"
    """Refused without acting, but see `MAY_HAVE_ACTED`."""
    GARBAGE = "garbage"
    TRUNCATED = "truncated"
    EXTRA = "extra bytes"
    DUPLICATE = "duplicate"
    RESET = "reset"
    """TCP: the connection is reset, before or after the device acted. Serial: a burst of noise before the answer."""
    EARLIER = "earlier answer"
    """The answer to an earlier request, once more."""
    DEAF = "deaf"
    """An honest echo of a write that changes nothing."""
    OWN_MIND = "own mind"
    """An honest echo of a write that the device takes as another value."""


FOR_WRITES: Mapping[Fault, float] = {
    Fault.HONEST: 40, Fault.DROPPED: 4, Fault.UNANSWERED: 6, Fault.LATE: 6, Fault.VERY_LATE: 3, Fault.STALLED: 3,
    Fault.WRONG_LENGTH: 3, Fault.WRONG_UNIT: 3, Fault.WRONG_FUNCTION: 3, Fault.EXCEPTION: 6, Fault.GARBAGE: 3,
    Fault.TRUNCATED: 3, Fault.EXTRA: 2, Fault.DUPLICATE: 3, Fault.RESET: 1, Fault.EARLIER: 3, Fault.DEAF: 5,
    Fault.OWN_MIND: 3,
}  # fmt: skip
FOR_READS: Mapping[Fault, float] = {
    Fault.HONEST: 93, Fault.DROPPED: 0.5, Fault.UNANSWERED: 0.5, Fault.LATE: 0.7, Fault.VERY_LATE: 0.4,
    Fault.STALLED: 0.4, Fault.WRONG_LENGTH: 0.5, Fault.WRONG_UNIT: 0.5, Fault.WRONG_FUNCTION: 0.5, Fault.EXCEPTION: 0.5,
    Fault.GARBAGE: 0.5, Fault.TRUNCATED: 0.5, Fault.EXTRA: 0.5, Fault.DUPLICATE: 0.5, Fault.RESET: 0.2,
    Fault.EARLIER: 0.5,
}  # fmt: skip
"""Shares. A unit that does not answer twice running is out for a second, so reads are kinder."""


def kinder(shares: Mapping[Fault, float], part: float) -> Mapping[Fault, float]:
    """`shares` with only `part` of the faults. A serial line that lost an answer waits up to 10 s before it asks in the same way again."""
    return {fault: share if fault is Fault.HONEST else share * part for fault, share in shares.items()}


@dataclass(slots=True)
class Plan:
    """Draws a fault for each request, the same ones for the same seed and requests."""

    seed: int
    patience: float
    """The master's time-out [s]; what is late is later than this."""
    writes: Mapping[Fault, float] = field(default_factory=lambda: FOR_WRITES)
    reads: Mapping[Fault, float] = field(default_factory=lambda: FOR_READS)
    honest: bool = False
    """True: from now on nothing goes wrong any more."""
    drawn: Counter[tuple[str, Fault]] = field(default_factory=Counter)
    chance: Random = field(init=False)

    def __post_init__(self) -> None:
        self.chance = Random(self.seed)

    def next(self, pdu: bytes) -> Fault:
        """What becomes of this request. The head of the training registers is always told the truth: it is no part of a real device."""
        writes = pdu[0] in WRITES
        if self.honest or int.from_bytes(pdu[1:3], "big") >= BASE:
            return Fault.HONEST
        shares = self.writes if writes else self.reads
        fault = self.chance.choices(list(shares), list(shares.values()))[0]
        self.drawn["write" if writes else "read", fault] += 1
        return fault


@dataclass(frozen=True, slots=True)
class Change:
    """A register really took a word."""

    at: float
    """[s, loop time]"""
    unit: int
    address: int
    word: int
    asked: int
    """The word of the request: another one when the device has a mind of its own."""


class Image:
    """The registers of one unit."""

    def __init__(self, unit: int, words: Mapping[int, int], changes: list[Change]) -> None:
        self.type = "faulty"
        self.unit = unit
        self.words = dict(words)
        self.line_fault = LineFault()
        self.changes = changes
        self.deaf = False
        self.offset = 0

    def read(self, function: int, address: int, count: int) -> list[int]:
        if function != 3:
            raise DeviceException(1)
        try:
            return [self.words[at] for at in range(address, address + count)]
        except KeyError:
            raise DeviceException(2) from None

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        if function != 6:
            raise DeviceException(1)
        if address not in self.words:
            raise DeviceException(2)
        if self.deaf:
            return
        word = (words[0] + self.offset) & 0xFFFF
        self.words[address] = word
        self.changes.append(Change(asyncio.get_running_loop().time(), self.unit, address, word, words[0]))

    def telegram_seen(self) -> None:
        pass


@dataclass(frozen=True, slots=True)
class Reply:
    """What goes onto the wire; the carrier frames it."""

    unit: int
    pdu: bytes
    earlier: bool = False
    """TCP: with the transaction number of the request before."""
    keep: float = 1.0
    """Part of the frame that is sent."""
    tail: bytes = b""
    noise: bool = False
    """`pdu` is sent without any frame."""


class Hears(Protocol):
    """Whoever has the units behind a carrier."""

    def hear(self, unit: int, pdu: bytes, send: Callable[[Reply], None], reset: Callable[[], None]) -> None:
        """Take a request; `send` what comes back now or later; `reset` breaks the connection."""
        ...


class Slave:
    """Units that answer as the plan wants, on whatever carrier."""

    def __init__(self, images: Mapping[int, Mapping[int, int]], plan: Plan) -> None:
        self.plan = plan
        self.changes: list[Change] = []
        """Every register that was really changed, in order."""
        self.units = {unit: Image(unit, words, self.changes) for unit, words in images.items()}
        self._bus = Bus(self.units)  # type: ignore[arg-type]
        self._answered: dict[int, deque[bytes]] = {unit: deque(maxlen=4) for unit in images}

    def hear(self, unit: int, pdu: bytes, send: Callable[[Reply], None], reset: Callable[[], None]) -> None:
        """Take a request: act on it and `send` what comes back now or later; `reset` breaks the connection."""
        image = self.units.get(unit)
        if image is None or not pdu:
            return
        plan, loop = self.plan, asyncio.get_running_loop()
        fault, chance = plan.next(pdu), plan.chance
        if fault is Fault.DROPPED or (fault is Fault.RESET and chance.random() < 0.5):
            if fault is Fault.RESET:
                reset()
            return
        if fault is Fault.STALLED:
            loop.call_later(plan.patience * chance.uniform(0.8, 4.0), self._stalled, unit, pdu, send)
            return
        if fault is Fault.EXCEPTION:
            code = chance.choice(EXCEPTIONS)
            if code in MAY_HAVE_ACTED and chance.random() < 0.5:
                self._act(unit, pdu)
            send(Reply(unit, exception_answer(pdu[0], code)))
            return
        if pdu[0] in WRITES:
            image.deaf = fault is Fault.DEAF
            image.offset = chance.choice((-7, 3, 11)) if fault is Fault.OWN_MIND else 0
        answer = self._act(unit, pdu)
        image.deaf, image.offset = False, 0
        for delay, reply in self._spoilt(fault, unit, answer):
            if delay:
                loop.call_later(delay, send, reply)
            else:
                send(reply)
        if fault is Fault.RESET:
            reset()
        self._answered[unit].append(answer)

    def held(self, unit: int, address: int, word: int, since: float) -> bool:
        """Whether the register held `word` at any time from `since` [s, loop time] until now."""
        if self.units[unit].words[address] == word:
            return True
        later = [change for change in self.changes if (change.unit, change.address) == (unit, address)]
        return any(before.word == word and after.at >= since for before, after in pairwise(later))

    def _act(self, unit: int, pdu: bytes) -> bytes:
        answer = self._bus.answer(unit, pdu).pdu
        assert answer is not None
        return answer

    def _stalled(self, unit: int, pdu: bytes, send: Callable[[Reply], None]) -> None:
        answer = self._act(unit, pdu)
        self._answered[unit].clear()  # an answer from before would be a lie that no master can see through
        send(Reply(unit, answer))

    def _spoilt(self, fault: Fault, unit: int, answer: bytes) -> list[tuple[float, Reply]]:
        """(delay [s], what is sent)."""
        chance, patience = self.plan.chance, self.plan.patience
        honest = Reply(unit, answer)
        match fault:
            case Fault.UNANSWERED:
                return []
            case Fault.LATE:
                return [(patience * chance.uniform(1.05, 5.0), honest)]
            case Fault.VERY_LATE:
                return [(chance.uniform(1.0, 4.0), honest)]
            case Fault.WRONG_LENGTH:
                return [(0, Reply(unit, _of_other_length(answer, chance)))]
            case Fault.WRONG_UNIT:
                return [(0, Reply(unit % 247 + 1, answer))]
            case Fault.WRONG_FUNCTION:
                return [(0, Reply(unit, bytes((chance.choice((1, 3, 4, 6, 16, 23)),)) + answer[1:]))]
            case Fault.GARBAGE:
                return [(0, Reply(unit, chance.randbytes(chance.randint(1, 60)), noise=True))]
            case Fault.TRUNCATED:
                return [(0, Reply(unit, answer, keep=chance.uniform(0.05, 0.95)))]
            case Fault.EXTRA:
                return [(0, Reply(unit, answer, tail=chance.randbytes(chance.randint(1, 12))))]
            case Fault.DUPLICATE:
                return [(0, honest), (chance.choice((0.0, 0.002, patience)), honest)]
            case Fault.RESET:
                return [(0, Reply(unit, chance.randbytes(9), noise=True)), (0.001, honest)]
            case Fault.EARLIER:
                former = list(self._answered[unit])
                if not former:
                    return [(0, honest)]
                return [(0, Reply(unit, chance.choice(former), earlier=chance.random() < 0.5))]
        return [(0, honest)]


def _of_other_length(answer: bytes, chance: Random) -> bytes:
    if answer[0] in (3, 4):
        words = answer[2:] + bytes(2) if chance.random() < 0.5 or len(answer) <= 4 else answer[2:-2]
        return bytes((answer[0], len(words))) + words
    return answer + bytes(2) if chance.random() < 0.5 else answer[:-1]


class TcpFaulty:
    """The slave on a TCP port."""

    def __init__(self, slave: Hears) -> None:
        self.slave = slave
        self.port = 0
        self._server: asyncio.Server | None = None
        self._open: set[asyncio.Transport] = set()

    async def start(self) -> None:
        """Listen on a free port of loopback; again, on the port of before."""
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(lambda: _Connection(self), "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        """Drop everybody."""
        for transport in tuple(self._open):
            transport.abort()
        if self._server is not None:
            self._server.close()
            await self._server.wait_closed()


class _Connection(asyncio.Protocol):
    def __init__(self, server: TcpFaulty) -> None:
        self.server = server
        self.transport: asyncio.Transport
        self.heard = bytearray()
        self.before = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self.server._open.add(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        self.server._open.discard(self.transport)

    def data_received(self, data: bytes) -> None:
        self.heard += data
        while len(self.heard) >= MBAP.size:
            transaction, _, length, unit = MBAP.unpack_from(self.heard)
            if len(self.heard) < 6 + length:
                return
            pdu = bytes(self.heard[MBAP.size : 6 + length])
            del self.heard[: 6 + length]
            before, self.before = self.before, transaction
            self.server.slave.hear(
                unit, pdu, lambda reply, now=transaction, then=before: self._send(reply, now, then), self._reset
            )

    def _send(self, reply: Reply, transaction: int, before: int) -> None:
        if self.transport.is_closing():
            return
        if reply.noise:
            self.transport.write(reply.pdu)
            return
        frame = MBAP.pack(before if reply.earlier else transaction, 0, len(reply.pdu) + 1, reply.unit) + reply.pdu
        self.transport.write(frame[: max(1, round(len(frame) * reply.keep))] + reply.tail)

    def _reset(self) -> None:
        self.transport.abort()


class SerialFaulty:
    """The slave on a serial line of this process; masters open its `path`."""

    def __init__(self, slave: Hears, path: str = "") -> None:
        self.slave = slave
        self.path = path
        self._line: SerialLine | None = None
        self._heard = bytearray()

    async def start(self) -> None:
        """Open it; again, under the path of before."""
        self._line = SerialLine(self.path)
        self._heard.clear()
        self.path = self._line.path
        asyncio.get_running_loop().add_reader(self._line.fileno(), self._readable)

    async def close(self) -> None:
        """Close it."""
        line, self._line = self._line, None
        if line is not None:
            asyncio.get_running_loop().remove_reader(line.fileno())
            line.close()

    def _readable(self) -> None:
        if self._line is None:
            return
        with contextlib.suppress(BlockingIOError):
            self._heard += os.read(self._line.fileno(), 4096)
        while (length := request_length(self._heard)) is not None and len(self._heard) >= length:
            request = parse_frame(bytes(self._heard[:length]))
            del self._heard[:length]
            assert request is not None, "our master sends no damaged frames"
            self.slave.hear(*request, self._send, lambda: None)

    def _send(self, reply: Reply) -> None:
        if self._line is None:
            return
        frame = reply.pdu if reply.noise else build_frame(reply.unit, reply.pdu)
        with contextlib.suppress(BlockingIOError):
            os.write(self._line.fileno(), frame[: max(1, round(len(frame) * reply.keep))] + reply.tail)
