"""A sequence as its file says: steps, permissives, abort conditions and tests."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.blocks.sequence import Chart
from app.plant.expression import parse

WISHES = ("start_when", "suspend_when", "advance_when")
"""Sentences of the plant by which a sequence starts, stands still, goes on."""
Texts = Mapping[str, str]
"""Language → text."""
PREFIX = "recipe."
"""Before the key of a value of a run, where it stands for a number."""


@dataclass(frozen=True, slots=True)
class RecipeValue:
    """A value of a run: the operator gives it at Start, and it is fixed until the run is over."""

    key: str
    label: Texts
    low: float
    high: float
    default: float
    """Before the first run."""
    unit: str = ""
    decimals: int = 1


@dataclass(frozen=True, slots=True)
class SequencePermissive:
    """One bit of a permissive word, in positive wording; a bit that nobody names counts as fulfilled."""

    key: str
    bit: int
    """0–15"""
    label: Texts
    when: str
    """Sentence of the grammar over the points of the sequence's machine, and of any as `equipment.point`; empty = the device itself
    knows it (no machine)."""
    value: str = ""
    """Point of the machine, or `equipment.point`, whose value is kept with a first-out; empty = none."""
    forceable: bool = True
    """False for what is relevant to safety."""
    missing: Texts = field(default_factory=dict)
    """What is so while it is not met; empty: that the label does not hold."""


@dataclass(frozen=True, slots=True)
class SequenceOrder:
    """One declared action of a machine of the plant, given through the gate when its step is entered."""

    machine: str
    """Id of the equipment."""
    action: str
    """Of its type, device.toml `[actions.orders]`."""
    values: Mapping[str, float] = field(default_factory=dict)
    """By the names that the action declares [EU]; of a value of the run its default."""
    recipe: Mapping[str, str] = field(default_factory=dict)
    """Those that are values of the run: name → key."""

    def given(self, values: Mapping[str, float]) -> "SequenceOrder":
        """The order as it is in a run with these `values`."""
        if not self.recipe:
            return self
        now = {name: values[key] for name, key in self.recipe.items() if key in values}
        return replace(self, values={**self.values, **now})

    def __str__(self) -> str:
        said = {name: f"{value:g}" for name, value in self.values.items()}
        said |= {name: PREFIX + key for name, key in self.recipe.items()}
        values = ", ".join(f"{name} = {value}" for name, value in said.items())
        return f"{self.machine}.{self.action}" + (f"({values})" if values else "")


@dataclass(frozen=True, slots=True)
class SequenceStep:
    """One step of a sequence."""

    key: str
    label: Texts
    minimum: float = 0.0
    """[s]"""
    maximum: float = 0.0
    """[s]; 0 = stay."""
    loss_aborts: bool = False
    actions: Sequence[str] = ()
    """What it asks of the machine while its output is on."""
    permissives: Sequence[SequencePermissive] = ()
    """In order of their bits."""
    orders: Sequence[SequenceOrder] = ()
    """What it commands when it is entered; those of one machine one after the other, machines side by side. It is
    left when all are confirmed."""
    recipe: Mapping[str, str] = field(default_factory=dict)
    """Times that are values of the run: `minimum`, `maximum` → key; above stand their defaults."""


@dataclass(frozen=True, slots=True)
class SequenceTest:
    """A given/when/then of a sequence, run on the simulator by `pogon check`."""

    name: str
    given: Mapping[str, float] = field(default_factory=dict)
    """Preset of the simulated machine → value."""
    when: Sequence[Mapping[str, object]] = ()
    """In order of time: `at` [s] with one of `command` (perhaps with `arguments`), `fault`, `set` (a table of presets)."""
    then: Sequence[Mapping[str, object]] = ()
    """What must be seen: `within` or `at` [s] with `state`, `step` or `expect`; `first_out`, the key of a permissive, with or without a
    time; `never` with a sentence. Sentences are over the points of the machine, without a machine over those of the sequence."""


@dataclass(frozen=True, slots=True)
class SequenceDefinition:
    """A sequence as its file says: `<plant>/sequences/<name>.toml`."""

    name: str
    label: Texts
    steps: Sequence[SequenceStep]
    abort: Sequence[SequencePermissive] = ()
    """Abort conditions; true = healthy."""
    output_while_suspended: bool = False
    stall_after: float = 1.0
    """[s]"""
    keep_forces: bool = False
    longest_force: float = 28800.0
    """[s]"""
    chart: Chart = field(default_factory=Chart)
    """Branches, loops and safe steps."""
    tests: Sequence[SequenceTest] = ()
    recipe: Sequence[RecipeValue] = ()
    """What is given at Start."""
    start_when: str = ""
    """In automatic it starts when this becomes true; empty = whenever it can."""
    suspend_when: str = ""
    """It stands still while this is true or not known."""
    advance_when: str = ""
    """In single step it goes on when this becomes true."""

    @property
    def wishes(self) -> Mapping[str, str]:
        """The sentences of the plant that start, suspend and advance it, those that there are."""
        return {key: text for key in WISHES if (text := getattr(self, key))}

    @property
    def sentences(self) -> list[str]:
        """Every sentence of it, each once."""
        words = [self.abort, *(step.permissives for step in self.steps)]
        return list(dict.fromkeys([*(one.when for word in words for one in word if one.when), *self.wishes.values()]))

    @property
    def points(self) -> list[str]:
        """Points of any machine, `equipment.point`, that its sentences and values name."""
        values = [one.value for word in (self.abort, *(step.permissives for step in self.steps)) for one in word]
        names = [name for text in self.sentences for name in sorted(parse(text, machines=True).names)]
        found = (name for name in (*names, *values) if "." in name and not self.is_recipe(name))
        return list(dict.fromkeys(found))

    def is_recipe(self, name: str) -> bool:
        """Whether `name` stands for a value of the run."""
        return bool(self.recipe) and name.startswith(PREFIX)

    def permissives(self, step: int) -> Sequence[SequencePermissive]:
        """The named bits of step `step`, from 1; of the abort conditions for 0."""
        if not 0 <= step <= len(self.steps):
            return ()
        return self.steps[step - 1].permissives if step else self.abort

    def permissive(self, step: int, bit: int) -> SequencePermissive | None:
        """What bit `bit` of the word of step `step` (0 = abort conditions) is called; None when nobody names it."""
        return next((each for each in self.permissives(step) if each.bit == bit), None)
