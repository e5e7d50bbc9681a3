"""The life of one command: asked, accepted by the device, confirmed by its feedback, or what became of it instead. Pure.

    requested ─→ accepted ─→ confirmed
        │            ├→ unconfirmed   no feedback within the limit
        │            ├→ failed        a fault appeared, or the device refused
        │            └→ superseded    a newer command or a Stop
        ├→ refused   the gate said no; nothing was written
        ├→ dry_run   computed and shown, never written
        └→ unknown   no valid answer to the telegram: re-read, never sent again

Accepted means that the echo of every telegram was checked. Confirmed means that values read after that satisfy the feedback.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from app.commands.value_set import Change


class ProgressState(StrEnum):
    """Where a command stands; its text is `fb.<state>`."""

    REQUESTED = "requested"
    ACCEPTED = "accepted"
    CONFIRMED = "confirmed"
    FAILED = "failed"
    UNCONFIRMED = "unconfirmed"
    REFUSED = "refused"
    UNKNOWN = "unknown"
    DRY_RUN = "dry_run"
    SUPERSEDED = "superseded"


_OUTCOMES = frozenset(
    {ProgressState.CONFIRMED, ProgressState.FAILED, ProgressState.UNCONFIRMED, ProgressState.SUPERSEDED}
)

NEXT: Mapping[ProgressState, frozenset[ProgressState]] = {
    ProgressState.REQUESTED: _OUTCOMES
    | {ProgressState.ACCEPTED, ProgressState.REFUSED, ProgressState.UNKNOWN, ProgressState.DRY_RUN},
    ProgressState.ACCEPTED: _OUTCOMES | {ProgressState.UNKNOWN},
    ProgressState.UNKNOWN: _OUTCOMES | {ProgressState.UNKNOWN},
    ProgressState.CONFIRMED: _OUTCOMES,
}
"""State → states that may follow. Requested goes to confirmed only for a Stop whose echo was lost and whose effect is read back, and for
a hold-to-run that was seen to move before its echo was through; confirmed goes on only for a hold-to-run, which is confirmed while it
moves and ends when it has stopped."""


@dataclass(frozen=True, slots=True)
class Progress:
    """One command as every viewer of the machine sees it. Texts are keys."""

    id: str
    equipment: str
    command: str
    """Key of the command or of the setpoint."""
    label: str
    """Text key of the command."""
    person: str
    """Name shown for who asked."""
    state: ProgressState
    requested: int
    """When it was asked [µs UTC]."""
    accepted: int = 0
    """When the echo was checked [µs UTC]; 0 = not."""
    ended: int = 0
    """When it came to its end [µs UTC]; 0 = it goes on."""
    reason: str = ""
    """Text key, filled with `params`."""
    params: Mapping[str, object] = field(default_factory=dict)
    argument: float | None = None
    old: float | int | str | None = None
    """What the point of the argument held before."""
    limit: float = 0.0
    """Time within which the feedback must come, from accepted on [s]."""
    telegrams: tuple[tuple[str, float], ...] = ()
    """(point, value) that are or, in a dry run, would be written; of a command sent as a code `code` and its arguments."""
    arguments: Mapping[str, float] = field(default_factory=dict)
    """Name → value, of a command that takes several."""
    changes: tuple[Change, ...] = ()
    """Of a set of setpoints: each with what the device holds of it in the end."""
    former: Mapping[str, float] = field(default_factory=dict)
    """Point → what it held before [EU], of a hold-to-run that gives it back when it is over."""
    requests: tuple[int, ...] = ()
    """Ids under which a device with a map of ours knows it; its events carry them."""
    asker: int = 0
    """Id of the person who asked, whatever they are called; 0 = a program, or nobody."""

    @property
    def over(self) -> bool:
        """Whether nothing more will happen to it."""
        return self.ended > 0

    @property
    def text(self) -> str:
        """Text key of the state."""
        return f"fb.{self.state}"


def also_known_as(progress: Progress, request: int) -> Progress:
    """`progress`, which the device knows by the id `request`, too; 0 is none."""
    if not request or request in progress.requests:
        return progress
    return replace(progress, requests=(*progress.requests, request))


def advance(
    progress: Progress,
    state: ProgressState,
    at: int,
    *,
    end: bool | None = None,
    reason: str = "",
    params: Mapping[str, object] = {},
) -> Progress:
    """`progress` in `state` since `at` [µs UTC]. Every state but accepted and unknown is the end, unless `end` says otherwise.

    Raises:
        ValueError: the command is over, or nothing leads from where it stands to `state`.
    """
    if progress.over or state not in NEXT.get(progress.state, ()):
        raise ValueError(f"command {progress.id}: {progress.state}{' (over)' * progress.over} does not become {state}")
    ends = state not in (ProgressState.ACCEPTED, ProgressState.UNKNOWN) if end is None else end
    return replace(
        progress,
        state=state,
        accepted=at if state is ProgressState.ACCEPTED else progress.accepted,
        ended=at if ends else 0,
        reason=reason or progress.reason,
        params=params if reason else progress.params,
    )


@dataclass(frozen=True, slots=True)
class Facts:
    """What is known about a command that waits for its feedback."""

    state: ProgressState
    waited: float
    """Since accepted, or since it became unknown [s]."""
    limit: float
    """[s]"""
    feedback: bool | None
    """The feedback by values read since the telegram; None = no such values yet, or not known."""
    before: bool | None = None
    """The feedback before the telegram."""
    fault: bool = False
    """A fault appeared since."""


def judge(facts: Facts) -> ProgressState | None:
    """What the command becomes now; None = it goes on waiting. Unknown is a verdict too, when time is up.

    A command whose telegram got no valid answer is confirmed only by a change: feedback that held before proves nothing.
    """
    if facts.feedback and (
        facts.state is ProgressState.ACCEPTED or (facts.state is ProgressState.UNKNOWN and facts.before is False)
    ):
        return ProgressState.CONFIRMED
    if facts.fault:
        return ProgressState.FAILED
    if facts.waited < facts.limit:
        return None
    if facts.state is ProgressState.UNKNOWN and facts.feedback is not False:
        return ProgressState.UNKNOWN
    return ProgressState.UNCONFIRMED
