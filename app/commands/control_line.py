"""The line for a machine: who waits for its control, in the order in which they asked.

Everybody has one place, whichever of their browsers asked; the machine goes to the session that did. Only the first in line is put to the
holder. Who asks while nobody waits is put to him at once, so for two people there is no line; who moves up, not before a minute has passed
since the machine changed hands or the one before was put in vain: a line does not ask the same holder every few seconds.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf

from app.access.roles import Person
from app.errors import Refused

ANSWER = 10.0
"""Time that the holder has to refuse a take-over [s]."""
REST = 60.0
"""Time that the holder is left alone before the next in line is put to him [s]."""
MOST = 64
"""So many wait for one machine."""


def identity(person: Person) -> str:
    """One and the same for all sessions of somebody; a program is its token, as it has no account of its own."""
    return str(person.id) if person.id else person.session


@dataclass(frozen=True, slots=True)
class Place:
    """Somebody waits for a machine."""

    who: Person
    asked: int
    """[µs UTC]"""
    until: float = inf
    """Monotonic time at which the holder's silence yields [s]; infinite while this is not put to him."""

    @property
    def session(self) -> str:
        """Which gets the machine."""
        return self.who.session

    @property
    def display(self) -> str:
        """Name of who waits."""
        return self.who.display


class Line:
    """Who waits for one machine."""

    def __init__(self) -> None:
        self.places: tuple[Place, ...] = ()
        """The next one first."""
        self.rest = 0.0
        """Monotonic time before which nobody is put to the holder [s]."""

    @property
    def first(self) -> Place | None:
        """Who is next."""
        return self.places[0] if self.places else None

    @property
    def put(self) -> Place | None:
        """Who is put to the holder: the first, or nobody yet."""
        return self.first if self.first and self.first.until < inf else None

    def number(self, person: Person) -> int:
        """The person's place, from 1; 0 = does not wait."""
        who = identity(person)
        return next((n for n, place in enumerate(self.places, 1) if identity(place.who) == who), 0)

    def join(self, person: Person, micros: int) -> None:
        """Stand at the end.

        Raises:
            Refused: 423 `why.line_full` (`most`).
        """
        if len(self.places) >= MOST:
            raise Refused("why.line_full", 423, most=MOST)
        self.places += (Place(person, micros),)

    def ask(self, now: float) -> bool:
        """Put the first to the holder if it is time for that; whether it was."""
        if self.first is None or self.put or now < self.rest:
            return False
        self.places = (replace(self.first, until=now + ANSWER), *self.places[1:])
        return True

    def keep(self, stays: Callable[[Place], bool], now: float) -> bool:
        """Only those wait on for whom `stays`, and the others move up; whether somebody left."""
        put, before = self.put, len(self.places)
        self.places = tuple(place for place in self.places if stays(place))
        if put and self.places and self.first is not put:
            self.rest = now + REST
        return len(self.places) < before

    def served(self, now: float) -> None:
        """The first has the machine now; with others behind he has it for a while."""
        self.places = self.places[1:]
        self.rest = now + REST if self.places else 0.0
