"""Passages of products as CSV, newest first: one line each, with the times and corrections at its sensors.

The file is one like those of the history (historian/export.py): the same separators, comments, number of rows and SHA-256.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any
from zoneinfo import ZoneInfo

from sqlalchemy import Connection

from app import __version__
from app.clock import to_datetime
from app.errors import ConfigurationError
from app.historian import passage_query as query
from app.historian.export import BOM, FORMATS, Sheet, iso
from app.historian.passage_query import Passage, Step, Wanted
from app.historian.passages import Code, tracks_products
from app.plant.definitions import Equipment, Plant
from app.plant.texts import Texts

PAGE = 500
"""Passages per question to the database."""
MOST_SENSORS = 8
COLUMNS = (
    "entered_utc", "entered_local", "equipment", "product", "length_mm", "outcome", "ended_utc", "ended_local", "duration_s",
    "corrections", "greatest_mm", "alarms", "events_lost", "person", "reason",
)  # fmt: skip
SENSOR_COLUMNS = ("sensor_utc", "sensor_correction_mm")
"""Of each sensor; their headers have `{n}`."""


@dataclass(frozen=True, slots=True)
class PassageWish:
    """What somebody wants to take home."""

    wanted: Wanted
    zone: ZoneInfo
    """Of the local times."""
    locale: str = "machine"
    bom: bool = False
    sensors: int = 4
    """Sensors that have columns."""
    headers: Mapping[str, str] = field(default_factory=dict)
    """Column → its name in the reader's language; else the column itself."""
    outcomes: Mapping[str, str] = field(default_factory=dict)
    events: Mapping[tuple[str, int], str] = field(default_factory=dict)
    """(machine, code) → the event in words; else its code."""
    most_rows: int = 0
    """0 = no limit."""
    filters: str = ""
    """The filter, as it is written into the file."""
    plant: str = ""
    person: str = ""
    created: int = 0
    """[µs UTC]"""
    simulated: bool = False

    def check(self) -> None:
        """Refuse what cannot be.

        Raises:
            ConfigurationError: names the part, its value and what was expected.
        """
        if self.locale not in FORMATS:
            raise ConfigurationError(f"locale: {self.locale}, expected one of {', '.join(FORMATS)}")
        if not 0 <= self.sensors <= MOST_SENSORS:
            raise ConfigurationError(f"sensors: {self.sensors}, expected 0 to {MOST_SENSORS}")


class PassageExport(Sheet):
    """One export of passages under way."""

    def __init__(self, wish: PassageWish) -> None:
        """Raises:
        ConfigurationError: `wish` cannot be.
        """
        wish.check()
        self.wish = wish
        self.total = 0
        """Rows that it will have."""
        super().__init__(wish.locale, wish.zone)

    @property
    def file_name(self) -> str:
        """A name for the file that says what is in it."""
        created = to_datetime(self.wish.created).astimezone(self.wish.zone)
        return f"pogon-products{'-' * bool(self.wish.wanted.equipment)}{self.wish.wanted.equipment}-{created:%Y%m%d-%H%M%S}.csv"

    @property
    def progress(self) -> float:
        """How far it has come, 0 to 1."""
        return 1.0 if self.done or not self.total else min(1.0, self.rows / self.total)

    def open(self, connection: Connection) -> None:
        """Count what fits."""
        self.total = query.count(connection, self.wish.wanted, self.wish.most_rows or 10**9)

    def _all(self) -> Iterator[str | None]:
        wish = self.wish
        if wish.bom:
            yield BOM
        yield from map(self._comment, self._head())
        names = [wish.headers.get(name, name) for name in COLUMNS]
        for n in range(1, wish.sensors + 1):
            names += [
                wish.headers.get(name, name.replace("sensor", "s{n}")).replace("{n}", str(n)) for name in SENSOR_COLUMNS
            ]
        yield self._separator.join(map(self._cell, names)) + "\r\n"
        page = wish.wanted
        while True:
            assert self._connection is not None
            found = query.find(self._connection, page, PAGE)
            steps = query.steps(self._connection, [one.id for one in found])
            for one in found:
                if self.rows == wish.most_rows > 0:
                    self.complete = False
                    yield self._comment(f"incomplete: stopped at the limit of {self.rows} rows")
                    break
                self.rows += 1
                yield self._line(one, steps[one.id])
            if len(found) < PAGE or not self.complete:
                break
            page = replace(page, before=(found[-1].entered, found[-1].id))
            yield None
        yield self._comment(f"rows: {self.rows}")

    def _head(self) -> Iterator[str]:
        wish, wanted = self.wish, self.wish.wanted
        yield f"Pogon {__version__} product passages"
        if wish.plant:
            yield f"plant: {wish.plant}"
        if wish.simulated:
            yield "SIMULATION: no real equipment"
        if wish.person:
            yield f"user: {wish.person}"
        if wish.created:
            yield f"created: {iso(wish.created, wish.zone)}"
        for name, time in (("from", wanted.begin), ("to", wanted.end)):
            if time is not None:
                yield f"{name}: {iso(time, wish.zone)}"
        yield f"time zone: {wish.zone.key}"
        if wish.filters:
            yield f"filter: {wish.filters}"

    def _line(self, one: Passage, steps: Sequence[Step]) -> str:
        wish, nothing = self.wish, self._separator
        asked = next((step for step in reversed(steps) if step.person), None)
        cells = [
            self._times(one.entered),
            self._cell(one.equipment),
            str(one.product),
            self._maybe(one.length),
            self._cell(wish.outcomes.get(one.outcome, one.outcome)),
            nothing if one.ended is None else self._times(one.ended),
            self._maybe(one.duration),
            str(one.corrections),
            self._maybe(one.greatest),
            self._cell(" + ".join(wish.events.get((one.equipment, code), str(code)) for code in one.alarms)),
            str(one.missed),
            self._cell(asked.person if asked else ""),
            self._cell(asked.reason if asked else ""),
        ]
        seen = at_sensors(steps)
        for n in range(1, wish.sensors + 1):
            step = seen.get(n)
            cells.append("" if step is None else self._times(step.time).partition(self._separator)[0])
            cells.append("" if step is None or step.code != Code.HEAD else self._maybe(step.value))
        return self._separator.join(cells) + "\r\n"

    def _maybe(self, value: float | None) -> str:
        return "" if value is None else self._number(round(value, 6))


def at_sensors(steps: Sequence[Step]) -> dict[int, Step]:
    """Sensor → when the head was first seen there; at the first sensor it arrives."""
    found: dict[int, Step] = {}
    for step in steps:
        if step.code in (Code.ARRIVED, Code.HEAD) and 1 <= step.source <= MOST_SENSORS:
            found.setdefault(step.source, step)
    return found


def tracking(plant: Plant | None) -> list[Equipment]:
    """The machines that track products."""
    return [item for item in plant.equipment.values() if tracks_products(item)] if plant else []


def sensors(plant: Plant | None, equipment: str = "") -> int:
    """How many sensors the machine (empty: the one with the most) has, at most 8."""
    numbers = [
        sum(key.startswith("beam_") for key in item.points) for item in tracking(plant) if equipment in ("", item.id)
    ]
    return min(MOST_SENSORS, max(numbers, default=4) or 4)


def words(texts: Texts, plant: Plant | None, locale: str) -> dict[str, Any]:
    """`headers`, `outcomes` and `events` of a wish in a language; for programs (`machine`) events by their keys."""
    machines = tracking(plant)
    if locale == "machine":
        return {"events": {(item.id, code): key for item in machines for code, key in item.type.events.items()}}
    return {
        "headers": {name: texts.text(locale, f"products.csv.{name}") for name in (*COLUMNS, *SENSOR_COLUMNS)},
        "outcomes": {one: texts.text(locale, f"products.outcome.{one}") for one in query.OUTCOMES},
        "events": {
            (item.id, code): texts.of_type(locale, item.type, f"event.{key}")
            for item in machines
            for code, key in item.type.events.items()
        },
    }
