"""Hold-to-run: a machine moves only while a person holds a button, and while word of that keeps coming.

Arming checks everything a command needs and gives a lease: 128 random bits, good for one press, begun within 10 s. The first keep-alive
starts the motion, so a delayed request cannot. Each further one must come within 500 ms and carry a higher counter. The motion ends on
release, silence, a lost permissive, a Stop, a stalled loop, 30 s of holding; whatever ends it, the lease is over and only a new press moves
the machine again. An operational aid, not a safety function: behind it stands the watchdog of the device itself.

This file keeps the leases; what is written to the device is the gate's.
"""

import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Protocol

from app import chance
from app.access.roles import Person
from app.clock import Clock
from app.errors import Refused

log = logging.getLogger(__name__)

TTL = 0.5
"""Longest time between two keep-alives [s]."""
ARMED = 10.0
"""Time within which an armed lease must begin [s]."""
LONGEST = 30.0
"""Longest hold [s]."""
STALL = 0.3
"""Gap between two ticks that counts as a stalled loop [s]."""
REMEMBERED = 100
"""So many leases that ended are known by why they did: who still holds the button is told."""
CAUSES = frozenset({"released", "closed", "left", "hidden", "dialog", "offline", "longest", "both"})
"""What a page may say why it let go: button up, page closed, pointer or focus left, page hidden, a dialog, no connection, held too long,
something else pressed meanwhile."""
PAUSE = 0.3
"""Time released before the other direction [s]."""


@dataclass(slots=True)
class Lease:
    """One press of a hold-to-run button."""

    token: str
    person: Person
    equipment: str
    command: str
    id: str
    address: str
    armed: float
    """Monotonic [s]."""
    armed_at: int
    """[µs UTC]"""
    started: float = 0.0
    """Monotonic [s]; 0 = not yet."""
    started_at: int = 0
    last: float = 0.0
    """Last keep-alive, monotonic [s]."""
    counter: int = 0
    cause: str = ""
    """Why it ended; its text is `hold.cause.<cause>`."""

    @property
    def moving(self) -> bool:
        """Whether it moves the machine."""
        return self.started > 0 and not self.cause


class Admit(Protocol):
    """Every check that a command needs; gives the identity of the command."""

    def __call__(
        self, person: Person, equipment: str, command: str, *, id: str, nonce: str, confirmed: bool, address: str
    ) -> Awaitable[str]:
        """Raises Refused."""
        ...


class HoldToRun:
    """The leases of all machines; at most one of a machine moves it."""

    def __init__(
        self,
        clock: Clock,
        *,
        admit: Admit,
        start: Callable[[Lease], None],
        stop: Callable[[Lease], None],
        lost: Callable[[Lease], str],
        kept: Callable[[Lease], None] = lambda lease: None,
    ) -> None:
        """`start` begins the motion or raises Refused; `stop` ends it; `lost` names the cause that forbids going on, or is empty; `kept` is
        called with every keep-alive that counts but the first.
        """
        self._clock = clock
        self._admit = admit
        self._start = start
        self._stop = stop
        self._lost = lost
        self._kept = kept
        self._leases: dict[str, Lease] = {}
        self._released: dict[str, tuple[str, float]] = {}
        self._over: dict[str, str] = {}
        self._ticked = clock.monotonic()

    async def arm(
        self,
        person: Person,
        equipment: str,
        command: str,
        *,
        id: str = "",
        nonce: str = "",
        confirmed: bool = False,
        address: str = "",
    ) -> str:
        """A lease for one press; nothing moves yet.

        Arming while another lease moves the machine stops it: two buttons pressed are a stop.

        Raises:
            Refused: what the gate says; 409 `why.both_directions`, `why.hold_pause` (less than 300 ms after the other direction).
        """
        moving = self.active(equipment)
        if moving is not None:
            self.end(moving, "both")
            raise Refused("why.both_directions", 409)
        before = self._released.get(equipment)
        if before and before[0] != command and self._clock.monotonic() - before[1] < PAUSE:
            raise Refused("why.hold_pause", 409, seconds=PAUSE)
        identity = await self._admit(
            person, equipment, command, id=id, nonce=nonce, confirmed=confirmed, address=address
        )
        for other in [lease for lease in self._leases.values() if lease.equipment == equipment and not lease.started]:
            del self._leases[other.token]
        lease = Lease(
            chance.token_urlsafe(16),
            person,
            equipment,
            command,
            identity,
            address,
            self._clock.monotonic(),
            self._clock.micros(),
        )
        self._leases[lease.token] = lease
        return lease.token

    def keep_alive(self, token: str, counter: int, session: str) -> bool:
        """The button is held; the first one starts the motion. False: `counter` did not rise, it changes nothing.

        Raises:
            Refused: 410 `why.lease_over` (`cause`), 403 `why.other_session`, and what keeps the motion from starting.
        """
        lease = self._lease(token, session)
        if counter <= lease.counter:
            log.warning(
                "hold counter not rising equipment=%s counter=%s last=%s", lease.equipment, counter, lease.counter
            )
            return False
        now = self._clock.monotonic()
        self._check_stall(now)
        if lease.cause:
            raise Refused("why.lease_over", 410, cause=lease.cause)
        if not lease.started:
            return self._begin(lease, counter, now)
        if now - lease.last > TTL:
            self.end(lease, "lost")
            raise Refused("why.lease_over", 410, cause="lost")
        lease.counter, lease.last = counter, now
        cause = self._lost(lease)
        if cause:
            self.end(lease, cause)
            raise Refused("why.lease_over", 410, cause=cause)
        self._kept(lease)
        return True

    def release(self, token: str, session: str, cause: str = "released") -> None:
        """The button is up, or the page went (`cause`, one of `CAUSES`). A lease that is over already stays over."""
        lease = self._leases.get(token)
        if lease is None:
            return
        if lease.person.session != session:
            raise Refused("why.other_session", 403)
        self.end(lease, cause if cause in CAUSES else "released")

    def release_session(self, session: str, cause: str = "session") -> None:
        """End every lease of a session: signed out, or its sockets are gone."""
        for lease in [lease for lease in self._leases.values() if lease.person.session == session]:
            self.end(lease, cause)

    def active(self, equipment: str) -> Lease | None:
        """The lease that moves the machine."""
        return next((lease for lease in self._leases.values() if lease.equipment == equipment and lease.moving), None)

    def tick(self) -> None:
        """End what is over. Called every 50 ms."""
        now = self._clock.monotonic()
        self._check_stall(now)
        self._ticked = now
        for lease in list(self._leases.values()):
            if not lease.started:
                if now - lease.armed > ARMED:
                    del self._leases[lease.token]
            elif now - lease.last > TTL:
                self.end(lease, "lost")
            elif now - lease.started > LONGEST:
                self.end(lease, "longest")
        self.judge()

    def judge(self) -> None:
        """End what may not go on: rights, token, values, conditions."""
        for lease in list(self._leases.values()):
            cause = self._lost(lease) if lease.moving else ""
            if cause:
                self.end(lease, cause)

    def end(self, lease: Lease, cause: str) -> None:
        """End `lease`; the gate writes its release when it moved."""
        if lease.cause:
            return
        moved = lease.moving
        lease.cause = cause
        self._leases.pop(lease.token, None)
        self._over[lease.token] = cause
        while len(self._over) > REMEMBERED:
            del self._over[next(iter(self._over))]
        if moved:
            self._released[lease.equipment] = (lease.command, self._clock.monotonic())
            self._stop(lease)

    def drop(self, lease: Lease, cause: str) -> None:
        """`lease` is over because a newer command has the machine now; nothing more is written for it."""
        if lease.cause:
            return
        lease.cause = cause
        self._leases.pop(lease.token, None)
        if lease.started:
            self._released[lease.equipment] = (lease.command, self._clock.monotonic())

    def disarm(self, equipment: str) -> None:
        """Void leases of the machine that do not move it yet: after a Stop only a new press moves it."""
        for lease in [lease for lease in self._leases.values() if lease.equipment == equipment and not lease.started]:
            self.drop(lease, "stop")

    def _begin(self, lease: Lease, counter: int, now: float) -> bool:
        if now - lease.armed > ARMED:
            del self._leases[lease.token]
            raise Refused("why.lease_over", 410, cause="late")
        before = self._released.get(lease.equipment)
        if before and before[0] != lease.command and now - before[1] < PAUSE:
            raise Refused("why.hold_pause", 409, seconds=PAUSE)
        lease.started, lease.started_at = now, self._clock.micros()
        lease.counter, lease.last = counter, now
        try:
            self._start(lease)
        except Exception:  # also a fault of our own: what never began does not count as moving
            lease.started = 0.0
            self._leases.pop(lease.token, None)
            raise
        return True

    def _check_stall(self, now: float) -> None:
        if now - self._ticked <= STALL:
            return
        self._ticked = now
        for lease in list(self._leases.values()):
            if lease.moving:
                log.warning("loop stalled, hold-to-run ends equipment=%s", lease.equipment)
                self.end(lease, "stall")

    def _lease(self, token: str, session: str) -> Lease:
        lease = self._leases.get(token)
        if lease is None:
            raise Refused("why.lease_over", 410, cause=self._over.get(token, "over"))
        if lease.person.session != session:
            raise Refused("why.other_session", 403)
        return lease
