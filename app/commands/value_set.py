"""A set of setpoints of one machine, written as one: in which order, whether the values go together, and what stands there now. Pure.

Limits and checks are judged with all new values in place. On the way there they must hold after every step, too: a minimum is not moved
beyond a maximum that is moved only later.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from app.commands import interlocks
from app.commands.interlocks import Prepared, RefusalReason
from app.plant import expression
from app.plant.definitions import Argument, Command, Condition, EquipmentType
from app.plant.expression import Look
from app.tags.quality import GOOD

KEY = "setpoints"
"""How a set is called where a command has its key."""
LABEL = "set.label"
MOST = 40
"""Values of one set."""


class Stands(StrEnum):
    """What a device holds of a value that was to be changed; its text is `set.<value>`."""

    NEW = "new"
    OLD = "old"
    OTHER = "other"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Change:
    """One value of a set."""

    key: str
    code: str
    """The maker's name for it, else its key."""
    label: str
    """Text key."""
    old: float
    """[EU]"""
    new: float
    unit: str = ""
    decimals: int = 0
    found: float | None = None
    """What was read when the set was over; None = not yet, or not to be read."""
    stands: Stands = Stands.UNKNOWN
    error: int | None = None
    """Number of the error with which a drive refused its parameter; None = it did not."""


def joined(parts: Sequence[Prepared]) -> Prepared:
    """The setpoints `parts` as one command: everything that one of them needs, the set needs."""
    first = parts[0].command
    arguments = tuple(
        Argument(part.point.key, unit=part.point.unit, decimals=part.point.decimals, label=part.point.label)
        for part in parts
        if part.point
    )
    command = Command(
        KEY,
        LABEL,
        writes=(),
        feedback="",
        timeout=first.timeout,
        level=max(part.command.level for part in parts),
        role=next((part.command.role for part in parts if part.command.role != "operator"), "operator"),
        moves=False,
        arguments=arguments,
        needs_reason=any(part.command.needs_reason for part in parts),
    )
    return Prepared(
        command,
        None,
        None,
        _once(condition for part in parts for condition in part.permissives),
        _once(condition for part in parts for condition in part.interlocks),
        None,
        tuple(dict.fromkeys(key for part in parts for key in part.watched)),
        tuple(dict.fromkeys(key for part in parts for key in part.used)),
        tuple(parts),
    )


def after(look: Look, values: Mapping[str, float]) -> Look:
    """What `look` will give when `values` are in effect."""
    return lambda key: (values[key], GOOD) if key in values else look(key)


def broken(kind: EquipmentType, values: Mapping[str, float], look: Look) -> Condition | None:
    """The first check of the type over any of `values` that does not hold with them; one that is not known does not."""
    for check in kind.checks:
        sentence = expression.parse(check.expression)
        if not sentence.names.isdisjoint(values) and sentence.true(after(look, values)) is not True:
            return check
    return None


def steps(
    kind: EquipmentType,
    parts: Sequence[Prepared],
    groups: Sequence[Sequence[str]],
    values: Mapping[str, float],
    look: Look,
) -> tuple[tuple[str, ...], ...] | RefusalReason:
    """`groups` (keys that the device takes all or none) in an order in which limits and checks hold after every step; else why there is
    none. Final values that hold together are taken for granted."""
    known = {part.command.key: part for part in parts}
    waiting, done, order = [tuple(group) for group in groups], dict[str, float](), list[tuple[str, ...]]()
    while waiting:
        group = next((group for group in waiting if _possible(kind, known, group, values, done, look)), None)
        if group is None:
            return RefusalReason("why.set_order", {}, known[waiting[0][0]].command.label)
        waiting.remove(group)
        order.append(group)
        done |= {key: values[key] for key in group}
    return tuple(order)


def _possible(
    kind: EquipmentType,
    parts: Mapping[str, Prepared],
    group: Sequence[str],
    values: Mapping[str, float],
    done: Mapping[str, float],
    look: Look,
) -> bool:
    then = {**done, **{key: values[key] for key in group}}
    before, now = after(look, done), after(look, then)
    if any(interlocks.wrong_value(parts[key], values[key], now) for key in group):
        return False
    for check in kind.checks:
        sentence = expression.parse(check.expression)
        touched = not sentence.names.isdisjoint(group)
        if touched and sentence.true(before) is True and sentence.true(now) is not True:
            return False
    return True


def judged(change: Change, part: Prepared, found: float | None) -> Change:
    """`change` with what the device holds, `found` [EU]; None = it could not be read."""
    if found is None:
        return replace(change, found=None, stands=Stands.UNKNOWN)
    if is_value(part, found, change.new):
        stands = Stands.NEW
    elif is_value(part, found, change.old):
        stands = Stands.OLD
    else:
        stands = Stands.OTHER
    return replace(change, found=found, stands=stands)


def is_value(part: Prepared, found: float, wanted: float) -> bool:
    """Whether `found` is `wanted` as far as the register tells."""
    assert part.feedback is not None
    return part.feedback.true({part.command.key: found}, argument=wanted) is True


def values_text(changes: Sequence[Change], *, old: bool) -> str:
    """Old or new values in one line: `F112 = 0.5, F111 = 50`."""
    return ", ".join(f"{change.code} = {change.old if old else change.new:.10g}" for change in changes)


def found_text(changes: Sequence[Change]) -> str:
    """Which value stands where, without a language: `F112 = 0.5 (new), F111 = ? (unknown)`."""
    return ", ".join(
        f"{change.code} = {'?' if change.found is None else f'{change.found:.10g}'} ({change.stands})"
        for change in changes
    )


def found_texts(changes: Sequence[Change]) -> list[str]:
    """As `found_text`, in the parts that an alarm says in its reader's language: what begins with @ is the key of a text. Of many values
    those that are not the former ones, and of these the first ones, with how many there are."""
    parts: list[str] = []
    for change in named(changes):
        name = f"@{change.label}" if change.code == change.key else change.code
        value = "?" if change.found is None else f"{change.found:.{change.decimals}f} {change.unit}".rstrip()
        parts += [", "] * bool(parts) + [name, f" = {value} (", f"@set.{change.stands}", ")"]
    left = len(changes) - len(named(changes))
    return [*parts, f", + {left}"] if left else parts


def named(changes: Sequence[Change]) -> Sequence[Change]:
    """Those that a text names: all, or of more than `MOST` the first ones that are not the former values."""
    if len(changes) <= MOST:
        return changes
    return [change for change in changes if change.stands is not Stands.OLD][:MOST]


def _once(conditions: Iterable[Condition]) -> tuple[Condition, ...]:
    return tuple({condition.key: condition for condition in conditions}.values())
