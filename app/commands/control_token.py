"""The control token: who may command a machine. One session at a time; Stop and acknowledge need none.

It is taken, handed over, released, or lost: 10 s after the last socket of its session, or after 15 min without a command or another deed
of the person. Whoever wants it from the holder asks; the holder has 10 s to refuse, silence yields to an asker who is still there: the
request is withdrawn 10 s after the last socket of its session. Nothing changes hands while a hold-to-run moves the machine.
"""

from collections.abc import Callable
from dataclasses import dataclass

from app.access.roles import Person, Rights
from app.clock import Clock
from app.errors import Refused

OPERATE = "operate"
"""Permission that the token needs."""
IDLE = 900.0
"""Time without a sign of the holder after which the token is free [s]."""
GONE = 10.0
"""Time after the holder's last socket closed [s]."""
ANSWER = 10.0
"""Time that the holder has to refuse a take-over [s]."""
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


@dataclass(frozen=True, slots=True)
class TakeOver:
    """Somebody asks the holder for a machine."""

    session: str
    person: str
    display: str
    asked: int
    """[µs UTC]"""
    until: float
    """Monotonic time at which silence yields [s]."""


@dataclass(slots=True)
class _Tenure:
    holder: Holder
    who: Person
    sign: float
    """Last sign of the person, monotonic [s]."""
    request: TakeOver | None = None
    asker: Person | None = None


Journal = Callable[[Person | None, str, str, str], None]
"""(person, equipment, what: taken, released, handed_over, taken_over, refused, lost; name of the former holder)."""


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

    def request_for(self, equipment: str) -> TakeOver | None:
        """The take-over that waits for the holder's answer."""
        tenure = self._tenures.get(equipment)
        return tenure.request if tenure else None

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

    def request(self, person: Person, equipment: str) -> TakeOver | None:
        """Ask the holder for the machine; None = it was free and is the asker's now.

        Raises:
            Refused: 403 `why.role`; 423 `why.hold_active` while a hold-to-run moves it, `why.requested` when somebody else asks already,
                `why.take_over_refused` within 30 s of the holder's refusal.
        """
        tenure = self._tenures.get(equipment)
        if tenure is None or tenure.holder.session == person.session:
            self.take(person, equipment)
            return None
        if not self._may(person):
            raise Refused("why.role", 403, role="operator")
        if self._moving(equipment):
            raise Refused("why.hold_active", 423, display=tenure.holder.display)
        now = self._clock.monotonic()
        if tenure.request and tenure.request.session != person.session:
            raise Refused("why.requested", 423, display=tenure.request.display)
        if now - self._refusals.get((equipment, str(person.id)), float("-inf")) < PAUSE:
            raise Refused("why.take_over_refused", 423, display=tenure.holder.display)
        if tenure.request is None:
            tenure.request = TakeOver(
                person.session, str(person.id), person.display, self._clock.micros(), now + ANSWER
            )
            tenure.asker = person
            self._changed(equipment)
        return tenure.request

    def refuse(self, person: Person, equipment: str) -> None:
        """The holder keeps the machine.

        Raises:
            Refused: 409 `why.no_request`: nobody asks, or this session does not hold it.
        """
        tenure = self._own(person, equipment)
        if tenure is None or tenure.request is None:
            raise Refused("why.no_request", 409)
        self._refusals[equipment, tenure.request.person] = self._clock.monotonic()
        self._journal(person, equipment, "refused", tenure.request.display)
        tenure.request = tenure.asker = None
        tenure.sign = self._clock.monotonic()
        self._changed(equipment)

    def give(self, person: Person, equipment: str) -> Holder:
        """The holder hands the machine to whoever asks, at once.

        Raises:
            Refused: 409 `why.no_request`; 423 `why.hold_active`.
        """
        tenure = self._own(person, equipment)
        if tenure is None or tenure.asker is None or not self._may(tenure.asker):
            raise Refused("why.no_request", 409)
        if self._moving(equipment):
            raise Refused("why.hold_active", 423, display=tenure.holder.display)
        return self._give(tenure.asker, equipment, "handed_over", tenure.holder.display)

    def release(self, person: Person, equipment: str) -> None:
        """The holder lets go; whoever asks gets it. Nothing happens when this session does not hold it.

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
            if tenure.request and tenure.request.session == session:
                tenure.request = tenure.asker = None
                self._changed(equipment)
            if tenure.holder.session == session:
                self._let_go(equipment, "lost")

    def keep_only(self, equipment: frozenset[str]) -> None:
        """Forget machines that the plant no longer has."""
        for gone in set(self._tenures) - equipment:
            del self._tenures[gone]

    def check_rights(self) -> None:
        """Free what is held, and drop what is asked for, by who may operate no more; not while it moves: the motion ends first."""
        for equipment, tenure in list(self._tenures.items()):
            if tenure.asker is not None and not self._may(tenure.asker):
                tenure.request = tenure.asker = None
                self._changed(equipment)
            if not self._may(tenure.who) and not self._moving(equipment):
                self._let_go(equipment, "lost")

    def tick(self) -> None:
        """Free what is idle or gone, and hand over where the holder kept silent. Called several times a second."""
        self.check_rights()
        now = self._clock.monotonic()
        for equipment, tenure in list(self._tenures.items()):
            if self._moving(equipment):
                tenure.sign = now
                continue
            gone = now - self._closed.get(tenure.holder.session, now) >= GONE
            if gone or now - tenure.sign >= IDLE:
                self._let_go(equipment, "lost")
            elif tenure.request and tenure.asker:
                asker = tenure.request.session
                if now - self._closed.get(asker, now) >= GONE:
                    tenure.request = tenure.asker = None
                    self._changed(equipment)
                elif now >= tenure.request.until and asker not in self._closed:  # nobody loses it to nobody
                    self._give(tenure.asker, equipment, "taken_over", tenure.holder.display)
        known = {tenure.holder.session for tenure in self._tenures.values()}
        known |= {tenure.request.session for tenure in self._tenures.values() if tenure.request}
        self._closed = {s: at for s, at in self._closed.items() if s in known or now - at < GONE}
        self._refusals = {key: at for key, at in self._refusals.items() if now - at < PAUSE}

    def _may(self, person: Person) -> bool:
        now = self._rights(person)
        return now is not None and now.may(OPERATE)

    def _own(self, person: Person, equipment: str) -> _Tenure | None:
        tenure = self._tenures.get(equipment)
        return tenure if tenure and tenure.holder.session == person.session else None

    def _give(self, person: Person, equipment: str, what: str, former: str = "") -> Holder:
        holder = Holder(person.session, str(person.id), person.display, self._clock.micros())
        self._tenures[equipment] = _Tenure(holder, person, self._clock.monotonic())
        self._journal(person, equipment, what, former)
        self._changed(equipment)
        return holder

    def _let_go(self, equipment: str, what: str) -> None:
        tenure = self._tenures.pop(equipment)
        self._journal(tenure.who, equipment, what, "")
        if tenure.asker and self._may(tenure.asker):
            self._give(tenure.asker, equipment, "taken_over", tenure.holder.display)
        self._changed(equipment)
