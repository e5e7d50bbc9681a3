"""A sequence as its file says: steps, permissives, abort conditions and tests."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

Texts = Mapping[str, str]
"""Language → text."""


@dataclass(frozen=True, slots=True)
class SequencePermissive:
    """One bit of a permissive word, in positive wording; a bit that nobody names counts as fulfilled."""

    key: str
    bit: int
    """0–15"""
    label: Texts
    when: str
    """Sentence of the grammar over the points of the sequence's machine; empty = the device itself knows it (no machine)."""
    value: str = ""
    """Point of the machine whose value is kept with a first-out; empty = none."""
    forceable: bool = True
    """False for what is relevant to safety."""


@dataclass(frozen=True, slots=True)
class SequenceStep:
    """One step of a sequence."""

    key: str
    label: Texts
    minimum: float = 0.0
    """[s]"""
    maximum: float = 0.0
    """[s]; 0 = stay."""
    loss_aborts: bool = False
    actions: Sequence[str] = ()
    """What it asks of the machine while its output is on."""
    permissives: Sequence[SequencePermissive] = ()
    """In order of their bits."""


@dataclass(frozen=True, slots=True)
class SequenceTest:
    """A given/when/then of a sequence, run on the simulator by `pogon check`."""

    name: str
    given: Mapping[str, float] = field(default_factory=dict)
    """Preset of the simulated machine → value."""
    when: Sequence[Mapping[str, object]] = ()
    """In order of time: `at` [s] with one of `command` (perhaps with `arguments`), `fault`, `set` (a table of presets)."""
    then: Sequence[Mapping[str, object]] = ()
    """What must be seen: `within` or `at` [s] with `state`, `step` or `expect`; `first_out`, the key of a permissive, with or without a
    time; `never` with a sentence. Sentences are over the points of the machine, without a machine over those of the sequence."""


@dataclass(frozen=True, slots=True)
class SequenceDefinition:
    """A sequence as its file says: `<plant>/sequences/<name>.toml`."""

    name: str
    label: Texts
    steps: Sequence[SequenceStep]
    abort: Sequence[SequencePermissive] = ()
    """Abort conditions; true = healthy."""
    output_while_suspended: bool = False
    stall_after: float = 1.0
    """[s]"""
    keep_forces: bool = False
    longest_force: float = 28800.0
    """[s]"""
    tests: Sequence[SequenceTest] = ()

    def permissives(self, step: int) -> Sequence[SequencePermissive]:
        """The named bits of step `step`, from 1; of the abort conditions for 0."""
        if not 0 <= step <= len(self.steps):
            return ()
        return self.steps[step - 1].permissives if step else self.abort

    def permissive(self, step: int, bit: int) -> SequencePermissive | None:
        """What bit `bit` of the word of step `step` (0 = abort conditions) is called; None when nobody names it."""
        return next((each for each in self.permissives(step) if each.bit == bit), None)
