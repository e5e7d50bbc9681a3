"""What the gate handles: an order as it came, the task it becomes when every check is passed, what it needs of links and the audit."""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from app.access.audit.kinds import Kind
from app.access.roles import Person
from app.commands.value_set import Change
from app.errors import Refused
from app.registers.plc_map import Answer
from app.tags.batch import Value


class Writer(Protocol):
    """What the gate needs of a link."""

    @property
    def simulated(self) -> bool:
        """Whether nothing real is behind it."""
        ...

    @property
    def paused(self) -> bool:
        """Whether what is behind it is simulated, and paused."""
        ...

    async def write(self, equipment: str, point: str, value: float, *, urgent: bool = False) -> int:
        """Write `value` [EU]; returns when the echo was checked. Urgent goes before everything that waits.

        What comes back is the id by which the device knows this write in its own records; 0: it has none.

        Raises:
            LinkError: no valid answer; DeviceException: the device refused; Overtaken: never sent.
        """
        ...

    def together(self, equipment: str, points: Sequence[str]) -> list[list[str]]:
        """`points` in the groups that the device takes all or none.

        Raises:
            LinkError: no such machine or point.
        """
        ...

    async def write_set(self, equipment: str, values: Mapping[str, float]) -> int:
        """Write the values [EU] of one group; returns when the device has taken all of them, the same as `write`.

        Raises:
            LinkError: as `write`; Rejected: the device took none.
        """
        ...

    async def refresh(self, equipment: str, points: Sequence[str]) -> None:
        """Read `points` now and publish them.

        Raises:
            LinkError: they could not be read.
        """
        ...


class MapWriter(Writer, Protocol):
    """What the gate needs besides of a link to a Pogon PLC (registers/plc_map.py)."""

    async def order(
        self,
        equipment: str,
        code: int,
        arguments: Sequence[int] = (),
        *,
        expected: int = 0,
        owner: int = 0,
        request: int = 0,
        urgent: bool = False,
    ) -> Answer:
        """Send one command with up to four raw 32-bit arguments; its first answer, within 1 s. `expected`: state that the device must
        be in, 0 = any; `request` 0: the link takes a fresh id.

        Raises:
            NoAnswer: nobody knows; LinkError itself: it did not arrive; DeviceException: the device refused the telegram; Overtaken.
        """
        ...

    async def answer(self, equipment: str, id: int) -> Answer | None:
        """What the device says now about the command `id`; None when it no longer remembers.

        Raises:
            LinkError: not read.
        """
        ...

    async def hold(
        self, equipment: str, bits: int, counter: int, argument: float = 0.0, *, urgent: bool = False
    ) -> None:
        """Write the request of a hold-to-run; returns when the echo was checked.

        Raises:
            LinkError: no valid answer.
        """
        ...


@dataclass(frozen=True, slots=True)
class AuditLine:
    """One line of the audit trail."""

    kind: Kind
    person: Person | None
    """None: the server itself."""
    object: str
    """`equipment.command`, or a machine."""
    old: Value
    new: Value
    result: str
    """A state of a command, or what became of the control of a machine."""
    reason: str = ""
    """A text key."""
    params: Mapping[str, Any] = field(default_factory=dict)
    address: str = ""


Audit = Callable[[AuditLine], Any]
"""Takes one line; called without waiting, a coroutine is run."""
Foretell = Callable[[AuditLine], Awaitable[bool]]
"""Takes one line before what it tells is done: true when it is on the disk, false when it can be written nowhere."""


async def foretell_nothing(line: AuditLine) -> bool:
    """For a gate whose commands are only written down with their outcome."""
    return True


LONGEST_REASON = 300
"""A reason has at most so many characters: it stands in lists and in the audit trail, and is a sentence."""


class Question(Refused):
    """The gate asks back before it acts: confirm, give a reason, enter the password. Nothing was done, nothing is in the audit trail."""


@dataclass(frozen=True, slots=True)
class Order:
    """What a person asks, as it came."""

    person: Person | None
    equipment: str
    key: str
    """Command or setpoint."""
    argument: str | float | None
    id: str
    nonce: str
    expected: float | None
    confirmed: bool
    proven: bool
    reason: str
    address: str
    language: str
    asked: int
    """[µs UTC]"""
    arguments: Mapping[str, str | float] = field(default_factory=dict)
    """Name → value, of a command that takes several, and of a set of setpoints."""
    seen: Mapping[str, float] = field(default_factory=dict)
    """What the person saw the setpoints of a set at [EU]."""


@dataclass(frozen=True, slots=True)
class Task:
    """An order that passed every check."""

    telegrams: tuple[tuple[str, float], ...]
    argument: float | None
    old: Value
    limit: float
    level: str
    arguments: Mapping[str, float] = field(default_factory=dict)
    words: tuple[int, ...] = ()
    """The arguments as they are sent."""
    expected: int = 0
    """State of the device as it was seen; 0 = any."""
    changes: tuple[Change, ...] = ()
    """Of a set of setpoints."""
    steps: tuple[tuple[str, ...], ...] = ()
    """Of a set of setpoints: what the device takes at once, in the order in which it is written."""
