"""What cares for a unit beside its plain registers: our PLC map is one such service, a drive's parameter mailbox is another.

A unit has a list of them, made of what its type says (`Device.services`). A new kind is one file here and one row in `KINDS` (outages.py).
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import Protocol

from app.links.scan_block import ScanBlock
from app.plant.definitions import Register

SetWrite = tuple[str, Register, Sequence[int]]
"""(name of the point, its register, its words)."""


class Seen(IntEnum):
    """What a block is worth that a service has looked at."""

    WHOLE = 0
    PARTLY = 1
    """The torn rows were made what they were before."""
    TORN = 2
    NOTHING = 3
    """Not to be published."""


class Service(Protocol):
    """One service of one unit."""

    async def identify(self) -> bool:
        """Whether the unit is the device of the plant file, as far as this service can tell.

        Raises:
            NoAnswer: it did not say.
        """
        ...

    def begin(self) -> None:
        """The unit is there, and is the right one."""
        ...

    def adopt(self, before: "Service") -> None:
        """The plant file has changed around the same device: go on where `before`, of the same kind, was."""
        ...

    async def end(self) -> None:
        """The link ends."""
        ...

    def reads(self, block: ScanBlock) -> bool:
        """Whether what is read of `block` goes through `seen` before it is published."""
        ...

    def seen(self, block: ScanBlock, words: list[int], started: float) -> Seen:
        """What `words`, read by a telegram sent at `started` [s], are worth; they may be put right."""
        ...

    def worth_reading(self, blocks: Sequence[ScanBlock]) -> list[ScanBlock]:
        """`blocks`, with what stands for those that need not be read."""
        ...

    def takes(self, register: Register) -> bool:
        """Whether a write to `register` goes through this service: those that it takes, it takes all or none."""
        ...

    async def write(self, writes: Sequence[SetWrite]) -> int:
        """Have the device take `writes` as a whole; returns when they are in effect, the id by which the device knows that (0: none).

        Raises:
            Rejected: the device takes none of it, with its reason; nothing has changed.
            LinkError: it did not arrive, or nobody knows (NoAnswer).
        """
        ...
