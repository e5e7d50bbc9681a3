"""One record, the events that make it, and what a machine is configured to do meanwhile."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

OPEN, UNKNOWN = "open", "unknown"
"""Outcomes of every kind: it is under way; its end was not seen."""
Value = float | int | str | None


@dataclass(frozen=True, slots=True)
class Reading:
    """One event of a machine's ring, in words."""

    boot: int
    sequence: int
    time: int
    """[µs UTC]"""
    code: int
    key: str
    """Of the code, as events.toml says; the code itself when it says nothing."""
    source: int = 0
    value: float | None = None
    """None: the event has none."""
    words: Mapping[str, float | int | None] = field(default_factory=dict)
    """What its snapshot says, by the names in events.toml; None: nothing."""
    id: int = 0
    """In the store of events."""


class Names(Protocol):
    """What a machine is configured to do, as it is kept with its records."""

    @property
    def id(self) -> str:
        """Of exactly this configuration; empty: none."""
        ...

    def part(self, number: int) -> str:
        """Key of a part; its number when nothing names it."""
        ...

    def bit(self, part: int, bit: int) -> str:
        """Key of a bit of a part (0: of all of them)."""
        ...

    def value(self, number: int) -> str:
        """Key of a value that is given at the beginning; empty: it has no name."""
        ...


@dataclass(frozen=True, slots=True)
class Unnamed:
    """Names of a machine that is configured to nothing."""

    id: str = ""

    def part(self, number: int) -> str:
        return str(number)

    def bit(self, part: int, bit: int) -> str:
        return f"{part}.bit_{bit}"

    def value(self, number: int) -> str:
        return ""


@dataclass(slots=True)
class Part:
    """A part of a record: a step of a run."""

    number: int
    key: str
    state: str
    begun: int | None = None
    """[µs UTC]; None: not seen."""
    ended: int | None = None
    seconds: float | None = None
    """How long it was active, pauses not counted [s]."""
    paused: int = 0
    """[µs]"""


@dataclass(slots=True)
class Record:
    """What became of one thing on one machine."""

    kind: str
    number: int
    """Of the thing, as the machine counts; 0 of a kind whose machines do one at a time."""
    boot: int
    sequence: int
    """Of its first event."""
    begun: int
    """[µs UTC]"""
    entry: int = 0
    """Code of the event with which it began; 0: its beginning was not seen."""
    outcome: str = OPEN
    ended: int | None = None
    """[µs UTC]; of one that is under way: when it will end by itself."""
    seconds: float | None = None
    """How long it took, as the machine says or as counted; None: under way, or not known."""
    paused: int = 0
    """Pauses that are over [µs]."""
    pause: int | None = None
    """Since when it is paused [µs UTC]."""
    missed: int = 0
    """Events lost meanwhile."""
    alarms: tuple[int, ...] = ()
    """Codes of its events that are alarms, in the order in which they first came."""
    definition: str = ""
    """Id of what the machine was configured to do."""
    fields: dict[str, Value] = field(default_factory=dict)
    """What its kind declares."""
    memo: dict[str, list[Value]] = field(default_factory=dict)
    """What its kind has to remember until its end."""
    parts: dict[int, Part] = field(default_factory=dict)
    id: int = 0
    """In the store; 0: not there yet."""
    equipment: str = ""
    """Name that the machine has now."""

    @property
    def open(self) -> bool:
        """Whether it is under way."""
        return self.outcome == OPEN

    @property
    def duration(self) -> float | None:
        """From its beginning to its end [s]."""
        return None if self.ended is None else (self.ended - self.begun) / 1e6

    def copy(self) -> "Record":
        """Another one that says the same."""
        return replace(
            self,
            fields=dict(self.fields),
            memo=dict(self.memo),
            parts={number: replace(part) for number, part in self.parts.items()},
        )
