"""Which step of a sequence follows which, for templates: branches, loops and safe steps in words, and what is waited for."""

from collections.abc import Callable, Collection
from functools import cached_property

from app.plant.sequence_definition import SequenceDefinition
from app.plant.sequence_recipe import point_of
from app.web.points import EquipmentView


class SequenceWays:
    """The structure of a sequence as it stands."""

    def __init__(
        self,
        equipment: EquipmentView,
        definition: SequenceDefinition,
        ready: Callable[[int], bool],
        active: Collection[int],
        say: Callable[..., str],
    ) -> None:
        """`ready`: whether a step can be entered; `active`: states of one that is active; `say`: a text of the screen by its key."""
        self.equipment, self.definition = equipment, definition
        self._ready, self._active, self._say, self._total = ready, active, say, len(definition.steps)

    def next_of(self, step: int) -> int:
        """The step that follows `step`: of several one that can be entered, else the first that cannot; the last one itself."""
        following = self.following(step)
        able = next((steps for steps in following if all(self._ready(each) for each in steps)), None)
        steps = able if able is not None else following[0]
        return next((each for each in steps if not self._ready(each)), steps[0]) if steps else step

    def following(self, step: int) -> tuple[tuple[int, ...], ...]:
        """What may follow `step` now, as the block says."""
        if not 0 < step <= self._total:
            return ((1,),)
        chart = self.definition.chart
        loop, back = chart.loop(step), self._cell(step, "passes") or 0
        if loop is not None and back + 1 < (self.times(step) or loop.times):
            return ((loop.first,),)
        return chart.ways(step, self._total).targets

    @cached_property
    def actives(self) -> list[int]:
        """Every step that is active, suspended or not."""
        return [number for number in range(1, self._total + 1) if self._cell(number, "state") in self._active]

    def beside(self, step: int) -> str:
        """Which other steps are active, to be written behind what `step` waits for; empty = none."""
        more = [str(each) for each in self.actives if each != step]
        return f" · {self._say('way_more', steps=', '.join(more))}" if more else ""

    def depth(self, step: int) -> int:
        """How many branches `step` stands in, as far as the list is set in."""
        return min(self.definition.chart.depth(step), 3)

    def words(self, step: int) -> list[str]:
        """What branches and loops have to do with `step`, in words."""
        chart = self.definition.chart
        said = []
        for branch in chart.branches:
            if step in branch.paths:
                key = "all" if branch.together else "first"
                number, total = list(branch.paths).index(step) + 1, len(branch.paths)
                said.append(self._say(f"way_{key}", n=number, total=total))
            if step == branch.then:
                said.append(self._say("way_meet"))
        if (loop := chart.loop(step)) is not None:
            said.append(self._back(step, loop.first))
        if chart.safe and step == chart.safe:
            said.append(self._say("way_safe"))
        return said

    def times(self, last: int) -> int | None:
        """How often the loop that ends with step `last` is passed in the run that lasts, or was in the last one; None = nobody says it."""
        loop = self.definition.chart.loop(last)
        if loop is None or not loop.recipe:
            return loop.times if loop else None
        number = [one.key for one in self.definition.recipe].index(loop.recipe) + 1
        point = self.equipment.point(point_of(number)) if self.equipment.has(point_of(number)) else None
        return round(point.value) if point and point.usable and isinstance(point.value, int | float) else None

    @property
    def passes(self) -> list[str]:
        """Of each loop in which the run is, in words: which pass it is, of how many."""
        said = []
        for loop in self.definition.chart.loops:
            back = self._cell(loop.last, "passes")
            if back is None or not any(loop.first <= step <= loop.last for step in self.actives):
                continue
            times = self.times(loop.last)
            said.append(self._say("way_pass", n=round(back) + 1, times=times or "–", first=loop.first, last=loop.last))
        return said

    @property
    def pass_names(self) -> str:
        """Tags by which `passes` changes."""
        keys = [f"step_{loop.last}_passes" for loop in self.definition.chart.loops]
        return " ".join(self.equipment.point(key).name for key in keys if self.equipment.has(key))

    @property
    def counted(self) -> bool:
        """Whether a loop is passed as often as is given at Start."""
        return any(loop.recipe for loop in self.definition.chart.loops)

    def _back(self, last: int, first: int) -> str:
        """Where the loop that ends with step `last` leads, and how often; before a run who says so."""
        loop, times = self.definition.chart.loop(last), self.times(last)
        given = next((one for one in self.definition.recipe if loop and one.key == loop.recipe), None)
        if given is None:
            return self._say("way_loop", first=first, times=times)
        label = self.equipment.words(given.label)
        if times is None or not self.actives:
            return self._say("way_loop_given", first=first, label=label)
        return self._say("way_loop_run", first=first, times=times, label=label)

    def _cell(self, step: int, column: str) -> float | None:
        key = f"step_{step}_{column}"
        point = self.equipment.point(key) if self.equipment.has(key) else None
        return float(point.value) if point and point.usable and isinstance(point.value, int | float) else None
