"""What keeps a command from acting late, twice or too often: nonces, identities, a rate.

A page holds a nonce that the server issued and renews it with every heartbeat, at least every two seconds. A command uses the nonce up.
One that waited in a proxy, a queue or a frozen server comes with a nonce that is too old, or that a newer one replaced too long ago, and
is refused (410). Nothing here needs the clock of the browser. Stop needs no nonce.
"""

import asyncio
import secrets
from collections import deque
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from app import chance
from app.clock import Clock
from app.errors import Refused

LIFE = 10.0
"""Age at which a nonce expires [s]."""
REPLACED_LIFE = 4.0
"""How long a nonce is good after a newer one of its session was issued [s]."""
MEMORY = 86_400.0
"""How long identities are remembered [s]."""
MOST = 2_000
"""Most identities remembered, each with its result. A press that comes again comes within minutes, and needs a fresh nonce."""
RATE, BURST = 5.0, 10.0
"""Commands of one person per second, and at once (security.md section 7)."""


@dataclass(slots=True)
class _Nonce:
    text: str
    issued: float
    replaced: float = float("inf")


class Nonces:
    """One-time numbers by session."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._sessions: dict[str, deque[_Nonce]] = {}

    def issue(self, session: str) -> str:
        """A new nonce for `session`; good for one command within 10 s."""
        now = self._clock.monotonic()
        self._forget(now)
        issued = self._sessions.setdefault(session, deque(maxlen=200))
        if issued and issued[-1].replaced > now:
            issued[-1].replaced = now
        nonce = _Nonce(chance.token_urlsafe(16), now)
        issued.append(nonce)
        return nonce.text

    def use(self, session: str, nonce: str) -> float:
        """Use `nonce` up; returns when it was issued [s, monotonic].

        Raises:
            Refused: 410 `why.expired`: not of this session, used before, older than 10 s, or replaced more than 4 s ago.
        """
        now = self._clock.monotonic()
        issued = self._sessions.get(session, deque())
        for held in issued:
            if secrets.compare_digest(held.text.encode(), nonce.encode()):
                issued.remove(held)
                if now - held.issued <= LIFE and now - held.replaced <= REPLACED_LIFE:
                    return held.issued
                break
        raise Refused("why.expired", 410)

    def drop(self, session: str) -> None:
        """The session has ended."""
        self._sessions.pop(session, None)

    def _forget(self, now: float) -> None:
        for session, issued in list(self._sessions.items()):
            while issued and now - issued[0].issued > LIFE:
                issued.popleft()
            if not issued:
                del self._sessions[session]


Outcome = TypeVar("Outcome")


@dataclass(slots=True)
class _Entry(Generic[Outcome]):
    owner: str
    at: float
    task: asyncio.Task[Outcome] | None
    result: Outcome | None = None
    refusal: Refused | None = None


class Once(Generic[Outcome]):
    """Identities of commands: the same one a second time gives the first result and does not act again."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._entries: dict[str, _Entry[Outcome]] = {}

    async def run(
        self, id: str, owner: str, work: Callable[[], Coroutine[Any, Any, Outcome]], *, keep: Callable[[Refused], bool]
    ) -> Outcome:
        """The result of `work()`, or of the first call with this `id` within 24 h.

        The work goes on when the caller goes away. A refusal for which `keep` is false (a question back to the person) is forgotten, so
        that the answer may come with the same identity.

        Raises:
            Refused: what `work` raised; 409 `why.replayed` when somebody else used the identity.
        """
        self._forget()
        entry = self._entries.get(id)
        if entry is not None and entry.owner != owner:
            raise Refused("why.replayed", 409)
        if entry is None:
            task = asyncio.create_task(work(), name=f"command {id}")
            entry = _Entry(owner, self._clock.monotonic(), task)
            self._entries[id] = entry
            task.add_done_callback(lambda done: self._done(id, done, keep))
        if entry.task is not None:
            return await asyncio.shield(entry.task)
        if entry.refusal is not None:
            raise Refused(entry.refusal.reason, entry.refusal.status, **entry.refusal.params)
        assert entry.result is not None
        return entry.result

    def known(self, id: str) -> bool:
        """Whether this identity was used."""
        return id in self._entries

    def _done(self, id: str, task: "asyncio.Task[Outcome]", keep: Callable[[Refused], bool]) -> None:
        entry = self._entries.get(id)
        error = None if task.cancelled() else task.exception()
        if entry is None or entry.task is not task:
            return
        if task.cancelled() or (error is not None and not (isinstance(error, Refused) and keep(error))):
            del self._entries[id]
            return
        entry.task = None
        if isinstance(error, Refused):
            entry.refusal = Refused(error.reason, error.status, **error.params)
        else:
            entry.result = task.result()

    def _forget(self) -> None:
        oldest = self._clock.monotonic() - MEMORY
        while self._entries:
            id, entry = next(iter(self._entries.items()))
            if entry.at > oldest and len(self._entries) <= MOST:
                break
            del self._entries[id]


class Rate:
    """At most 5 commands a second and 10 at once by one person."""

    def __init__(self, clock: Clock, rate: float = RATE, burst: float = BURST) -> None:
        self._clock = clock
        self._rate, self._burst = rate, burst
        self._left: dict[str, tuple[float, float]] = {}

    def take(self, person: str) -> bool:
        """Whether `person` may give one more command now."""
        now = self._clock.monotonic()
        left, at = self._left.get(person, (self._burst, now))
        left = min(self._burst, left + (now - at) * self._rate)
        allowed = left >= 1
        self._left[person] = (left - 1 if allowed else left, now)
        return allowed
