"""What engineers change in the definitions of sequences before it is taken: a draft for each person, and every revision that was taken.

A draft is kept in `pogon.db` with each change, so that nothing is lost when a session ends or the server stops. It knows the text that
it was begun from: when somebody else's is taken meanwhile, the draft is told so and stays. Of two windows of one person the one that wrote
last goes on; the other one is told.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import (
    BigInteger,
    Column,
    Connection,
    ForeignKey,
    Integer,
    String,
    Table,
    Text,
    delete,
    func,
    insert,
    select,
)

from app.access.roles import Person
from app.access.tables import person_table
from app.clock import Clock
from app.db import Database, pogon_tables
from app.errors import Refused
from app.files import read_text
from app.plant.sequence_text import LARGEST_TEXT
from app.plant.sequences import FOLDER

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
class Other:
    """Somebody else with a draft of the same sequence."""

    name: str
    changed: int


class SequenceDrafts:
    """Drafts and revisions of the definitions in the plant folder `folder`."""

    def __init__(self, folder: Path, database: Callable[[], Database], clock: Clock) -> None:
        self._folder, self._database, self._clock = folder, database, clock

    def path(self, name: str) -> Path:
        """The file of the definition `name`."""
        return self._folder / FOLDER / f"{name}.toml"

    def file(self, name: str) -> str:
        """What is in it now, with plain line ends.

        Raises:
            UnusableFile: it cannot be read.
        """
        return read_text(self.path(name), LARGEST_TEXT, inside=self._folder).replace("\r\n", "\n")

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
        text = self.file(name)
        return Draft(text, text)

    async def save(self, person: Person, name: str, draft: Draft, text: str, *, tab: str, seen: int) -> Draft:
        """Keep `text` as the draft of `person`; `seen`: the version that the window `tab` began with.

        Raises:
            Refused: 409, another window wrote meanwhile; 413, it is too long.
            StorageError: it was not kept.
        """
        if len(text.encode()) > LARGEST_TEXT:
            raise Refused("editor.too_long", 413, most=LARGEST_TEXT // 1024)
        if draft.version not in (0, seen) and draft.tab != tab:
            raise Refused("editor.other_window", 409)
        now = self._clock.micros()

        def work(connection: Connection) -> Draft:
            row = connection.execute(
                select(draft_table.c.version, draft_table.c.tab).where(_of(person, name))
            ).one_or_none()
            if row is not None and row.version != seen and row.tab != tab:
                raise Refused("editor.other_window", 409)
            made = Draft(text, draft.base, max(draft.version, row.version if row else 0) + 1, tab, now)
            connection.execute(delete(draft_table).where(_of(person, name)))
            values = {"text": text, "base": made.base, "version": made.version, "tab": tab, "changed": now}
            connection.execute(insert(draft_table).values(sequence=name, person=person.id, **values))
            return made

        return await self._database().write(work)

    async def rebase(self, person: Person, name: str) -> None:
        """Go on with the draft as one of the file as it is now."""
        text = self.file(name)

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
            return [
                Revision(row.number, row.text, row.taken, row.person, row.reason, row.returned_to)
                for row in connection.execute(query)
            ]

        return await self._database().read(work)

    async def keep(self, person: Person, name: str, former: str, text: str, reason: str) -> Revision:
        """Write down that `text` is taken in place of `former`, which becomes a revision of its own if it was none.

        Raises:
            StorageError: it was not written down.
        """
        now, who = self._clock.micros(), person.display or person.name

        def work(connection: Connection) -> Revision:
            rows = connection.execute(
                select(revision_table).where(revision_table.c.sequence == name).order_by(revision_table.c.number)
            ).all()
            number = rows[-1].number if rows else 0
            if not rows or rows[-1].text != former:
                number += 1
                by_hand = {"person": "", "reason": "", "returned_to": 0, "taken": now, "text": former}
                connection.execute(insert(revision_table).values(sequence=name, number=number, **by_hand))
            same = [row.number for row in rows if row.text == text]
            made = Revision(number + 1, text, now, who, reason, same[-1] if same else 0)
            values = {"text": text, "taken": now, "person": who, "reason": reason, "returned_to": made.returned_to}
            connection.execute(insert(revision_table).values(sequence=name, number=made.number, **values))
            return made

        return await self._database().write(work)

    async def drop(self, name: str, number: int) -> None:
        """Revision `number` did not come to run."""
        here = (revision_table.c.sequence == name) & (revision_table.c.number == number)
        await self._database().write(lambda connection: connection.execute(delete(revision_table).where(here)))

    async def count(self, name: str) -> int:
        """Number of the newest revision; 0 = there is none."""
        query = select(func.max(revision_table.c.number)).where(revision_table.c.sequence == name)
        return await self._database().read(lambda connection: connection.execute(query).scalar() or 0)


def _of(person: Person, name: str):  # type: ignore[no-untyped-def]
    return (draft_table.c.sequence == name) & (draft_table.c.person == person.id)
