"""Every error that is ours.

    PogonError
    ├── ConfigurationError   a plant folder, a setting or a file is wrong: names file, key, value and what was expected
    │   └── UnusableFile     a file that cannot be read as what it should be
    │       └── MissingFile  it is not there
    ├── LinkError            a device or its line did not do what was asked
    │   ├── NoAnswer         silence until the time-out
    │   ├── NotConnected     the line or the socket is not there
    │   ├── BadAnswer        an answer came and is not one to this request (length, unit, function, check sum)
    │   │   └── HungUp       instead of it the device closed the connection, as it did before
    │   ├── DeviceException  the device answered with a Modbus exception code
    │   ├── Overtaken        a write that was never sent, because a Stop came before it
    │   ├── Withdrawn        a write that was never sent, because whoever asked for it may no more
    │   ├── NotTaken         what the device has not taken at all: the telegram that counts was never sent
    │   ├── Rejected         the device understood and did not take it, with its own reason
    │   └── MailboxRefused   the parameter mailbox of a drive did not take a request as such, with its own error number
    ├── TelegramError        bytes or words that are no telegram of a drive, or values that cannot become one
    ├── Refused              a command that was not carried out, with the reason the operator sees
    └── StorageError         a database or a disk did not take what was given

A message names the thing, the value and what was expected.
"""

from collections.abc import Mapping
from pathlib import Path


class PogonError(Exception):
    """Anything that Pogon itself raises."""


class ConfigurationError(PogonError):
    """A file or a setting that cannot be used."""


class UnusableFile(ConfigurationError):
    """A file that cannot be read as what it should be: `found` in place of `expected`, at `line` (from 1) of a text."""

    def __init__(self, path: Path, found: str, expected: str, line: int | None = None) -> None:
        super().__init__(f"{path}{f':{line}' if line else ''}: {found}, expected {expected}")
        self.found = found
        self.expected = expected
        self.line = line


class MissingFile(UnusableFile):
    """A file that is not there."""


class LinkError(PogonError):
    """A device or its line did not do what was asked. `kind` is a key under `link.error.` of the product texts."""

    kind = "failed"


class NoAnswer(LinkError):
    """Silence until the time-out."""

    kind = "no_answer"
    request = 0
    """Id of the command of which nobody knows what became; 0 = it was none."""
    instead = ""
    """What came that was no answer, in words; empty = nothing."""


class NotConnected(LinkError):
    """The line or the socket is not there."""

    kind = "not_connected"


class BadAnswer(LinkError):
    """An answer that does not belong to the request."""

    kind = "bad_answer"


class HungUp(BadAnswer):
    """The device closed the connection instead of answering, as it did before; another one is open."""

    kind = "hung_up"


EXCEPTION_NAMES: Mapping[int, str] = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "server device failure",
    5: "acknowledge",
    6: "server device busy",
    7: "negative acknowledge",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target failed to respond",
}
"""Modbus exception codes by name (reference/modbus.md section 2)."""
GATEWAY = (10, 11)
"""Codes of a gateway that speaks in the place of a unit which it does not reach, or which did not answer it."""
MAY_HAVE_ACTED = (5, 11)
"""Refusals of a write that do not say that nothing happened: "accepted, it will take a while", and a gateway that lost the answer."""


class DeviceException(LinkError):
    """The device answered with Modbus exception `code`."""

    kind = "exception"

    def __init__(self, code: int, what: str = "") -> None:
        name = EXCEPTION_NAMES.get(code, "unknown exception")
        super().__init__(f"{what + ': ' if what else ''}exception {code:02d} {name}")
        self.code = code


class Overtaken(LinkError):
    """A write that was never sent, because a Stop to the same device came before it."""

    kind = "overtaken"


class Withdrawn(LinkError):
    """A write that was never sent, because whoever asked for it may no more."""

    kind = "withdrawn"


class NotTaken(LinkError):
    """What was never written: a set whose word that makes it valid was not sent, or bits of a word whose others could not be read."""

    kind = "failed"


class Rejected(LinkError):
    """The device understood a command and did not carry it out. `reason` is its own code, a key of the type's `reasons`."""

    kind = "rejected"

    def __init__(self, what: str, reason: int, detail: int = 0, state: str = "rejected") -> None:
        super().__init__(f"{what}: {state} by the device, reason {reason}" + (f" ({detail})" if detail else ""))
        self.reason = reason
        self.detail = detail
        self.state = state


class MailboxRefused(LinkError):
    """The parameter mailbox of a drive did not take a request as such; `number` is its own error (profidrive/parameter_access)."""

    kind = "rejected"

    def __init__(self, what: str, number: int) -> None:
        super().__init__(f"{what}: the parameter mailbox took no request, error {number:04X}")
        self.number = number


class TelegramError(PogonError):
    """What is no telegram, or cannot become one: at `place` there is `found` instead of `expected`.

    `refusal`: error number by which a device refuses such a request, if there is one.
    """

    def __init__(self, place: str, found: str, expected: str, refusal: int | None = None) -> None:
        super().__init__(f"{place}: {found}, expected {expected}")
        self.place = place
        self.found = found
        self.expected = expected
        self.refusal = refusal


class Refused(PogonError):
    """A command that was not carried out.

    `reason` is a key of the product texts (or, with a dot and an equipment type in front, of the type's), `params` fill its
    placeholders, `status` is the HTTP status for it.
    """

    def __init__(self, reason: str, status: int = 409, **params: object) -> None:
        super().__init__(f"{reason} {params}" if params else reason)
        self.reason = reason
        self.status = status
        self.params = params


class StorageError(PogonError):
    """A database or a disk did not take what was given."""
