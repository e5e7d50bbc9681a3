"""What is known of one parameter of a drive."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from app.profidrive.parameter_access.formats import Format


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

    @property
    def code(self) -> str:
        """As people call it: p1120, r0945."""
        return f"{'p' if self.writable else 'r'}{self.number:04d}"

    @property
    def elements(self) -> int:
        """So many values."""
        return self.count or 1
