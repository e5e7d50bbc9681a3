"""The parameters of a drive without Modbus through a PLC: a mailbox among its registers, records on its fieldbus.

The mailbox has the layout of DS47 (profidrive/parameter_access/mailbox.py), so whoever asks a drive directly asks a PLC in the same way. A
request is sent as one record (WRREC) and its answer fetched as another (RDREC), again and again while the drive has none. In
structured text it is `PogonGateway` (docs/plc, docs/gateway.md); both do the same scan for scan.

    inputs of a scan       what the PLC's two system blocks say
    outputs of a scan      which of them is to run

Source: the proxy blocks of the thesis on drive parameters (reference/theses-facts.md section 4, reference/sinamics-modbus.md section 5);
errors 6 and 7 are ours: a drive's own mailbox has no fieldbus behind it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from app.profidrive.parameter_access.error_numbers import MailboxError
from app.profidrive.parameter_access.mailbox import FUNCTION, HEAD, WORDS, Control
from app.profidrive.parameter_access.messages import LONGEST

TRIES = 100
"""So often an answer that is not there yet is asked for, as in the thesis."""
NO_ANSWER = FUNCTION << 8
SHORTEST = 4
"""Bytes of a request that names nothing."""


class Doing(IntEnum):
    """What the block waits for."""

    NOTHING = 0
    WRITING = 1
    READING = 2
    PAUSE = 3
    """One scan in which no block runs, so that the next one sees an edge."""


@dataclass(frozen=True, slots=True)
class Bus:
    """What the system blocks say in this scan; nothing while they are busy."""

    write_done: bool = False
    write_error: bool = False
    write_refused: bool = False
    """Together with `write_error`: the drive is at somebody else's request (0xDF80B500)."""
    read_done: bool = False
    read_error: bool = False
    not_ready: bool = False
    """Together with `read_error`: the answer is not there yet (0xDE80B500)."""
    answer: Sequence[int] = ()
    """Words of the record that was read."""
    length: int = 0
    """[bytes]"""


@dataclass(frozen=True, slots=True)
class Records:
    """Which block is to run."""

    write: bool = False
    read: bool = False


class ParameterGateway:
    """The mailbox of one drive behind one PLC."""

    def __init__(self) -> None:
        self.window = [0] * WORDS
        """The registers. Whoever asks writes into them between two scans."""
        self.record: tuple[int, ...] = ()
        """Words of the request that is written."""
        self.length = 0
        """[bytes]"""
        self._doing = Doing.NOTHING
        self._tries = 0
        self._started = False

    def scan(self, bus: Bus) -> Records:
        """One scan of the PLC."""
        if not self._started:  # whoever waited sees that its request is gone
            self._started, self._doing = True, Doing.NOTHING
            self.window[:HEAD] = Control.IDLE, NO_ANSWER
        if self._doing is Doing.PAUSE:
            self._doing = Doing.READING
        elif self._doing is Doing.WRITING:
            self._written(bus)
        elif self._doing is Doing.READING:
            self._read(bus)
        if self._doing is Doing.NOTHING and self._asked:
            self._take()
        return Records(self._doing is Doing.WRITING, self._doing is Doing.READING)

    @property
    def _asked(self) -> bool:
        """Whether a request lies there that was not taken."""
        return self.window[0] == Control.ACTIVE and self.window[1] != NO_ANSWER

    @property
    def _waited_for(self) -> bool:
        """Whether the one that was taken is still what lies there."""
        return self.window[0] == Control.ACTIVE and self.window[1] == NO_ANSWER

    def _take(self) -> None:
        head = self.window[1]
        length = head & 0xFF
        if head >> 8 != FUNCTION:
            self._say(MailboxError.INVALID_FUNCTION)
        elif length % 2 or not SHORTEST <= length <= LONGEST:
            self._say(MailboxError.INVALID_LENGTH)
        else:
            self.record, self.length = tuple(self.window[HEAD : HEAD + length // 2]), length
            self.window[1 : HEAD + 1] = NO_ANSWER, MailboxError.NOT_READY
            self._doing, self._tries = Doing.WRITING, 0

    def _written(self, bus: Bus) -> None:
        if bus.write_done:
            self._doing = Doing.READING if self._waited_for else Doing.NOTHING
        elif bus.write_error:
            self._doing = Doing.NOTHING
            if self._waited_for:
                self._say(MailboxError.INVALID_STATE if bus.write_refused else MailboxError.UNREACHED)

    def _read(self, bus: Bus) -> None:
        if bus.read_done:
            self._doing = Doing.NOTHING
            if self._waited_for:
                self._answer(bus)
        elif bus.read_error and bus.not_ready and self._tries < TRIES:
            self._tries += 1
            self._doing = Doing.PAUSE
        elif bus.read_error:
            self._doing = Doing.NOTHING
            if self._waited_for:
                self._say(MailboxError.UNANSWERED)

    def _answer(self, bus: Bus) -> None:
        count = min((bus.length + 1) // 2, WORDS - HEAD)
        self.window[HEAD : HEAD + count] = [*bus.answer, *(0,) * count][:count]
        self.window[1] = NO_ANSWER | min(bus.length, LONGEST)
        self.window[0] = Control.DONE

    def _say(self, error: MailboxError) -> None:
        self.window[: HEAD + 1] = Control.DONE, NO_ANSWER, error
