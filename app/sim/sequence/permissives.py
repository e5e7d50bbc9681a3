"""The permissive words of a sequence: sentences over its machine and points of the plant, or words that an instructor teaches."""

from collections.abc import Callable, Mapping
from math import isfinite, nan

from app.blocks.sequence import ALL
from app.errors import ConfigurationError
from app.plant.expression import parse
from app.plant.said import not_as, said
from app.plant.sequence_definition import SequenceDefinition
from app.plant.sequence_plant import own
from app.sim.sequence.machine import Machine
from app.tags.quality import GOOD, NO_DATA


class Permissives:
    """Words of a definition, abort conditions first, then one per step; a bit that nobody names is there.

    A sentence that cannot be decided counts as missing. Sentences are decided again only when a signal that they name has changed.
    """

    def __init__(self, definition: SequenceDefinition) -> None:
        """Without a machine, all taught words 1."""
        self._definition = definition
        self.machine: Machine | None = None
        self.plant: Callable[[str], float] = lambda name: nan
        """The value of a point of any machine, `m1.speed`; NaN unless it is good."""
        self.recipe: Callable[[str], float | None] = lambda name: None
        """The value of the run that a name stands for; None = it is the name of a point."""
        self.steps = len(definition.steps)
        words = tuple(definition.permissives(number) for number in range(self.steps + 1))
        sentences = definition.sentences
        self._sentences = tuple(parse(text, machines=True) for text in sentences)
        self._wishes = {key: sentences.index(text) for key, text in definition.wishes.items()}
        self._reads = tuple(
            tuple((one.bit, sentences.index(one.when)) for one in permissives if one.when) for permissives in words
        )
        self._names = tuple(dict.fromkeys(name for sentence in self._sentences for name in sorted(sentence.names)))
        self._own = tuple(own(self._names))
        self._elsewhere = tuple(name for name in self._names if "." in name)
        self._of_plant = bool(self._names) and not self._own
        """Whether it needs no machine of its own: its sentences ask the plant alone."""
        self._unnamed = tuple(ALL & ~sum(1 << one.bit for one in permissives) for permissives in words)
        self._value_of = {
            (number, one.bit): one.value for number, permissives in enumerate(words) for one in permissives if one.value
        }
        self.forget()

    words: tuple[int, ...]
    """As they count now."""

    def forget(self) -> None:
        """As never taught, nothing decided yet."""
        self._taught = [ALL] * (self.steps + 1)
        self._decide_anew()
        self.words = self._unnamed

    def attach(self, machine: Machine | None) -> None:
        """Couple with `machine`; None = with none.

        Raises:
            ConfigurationError: see `fits`.
        """
        if machine is not None:
            self.fits(machine)
        self.machine = machine
        self._decide_anew()
        self.take()

    def fits(self, machine: Machine) -> None:
        """Whether `machine` has what the definition names.

        Raises:
            ConfigurationError: a sentence or a step names what the machine does not have.
        """
        known, can, name = set(machine.signals), set(machine.actions), self._definition.name
        for sentence in self._sentences:
            if strangers := sorted(set(own(sentence.names)) - known):
                raise ConfigurationError(
                    not_as(
                        said("mistake.names_strangers", name=name, text=sentence.text, strangers=", ".join(strangers)),
                        said("mistake.signals_of", machine=machine.type),
                        "but_expected",
                    )
                )
        for number in range(self.steps + 1):
            for one in self._definition.permissives(number):
                if not one.when or (one.value and "." not in one.value and one.value not in known):
                    if one.when:
                        found = said("mistake.has_value", name=name, key=one.key, value=one.value)
                    else:
                        found = said("mistake.has_no_sentence", name=name, key=one.key)
                    expected = said("mistake.signals_of", machine=machine.type)
                    raise ConfigurationError(not_as(found, expected, "but_expected"))
        for step in self._definition.steps:
            if strangers := sorted(set(step.actions) - can):
                raise ConfigurationError(
                    not_as(
                        said("mistake.step_asks", name=name, step=step.key, strangers=", ".join(strangers)),
                        said("mistake.of_machine_known", machine=machine.type, known=", ".join(machine.actions)),
                        "but_expected",
                    )
                )

    def teach(self, number: int, word: int) -> None:
        """Of a sequence without a machine: the word of a step, 0 = the abort conditions."""
        self._taught[number] = word

    def take(self) -> None:
        """Look at the machine, or at what was taught."""
        if self.machine is None and not self._of_plant:
            self.words = tuple(word | free for word, free in zip(self._taught, self._unnamed, strict=True))
        elif self._decide():
            self.words = self._decided = tuple(
                word | sum(1 << bit for bit, n in reads if self._holds[n])
                for word, reads in zip(self._unnamed, self._reads, strict=True)
            )
        else:
            self.words = self._decided

    def wish(self, key: str) -> bool | None:
        """Whether `start_when`, `suspend_when` or `advance_when` holds as of the last look; None = not known, or it has none."""
        return self._holds[self._wishes[key]] if key in self._wishes and self._holds else None

    def has_wish(self, key: str) -> bool:
        """Whether the definition has such a sentence."""
        return key in self._wishes

    @property
    def machine_manual(self) -> bool:
        """Whether the machine takes no actions: it is not in automatic."""
        return self.machine is not None and not self.machine.takes_actions

    def named(self, number: int, bit: int) -> bool:
        """Whether the definition names this permissive."""
        return not self._unnamed[number] >> bit & 1

    def missing(self, number: int, forced: int) -> int:
        """Lowest permissive of a step (0 = abort) that is missing now in spite of those `forced`, -1 = none."""
        word = ~(self.words[number] | forced) & ALL
        return (word & -word).bit_length() - 1

    def value(self, step: int, bit: int) -> float:
        """What is behind a permissive; NaN = nothing, or not known."""
        name = self._value_of.get((step, bit))
        return self._signal(name) if name else nan

    def _decide_anew(self) -> None:
        self._signals: dict[str, float] = {}
        self._holds: list[bool | None] = []
        self._decided = self._unnamed

    def _signal(self, name: str) -> float:
        if "." in name:
            given = self.recipe(name)
            return self.plant(name) if given is None else given
        return self.machine.signal(name) if self.machine else nan

    def _decide(self) -> bool:
        """Decide what has to be; whether any sentence is decided otherwise than before."""
        before = self._signals
        signal = self.machine.signal if self.machine else self._signal
        now = self._signals = {name: signal(name) for name in self._own}
        for name in self._elsewhere:
            now[name] = self._signal(name)
        if now == before and self._holds:
            return False
        other = {name for name, value in now.items() if value != before.get(name)}
        changed = False
        for n, sentence in enumerate(self._sentences):
            if n < len(self._holds) and other.isdisjoint(sentence.names):
                continue
            holds = sentence.true(lambda name: _reading(now, name))
            if n < len(self._holds):
                changed |= self._holds[n] is not holds
                self._holds[n] = holds
            else:
                changed = True
                self._holds.append(holds)
        return changed


def _reading(signals: Mapping[str, float], name: str) -> tuple[float | None, int]:
    return (signals[name], GOOD) if isfinite(signals[name]) else (None, NO_DATA)
