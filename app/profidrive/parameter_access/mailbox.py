"""The DS47 window of a drive's Modbus map: 122 registers in which one parameter request lies, and then its answer.

    word 0   1 = do it, or it is being done; 2 = done; 0 = values only
    word 1   0x2F00 | length of request or answer [bytes]; 0x2F00 = no answer, word 2 tells why
    word 2 … request or answer, at most 240 bytes

Source: reference/sinamics-modbus.md section 5, its worked examples included.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from app.errors import TelegramError
from app.profidrive.parameter_access.error_numbers import MailboxError
from app.profidrive.parameter_access.messages import LONGEST

HEAD = 2
"""Words before the data."""
WORDS = HEAD + LONGEST // 2
LOOK = HEAD + 1
"""Words that tell how far a request is."""
FUNCTION = 0x2F


class Control(IntEnum):
    """Word 0."""

    IDLE = 0
    ACTIVE = 1
    DONE = 2


@dataclass(frozen=True, slots=True)
class Look:
    """What the first three words say."""

    done: bool
    """Whether there is an answer, or an error instead of one."""
    length: int = 0
    """Of the answer [bytes]."""
    reference: int = 0
    """Of the request that it answers."""
    error: int = 0
    """Why there is no answer (`MailboxError`), 0 = there is one."""
    idle: bool = False
    """Whether there is no request either."""


def request_words(data: bytes) -> tuple[int, ...]:
    """What is written, in one telegram, to have `data` done.

    Raises:
        TelegramError: it is empty, longer than 240 bytes or of odd length.
    """
    _check_length(len(data), "request")
    return (Control.ACTIVE, FUNCTION << 8 | len(data), *words_of(data))


def look(words: Sequence[int]) -> Look:
    """How far the request is, by at least the first three words; one that nobody activated is not done.

    Raises:
        TelegramError: they are not those of a window.
    """
    if len(words) < LOOK:
        raise TelegramError("mailbox", f"{len(words)} words", f"at least {LOOK}")
    control, head, first = words[:LOOK]
    if control not in tuple(Control):
        raise TelegramError("mailbox, word 0", str(control), "0, 1 or 2")
    if head >> 8 != FUNCTION:
        raise TelegramError("mailbox, word 1", f"0x{head:04X}", f"0x{FUNCTION:02X} in its high byte")
    if control != Control.DONE:
        return Look(False, idle=control == Control.IDLE)
    length = head & 0xFF
    if not length:
        return Look(first != MailboxError.NOT_READY, error=first)
    _check_length(length, "mailbox, word 1")
    return Look(True, length, first >> 8)


def data_of(words: Sequence[int], length: int) -> bytes:
    """The `length` bytes behind the head.

    Raises:
        TelegramError: so many are not there.
    """
    data = b"".join((word & 0xFFFF).to_bytes(2, "big") for word in words[HEAD:])
    if len(data) < length:
        raise TelegramError("mailbox", f"{len(data)} bytes", str(length))
    return data[:length]


def words_of(data: bytes) -> tuple[int, ...]:
    """Bytes of even number as words."""
    return tuple(int.from_bytes(data[at : at + 2], "big") for at in range(0, len(data), 2))


def _check_length(length: int, place: str) -> None:
    if length % 2 or not 0 < length <= LONGEST:
        raise TelegramError(place, f"{length} bytes", f"an even number of 2 to {LONGEST}")
