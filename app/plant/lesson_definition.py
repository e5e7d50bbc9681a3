"""What a lesson consists of, after its file was read (plant/lessons.py)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from zlib import crc32

Texts = Mapping[str, str]
"""Language → text."""

NO_FAULT = "none"
"""In place of the name of a fault: what was caused is removed."""
MOMENTS = ("active", "acknowledged", "gone")
"""What a step may wait for with an alarm: it stands, it stands and was seen, it neither stands nor waits to be seen."""


@dataclass(frozen=True, slots=True)
class Choice:
    """An answer that one may give."""

    label: Texts
    right: bool
    why: Texts
    """Why it is right, or wrong."""


@dataclass(frozen=True, slots=True)
class Deed:
    """What a learner does, in a solution: one of the two."""

    command: str = ""
    value: float | None = None
    """Its argument [EU]."""
    acknowledge: str = ""
    """Key of an alarm."""


@dataclass(frozen=True, slots=True)
class LessonStep:
    """One step: it is done by exactly one of `until`, `command`, `alarm`, `cause`, `choices`."""

    title: Texts
    text: Texts
    hint: Texts
    """Empty: there is none."""
    until: str = ""
    """A sentence over the points of the machine that becomes true."""
    hold: float = 0.0
    """For how long it must hold [s]."""
    command: str = ""
    """A command that the learner gives and that is confirmed."""
    alarm: str = ""
    """Key of an alarm of the machine."""
    moment: str = "active"
    """Of `MOMENTS`."""
    cause: str = ""
    """Name of a machine fault of the type's training that the step causes when the learner says so, or `NO_FAULT`."""
    choices: Sequence[Choice] = ()
    solution: Sequence[Deed] = ()
    """How it is done, for the test that plays the lesson."""

    @property
    def kind(self) -> str:
        """`until`, `command`, `alarm`, `cause` or `question`."""
        return next((name for name in ("until", "command", "alarm", "cause") if getattr(self, name)), "question")

    @property
    def right(self) -> int:
        """Index of the right answer of a question."""
        return next(index for index, choice in enumerate(self.choices) if choice.right)


@dataclass(frozen=True)
class Lesson:
    """A lesson for machines of one type."""

    name: str
    type: str
    title: Texts
    about: Texts
    minutes: int
    """How long it takes, about [min]."""
    steps: Sequence[LessonStep] = field(default_factory=tuple)

    @cached_property
    def edition(self) -> str:
        """Another one when what is to be done differs: progress in another edition says nothing. Words may be mended."""
        told = [
            (step.until, step.hold, step.command, step.alarm, step.moment, step.cause, len(step.choices), step.kind)
            for step in self.steps
        ]
        return f"{crc32(repr((self.type, told)).encode()):08x}"
