"""One alarm at work: its definition, its layers, when it came and went, and how it is shown and written down."""

import json
import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from app.access.roles import Person
from app.alarms.conditions import ByEvent, Condition, Delay
from app.alarms.event_params import of_event
from app.alarms.journal import Record
from app.alarms.lifecycle import UNACKED, AlarmState, Life, Step, Traits
from app.alarms.shelf import Service, Shelf
from app.plant.definitions import Alarm
from app.plant.events import RingEvent
from app.plant.texts import Texts
from app.records.snapshot import Layout
from app.tags import quality
from app.tags.batch import Value

CHATTER_WINDOW = 60.0
CHATTERS = 3
"""An alarm that raised so often within the window [s] chatters."""


@dataclass(frozen=True, slots=True)
class ListedAlarm:
    """One alarm that is not normal, as lists show it. Texts are keys."""

    id: str
    occurrence: int
    equipment: str
    """Empty for the system."""
    area: str
    type: str
    """Equipment type whose texts are asked; empty = the product's."""
    key: str
    label: str
    consequence: str
    cause: str
    response: str
    params: Mapping[str, object]
    priority: int
    alarm_class: str
    state: AlarmState
    life: Life
    known: bool
    """False while the inputs of its condition are not: flag Q."""
    first_true: int
    """When the condition first was true [µs UTC]."""
    annunciated: int
    returned: int
    """0 = the condition holds."""
    acked_at: int
    acked_by: str
    point: str
    """Key of the point whose value is kept."""
    value: float | None
    limit: float | None
    count: int
    """How often it raised since it was last normal for a minute."""
    chattering: bool
    ordinal: int
    """Place in its first-out group; 0 = in none."""
    uncertain: bool
    """Another one of the group came in the same scan: the order is not known."""
    rule: str
    """What suppresses it."""
    shelf: Shelf | None
    service: Service | None
    audible: bool

    @property
    def unacked(self) -> bool:
        """Whether it waits for an acknowledgement."""
        return self.state in UNACKED

    @property
    def symbol(self) -> str:
        """`data-state` of its symbol."""
        return SYMBOLS[self.state]

    @property
    def order(self) -> tuple[bool, int, int, str]:
        """Unacknowledged first, then priority, then the newest, then by id."""
        return (not self.unacked, self.priority, -self.first_true, self.id)


SYMBOLS: Mapping[AlarmState, str] = {
    AlarmState.NORMAL: "none",
    AlarmState.UNACKNOWLEDGED: "unack",
    AlarmState.ACKNOWLEDGED: "ack",
    AlarmState.RETURNED: "rtn",
    AlarmState.LATCHED_UNACKNOWLEDGED: "rtn",
    AlarmState.LATCHED: "latch",
    AlarmState.SHELVED: "shlv",
    AlarmState.SUPPRESSED: "supp",
    AlarmState.OUT_OF_SERVICE: "oos",
}


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of an acknowledgement."""

    occurrence: int
    outcome: str
    """`done`, `already`, `gone` (that occurrence is over, or was never there) or `hidden`; text `alarm.answer.<outcome>`."""
    alarm: str = ""
    by: str = ""
    at: int = 0
    """When it was acknowledged [µs UTC]."""
    stored: bool = True
    """False: done, and in memory only, as the database has not taken it; lost if the server stops before it does."""


@dataclass(slots=True)
class Watch:
    """One alarm at work."""

    id: str
    index: int
    """Place in the order of evaluation."""
    equipment: str
    area: str
    type: str
    alarm: Alarm
    condition: Condition
    delay: Delay
    look: Callable[[str], tuple[Value, int]]
    age: Callable[[str], float | None]
    handles: frozenset[int]
    unit: str = ""
    decimals: int = 0
    once: bool = False
    params: Mapping[str, object] = field(default_factory=dict)
    life: Life = field(default_factory=Life)
    known: bool = True
    occurrence: int = 0
    first_true: int = 0
    annunciated: int = 0
    returned: int = 0
    acked_at: int = 0
    acked_by: str = ""
    value: float | None = None
    limit: float | None = None
    count: int = 0
    raises: deque[float] = field(default_factory=lambda: deque(maxlen=CHATTERS))
    """[s, monotonic]"""
    ordinal: int = 0
    uncertain: bool = False
    layout: Layout = field(default_factory=dict)
    """Of the snapshot words of its machine's events."""
    event: int = 0
    """Sequence of the device's event that raised it; 0 = none did."""
    shelf: Shelf | None = None
    """Who shelved it; None = nobody did."""
    service: Service | None = None
    """Who took it out of service; None = nobody did."""
    listed: ListedAlarm | None = None

    @property
    def traits(self) -> Traits:
        """What its definition asks of its life."""
        return Traits(self.alarm.latching, self.alarm.ack_required)

    def chattering(self, now: float) -> bool:
        """Whether it raised so often that only the last of it counts."""
        return len(self.raises) == CHATTERS and now - self.raises[0] <= CHATTER_WINDOW


def listed(watch: Watch, chattering: bool, rule: str) -> ListedAlarm:
    """How lists show it; `rule` is what suppresses it."""
    alarm = watch.alarm
    return ListedAlarm(
        id=watch.id,
        occurrence=watch.occurrence,
        equipment=watch.equipment,
        area=watch.area,
        type=watch.type,
        key=alarm.key,
        label=alarm.label,
        consequence=alarm.consequence,
        cause=alarm.cause,
        response=alarm.response,
        params=watch.params,
        priority=alarm.priority,
        alarm_class=alarm.alarm_class,
        state=watch.life.state,
        life=watch.life,
        known=watch.known,
        first_true=watch.first_true,
        annunciated=watch.annunciated,
        returned=watch.returned,
        acked_at=watch.acked_at,
        acked_by=watch.acked_by,
        point=alarm.value,
        value=watch.value,
        limit=watch.limit,
        count=watch.count,
        chattering=chattering,
        ordinal=watch.ordinal,
        uncertain=watch.uncertain,
        rule=rule,
        shelf=watch.shelf,
        service=watch.service,
        audible=alarm.audible,
    )


def record(
    watch: Watch, result: Step, at: int, person: Person | None, comment: str, detail: str, text: str, config: str
) -> Record:
    """The transition `result` of `watch` at `at` [µs UTC] for the journal; `text` is its text as written down."""
    life, alarm = watch.life, watch.alarm
    reading = watch.look(alarm.value) if alarm.value and not watch.event else (watch.value, quality.GOOD)
    hidden = (("shelved", life.shelved), ("suppressed", life.suppressed), ("oos", life.out_of_service))
    return Record(
        time=at,
        first_true=watch.first_true,
        event=str(result.entry),
        detail=" ".join(part for part in (result.detail, detail) if part)[:200],
        alarm=watch.id,
        occurrence=watch.occurrence,
        equipment=watch.equipment,
        area=watch.area,
        alarm_class=alarm.alarm_class,
        priority=alarm.priority,
        before=str(result.before),
        after=str(result.after),
        active=life.active,
        acked=life.acked,
        latched=life.latched,
        hidden="+".join(name for name, is_so in hidden if is_so),
        silent=result.silent,
        ordinal=watch.ordinal,
        value=number(reading),
        unit=watch.unit,
        quality=quality.name(reading[1]),
        limit=None if watch.limit is None else float(watch.limit),
        person_id=person.id if person else 0,
        person=person.name if person else "",
        roles=",".join(sorted(person.roles)) if person else "",
        address=person.address if person else "",
        session=person.session[:12] if person else "",
        comment=comment[:500],
        type=watch.type,
        text_id=alarm.label,
        params=json.dumps(watch.params, ensure_ascii=False, sort_keys=True, separators=(",", ":")),
        text=text,
        config=config,
    )


def carry(before: Watch, after: Watch) -> None:
    """What lives on when a definition is read anew."""
    after.life, after.known, after.uncertain = before.life, before.known, before.uncertain
    after.shelf, after.service = before.shelf, before.service
    after.occurrence, after.ordinal = before.occurrence, before.ordinal
    after.first_true, after.annunciated, after.returned = before.first_true, before.annunciated, before.returned
    after.acked_at, after.acked_by = before.acked_at, before.acked_by
    after.value, after.limit, after.params, after.event = before.value, before.limit, before.params, before.event
    after.count, after.raises = before.count, before.raises
    if isinstance(before.condition, ByEvent) and isinstance(after.condition, ByEvent):
        for name in ("raised", "until", "proved"):
            setattr(after.condition, name, getattr(before.condition, name))
    after.delay.active, after.delay.since, after.delay.at = before.delay.active, before.delay.since, before.delay.at


def explain(watch: Watch, event: RingEvent) -> None:
    """Take what the `event` that raised `watch` says of it: number, value and the words of its snapshot."""
    watch.event = event.sequence
    watch.value = event.value if math.isfinite(event.value) else watch.value
    watch.params = of_event(watch.layout, event, {} if watch.life.acked else watch.params)


def number(reading: tuple[Value, int]) -> float | None:
    value, word = reading
    if quality.is_bad(word) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def written(watch: Watch) -> dict[str, object]:
    """Parameters with value and limit for the text as it is written down; screens format them for their reader."""
    pairs = (("value", watch.value), ("limit", watch.limit))
    return {**watch.params, **{name: f"{one:.{watch.decimals}f}" for name, one in pairs if one is not None}}


def spoken(texts: Texts, lang: str, type: str, params: Mapping[str, object]) -> dict[str, object]:
    """Parameters in `lang`: one that begins with @ is the key of a text, a list is its parts in one."""

    def word(value: object) -> object:
        if isinstance(value, list | tuple):
            return "".join(str(word(part)) for part in value)
        return texts.of_former(lang, type, value[1:]) if isinstance(value, str) and value.startswith("@") else value

    return {name: word(value) for name, value in params.items()}
