"""The control token: who may command a machine. One session at a time; Stop and acknowledge need none.

It is taken, handed over, released, or lost: 10 s after the last socket of its session, or after 15 min without a command or another deed
of the person. Whoever wants it from the holder asks, and stands in line behind those who asked before (`control_line`). The first in line
is put to the holder, who has 10 s to refuse; silence yields to an asker who is still there. A refusal takes only that one out, who may
ask again after 30 s. What is released or lost goes to the first in line at once. Out of the line is who withdraws, whose session ends or
may not operate any more, and whose last socket closed 10 s ago. Nothing changes hands while a hold-to-run moves the machine, and nobody
is put to who holds the button; who asks meanwhile stands in line.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from app.access.roles import Person, Rights
from app.clock import Clock
from app.commands.control_line import ANSWER, Line, Place, identity
from app.errors import Refused

OPERATE = "operate"
"""Permission that the token needs."""
IDLE = 900.0
"""Time without a sign of the holder after which the token is free [s]."""
GONE = 10.0
"""Time after the holder's last socket closed [s]."""
PAUSE = 30.0
"""Time after a refusal before the same person may ask again [s]."""


@dataclass(frozen=True, slots=True)
class Holder:
    """Who holds a machine."""

    session: str
    person: str
    """Identity."""
    display: str
    since: int
    """[µs UTC]"""


@dataclass(slots=True)
class _Tenure:
    holder: Holder
    who: Person
    sign: float
    """Last sign of the person, monotonic [s]."""
    line: Line = field(default_factory=Line)


Journal = Callable[[Person | None, str, str, str], None]
"""(person, equipment, what, name of the former holder); what is taken, released, handed_over, taken_over, moved_up, refused, withdrawn,
lost or revoked."""


class ControlToken:
    """The tokens of all machines."""

    def __init__(
        self,
        clock: Clock,
        *,
        moving: Callable[[str], bool] = lambda equipment: False,
        changed: Callable[[str], None] = lambda equipment: None,
        journal: Journal = lambda person, equipment, what, former: None,
        rights: Rights = lambda person: person,
    ) -> None:
        """`moving`: whether a hold-to-run moves the machine; `changed` is called with the machine whose token changed; `rights` gives a
        person as of now, None when the session is over.
        """
        self._rights = rights
        self._clock = clock
        self._moving = moving
        self._changed = changed
        self._journal = journal
        self._tenures: dict[str, _Tenure] = {}
        self._sockets: dict[str, int] = {}
        self._closed: dict[str, float] = {}
        self._refusals: dict[tuple[str, str], float] = {}

    def holder(self, equipment: str) -> Holder | None:
        """Who holds the machine; None = nobody."""
        tenure = self._tenures.get(equipment)
        return tenure.holder if tenure else None

    def line(self, equipment: str) -> tuple[Place, ...]:
        """Who waits for the machine, the next one first."""
        tenure = self._tenures.get(equipment)
        return tenure.line.places if tenure else ()

    def request_for(self, equipment: str) -> Place | None:
        """The take-over that waits for the holder's answer: of the first in line, or none yet."""
        tenure = self._tenures.get(equipment)
        return tenure.line.put if tenure else None

    def number(self, person: Person, equipment: str) -> int:
        """The person's place in the line, from 1, from whichever browser they asked; 0 = does not wait."""
        tenure = self._tenures.get(equipment)
        return tenure.line.number(person) if tenure else 0

    def yields_in(self, equipment: str) -> float | None:
        """Time after which the first in line has the machine if the holder keeps silent [s]; None while nobody can say."""
        tenure, now = self._tenures.get(equipment), self._clock.monotonic()
        if tenure is None or tenure.line.first is None:
            return None
        if tenure.line.put:
            return max(0.0, tenure.line.put.until - now)
        return None if self._moving(equipment) else max(0.0, tenure.line.rest - now) + ANSWER

    def holds(self, person: Person, equipment: str) -> bool:
        """Whether this very session holds the machine."""
        tenure = self._tenures.get(equipment)
        return tenure is not None and tenure.holder.session == person.session

    def take(self, person: Person, equipment: str) -> Holder:
        """Take a free machine; the holder may take it again.

        Raises:
            Refused: 403 `why.role` (not an operator), 423 `why.held` (`display`, `since`).
        """
        if not self._may(person):
            raise Refused("why.role", 403, role="operator")
        tenure = self._tenures.get(equipment)
        if tenure is None:
            return self._give(person, equipment, "taken")
        if tenure.holder.session != person.session:
            raise Refused("why.held", 423, display=tenure.holder.display, since=tenure.holder.since)
        tenure.sign = self._clock.monotonic()
        return tenure.holder

    def request(self, person: Person, equipment: str) -> Place | None:
        """Ask for the machine; the person's place in the line, None = the machine was free and is the asker's now.

        Raises:
            Refused: 403 `why.role`; 409 `why.in_line` when the person waits already from another session; 423 `why.line_full`,
                `why.take_over_refused` within 30 s of the holder's refusal.
        """
        tenure = self._tenures.get(equipment)
        if tenure is None or tenure.holder.session == person.session:
            self.take(person, equipment)
            return None
        if not self._may(person):
            raise Refused("why.role", 403, role="operator")
        line, now = tenure.line, self._clock.monotonic()
        if number := line.number(person):
            if line.places[number - 1].session != person.session:
                raise Refused("why.in_line", 409)
            return line.places[number - 1]
        if now - self._refusals.get((equipment, identity(person)), float("-inf")) < PAUSE:
            raise Refused("why.take_over_refused", 423, display=tenure.holder.display)
        line.join(person, self._clock.micros())
        if not self._moving(equipment):
            line.ask(now)
        self._changed(equipment)
        return line.places[-1]

    def withdraw(self, person: Person, equipment: str) -> None:
        """The person waits no more for the machine, from whichever session they asked.

        Raises:
            Refused: 409 `why.not_in_line`.
        """
        tenure = self._tenures.get(equipment)
        if tenure is None or not tenure.line.number(person):
            raise Refused("why.not_in_line", 409)
        self._journal(person, equipment, "withdrawn", "")
        self._keep(equipment, tenure, lambda place: identity(place.who) != identity(person))

    def refuse(self, person: Person, equipment: str) -> None:
        """The holder keeps the machine.

        Raises:
            Refused: 409 `why.no_request`: nobody is put to the holder, or this session does not hold it.
        """
        tenure = self._own(person, equipment)
        if tenure is None or (put := tenure.line.put) is None:
            raise Refused("why.no_request", 409)
        tenure.sign = self._refusals[equipment, identity(put.who)] = self._clock.monotonic()
        self._journal(person, equipment, "refused", put.display)
        self._keep(equipment, tenure, lambda place: place is not put)

    def give(self, person: Person, equipment: str) -> Holder:
        """The holder hands the machine to whoever is put to him, at once.

        Raises:
            Refused: 409 `why.no_request`; 423 `why.hold_active`.
        """
        tenure = self._own(person, equipment)
        if tenure is None or (put := tenure.line.put) is None or not self._may(put.who):
            raise Refused("why.no_request", 409)
        if self._moving(equipment):
            raise Refused("why.hold_active", 423, display=tenure.holder.display)
        return self._pass_on(tenure, put, equipment, "handed_over")

    def release(self, person: Person, equipment: str) -> None:
        """The holder lets go; the first in line gets it. Nothing happens when this session does not hold it.

        Raises:
            Refused: 423 `why.hold_active`.
        """
        tenure = self._own(person, equipment)
        if tenure is None:
            return
        if self._moving(equipment):
            raise Refused("why.hold_active", 423, display=tenure.holder.display)
        self._let_go(equipment, "released")

    def touch(self, session: str, equipment: str) -> None:
        """The holder gave a command to the machine."""
        tenure = self._tenures.get(equipment)
        if tenure and tenure.holder.session == session:
            tenure.sign = self._clock.monotonic()

    def session_seen(self, session: str) -> None:
        """The person did something (a request of a page, not a keep-alive)."""
        for tenure in self._tenures.values():
            if tenure.holder.session == session:
                tenure.sign = self._clock.monotonic()

    def socket_opened(self, session: str) -> None:
        """One more socket of the session."""
        self._sockets[session] = self._sockets.get(session, 0) + 1
        self._closed.pop(session, None)

    def socket_closed(self, session: str) -> None:
        """One socket fewer; after the last one the token has 10 s."""
        left = self._sockets.get(session, 0) - 1
        if left > 0:
            self._sockets[session] = left
            return
        self._sockets.pop(session, None)
        self._closed[session] = self._clock.monotonic()

    def session_ended(self, session: str) -> None:
        """Signed out, or ended by an administrator: what it held is free at once, what it asked for is withdrawn."""
        self._closed.pop(session, None)
        self._sockets.pop(session, None)
        for equipment, tenure in list(self._tenures.items()):
            self._keep(equipment, tenure, lambda place: place.session != session)
            if tenure.holder.session == session:
                self._let_go(equipment, "revoked")

    def keep_only(self, equipment: frozenset[str]) -> None:
        """Forget machines that the plant no longer has."""
        for gone in set(self._tenures) - equipment:
            del self._tenures[gone]

    def check_rights(self) -> None:
        """Free what is held by who may operate no more, and drop their places; not while it moves: the motion ends first."""
        for equipment, tenure in list(self._tenures.items()):
            self._keep(equipment, tenure, lambda place: self._may(place.who))
            if not self._may(tenure.who) and not self._moving(equipment):
                self._let_go(equipment, "revoked")

    def tick(self) -> None:
        """Free what is idle or gone, move the lines up, and hand over where the holder kept silent. Called several times a second."""
        self.check_rights()
        now = self._clock.monotonic()
        for equipment, tenure in list(self._tenures.items()):
            self._keep(equipment, tenure, lambda place: not self._gone(place.session))
            if self._moving(equipment):
                tenure.sign = now
            elif self._gone(tenure.holder.session) or now - tenure.sign >= IDLE:
                self._let_go(equipment, "lost")
            elif (put := tenure.line.put) is None:
                if tenure.line.ask(now):
                    self._changed(equipment)
            elif now >= put.until and put.session not in self._closed:  # nobody loses it to nobody
                self._pass_on(tenure, put, equipment, "taken_over")
        known = {tenure.holder.session for tenure in self._tenures.values()}
        known |= {place.session for tenure in self._tenures.values() for place in tenure.line.places}
        self._closed = {s: at for s, at in self._closed.items() if s in known or now - at < GONE}
        self._refusals = {key: at for key, at in self._refusals.items() if now - at < PAUSE}

    def _may(self, person: Person) -> bool:
        now = self._rights(person)
        return now is not None and now.may(OPERATE)

    def _own(self, person: Person, equipment: str) -> _Tenure | None:
        tenure = self._tenures.get(equipment)
        return tenure if tenure and tenure.holder.session == person.session else None

    def _gone(self, session: str) -> bool:
        """Whether its last socket closed long enough ago."""
        now = self._clock.monotonic()
        return now - self._closed.get(session, now) >= GONE

    def _keep(self, equipment: str, tenure: _Tenure, stays: Callable[[Place], bool]) -> None:
        if tenure.line.keep(stays, self._clock.monotonic()):
            self._changed(equipment)

    def _give(self, person: Person, equipment: str, what: str, former: str = "", line: Line | None = None) -> Holder:
        holder = Holder(person.session, str(person.id), person.display, self._clock.micros())
        self._tenures[equipment] = _Tenure(holder, person, self._clock.monotonic(), line or Line())
        self._journal(person, equipment, what, former)
        self._changed(equipment)
        return holder

    def _pass_on(self, tenure: _Tenure, first: Place, equipment: str, what: str) -> Holder:
        tenure.line.served(self._clock.monotonic())
        return self._give(first.who, equipment, what, tenure.holder.display, tenure.line)

    def _let_go(self, equipment: str, what: str) -> None:
        tenure = self._tenures.pop(equipment)
        self._journal(tenure.who, equipment, what, "")
        tenure.line.keep(lambda place: self._may(place.who), self._clock.monotonic())
        if first := tenure.line.first:
            self._pass_on(tenure, first, equipment, "moved_up")
        self._changed(equipment)
