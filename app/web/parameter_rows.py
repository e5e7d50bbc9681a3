"""The parameters of a machine as the rows of their page."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

from app.plant import expression
from app.plant.definitions import Setpoint
from app.web.operation import Operation
from app.web.points import PointView

CONFIRMED = frozenset("MTCX")
"""Marks of the reference sheet that stand for a source; G alone, or a question mark, is unconfirmed."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter as a row."""

    key: str
    code: str
    """The maker's name for it, else its key."""
    point: PointView
    low: float | None
    """Least value now [EU]; None = not known."""
    high: float | None
    default: str
    options: Mapping[str, str]
    """Value → text; empty when it is a number."""
    confirmed: bool
    marks: str
    warning: str
    stopped_only: bool
    depends: Sequence[str]
    """Other setpoints that its limits come from: with a new value of one of them they are others than drawn."""
    reason: str
    """Why this person cannot write it at all; empty = they can."""

    @property
    def mark(self) -> str:
        """The maker's name for it, as it is shown; empty when there is none."""
        return "" if self.code == self.key else self.code

    @property
    def permitted(self) -> str:
        """The permitted range as drawn."""
        if self.low is None or self.high is None:
            return "– –"
        return f"{self.point.number(self.low)} … {self.point.number(self.high)}"


@dataclass(frozen=True, slots=True)
class Group:
    """Parameters that belong together."""

    key: str
    label: str
    rows: Sequence[Parameter]

    @property
    def codes(self) -> str:
        """First and last code: `F900 – F905`."""
        codes = sorted(row.mark for row in self.rows)
        return codes[0] if codes[0] == codes[-1] else f"{codes[0]} – {codes[-1]}"


def groups_of(operation: Operation, keys: Container[str] | None = None) -> list[Group]:
    """The setpoints of the machine, or those of them that are in `keys`, by group, in the order of the type's file."""
    item, machine = operation.equipment.equipment, operation.equipment
    found: dict[str, list[Parameter]] = {}
    for key, setpoint in item.type.setpoints.items():
        if key in item.points and (keys is None or key in keys):
            found.setdefault(setpoint.group, []).append(_parameter(operation, key, setpoint))
    return [
        Group(key or "other", machine.t(key) if key else machine.text("par.other"), rows) for key, rows in found.items()
    ]


def _parameter(operation: Operation, key: str, setpoint: Setpoint) -> Parameter:
    machine, person = operation.equipment, operation.person
    point = machine.point(key)
    look = operation.look
    marks = setpoint.certainty
    low, high = expression.number(setpoint.low, look), expression.number(setpoint.high, look)
    item_setpoints = machine.equipment.type.setpoints.keys()
    reason = ""
    if person is None or not person.may("configure") or setpoint.role not in person.roles:
        reason = machine.text("par.engineers_write")
    return Parameter(
        key,
        setpoint.code or key,
        point,
        low,
        high,
        "" if setpoint.default is None else _default(machine.t, setpoint, point),
        {f"{value:g}": machine.t(text) for value, text in setpoint.options.items()},
        bool(CONFIRMED & set(marks)) and "?" not in marks,
        marks,
        machine.t(setpoint.warning) if setpoint.warning else "",
        setpoint.stopped_only,
        sorted(_names(setpoint) & item_setpoints),
        reason,
    )


def _names(setpoint: Setpoint) -> frozenset[str]:
    return expression.parse(setpoint.low).names | expression.parse(setpoint.high).names


def _default(t: "object", setpoint: Setpoint, point: PointView) -> str:
    assert setpoint.default is not None
    key = setpoint.options.get(int(setpoint.default)) if setpoint.options else None
    return str(t(key)) if key and callable(t) else point.number(setpoint.default)
