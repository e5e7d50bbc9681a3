"""Events of machines as CSV (event_export.py), newest first: one line each, in the words of the types."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sqlalchemy import Connection

from app.historian import event_search as search
from app.historian.event_export import PAGE, SHIFT, ListExport, ListExportSettings
from app.historian.event_gaps import Gap, Place, gaps
from app.historian.event_search import Codes, EventFilter
from app.historian.events import has_ring
from app.historian.export import iso
from app.plant.definitions import Equipment, Plant
from app.plant.texts import Texts
from app.records.event import Event
from app.records.snapshot import Layout, decode

COLUMNS = (
    "time_utc", "time_local", "equipment", "event", "code", "source", "value", "snapshot", "person", "reason", "command", "boot",
    "sequence",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class EventExportSettings(ListExportSettings):
    """Which events somebody wants to take home, and how."""

    wanted: EventFilter
    events: Mapping[tuple[str, int], str] = field(default_factory=dict)
    """(machine, code) → the event in words; else its code."""
    layouts: Mapping[str, Layout] = field(default_factory=dict)
    """Machine → what the words of its snapshots say."""
    fields: Mapping[tuple[str, str], str] = field(default_factory=dict)
    """(machine, name in the snapshot) → what it is called; else its name."""


class EventExport(ListExport[EventExportSettings, Event]):
    """One export of events under way."""

    title = "events of machines"
    stem = "events"

    def __init__(self, settings: EventExportSettings) -> None:
        super().__init__(settings)
        self._gaps: list[Gap] = []

    def open(self, connection: Connection) -> None:
        """Count what fits, and find what is missing."""
        super().open(connection)
        wanted = self.settings.wanted
        self._gaps = gaps(connection, wanted.equipment, wanted.begin, wanted.end)

    def _head(self) -> Iterator[str]:
        yield from super()._head()
        for gap in self._gaps:
            places = (("after", gap.after), ("before", gap.before))
            told = "".join(f" {word} {self._at(place)}" for word, place in places if place is not None)
            yield f"lost: {gap.count} events of {gap.equipment}{told}"

    def _at(self, place: Place) -> str:
        return f"{iso(place.time, self.settings.zone)} (boot {place.boot}, sequence {place.sequence})"

    def _count(self, connection: Connection, most: int) -> int:
        return search.count(connection, self.settings.wanted, most)

    def _columns(self) -> Iterator[str]:
        yield from (self.settings.headers.get(name, name) for name in COLUMNS)

    def _page(self, connection: Connection, before: tuple[int, int] | None) -> Sequence[Event]:
        return search.find(connection, replace(self.settings.wanted, before=before), PAGE)

    def _place(self, one: Event) -> tuple[int, int]:
        return one.time, one.id

    def _line(self, one: Event) -> str:
        settings = self.settings
        said = decode(settings.layouts.get(one.equipment, {}), one.words, one.code)
        named = ((settings.fields.get((one.equipment, name), name), value) for name, value in said.items())
        cells = [
            self._times(one.time),
            self._cell(one.equipment),
            self._cell(settings.events.get((one.equipment, one.code), str(one.code))),
            str(one.code),
            str(one.source),
            self._maybe(one.value),
            self._cell(
                " · ".join(f"{name} = {self._maybe(float(value))}" for name, value in named if value is not None)
            ),
            self._cell(one.person),
            self._cell(one.reason),
            str(one.request) if one.request else "",
            str(one.boot),
            str(one.sequence),
        ]
        return self._separator.join(cells) + "\r\n"


def with_ring(plant: Plant | None) -> list[Equipment]:
    """The machines that have an event ring."""
    return [item for item in plant.equipment.values() if has_ring(item)] if plant else []


def words(texts: Texts, plant: Plant | None, locale: str) -> dict[str, Any]:
    """`headers`, `events`, `layouts` and `fields` of an export in a language; for programs (`machine`) there are keys."""
    machines = with_ring(plant)
    layouts = {item.id: item.type.snapshot for item in machines}
    events = {(item.id, code): key for item in machines for code, key in item.type.events.items()}
    if locale == "machine":
        return {"events": events, "layouts": layouts}
    kinds = {item.id: item.type for item in machines}
    return {
        "headers": {name: texts.text(locale, f"events.csv.{name}") for name in (*COLUMNS, SHIFT)},
        "events": {(id, code): texts.of_type(locale, kinds[id], f"event.{key}") for (id, code), key in events.items()},
        "layouts": layouts,
        "fields": {
            (id, name): texts.of_type(locale, kinds[id], f"snapshot.{name}")
            for id, layout in layouts.items()
            for name in layout
        },
    }


def worded(texts: Texts, plant: Plant | None, lang: str, text: str) -> Codes:
    """Machine → codes of its events whose words have `text` in them."""
    wanted = text.casefold()
    return {
        item.id: [
            code
            for code, key in item.type.events.items()
            if wanted in texts.of_type(lang, item.type, f"event.{key}").casefold() or wanted == key
        ]
        for item in with_ring(plant)
    }


def coded(plant: Plant | None, key: str) -> Codes:
    """Machine → code of its event with this key."""
    return {
        item.id: [code for code, name in item.type.events.items() if name == key]
        for item in with_ring(plant)
        if key in item.type.events.values()
    }
