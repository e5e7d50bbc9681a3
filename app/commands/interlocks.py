"""Why a command is not possible now: freshness, limits, permissives and interlocks, computed from values that are given. Pure.

A condition that is not known (a bad value) counts as not met. Every reason is a key; the first missing one comes first.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite

from app.plant import expression
from app.plant.definitions import (
    Argument,
    Command,
    Condition,
    Equipment,
    EquipmentType,
    Link,
    Point,
    Scan,
    Setpoint,
    Type,
    Write,
)
from app.plant.expression import Expression, Look
from app.registers.plc_map import real
from app.registers.register import REALS
from app.tags import quality
from app.tags.batch import Value

Age = Callable[[str], float]
"""Seconds since a point was seen, by its key; infinite when never."""

LEVELS = ("C0", "C1", "C2", "C3", "C4")
JUMP = 0.2
"""Part of the span beyond which a change of a setpoint asks for confirmation (hmi-design.md section 10)."""
FRESH = 2.0
SCANS = 3.0
"""A value is fresh while younger than max(2 s, 3 scan periods) (precedence.md)."""


@dataclass(frozen=True, slots=True)
class RefusalReason:
    """Why not: a text key with what fills it; `label` is the text key of the point or condition that it is about."""

    key: str
    params: Mapping[str, object] = field(default_factory=dict)
    label: str = ""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A command or setpoint with everything that the gate asks about it, worked out once per plant."""

    command: Command
    setpoint: Setpoint | None
    """Of the argument."""
    point: Point | None
    """Of the argument."""
    permissives: Sequence[Condition]
    interlocks: Sequence[Condition]
    feedback: Expression | None
    watched: Sequence[str]
    """Points read from the device that decide the feedback."""
    used: Sequence[str]
    """Points read from the device that anything about the command uses."""
    parts: "Sequence[Prepared]" = ()
    """Of a set of setpoints each of them; empty for what is one command."""
    released: "Prepared | None" = None
    """What tells that a hold-to-run is over, as the feedback of a Stop would; None = the machine's Stop does."""

    @property
    def roles(self) -> Sequence[str]:
        """Roles that whoever asks must have the permission of."""
        return tuple(dict.fromkeys(part.command.role for part in self.parts)) or (self.command.role,)


def prepare(item: Equipment, command: Command) -> Prepared:
    """`command` of `item`, ready to be judged."""
    kind = item.type
    point = item.points.get(command.argument)
    setpoint = kind.setpoints.get(command.argument)
    permissives = tuple(c for c in kind.permissives if guards(c, command))
    interlocks = tuple(c for c in kind.interlocks if guards(c, command))
    if setpoint and setpoint.stopped_only:
        permissives = (*permissives, stopped(kind))
    feedback = expression.parse(command.feedback) if command.feedback else None
    sentences = [command.timeout, *(c.expression for c in (*permissives, *interlocks))]
    sentences += [command.level_when[0]] if command.level_when else []
    sentences += [setpoint.low, setpoint.high] if setpoint else []
    sentences += [limit for argument in command.arguments for limit in (argument.low, argument.high) if limit]
    names = {name for text in sentences for name in expression.parse(text).names}
    names |= feedback.names if feedback else frozenset()
    names |= {command.argument} if command.argument else set()
    names |= {write.point for write in (*command.writes, *command.release) if write.value == "previous"}
    for sentence in (sentence for write in command.writes for sentence in (write.when, write.after) if sentence):
        names |= expression.parse(sentence).names
    watched = sources(item.points, feedback.names if feedback else ())
    released = prepare(item, replace(command, feedback=command.released, released="")) if command.released else None
    return Prepared(
        command,
        setpoint,
        point,
        permissives,
        interlocks,
        feedback,
        watched,
        sources(item.points, names),
        released=released,
    )


def setting(item: Equipment, setpoint: Setpoint) -> Command:
    """Writing the parameter `setpoint` as a command with read-back: engineers' parameters and those with a warning are C2."""
    point = item.points[setpoint.key]
    whole = point.register is not None and point.register.type not in REALS
    step = abs(point.register.scale) if point.register and whole else 10.0**-point.decimals
    return Command(
        key=setpoint.key,
        label=point.label,
        writes=(Write(setpoint.key, expression.ARGUMENT),),
        feedback=f"abs({setpoint.key} - argument) < {0.6 * step:.10f}",
        timeout="5",
        level="C1" if setpoint.role == "operator" and not setpoint.warning else "C2",
        role=setpoint.role,
        moves=False,
        argument=setpoint.key,
    )


def guards(condition: Condition, command: Command) -> bool:
    """Whether `condition` must be met for `command`; one that names no command guards all that move."""
    return not command.stop and (command.key in condition.commands if condition.commands else command.moves)


def stopped(kind: EquipmentType) -> Condition:
    """The condition that the machine stands: what its Stop is confirmed by."""
    stop = next((command for command in kind.commands.values() if command.stop), None)
    return Condition("stopped", "why.machine_stopped", stop.feedback if stop and stop.feedback else "1 == 1")


def sources(points: Mapping[str, Point], keys: Iterable[str]) -> tuple[str, ...]:
    """The points that `keys` come from: a derived point stands for what it is computed from, an option for nothing."""
    found: dict[str, None] = {}
    waiting = sorted(keys, reverse=True)
    seen: set[str] = set()
    while waiting:
        key = waiting.pop()
        if key in seen:
            continue
        seen.add(key)
        derived = points[key].derived
        if derived is None:
            found[key] = None
        elif derived.kind != "option":
            when = sorted(expression.parse(derived.when).names) if derived.when else []
            waiting += [*reversed(when), *([derived.of] if derived.of else [])]
    return tuple(found)


def longest_age(point: Point, item: Equipment, link: Link) -> float:
    """Age up to which a value may be used [s]; infinite for what is read once or on demand: its quality alone counts."""
    device = item.type.device
    match point.scan:
        case Scan.FAST:
            return max(FRESH, SCANS * (link.fast or device.fast))
        case Scan.SLOW:
            return max(FRESH, SCANS * (link.slow or device.slow))
        case _:
            return float("inf")


def stale(item: Equipment, link: Link, keys: Iterable[str], look: Look, age: Age) -> list[RefusalReason]:
    """Points of `keys` that may not be used now. Where a value comes from (simulated, forced) does not count."""
    reasons: list[RefusalReason] = []
    for key in keys:
        point = item.points[key]
        value, word = look(key)
        if quality.is_bad(word) or value is None:
            reasons.append(
                RefusalReason("why.bad_value", {"point": point.name, "quality": quality.name(word)}, point.label)
            )
        elif not quality.is_good(word):
            reasons.append(
                RefusalReason("why.poor_value", {"point": point.name, "quality": quality.name(word)}, point.label)
            )
        elif not (old := age(key)) < (limit := longest_age(point, item, link)):
            reasons.append(
                RefusalReason("why.old_value", {"point": point.name, "age": round(old, 1), "limit": limit}, point.label)
            )
    return reasons


def met(condition: Condition, look: Look, argument: float | None = None, age: Age | None = None) -> bool | None:
    """Whether `condition` holds; None = not known."""
    return expression.parse(condition.expression).true(look, age=age, argument=argument)


def missing(
    conditions: Iterable[Condition], look: Look, argument: float | None = None, age: Age | None = None
) -> list[RefusalReason]:
    """Conditions that are not met, or not known to be."""
    reasons: list[RefusalReason] = []
    for condition in conditions:
        value = met(condition, look, argument, age)
        if value is None:
            reasons.append(RefusalReason("why.condition_unknown", {"condition": condition.key}, condition.label))
        elif not value:
            params = {"condition": condition.key, **amounts(condition.values, look)}
            reasons.append(RefusalReason("why.condition", params, condition.missing or condition.label))
    return reasons


def amounts(values: Mapping[str, str], look: Look) -> dict[str, float | None]:
    """The numbers that a text names, rounded as people say them: one decimal place below 100; None = not known."""
    found: dict[str, float | None] = {}
    for name, text in values.items():
        value = expression.number(text, look)
        found[name] = None if value is None else round(value, 1 if abs(value) < 100 else 0)
    return found


def effect(command: Command, look: Look) -> tuple[str, Mapping[str, float | None]]:
    """What the command will do now: the key of its text and the numbers that this names; an empty key = nothing is known of it."""
    for one in command.effects:
        if one.when and expression.parse(one.when).true(look) is not True:
            continue
        numbers = amounts(one.values, look)
        if None not in numbers.values():
            return one.text, numbers
    return "", {}


def limits(prepared: Prepared, look: Look) -> tuple[float | None, float | None]:
    """Least and greatest argument now [EU]; None = not known."""
    if prepared.setpoint:
        return expression.number(prepared.setpoint.low, look), expression.number(prepared.setpoint.high, look)
    point = prepared.point
    if point is None:
        return float("-inf"), float("inf")
    return (
        float("-inf") if point.low is None else point.low,
        float("inf") if point.high is None else point.high,
    )


def unlimited(prepared: Prepared, look: Look) -> list[RefusalReason]:
    """A reason when the limits of the argument are not known."""
    if prepared.point is None or None not in limits(prepared, look):
        return []
    return [RefusalReason("why.limits_unknown", {"point": prepared.point.name}, prepared.point.label)]


def wrong_value(prepared: Prepared, value: float, look: Look) -> RefusalReason | None:
    """Why `value` [EU] cannot be the argument; None when it can."""
    point = prepared.point
    if point is None:
        return None
    unit = {"unit": point.unit, "value": value}
    options = prepared.setpoint.options if prepared.setpoint else {}
    if options and value not in options:
        return RefusalReason("why.no_option", {**unit, "options": tuple(options)}, point.label)
    low, high = limits(prepared, look)
    if low is None or high is None:
        return RefusalReason("why.limits_unknown", {"point": point.name}, point.label)
    if not low <= value <= high:
        return RefusalReason("why.out_of_limits", {**unit, "min": low, "max": high}, point.label)
    if round(value, point.decimals) != value:
        return RefusalReason("why.decimals", {**unit, "decimals": point.decimals}, point.label)
    return None


RANGE: Mapping[Type, tuple[float, float]] = {Type.U32: (0, 2**32 - 1), Type.I32: (-(2**31), 2**31 - 1)}
"""What fits into an argument; anything that is a number fits into f32."""
LARGEST_F32 = 3.4e38


def wrong_argument(argument: Argument, value: float, look: Look) -> RefusalReason | None:
    """Why `value` [EU] cannot be `argument`; None when it can."""
    low, high = (expression.number(text, look) if text else None for text in (argument.low, argument.high))
    known = (low is not None or not argument.low) and (high is not None or not argument.high)
    params: dict[str, object] = {"argument": argument.name, "unit": argument.unit, "value": value}
    if not known:
        return RefusalReason("why.limits_unknown", {**params, "point": argument.name}, argument.label)
    if not isfinite(value):
        return RefusalReason("why.not_a_number", {**params, "text": str(value)}, argument.label)
    if low is not None and high is not None and not low <= value <= high:
        return RefusalReason("why.out_of_limits", {**params, "min": low, "max": high}, argument.label)
    if low is not None and value < low:
        return RefusalReason("why.too_low", {**params, "min": low}, argument.label)
    if high is not None and value > high:
        return RefusalReason("why.too_high", {**params, "max": high}, argument.label)
    if abs(value) > LARGEST_F32:
        return RefusalReason("why.not_a_number", {**params, "text": str(value)}, argument.label)
    least, most = RANGE.get(argument.type, (value, value))
    if not least <= value <= most:
        bounds = {"min": least if low is None else low, "max": most if high is None else high}
        return RefusalReason("why.out_of_limits", {**params, **bounds}, argument.label)
    if round(value, argument.decimals) != value:
        return RefusalReason("why.decimals", {**params, "decimals": argument.decimals}, argument.label)
    return None


def raw(argument: Argument, value: float) -> int:
    """`value` as the 32 bits that are sent."""
    return real(value) if argument.type is Type.F32 else int(value) & 0xFFFF_FFFF


def level(prepared: Prepared, look: Look, value: float | None = None) -> tuple[str, tuple[str, ...]]:
    """Confirmation level C0–C4 now, and the text keys that say why it is higher than usual.

    A condition for a higher level that is not known counts as holding.
    """
    command = prepared.command
    result, why = command.level, []
    if command.level_when:
        condition, higher = command.level_when
        if expression.parse(condition).true(look, argument=value) is not False:
            result = max(result, higher)
            why.append("ask.situation")
    point, setpoint = prepared.point, prepared.setpoint
    if point is None or value is None:
        return result, tuple(why)
    if same(look(point.key)[0], value, point.decimals):
        return min(result, "C1"), ()  # nothing changes, so there is nothing to ask
    if setpoint and setpoint.options:
        return result, tuple(why)
    band = setpoint.normal if setpoint and setpoint.normal else point.normal
    if band and not band[0] <= value <= band[1]:
        result = max(result, "C2")
        why.append("ask.outside_normal")
    if jumps(look(point.key)[0], value, limits(prepared, look)):
        result = max(result, "C2")
        why.append("ask.jump")
    return result, tuple(why)


def same(old: Value, new: float, decimals: int) -> bool:
    """Whether two values are one as they are written."""
    return isinstance(old, int | float) and abs(old - new) < 0.5 * 10.0**-decimals


def jumps(old: Value, new: float, span: tuple[float | None, float | None]) -> bool:
    """Whether a change is more than 20 % of the span; a change from a value that is not known is one."""
    low, high = span
    if low is None or high is None or isinstance(old, str) or old is None:
        return True
    return high - low < float("inf") and abs(new - old) > JUMP * (high - low) + 1e-9


def telegrams(
    item: Equipment, writes: Iterable[Write], argument: float | None, previous: Mapping[str, float]
) -> tuple[tuple[str, float], ...]:
    """(point, value [EU]) of `writes`; `previous` is what points held before.

    Raises:
        KeyError: an argument or a previous value is missing.
    """
    result: list[tuple[str, float]] = []
    for write in writes:
        if write.value == "argument":
            if argument is None:
                raise KeyError(f"{item.id}: {write.point} needs an argument")
            result.append((write.point, argument))
        elif write.value == "previous":
            result.append((write.point, previous[write.point]))
        elif write.value.startswith("option:"):
            option = item.options[write.value.removeprefix("option:")]
            assert isinstance(option, int | float)
            result.append((write.point, float(option)))
        else:
            result.append((write.point, float(write.value)))
    return tuple(result)
