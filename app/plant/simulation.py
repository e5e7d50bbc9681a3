"""What `simulation.toml` of a type says of the machine behind its registers: data, of which sim/described makes a virtual device."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

Term = float | str
"""A number, or a sentence over points, options and training words."""

FAULT = "fault"
"""Word of a sentence: the machine fault that the instructor caused, 0 = none."""


@dataclass(frozen=True, slots=True)
class WriteRow:
    """What happens when a point is written: a row of `[[writes]]`."""

    point: str
    value: float | None
    """Only when it is this [EU]; None = whatever it is."""
    when: str
    """Sentence that must hold; empty = always."""
    refuse: int
    """Modbus exception with which the telegram is answered while `when` does not hold; 0 = it is taken and nothing more happens."""
    set: Mapping[str, Term]
    """Point → what it holds from then on; `argument` is what was written."""


@dataclass(frozen=True, slots=True)
class Rule:
    """What happens by itself, once each time that `when` has begun to hold: a row of `[[rules]]`."""

    when: str
    after: Term
    """It must have held for so long [s]."""
    set: Mapping[str, Term]


@dataclass(frozen=True, slots=True)
class Movement:
    """How a point moves by itself: `[values.<point>]`. Exactly one of `to`, `integral` and `every` is given."""

    to: Term | None = None
    """Where it goes [EU]."""
    lag: Term | None = None
    """Time constant with which it goes there [s]."""
    rate: Term | None = None
    """Steepest change with which it goes there [EU/s]; neither of both: at once."""
    integral: Term | None = None
    """What is added to it each second [EU/s]."""
    low: Term | None = None
    high: Term | None = None
    """Where an integral stops [EU]."""
    every: float = 0.0
    """Heartbeat: one more each time so long has passed [s]."""
    modulo: int = 0
    """The heartbeat begins again with 0 there."""
    noise: float = 0.0
    """Standard deviation of what its registers say around the value itself [EU]."""


@dataclass(frozen=True, slots=True)
class Simulation:
    """A whole simulation.toml."""

    start: Mapping[str, Term] = field(default_factory=dict)
    """Point → what it holds at the start: a number, a sentence over options, or the text of a string; others 0."""
    writes: Sequence[WriteRow] = ()
    rules: Sequence[Rule] = ()
    values: Mapping[str, Movement] = field(default_factory=dict)
