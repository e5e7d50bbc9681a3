"""A line of the audit: what it says, made safe to print on one line, and which lines the log tells, too."""

import json
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass

from app import chance
from app.access.audit.kinds import Kind
from app.access.roles import SYSTEM, Person
from app.logs import security

SECURITY_KINDS = (
    "signin.", "session.", "person.", "password.", "token.", "factor.", "access.", "audit.", "backup.", "clock.", "server.",
    "plant.reloaded",
    "plant.edited",
)  # fmt: skip
"""Beginnings of the kinds of lines that the log tells as security events, too."""
GRAVE_KINDS = (
    "person.", "token.created", "factor.removed", "factor.reset", "factor.recovery", "audit.lost", "audit.foreign",
    "backup.restor", "clock.",
)  # fmt: skip
"""Of these, told as warnings whatever their result."""

LONGEST_TEXT = 500
"""Characters of a field; what is longer is cut and ends with …."""
_HIDDEN = ("password", "secret", "token", "cookie", "csrf", "sid", "hash", "code")
_TOLD = "reason_code"
"""What a device refused with: an exception, or a reason of its own."""
_BACKWARDS = {0x2028, 0x2029, *range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x200E, 0x200F, 0xFEFF}


@dataclass(frozen=True, slots=True)
class Entry:
    """What is to be written down; texts are already safe to print on one line."""

    time: int
    kind: str
    """Key under `audit.kind.` of the product texts."""
    person_id: int
    person: str
    address: str
    session: str
    """First 12 digits of the session's hash."""
    object: str
    old: str
    new: str
    result: str
    """`ok`, `refused`, `failed` or what a command became; key under `audit.result.`."""
    reason: str
    """Key of the product texts, or words of a person."""
    params: str
    """JSON object of texts for the placeholders."""


@dataclass(frozen=True, slots=True)
class Record(Entry):
    """A written line."""

    seq: int = 0

    @property
    def parameters(self) -> Mapping[str, str]:
        """`params` as a mapping of texts."""
        return {str(name): str(value) for name, value in parameters_of(self.params).items()}


def entry_at(
    time: int,
    /,
    kind: Kind,
    person: Person | None,
    object: str = "",
    old: object = "",
    new: object = "",
    result: str = "ok",
    reason: str = "",
    address: str = "",
    **params: object,
) -> Entry:
    """The line of what happened at `time` [µs UTC]; `person` None is the server itself.

    A parameter whose name sounds like a secret is not written; texts are cut, and control signs become escapes.
    """
    who = person or SYSTEM
    safe = {printable(name, 60): printable(_as_text(value)) for name, value in params.items() if not _secret(name)}
    return Entry(
        time=time,
        kind=printable(kind, 64),
        person_id=who.id,
        person=printable(who.name, 64),
        address=printable(address or who.address, 64),
        session=printable(who.session, 12) if not who.session.startswith("token-") else printable(who.session, 16),
        object=printable(object, 120),
        old=printable(_as_text(old)),
        new=printable(_as_text(new)),
        result=printable(result, 32),
        reason=printable(reason),
        params=_json(safe),
    )


def waiting_form(entry: Entry) -> dict[str, object]:
    """`entry` as it waits outside the database, with an id by which it is written once only."""
    return {"id": chance.token_hex(8), **asdict(entry)}


def of_waiting(kept: Mapping[str, object], *, marked: bool = False) -> Entry:
    """The line that waited as `kept`; `marked` names its id among the parameters.

    Raises:
        TypeError: its fields are of another version.
    """
    fields = {name: value for name, value in kept.items() if name != "id"}
    if marked:
        fields["params"] = _json({**json.loads(str(fields["params"])), "buffered": kept["id"]})
    return Entry(**fields)  # type: ignore[arg-type]


def parameters_of(text: object) -> Mapping[str, object]:
    """The parameters that a line keeps as a JSON object; none for anything else."""
    try:
        found = json.loads(text) if isinstance(text, str) else None
    except ValueError:
        found = None
    return found if isinstance(found, dict) else {}


def printable(text: object, longest: int = LONGEST_TEXT) -> str:
    """`text` on one line: control signs, line separators and signs that turn the writing direction become escapes."""
    shown = str(text)[: longest + 1]
    if not shown.isprintable():  # nearly all are, and none that is holds a sign to be escaped
        shown = "".join(map(_escaped, shown))
    return shown if len(shown) <= longest else shown[: longest - 1] + "…"


def announce(entries: Iterable[Entry]) -> None:
    """Tell the log, and with POGON_SYSLOG another machine, of lines that are about who may do what."""
    for entry in entries:
        if entry.kind.startswith(SECURITY_KINDS):
            grave = entry.result != "ok" or entry.kind.startswith(GRAVE_KINDS)
            about = {"person": entry.person, "object": entry.object, "old": entry.old, "new": entry.new}
            about |= {"result": entry.result, "reason": entry.reason, "address": entry.address}
            security(entry.kind, grave=grave, **{name: text for name, text in about.items() if text})


def _json(fields: Mapping[str, object]) -> str:
    return json.dumps(fields, ensure_ascii=False, sort_keys=True, separators=(",", ":"))


def _as_text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "1" if value else "0"
    if isinstance(value, (set, frozenset)):
        return ", ".join(sorted(map(str, value)))
    return str(value)


def _secret(name: str) -> bool:
    return name != _TOLD and any(word in name.lower().split("_") for word in _HIDDEN)


def _escaped(letter: str) -> str:
    point = ord(letter)
    if unicodedata.category(letter) in ("Cc", "Cs") or point in _BACKWARDS:
        return f"\\x{point:02x}" if point < 0x100 else f"\\u{point:04x}"
    return letter
