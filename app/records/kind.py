"""A kind of record, as records.toml of an equipment type declares it: what begins, ends and fills it, and how it is shown.

Which events make a record is data; what these words cannot say is a function of the type's own `records.py`, found by its name:
`<kind>_number`, `<kind>_belongs`, `<kind>_fold`, `<kind>_detail`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from app.records.record import OPEN, UNKNOWN, Names, Reading, Record


class Belongs(StrEnum):
    """Where an event belongs."""

    HERE = "here"
    """To the newest record of its number."""
    SEEN = "seen"
    """To another record, which it begins."""
    UNSEEN = "unseen"
    """To another record, whose beginning was not seen."""
    NOWHERE = "nowhere"


class Verb(StrEnum):
    """What an event does to a field."""

    SET = "set"
    FIRST = "first"
    """Set it, unless it is set."""
    COUNT = "count"
    SUM = "sum"
    LARGEST = "largest"
    SMALLEST = "smallest"


class Type(StrEnum):
    """What a field holds."""

    NUMBER = "number"
    TIME = "time"
    """[µs UTC]"""
    WORD = "word"
    """A key whose text the type has: `record.<kind>.<field>.<key>`."""
    NAME = "name"
    """A key of the definition kept with the record, shown as its label."""
    IDENTITY = "identity"
    """A number that counts nothing: of an order, of a class."""
    PART = "part"
    """Number of a part, shown with its name."""
    PERSON = "person"
    """Who asked for the last of some of its events; it is read from these."""


@dataclass(frozen=True, slots=True)
class When:
    """Which events are meant."""

    codes: frozenset[int]
    source: int | None = None
    value: float | None = None

    def fits(self, event: Reading) -> bool:
        """Whether `event` is one of them."""
        return (
            event.code in self.codes
            and (self.source is None or event.source == self.source)
            and (self.value is None or event.value == self.value)
        )


@dataclass(frozen=True, slots=True)
class Rule:
    """What some events do to a field."""

    verb: Verb
    when: When
    of: str = ""
    """`value`, `source`, `time`, or a word of the snapshot; nothing happens when it says nothing. Empty: just that it happened."""
    amount: bool = False
    """Without its sign."""
    above: float | None = None
    """Only what is greater."""


@dataclass(frozen=True, slots=True)
class Field:
    """Something a record of a kind says."""

    name: str
    type: Type = Type.NUMBER
    rules: Sequence[Rule] = ()
    unit: str = ""
    decimals: int = 0
    initial: float | None = None
    overlapping: str = ""
    """Counts records of this kind of the same machine that are under way at any time of the record."""
    people: When | None = None
    """Of a person: the events that somebody asked for; None: any."""
    words: Sequence[str] = ()
    """All that a field of the type word can hold."""
    badge: str = ""
    """Sign beside the outcome when it is not 0: `record.<kind>.badge.<field>` says what it means."""


@dataclass(frozen=True, slots=True)
class End:
    """Events that end a record."""

    outcome: str
    when: When
    after: frozenset[str] = frozenset((OPEN,))
    """Outcomes that it replaces."""
    seconds: str = "elapsed"
    """`elapsed`, `value` (as the event says), `unknown`."""
    part: str = ""
    """State of the part that was active."""


@dataclass(frozen=True, slots=True)
class Order:
    """Records that leave in the order in which they came: one that came before, and of which events were lost, has left unseen."""

    begun: frozenset[int]
    ended: frozenset[int]


@dataclass(frozen=True, slots=True)
class Parts:
    """Events that begin and end a part; its number is the source."""

    begin: frozenset[int]
    end: frozenset[int]
    named: str = ""
    """Enumeration whose texts name the parts by their numbers; empty: what the machine is configured to do names them."""
    together: bool = False
    """Whether several may be under way at once, and one may come again; its seconds are those of all its passages."""


@dataclass(frozen=True, slots=True)
class Pause:
    """Events that begin and end a pause."""

    begin: frozenset[int]
    end: frozenset[int]


@dataclass(frozen=True, slots=True)
class Column:
    """One column of the CSV."""

    name: str
    of: str
    """A field, or one of `SOURCES`."""


@dataclass(frozen=True, slots=True)
class Repeat:
    """Columns that come again: for each part, or for each source of some events."""

    columns: Sequence[Column]
    """Their names have `{n}`; `time`, `value` and `seconds` are what they can be of."""
    events: frozenset[int] = frozenset()
    """The first of these with the source n; empty: parts."""
    value: frozenset[int] = frozenset()
    """Of these events the value counts."""
    points: str = ""
    """So many as the machine has points whose key begins so."""
    usual: int = 0
    """When no machine says."""
    most: int = 200


@dataclass(frozen=True, slots=True)
class Filter:
    """Something one can ask for."""

    name: str
    of: str
    """A field, or one of `SOURCES`."""
    how: str
    """`is`, `above`, `any` (it is not empty or zero), `choice` (of the values that there are), `alarm`."""


@dataclass(frozen=True, slots=True)
class Shown:
    """How some events are shown among those of a record."""

    events: frozenset[int]
    unit: str = ""
    """Of the value; empty: it is not shown, s: as a duration."""
    decimals: int = 0
    signed: bool = False
    source: str = ""
    """What stands before the number of the source; empty: that is not shown."""


@dataclass(frozen=True, slots=True)
class Hooks:
    """What a type's own Python says of a kind."""

    number: Callable[[Reading], int | None] | None = None
    belongs: Callable[[Record | None, Reading], Belongs | None] | None = None
    """None: as the words of records.toml say."""
    fold: Callable[[Record, Record, Reading, Names], None] | None = None
    """Change the new record, made of the former one by everything that records.toml says."""
    detail: Callable[..., Mapping[str, Any]] | None = None
    """What the kind's own template shows beyond the record."""


SOURCES = (
    "begun.utc", "begun.local", "ended.utc", "ended.local", "equipment", "number", "outcome", "duration", "seconds", "paused", "missed",
    "alarms", "definition", "person", "reason",
)  # fmt: skip
"""What a column may show beside the fields: times, the machine, its number, … `person` and `reason` are of its last event that somebody
asked for."""


@dataclass(frozen=True, slots=True)
class RecordKind:
    """A kind of record."""

    name: str
    begin: frozenset[int]
    number: str = ""
    """Word of the snapshot that says which one; empty: one at a time."""
    only: frozenset[int] | None = None
    """No other events are of such a record; None: all that name it."""
    implied: frozenset[int] | None = frozenset()
    """These begin one, too, when none is known: its beginning was not seen; None: whatever names it."""
    found: frozenset[int] = frozenset()
    """Of these it counts as the beginning that they were seen."""
    also: str = ""
    """Word that names another record to which an event belongs, of `shared`."""
    shared: frozenset[int] = frozenset()
    late: float = 0.0
    """An event so long after the end still belongs to it [s]."""
    ends: Sequence[End] = ()
    oldest: frozenset[int] = frozenset()
    """These are about the oldest that is under way: things pass one after the other, and the next begins before the last has ended."""
    restart: frozenset[int] = frozenset()
    """With these a machine that was switched on says itself what became of it, even where its ring begins anew."""
    displaced: str = UNKNOWN
    """Outcome of one that was under way when another of its number began."""
    reopen: Mapping[str, frozenset[int]] = field(default_factory=dict)
    """Outcome → events that prove it wrong."""
    order: Order | None = None
    lasts: str = ""
    """What the first event says, as `Rule.of`: so long it lasts, unless an event ends it before [s]."""
    expired: str = UNKNOWN
    """Outcome of one whose time was over."""
    forgotten: str = ""
    """Outcome of one that still lasted when its machine began anew and knows nothing of it; empty: it lasts as long as was said."""
    parts: Parts | None = None
    pause: Pause | None = None
    alarms: bool = False
    """Whether its alarms are noted."""
    definition: bool = False
    """Whether what the machine is configured to do is kept with it."""
    fields: Mapping[str, Field] = field(default_factory=dict)
    key: str = ""
    """Field by which records are found fast (text)."""
    value: str = ""
    """Field by which records are found fast (number)."""
    columns: Sequence[str] = ()
    """Of the list on the screen."""
    minor: frozenset[str] = frozenset()
    """Of these those that a small screen leaves out."""
    shown: Sequence[Shown] = ()
    absent: frozenset[str] = frozenset()
    """Fields that this machine never fills: they are in no list, file or filter of it."""
    details: Sequence[str] = ()
    """What stands above the events of one."""
    filters: Mapping[str, Filter] = field(default_factory=dict)
    csv: Sequence[Column] = ()
    repeat: Repeat | None = None
    complete: str = ""
    """Outcome of those whose times are compared; empty: none are."""
    former: str = ""
    """Address under which it was before there were records."""
    title: str = ""
    """First line of a CSV file."""
    file: str = ""
    """Stem of its name."""
    hooks: Hooks = field(default_factory=Hooks)

    @property
    def outcomes(self) -> tuple[str, ...]:
        """All that there are, each once: under way, as ends are declared, unknown."""
        found = dict.fromkeys((OPEN, *(end.outcome for end in self.ends)))
        found |= dict.fromkeys(
            one for one in (self.displaced, self.expired, self.forgotten) if one not in (UNKNOWN, "")
        )
        if self.displaced == UNKNOWN:
            found |= dict.fromkeys((UNKNOWN,))
        return tuple(found)


def joined(kinds: Iterable[RecordKind]) -> dict[str, RecordKind]:
    """The kinds of several machines by name: of each that with the fewest fields absent."""
    found: dict[str, RecordKind] = {}
    for kind in kinds:
        if kind.name not in found or len(kind.absent) <= len(found[kind.name].absent):
            found[kind.name] = kind
    return found
