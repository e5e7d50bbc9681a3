"""What is known of one parameter of a drive."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from app.profidrive.parameter_access.formats import Format, Number

NEAR = 1e-6
"""Of a step: so far a value may be from one and still means it."""


class When(StrEnum):
    """When a parameter may be changed."""

    ALWAYS = "always"
    STOPPED = "stopped"
    """Pulses off."""
    COMMISSIONING = "commissioning"
    """Pulses off, and p0010 is not 0."""


class Kind(StrEnum):
    """What its values mean."""

    NUMBER = "number"
    BINECTOR = "binector"
    """Where a bit comes from (BICO): `r0722.0`."""
    CONNECTOR = "connector"
    """Where a value comes from (BICO): `r2050[1]`."""
    BITS = "bits"
    """A word of which every bit means something of its own."""


@dataclass(frozen=True, slots=True)
class DriveParameter:
    """One parameter, in every drive object that has it."""

    number: int
    writable: bool
    """p, else r."""
    format: Format
    group: str
    objects: tuple[int, ...] = (2,)
    """Drive objects that have it."""
    count: int = 0
    """Elements of an array; 0 = it is none."""
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    """Least and greatest value, of one that is written [unit]."""
    default: float = 0.0
    allowed: tuple[float, ...] = ()
    """If there are any, no other value is permitted."""
    when: When = field(default=When.ALWAYS)
    certainty: str = "G"
    """M a manual's page, T a thesis, G unconfirmed: number and meaning, not ranges and defaults."""
    options: Mapping[int, str] = field(default_factory=dict)
    """Value → text key, of those that have a name; a drive may know others within the limits."""
    kind: Kind = field(default=Kind.NUMBER)
    trigger: bool = False
    """Writing it makes the drive do something; then it reads 0 again."""
    name: str = ""
    """As its maker calls it (F114), of one that is a register: `number` is its address then. Empty = p or r and the number."""
    point: str = ""
    """The setpoint that is the same value; empty = none is."""
    label: str = ""
    """Text key of its name; empty = the one of its code."""
    warning: str = ""
    """Text key that is shown before writing."""
    scale: float = 1.0
    """[unit per raw step]; a fraction is one over a whole number."""
    decimals: int = 0
    bounds: tuple[str, str] = ("", "")
    """Codes of the parameters that its least and greatest value depend on; empty = `low`, `high`."""
    has_default: bool = True
    """Whether anything is known of its default."""
    individual: bool = False
    """Belongs to one drive alone (its address on the line, its encoder's adjustment): what another drive has of it is never taken over."""
    known: bool = True
    """Whether anything is known of it but its number."""

    @property
    def code(self) -> str:
        """As people call it: p1120, r0945, F114."""
        return self.name or f"{'p' if self.writable else 'r'}{self.number:04d}"

    @property
    def text_key(self) -> str:
        """Key of the text of its name."""
        return self.label or f"parameter.{self.code}"

    def in_unit(self, raw: Number) -> float:
        """`raw`, as the drive counts it, in its unit."""
        return float(raw) if self.scale == 1 else raw / round(1 / self.scale)

    def steps(self, value: float) -> float:
        """`value` [unit] as the drive counts it; not whole where it lies between two steps."""
        if self.scale == 1:
            return value
        exact = value * round(1 / self.scale)
        nearest = round(exact) if math.isfinite(exact) else exact
        return nearest if abs(exact - nearest) < NEAR else exact

    @property
    def elements(self) -> int:
        """So many values."""
        return self.count or 1
