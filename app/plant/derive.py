"""Derived points: a closed list of values computed from others of the same equipment.

    option         the option `of` of the equipment, as the plant file sets it
    signed         `of`, negative while `when` holds
    condition      1 while `when` holds, else 0
    running_hours  hours during which `when` held, retained [h]
    starts         how often `when` became true, retained
    min_today      least `of` since midnight of the plant's zone, retained
    max_today      greatest `of` since midnight of the plant's zone, retained
    since          time of the last change of `of`, retained [µs UTC]

Integrals are taken over the times given, never over the number of calls. Time during which `when` is not known is not counted, nor is
time of stale inputs: nobody saw it. Quality is the worst of the inputs; an accumulation lives through bad inputs and is then stale, because
it may miss something.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from zoneinfo import ZoneInfo

from app.clock import local_day, to_datetime
from app.errors import ConfigurationError
from app.plant import expression
from app.plant.definitions import Plant, Point
from app.tags.batch import Value
from app.tags.quality import GOOD, NO_DATA, STALE, is_bad, is_unseen, origin, worst

KINDS: Mapping[str, tuple[bool, bool]] = {
    "option": (True, False),
    "signed": (True, True),
    "condition": (False, True),
    "running_hours": (False, True),
    "starts": (False, True),
    "min_today": (True, False),
    "max_today": (True, False),
    "since": (True, False),
}
"""Kind → (needs `of`, needs `when`)."""
TIME_UNIT = "time"
"""Unit of a point that is a moment [µs UTC]: it is drawn as a time of the plant. A `since` has it unless its type says otherwise."""
RETAINED = frozenset({"running_hours", "starts", "min_today", "max_today", "since"})
_NEVER: tuple[Value, int] = (None, NO_DATA)
HOUR = 3_600_000_000
"""[µs]"""

Retained = Mapping[str, object]
"""What a derived point needs to go on after a restart: plain numbers and texts, fit for JSON."""


@dataclass(slots=True)
class _State:
    """One derived point at work."""

    point: Point
    kind: str
    of: str
    """Name of the input point."""
    when: expression.Expression | None
    inputs: tuple[str, ...]
    """Names of all points it reads."""
    value: float | None = None
    """Accumulated, exact."""
    truth: bool | None = None
    """The condition as last seen."""
    at: int = 0
    """When it was last brought up to date [µs]."""
    day: str = ""
    other: tuple[str, float | None] = ("", None)
    """Of an extreme the day before this one, or after it when the clock was set back, and what it was then."""
    last: Value = None
    """Input as last seen."""
    heard: bool = False
    """The input was good since the start."""
    lost: int = 0
    """Since when it is not, after it was [µs]; 0 = it is."""
    sent: tuple[Value, int] | None = None
    keys: Mapping[str, str] = field(default_factory=dict)
    """Key in the condition → name."""


class Derivation:
    """All derived points of a plant."""

    def __init__(self, plant: Plant) -> None:
        self._zone = ZoneInfo(plant.timezone)
        self._day = ""
        self._begin = self._midnight = 0
        self._values: dict[str, tuple[Value, int]] = {}
        self._states = [state for item in plant.equipment.values() for state in _in_order(_states(item.points))]
        self._by_name = {state.point.name: state for state in self._states}
        self._downstream = _downstream(self._states)
        self._timed = [
            index
            for index, state in enumerate(self._states)
            if state.kind in ("running_hours", "min_today", "max_today")
        ]
        self._options = {
            f"{item.id}.{point.key}": _number(item.options.get(point.derived.of))
            for item in plant.equipment.values()
            for point in item.points.values()
            if point.derived and point.derived.kind == "option"
        }
        self._fresh = True
        self.worth_keeping = False
        """A start was counted, what counts hours came to a stop, or a counter was set back: whoever keeps this sets it to False."""

    @property
    def inputs(self) -> frozenset[str]:
        """Points whose changes it wants to hear of."""
        return frozenset(self._downstream) - self.names

    @property
    def names(self) -> frozenset[str]:
        """Points that it publishes."""
        return frozenset(self._by_name)

    def update(self, changed: Mapping[str, tuple[Value, int]], time_us: int) -> list[tuple[str, Value, int]]:
        """Take what changed at `time_us` [µs UTC]; what changes by it as (name, value, quality).

        Call it once a second or so with nothing: hours go on and a new day begins although no value changes. The first call gives
        every derived point. A clock that was set back adds nothing and takes nothing away; over midnight, the extremes of that day are
        those of today again.
        """
        new_day = self._turn_day(time_us)
        waiting: set[int] = set()
        if self._fresh or new_day:
            waiting.update(range(len(self._states)))
        elif not changed:
            waiting.update(self._timed)
        self._fresh = False
        self._values.update(changed)
        for name in changed:
            waiting.update(self._downstream.get(name, ()))
        result: list[tuple[str, Value, int]] = []
        for index in sorted(waiting):
            state = self._states[index]
            reading = self._compute(state, time_us)
            if reading != state.sent:
                state.sent = self._values[state.point.name] = reading
                result.append((state.point.name, *reading))
        return result

    def interrupted(self, begin: int, end: int) -> None:
        """Nobody saw anything from `begin` to `end` [µs UTC]: that time is not counted."""
        for state in self._states:
            if state.kind == "running_hours" and state.at:
                self._compute(state, max(begin, state.at))
                state.at = max(end, state.at)

    def retained(self) -> dict[str, Retained]:
        """State of every point that survives a restart, by the lasting id of the point."""
        return {
            state.point.id: {"value": state.value, "day": state.day, "last": state.last, "other": list(state.other)}
            for state in self._states
            if state.kind in RETAINED and (state.value is not None or state.other[1] is not None)
        }

    def restore(self, kept: Mapping[str, Retained]) -> None:
        """Go on from what `retained` gave; what does not fit is left out. The time in between is not counted."""
        for state in self._states:
            found = kept.get(state.point.id)
            if state.kind not in RETAINED or not found:
                continue
            value, day, last = found.get("value"), found.get("day"), found.get("last")
            if (isinstance(value, int | float) and not isinstance(value, bool) and value >= 0) or state.kind.endswith(
                "_today"
            ):
                state.value = value if isinstance(value, int | float) else None
                state.day = day if isinstance(day, str) else ""
                state.last = last if isinstance(last, int | float | str) else None
                state.other = _other(found.get("other"))
        self._fresh = True

    def reset(self, name: str) -> None:
        """Set an accumulated point (`m1.running_hours`) back to 0; it is told with the next update.

        Raises:
            ConfigurationError: no such accumulated point.
        """
        state = self._by_name.get(name)
        if state is None or state.kind not in ("running_hours", "starts"):
            raise ConfigurationError(f"{name} is no counter: only running hours and starts can be set back")
        state.value = 0.0
        self._fresh = self.worth_keeping = True

    def _turn_day(self, time_us: int) -> bool:
        if self._begin <= time_us < self._midnight:
            return False
        self._day = to_datetime(time_us).astimezone(self._zone).date().isoformat()
        self._begin, self._midnight = local_day(time_us, self._zone)
        return True

    def _compute(self, state: _State, now: int) -> tuple[Value, int]:
        if state.kind == "option":
            option = self._options[state.point.name]
            return (option, GOOD) if option is not None else _NEVER
        readings = [self._values.get(name, _NEVER) for name in state.inputs]
        quality = readings[0][1] if len(readings) == 1 else worst([reading[1] for reading in readings])
        truth = None
        if state.when is not None:
            truth = state.when.true(lambda key: self._values.get(state.keys[key], _NEVER))
        seen = None if is_unseen(quality) else truth
        match state.kind:
            case "signed":
                size = _number(self._values.get(state.of, _NEVER)[0])
                if size is None or truth is None or is_bad(quality):
                    return None, _at_least_bad(quality)
                return (-size if truth and size else size), quality
            case "condition":
                return (None, _at_least_bad(quality)) if truth is None else (int(truth), quality)
            case "running_hours":
                if state.truth and state.at and now > state.at:
                    state.value = (state.value or 0.0) + (now - state.at) / HOUR
                state.value = state.value or 0.0
                self.worth_keeping |= bool(state.truth) and not seen
                state.truth, state.at = seen, now
                return round(state.value, max(1, state.point.decimals)), _accumulated(quality, known=seen is not None)
            case "starts":
                if seen and state.truth is False:
                    state.value = (state.value or 0.0) + 1
                    self.worth_keeping = True
                state.value = state.value or 0.0
                state.truth = state.truth if seen is None else seen
                return round(state.value), _accumulated(quality, known=seen is not None)
            case "since":
                value = readings[0][0]
                if value is None or is_bad(quality):
                    # a state that is not known is none since it broke off; the one before stays in mind
                    state.lost = state.lost or (now if state.heard else 0)
                    if state.lost:
                        return state.lost, _accumulated(quality, known=False)
                else:
                    state.heard, state.lost = True, 0
                    if value != state.last:
                        # the first value after a start is when we learnt of it, unless it is the one that was kept
                        state.value, state.last = float(now), value
                if state.value is None:
                    return None, _at_least_bad(quality)
                return int(state.value), _accumulated(quality, known=value is not None)
        return self._extreme(state, readings[0], quality)

    def _extreme(self, state: _State, reading: tuple[Value, int], quality: int) -> tuple[Value, int]:
        if state.day != self._day:
            # a clock that is set back over midnight, and passes it again, finds both days as they were left
            again = state.other[1] if state.other[0] == self._day else None
            state.other, state.day, state.value = (state.day, state.value), self._day, again
        value = _number(reading[0])
        if value is not None and not is_bad(quality) and not is_unseen(quality):
            better = min if state.kind == "min_today" else max
            state.value = value if state.value is None else better(state.value, value)
        if state.value is None:
            return None, _at_least_bad(quality)
        return state.value, _accumulated(quality, known=value is not None)


def order_problem(points: Mapping[str, Point]) -> str:
    """Keys of derived points that depend on each other in a circle, or an empty text."""
    derived = {key: replace(point, name=key) for key, point in points.items() if point.derived is not None}
    states = _states(derived)
    ordered = {state.point.key for state in _in_order(states)}
    return ", ".join(sorted(state.point.key for state in states if state.point.key not in ordered))


def _states(points: Mapping[str, Point]) -> list[_State]:
    states = []
    for point in points.values():
        if point.derived is None:
            continue
        when = expression.parse(point.derived.when) if point.derived.when else None
        prefix = point.name[: len(point.name) - len(point.key)]
        of = "" if point.derived.kind == "option" or not point.derived.of else prefix + point.derived.of
        keys = {key: prefix + key for key in when.names} if when else {}
        inputs = tuple(dict.fromkeys([*([of] if of else []), *keys.values()]))
        states.append(_State(point, point.derived.kind, of, when, inputs, keys=keys))
    return states


def _downstream(ordered: list[_State]) -> dict[str, tuple[int, ...]]:
    """Name → indices of everything that is computed from it, directly or through others."""
    reached: dict[str, set[int]] = {}
    for index in reversed(range(len(ordered))):
        state = ordered[index]
        further = reached.get(state.point.name, set())
        for name in state.inputs:
            reached.setdefault(name, set()).update(further, (index,))
    return {name: tuple(sorted(indices)) for name, indices in reached.items()}


def _in_order(states: list[_State]) -> list[_State]:
    """Inputs before what is computed from them; what stands in a circle is left out."""
    left = {state.point.name: state for state in states}
    ordered: list[_State] = []
    while left:
        ready = [state for state in left.values() if not any(name in left for name in state.inputs)]
        if not ready:
            break
        for state in ready:
            del left[state.point.name]
        ordered += ready
    return ordered


def _other(kept: object) -> tuple[str, float | None]:
    match kept:
        case [str(day), float(value) | int(value)]:
            return day, value
    return "", None


def _number(value: object) -> float | None:
    return value if isinstance(value, int | float) else None


def _at_least_bad(quality: int) -> int:
    return quality if is_bad(quality) else NO_DATA | origin(quality)


def _accumulated(quality: int, *, known: bool) -> int:
    return STALE | origin(quality) if is_bad(quality) or not known else quality
