"""The values of a run of a virtual sequence: those of the last start until the next one, retained."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite

from app.blocks.sequence import SequenceBlock
from app.plant.sequence_definition import PREFIX, SequenceDefinition
from app.registers.codec import shortest_of
from app.registers.plc_map import real, real_of


class Recipe:
    """What Start takes beside the permissives; before the first run the defaults."""

    def __init__(self, definition: SequenceDefinition, changed: Callable[[], None]) -> None:
        """`changed` is called when values are others than before."""
        self._declared, self._steps, self._changed = tuple(definition.recipe), definition.steps, changed
        self._counts = frozenset(loop.recipe for loop in definition.chart.loops)
        self.forget()

    values: tuple[float, ...]
    """In the order of the definition."""

    def forget(self) -> None:
        """As before the first run."""
        self.values = tuple(one.default for one in self._declared)

    def __len__(self) -> int:
        return len(self._declared)

    @property
    def by_key(self) -> dict[str, float]:
        """Key → value."""
        return {one.key: value for one, value in zip(self._declared, self.values, strict=True)}

    def value(self, name: str) -> float | None:
        """What `recipe.<key>` in a sentence is; None = it is none of the values."""
        return self.by_key.get(name.removeprefix(PREFIX)) if name.startswith(PREFIX) else None

    def outside(self, raw: Sequence[int]) -> int:
        """Number, from 1, of the first of the `raw` arguments of a start that is no value within its limits, or not
        whole and the count of a loop; 0 = all are."""
        for number, (one, word) in enumerate(zip(self._declared, raw, strict=False), 1):
            value = real_of(word)
            # both ends as a telegram carries them: an f32
            if not (isfinite(value) and _single(one.low) <= value <= _single(one.high)):
                return number
            if one.key in self._counts and not value.is_integer():
                return number
        return 0

    def take(self, raw: Sequence[int]) -> None:
        """The `raw` arguments of a start, as they were written: 0.1, not what is left of it in a telegram."""
        self.put(tuple(shortest_of(real_of(word)) for _, word in zip(self._declared, raw, strict=False)))

    def put(self, values: tuple[float, ...]) -> None:
        """These values."""
        if values != self.values:
            self.values = values
            self._changed()

    def time(self, step: int, which: str) -> float | None:
        """The time (`minimum`, `maximum`) of `step` that is a value of the run [s]; None = it is none."""
        key = self._steps[step - 1].recipe.get(which)
        return self.by_key[key] if key else None

    def apply(self, block: SequenceBlock) -> None:
        """Times of steps and counts of loops that are values of the run."""
        block.settings = replace(block.settings, chart=block.settings.chart.counted(self.by_key))
        for number in range(1, len(self._steps) + 1):
            minimum, maximum = self.time(number, "minimum"), self.time(number, "maximum")
            if minimum is None and maximum is None:
                continue
            now = block.settings.step(number)
            block.set_times(
                number, now.minimum if minimum is None else minimum, now.maximum if maximum is None else maximum
            )


def _single(value: float) -> float:
    return real_of(real(value))
