"""When an alarm's condition is true, and since when: limits with dead-band, deviation, rate, sentences, quality; delays. Pure.

A condition says True, False or None: None means that its inputs are not known. What is not known neither raises nor returns anything: an
alarm never comes from garbage and never goes because the data vanished (reference/alarms.md T22). Times are monotonic seconds.

The dead-band works on the return side only: a high alarm raises at `value >= limit` and returns at `value < limit - dead_band`.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

from app.plant import expression
from app.plant.definitions import Alarm
from app.plant.expression import Age, Expression, Look
from app.tags.quality import is_bad

Truth = bool | None

EVENT_LATE = 2.0
"""How long an event may come after the value that it explains, and the value after the event [s]."""


class Condition(Protocol):
    """Says whether the alarm should stand."""

    def holds(self, look: Look, held: bool, now: float, age: Age | None = None) -> Truth:
        """True, False or not known at `now` [s]; `held` says whether the alarm stands, because returning may ask for more."""
        ...


@dataclass(frozen=True, slots=True)
class High:
    """`value >= limit`, until `value < limit - dead_band` [EU]."""

    point: str
    limit: float
    dead_band: float = 0.0

    def holds(self, look: Look, held: bool, now: float, age: Age | None = None) -> Truth:
        value = known(look, self.point)
        if value is None:
            return None
        return value >= (self.limit - self.dead_band if held else self.limit)


@dataclass(frozen=True, slots=True)
class Low:
    """`value <= limit`, until `value > limit + dead_band` [EU]."""

    point: str
    limit: float
    dead_band: float = 0.0

    def holds(self, look: Look, held: bool, now: float, age: Age | None = None) -> Truth:
        value = known(look, self.point)
        if value is None:
            return None
        return value <= (self.limit + self.dead_band if held else self.limit)


@dataclass(frozen=True, slots=True)
class Deviation:
    """`|value - reference| >= limit`, until below `limit - dead_band` [EU]."""

    point: str
    reference: str
    limit: float
    dead_band: float = 0.0

    def holds(self, look: Look, held: bool, now: float, age: Age | None = None) -> Truth:
        value, reference = known(look, self.point), known(look, self.reference)
        if value is None or reference is None:
            return None
        return abs(value - reference) >= (self.limit - self.dead_band if held else self.limit)


@dataclass(slots=True)
class Rate:
    """`|change| >= limit` per second over the last `window` seconds, until below `limit - dead_band` [EU/s].

    The change is taken between now and the newest value that is at least `window` old; until there is one, nothing is known. A value
    that is not known starts the window again.
    """

    point: str
    limit: float
    window: float
    dead_band: float = 0.0
    _seen: deque[tuple[float, float]] = field(default_factory=deque, repr=False)

    def holds(self, look: Look, held: bool, now: float, age: Age | None = None) -> Truth:
        value = known(look, self.point)
        if value is None:
            self._seen.clear()
            return None
        self._seen.append((now, value))
        while len(self._seen) > 1 and self._seen[1][0] <= now - self.window:
            self._seen.popleft()
        then, before = self._seen[0]
        if now - then < self.window:
            return None
        rate = abs(value - before) / (now - then)
        return rate >= (self.limit - self.dead_band if held else self.limit)


@dataclass(frozen=True, slots=True)
class Discrete:
    """A sentence of the small grammar, with another one for when it is over; without that, it is over when the first is false."""

    raises: Expression
    clears: Expression | None = None

    def holds(self, look: Look, held: bool, now: float, age: Age | None = None) -> Truth:
        if held and self.clears is not None:
            over = self.clears.true(look, age=age)
            return None if over is None else not over
        return self.raises.true(look, age=age)


@dataclass(frozen=True, slots=True)
class BadQuality:
    """The quality of a point is bad, or there is no value; always known."""

    point: str

    def holds(self, look: Look, held: bool, now: float, age: Age | None = None) -> Truth:
        value, quality = look(self.point)
        return is_bad(quality) or value is None


@dataclass(slots=True)
class Reported:
    """What another part of the system says: a task is down, a command was not confirmed. It stands until it is said to be over.

    With `until`, a sentence over the equipment's points, it is over when that holds.
    """

    active: bool = False
    until: Expression | None = None

    def holds(self, look: Look, held: bool, now: float, age: Age | None = None) -> Truth:
        if self.active and self.until is not None and self.until.true(look, age=age):
            self.active = False
        return self.active


@dataclass(slots=True)
class ByEvent:
    """An event of the device raised it; the engine says so. With a sentence it stands as long as that is true, and the sentence alone
    raises it when the event was lost. Without one it stands until another event ends it, or not at all.
    """

    sentence: Discrete | None = None
    lasts: bool = False
    """Another event ends it."""
    raised: bool = False
    """An event raised it, and nothing has ended it."""
    until: float = 0.0
    """Up to then a sentence that is false may be older than the event [s, monotonic]."""
    proved: bool = False
    """The sentence was seen true since the event."""

    @property
    def momentary(self) -> bool:
        """Whether it is over at once."""
        return self.sentence is None and not self.lasts

    @property
    def settling(self) -> bool:
        """Whether the event stands and its sentence has not been seen true yet."""
        return self.raised and self.sentence is not None and not self.proved

    def begin(self, until: float) -> None:
        """The event has come; `until` when its sentence counts, should it be false till then."""
        self.raised, self.proved, self.until = not self.momentary, False, until

    def holds(self, look: Look, held: bool, now: float, age: Age | None = None) -> Truth:
        if self.sentence is None:
            return self.raised
        truth = self.sentence.holds(look, held, now, age)
        if not self.raised or truth is None:
            return truth
        if truth:
            self.proved = True
        elif self.proved or now >= self.until:
            self.raised = False
        return self.raised


class Kind(StrEnum):
    """Ways of saying a condition in a row of alarms."""

    EXPRESSION = "expression"
    HIGH = "high"
    LOW = "low"
    DEVIATION = "deviation"
    RATE = "rate"
    BAD_QUALITY = "bad_quality"


def condition(alarm: Alarm) -> Condition:
    """The condition of an alarm row.

    Raises:
        ConfigurationError: its sentence is none of the grammar (the plant reader has refused it before).
    """
    if alarm.event:
        return ByEvent(_discrete(alarm) if alarm.expression else None, alarm.event_clear > 0)
    return _BUILD[Kind(alarm.kind)](alarm)


def delay(alarm: Alarm) -> "Delay":
    """The delays of an alarm row: a sentence beside an event waits for it."""
    return Delay(max(alarm.on_delay, EVENT_LATE) if alarm.event else alarm.on_delay, alarm.off_delay)


def inputs(alarm: Alarm) -> frozenset[str]:
    """Keys of the points that decide it."""
    if alarm.kind == Kind.EXPRESSION:
        sentences = [text for text in (alarm.expression, alarm.clear) if text]
        return frozenset().union(*(expression.parse(text).names for text in sentences))
    return frozenset(key for key in (alarm.value, alarm.reference) if key)


def needs_time(alarm: Alarm) -> bool:
    """Whether it may change although no value does: it asks for an age or a rate."""
    if alarm.kind == Kind.RATE:
        return True
    sentences = [text for text in (alarm.expression, alarm.clear) if text]
    return alarm.kind == Kind.EXPRESSION and any(expression.parse(text).ages for text in sentences)


def known(look: Look, point: str) -> float | None:
    """The number of `point`, or None while it is bad, missing or no number."""
    value, quality = look(point)
    if is_bad(quality) or not isinstance(value, int | float) or value != value:
        return None
    return value


@dataclass(frozen=True, slots=True)
class Change:
    """The condition has come or gone."""

    active: bool
    since: float
    """When it first was so, before the delay [s, monotonic]."""
    at: int
    """The same in µs UTC."""


@dataclass(slots=True)
class Delay:
    """On-delay and off-delay: what must hold for a while before it counts. 0 counts at once."""

    on: float
    off: float
    active: bool = False
    since: float | None = None
    """When the opposite first held; None while nothing is pending [s, monotonic]."""
    at: int = 0

    @property
    def due(self) -> float | None:
        """When the pending change counts [s, monotonic]; None while nothing is pending."""
        return None if self.since is None else self.since + (self.off if self.active else self.on)

    def step(self, truth: Truth, now: float, at: int) -> Change | None:
        """Take what the condition says at `now` [s, monotonic], `at` [µs UTC]. Not known ends what is pending."""
        if truth is None or truth is self.active:
            self.since = None
            return None
        if self.since is None:
            self.since, self.at = now, at
        due = self.since + (self.off if self.active else self.on)
        if now < due:
            return None
        change = Change(truth, self.since, self.at)
        self.active, self.since = truth, None
        return change

    def restart(self, active: bool = False) -> None:
        """Forget what is pending and stand at `active`."""
        self.active, self.since = active, None


def _discrete(alarm: Alarm) -> Discrete:
    return Discrete(expression.parse(alarm.expression), expression.parse(alarm.clear) if alarm.clear else None)


_BUILD: dict[Kind, Callable[[Alarm], Condition]] = {
    Kind.EXPRESSION: _discrete,
    Kind.HIGH: lambda alarm: High(alarm.value, alarm.limit or 0.0, alarm.dead_band),
    Kind.LOW: lambda alarm: Low(alarm.value, alarm.limit or 0.0, alarm.dead_band),
    Kind.DEVIATION: lambda alarm: Deviation(alarm.value, alarm.reference, alarm.limit or 0.0, alarm.dead_band),
    Kind.RATE: lambda alarm: Rate(alarm.value, alarm.limit or 0.0, alarm.window, alarm.dead_band),
    Kind.BAD_QUALITY: lambda alarm: BadQuality(alarm.value),
}
