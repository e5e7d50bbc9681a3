"""The lines between server and virtual devices: they spoil what they carry, and know what was really sent, heard and done.

A line is in memory (the server's own simulation), or bytes: frames on TCP connections or on a serial line of the loop (`tests/wires.py`),
as slow as such a line is.
"""

import asyncio
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from typing import Any

from app.clock import Clock
from app.errors import BadAnswer
from app.registers.pdu import WRITES, exception_answer
from app.registers.rtu import build_frame, character_time, silence
from app.sim.bus import Bus, damaged
from app.sim.training import is_training
from tests.faulty import Reply, SerialFaulty, TcpFaulty

NEVER = 1e9
HONEST = ("", "doubled", "late")
"""Faults whose answer, when it comes, is true."""
BAUD = {"hall": 9600}
"""Of serial lines; PLCs have a faster one."""
FAST = 115_200
TURNAROUND = 0.004
"""Time that a device on a serial line takes for an answer [s]."""
NEAR = 0.001
"""Time that a request takes over TCP, and its answer [s]."""
FIRST_PORT = 15_020


@dataclass
class Trouble:
    """A fault of the line to some units."""

    bus: Bus
    unit: int
    fault: str
    part: float
    until: float


@dataclass(frozen=True)
class Sent:
    """A write that the server sent."""

    at: float
    unit: int
    bus: Bus
    function: int
    address: int
    words: tuple[int, ...]
    machine: str
    life: int
    """Which server."""


@dataclass
class Line:
    """Stands in for `app.sim.plant.exchange`, and for what is behind the ends of wires."""

    clock: Clock
    random: Random
    trace: Callable[[str], None]
    troubles: list[Trouble] = field(default_factory=list)
    dead: bool = False
    """The server was killed: what its rests send goes nowhere."""
    life: int = 0
    """Which server is at the other end."""
    sent: list[Sent] = field(default_factory=list)
    taken: list[Sent] = field(default_factory=list)
    """The same, of what reached a device."""
    heard: dict[tuple[int, int], float] = field(default_factory=lambda: defaultdict(lambda: -NEVER))
    """(bus, unit) → when the last honest answer to a read reached the server [s]."""
    name: Callable[[Bus, int], str] = lambda bus, unit: ""
    """The machine at a unit."""
    look: Callable[[Bus, int], Any] = lambda bus, unit: None
    """What there is to see of a unit at the moment when it answers a read; `tell` gets it when the answer has arrived."""
    tell: Callable[[Any], None] = lambda seen: None

    async def exchange(self, bus: Bus, unit: int, pdu: bytes) -> bytes | None:
        """As `app.sim.plant.exchange`, but for what is wrong with the line now."""
        if self.dead:
            await asyncio.sleep(NEVER)
        fault = self.requested(bus, unit, pdu)
        seen: list[Any] = []
        answer = await self._carry(bus, unit, pdu, fault, seen)
        self.trace(f"{self.clock.monotonic():.6f} {unit} -> {answer.hex() if answer else answer}")
        if answer is not None and fault in HONEST:
            self.arrived(bus, unit, answer, seen)
        return answer

    def requested(self, bus: Bus, unit: int, pdu: bytes) -> str:
        """The server sends a request: what will be wrong with it."""
        now, address = self.clock.monotonic(), int.from_bytes(pdu[1:3], "big")
        training = is_training(address)
        trouble = None if training else self._trouble(bus, unit, now)
        fault = trouble.fault if trouble else ""
        self.trace(f"{now:.6f} {unit} {pdu.hex()} {fault}")
        if pdu[0] in WRITES and not training:
            self.sent.append(self._write(bus, unit, pdu))
        return fault

    def _write(self, bus: Bus, unit: int, pdu: bytes) -> Sent:
        words = tuple(pdu[3:]) if pdu[0] == 6 else tuple(pdu[6:])
        paired = tuple(a << 8 | b for a, b in zip(words[::2], words[1::2], strict=False))
        address = int.from_bytes(pdu[1:3], "big")
        return Sent(self.clock.monotonic(), unit, bus, pdu[0], address, paired, self.name(bus, unit), self.life)

    def arrived(self, bus: Bus, unit: int, answer: bytes, seen: list[Any]) -> None:
        """An honest answer has reached the server."""
        if answer[0] not in WRITES and not answer[0] & 0x80:
            self.heard[id(bus), unit] = self.clock.monotonic()
            for one in seen:
                self.tell(one)

    def act(self, bus: Bus, unit: int, pdu: bytes, seen: list[Any]) -> bytes | None:
        """The device takes a request."""
        if pdu[0] not in WRITES:
            seen.append(self.look(bus, unit))
        else:
            self.taken.append(self._write(bus, unit, pdu))
        return bus.answer(unit, pdu).pdu

    async def _carry(self, bus: Bus, unit: int, pdu: bytes, fault: str, seen: list[Any]) -> bytes | None:
        if fault in ("cable", "reset"):
            return None
        if fault == "slow":  # waits in a gateway: the device is told, its answer is too late for anybody
            delay = self.random.uniform(0.1, 3.0)
            asyncio.get_running_loop().call_later(delay, self.act, bus, unit, pdu, [])
            return None
        if fault == "exception":
            return exception_answer(pdu[0], self.random.choice((1, 2, 3, 4, 6)))
        if fault == "doubled":
            bus.answer(unit, pdu)
        answer = self.act(bus, unit, pdu, seen)
        if answer is None or fault in ("", "doubled"):
            return answer
        if fault == "lost":
            return None
        if fault == "late":
            await asyncio.sleep(self.random.uniform(0.01, 3.0))
            return answer
        if fault == "garbled":
            return damaged(answer)
        if fault == "unit":
            raise BadAnswer(f"unit {unit + 1} answered: expected unit {unit}")
        if fault == "function":
            return bytes((answer[0] ^ 0x07,)) + answer[1:]
        if fault == "short":
            return answer[:-1]
        return answer + b"\0"

    def _trouble(self, bus: Bus, unit: int, now: float) -> Trouble | None:
        self.troubles = [one for one in self.troubles if one.until > now]
        for one in self.troubles:
            if one.bus is bus and one.unit == unit and self.random.random() < one.part:
                return one
        return None


@dataclass
class Wire:
    """One line of bytes: what is behind its end (`tests.faulty.Hears`)."""

    line: Line
    link: str
    number: int
    serial: bool
    bus: Callable[[], Bus | None]
    """What hangs on it now."""
    carrier: TcpFaulty | SerialFaulty = field(init=False)

    def __post_init__(self) -> None:
        self.baud = BAUD.get(self.link, FAST)
        if self.serial:
            self.carrier = SerialFaulty(self, f"/wires/storm-{self.link}")
        else:
            self.carrier = TcpFaulty(self)
            self.carrier.port = FIRST_PORT + self.number

    @property
    def toml(self) -> str:
        """What the plant file says of it."""
        if isinstance(self.carrier, SerialFaulty):
            return f'transport = "rtu"\nport = "{self.carrier.path}"\nbaud = {self.baud}'
        return f'transport = "tcp"\nhost = "127.0.0.1"\nport = {self.carrier.port}'

    def hear(self, unit: int, pdu: bytes, send: Callable[[Reply], None], reset: Callable[[], None]) -> None:
        """A request that the server sent."""
        bus = self.bus()
        if bus is None or not pdu or self.line.dead:
            return
        line, random, loop = self.line, self.line.random, asyncio.get_running_loop()
        fault = line.requested(bus, unit, pdu)
        there = self._time(len(pdu) + 3)
        if fault == "cable":
            return
        if fault == "reset" and random.random() < 0.5:
            reset()
            return
        if fault == "exception":
            refusal = exception_answer(pdu[0], random.choice((1, 2, 3, 4, 6)))
            loop.call_later(there + self._time(5), self._send, send, Reply(unit, refusal))
            return
        if fault == "slow":  # waits in a gateway
            there += random.uniform(0.1, 3.0)
        loop.call_later(there, self._act, bus, unit, pdu, fault, send, reset)

    def _act(
        self, bus: Bus, unit: int, pdu: bytes, fault: str, send: Callable[[Reply], None], reset: Callable[[], None]
    ) -> None:
        seen: list[Any] = []
        answer = self.line.act(bus, unit, pdu, seen)
        if answer is None or fault == "lost":
            return
        random, loop = self.line.random, asyncio.get_running_loop()
        back = self._time(len(answer) + 3)
        if fault == "late":
            back += random.uniform(0.01, 3.0)
        if fault in ("", "doubled", "late", "slow", "long", "reset"):
            loop.call_later(back, self.line.arrived, bus, unit, answer, seen)
        for reply in self._spoilt(fault, unit, answer):
            loop.call_later(back, self._send, send, reply)
        if fault == "reset":
            loop.call_later(back, reset)

    def _spoilt(self, fault: str, unit: int, answer: bytes) -> list[Reply]:
        random, honest = self.line.random, Reply(unit, answer)
        match fault:
            case "doubled":
                return [honest, honest]
            case "garbled" if self.serial:
                frame = build_frame(unit, answer)
                at = random.randrange(len(frame))
                return [
                    Reply(
                        unit, frame[:at] + bytes((frame[at] ^ 1 << random.randrange(8),)) + frame[at + 1 :], noise=True
                    )
                ]
            case "garbled" | "noise":
                return [Reply(unit, random.randbytes(random.randint(1, 60)), noise=True)]
            case "unit":
                return [Reply(unit % 247 + 1, answer)]
            case "function":
                return [Reply(unit, bytes((answer[0] ^ 0x07,)) + answer[1:])]
            case "short":
                return [Reply(unit, answer, keep=random.uniform(0.05, 0.95))]
            case "long":
                return [Reply(unit, answer, tail=random.randbytes(random.randint(1, 12)))]
            case "reset" if self.serial:
                return [Reply(unit, random.randbytes(9), noise=True), honest]
        return [honest]

    def _send(self, send: Callable[[Reply], None], reply: Reply) -> None:
        self.line.trace(f"{self.line.clock.monotonic():.6f} {reply.unit} -> {reply.pdu.hex()}")
        send(reply)

    def _time(self, length: int) -> float:
        """Of so many bytes [s]."""
        if not self.serial:
            return NEAR
        return length * character_time(self.baud) + silence(self.baud) / 2 + TURNAROUND / 2
