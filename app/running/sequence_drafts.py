"""What engineers change in the definitions of sequences before it is taken: a draft for each person, and every revision that was taken.

A draft is kept in `pogon.db` with each change, so that nothing is lost when a session ends or the server stops. It knows the text that
it was begun from: when somebody else's is taken meanwhile, the draft is told so and stays. Of two windows of one person the one that wrote
last goes on; the other one is told.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from sqlalchemy import (
    BigInteger,
    Column,
    ColumnElement,
    Connection,
    ForeignKey,
    Integer,
    Row,
    String,
    Table,
    Text,
    delete,
    func,
    insert,
    select,
)

from app.access.audit.audit import Audit
from app.access.audit.line import Entry
from app.access.roles import Person
from app.access.tables import audit_table, person_table
from app.clock import Clock
from app.db import Database, pogon_tables
from app.errors import Refused, UnusableFile
from app.files import read_text
from app.plant.sequence_text import LARGEST_TEXT
from app.plant.sequences import FOLDER

log = logging.getLogger(__name__)

OVERTAKEN = "editor.refused.overtaken"
"""Why a draft is not taken whose file is another one by now."""
KILLED = "editor.refused.killed"
"""Why a draft was not taken: the server was killed before it was written."""

draft_table = Table(
    "sequence_draft",
    pogon_tables,
    Column("sequence", String(32), primary_key=True),
    Column("person", ForeignKey("person.id", ondelete="CASCADE"), primary_key=True),
    Column("text", Text, nullable=False),
    Column("base", Text, nullable=False),
    Column("version", Integer, nullable=False),
    Column("tab", String(32), nullable=False),
    Column("changed", BigInteger, nullable=False),
)
revision_table = Table(
    "sequence_revision",
    pogon_tables,
    Column("sequence", String(32), primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("text", Text, nullable=False),
    Column("taken", BigInteger, nullable=False),
    Column("person", String(80), nullable=False),
    Column("reason", String(400), nullable=False),
    Column("returned_to", Integer, nullable=False),
)


@dataclass(frozen=True, slots=True)
class Draft:
    """How far a person is with a definition."""

    text: str
    base: str
    """The file as it was when the draft was begun."""
    version: int = 0
    """Counts its changes; 0 = there is none yet, it is the file."""
    tab: str = ""
    """The window that made the last one."""
    changed: int = 0
    """When [µs UTC]."""

    @property
    def begun(self) -> bool:
        """Whether there is anything to lose."""
        return self.version > 0


@dataclass(frozen=True, slots=True)
class Revision:
    """A definition as it was taken."""

    number: int
    """From 1."""
    text: str
    taken: int
    """When [µs UTC]."""
    person: str
    """Name; empty = the file was written by hand."""
    reason: str
    returned_to: int
    """The revision that it brought back; 0 = none."""


@dataclass(frozen=True, slots=True)
class Begun:
    """Of a taking that was begun and did not come to its end."""

    name: str
    person: Person
    revision: Revision


@dataclass(frozen=True, slots=True)
class Other:
    """Somebody else with a draft of the same sequence."""

    name: str
    changed: int


class SequenceDrafts:
    """Drafts and revisions of the definitions in the plant folder `folder`."""

    def __init__(self, folder: Path, database: Callable[[], Database], clock: Clock) -> None:
        self._folder, self._database, self._clock = folder, database, clock
        self.turn = asyncio.Lock()
        """Held from reading a draft to writing it: two requests of one window change it one after the other."""
        self._taking = asyncio.Lock()

    def path(self, name: str) -> Path:
        """The file of the definition `name`."""
        return self._folder / FOLDER / f"{name}.toml"

    async def file(self, name: str) -> str:
        """What is in it now, with plain line ends.

        Raises:
            UnusableFile: it cannot be read.
        """
        read = partial(read_text, self.path(name), LARGEST_TEXT, inside=self._folder)
        return (await asyncio.to_thread(read)).replace("\r\n", "\n")

    async def draft(self, person: Person, name: str) -> Draft:
        """The draft of `person`; without one, the file.

        Raises:
            UnusableFile, StorageError: neither can be read.
        """

        def work(connection: Connection) -> Draft | None:
            row = connection.execute(select(draft_table).where(_of(person, name))).one_or_none()
            return Draft(row.text, row.base, row.version, row.tab, row.changed) if row else None

        found = await self._database().read(work)
        if found is not None:
            return found
        text = await self.file(name)
        return Draft(text, text)

    async def save(self, person: Person, name: str, draft: Draft, text: str, *, tab: str, seen: int) -> Draft:
        """Keep `text` as the draft of `person`; `seen`: the version that the window `tab` began with.

        Raises:
            Refused: 409, another window wrote meanwhile; 413, it is too long.
            StorageError: it was not kept.
        """
        if len(text.encode()) > LARGEST_TEXT:
            raise Refused("editor.too_long", 413, most=LARGEST_TEXT // 1024)
        if draft.version != seen and draft.tab != tab:
            raise Refused("editor.other_window", 409)
        now = self._clock.micros()

        def work(connection: Connection) -> Draft:
            version = connection.execute(select(draft_table.c.version).where(_of(person, name))).scalar() or 0
            if version != draft.version:
                raise Refused("editor.other_window", 409)
            made = Draft(text, draft.base, version + 1, tab, now)
            connection.execute(delete(draft_table).where(_of(person, name)))
            values = {"text": text, "base": made.base, "version": made.version, "tab": tab, "changed": now}
            connection.execute(insert(draft_table).values(sequence=name, person=person.id, **values))
            return made

        return await self._database().write(work)

    async def rebase(self, person: Person, name: str) -> None:
        """Go on with the draft as one of the file as it is now."""
        text = await self.file(name)

        def work(connection: Connection) -> None:
            connection.execute(draft_table.update().where(_of(person, name)).values(base=text))

        await self._database().write(work)

    async def discard(self, person: Person, name: str) -> None:
        """Forget the draft of `person`."""
        await self._database().write(
            lambda connection: connection.execute(delete(draft_table).where(_of(person, name)))
        )

    async def others(self, person: Person, name: str) -> list[Other]:
        """Who else has a draft of it, the latest first."""

        def work(connection: Connection) -> list[Other]:
            query = (
                select(person_table.c.display, person_table.c.name, draft_table.c.changed)
                .join(person_table)
                .where(draft_table.c.sequence == name, draft_table.c.person != person.id)
                .order_by(draft_table.c.changed.desc())
            )
            return [Other(row.display or row.name, row.changed) for row in connection.execute(query)]

        return await self._database().read(work)

    # ---- revisions ------------------------------------------------------------------------------------

    async def revisions(self, name: str) -> list[Revision]:
        """All of them, the newest first."""

        def work(connection: Connection) -> list[Revision]:
            query = (
                select(revision_table).where(revision_table.c.sequence == name).order_by(revision_table.c.number.desc())
            )
            return [_revision(row) for row in connection.execute(query)]

        return await self._database().read(work)

    async def take(
        self, person: Person, name: str, draft: Draft, reason: str, into: Callable[[], Awaitable[bool]]
    ) -> Revision | None:
        """`draft` becomes a revision, its text the plant's by `into`, which says whether the plant took it; then the draft is no more.

        What `into` does not take leaves neither a revision nor a trace of one; None then.

        Raises:
            Refused: 409, the file is not what the draft was begun from.
            StorageError, UnusableFile: it was not written down.
        """
        async with self._taking:  # or the second of two would find a file that nobody wrote by hand
            if await self.file(name) != draft.base:
                raise Refused(OVERTAKEN, 409)
            revision, done = await self._keep(person, name, draft.base, draft.text, reason), False
            try:
                done = await into()
            finally:
                if not done:
                    await self._drop(name, revision.number)
            if done:
                await self.discard(person, name)
        return revision if done else None

    async def finish(self, audit: Audit) -> None:
        """End what a server that was killed was taking, and write it down: taken when the file has it, else no revision.

        Raises:
            StorageError: `pogon.db` does not take it.
        """
        for begun in await self._database().read(_begun):
            with suppress(UnusableFile):
                done = await self.file(begun.name) == begun.revision.text
                entry = audit.entry(
                    "plant.edited",
                    begun.person,
                    begun.name,
                    result="ok" if done else "refused",
                    reason=begun.revision.reason if done else KILLED,
                    changes=1,
                )
                await audit.with_entries(partial(_ended, begun, entry, done))
                log.warning("taking was interrupted sequence=%s taken=%s", begun.name, done)

    async def _keep(self, person: Person, name: str, former: str, text: str, reason: str) -> Revision:
        """Write down that `text` is taken in place of `former`, which becomes a revision of its own if it was none.

        Raises:
            StorageError: it was not written down.
        """
        now, who = self._clock.micros(), person.display or person.name

        def work(connection: Connection) -> Revision:
            mine = select(revision_table.c.number, revision_table.c.text).where(revision_table.c.sequence == name)
            newest = connection.execute(mine.order_by(revision_table.c.number.desc()).limit(1)).one_or_none()
            number = newest.number if newest else 0
            same = connection.execute(
                select(func.max(revision_table.c.number)).where(
                    revision_table.c.sequence == name, revision_table.c.text == text
                )
            ).scalar()
            if newest is None or newest.text != former:
                number += 1
                by_hand = {"person": "", "reason": "", "returned_to": 0, "taken": now, "text": former}
                connection.execute(insert(revision_table).values(sequence=name, number=number, **by_hand))
            made = Revision(number + 1, text, now, who, reason, same or 0)
            values = {"text": text, "taken": now, "person": who, "reason": reason, "returned_to": made.returned_to}
            connection.execute(insert(revision_table).values(sequence=name, number=made.number, **values))
            return made

        return await self._database().write(work)

    async def _drop(self, name: str, number: int) -> None:
        """Revision `number` did not come to run."""
        here = _numbered(name, number)
        await self._database().write(lambda connection: connection.execute(delete(revision_table).where(here)))


def _begun(connection: Connection) -> list[Begun]:
    """Drafts that are the newest revision of their sequence, begun from the one before: with the last step of taking they go."""
    found = []
    query = select(draft_table, person_table.c.name, person_table.c.display).join(person_table)
    for row in connection.execute(query).all():
        revisions = select(revision_table).where(revision_table.c.sequence == row.sequence)
        newest = connection.execute(revisions.order_by(revision_table.c.number.desc()).limit(2)).all()
        if len(newest) < 2 or row.changed > newest[0].taken or (newest[0].text, newest[1].text) != (row.text, row.base):
            continue
        who = Person(row.person, row.name, row.display, frozenset(), frozenset(), "")
        found.append(Begun(row.sequence, who, _revision(newest[0])))
    return found


def _ended(begun: Begun, entry: Entry, done: bool, connection: Connection) -> tuple[None, list[Entry]]:
    """The draft goes when it was taken, else its revision."""
    told = select(audit_table.c.seq).where(
        (audit_table.c.kind == entry.kind)
        & (audit_table.c.object == begun.name)
        & (audit_table.c.time >= begun.revision.taken)
        & (audit_table.c.result == "ok")
    )
    was_told = connection.execute(told.limit(1)).one_or_none() is not None
    if done:
        connection.execute(delete(draft_table).where(_of(begun.person, begun.name)))
    else:
        connection.execute(delete(revision_table).where(_numbered(begun.name, begun.revision.number)))
    return None, [] if was_told else [entry]


def _revision(row: Row[Any]) -> Revision:
    return Revision(row.number, row.text, row.taken, row.person, row.reason, row.returned_to)


def _numbered(name: str, number: int) -> ColumnElement[bool]:
    return (revision_table.c.sequence == name) & (revision_table.c.number == number)


def _of(person: Person, name: str) -> ColumnElement[bool]:
    return (draft_table.c.sequence == name) & (draft_table.c.person == person.id)
