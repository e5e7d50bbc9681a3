"""What a sequence is told: its settings, and the signals of one scan."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from app.blocks.sequence.chart import Chart
from app.blocks.sequence.states import ALL


@dataclass(frozen=True, slots=True)
class StepSettings:
    """Times of a step and what its permissives may do."""

    minimum: float = 0.0
    """[s]"""
    maximum: float = 0.0
    """[s]; 0 = stay."""
    loss_aborts: bool = False
    """Whether a permissive that is lost while the step is active aborts; else they only count for entering it."""
    forceable: int = ALL
    """Permissives that may be forced."""

    def __post_init__(self) -> None:
        for name in ("minimum", "maximum"):
            value = getattr(self, name)
            if not 0 <= value < float("inf"):
                raise ValueError(f"{name} = {value}: expected seconds from 0 up")
        if not 0 <= self.forceable <= ALL:
            raise ValueError(f"forceable = {self.forceable}: expected 16 bits")


@dataclass(frozen=True, slots=True)
class SequenceSettings:
    """Everything of a sequence that is not a signal."""

    steps: Sequence[StepSettings]
    abort_forceable: int = 0
    """Abort conditions that may be forced."""
    output_while_suspended: bool = False
    stall_after: float = 1.0
    """[s]"""
    longest_force: float = 8 * 3600.0
    """[s]"""
    keep_forces: bool = False
    """Whether forces outlive a restart of the device; else they are gone then."""
    chart: Chart = field(default_factory=Chart)
    """Which step follows which."""

    def __post_init__(self) -> None:
        if not self.steps:
            raise ValueError("steps = 0: expected at least one")

    def step(self, number: int) -> StepSettings:
        """The settings of step `number`, from 1."""
        return self.steps[number - 1]


@dataclass(slots=True)
class Signals:
    """Inputs of one scan."""

    permissives: Sequence[int]
    """16 bits per step."""
    abort: int = ALL
    """Abort conditions; 1 = healthy."""
    start: bool = False
    suspend: bool = False
    abort_request: bool = False
    acknowledge: bool = False
    single: bool = False
    """Single step: a step is left only on a rising edge of `advance`."""
    advance: bool = False
    pending: Collection[int] = ()
    """Steps whose commands are not confirmed yet: they are not left."""
    refused: Mapping[int, int] = field(default_factory=dict)
    """Step → number, from 1, of its command that was refused or not confirmed."""
