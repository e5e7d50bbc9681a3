"""What a person entered with an order: numbers as they are typed, limits, what was seen, and whether to ask back. Pure."""

from collections.abc import Mapping
from math import isfinite

from app.commands import interlocks, value_set
from app.commands.entry import parse_number
from app.commands.interlocks import Prepared
from app.commands.orders import Order, Question
from app.errors import Refused
from app.plant import expression
from app.plant.definitions import EquipmentType
from app.tags.batch import Value


def argument_of(order: Order, prepared: Prepared, kind: EquipmentType, look: expression.Look) -> float | None:
    """The value of a command that takes one, within its limits and as the person saw it before; None of one that takes none.

    Raises:
        Question: the number can mean two things.
        Refused: 422; 409, the setpoint is another one by now.
    """
    if prepared.point is None:
        if order.argument not in (None, ""):
            raise Refused("why.no_argument", 422)
        return None
    if order.argument is None or (isinstance(order.argument, str) and not order.argument.strip()):
        raise Refused("why.argument_missing", 422, label=prepared.point.label)
    value = entered(order, prepared, order.argument)
    wrong = interlocks.wrong_value(prepared, value, look)
    if wrong is not None:
        raise Refused(wrong.key, 422, label=wrong.label, **wrong.params)
    check_seen(prepared, look, order.expected)
    check_relations(kind, {prepared.point.key: value}, look)
    return value


def arguments_of(order: Order, prepared: Prepared, look: expression.Look) -> dict[str, float]:
    """What goes with a code: each named once, a number, within its limits.

    Raises:
        Question: a number can mean two things.
        Refused: 422.
    """
    known = prepared.command.arguments
    for name in order.arguments:
        if name not in (argument.name for argument in known):
            raise Refused("why.unknown_argument", 422, argument=name[:40])
    found: dict[str, float] = {}
    for argument in known:
        given = order.arguments.get(argument.name, "")
        if isinstance(given, str) and not given.strip():
            raise Refused("why.argument_missing", 422, label=argument.label, argument=argument.name)
        try:
            value = parse_number(given, order.language, argument.unit) if isinstance(given, str) else float(given)
        except Refused as refusal:
            more = {**refusal.params, "label": argument.label, "argument": argument.name, "unit": argument.unit}
            if refusal.reason == "why.ambiguous":
                raise Question(refusal.reason, refusal.status, **more) from refusal
            raise Refused(refusal.reason, refusal.status, **more) from refusal
        wrong = interlocks.wrong_argument(argument, value, look)
        if wrong is not None:
            raise Refused(wrong.key, 422, label=wrong.label, **wrong.params)
        found[argument.name] = value
    return found


def entered(order: Order, prepared: Prepared, given: str | float) -> float:
    """What was entered for the point of `prepared`, as a number."""
    assert prepared.point is not None
    more: dict[str, object] = {"argument": prepared.command.key} if order.arguments else {}
    try:
        return parse_number(given, order.language, prepared.point.unit) if isinstance(given, str) else float(given)
    except Refused as refusal:
        if refusal.reason != "why.ambiguous":
            raise Refused(refusal.reason, refusal.status, **{**refusal.params, **more}) from refusal
        raise Question(
            refusal.reason,
            refusal.status,
            label=prepared.point.label,
            unit=prepared.point.unit,
            **{**refusal.params, **more},
        ) from refusal


def check_seen(prepared: Prepared, look: expression.Look, seen: float | None) -> None:
    """The setpoint still is what the person saw it at [EU].

    Raises:
        Refused: 409.
    """
    point = prepared.point
    if point is None or seen is None:
        return
    current = look(point.key)[0]
    if not isinstance(current, int | float) or not abs(current - seen) < 0.6 * 10.0**-point.decimals:
        raise Refused("why.changed", 409, label=point.label, current=current, expected=seen, unit=point.unit)


def check_relations(kind: EquipmentType, values: Mapping[str, float], look: expression.Look) -> None:
    """The setpoints fit each other with the new `values`.

    Raises:
        Refused: 422.
    """
    check = value_set.broken(kind, values, look)
    if check is not None:
        raise Refused("why.check", 422, label=check.label, check=check.key)


def confirm(
    order: Order,
    prepared: Prepared,
    level: str,
    why: tuple[str, ...],
    argument: float | None,
    old: Value,
    arguments: Mapping[str, float],
    span: tuple[float | None, float | None] = (None, None),
) -> None:
    """Ask back when the level wants more than the person gave; `span` are the limits of the argument [EU].

    Raises:
        Question: what is missing, and everything that the dialog shows.
    """
    needs_reason = level >= "C3" or prepared.command.needs_reason
    point, setpoint = prepared.point, prepared.setpoint
    missing = ""
    if level >= "C2" and not order.confirmed:
        missing = "why.confirm"
    elif needs_reason and not order.reason.strip():
        missing = "why.reason_needed"
    elif level >= "C4" and not order.proven:
        missing = "why.password_needed"
    if not missing:
        return
    difference = argument - old if argument is not None and isinstance(old, int | float) else None
    raise Question(
        missing,
        409,
        level=level,
        equipment=order.equipment,
        command=prepared.command.key,
        label=prepared.command.label,
        why=why,
        old=old,
        new=argument,
        difference=difference,
        unit=point.unit if point else "",
        decimals=point.decimals if point else 0,
        warning=setpoint.warning if setpoint else "",
        needs_reason=needs_reason,
        arguments=arguments,
        low=_known(span[0]),
        high=_known(span[1]),
    )


def _known(limit: float | None) -> float | None:
    return limit if limit is not None and isfinite(limit) else None
