"""What must be true of a machine: before a command, at any time, between its parameters, before an action."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Condition:
    """A sentence of the small grammar (plant/expression.py) with the text that names it in positive wording."""

    key: str
    label: str
    expression: str
    commands: Sequence[str] = ()
    """Commands it guards; empty = all that move."""
    missing: str = ""
    """Text key: what is wrong while it does not hold, and the way out; empty = only `label` is told."""
    values: Mapping[str, str] = field(default_factory=dict)
    """Numbers that this text names: name → expression over points."""
    situational: bool = False
    """It is not met in good running, too (standstill, a mode): it looks missing only at the command that it guards."""
