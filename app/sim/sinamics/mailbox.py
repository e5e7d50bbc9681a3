"""The DS47 mailbox of the virtual drive, 40601 to 40722: one request at a time, done after a while.

What no source tells: a request that comes while another is being done takes its place, and the other one is never done.

Source: reference/sinamics-modbus.md sections 5 and 7.
"""

from collections.abc import Callable, Sequence
from enum import IntEnum

from app.errors import TelegramError
from app.profidrive.parameter_access.error_numbers import ErrorNumber, MailboxError
from app.profidrive.parameter_access.mailbox import FUNCTION, HEAD, WORDS, Control, data_of, words_of
from app.profidrive.parameter_access.messages import (
    HEADER,
    LONGEST,
    MOST_PARAMETERS,
    NEGATIVE,
    Failed,
    Request,
    Result,
    answered,
    decode_request,
    encode_answer,
    encode_result,
)

DELAY = 0.03
"""From the request to its answer [s]; assumed."""
ERROR_BLOCK = 6

Serve = Callable[[Request], Sequence[Result]]
"""What the drive does with a request: one result per parameter."""


class MailboxFault(IntEnum):
    """What the instructor has done to the mailbox (training register 0xE028)."""

    NONE = 0
    LATE = 1
    """Answers after two seconds."""
    BUSY = 2
    """Says that it cannot now (0002), and does nothing."""
    FOREIGN = 3
    """Holds the answer to somebody else's request."""
    WRONG_LENGTH = 4
    """Says that the answer is two bytes longer than it is."""
    INTERNAL = 5
    """Internal error (0005)."""
    NEVER = 6
    """Never gets ready."""
    UNREACHED = 7
    """Of a PLC between (gateway.py), as those below: it does not reach the drive. Without one all three are like `NEVER`."""
    UNANSWERED = 8
    """The drive takes requests, and its answers do not arrive."""
    RESTART = 9
    """The PLC restarts whenever a request is on its way."""


LATE = 2.0
"""[s]"""


class Mailbox:
    """The window and what is being done for it."""

    def __init__(self, serve: Serve) -> None:
        self._serve = serve
        self.words = [0] * WORDS
        """As they are read."""
        self._request: tuple[int, ...] = ()
        self._left = 0.0
        self._begun = False

    def write(self, offset: int, words: Sequence[int]) -> None:
        """Take `words` from `offset` on; a request that they activate is begun with the next step."""
        self.words[offset : offset + len(words)] = words
        if offset == 0:
            self._begun = False
            if words[0] == Control.ACTIVE:
                self._request = tuple(self.words)
                self.words[1 : HEAD + 1] = FUNCTION << 8, MailboxError.NOT_READY
            else:
                self._request = ()

    def step(self, dt: float, fault: int) -> None:
        """One step of `dt` [s]: what is due is done."""
        if not self._request or fault >= MailboxFault.NEVER:
            return
        if not self._begun:
            self._begun, self._left = True, LATE if fault == MailboxFault.LATE else DELAY
        self._left -= dt
        if self._left > dt / 2:
            return
        request, self._request = self._request, ()
        if fault in (MailboxFault.BUSY, MailboxFault.INTERNAL):
            said = MailboxError.INVALID_STATE if fault == MailboxFault.BUSY else MailboxError.INTERNAL
            self._put(b"", said)
            return
        data, error = self._done(request)
        if fault == MailboxFault.FOREIGN and data:
            data = bytes((data[0] % 255 + 1,)) + data[1:]
        self._put(data, error)
        if fault == MailboxFault.WRONG_LENGTH and data:
            self.words[1] = FUNCTION << 8 | min(len(data) + 2, LONGEST)

    def _put(self, data: bytes, error: int) -> None:
        rest = words_of(data) if data else (error,)
        words = (Control.DONE, FUNCTION << 8 | len(data), *rest)
        self.words = [*words, *(0,) * (WORDS - len(words))]

    def _done(self, words: Sequence[int]) -> tuple[bytes, int]:
        """(answer, 0), or (nothing, why there is none)."""
        length = words[1] & 0xFF
        if words[1] >> 8 != FUNCTION:
            return b"", MailboxError.INVALID_FUNCTION
        if length % 2 or not HEADER <= length <= LONGEST:
            return b"", MailboxError.INVALID_LENGTH
        data = data_of(words, length)
        try:
            request = decode_request(data)
        except TelegramError as error:
            if error.refusal is None:
                return b"", MailboxError.INVALID_LENGTH
            return refused(data, error.refusal), 0
        return encode_answer(answered(request, fitting(self._serve(request)))), 0


def refused(data: bytes, number: int) -> bytes:
    """The answer to what is a request by its length only: every parameter that it counts with error `number`."""
    count = min(max(data[3], 1), MOST_PARAMETERS)
    error = encode_result(Failed(number))
    return bytes((data[0], data[1] | NEGATIVE, data[2], count)) + error * count


def fitting(results: Sequence[Result]) -> list[Result]:
    """`results`, with error 0x15 for those that an answer of 240 bytes has no room for."""
    room = LONGEST - HEADER - ERROR_BLOCK * len(results)
    found: list[Result] = []
    for result in results:
        more = max(0, _length(result) - ERROR_BLOCK)
        found.append(result if more <= room else Failed(ErrorNumber.ANSWER_TOO_LONG))
        room -= more if more <= room else 0
    return found


def _length(result: Result) -> int:
    try:
        return len(encode_result(result))
    except TelegramError:  # more values than a block can count
        return LONGEST + 1
