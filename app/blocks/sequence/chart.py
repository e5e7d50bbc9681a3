"""Which step follows which: paths, alternative and parallel branches, loops and safe steps, by the numbers of the steps.

Steps stand in one row. A branch divides behind a step into paths that follow one another in the row and meet in the step behind them; a
loop leads from the end of a stretch back to its beginning. So every branch meets again, whatever is nested in it, and no step is active
twice. Branches follow IEC 61131-3, sequential function chart:

| subject | rule |
| --- | --- |
| alternative | the first path whose first step can be entered, in the order of the row |
| parallel | all paths at once, when the first steps of all can be entered |
| they meet | when the last steps of all paths have had their time and the step in which they meet can be entered |
| loop | behind its last step, until it was passed `times` times; then what follows it; `times` may be given at the start |
| safe steps | the end of the row: entered by a run that stops before its end, never else |
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise


@dataclass(frozen=True, slots=True)
class Branch:
    """Paths behind a step."""

    after: int
    paths: Sequence[int]
    """The first step of each; it goes up to the next one, the last up to `then`."""
    then: int
    """The step in which they meet."""
    together: bool = False
    """Whether all paths are run side by side; else the first that can be entered."""

    @property
    def spans(self) -> list[tuple[int, int]]:
        """First and last step of each path."""
        return [(first, follower - 1) for first, follower in pairwise((*self.paths, self.then))]


@dataclass(frozen=True, slots=True)
class Loop:
    """A stretch of steps that is passed several times."""

    first: int
    last: int
    times: int
    recipe: str = ""
    """Key of the value of the run that says `times`; empty = it is fixed."""


@dataclass(frozen=True, slots=True)
class Ways:
    """Where a step leads."""

    targets: tuple[tuple[int, ...], ...]
    """In the order of their priority, each the steps that are entered together; (()) = the end."""
    together: tuple[int, ...] = ()
    """Last steps of parallel paths that are left together, this one among them; empty = it is left by itself."""


@dataclass(frozen=True, slots=True)
class Chart:
    """The structure of a sequence; without branches one step after the other."""

    branches: Sequence[Branch] = ()
    loops: Sequence[Loop] = ()
    safe: int = 0
    """The first of the safe steps; 0 = none."""
    _ways: dict[tuple[int, int], Ways] = field(default_factory=dict, repr=False, compare=False)

    def final(self, steps: int) -> int:
        """The last step of a run that nothing stops."""
        return self.safe - 1 if self.safe else steps

    def counted(self, values: Mapping[str, float]) -> "Chart":
        """As it is in a run with these values, by their keys: loops that one of them counts are passed so often."""
        if not any(loop.recipe in values for loop in self.loops):
            return self
        loops = (
            replace(loop, times=round(values[loop.recipe])) if loop.recipe in values else loop for loop in self.loops
        )
        return replace(self, loops=tuple(loops))

    def loop(self, step: int) -> Loop | None:
        """The loop that ends with `step`."""
        return next((loop for loop in self.loops if loop.last == step), None)

    def ways(self, step: int, steps: int) -> Ways:
        """Where `step` of so many leads; loops aside."""
        found = self._ways.get((step, steps))
        if found is None:
            found = self._ways[step, steps] = self._find(step, steps)
        return found

    def _find(self, step: int, steps: int) -> Ways:
        for branch in self.branches:
            if branch.after == step:
                return Ways((tuple(branch.paths),) if branch.together else tuple((path,) for path in branch.paths))
        for branch in self.branches:
            ends = tuple(last for _, last in branch.spans)
            if step in ends:
                return Ways(((branch.then,),), ends if branch.together else ())
        return Ways(((),) if step in (self.final(steps), steps) else ((step + 1,),))

    def depth(self, step: int) -> int:
        """How many branches `step` stands in."""
        return sum(1 for branch in self.branches if branch.paths[0] <= step < branch.then)

    def beside(self, step: int) -> frozenset[int]:
        """Steps that may be active while `step` is."""
        found: set[int] = set()
        for branch in self.branches:
            inside = [span for span in branch.spans if span[0] <= step <= span[1]]
            if branch.together and inside:
                found.update(
                    n for first, last in branch.spans if (first, last) != inside[0] for n in range(first, last + 1)
                )
        return frozenset(found)
