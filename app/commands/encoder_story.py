"""The adjustment of an absolute encoder as it is told: which step is at what, since when, with which value. Pure.

    read → coordinate → start → wait → verify        → save
    former values, p2599 written, p2507 = 2, 3 read, position compared; saving to ROM is a deliberate step of its own

Source of the order: reference/theses-facts.md section 4 (Encoder_Set) with the time-out that it lacks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

READ, COORDINATE, START, WAIT, VERIFY, SAVE = "read", "coordinate", "start", "wait", "verify", "save"
STEPS = (READ, COORDINATE, START, WAIT, VERIFY)
"""Steps of the sequence itself, in their order."""
ERROR, NOT_ADJUSTED, STARTED, ADJUSTED = 0, 1, 2, 3
"""Values of p2507 (reference/profidrive.md section 7)."""
WAIT_LIMIT = 10.0
"""Longest wait for the drive to be adjusted [s] (reference/hmi-design.md 22.12)."""


class StepState(StrEnum):
    """Where a step stands; its text is `enc.state.<value>`."""

    WAITING = "waiting"
    ACTIVE = "active"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Step:
    """One step."""

    key: str
    state: StepState = StepState.WAITING
    began: int = 0
    """[µs UTC]; 0 = not yet."""
    ended: int = 0
    """[µs UTC]; 0 = not yet."""
    value: float | None = None
    """What was read or written last in it."""
    reason: str = ""
    """Why it failed (text key), filled with `params`."""
    params: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Story:
    """One adjustment."""

    coordinate: float
    """Where the axis is to be [LU]."""
    person: str
    id: str = ""
    """Of its order, as the audit trail has it."""
    steps: tuple[Step, ...] = field(default_factory=lambda: tuple(Step(key) for key in STEPS))
    save: Step = Step(SAVE)
    former: Mapping[str, float] = field(default_factory=dict)
    """Code → what the drive held before [LU]; p2507 as it is."""

    def step(self, key: str) -> Step:
        """One of its steps."""
        return next(one for one in (*self.steps, self.save) if one.key == key)

    @property
    def succeeded(self) -> bool:
        """Whether the encoder is adjusted and the position verified; saved or not."""
        return all(one.state is StepState.DONE for one in self.steps)

    @property
    def failed(self) -> Step | None:
        """The step that it ended in."""
        return next((one for one in self.steps if one.state is StepState.FAILED), None)

    @property
    def over(self) -> bool:
        """Whether it has come to its end."""
        return self.succeeded or self.failed is not None

    def began(self, key: str, at: int) -> "Story":
        """The step begins at `at` [µs UTC]."""
        return self._with(replace(self.step(key), state=StepState.ACTIVE, began=at, ended=0, reason="", params={}))

    def saw(self, key: str, value: float) -> "Story":
        """What the step has read or written."""
        return self._with(replace(self.step(key), value=value))

    def done(self, key: str, at: int, value: float | None = None) -> "Story":
        """The step is over at `at` [µs UTC]."""
        before = self.step(key)
        return self._with(
            replace(before, state=StepState.DONE, ended=at, value=before.value if value is None else value)
        )

    def broke(self, key: str, at: int, reason: str, params: Mapping[str, object]) -> "Story":
        """The step failed at `at` [µs UTC]."""
        return self._with(replace(self.step(key), state=StepState.FAILED, ended=at, reason=reason, params=dict(params)))

    def _with(self, step: Step) -> "Story":
        if step.key == SAVE:
            return replace(self, save=step)
        return replace(self, steps=tuple(step if one.key == step.key else one for one in self.steps))


def verdict(state: float | None, waited: float) -> str | None:
    """Why a drive whose p2507 reads `state` (None = it does not tell) after `waited` [s] is not adjusted, a text key; empty = it is;
    None = it goes on."""
    if state == ADJUSTED:
        return ""
    if state == ERROR:
        return "why.enc_error"
    if state == NOT_ADJUSTED:
        return "why.enc_not_adjusted"
    if waited < WAIT_LIMIT:
        return None
    return "why.enc_unread" if state is None else "why.enc_timeout"
