"""What a transport is: four calls that carry one telegram at a time to the registers of a device.

A transport knows addresses and bytes; it does not know quality, priorities, retries, alarms or people. One object is one connection (one
socket, one serial line) and gets one call at a time; what waits is ordered by the link. Everything it raises is a `LinkError`.

A late answer never becomes the answer to a later request: TCP tells them apart by transaction, a serial transport (rtu.py) sends nothing
whose answer an older one could be taken for. What it waits for before a telegram belongs to the call and counts as its time on the wire.
"""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from app.errors import NoAnswer
from app.plant.definitions import Link

Exchange = Callable[[int, bytes], Awaitable[bytes | None]]
"""(unit, PDU) → the PDU that the virtual device answers, or None for silence."""


@dataclass(frozen=True, slots=True)
class Block:
    """Neighbouring registers, or bits, that one telegram reads."""

    address: int
    """First register, 0-based."""
    count: int
    """1 to 125, of bits 2000."""
    function: int = 3
    """03 holding, 04 input registers, 01 coils, 02 discrete inputs."""
    cuts: tuple[int, ...] = field(default=(), compare=False)
    """Counts of registers after which it may be read in two telegrams without tearing a value."""
    again: bool = field(default=False, compare=False)
    """Whether an older answer to the very same read may stand for a newer one that does not come: an image tells its own generation."""

    @property
    def last(self) -> int:
        """Last register."""
        return self.address + self.count - 1


@dataclass(slots=True)
class Counts:
    """What only the wire knows; all connections of a link share one object."""

    damaged: int = 0
    """Telegrams with a wrong check sum, and noise."""
    late: int = 0
    """Answers to requests that had been given up."""
    parity: int = 0
    """Characters whose parity was wrong, as far as a serial port counts them; since it was opened."""
    framing: int = 0
    """Those without a stop bit where one had to be."""
    strange: bool = False
    """Bytes were heard since a serial port was opened, and none of them was a telegram."""


class LateAnswerDue(NoAnswer):
    """Not sent: the device may still answer an earlier request, and that answer could be taken for this one's.

    `wait`: until then [s].
    """

    def __init__(self, what: str, wait: float) -> None:
        super().__init__(f"{what}: an earlier answer may still come, asked again in {wait:.1f} s")
        self.wait = wait


class Transport(Protocol):
    """One connection to devices. `patience` is the device's own time for an answer [s]; time on the wire comes on top."""

    parallel: ClassVar[bool]
    """Whether a link may open several of them to the same device (`device.connections`)."""
    counts: Counts
    """Counted by the transport; the link puts its own object here."""

    @property
    def connected(self) -> bool:
        """Whether a telegram could be sent now."""
        ...

    async def connect(self) -> None:
        """Open the connection; returns when telegrams can be carried.

        Raises:
            NotConnected: it could not be opened.
        """
        ...

    async def read(self, unit: int, block: Block, patience: float) -> list[int]:
        """Exactly `block.count` words of the device `unit`; of bits each is 0 or 1.

        Raises:
            NoAnswer: silence until the time-out.
            LateAnswerDue: nothing was sent, for the sake of an earlier answer.
            NotConnected: the connection is not there, or went while waiting.
            BadAnswer: an answer came that is not one to this request.
            DeviceException: the device refused.
        """
        ...

    async def write(self, unit: int, address: int, words: Sequence[int], patience: float, function: int = 6) -> None:
        """Write `words` from `address` on with function 06 (one word) or 16, bits with 05 (one) or 15; returns when the echo equals
        the request.

        Raises:
            NoAnswer, NotConnected, BadAnswer, DeviceException: as `read`; whether the device acted is not known then.
        """
        ...

    async def close(self) -> None:
        """Close the connection; never raises, and may be called twice."""
        ...


TransportFactory = Callable[[Link, Exchange | None], Transport]
"""Builds one unopened connection of a link."""
