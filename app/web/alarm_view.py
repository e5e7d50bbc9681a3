"""How alarms are drawn: rows of the list, the banner, marks on tabs, tiles and pointers, all in the language of whoever looks."""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol
from zoneinfo import ZoneInfo

from app.alarms.definitions import PRIORITIES
from app.alarms.engine import AlarmEngine
from app.alarms.event_params import completed
from app.alarms.journal import HOUR, Record
from app.alarms.lifecycle import AlarmState
from app.alarms.shelf import Service, Shelf
from app.alarms.watch import SYMBOLS, ListedAlarm, spoken
from app.clock import Clock
from app.plant.definitions import Kind, Plant, Point
from app.plant.system import SYSTEM
from app.plant.texts import Texts
from app.web import format as fmt

PRIORITY_NAMES = {1: "critical", 2: "high", 3: "medium", 4: "low"}
STATE_NAMES: Mapping[AlarmState, str] = {
    AlarmState.NORMAL: "normal",
    AlarmState.UNACKNOWLEDGED: "unack",
    AlarmState.ACKNOWLEDGED: "ack",
    AlarmState.RETURNED: "rtn",
    AlarmState.LATCHED_UNACKNOWLEDGED: "latched_unack",
    AlarmState.LATCHED: "latched",
    AlarmState.SHELVED: "shelved",
    AlarmState.SUPPRESSED: "suppressed",
    AlarmState.OUT_OF_SERVICE: "oos",
}
"""State → `alarm.state.<name>`."""
MOST_MACHINES = 8
"""Rows of the summary; a plant with more machines is counted by area."""
MOST_OF_AREA = 8
"""Alarms that are named beside an area; its list has the others."""


class Surroundings(Protocol):
    """What drawing alarms needs of the runtime."""

    @property
    def alarms(self) -> AlarmEngine: ...
    @property
    def plant(self) -> Plant | None: ...
    @property
    def clock(self) -> Clock: ...


@dataclass(frozen=True, slots=True)
class Row:
    """One alarm as a line."""

    occurrence: int
    id: str
    equipment: str
    """Empty for the system."""
    source: str
    """What stands on its chip."""
    url: str
    """Screen of its machine; empty for the system."""
    text: str
    priority: int
    priority_text: str
    symbol: str
    """`data-state` of the symbol."""
    state_text: str
    locked: bool
    unacked: bool
    came: str
    came_second: str
    """As `came`, to the second."""
    iso: str
    since: int
    """When it came [µs UTC]."""
    lasted: str
    """How long it has stood, or stood."""
    counting: bool
    """Whether the duration goes on."""
    value: str
    """Value and limit when it came: `71 > 70 °C`."""
    count: int
    chattering: bool
    ordinal: int
    """Place in its first-out group; 0 while no other one of it stands."""
    uncertain: bool
    known: bool
    acked_by: str
    acked_at: str
    resettable: bool
    aside: str
    """Who put it aside, until when and why; empty = nobody did."""
    shelved: bool
    out: bool
    """Out of service."""
    review_due: bool


class Drawing:
    """Alarms in one language."""

    def __init__(
        self, runtime: Surroundings, texts: Texts, lang: str, shown_name: Callable[[str], str] = lambda name: name
    ) -> None:
        """`shown_name`: how the name of a person is written for this reader."""
        self.runtime = runtime
        self.texts = texts
        self.lang = lang
        self.shown_name = shown_name
        self.now = runtime.clock.micros()
        self._groups = Counter(one.equipment for one in runtime.alarms.list.active() if one.ordinal)
        self.zone = ZoneInfo(runtime.plant.timezone) if runtime.plant else ZoneInfo("UTC")

    def row(self, one: ListedAlarm) -> Row:
        """`one` as a line of the list."""
        active = one.life.active
        seconds = ((self.now if active else one.returned or self.now) - one.first_true) / 1e6
        return Row(
            occurrence=one.occurrence,
            id=one.id,
            equipment=one.equipment,
            source=one.equipment or SYSTEM,
            url=f"/equipment/{one.equipment}" if one.equipment else "",
            text=self.text(one),
            priority=one.priority,
            priority_text=self._("alarm.priority." + PRIORITY_NAMES[one.priority]),
            symbol=one.symbol,
            state_text=self._("alarm.state." + STATE_NAMES[one.state]),
            locked=one.life.latched and not active,
            unacked=one.unacked,
            came=self.moment(one.first_true),
            came_second=fmt.moment_or_time(one.first_true, self.zone, self.lang, self.now),
            iso=fmt.iso(one.first_true, self.zone),
            since=one.first_true,
            lasted=lasting(seconds),
            counting=active,
            value=self.value(one.equipment, one.point, one.value, one.limit),
            count=one.count,
            chattering=one.chattering,
            ordinal=one.ordinal if self._groups[one.equipment] > 1 else 0,
            uncertain=one.uncertain,
            known=one.known,
            acked_by=self.shown_name(one.acked_by),
            acked_at=self.moment(one.acked_at) if one.acked_at else "",
            resettable=one.state is AlarmState.LATCHED,
            aside=self.put_aside(one),
            shelved=one.life.shelved,
            out=one.life.out_of_service,
            review_due=one.service is not None and one.service.review_due(self.now),
        )

    def put_aside(self, one: ListedAlarm) -> str:
        """Everything that hides it, the strongest first: out of service, suppressed, shelved; each with who, when and why."""
        found = []
        if one.service is not None:
            permit = f" ({one.service.permit})" if one.service.permit else ""
            found.append(self._("alarm.out_since", **self._told(one.service) | {"permit": permit}))
        if one.life.suppressed:
            found.append(self._("alarm.suppressed_by_communication"))
        if one.shelf is not None:
            key = "alarm.shelved_once" if one.shelf.once else "alarm.shelved_until"
            found.append(self._(key, **self._told(one.shelf) | {"until": self._minute(one.shelf.until)}))
        return " · ".join(found)

    def _told(self, aside: Shelf | Service) -> dict[str, object]:
        by = self.shown_name(aside.by)
        return {"by": by, "reason": aside.reason if by == aside.by else "", "since": self._minute(aside.since)}

    def _minute(self, micros: int) -> str:
        today = fmt.date(micros, self.zone, self.lang) == fmt.date(self.now, self.zone, self.lang)
        clock = fmt.clock_time(micros, self.zone, seconds=False, lang=self.lang)
        return clock if today else f"{fmt.date(micros, self.zone, self.lang, year=False)} {clock}"

    def text(self, one: ListedAlarm, key: str = "") -> str:
        """Its text (or another one of its texts) with its parameters as this reader writes them."""
        return self.filled(
            one.type,
            key or one.label,
            self._params(one.equipment, one.point, one.value, one.limit, one.type, one.params),
        )

    def optional(self, one: ListedAlarm, key: str) -> str:
        """As `text`, empty where nobody has written one."""
        found = self.text(one, key)
        return "" if found in (f"[{key}]", "–") or found.endswith("] –") else found

    def recorded(self, record: Record) -> str:
        """The text of a journal record in this language; the one that was written down when its key is gone."""
        alarm = self.runtime.alarms.definition(record.alarm)
        point = alarm.value if alarm else ""
        params = self._params(record.equipment, point, record.value, record.limit, record.type, record.parameters)
        found = self.filled(record.type, record.text_id, params)
        return record.text if found == f"[{record.text_id}]" else found

    def filled(self, type: str, key: str, params: Mapping[str, object]) -> str:
        """A text of an equipment type or of the product."""
        return self.texts.of_type(self.lang, type, key, **params)

    def _params(
        self,
        equipment: str,
        point: str,
        value: float | None,
        limit: float | None,
        type: str,
        params: Mapping[str, object],
    ) -> dict[str, object]:
        found = self._point(equipment, point)
        decimals = found.decimals if found else 1  # the value of an event has no point that would say more
        shown = {
            name: fmt.number(one, decimals if name == "value" and found else fmt.shortest(one, decimals), self.lang)
            for name, one in (("value", value), ("limit", limit))
            if one is not None
        }
        unit = fmt.unit_symbol(found.unit, self._) if found and found.unit else ""
        kind = self.runtime.plant.types.get(type) if self.runtime.plant else None
        whole = completed(kind.snapshot, params) if kind else params
        plain = {
            name: fmt.number(one, fmt.shortest(one, 3), self.lang) if isinstance(one, float) else one
            for name, one in spoken(self.texts, self.lang, type, whole).items()
        }
        if not type and "account" in params:  # of our own alarms about people
            plain["account"] = self.shown_name(str(params["account"]))
        return {"unit": unit, **plain, **shown}

    def value(self, equipment: str, point: str, value: float | None, limit: float | None) -> str:
        """Value against limit with unit, or `–`: an enumeration says nothing as a number."""
        found = self._point(equipment, point)
        if found is None or value is None or found.texts or found.kind is Kind.ENUM:
            return "–"
        shown = fmt.number(value, found.decimals, self.lang)
        if limit is not None:
            sign = "=" if value == limit else ">" if value > limit else "<"
            shown += f" {sign} {fmt.number(limit, fmt.shortest(limit, found.decimals), self.lang)}"
        unit = fmt.unit_symbol(found.unit, self._)
        return f"{shown}{fmt.SPACE}{unit}" if unit else shown

    def moment(self, micros: int) -> str:
        """Time of day to the millisecond when it is of today, else date and time."""
        return fmt.moment_or_time(micros, self.zone, self.lang, self.now, milliseconds=True)

    def label_of(self, equipment: str) -> str:
        """Name of a machine, or of the system."""
        item = self.runtime.plant.equipment.get(equipment) if self.runtime.plant and equipment else None
        return self.texts.label(self.lang, item.label) if item else self._("alarm.system.name")

    def steps(self, text: str) -> list[str]:
        """A response as its steps: one sentence each."""
        parts: list[str] = []
        rest = text
        while rest:
            end = next(
                (
                    i + 1
                    for i, sign in enumerate(rest)
                    if sign == "." and rest[i + 1 : i + 2] == " " and rest[i + 2 : i + 3].isupper()
                ),
                len(rest),
            )
            parts.append(rest[:end].strip())
            rest = rest[end:].strip()
        return parts

    def _point(self, equipment: str, key: str) -> Point | None:
        item = self.runtime.plant.equipment.get(equipment) if self.runtime.plant else None
        return item.points.get(key) if item and key else None

    def _(self, key: str, /, **params: object) -> str:
        return self.texts.text(self.lang, key, **params)

    # ---- on every page --------------------------------------------------------------------------------

    def banner(self, *, may_view: bool, may_acknowledge: bool) -> dict[str, object]:
        """What the banner shows: the most important alarm that waits, counts, marks; without the right to view only the counts."""
        engine = self.runtime.alarms
        counts = engine.counts.values()
        first = engine.list.latest() if may_view else None
        unacked = int(str(counts["unack"]))
        return {
            "row": self.row(first) if first else None,
            "unknown": self.runtime.plant is None,  # nobody looks for alarms of machines
            "more": max(0, unacked - 1),
            "counts": [(one, counts[f"active_{one}"], counts[f"unack_{one}"]) for one in PRIORITIES],
            "total": counts["total"],
            "unack": unacked,
            "flood": len([at for at in engine.annunciations.times if self.now - at <= 600_000_000])
            if engine.annunciations.flood
            else 0,
            "may_view": may_view,
            "may_acknowledge": may_acknowledge,
            "news": engine.annunciations.count,
            "sound": counts["sound"],
            "revision": engine.list.revision,
            "marks": symbols(engine.list.active()) if may_view else {"of": {}, "area": {}, "part": {}, "point": {}},
        }

    def summary(self, area: str = "") -> dict[str, object]:
        """Alarms by machine or area, the last three, the last 24 hours; of one `area` by machine, the last few."""
        active = [one for one in self.runtime.alarms.list.active() if not area or (one.equipment and one.area == area)]
        plant = self.runtime.plant
        machines = [item for item in (plant.equipment.values() if plant else ()) if not area or item.area == area]
        by_machine = bool(area) or len(machines) <= MOST_MACHINES
        rows: dict[str, tuple[str, dict[int, int]]] = {}
        for item in machines:
            key = item.id if by_machine else item.area
            label = self.texts.label(self.lang, item.label) if by_machine else key
            if plant and not by_machine and item.area in plant.areas:
                label = self.texts.label(self.lang, plant.areas[item.area]) or key
            rows.setdefault(key, (label, dict.fromkeys(PRIORITIES, 0)))
        if not area:
            rows[SYSTEM] = (self._("alarm.system.name"), dict.fromkeys(PRIORITIES, 0))
        for one in active:
            of = one.equipment if by_machine else one.area
            rows[of if of in rows else SYSTEM][1][one.priority] += 1  # also of a machine that a reload took away
        newest = sorted(active, key=lambda one: -one.first_true)[: MOST_OF_AREA if area else 3]
        told = self.runtime.alarms.annunciations.times
        return {
            "area": area,
            "title": self._("alarm.of_area" if area else "alarm.by_machine" if by_machine else "alarm.by_area"),
            "rows": [(label, [counts[one] for one in PRIORITIES]) for label, counts in rows.values()],
            "newest": [(self.row(one), self._minute(one.first_true)) for one in newest],
            "told": len(told),
            "bars": bars(told, self.now, HOUR, 24),
            "axis": [fmt.clock_time(self.now - back * HOUR, self.zone, seconds=False) for back in (24, 12, 0)],
        }


def symbols(active: Iterable[ListedAlarm]) -> dict[str, dict[str, list[object]]]:
    """What is marked: machine, area, part and point → [priority, `data-state`] of its most important alarm.

    The part of a machine is the first word of the alarm's key: `cr1.hoist` of `hoist_encoder`.
    """
    found: dict[str, dict[str, list[object]]] = {"of": {}, "area": {}, "part": {}, "point": {}}
    for one in sorted(active, key=lambda one: (one.priority, not one.unacked)):
        mark: list[object] = [one.priority, one.symbol]
        if one.equipment:
            found["of"].setdefault(one.equipment, mark)
            found["area"].setdefault(one.area, mark)
            found["part"].setdefault(f"{one.equipment}.{one.key.partition('_')[0]}", mark)
            if one.point:
                found["point"].setdefault(f"{one.equipment}.{one.point}", mark)
    return found


def bars(times: Sequence[int], now: int, width: int, count: int) -> list[int]:
    """How many of `times` fall into each of the last `count` spans of `width` [µs], oldest first."""
    found = [0] * count
    for at in times:
        index = count - 1 - (now - at) // width
        if 0 <= index < count:
            found[index] += 1
    return found


def lasting(seconds: float) -> str:
    """A duration as a clock: `00:06`, `1:02:03`, `3 d 04:05`; static/js/alarms.js counts on."""
    whole = max(0, int(seconds))
    days, rest = divmod(whole, 86400)
    hours, rest = divmod(rest, 3600)
    minutes, left = divmod(rest, 60)
    if days:
        return f"{days}{fmt.SPACE}d {hours:02d}:{minutes:02d}"
    return f"{hours}:{minutes:02d}:{left:02d}" if hours else f"{minutes:02d}:{left:02d}"


def marks_json(found: Mapping[str, object]) -> str:
    """`symbols` for an attribute."""
    return json.dumps(found, ensure_ascii=False, separators=(",", ":"))


SYMBOL_OF: Mapping[str, str] = {str(state): symbol for state, symbol in SYMBOLS.items()}
"""Letter of a state → `data-state` of its symbol, for the journal."""
