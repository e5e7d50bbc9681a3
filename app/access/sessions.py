"""Who is signed in: sessions live on the server, survive a restart, and the browser holds only a random id.

Only SHA-256 of the id is stored. Rights are read from the database with every request, so a change of roles, a disabled account or a
closed session acts on the next one, also when the command line made it. What goes on without requests (a button that is held, a command
that waits for its turn, a socket) asks `current`, which follows the database by half a second (`renew`, in this process at once).
When a session ends and when it is idle is in `session_times`, what it allows in `session_person`. Source: reference/security.md
section 4.4.
"""

import hashlib
import re
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, bindparam, delete, func, insert, literal_column, select, update

from app import chance
from app.access.audit.audit import Audit
from app.access.audit.kinds import Kind
from app.access.audit.line import Entry, printable
from app.access.roles import Person
from app.access.session_person import person_of, watching
from app.access.session_times import SessionTimes, lifetime
from app.access.standing import StandingSessions
from app.access.tables import factor_table, person_table, role_table, session_table
from app.clock import Clock
from app.db import Database
from app.errors import StorageError

IDLE_WARNING = 60.0
"""So long before that the page says so [s]."""
LIMITS = {"viewer": 10, "operator": 3, "engineer": 2, "admin": 1}
"""Sessions at once; who has several roles has the largest of their limits."""
TOUCH_PERIOD = 20.0
"""A deed is written at most so often [s]."""
ID_BYTES = 32
MOST_KNOWN = 1000
"""Sessions remembered for what goes on without requests, and for the time when the database cannot be read."""
IN_USE = 120.0
"""A session that nobody asked for in so long is not followed [s]."""
MOST_FAILURES = 6
"""After so many tries to follow the database in vain, what is known from before only allows to watch and to stop."""


@dataclass(frozen=True, slots=True)
class Session:
    """One session, for the people who look after them."""

    id_hash: str
    person: int
    created: int
    active: int
    until: int
    address: str
    agent: str
    """Family and system of the browser."""


@dataclass(slots=True)
class _Known:
    """What is known of a session without asking the database."""

    row: Any
    roles: frozenset[str]
    used: float
    """When somebody asked for it, monotonic [s]."""

    def rights(self) -> tuple[object, ...]:
        """What its person may do hangs on these."""
        return self.roles, self.row.must_change, self.row.factor_since, self.row.name, self.row.display


class Sessions:
    """Opens, finds and ends sessions."""

    def __init__(self, db: Database, clock: Clock, audit: Audit, factor_roles: Iterable[str] = ()) -> None:
        """Who has one of `factor_roles` does nothing but stop until they have a second factor."""
        self._db = db
        self._clock = clock
        self._audit = audit
        self._factor_roles = frozenset(factor_roles)
        self._ended: list[Callable[[Collection[str]], None]] = []
        self._changed: list[Callable[[Collection[str]], None]] = []
        self._acted: list[Callable[[Collection[str]], None]] = []
        self._touched: dict[str, float] = {}
        self._times = SessionTimes(clock)
        self.standing = StandingSessions(db, clock, self._times)
        self._known: OrderedDict[str, _Known] = OrderedDict()
        self._why: OrderedDict[str, str] = OrderedDict()
        self._unwritten: dict[str, Callable[[Connection], tuple[bool, list[Entry]]]] = {}
        """Hash of a session that is over → what the database did not take of it."""
        self._failures = 0
        self._epoch = 0
        """Changes that this process made: what was read before one of them is not news."""

    def subscribe(self, ended: Callable[[Collection[str]], None]) -> None:
        """Have `ended` called with the hashes of sessions that are over, so that sockets close and motions stop at once."""
        self._ended.append(ended)

    def subscribe_changes(self, changed: Callable[[Collection[str]], None]) -> None:
        """Have `changed` called with the hashes of sessions whose person has other rights or another name now."""
        self._changed.append(changed)

    def subscribe_deeds(self, acted: Callable[[Collection[str]], None]) -> None:
        """Have `acted` called with the hash of a session whose person has just done something."""
        self._acted.append(acted)

    async def load(self) -> None:
        """Take the times of all sessions over from before the restart.

        Raises:
            StorageError: the database cannot be read.
        """
        for row in await self._db.read(lambda connection: connection.execute(select(session_table)).all()):
            self._times.load(row)

    async def find(self, sid: str, address: str, agent: str) -> Person | None:
        """The person behind the id `sid`, with what is allowed now; None when there is no such session, or no more.

        While the database cannot be read, a person known from before may still watch and stop the plant, and nothing else.

        Raises:
            StorageError: the database cannot be read, and this session was not seen before.
        """
        if not re.fullmatch(r"[\w-]{43}", sid, re.ASCII):
            return None
        id_hash = hash_of(sid)
        try:
            known = await self._read(id_hash)
        except StorageError:
            before = self._known.get(id_hash)
            if before is None or before.row.agent != family(agent):
                raise
            return watching(self._person(before, address))
        if known is None or known.row.agent != family(agent):
            return None
        return self._person(known, address)

    def note_over(self, hashes: Iterable[str], why: str) -> None:
        """Remember why sessions ended that their people did not end: `limit` or `ended`. A restart forgets it."""
        for id_hash in hashes:
            self._why[id_hash] = why
        while len(self._why) > MOST_KNOWN:
            self._why.popitem(last=False)

    def why_over(self, sid: str) -> str:
        """Why the session with the id `sid` is over; empty when nobody knows or the person did it."""
        return self._why.get(hash_of(sid), "")

    async def again(self, person: Person) -> Person | None:
        """`person` as of now, for a socket that stays open; None when its session is over.

        Raises:
            StorageError: the database cannot be read.
        """
        known = await self._read(person.session)
        return self._person(known, person.address) if known else None

    def current(self, person: Person) -> Person | None:
        """`person` as of now without asking the database; None when the session is over, or was not found lately.

        A change that another process made is known after `renew`.
        """
        known = self._known.get(person.session)
        if known is None or self._times.is_over(person.session):
            return None
        known.used = self._clock.monotonic()
        now = self._person(known, person.address)
        return watching(now) if self._failures >= MOST_FAILURES else now

    async def renew(self) -> None:
        """Read again the sessions that are in use; tell whose are over and whose rights are others now. Called every half second.

        A database that cannot be read is borne for a while; then nobody may act any more.
        """
        self.announce([id_hash for id_hash in self._known if self._times.is_over(id_hash)])
        oldest = self._clock.monotonic() - IN_USE
        wanted = [id_hash for id_hash, known in self._known.items() if known.used >= oldest]
        epoch = self._epoch
        try:
            found = await self._db.read(lambda connection: self._rows(connection, wanted)) if wanted else {}
        except StorageError:
            self._failures += 1
            if self._failures == MOST_FAILURES:
                self._tell(self._changed, wanted)
            return
        self._failures = 0
        if epoch != self._epoch:
            return  # what changed meanwhile was told by whoever changed it
        over, changed = [], []
        for id_hash in wanted:
            known, now = self._known.get(id_hash), found.get(id_hash)
            if known is None:
                continue
            if now is None or now[0].disabled:
                over.append(id_hash)
                continue
            before = known.rights()
            known.row, known.roles = now
            if known.rights() != before:
                changed.append(id_hash)
        self.announce(over)
        self._tell(self._changed, changed)

    async def people_changed(self) -> None:
        """This process has changed accounts: whoever loses a right by it loses it now."""
        self._epoch += 1
        await self.renew()

    def touch(self, person: Person) -> None:
        """`person` has just done something: the idle time starts anew. An idle session stays idle."""
        left = None if person.idle else self._times.acted(person.session)
        if left is None:
            return
        self._tell(self._acted, [person.session])
        now = self._clock.monotonic()
        if now - self._touched.get(person.session, float("-inf")) < TOUCH_PERIOD:
            return
        self._touched[person.session] = now
        active = self._clock.micros()
        values = {"active": active, "until": active + round(left * 1e6)}
        change = update(session_table).where(session_table.c.id_hash == person.session).values(**values)
        self._db.submit(lambda connection: connection.execute(change) and None)

    def open(
        self,
        connection: Connection,
        person_id: int,
        roles: Iterable[str],
        address: str,
        agent: str,
        replaces: str | None,
    ) -> tuple[str, list[str]]:
        """A new session in this transaction, in place of `replaces` (a hash); returns its id and the hashes that it ended.

        The oldest sessions of the person go when there are too many.
        """
        now, held = self._clock.micros(), frozenset(roles)
        session = session_table.c
        rows = connection.execute(select(session_table)).all()
        over = [row.id_hash for row in rows if self._times.left(row) <= 0]
        self._times.keep({row.id_hash for row in rows} | {one.id_hash for one in self.standing.all})
        connection.execute(delete(session_table).where(session.id_hash.in_([*over, replaces or ""])))
        limit = limit_of(held)
        kept = (
            select(session.id_hash)
            .where(session.person == person_id)
            .order_by(session.active.desc(), session.created.desc(), literal_column("session.rowid").desc())
        )
        crowded = list(connection.execute(kept.offset(limit - 1)).scalars())
        if crowded:
            connection.execute(delete(session_table).where(session.id_hash.in_(crowded)))
        sid = chance.token_urlsafe(ID_BYTES)
        connection.execute(
            insert(session_table).values(
                id_hash=hash_of(sid),
                person=person_id,
                created=now,
                active=now,
                until=now + round(lifetime(held) * 1e6),
                address=address[:64],
                agent=family(agent),
            )
        )
        self._times.begin(hash_of(sid), held)
        return sid, crowded + ([replaces] if replaces else [])

    async def of(self, person_id: int | None = None) -> list[Session]:
        """Open sessions, of one person or of all, newest first.

        Raises:
            StorageError: the database cannot be read.
        """
        query = select(session_table).order_by(session_table.c.created.desc())
        if person_id is not None:
            query = query.where(session_table.c.person == person_id)
        rows = await self._db.read(lambda connection: connection.execute(query).all())
        standing = [Session(**one.row) for one in self.standing.all if person_id in (None, one.person)]
        return [*reversed(standing), *(Session(**row._mapping) for row in rows if self._times.left(row) > 0)]

    async def end(self, by: Person, id_hash: str, kind: Kind = "session.ended") -> bool:
        """End one session; False when there is none.

        Raises:
            StorageError: the database did not take it. It is over here all the same, and written as soon as that can be done; should the
                server end before, it is one again.
        """

        standing = self.standing.pop(id_hash)

        def work(connection: Connection) -> tuple[bool, list[Entry]]:
            query = (
                select(person_table.c.name).join(session_table, session_table.c.person == person_table.c.id)
            ).where(session_table.c.id_hash == id_hash)
            name = connection.execute(query).scalar() or (standing.name if standing else None)
            if name is None:
                return False, []
            connection.execute(delete(session_table).where(session_table.c.id_hash == id_hash))
            return True, [self._audit.entry(kind, by, name, ended=id_hash[:12])]

        try:
            return await self._audit.with_entries(work)
        except StorageError:
            self._times.end(id_hash)
            self._unwritten[id_hash] = work
            raise
        finally:
            if by.session != id_hash:
                self.note_over([id_hash], "ended")
            self.announce([id_hash])

    def replaced(self, id_hash: str) -> None:
        """A session that the database still has is over by another one: its row goes as soon as that can be done, else it would be one
        again after a restart."""
        gone = delete(session_table).where(session_table.c.id_hash == id_hash)
        self._unwritten[id_hash] = lambda connection: (connection.execute(gone).rowcount > 0, [])

    async def write_ends(self) -> None:
        """Write what the database did not take when sessions were ended.

        Raises:
            StorageError: it does not take it yet.
        """
        for id_hash, work in tuple(self._unwritten.items()):
            await self._audit.with_entries(work)
            self._unwritten.pop(id_hash, None)

    def announce(self, hashes: Collection[str]) -> None:
        """Tell the subscribers that these sessions are over."""
        if not hashes:
            return
        self._epoch += 1
        for id_hash in hashes:
            self._known.pop(id_hash, None)
            self._touched.pop(id_hash, None)
        self._tell(self._ended, hashes)

    @staticmethod
    def _tell(subscribers: Iterable[Callable[[Collection[str]], None]], hashes: Collection[str]) -> None:
        for tell in subscribers if hashes else ():
            tell(hashes)

    async def _read(self, id_hash: str) -> _Known | None:
        """The session as the database has it now; it is known from now on, or no more."""
        for _ in range(3):
            epoch = self._epoch
            found = (await self._db.read(lambda connection: self._rows(connection, [id_hash]))).get(id_hash)
            if epoch == self._epoch:
                break
        if found is None or found[0].disabled or self._times.left(found[0]) <= 0:
            if id_hash in self._known:
                self.announce([id_hash])
            return None
        before = self._known.get(id_hash)
        known = self._known[id_hash] = _Known(*found, used=self._clock.monotonic())
        self._known.move_to_end(id_hash)
        while len(self._known) > MOST_KNOWN:
            self._known.popitem(last=False)
        if before is not None and before.rights() != known.rights():  # `renew` will see no difference any more
            self._tell(self._changed, [id_hash])
        return known

    def _person(self, known: _Known, address: str) -> Person:
        person = person_of(known.row, known.roles, address, self._times.quiet(known.row), self._factor_roles)
        return watching(person) if self.standing.watches_only(known.row.id_hash) else person

    def _rows(self, connection: Connection, hashes: Collection[str]) -> dict[str, tuple[Any, frozenset[str]]]:
        """Session → its row with that of its person, and the roles."""
        rows = {id_hash: (row, roles_of(connection, row.id)) for id_hash, row in self.standing.rows(connection, hashes)}
        for row in connection.execute(_OF_HASHES, {"hashes": list(hashes)}).all():
            rows[row.id_hash] = row, frozenset((row.roles or "").split())
        return rows


_ROLES = (
    select(func.aggregate_strings(role_table.c.role, " "))
    .where(role_table.c.person == session_table.c.person)
    .scalar_subquery()
    .label("roles")
)
_OF_HASHES = (
    select(session_table, person_table, factor_table.c.since.label("factor_since"), _ROLES)
    .join(person_table, session_table.c.person == person_table.c.id)
    .outerjoin(factor_table, factor_table.c.person == person_table.c.id)
    .where(session_table.c.id_hash.in_(bindparam("hashes", expanding=True)))
)
"""Made once, and one for all that is asked, as every request waits for its session."""
_ROLES_OF = select(role_table.c.role).where(role_table.c.person == bindparam("person_id"))


def hash_of(sid: str) -> str:
    """What is stored of an id or a token: SHA-256 [hex]; enough for 256 random bits."""
    return hashlib.sha256(sid.encode("utf-8", "replace")).hexdigest()


def end_all(connection: Connection, person_id: int) -> list[str]:
    """End all sessions of a person in this transaction; returns their hashes, to be announced after it."""
    mine = session_table.c.person == person_id
    ended = list(connection.execute(select(session_table.c.id_hash).where(mine)).scalars())
    connection.execute(delete(session_table).where(mine))
    return ended


def roles_of(connection: Connection, person_id: int) -> frozenset[str]:
    """The roles of a person."""
    return frozenset(connection.execute(_ROLES_OF, {"person_id": person_id}).scalars())


def limit_of(roles: Iterable[str]) -> int:
    """So many sessions somebody with `roles` may have at once."""
    return max((LIMITS[role] for role in roles), default=1)


def family(agent: str) -> str:
    """Browser and system that a User-Agent names, without versions: a session does not move from one to another."""
    text = agent[:400]
    browsers = (("Edg", "Edge"), ("OPR", "Opera"), ("Firefox", "Firefox"), ("Chrom", "Chrome"), ("Safari", "Safari"))
    systems = ("Android", "iPhone", "iPad", "Windows", "Mac OS X", "CrOS", "Linux")
    browser = next((name for sign, name in browsers if sign in text), None)
    system = next((name for name in systems if name in text), "")
    if browser is None:
        browser = printable(text.partition("/")[0].strip(), 40) or "?"
    return f"{browser}, {system}" if system else browser
