"""Who is signed in: sessions live on the server, survive a restart, and the browser holds only a random id.

Only SHA-256 of the id is stored. Rights are read from the database with every request, so a change of roles, a disabled account or a
closed session acts on the next one, also when the command line made it. Source: reference/security.md section 4.4.
"""

import hashlib
import re
import secrets
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace

from sqlalchemy import Connection, delete, insert, select, update

from app.access.audit import Audit, printable
from app.access.roles import ACTING, FORCED, IDLE, Person, permissions_of
from app.access.tables import person_table, role_table, session_table
from app.clock import Clock
from app.db import Database
from app.errors import StorageError

IDLE_AFTER = 15 * 60.0
"""Without a deed for so long a session only watches [s]."""
IDLE_WARNING = 60.0
"""So long before that the page says so [s]."""
SHIFT, SHIFT_WITH_POWER, WATCHING = 12 * 3600.0, 8 * 3600.0, 30 * 86_400.0
"""A session ends after a shift for an operator, 8 h for an engineer or administrator, 30 days for a viewer [s]."""
LIMITS = {"viewer": 10, "operator": 3, "engineer": 2, "admin": 1}
"""Sessions at once; who has several roles has the largest of their limits."""
TOUCH_PERIOD = 20.0
"""A deed is written at most so often [s]."""
ID_BYTES = 32
MOST_KNOWN = 1000
"""Sessions remembered for the time when the database cannot be read."""


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


class Sessions:
    """Opens, finds and ends sessions."""

    def __init__(self, db: Database, clock: Clock, audit: Audit) -> None:
        self._db = db
        self._clock = clock
        self._audit = audit
        self._ended: list[Callable[[Collection[str]], None]] = []
        self._touched: dict[str, int] = {}
        self._known: OrderedDict[str, Person] = OrderedDict()

    def subscribe(self, ended: Callable[[Collection[str]], None]) -> None:
        """Have `ended` called with the hashes of sessions that this process has just ended, so that sockets close at once."""
        self._ended.append(ended)

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
            person = await self._db.read(lambda connection: self._found(connection, id_hash, address, agent))
        except StorageError:
            known = self._known.get(id_hash)
            if known is None:
                raise
            return replace(known, permissions=known.permissions & IDLE, idle=True, idle_in=0.0)
        if person is None:
            self._known.pop(id_hash, None)
        else:
            self._known[id_hash] = person
            while len(self._known) > MOST_KNOWN:
                self._known.popitem(last=False)
        return person

    async def again(self, person: Person) -> Person | None:
        """`person` as of now, for a socket that stays open; None when its session is over.

        Raises:
            StorageError: the database cannot be read.
        """
        return await self._db.read(lambda connection: self._found(connection, person.session, person.address, None))

    def touch(self, person: Person) -> None:
        """`person` has just done something: the idle time starts anew. An idle session stays idle."""
        now = self._clock.micros()
        if not person.session or person.idle or now - self._touched.get(person.session, 0) < TOUCH_PERIOD * 1e6:
            return
        if len(self._touched) > 10_000:
            self._touched.clear()
        self._touched[person.session] = now
        session = session_table.c
        self._db.submit(
            lambda connection: connection.execute(
                update(session_table)
                .where(session.id_hash == person.session, session.active > now - IDLE_AFTER * 1e6)
                .values(active=now)
            )
        )

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
        connection.execute(delete(session_table).where((session.until <= now) | (session.id_hash == (replaces or ""))))
        limit = max((LIMITS[role] for role in held), default=1)
        kept = (
            select(session.id_hash)
            .where(session.person == person_id)
            .order_by(session.active.desc(), session.created.desc())
        )
        over = list(connection.execute(kept.offset(limit - 1)).scalars())
        if over:
            connection.execute(delete(session_table).where(session.id_hash.in_(over)))
        sid = secrets.token_urlsafe(ID_BYTES)
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
        return sid, over + ([replaces] if replaces else [])

    async def of(self, person_id: int | None = None) -> list[Session]:
        """Open sessions, of one person or of all, newest first.

        Raises:
            StorageError: the database cannot be read.
        """
        now = self._clock.micros()
        query = select(session_table).where(session_table.c.until > now).order_by(session_table.c.created.desc())
        if person_id is not None:
            query = query.where(session_table.c.person == person_id)
        rows = await self._db.read(lambda connection: connection.execute(query).all())
        return [Session(**row._mapping) for row in rows]

    async def end(self, by: Person, id_hash: str, kind: str = "session.ended") -> bool:
        """End one session; False when there is none.

        Raises:
            StorageError: the database did not take it.
        """

        def work(connection: Connection) -> tuple[bool, list[object]]:
            query = (
                select(person_table.c.name).join(session_table, session_table.c.person == person_table.c.id)
            ).where(session_table.c.id_hash == id_hash)
            name = connection.execute(query).scalar()
            if name is None:
                return False, []
            connection.execute(delete(session_table).where(session_table.c.id_hash == id_hash))
            return True, [self._audit.entry(kind, by, name, ended=id_hash[:12])]

        done = await self._audit.with_entries(work)  # type: ignore[arg-type]
        self.announce([id_hash])
        return bool(done)

    def announce(self, hashes: Collection[str]) -> None:
        """Tell the subscribers that these sessions are over."""
        for id_hash in hashes:
            self._known.pop(id_hash, None)
        if hashes:
            for ended in self._ended:
                ended(hashes)

    def _found(self, connection: Connection, id_hash: str, address: str, agent: str | None) -> Person | None:
        session, person = session_table.c, person_table.c
        row = connection.execute(
            select(session_table, person_table)
            .join(person_table, session.person == person.id)
            .where(session.id_hash == id_hash)
        ).first()
        now = self._clock.micros()
        if row is None or row.disabled or row.until <= now or (agent is not None and row.agent != family(agent)):
            return None
        roles = roles_of(connection, row.id)
        acting = bool(roles & ACTING)
        quiet = (now - max(row.active, self._touched.get(id_hash, 0))) / 1e6
        moved = bool(roles & {"engineer", "admin"}) and address != row.address
        idle = acting and (quiet >= IDLE_AFTER or moved)
        allowed = permissions_of(roles)
        if idle:
            allowed &= IDLE
        if row.must_change:
            allowed &= FORCED
        return Person(
            id=row.id,
            name=row.name,
            display=row.display,
            roles=roles,
            permissions=allowed,
            session=id_hash,
            language=row.language,
            theme=row.theme,
            address=address,
            idle=idle,
            must_change=bool(row.must_change),
            idle_in=max(0.0, IDLE_AFTER - quiet) if acting and not idle else 0.0,
        )


def hash_of(sid: str) -> str:
    """What is stored of an id or a token: SHA-256 [hex]; enough for 256 random bits."""
    return hashlib.sha256(sid.encode("utf-8", "replace")).hexdigest()


def lifetime(roles: Iterable[str]) -> float:
    """How long a session of somebody with `roles` lasts at most [s]."""
    held = set(roles)
    if held & {"engineer", "admin"}:
        return SHIFT_WITH_POWER
    return SHIFT if "operator" in held else WATCHING


def roles_of(connection: Connection, person_id: int) -> frozenset[str]:
    """The roles of a person."""
    query = select(role_table.c.role).where(role_table.c.person == person_id)
    return frozenset(connection.execute(query).scalars())


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
