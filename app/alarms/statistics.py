"""How well the alarms serve the person who answers them: the figures of ISA-18.2 / EEMUA 191, each with its limit and a verdict. Pure.

Rates are those of annunciated alarms, per operator position. What was raised while it was shelved, suppressed or out of service counts
in no rate and is told apart (`Figures.hidden`). Times are integer µs UTC, so a night of the clock change needs no care; where the clock was
set back, nobody knows how long something took that spans it, and it counts as neither short nor long.

Source of every definition and limit: reference/alarms.md section 3. The targets 1 alarm in 10 min, a flood of 10 in 10 min, at most 10 in
any 10 min, 2 in a minute and the distribution 80/15/5 are those of EEMUA 191 as its summaries give them, 6/h follows from the first. The
other limits (1 % of the time, 5 % for the top ten, the end of a flood below 5, fewer than 5 standing) are the ones commonly taken from
ISA-18.2 / IEC 62682; we had the summaries only, not the standards themselves. 10 s for a fleeting alarm and 60 s to acknowledge a critical
one are decisions of ours.
"""

from collections import Counter, deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median, quantiles
from typing import NamedTuple

from app.alarms.annunciations import FLOOD_BEGINS, FLOOD_ENDS, FLOOD_WINDOW
from app.alarms.definitions import PRIORITIES
from app.alarms.lifecycle import ANNUNCIATED, Entry
from app.alarms.watch import CHATTER_WINDOW, CHATTERS

SECOND = 1_000_000
MINUTE = 60 * SECOND
BUCKET = round(FLOOD_WINDOW * SECOND)
"""Ten minutes [µs]."""
HOUR = 3600 * SECOND
DAY = 24 * HOUR
STANDING = DAY
"""An alarm that was annunciated for longer without a break stands [µs]."""
FLEETING = 10 * SECOND
"""One that cleared sooner, and nobody had acknowledged it, was fleeting [µs]."""
MOST_IN_BUCKET = 10
"""Annunciated alarms in 10 min that one person can answer."""
TOP = 10
ENOUGH = 30 * DAY
"""Figures of less are an indication only [µs]."""


class Step(NamedTuple):
    """What a journal record says to the statistics."""

    time: int
    event: str
    alarm: str
    occurrence: int
    priority: int
    after: str
    """Letter of the state."""
    asks: bool
    """It asked for attention (`journal.asks_attention`)."""


@dataclass(frozen=True, slots=True)
class Flood:
    """A time in which more came than people can answer."""

    begin: int
    """When the alarm came that made it one."""
    end: int
    """When the last 10 min had fewer than 5; the end of the period where it goes on."""
    alarms: int
    """From the first of the ten that made it one."""
    peak: int
    """Most of them in 10 min."""
    goes_on: bool = False


@dataclass(frozen=True, slots=True)
class Run:
    """A time in which an alarm was annunciated without a break."""

    alarm: str
    begin: int
    end: int
    goes_on: bool


@dataclass(frozen=True, slots=True)
class Delay:
    """How long the annunciations of one priority waited for their acknowledgement."""

    asked: int
    acknowledged: int
    median: float | None = None
    """[s]; None: nobody acknowledged one, or not by a clock that was not set back meanwhile."""
    ninth: float | None = None
    """Nine of ten were acknowledged within [s]."""


@dataclass(frozen=True, slots=True)
class Figures:
    """What became of the alarms between `begin` and `end` [µs UTC]."""

    begin: int
    end: int
    positions: int
    total: int
    """Annunciated alarms."""
    hidden: int
    """Raised while shelved, suppressed or out of service."""
    buckets: Sequence[int]
    """Annunciated alarms of each 10 min from `begin` on; the last may be cut short."""
    peak_minute: int
    by_alarm: Sequence[tuple[str, int]]
    """The most frequent first."""
    by_priority: Mapping[int, int]
    floods: Sequence[Flood]
    standing: Sequence[Run]
    """Longer than a day, the longest first."""
    most_standing: int
    """At one time."""
    chattering: Mapping[str, int]
    """Alarm → how often it was raised in bursts of three or more in 60 s."""
    fleeting: Mapping[str, int]
    """Alarm → how often it was."""
    delays: Mapping[int, Delay]
    """By priority."""


@dataclass(frozen=True, slots=True)
class Measure:
    """A figure, its limits and what they say of it."""

    key: str
    """Text `alarm.stats.measure.<key>`."""
    value: float | None
    """None: there is nothing to measure."""
    unit: str
    target: float
    most: float
    """Above the target, and up to this, it is manageable."""
    verdict: str
    """`good`, `manageable`, `action`; `none`: it cannot be judged."""


def figures(
    steps: Iterable[Step], standing: Mapping[str, int], begin: int, end: int, positions: int = 1, hidden: int = 0
) -> Figures:
    """The figures of the time from `begin` up to `end`.

    `steps` of that time in the order of the journal; `standing`: alarm → since when it had been annunciated at `begin`; `positions`: how
    many people share the alarms, so a flood is so many times ten.

    Raises:
        ValueError: `end` is not after `begin`, or nobody shares them.
    """
    if end <= begin or positions < 1:
        raise ValueError(f"statistics take a time that ends after it begins and 1 position or more, not {positions}")
    story = _Story(standing)
    for step in steps:
        story.take(step)
    times = sorted(time for time, _, _ in story.asked)
    runs = story.runs_until(end)
    long = sorted((run for run in runs if run.end - run.begin > STANDING), key=lambda run: run.begin - run.end)
    by_priority = Counter(priority for _, _, priority in story.asked)
    return Figures(
        begin=begin,
        end=end,
        positions=positions,
        total=len(times),
        hidden=hidden,
        buckets=_buckets(times, begin, end),
        peak_minute=_peak(times, MINUTE),
        by_alarm=sorted(Counter(alarm for _, alarm, _ in story.asked).items(), key=lambda one: (-one[1], one[0])),
        by_priority={priority: by_priority[priority] for priority in PRIORITIES},
        floods=floods(times, end, positions),
        standing=long,
        most_standing=_most_at_once(long, begin),
        chattering=story.chattering,
        fleeting=story.fleeting,
        delays={one: _delay(by_priority[one], story.waited.get(one, [])) for one in PRIORITIES},
    )


def floods(times: Sequence[int], end: int, positions: int = 1) -> list[Flood]:
    """The floods among `times`, sorted [µs]: begun by the tenth alarm in 10 min, over when the last 10 min had fewer than five.

    The rule of `annunciations.Annunciations`, which tells a flood while it comes.
    """
    begins, ends = FLOOD_BEGINS * positions, FLOOD_ENDS * positions
    found: list[Flood] = []
    window: deque[int] = deque()
    begun: int | None = None
    count = peak = 0
    for time in times:
        if begun is not None and (over := window[-ends] + BUCKET) < time:
            found.append(Flood(begun, over, count, peak))
            begun = None
        window.append(time)
        while time - window[0] > BUCKET:
            window.popleft()
        if begun is not None:
            count, peak = count + 1, max(peak, len(window))
        elif len(window) >= begins:
            begun, count, peak = time, len(window), len(window)
    if begun is not None:
        over = window[-ends] + BUCKET
        found.append(Flood(begun, min(over, end), count, peak, goes_on=over >= end))
    return found


def measures(found: Figures) -> list[Measure]:
    """The figures that have a limit, judged."""
    span, each = found.end - found.begin, found.positions
    rate = found.total / each / (span / HOUR)
    busy = sum(n > MOST_IN_BUCKET * each for n in found.buckets)
    flooded = sum(flood.end - flood.begin for flood in found.floods)
    critical = found.delays[1].median
    return [
        _judged("hour", rate, "/h", 6, 12),
        _judged("ten", rate / 6, "/10 min", 1, 2),
        _judged("busy", 100 * busy / len(found.buckets), "%", 1, 1),
        _judged("peak_ten", max(found.buckets) / each, "", MOST_IN_BUCKET, MOST_IN_BUCKET),
        _judged("peak_minute", found.peak_minute / each, "", 2, 2),
        _judged("flooded", 100 * flooded / span, "%", 1, 1),
        _top(found),
        _judged("chattering", len(found.chattering), "", 0, 0),
        _judged("fleeting", len(found.fleeting), "", 0, 0),
        _judged("standing", found.most_standing, "", 4, 4),
        *(_share(found, key, priority, most) for key, priority, most in SHARES),
        _judged("acknowledge", critical, "s", 60, 60),
    ]


SHARES = (("share_3", 3, 15.0), ("share_2", 2, 5.0), ("share_1", 1, 1.0))
"""Key, priority and the most that it should have of all annunciated alarms [%]; the rest, some 80 %, is of low priority."""


def top_share(found: Figures) -> float | None:
    """How much of all annunciated alarms the ten most frequent are [%]; None without alarms."""
    return 100 * sum(n for _, n in found.by_alarm[:TOP]) / found.total if found.total else None


def _top(found: Figures) -> Measure:
    """With fewer than 200 different alarms the ten most frequent are more than 5 % whatever happens, so that is not judged."""
    one = _judged("top", top_share(found), "%", 1, 5)
    if one.value is not None and len(found.by_alarm) * one.most < 100 * TOP:
        return Measure(one.key, one.value, one.unit, one.target, one.most, "none")
    return one


def _share(found: Figures, key: str, priority: int, most: float) -> Measure:
    share = 100 * found.by_priority[priority] / found.total if found.total else None
    return _judged(key, share, "%", most, most)


def _judged(key: str, value: float | None, unit: str, target: float, most: float) -> Measure:
    verdict = "none" if value is None else "good" if value <= target else "manageable" if value <= most else "action"
    return Measure(key, value, unit, float(target), float(most), verdict)


class _Story:
    """Follows every alarm through its steps."""

    def __init__(self, standing: Mapping[str, int]) -> None:
        self.asked: list[tuple[int, str, int]] = []
        """Time, alarm and priority of each annunciation."""
        self.chattering: Counter[str] = Counter()
        self.fleeting: Counter[str] = Counter()
        self.waited: dict[int, list[float | None]] = {}
        """How long [s]; None: not known."""
        self._since = dict(standing)
        self._over: list[Run] = []
        self._waits: dict[int, Step] = {}
        self._raised: dict[str, deque[int]] = {}
        """When it was, those of the last minute."""
        self._counted: dict[str, int] = {}
        """How many of these, the oldest, are counted as chattering."""
        self._fresh: dict[str, int] = {}
        """When it was raised, while nobody has acknowledged it."""

    def take(self, step: Step) -> None:
        """The next record."""
        if step.after in ANNUNCIATED:
            self._since.setdefault(step.alarm, step.time)
        elif (since := self._since.pop(step.alarm, None)) is not None:
            self._over.append(Run(step.alarm, since, step.time, goes_on=False))
        if step.asks:
            self.asked.append((step.time, step.alarm, step.priority))
            self._waits[step.occurrence] = step
            if step.event == Entry.RAISED:
                self._raise(step)
        elif step.event == Entry.ACK:
            self._fresh.pop(step.alarm, None)
            if asked := self._waits.pop(step.occurrence, None):
                waited = step.time - asked.time
                self.waited.setdefault(asked.priority, []).append(waited / SECOND if waited >= 0 else None)
        elif step.event == Entry.RTN:
            raised = self._fresh.pop(step.alarm, None)
            self.fleeting.update([step.alarm] if raised is not None and 0 <= step.time - raised < FLEETING else [])

    def runs_until(self, end: int) -> list[Run]:
        """Every time in which an alarm was annunciated without a break."""
        return [*self._over, *(Run(alarm, since, end, goes_on=True) for alarm, since in self._since.items())]

    def _raise(self, step: Step) -> None:
        self._fresh[step.alarm] = step.time
        recent = self._raised.setdefault(step.alarm, deque())
        counted = self._counted.get(step.alarm, 0)
        recent.append(step.time)
        while not 0 <= step.time - recent[0] <= CHATTER_WINDOW * SECOND:
            recent.popleft()
            counted = max(0, counted - 1)
        if len(recent) >= CHATTERS:
            self.chattering[step.alarm] += len(recent) - counted
            counted = len(recent)
        self._counted[step.alarm] = counted


def _buckets(times: Iterable[int], begin: int, end: int) -> list[int]:
    found = [0] * -(-(end - begin) // BUCKET)
    for time in times:
        found[min((time - begin) // BUCKET, len(found) - 1)] += 1
    return found


def _peak(times: Sequence[int], span: int) -> int:
    """Most of `times` within less than `span`."""
    window: deque[int] = deque()
    most = 0
    for time in times:
        window.append(time)
        while time - window[0] >= span:
            window.popleft()
        most = max(most, len(window))
    return most


def _most_at_once(runs: Iterable[Run], begin: int) -> int:
    """Most that had stood for a day at one time, from `begin` on."""
    turns = sorted(turn for run in runs for turn in ((max(run.begin + STANDING, begin), 1), (run.end, -1)))
    most = now = 0
    for _, turn in turns:
        now += turn
        most = max(most, now)
    return most


def _delay(asked: int, waited: Sequence[float | None]) -> Delay:
    known = [one for one in waited if one is not None]
    if not known:
        return Delay(asked, len(waited))
    ninth = quantiles(known, n=10, method="inclusive")[-1] if len(known) > 1 else known[0]
    return Delay(asked, len(waited), median(known), ninth)
