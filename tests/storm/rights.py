"""What people may do as it was given to them and taken away: kept by the world itself, nothing of it is asked of a server."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf

from app.access.roles import permissions_of
from app.access.sessions import hash_of


@dataclass(frozen=True)
class Over:
    """A session that was ended, and somebody was told so."""

    who: str
    sid: str
    since: float
    """[s]"""


@dataclass
class Rights:
    """Of all people; times are those of the world [s]."""

    now: Callable[[], float]
    over: dict[str, Over] = field(default_factory=dict)
    """By the hash of the id."""
    _facts: dict[tuple[str, str], tuple[object, float]] = field(default_factory=dict)
    """Person and what of theirs → as it was told to be, and since when; what is not here nobody knows."""
    _begun: Counter[tuple[str, str]] = field(default_factory=Counter)
    _under_way: Counter[tuple[str, str]] = field(default_factory=Counter)

    def begin(self, who: str, roles: Iterable[str]) -> None:
        """Somebody is there, with these roles."""
        self._facts[who, "roles"] = tuple(roles), self.now()
        self._facts[who, "barred"] = False, self.now()

    @contextmanager
    def change(self, who: str, what: str, value: object) -> Iterator[None]:
        """Inside, `what` of somebody becomes `value`; when it fails, or others are at it meanwhile, nobody knows what holds."""
        key = who, what
        alone = not self._under_way[key]
        self._facts.pop(key, None)
        self._under_way[key] += 1
        self._begun[key] += 1
        mine = self._begun[key]
        try:
            yield
        finally:
            self._under_way[key] -= 1
        if alone and mine == self._begun[key]:
            self._facts[key] = value, self.now()

    def end(self, who: str, sid: str) -> None:
        """A session is over."""
        if sid:
            self.over.setdefault(hash_of(sid), Over(who, sid, self.now()))

    def forget(self, since: float) -> None:
        """Of sessions that were ended from `since` on nobody knows."""
        self.over = {session: one for session, one in self.over.items() if one.since < since}

    def without(self, who: str, permission: str) -> float:
        """Since when somebody has been without a permission [s]; who has it, or of whom nobody knows: infinite."""
        roles, since = self._facts.get((who, "roles"), (None, inf))
        barred, from_then = self._facts.get((who, "barred"), (False, inf))
        if barred:
            return from_then
        return since if isinstance(roles, tuple) and permission not in permissions_of(roles) else inf
