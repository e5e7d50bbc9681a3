"""The permissives of a sequence as they come: when each fell, which were lost for a moment, which of them fell first."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.blocks.sequence.forces import Forces
from app.blocks.sequence.reports import Fall, FirstOut, Report
from app.blocks.sequence.states import ALL, BITS, Cause, SequenceEvent

Values = Callable[[int, int], float]
"""(step, bit) → the analog value behind a permissive, for the first-out."""
FALLS_KEPT = 64
"""Short losses remembered per step."""


@dataclass(slots=True)
class _Snapshot:
    time: int
    words: tuple[int, ...]
    value: float
    together: int


class Watch:
    """The words of one sequence, abort conditions first."""

    def __init__(self, forces: Forces, values: Values) -> None:
        """Nothing seen yet."""
        self.falls: list[Fall] = []
        """What was lost while it mattered, oldest first."""
        self._forces, self._values = forces, values
        self._inputs: tuple[int, ...] = ()
        self._fell: dict[tuple[int, int], _Snapshot] = {}

    def word(self, number: int) -> int:
        """Permissives of step `number` (0 = abort conditions) as they count: inputs and forces."""
        return (self._inputs[number] if self._inputs else 0) | self._forces.bits(number)

    def first_out(self, cause: Cause, places: Sequence[int], at: int, now: int, value: float) -> FirstOut:
        """Of what is missing in the words of `places` what fell first; `at`: the step that was active."""
        missing = [(step, bit) for step in places for bit in range(BITS) if not self.word(step) >> bit & 1]
        if not missing:
            return FirstOut(cause, 0, -1, now, at, value, self._inputs)
        first = min(missing, key=lambda place: (self._fell[place].time, place))
        seen = self._fell[first]
        return FirstOut(cause, *first, seen.time, at, seen.value, seen.words, seen.together)

    def follow(self, words: tuple[int, ...], now: int, matters: Callable[[int], bool], reports: list[Report]) -> None:
        """Note when each permissive fell or came back; `matters`: whether that of a step is told."""
        before = self._inputs
        if words == before:
            return
        self._inputs = words
        fallen: list[tuple[int, int]] = []
        for step, word in enumerate(words):
            changed = word ^ before[step] if before else ~word & ALL
            while changed:
                bit = lowest(changed)
                changed &= changed - 1
                if word >> bit & 1:
                    self._came_back(step, bit, now)
                    if matters(step):
                        reports.append(Report(SequenceEvent.PERMISSIVE_BACK, step, bit))
                else:
                    fallen.append((step, bit))
        if not fallen:
            return
        together = {
            step: max(1, sum(1 for place in fallen if place[0] == step and place not in self._forces))
            for step, _ in fallen
        }
        for step, bit in fallen:
            self._fell[step, bit] = _Snapshot(now, words, self._values(step, bit), together[step])
            if before and matters(step):
                if len(self.falls) < FALLS_KEPT:
                    self.falls.append(Fall(step, bit, now, 0))
                reports.append(Report(SequenceEvent.PERMISSIVE_LOST, step, bit, together=together[step]))

    def _came_back(self, step: int, bit: int, now: int) -> None:
        self._fell.pop((step, bit), None)
        for index, fall in enumerate(self.falls):
            if (fall.step, fall.bit) == (step, bit) and not fall.back:
                self.falls[index] = fall._replace(back=now)


def lowest(word: int) -> int:
    """The lowest bit that is set."""
    return (word & -word).bit_length() - 1
