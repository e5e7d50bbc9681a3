"""Notes that people put on trends: what was seen or done at a time, on a machine or on all; in `pogon.db`.

A note outlives the account of who wrote it, and is never changed: who wrote it, or an engineer, may delete it. Both is audited.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from sqlalchemy import BigInteger, Column, Connection, Integer, String, Table, delete, insert, select

from app.access.audit.audit import Audit
from app.access.audit.line import Entry, printable
from app.access.roles import Person
from app.clock import Clock
from app.db import Database, pogon_tables
from app.errors import Refused

LONGEST_NOTE = 300
MOST_NOTES = 200
"""On a page: the newest of the range."""

note_table = Table(
    "trend_note",
    pogon_tables,
    Column("id", Integer, primary_key=True),
    Column("time", BigInteger, nullable=False, index=True),
    Column("machine", String(64), nullable=False),
    Column("text", String(LONGEST_NOTE), nullable=False),
    Column("person", Integer, nullable=False),
    Column("author", String(80), nullable=False),
    Column("created", BigInteger, nullable=False),
    sqlite_autoincrement=True,
)


@dataclass(frozen=True, slots=True)
class Note:
    """One of them."""

    id: int
    time: int
    """What it is about [µs UTC]."""
    machine: str
    """Empty: all of them."""
    text: str
    person: int
    """Who wrote it; an id is never given twice."""
    author: str
    """Their name as it was."""
    created: int

    def may_be_deleted_by(self, person: Person) -> bool:
        """Whether it is theirs, or they are an engineer; whoever idles may not."""
        return person.may("annotate") and (self.person == person.id or person.may("configure"))


class Notes:
    """The notes of everybody."""

    def __init__(self, db: Database, audit: Audit, clock: Clock) -> None:
        self._db = db
        self._audit = audit
        self._clock = clock

    async def find(
        self, machines: Collection[str], begin: int, end: int, most: int | None = MOST_NOTES
    ) -> Sequence[Note]:
        """Those about `machines`, or about all, with begin <= time < end, in order; of more than `most` the newest, None: all."""
        about = note_table.c.machine.in_(["", *machines])
        asked = select(note_table).where(about, note_table.c.time >= begin, note_table.c.time < end)
        newest = asked.order_by(note_table.c.time.desc(), note_table.c.id.desc()).limit(most)
        rows = await self._db.read(lambda connection: connection.execute(newest).all())
        return [Note(*row) for row in reversed(rows)]

    async def add(self, person: Person, time: int, machine: str, text: str) -> None:
        """Write `text` at `time` [µs UTC].

        Raises:
            Refused: 422, the text is empty, too long or has control signs, or the time is still to come.
        """
        said, now = " ".join(text.split()), self._clock.micros()
        if not said or len(said) > LONGEST_NOTE or printable(said, LONGEST_NOTE) != said:
            raise Refused("trend.error.note", 422, most=LONGEST_NOTE)
        if not 0 < time <= now:
            raise Refused("trend.error.note_time", 422)
        row = {
            "time": time,
            "machine": machine,
            "text": said,
            "person": person.id,
            "author": person.display or person.name,
            "created": now,
        }

        def work(connection: Connection) -> tuple[None, list[Entry]]:
            connection.execute(insert(note_table).values(**row))
            return None, [self._audit.entry("trend.noted", person, machine, new=said)]

        await self._audit.with_entries(work)

    async def remove(self, person: Person, number: int) -> None:
        """Delete a note.

        Raises:
            Refused: 404, there is none with this number; 403, it is another's and `person` is no engineer.
        """

        def work(connection: Connection) -> tuple[None, list[Entry]]:
            asked = select(note_table).where(note_table.c.id == number)
            row = connection.execute(asked).first() if 0 < number < 2**63 else None
            if row is None:
                raise Refused("trend.error.no_note", 404)
            note = Note(*row)
            if not note.may_be_deleted_by(person):
                raise Refused("trend.error.not_your_note", 403)
            connection.execute(delete(note_table).where(note_table.c.id == number))
            return None, [self._audit.entry("trend.note_deleted", person, note.machine, old=note.text)]

        await self._audit.with_entries(work)
