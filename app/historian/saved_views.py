"""Views of trends that people keep under a name, for themselves or for all: in `pogon.db`.

A view is the address of the page without its path. What it may say is for the page to check; here it is a text that belongs to somebody.
What others see is audited: when a view is shared, and what becomes of it while it is.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Connection,
    ForeignKey,
    Integer,
    String,
    Table,
    Text,
    UniqueConstraint,
    delete,
    func,
    insert,
    select,
    update,
)

from app.access.accounts import Account
from app.access.audit.audit import Audit
from app.access.audit.kinds import Kind
from app.access.audit.line import Entry, printable
from app.access.roles import Person
from app.access.tables import person_table
from app.clock import Clock
from app.db import Database, pogon_tables
from app.errors import Refused

T = TypeVar("T")

LONGEST_NAME = 60
LONGEST_VIEW = 2000
MOST_VIEWS = 50
"""Of one person."""

view_table = Table(
    "trend_view",
    pogon_tables,
    Column("id", Integer, primary_key=True),
    Column("person", ForeignKey("person.id", ondelete="CASCADE"), nullable=False),
    Column("name", String(LONGEST_NAME), nullable=False),
    Column("query", Text, nullable=False),
    Column("shared", Boolean, nullable=False),
    Column("changed", BigInteger, nullable=False),
    UniqueConstraint("person", "name", name="uq_trend_view_name"),
    sqlite_autoincrement=True,
)


@dataclass(frozen=True, slots=True)
class SavedView:
    """One of them."""

    id: int
    person: int
    """Whose it is."""
    owner: str
    """Their name as it is shown."""
    name: str
    query: str
    shared: bool


class SavedViews:
    """The views of everybody, each changed by its owner alone."""

    def __init__(self, db: Database, audit: Audit, clock: Clock) -> None:
        self._db = db
        self._audit = audit
        self._clock = clock

    async def of(self, person: Person) -> Sequence[SavedView]:
        """Those that `person` may use: their own, then what others share, each by name."""
        table, people = view_table, person_table
        asked = (
            select(
                table.c.id, table.c.person, people.c.display, people.c.name, table.c.name, table.c.query, table.c.shared
            )
            .join(people, people.c.id == table.c.person)
            .where((table.c.person == person.id) | table.c.shared)
            .order_by(table.c.person != person.id, func.lower(table.c.name), table.c.id)
        )
        rows = await self._db.read(lambda connection: connection.execute(asked).all())
        return [SavedView(row[0], row[1], row[2] or row[3], *row[4:]) for row in rows]

    async def save(self, person: Person, name: str, query: str) -> None:
        """Keep `query` as `name`, for oneself.

        Raises:
            Refused: 422, the name is empty, too long or has hidden signs, or there are 50 already; 409, one's own view has this name.
        """
        called = _checked(name)

        def work(connection: Connection) -> None:
            own = connection.execute(select(view_table.c.name).where(view_table.c.person == person.id)).scalars().all()
            _free(called, own)
            if len(own) >= MOST_VIEWS:
                raise Refused("trend.error.views", 422, most=MOST_VIEWS)
            row = {
                "person": person.id,
                "name": called,
                "query": query,
                "shared": False,
                "changed": self._clock.micros(),
            }
            connection.execute(insert(view_table).values(**row))

        await self._db.write(work)

    async def rename(self, person: Person, number: int, name: str) -> None:
        """Call one's own view otherwise.

        Raises:
            Refused: as `save`; 404, it is not one's own.
        """
        called = _checked(name)

        def others(connection: Connection) -> None:
            own = view_table.c.person == person.id, view_table.c.id != number
            _free(called, connection.execute(select(view_table.c.name).where(*own)).scalars().all())

        await self._change(person, number, "trend.renamed", others, name=called)

    async def replace(self, person: Person, number: int, query: str) -> None:
        """Have one's own view show `query` from now on.

        Raises:
            Refused: 404, it is not one's own.
        """
        await self._change(person, number, "trend.changed", query=query)

    async def share(self, person: Person, number: int, shared: bool) -> None:
        """Let everybody use one's own view, or nobody else any more.

        Raises:
            Refused: 404, it is not one's own.
        """
        await self._change(person, number, "trend.shared" if shared else "trend.unshared", shared=shared)

    async def remove(self, person: Person, number: int) -> None:
        """Delete one's own view.

        Raises:
            Refused: 404, it is not one's own.
        """

        def work(connection: Connection) -> tuple[None, list[Entry]]:
            before = _own(connection, person, number)
            connection.execute(delete(view_table).where(view_table.c.id == number))
            return None, [self._audit.entry("trend.deleted", person, before.name)] if before.shared else []

        await self._audit.with_entries(work)

    async def shared_by(self) -> Mapping[int, int]:
        """How many views everybody shares, by person; who shares none is not in it.

        Raises:
            StorageError: the database cannot be read.
        """
        asked = select(view_table.c.person, func.count()).where(view_table.c.shared).group_by(view_table.c.person)
        rows = await self._db.read(lambda connection: connection.execute(asked).all())
        return {row[0]: row[1] for row in rows}

    def hand_over(self, connection: Connection, to: Person, account: Account) -> Sequence[Entry]:
        """Make what `account` shares with all `to`'s own in this transaction; returns the lines of it.

        A name that `to` has already gets that of the account behind it. Above 50 views `to` keeps no new one until some are deleted.
        """
        table = view_table.c
        own = connection.execute(select(table.name).where(table.person == to.id)).scalars().all()
        taken = {name.casefold() for name in own}
        theirs = select(table.id, table.name).where(table.person == account.id, table.shared).order_by(table.id)
        entries = []
        for row in connection.execute(theirs).all():
            name = _unlike(row.name, account.name, taken)
            taken.add(name.casefold())
            values = {"person": to.id, "name": name, "changed": self._clock.micros()}
            connection.execute(update(view_table).where(table.id == row.id).values(**values))
            entries.append(self._audit.entry("trend.handed_over", to, name, old=account.name, new=to.name))
        return entries

    async def _change(
        self,
        person: Person,
        number: int,
        kind: Kind,
        check: Callable[[Connection], None] = lambda _connection: None,
        **values: object,
    ) -> None:
        def work(connection: Connection) -> tuple[None, list[Entry]]:
            before = _own(connection, person, number)
            check(connection)
            changed = view_table.c.id == number
            connection.execute(update(view_table).where(changed).values(**values, changed=self._clock.micros()))
            entries = []
            if before.shared or values.get("shared"):
                old, new = (before.name, values["name"]) if "name" in values else ("", "")
                entries = [self._audit.entry(kind, person, before.name, old=old, new=new)]
            return None, entries

        await self._audit.with_entries(work)


def _own(connection: Connection, person: Person, number: int) -> SavedView:
    asked = select(view_table).where(view_table.c.id == number)
    row = connection.execute(asked).first() if 0 < number < 2**63 else None
    if row is None or row.person != person.id:  # that another has one with this number is nobody's business
        raise Refused("trend.error.no_view", 404)
    return SavedView(row.id, row.person, person.name, row.name, row.query, row.shared)


def _checked(name: str) -> str:
    called = " ".join(name.split())
    if not called or len(called) > LONGEST_NAME:
        raise Refused("trend.error.view_name", 422, most=LONGEST_NAME)
    if (shown := printable(called)) != called:
        raise Refused("trend.error.view_signs", 422, most=LONGEST_NAME, name=shown)
    return called


def _unlike(name: str, owner: str, taken: Collection[str]) -> str:
    """`name`, or with that of its owner and a number if need be, as none of `taken` is [casefolded]."""
    tails = ("", f" ({owner[:20]})", *(f" ({owner[:20]} {number})" for number in range(2, MOST_VIEWS + len(taken) + 2)))
    found = (f"{name[: LONGEST_NAME - len(tail)].rstrip()}{tail}" for tail in tails)
    return next(one for one in found if one.casefold() not in taken)


def _free(name: str, taken: Sequence[str]) -> None:
    if name.casefold() in {one.casefold() for one in taken}:
        raise Refused("trend.error.name_taken", 409, name=name)
