"""Values of drive parameters that are to be written: which element of which drive object, and what reading it back must give. Pure.

An element is `2:p1120`, of an array `1:p0757[3]`: drive object, code, index. Where parameters are registers there are no drive objects:
`0:F114`.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from app.commands import value_set
from app.commands.value_set import Change, Stands
from app.errors import Refused
from app.plant.definitions import EquipmentType
from app.plant.expression import Look
from app.profidrive.parameter_access.formats import LAYOUTS, Number, fits, rounded
from app.profidrive.parameter_access.messages import (
    ADDRESS,
    HEADER,
    LONGEST,
    MOST_PARAMETERS,
    Address,
    Values,
    block_length,
)
from app.profidrive.parameter_access.parameter import DriveParameter

KEY, SAVE = "drive_parameters", "drive_save"
"""How writing parameters, and saving them, are called where a command has its key."""
LABEL, SAVE_LABEL = "dpar.change", "dpar.save"
ENCODER, ENCODER_LABEL = "encoder_adjustment", "enc.title"
"""The same of adjusting an absolute encoder."""
MOST = 300
"""Elements written as one: what the line of the audit trail that has each by itself can hold."""
ADJUSTS = ("p2507", 2)
"""What starts the adjustment of an encoder (encoder_adjustment.py)."""
SAVES = ("p0977", "p0971")
"""Parameters that copy RAM to ROM: of the whole device, of one drive object. The first that the type knows is used."""


@dataclass(frozen=True, slots=True)
class ParameterChange:
    """One element that is to hold another value."""

    object: int
    parameter: DriveParameter
    new: float
    index: int = 0
    seen: float | None = None
    """What the person saw it at; None = it was not looked at."""
    becomes: tuple[float, ...] = ()
    """What it may read back as besides `new`, of one that the drive itself goes on from (p2507: 2 becomes 3)."""

    @property
    def name(self) -> str:
        """p1120, p0757[3]."""
        return element_name(self.parameter, self.index)

    @property
    def key(self) -> str:
        """With the drive object."""
        return f"{self.object}:{self.name}"

    @property
    def acts(self) -> bool:
        """Writing it makes the drive do something, which writing the former value does not undo."""
        return self.parameter.trigger or bool(self.becomes)

    @property
    def address(self) -> Address:
        """The element in a request."""
        return Address(self.parameter.number, self.index, 1 if self.parameter.count else 0)

    def block(self, value: float) -> Values:
        """`value` as it is sent.

        Raises:
            TelegramError: it does not fit the format.
        """
        return Values(self.parameter.format, (rounded(self.parameter.format, as_number(self.parameter, value)),))

    def in_format(self, value: float) -> float:
        """`value` as the drive can hold it.

        Raises:
            TelegramError: it cannot.
        """
        return held(self.parameter, value)

    def described(self, old: float) -> Change:
        """The change as it is told, before it was made."""
        decimals = self.parameter.decimals if LAYOUTS[self.parameter.format].code != "f" else 3
        return Change(
            self.key, self.name, self.parameter.text_key, old, self.in_format(self.new), self.parameter.unit, decimals
        )

    def judged(self, change: Change, found: float | None, *, failed: bool = False) -> Change:
        """`change` with what the drive holds, `found`; None = it could not be read. `failed`: a former value that is the new one, too,
        counts as the former one."""
        if found is None:
            return replace(change, found=None, stands=Stands.UNKNOWN)
        if failed and found == change.old:
            stands = Stands.OLD
        elif found == change.new or found in self.becomes or (self.parameter.trigger and not found):
            stands = Stands.NEW
        else:
            stands = Stands.OLD if found == change.old else Stands.OTHER
        return replace(change, found=found, stands=stands)


def element_name(parameter: DriveParameter, index: int) -> str:
    """p1120, p0757[3]."""
    return f"{parameter.code}[{index}]" if parameter.count else parameter.code


def as_number(parameter: DriveParameter, value: float) -> Number:
    """`value` [unit] as the drive counts it: a whole number where the format is one."""
    steps = parameter.steps(value)
    whole = LAYOUTS[parameter.format].code != "f" and math.isfinite(steps) and steps == int(steps)
    return int(steps) if whole else steps


def held(parameter: DriveParameter, value: float) -> float:
    """`value` as the drive can hold it [unit].

    Raises:
        TelegramError: it cannot.
    """
    return parameter.in_unit(rounded(parameter.format, as_number(parameter, value)))


def wrong_value(parameter: DriveParameter, value: float) -> tuple[str, dict[str, object]] | None:
    """Why the parameter cannot be `value` by what is known of it (text key, what fills it); None = it may. The drive decides in the end."""
    unit: dict[str, object] = {"value": value, "unit": parameter.unit}
    if not parameter.writable:
        return "profidrive.error.x01", {}
    if not fits(parameter.format, as_number(parameter, value)):
        steps = parameter.steps(value)
        between = LAYOUTS[parameter.format].code != "f" and math.isfinite(steps) and steps != int(steps)
        key = "why.decimals" if between else "why.out_of_limits"
        return key, {**unit, "decimals": parameter.decimals, "min": parameter.low, "max": parameter.high}
    if parameter.allowed and value not in parameter.allowed:
        return "why.no_option", {**unit, "options": parameter.allowed}
    low, high = held(parameter, parameter.low), held(parameter, parameter.high)
    if not low <= held(parameter, value) <= high:
        return "why.out_of_limits", {**unit, "min": parameter.low, "max": parameter.high}
    return None


def apart(parameter: DriveParameter, value: float) -> str:
    """Why `value` is not written together with others, a text key; empty = it is: saving, and adjusting an encoder, wait for the drive."""
    if parameter.code in SAVES:
        return "why.par_save_apart"
    return "why.enc_apart" if parameter.code == ADJUSTS[0] and value == ADJUSTS[1] else ""


def requests(changes: Sequence[ParameterChange]) -> Iterator[Sequence[ParameterChange]]:
    """`changes` in their order, as many at a time as one request of a change holds."""
    found: list[ParameterChange] = []
    length = HEADER
    for one in changes:
        more = ADDRESS + block_length(LAYOUTS[one.parameter.format].size, 1)
        full = length + more > LONGEST or len(found) == MOST_PARAMETERS
        if found and (full or one.object != found[0].object):
            yield found
            found, length = [], HEADER
        found.append(one)
        length += more
    if found:
        yield found


def in_order(kind: EquipmentType, changes: Sequence[ParameterChange], look: Look) -> list[ParameterChange]:
    """`changes` in an order in which the checks of the type hold after every one of them, otherwise as they were.

    Raises:
        Refused: 422 `why.check`, they do not hold with the new values; `why.set_order`, there is no such order.
    """
    values = {one.parameter.point: one.new for one in changes if one.parameter.point}
    if (check := value_set.broken(kind, values, look)) is not None:
        raise Refused("why.check", 422, label=check.label, check=check.key)
    waiting, ordered, done = list(changes), list[ParameterChange](), dict[str, float]()
    while waiting:
        possible = (one for one in waiting if _holds(kind, one, done, look))
        following = next(possible, None)
        if following is None:
            raise Refused("why.set_order", 422, label=waiting[0].parameter.text_key)
        waiting.remove(following)
        ordered.append(following)
        if following.parameter.point:
            done[following.parameter.point] = following.new
    return ordered


def _holds(kind: EquipmentType, one: ParameterChange, done: Mapping[str, float], look: Look) -> bool:
    point = one.parameter.point
    return not point or value_set.broken(kind, {point: one.new}, value_set.after(look, done)) is None


def saving_of(kind: EquipmentType) -> DriveParameter | None:
    """The parameter by which a drive of this type copies its RAM to ROM; None when it has none."""
    return next((kind.drive_parameters[code] for code in SAVES if code in kind.drive_parameters), None)
