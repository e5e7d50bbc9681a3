"""What lists of events and of records have in common as CSV: newest first, page by page, with what they are in comments.

The file is one like those of the history (historian/export.py): the same separators, comments, number of rows and SHA-256.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar
from zoneinfo import ZoneInfo

from sqlalchemy import Connection

from app import __version__
from app.clock import to_datetime
from app.errors import ConfigurationError
from app.historian.calendar import Shifts
from app.historian.export import BOM, FORMATS, Sheet, clock, iso

PAGE = 500
"""Rows per question to the database."""
SHIFT = "shift"
"""Column of the shift."""
W = TypeVar("W", bound="ListExportSettings")
R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class ListExportSettings:
    """What somebody wants to take home."""

    wanted: Any
    """The filter: `equipment`, `begin`, `end`, and `before` for the next page."""
    zone: ZoneInfo
    """Of the local times."""
    locale: str = "machine"
    bom: bool = False
    headers: Mapping[str, str] = field(default_factory=dict)
    """Column → its name in the reader's language; else the column itself."""
    outcomes: Mapping[str, str] = field(default_factory=dict)
    most_rows: int = 0
    """0 = no limit."""
    filters: str = ""
    """The filter, as it is written into the file."""
    plant: str = ""
    person: str = ""
    created: int = 0
    """[µs UTC]"""
    simulated: bool = False
    shifts: Sequence[int] = ()
    """With the shift of each row, which begin at so many minutes of the local day."""

    def check(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigurationError: names the part, its value and what was expected.
        """
        if self.locale not in FORMATS:
            raise ConfigurationError(f"locale: {self.locale}, expected one of {', '.join(FORMATS)}")


class ListExport(Sheet, Generic[W, R]):
    """One export of a list under way."""

    title: ClassVar[str]
    """First line of the file."""
    stem: ClassVar[str]
    """Of its name."""

    def __init__(self, settings: W) -> None:
        """Raises:
        ConfigurationError: `settings` cannot be.
        """
        settings.check()
        self.settings = settings
        self.total = 0
        """Rows that it will have."""
        self._shifts = Shifts(settings.shifts, settings.zone) if settings.shifts else None
        super().__init__(settings.locale, settings.zone)

    @property
    def file_name(self) -> str:
        """A name for the file that says what is in it."""
        created = to_datetime(self.settings.created).astimezone(self.settings.zone)
        equipment = self.settings.wanted.equipment
        return f"pogon-{self.stem}{'-' * bool(equipment)}{equipment}-{created:%Y%m%d-%H%M%S}.csv"

    @property
    def progress(self) -> float:
        """How far it has come, 0 to 1."""
        return 1.0 if self.done or not self.total else min(1.0, self.rows / self.total)

    def open(self, connection: Connection) -> None:
        """Count what fits."""
        self.total = self._count(connection, self.settings.most_rows or 10**9)

    @abstractmethod
    def _count(self, connection: Connection, most: int) -> int:
        """Rows that fit, counted up to `most`."""

    @abstractmethod
    def _columns(self) -> Iterator[str]:
        """Names of the columns."""

    @abstractmethod
    def _page(self, connection: Connection, before: tuple[int, int] | None) -> Sequence[R]:
        """The next rows of the list, at most `PAGE`, after `before`."""

    @abstractmethod
    def _place(self, one: R) -> tuple[int, int]:
        """Its place in the list: time and number."""

    @abstractmethod
    def _line(self, one: R) -> str:
        """A row as a line."""

    def _all(self) -> Iterator[str | None]:
        settings, before = self.settings, self.settings.wanted.before
        if settings.bom:
            yield BOM
        yield from map(self._comment, self._head())
        shift = [settings.headers.get(SHIFT, SHIFT)] if settings.shifts else []
        yield self._separator.join(map(self._cell, (*shift, *self._columns()))) + "\r\n"
        while True:
            assert self._connection is not None
            found = self._page(self._connection, before)
            for one in found:
                if self.rows == settings.most_rows > 0:
                    self.complete = False
                    yield self._comment(f"incomplete: stopped at the limit of {self.rows} rows")
                    break
                self.rows += 1
                yield self._shift(self._place(one)[0]) + self._line(one)
            if len(found) < PAGE or not self.complete:
                break
            before = self._place(found[-1])
            yield None
        yield self._comment(f"rows: {self.rows}")

    def _head(self) -> Iterator[str]:
        settings, wanted = self.settings, self.settings.wanted
        yield f"Pogon {__version__} {self.title}"
        if settings.plant:
            yield f"plant: {settings.plant}"
        if settings.simulated:
            yield "SIMULATION: no real equipment"
        if settings.person:
            yield f"user: {settings.person}"
        if settings.created:
            yield f"created: {iso(settings.created, settings.zone)}"
        for name, time in (("from", wanted.begin), ("to", wanted.end)):
            if time is not None:
                yield f"{name}: {iso(time, settings.zone)}"
        yield f"time zone: {settings.zone.key}"
        if settings.shifts:
            yield f"shifts begin at: {' '.join(map(clock, settings.shifts))}"
        if settings.filters:
            yield f"filter: {settings.filters}"

    def _shift(self, time: int) -> str:
        """The cell before a row: when its shift began, on the wall and with its offset."""
        if self._shifts is None:
            return ""
        return shift_cell(self._shifts, time, self.settings.zone) + self._separator

    def _utc(self, time: int | None) -> str:
        return "" if time is None else self._times(time).partition(self._separator)[0]

    def _maybe(self, value: float | None) -> str:
        return "" if value is None else self._number(round(value, 6))


def shift_cell(shifts: Shifts, time: int, zone: ZoneInfo) -> str:
    """When the shift of a time began: 2026-03-28T22:00+01:00."""
    return to_datetime(shifts.of(time)).astimezone(zone).isoformat(timespec="minutes")
