"""Forces of a sequence: permissives that a person has set for a time."""

from collections.abc import Iterator
from dataclasses import dataclass

from app.blocks.sequence.reports import Report
from app.blocks.sequence.settings import SequenceSettings
from app.blocks.sequence.states import BITS, SequenceEvent

ENDED_BY_PERSON, ENDED_BY_TIME, ENDED_BY_RESTART = 0.0, 1.0, 2.0
"""Value of `SequenceEvent.RELEASED`."""


@dataclass(frozen=True, slots=True)
class Force:
    """One forced permissive."""

    step: int
    bit: int
    until: int
    """[µs]"""


class ForceRefused(ValueError):
    """A permissive cannot be forced: `reason` is `unknown`, `forbidden` or `duration`."""

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


class Forces:
    """Places (step, bit) that are forced, in the order in which they came; step 0 = the abort conditions."""

    def __init__(self) -> None:
        """None is forced."""
        self._held: dict[tuple[int, int], Force] = {}

    def __contains__(self, place: object) -> bool:
        """Whether (step, bit) is forced."""
        return place in self._held

    def __iter__(self) -> Iterator[tuple[int, int]]:
        """The places."""
        return iter(self._held)

    def __len__(self) -> int:
        """How many there are."""
        return len(self._held)

    def bits(self, step: int) -> int:
        """Forced bits of `step`."""
        return sum(1 << force.bit for force in self._held.values() if force.step == step)

    def remaining(self, step: int, bit: int, now: int) -> float:
        """How long a force still holds [s] at `now` [µs]; 0 = not forced."""
        force = self._held.get((step, bit))
        return max(0.0, (force.until - now) / 1e6) if force else 0.0

    def force(self, settings: SequenceSettings, step: int, bit: int, seconds: float, now: int) -> Report:
        """Set permissive `bit` of `step` for `seconds`; a second time changes how long.

        Raises:
            ForceRefused: no such permissive, one that may not be forced, no such duration.
        """
        if not (0 <= step <= len(settings.steps) and 0 <= bit < BITS):
            raise ForceRefused("unknown", f"step {step} bit {bit}: no such permissive")
        allowed = settings.step(step).forceable if step else settings.abort_forceable
        if not allowed >> bit & 1:
            raise ForceRefused("forbidden", f"step {step} bit {bit}: may not be forced")
        if not 0 < seconds <= settings.longest_force:
            raise ForceRefused("duration", f"{seconds} s: expected more than 0, at most {settings.longest_force:g}")
        self._held[step, bit] = Force(step, bit, now + round(seconds * 1e6))
        return Report(SequenceEvent.FORCED, step, bit, seconds)

    def release(self, step: int, bit: int) -> Report | None:
        """End a force; None when there was none."""
        if self._held.pop((step, bit), None) is None:
            return None
        return Report(SequenceEvent.RELEASED, step, bit, ENDED_BY_PERSON)

    def expire(self, now: int) -> list[Report]:
        """End those whose time is over at `now` [µs]."""
        over = [place for place, force in self._held.items() if force.until <= now]
        for place in over:
            del self._held[place]
        return [Report(SequenceEvent.RELEASED, *place, ENDED_BY_TIME) for place in over]

    def retained(self) -> list[tuple[int, int, int]]:
        """(step, bit, until [µs]) of each, for a restart."""
        return [(force.step, force.bit, force.until) for force in self._held.values()]

    def restore(self, step: int, bit: int, until: int, now: int, *, keep: bool) -> Report | None:
        """After a restart: it goes on if `keep` and its time is not over; else it has ended."""
        if keep and until > now:
            self._held[step, bit] = Force(step, bit, until)
            return None
        return Report(SequenceEvent.RELEASED, step, bit, ENDED_BY_RESTART)
