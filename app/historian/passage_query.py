"""Questions to the passages: what a person filters, page by page, newest first, and the steps of one."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import Connection

from app.historian.event_query import belonging, counted, filtered
from app.historian.events import lost as lost
from app.historian.passages import Outcome

ANY_ALARM = "any"
OUTCOMES: Sequence[str] = tuple(outcome.value for outcome in Outcome)


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which passages a person wants to see; what is empty does not filter."""

    equipment: str = ""
    begin: int | None = None
    """Entered at or after [µs UTC]."""
    end: int | None = None
    """Entered before."""
    product: int | None = None
    outcome: str = ""
    correction: float | None = None
    """Greatest correction above this [mm]."""
    alarm: str = ""
    """`any`, or the code of an event."""
    before: tuple[int, int] | None = None
    """Only what comes after this one in the list (entered, id): the next page."""


@dataclass(frozen=True, slots=True)
class Passage:
    """One product on one machine."""

    id: int
    equipment: str
    boot: int
    product: int
    entered: int
    """[µs UTC]"""
    entry: int
    """Code of the event with which it began; 0 = not seen."""
    length: float | None
    """[mm]"""
    corrections: int
    greatest: float | None
    """Greatest amount of a correction [mm]."""
    codes: str
    outcome: str
    ended: int | None
    missed: int
    """Events lost meanwhile."""

    @property
    def alarms(self) -> tuple[int, ...]:
        """Codes of its events that are alarms, in the order in which they first came."""
        return tuple(int(code) for code in self.codes.split())

    @property
    def duration(self) -> float | None:
        """How long it took [s]."""
        return None if self.ended is None else (self.ended - self.entered) / 1e6


@dataclass(frozen=True, slots=True)
class Step:
    """One event of a passage."""

    boot: int
    sequence: int
    time: int
    """[µs UTC]"""
    code: int
    source: int
    value: float | None
    second: int
    """Number of another product that is part of it; 0 = none."""
    second_value: float | None
    person: str
    """Who asked for it."""
    reason: str


COLUMNS = "id, equipment, boot, product, entered, entry, length, corrections, greatest, alarms, outcome, ended, missed"
STEP = "boot, sequence, time, code, source, value, second, second_value, person, reason"


def find(connection: Connection, wanted: Wanted, limit: int) -> list[Passage]:
    """The newest `limit` passages that `wanted` lets through, newest first."""
    where, given = _where(wanted)
    rows = connection.exec_driver_sql(
        f"SELECT {COLUMNS} FROM passage {where} ORDER BY entered DESC, id DESC LIMIT ?", (*given, limit)
    )
    return [Passage(*row) for row in rows]


def count(connection: Connection, wanted: Wanted, most: int) -> int:
    """How many passages `wanted` lets through, counted up to `most`."""
    return counted(connection, "passage", *_where(wanted), most)


def get(connection: Connection, number: int) -> Passage | None:
    """The passage `number`."""
    row = connection.exec_driver_sql(f"SELECT {COLUMNS} FROM passage WHERE id = ?", (number,)).first()
    return None if row is None else Passage(*row)


def steps(connection: Connection, numbers: Iterable[int]) -> Mapping[int, list[Step]]:
    """Passage → its events in the order of the ring."""
    return belonging(
        connection, f"SELECT passage, {STEP} FROM passage_step", "passage", "boot, sequence", numbers, Step
    )


def _where(wanted: Wanted) -> tuple[str, list[object]]:
    return filtered(
        (
            ("equipment = ?", wanted.equipment or None),
            ("entered >= ?", wanted.begin),
            ("entered < ?", wanted.end),
            ("product = ?", wanted.product),
            ("outcome = ?", wanted.outcome or None),
            ("greatest > ?", wanted.correction),
            ("instr(alarms, ?) > 0", f" {wanted.alarm} " if wanted.alarm not in ("", ANY_ALARM) else None),
            ("(entered, id) < (?, ?)", wanted.before),
        ),
        ("alarms <> ''",) if wanted.alarm == ANY_ALARM else (),
    )
