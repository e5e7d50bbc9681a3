"""Passages of products as CSV (event_export.py), newest first: one line each, with the times and corrections at its sensors."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sqlalchemy import Connection

from app.errors import ConfigurationError
from app.historian import passage_query as query
from app.historian.event_export import PAGE, ListExport, ListWish
from app.historian.passage_query import Passage, Step, Wanted
from app.historian.passages import Code, tracks_products
from app.plant.definitions import Equipment, Plant
from app.plant.texts import Texts

MOST_SENSORS = 8
COLUMNS = (
    "entered_utc", "entered_local", "equipment", "product", "length_mm", "outcome", "ended_utc", "ended_local", "duration_s",
    "corrections", "greatest_mm", "alarms", "events_lost", "person", "reason",
)  # fmt: skip
SENSOR_COLUMNS = ("sensor_utc", "sensor_correction_mm")
"""Of each sensor; their headers have `{n}`."""


@dataclass(frozen=True, slots=True)
class PassageWish(ListWish):
    """Which passages somebody wants to take home, and how."""

    wanted: Wanted
    sensors: int = 4
    """Sensors that have columns."""
    events: Mapping[tuple[str, int], str] = field(default_factory=dict)
    """(machine, code) → the event in words; else its code."""

    def check(self) -> None:
        ListWish.check(self)
        if not 0 <= self.sensors <= MOST_SENSORS:
            raise ConfigurationError(f"sensors: {self.sensors}, expected 0 to {MOST_SENSORS}")


class PassageExport(ListExport[PassageWish, Passage]):
    """One export of passages under way."""

    title = "product passages"
    stem = "products"

    def __init__(self, wish: PassageWish) -> None:
        super().__init__(wish)
        self._steps: Mapping[int, Sequence[Step]] = {}
        """Of the page at hand."""

    def _count(self, connection: Connection, most: int) -> int:
        return query.count(connection, self.wish.wanted, most)

    def _columns(self) -> Iterator[str]:
        headers = self.wish.headers
        yield from (headers.get(name, name) for name in COLUMNS)
        for n in range(1, self.wish.sensors + 1):
            for name in SENSOR_COLUMNS:
                yield headers.get(name, name.replace("sensor", "s{n}")).replace("{n}", str(n))

    def _page(self, connection: Connection, before: tuple[int, int] | None) -> Sequence[Passage]:
        found = query.find(connection, replace(self.wish.wanted, before=before), PAGE)
        self._steps = query.steps(connection, [one.id for one in found])
        return found

    def _place(self, one: Passage) -> tuple[int, int]:
        return one.entered, one.id

    def _line(self, one: Passage) -> str:
        wish, nothing, steps = self.wish, self._separator, self._steps[one.id]
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
            cells.append(self._utc(None if step is None else step.time))
            cells.append("" if step is None or step.code != Code.HEAD else self._maybe(step.value))
        return self._separator.join(cells) + "\r\n"


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
