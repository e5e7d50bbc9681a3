"""The line between server and virtual devices: it spoils what it carries, and knows what was really sent, heard and done."""

import asyncio
from collections import defaultdict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

from app.clock import Clock
from app.errors import BadAnswer
from app.registers.pdu import WRITES, exception_answer
from app.sim.bus import Bus, damaged
from app.sim.training import is_training

NEVER = 1e9
HONEST = ("", "doubled", "late")
"""Faults whose answer, when it comes, is true."""


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


@dataclass
class Line:
    """Stands in for `app.sim.plant.exchange`."""

    clock: Clock
    random: Random
    trace: Callable[[str], None]
    troubles: list[Trouble] = field(default_factory=list)
    dead: bool = False
    """The server was killed: what its rests send goes nowhere."""
    sent: list[Sent] = field(default_factory=list)
    heard: dict[tuple[int, int], float] = field(default_factory=lambda: defaultdict(lambda: -NEVER))
    """(bus, unit) → when the last honest answer to a read reached the server [s]."""
    listeners: list[Callable[[Bus, int, bytes], None]] = field(default_factory=list)
    """Called with every read that was answered honestly, at that moment."""
    latest: deque[str] = field(default_factory=lambda: deque(maxlen=40))

    async def exchange(self, bus: Bus, unit: int, pdu: bytes) -> bytes | None:
        """As `app.sim.plant.exchange`, but for what is wrong with the line now."""
        if self.dead:
            await asyncio.sleep(NEVER)
        now, address = self.clock.monotonic(), int.from_bytes(pdu[1:3], "big")
        training = is_training(address)
        trouble = None if training else self._trouble(bus, unit, now)
        fault = trouble.fault if trouble else ""
        self.trace(f"{now:.6f} {unit} {pdu.hex()} {fault}")
        if pdu[0] in WRITES and not training:
            words = tuple(pdu[3:]) if pdu[0] == 6 else tuple(pdu[6:])
            paired = tuple(a << 8 | b for a, b in zip(words[::2], words[1::2], strict=False))
            self.sent.append(Sent(now, unit, bus, pdu[0], address, paired))
        answer = await self._carry(bus, unit, pdu, fault)
        self.trace(f"{self.clock.monotonic():.6f} {unit} -> {answer.hex() if answer else answer}")
        if answer is not None and fault in HONEST and pdu[0] not in WRITES and not answer[0] & 0x80:
            self.heard[id(bus), unit] = self.clock.monotonic()
            for listener in self.listeners:
                listener(bus, unit, pdu)
        return answer

    async def _carry(self, bus: Bus, unit: int, pdu: bytes, fault: str) -> bytes | None:
        if fault == "cable":
            return None
        if fault == "slow":  # waits in a gateway: the device is told, its answer is too late for anybody
            delay = self.random.uniform(0.1, 3.0)
            asyncio.get_running_loop().call_later(delay, bus.answer, unit, pdu)
            return None
        if fault == "exception":
            return exception_answer(pdu[0], self.random.choice((1, 2, 3, 4, 6)))
        if fault == "doubled":
            bus.answer(unit, pdu)
        answer = bus.answer(unit, pdu).pdu
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
