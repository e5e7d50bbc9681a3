"""History as CSV: read in portions, so that an export of any length needs the same memory, and can be given up at any time.

Raw: `time_utc;time_local;tag;value;unit;quality;flags`, one line per sample, all tags in order of time. Aggregated: `time_utc;time_local;
tag;min;max;first;last;mean;unit;good_percent;samples`, one line per interval and tag; by shift, `end_local;shift;hours` stand before the
tag. A bad value is empty. Lines that begin with `#` tell
what the file is; the last two give the number of rows and the SHA-256 of everything before the last, which `verify_export` checks.
"""

import hashlib
import heapq
import re
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path
from zoneinfo import ZoneInfo

from sqlalchemy import Connection

from app import __version__
from app.clock import is_moment, to_datetime, to_micros
from app.db import Database
from app.errors import ConfigurationError
from app.historian import calendar, query
from app.historian.calendar import DAY
from app.historian.notes import Note
from app.historian.query import Recorded
from app.historian.store import GAP_AFTER, MINUTE
from app.tags.quality import Origin, name, origin

FORMATS: Mapping[str, tuple[str, str]] = {
    "hr": (";", ","),
    "en": (",", "."),
    "de": (";", ","),
    "cs": (";", ","),
    "machine": (",", "."),
}
"""Locale → separator, decimal sign (i18n.md section 6)."""
FLAGS: tuple[tuple[Origin, str], ...] = (
    (Origin.SIMULATED, "S"),
    (Origin.FORCED, "F"),
    (Origin.SUBSTITUTED, "M"),
    (Origin.LOCAL, "L"),
)
FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "|", "%")
"""A text cell that begins so is a formula to a spreadsheet program; an apostrophe before it makes it text."""
INSIDE = re.compile(
    r"""(?<=[;,\t\r\n])("*)(?=[=+\-@|%])(?!(?:[+-]?\d[\d.]*|[+\-@|%])(?:[;,\t\r\n]|$))""",
)
"""Where a cell begins for a program that is set to other separators than the file has, which no quotes prevent; neither number nor sign."""
CONTROLS = re.compile(r"[\x00-\x1f\x7f\x85\u2028\u2029]")
"""Signs that are none in a cell, ends of lines among them: a space stands for each."""
WHOLE = 2.0**53
"""Up to here every whole number is stored to the last unit."""
DIGITS = 15
"""Of any other number: as many as a double holds of any decimal; more would show its binary fraction."""
BOM = "\ufeff"
PAGE = 2000
"""Samples per question to the database."""
PORTION = 1000
"""Lines per portion."""
MOST_TAGS = 100
EARLIEST, LATEST = (to_micros(one.replace(tzinfo=UTC)) for one in (datetime.min, datetime.max))
COUNTED = 10 * 366 * DAY * 1_000_000
"""Shifts of no longer a time are counted one by one [µs]."""
ROOM = 2 * 366 * DAY * 1_000_000
"""Before and behind a range whose rows are intervals or shifts [µs]: these begin before it, and its last one ends behind it."""
CHECKSUM = b"# sha256: "


@dataclass(frozen=True, slots=True)
class ExportSettings:
    """What somebody wants to take home."""

    tags: Sequence[str]
    begin: int
    end: int
    """[µs UTC], without it."""
    zone: ZoneInfo
    """Of the local times."""
    interval: int = 0
    """Seconds per line; 0 = raw. Intervals that divide a day begin at their times of the local day."""
    shifts: Sequence[int] = ()
    """Instead of an interval, a line per shift; these begin at so many minutes of the local day."""
    locale: str = "machine"
    bom: bool = False
    """Mark the file as UTF-8 for spreadsheet programs."""
    most_rows: int = 0
    """0 = no limit; a file that stops there says so."""
    plant: str = ""
    person: str = ""
    created: int = 0
    """[µs UTC]."""
    simulated: bool = False
    notes: Sequence[Note] = ()
    """What people wrote of this time."""

    def check(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigurationError: names the part, its value and what was expected.
        """
        if not self.tags or len(self.tags) > MOST_TAGS:
            raise ConfigurationError(f"tags: {len(self.tags)} named, expected 1 to {MOST_TAGS}")
        if len(set(self.tags)) != len(self.tags):
            raise ConfigurationError("tags: one is named twice, expected each once")
        if self.end <= self.begin:
            raise ConfigurationError(
                f"to: {to_datetime(self.end).isoformat()} expected after {to_datetime(self.begin).isoformat()}"
            )
        if self.locale not in FORMATS:
            raise ConfigurationError(f"locale: {self.locale}, expected one of {', '.join(FORMATS)}")
        if not 0 <= self.interval <= 366 * DAY:
            raise ConfigurationError(
                f"interval: {self.interval}, expected 1 to {366 * DAY} seconds, or 0 for raw values"
            )
        if self.interval and self.shifts:
            raise ConfigurationError(f"interval: {self.interval}, expected none where a row is a shift")
        if self.interval or self.shifts:
            for field, time in (("from", self.begin), ("to", self.end)):
                if not ROOM <= time - EARLIEST <= LATEST - EARLIEST - ROOM:
                    said = to_datetime(time).isoformat()
                    raise ConfigurationError(f"{field}: {said}, expected the years 3 to 9997 where rows are aggregated")

    def count(self) -> int:
        """How many rows each tag has, of those that are aggregated; of centuries about."""
        if self.shifts and self.end - self.begin <= COUNTED:
            return sum(1 for _ in self.rows())
        span = self.interval or DAY // len(self.shifts)
        return -(-(self.end - self.begin) // (span * 1_000_000))

    def rows(self) -> Iterator[tuple[int, int]]:
        """From when to when each row is [µs UTC], of those that are aggregated."""
        if self.shifts:
            return calendar.shifts(self.begin, self.end, self.shifts, self.zone)
        return calendar.intervals(self.begin, self.end, self.interval, self.zone)


class Sheet:
    """A CSV file on its way out, in the separators of a language: `read` gives portion after portion until `done`."""

    def __init__(self, locale: str, zone: ZoneInfo) -> None:
        self.rows = 0
        """Rows so far."""
        self.done = False
        self.complete = True
        """False when the limit of rows ended it."""
        self._connection: Connection | None = None
        self._zone = zone
        self._separator, self._decimal = FORMATS[locale]
        self._digest = hashlib.sha256()
        self._lines = self._all()
        self._minute = -1
        self._stamps = ("", "", "")

    @property
    def file_name(self) -> str:
        """A name for the file that says what is in it."""
        raise NotImplementedError

    @property
    def progress(self) -> float:
        """How far it has come, 0 to 1."""
        raise NotImplementedError

    def open(self, connection: Connection) -> None:
        """Find what is to be read."""

    def read(self, connection: Connection) -> bytes:
        """The next portion; it may be empty before `done`."""
        if self._connection is None:
            self.open(connection)
        self._connection = connection
        lines: list[str] = []
        for line in self._lines:
            if line is None:
                break
            lines.append(line)
            if len(lines) >= PORTION:
                break
        else:
            self.done = True
        data = "".join(lines).encode()
        self._digest.update(data)
        if self.done:
            data += CHECKSUM + self._digest.hexdigest().encode() + b"\r\n"
        return data

    async def stream(self, database: Database) -> AsyncIterator[bytes]:
        """All portions, each read on a thread for those who read much: nothing of the database is held between them."""
        while not self.done:
            if data := await database.read_long(self.read):
                yield data

    def _all(self) -> Iterator[str | None]:
        raise NotImplementedError

    def _times(self, time: int) -> str:
        """UTC and local time with its offset [ISO 8601, ms]; rows of one minute share all but the seconds."""
        minute, rest = divmod(time, MINUTE)
        if minute != self._minute:
            utc = to_datetime(minute * MINUTE)
            local = utc.astimezone(self._zone)
            offset = local.isoformat(timespec="minutes")[16:]
            self._minute = minute
            self._stamps = (f"{utc:%Y-%m-%dT%H:%M:}", f"{self._separator}{local:%Y-%m-%dT%H:%M:}", offset)
        utc_head, local_head, offset = self._stamps
        seconds = f"{rest // 1_000_000:02d}.{rest // 1000 % 1000:03d}"
        return f"{utc_head}{seconds}Z{local_head}{seconds}{offset}"

    def _number(self, value: float) -> str:
        text = str(int(value)) if value.is_integer() and abs(value) <= WHOLE else f"{value:.{DIGITS}g}"
        if "e" in text:
            text = f"{Decimal(text):f}"
        return text if self._decimal == "." else text.replace(".", self._decimal)

    def _cell(self, text: str) -> str:
        """A text as one cell: no formula, no end of line, quoted where it must be."""
        return self._quoted(defused(text[:1] + CONTROLS.sub(" ", text[1:])))

    def _quoted(self, text: str) -> str:
        text = CONTROLS.sub(" ", text)
        return '"' + text.replace('"', '""') + '"' if re.search('[;,"]', text) else text

    def _comment(self, text: str) -> str:
        return self._quoted(f"# {text}") + "\r\n"


class Export(Sheet):
    """One export of samples under way."""

    def __init__(self, settings: ExportSettings) -> None:
        """Raises:
        ConfigurationError: `settings` cannot be.
        """
        settings.check()
        self.settings = settings
        self.reached = settings.begin
        """Up to which time [µs UTC]: of the range, so that progress can be shown."""
        self._points: list[Recorded] = []
        self._qualities: dict[int, str] = {}
        super().__init__(settings.locale, settings.zone)

    @property
    def progress(self) -> float:
        """How far it has come, 0 to 1."""
        return 1.0 if self.done else (self.reached - self.settings.begin) / (self.settings.end - self.settings.begin)

    @property
    def file_name(self) -> str:
        """A name for the file that says what is in it."""
        begin = to_datetime(self.settings.begin).astimezone(self.settings.zone)
        return f"pogon-{'history' if len(self.settings.tags) > 1 else self.settings.tags[0]}-{begin:%Y%m%d-%H%M%S}.csv"

    def open(self, connection: Connection) -> None:
        """Find the points.

        Raises:
            ConfigurationError: one of them was never recorded.
        """
        known = query.recorded(connection)
        missing = [tag for tag in self.settings.tags if tag not in known]
        if missing:
            raise ConfigurationError(f"tags: {', '.join(missing)}: nothing was ever recorded of it")
        self._points = [known[tag] for tag in self.settings.tags]

    def _all(self) -> Iterator[str | None]:
        if self.settings.bom:
            yield BOM
        yield from map(self._comment, self._head())
        aggregated = self.settings.interval > 0 or bool(self.settings.shifts)
        columns = BY_SHIFT if self.settings.shifts else AGGREGATED if aggregated else RAW
        yield self._separator.join(columns) + "\r\n"
        for line in self._aggregates() if aggregated else self._samples():
            if line is not None:
                if self.rows == self.settings.most_rows > 0:
                    self.complete = False
                    reached = iso(self.reached, self.settings.zone)
                    yield self._comment(f"incomplete: stopped at the limit of {self.rows} rows, at {reached}")
                    break
                self.rows += 1
            yield line
        yield self._comment(f"rows: {self.rows}")

    def _head(self) -> Iterator[str]:
        settings = self.settings
        yield f"Pogon {__version__} history"
        if settings.plant:
            yield f"plant: {settings.plant}"
        if settings.simulated:
            yield "SIMULATION: no real equipment"
        if settings.person:
            yield f"user: {settings.person}"
        if settings.created:
            yield f"created: {iso(settings.created, settings.zone)}"
        yield f"from: {iso(settings.begin, settings.zone)}"
        yield f"to: {iso(settings.end, settings.zone)}"
        yield f"time zone: {settings.zone.key}"
        if settings.shifts:
            yield f"values: aggregated by shift, which begin at {' '.join(map(clock, settings.shifts))}"
        else:
            yield f"values: aggregated every {settings.interval} s" if settings.interval else "values: raw"
        yield f"tags: {' '.join(settings.tags)}"
        if not settings.interval and not settings.shifts:
            yield "flags: S simulated, F forced, M substituted, L local"
        for note in settings.notes:
            about = f" {note.machine}" if note.machine else ""
            yield f"note: {iso(note.time, settings.zone)}{about} ({note.author}): {note.text}"

    def _samples(self) -> Iterator[str]:
        points, separator = self._points, self._separator
        tags = [self._cell(point.name) for point in points]
        units = [self._cell(point.unit) for point in points]
        for time, index, value, quality in heapq.merge(*(self._pages(i) for i in range(len(points)))):
            self.reached = time
            shown = self._cell(value) if isinstance(value, str) else "" if value is None else self._number(value)
            yield (
                f"{self._times(time)}{separator}{tags[index]}{separator}{shown}{separator}{units[index]}{separator}"
                f"{self._quality(quality)}\r\n"
            )

    def _pages(self, index: int) -> Iterator[tuple[int, int, float | str | None, int]]:
        """Samples of one point in order of time, from whichever connection there is when more are needed."""
        number, after = self._points[index].number, self.settings.begin - 1
        while True:
            assert self._connection is not None
            rows = query.page(self._connection, number, after, self.settings.end, PAGE)
            for time, value, quality in rows:
                yield time, index, value, quality
            if len(rows) < PAGE:
                return
            after = rows[-1][0]

    def _aggregates(self) -> Iterator[str | None]:
        separator = self._separator
        held = [_Held(self, index) for index in range(len(self._points))]
        heads = [(self._cell(point.name), self._cell(point.unit)) for point in self._points]
        for begin, end in self.settings.rows():
            shift = self._shift(begin, end) if self.settings.shifts else ""
            for one, (tag, unit) in zip(held, heads, strict=True):
                yield from one.gather(begin, end)
                numbers = (one.low, one.high, one.first, one.last, one.area / one.good if one.weighed else None)
                cells = ["" if value is None else self._number(value) for value in numbers]
                good = self._number(round(100 * one.good / (end - begin), 3))
                yield separator.join((self._times(begin) + shift, tag, *cells, unit, good, str(one.count))) + "\r\n"
            self.reached = end

    def _shift(self, begin: int, end: int) -> str:
        """When it ends on the wall, which of the day it is, and its hours: 7 and 9 in the two nights when the clock changes."""
        settings = self.settings
        number = calendar.number(begin, settings.shifts, settings.zone)
        hours = self._number(round((end - begin) / 3.6e9, 4))
        return "".join(f"{self._separator}{cell}" for cell in (iso(end, settings.zone), number, hours))

    def _quality(self, quality: int) -> str:
        known = self._qualities.get(quality)
        if known is None:
            flags = "".join(letter for flag, letter in FLAGS if origin(quality) & flag)
            known = self._qualities[quality] = f"{name(quality)}{self._separator}{flags}"
        return known


RAW = ("time_utc", "time_local", "tag", "value", "unit", "quality", "flags")
AGGREGATED = (
    "time_utc",
    "time_local",
    "tag",
    "min",
    "max",
    "first",
    "last",
    "mean",
    "unit",
    "good_percent",
    "samples",
)


BY_SHIFT = (*AGGREGATED[:2], "end_local", "shift", "hours", *AGGREGATED[2:])


def defused(text: str) -> str:
    """`text` so that no spreadsheet takes it, or what follows a separator in it, for a formula; a sign alone, as the unit %, is none."""
    inside = INSIDE.sub(r"\1'", text)
    return f"'{inside}" if text.startswith(FORMULA) and len(text) > 1 else inside


def clock(minute: int) -> str:
    """A minute of the day as on the clock."""
    return f"{minute // 60:02d}:{minute % 60:02d}"


class _Held:
    """One point on its way through the intervals: what held, and what comes next."""

    def __init__(self, export: Export, index: int) -> None:
        self._rows = export._pages(index)
        self._next = next(self._rows, None)
        self._time = 0
        self._valid = False
        self._level = 2
        self._value: float | None = None
        assert export._connection is not None
        before = query.at(export._connection, export._points[index].number, export.settings.begin - 1)
        if before is not None:
            self._hold(*before)

    def gather(self, begin: int, end: int) -> Iterator[None]:
        """Take everything from `begin` to `end` together; yields now and then, for a pause."""
        self.low = self.high = self.first = self.last = None
        self.area, self.good, self.count, self.weighed = 0.0, 0, 0, False
        cursor = begin
        while True:
            coming = self._next
            stop = end if coming is None or coming[0] >= end else coming[0]
            self._weigh(cursor, stop)
            if coming is None or coming[0] >= end:
                return
            cursor = coming[0]
            self._hold(cursor, coming[2], coming[3])
            self._note()
            self.count += 1
            self._next = next(self._rows, None)
            if self.count % PAGE == 0:
                yield None

    def _hold(self, time: int, value: float | str | None, quality: int) -> None:
        self._time, self._level = time, quality & 3
        self._valid = value is not None and self._level < 2
        self._value = value if self._valid and not isinstance(value, str) else None

    def _weigh(self, begin: int, end: int) -> None:
        held = min(end, self._time + GAP_AFTER) - begin
        if held <= 0 or not self._valid:
            return
        self._note()
        if self._level == 0:
            self.good += held
            if self._value is not None:
                self.area += self._value * held
                self.weighed = True

    def _note(self) -> None:
        value = self._value
        if value is None:
            return
        self.low = value if self.low is None else min(self.low, value)
        self.high = value if self.high is None else max(self.high, value)
        self.first = value if self.first is None else self.first
        self.last = value

    low: float | None
    high: float | None
    first: float | None
    last: float | None
    area: float
    good: int
    count: int
    weighed: bool


def iso(micros: int, zone: ZoneInfo) -> str:
    return to_datetime(micros // 1000 * 1000).astimezone(zone).isoformat(timespec="milliseconds")


LONGEST_MOMENT = 40
RELATIVE = re.compile(r"^(?:now)?-(\d{1,9})(s|m|min|h|d)$")
SECONDS = {"s": 1, "m": 60, "min": 60, "h": 3600, "d": DAY}


def moment(text: str, zone: ZoneInfo, now: int) -> int:
    """A time that a person or a page wrote, as µs UTC: µs, ISO 8601 (without an offset: in `zone`), `now`, `-8h` (s, min, h, d ago).

    Raises:
        ConfigurationError: it is none of these.
    """
    text = text.strip()
    if text == "now":
        return now
    try:
        if len(text) > LONGEST_MOMENT:
            raise ValueError
        if match := RELATIVE.match(text):
            micros = now - int(match[1]) * SECONDS[match[2]] * 1_000_000
        elif re.fullmatch(r"\d{9,16}", text):
            micros = int(text)
        else:
            value = datetime.fromisoformat(text.replace(" ", "+") if re.search(r"T.* \d\d:?\d\d$", text) else text)
            micros = to_micros(value if value.tzinfo else value.replace(tzinfo=zone))
        to_datetime(micros).astimezone(zone)
    except (ValueError, OverflowError) as error:
        raise ConfigurationError(
            f"time: {text[:LONGEST_MOMENT]}, expected 2026-03-09T06:00, 2026-03-09T06:00+01:00, µs since 1970, now, or -8h"
        ) from error
    return micros


def span(begin: str, end: str, zone: ZoneInfo, now: int) -> tuple[int, int]:
    """Two times as `moment` takes them.

    Raises:
        ConfigurationError: one is none, or the second is not after the first; names what was written and what it means.
    """
    first, last = moment(begin, zone, now), moment(end, zone, now)
    if last <= first:
        raise ConfigurationError(
            f"to: {meant(end, last, zone)}, expected a time after from: {meant(begin, first, zone)}"
        )
    return first, last


def meant(text: str, micros: int, zone: ZoneInfo) -> str:
    """What somebody wrote, and what time that is when it is not the same: relative, with another offset, or left out by the clock."""
    if not is_moment(micros):
        return text.strip()
    local = to_datetime(micros).astimezone(zone).isoformat(timespec="seconds")
    return text.strip() if local.startswith(text.strip()) else f"{text.strip()} (= {local})"


@dataclass(frozen=True, slots=True)
class Check:
    """What verifying an export found."""

    ok: bool
    rows: int
    why: str = ""


def verify_export(path: Path) -> Check:
    """Whether the file is as it was written: SHA-256 and number of rows.

    Raises:
        OSError: it cannot be read.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(0, size - 200))
        tail = file.read()
        place = tail.rfind(CHECKSUM)
        if place < 0:
            return Check(False, 0, "it has no checksum at its end: it was cut off or is none of ours")
        said = tail[place + len(CHECKSUM) :].decode("ascii", "replace")
        left = max(0, size - 200) + place
        file.seek(0)
        digest, rows, counted = hashlib.sha256(), 0, -1
        for line in file:
            line = line[:left]
            left -= len(line)
            digest.update(line)
            rows += line[:1].isdigit()
            if line.startswith(b"# rows: "):
                counted = int(line[8:].strip() or -1)
            if left <= 0:
                break
    if said != digest.hexdigest() + "\r\n":
        return Check(False, rows, "its checksum is not that of its content: it was changed")
    if rows != counted:
        return Check(False, rows, f"it has {rows} rows and says {counted}")
    return Check(True, rows)
