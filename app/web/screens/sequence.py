"""What templates know of a sequence: its steps and permissives by name, what is missing, what fell first, and the sentence that says it.

The device says numbers (steps, bits); the definition in the plant's files says what they are called. Both come together here.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

from app.blocks.sequence import ABORT, ALL, BITS, Cause, SequenceState, StepState
from app.errors import Refused
from app.plant.definitions import Command
from app.plant.sequence_definition import SequenceDefinition, SequencePermissive
from app.tags.quality import is_unseen, reason
from app.web import format as fmt
from app.web.points import EquipmentView, PointView
from app.web.sequence_plant import SequencePlant
from app.web.sequence_ways import SequenceWays
from app.web.tables import RowName, RowView, TableView

MOST_NAMED = 3
"""So many missing permissives are named in one sentence; the others are counted."""
NO_BIT = 0xFFFF
NEARLY = 0.8
"""From this part of its greatest time on a step is said to be near it."""
ROOM = 1.12
"""A time bar ends so far beyond the longest time."""


ACTIVE_STATES = (StepState.ACTIVE, StepState.SUSPENDED, StepState.STALLED)


@dataclass(frozen=True, slots=True)
class BitView:
    """One permissive of a step."""

    step: int
    bit: int
    label: str
    """What is true while it is met."""
    lacking: str
    """What is true while it is not."""
    named: bool
    """False: the definition does not name it, and it counts as fulfilled."""
    met: bool | None
    """As it counts, forces included; None = not known."""
    forced: bool
    forceable: bool
    when: str
    """The sentence it is made of, in words."""
    first: bool = False
    fell: PointView | None = None
    back: PointView | None = None
    doubt: str = ""
    """The first point of another machine in its sentence that has no good value, by machine and name; empty = none."""
    force: RowView | None = None
    """Its row in the table of forces."""

    @property
    def since(self) -> PointView | None:
        """When it became what it is, as far as the device knows: missing since it fell, there since it came back."""
        if self.met is None or self.forced:
            return None
        return (self.back if number_of(self.back) else None) if self.met else self.fell


@dataclass(frozen=True, slots=True)
class StepView:
    """One step; number 0 stands for the abort conditions."""

    number: int
    label: str
    cells: Mapping[str, PointView]

    def __getitem__(self, column: str) -> PointView:
        return self.cells[column]

    def has(self, column: str) -> bool:
        """Whether the device tells it."""
        return column in self.cells

    def number_of(self, column: str) -> float | None:
        """Value of a cell; None when there is none to rely on."""
        return number_of(self.cells.get(column))

    @property
    def soon(self) -> float | None:
        """From here on the greatest time is near [s]; None = the step may stay."""
        maximum = self.number_of("maximum")
        return maximum * NEARLY if maximum else None


@dataclass(frozen=True, slots=True)
class FallView:
    """A permissive that fell, in the order in which they fell."""

    order: int
    bit: BitView
    fell: PointView
    back: PointView
    first: bool


@dataclass(frozen=True, slots=True)
class Headline:
    """Why it does not go on, in two lines. `before` and `after` stand around the seconds that run."""

    symbol: str
    before: str
    after: str
    elapsed: PointView | None
    detail: str
    kind: str
    """calm, wait or stop."""
    soon: float | None = None
    """While it runs: seconds from which on the greatest time is near."""
    unseen: bool = False
    """Whether it is what was last known, and nobody sees what is true now: `detail` says why."""


class SequenceView:
    """A machine that runs a sequence, for templates."""

    def __init__(self, equipment: EquipmentView, definition: SequenceDefinition) -> None:
        self.equipment = equipment
        self.definition = definition
        self.total = len(definition.steps)
        item = equipment.equipment
        self.machine: EquipmentView | None = equipment.other(item.machine) if item.machine else None
        """What its actions move; None = it has no machine."""
        self.plant = SequencePlant(equipment, definition)
        """What it has to do with other machines."""
        self.ways = SequenceWays(
            equipment, definition, lambda n: self.word(n) == ALL, ACTIVE_STATES, partial(_say, equipment)
        )
        """Which step follows which."""

    # ---- numbers --------------------------------------------------------------------------------------

    def value(self, key: str) -> float | None:
        """Value of a point; None when there is none to rely on, or no such point."""
        return number_of(self.equipment.point(key)) if self.equipment.has(key) else None

    def is_on(self, key: str) -> bool:
        """Whether a bit is set, as far as is known."""
        return bool(self.value(key))

    @cached_property
    def state(self) -> int | None:
        """SequenceState; None = not known."""
        found = self.value("state")
        return None if found is None else int(found)

    @cached_property
    def active(self) -> int:
        """Number of the active step; 0 = none."""
        step = int(self.value("step") or 0)
        return step if 0 < step <= self.total else 0

    @property
    def running(self) -> bool:
        """Whether a run is not over."""
        return self.state in (SequenceState.RUNNING, SequenceState.SUSPENDED)

    @property
    def awaited(self) -> int:
        """The step whose permissives decide now what happens next."""
        if self.running and self.active:
            return self.ways.next_of(self.active)
        if self.state == SequenceState.ABORTED and self.value("first_out_cause") in (
            Cause.ABORT_CONDITION,
            Cause.PERMISSIVE_LOST,
        ):
            return int(self.value("first_out_step") or 0)
        if self.state == SequenceState.TIMED_OUT:
            return int(self.value("first_out_step") or 0) or self.ways.next_of(int(self.value("first_out_at") or 0))
        return 1

    def names(self, *keys: str) -> str:
        """Tags of those points that there are, as `data-tags` takes them."""
        return " ".join(f"{self.equipment.id}.{key}" for key in keys if self.equipment.has(key))

    def step_names(self, *columns: str) -> str:
        """Tags of columns of all steps."""
        return self.names(*(f"step_{n}_{column}" for n in range(1, self.total + 1) for column in columns))

    # ---- steps and permissives ------------------------------------------------------------------------

    @cached_property
    def steps(self) -> list[StepView]:
        """All steps in order."""
        return [self.step(number) for number in range(1, self.total + 1)]

    def step(self, number: int) -> StepView:
        """Step `number`, from 1; one that the definition does not have is called by its number."""
        known = 0 < number <= len(self.definition.steps)
        label = self.equipment.words(self.definition.steps[number - 1].label) if known else f"#{number}"
        prefix = f"step_{number}_"
        points = self.equipment.equipment.points
        columns = self.equipment.equipment.type.tables["step"].columns
        cells = {key: self.equipment.point(prefix + key) for key in columns if prefix + key in points}
        return StepView(number, label, cells)

    def title(self, number: int) -> str:
        """What step `number` is called; 0 = the abort conditions."""
        return self.step(number).label if number else self.equipment.text("sequence.screen.abort")

    def word(self, step: int, column: str = "word") -> int | None:
        """A word of permissives: `word` as it counts, `input`, `forced`, `forceable`; None = not known."""
        found = self.value(f"step_{step}_{column}" if step else f"abort_{column}")
        return None if found is None else int(found)

    def label(self, step: int, bit: int) -> str:
        """What a permissive is called."""
        named = self.definition.permissive(step, bit)
        return self.equipment.words(named.label) if named else self.equipment.text("sequence.screen.bit", n=bit)

    def lacking(self, step: int, bit: int) -> str:
        """What is so when a permissive is not met: its own words for that, else that what it is called does not hold."""
        named = self.definition.permissive(step, bit)
        own = self.equipment.words(named.missing) if named and named.missing else ""
        return own or self.equipment.text("sequence.screen.lacks", what=self.label(step, bit))

    @cached_property
    def first(self) -> tuple[int, int] | None:
        """(step, bit) of the permissive that fell first; None = nothing is latched, or no permissive was the cause."""
        cause, bit = self.value("first_out_cause"), self.value("first_out_bit")
        if not cause or bit is None or int(bit) >= BITS:
            return None
        return int(self.value("first_out_step") or 0), int(bit)

    @cached_property
    def forces(self) -> list[RowView]:
        """Permissives that are forced."""
        return TableView(self.equipment, "force").rows if "force" in self.equipment.equipment.tables else []

    def bit(self, step: int, bit: int) -> BitView:
        """One permissive as it stands."""
        named: SequencePermissive | None = self.definition.permissive(step, bit)
        word, forced = self.word(step), self.word(step, "forced") or 0
        may = self.word(step, "forceable")
        fall = next((row for row in self._falls if _is(row, step, bit)), None)
        return BitView(
            step=step,
            bit=bit,
            label=self.label(step, bit),
            lacking=self.lacking(step, bit),
            named=named is not None,
            met=None if word is None else bool(word >> bit & 1),
            forced=bool(forced >> bit & 1),
            forceable=(named.forceable if named else False) and (may is None or bool(may >> bit & 1)),
            when=self.plant.told(named.when) if named else "",
            doubt=self.plant.doubt(named.when) if named and not (word or 0) >> bit & 1 else "",
            first=self.first == (step, bit),
            fell=fall["fell"] if fall else None,
            back=fall["back"] if fall else None,
            force=next((row for row in self.forces if _is(row, step, bit)), None),
        )

    def bits(self, step: int) -> list[BitView]:
        """All 16, missing ones first, then forced ones, the others in their order."""
        found = [self.bit(step, bit) for bit in range(BITS)]
        return sorted(found, key=lambda one: (one.met is True, not one.forced if one.met else not one.first, one.bit))

    def missing(self, step: int) -> list[BitView]:
        """What is not fulfilled as it counts."""
        return [one for one in self.bits(step) if one.met is False]

    def count(self, step: int) -> int | None:
        """How many of the 16 are fulfilled."""
        word = self.word(step)
        return None if word is None else (word & ALL).bit_count()

    @cached_property
    def _falls(self) -> list[RowView]:
        table = self.equipment.equipment.tables
        return TableView(self.equipment, "fall").by("id") if "fall" in table else []

    @cached_property
    def falls(self) -> list[FallView]:
        """What fell, the earliest first."""
        return [
            FallView(
                order,
                self.bit(int(row.number("step") or 0), int(row.number("bit") or 0)),
                row["fell"],
                row["back"],
                self.first == (int(row.number("step") or 0), int(row.number("bit") or 0)),
            )
            for order, row in enumerate(self._falls, 1)
            if (row.number("bit") or 0) < BITS
        ]

    @property
    def first_value(self) -> str:
        """What the value that belongs to the first-out was; empty when it has none."""
        if self.first is None or self.machine is None:
            return ""
        named = self.definition.permissive(*self.first)
        value = self.value("first_out_value")
        if named is None or not named.value or not self.machine.has(named.value) or value is None:
            return ""
        point = self.machine.point(named.value)
        written = fmt.quantity(value, point.decimals, point.unit, self.equipment.lang)
        return f"{point.label} {written}"

    # ---- times ----------------------------------------------------------------------------------------

    @cached_property
    def longest(self) -> float:
        """End of the time bars [s]: the longest maximum, or the longest minimum where steps stay."""
        times = [step.number_of(column) or 0.0 for step in self.steps for column in ("minimum", "maximum", "most")]
        return max([*times, 1.0]) * ROOM

    def seconds(self, value: float | None, *, unit: bool = True) -> str:
        """A time of a step: `12,4 s`, `3 min 05 s`; below 100 s also without the unit."""
        if value is None:
            return "–"
        lang = self.equipment.lang
        return fmt.quantity(value, 1, "s" if unit else "", lang) if value < 100 else fmt.duration(value, lang)

    # ---- the headline ---------------------------------------------------------------------------------

    @cached_property
    def headline(self) -> Headline:
        """State, step, seconds waited of those allowed, and what is missing; or why nobody knows."""
        quality = self.equipment.point("state").quality
        if not is_unseen(quality):
            return self._seen
        why = self.equipment.text(f"quality.reason.{reason(quality).name.lower()}")
        detail = why[:1].upper() + why[1:]
        return replace(self._seen, symbol="i-link-off", detail=detail, kind="stop", soon=None, unseen=True)

    @property
    def _seen(self) -> Headline:
        """What is told of the state as it is known."""
        text, state = self.equipment.text, self.state
        if state is None:
            return Headline(
                "i-link-off", text("live.no_communication"), "", None, text("sequence.screen.head.unknown"), "stop"
            )
        if state == SequenceState.IDLE or (state == SequenceState.DONE and not self.is_on("needs_acknowledge")):
            done = state == SequenceState.DONE
            ready = self.is_on("start_possible")
            key = "done" if done else "ready" if ready else "idle"
            time = self.value("last_run_time") if self.value("runs_done") else None
            line = text(f"sequence.screen.head.{key}", time=self.seconds(time))
            return Headline("i-check" if done or ready else "i-pause", line, "", None, self._to_start(), "calm")
        if state == SequenceState.ABORTED:
            return Headline("i-cross", _aborted(self), "", None, _then(self), "stop")
        step = self.active or int(self.value("first_out_at") or 0)
        cells = self.step(step) if 0 < step <= self.total else None
        elapsed = cells["elapsed"] if cells and cells.has("elapsed") else None
        maximum = cells.number_of("maximum") if cells else None
        allowed = self.seconds(maximum) if maximum else text("sequence.screen.unlimited")
        stalled = self.is_on("stalled")
        kind = {SequenceState.TIMED_OUT: "timed_out", SequenceState.SUSPENDED: "suspended"}.get(
            SequenceState(state) if state in tuple(SequenceState) else SequenceState.IDLE,
            "stalled" if stalled else "running",
        )
        line = text(
            f"sequence.screen.head.{kind}",
            step=step,
            total=self.total,
            label=cells.label if cells else "",
            allowed=allowed,
            elapsed="\0",
        )
        before, _, after = line.partition("\0")
        symbol = {"timed_out": "i-clock", "suspended": "i-pause", "stalled": "i-clock"}.get(kind, "i-right")
        detail = _then(self) if kind == "timed_out" else self._waits(step, maximum)
        look = {"running": "calm", "suspended": "wait"}.get(kind, "stop")
        soon = cells.soon if cells and state == SequenceState.RUNNING else None
        return Headline(symbol, before, after, elapsed, detail, look, soon)

    def named(self, bits: Sequence[BitView], *, lacking: bool = False, most: int = MOST_NAMED) -> str:
        """Some permissives in one line: A · B · C and 2 more; `lacking`: in the words for what is so while each is not met."""
        shown = " · ".join(one.lacking if lacking else one.label for one in bits[:most])
        more = len(bits) - most
        return self.equipment.text("sequence.screen.and_more", names=shown, n=more) if more > 0 else shown

    def _to_start(self) -> str:
        """What is missing to start, or that nothing is."""
        text = self.equipment.text
        if self.is_on("machine_manual"):
            return text("sequence.screen.head.manual")
        if abort := self.missing(ABORT):
            return text("sequence.screen.head.abort_missing", names=self.named(abort, lacking=True))
        if missing := self.missing(1):
            return text("sequence.screen.head.missing", step=1, names=self.named(missing, lacking=True))
        return text("sequence.screen.head.automatic" if self.is_on("automatic") else "sequence.screen.head.can_start")

    def _waits(self, step: int, maximum: float | None) -> str:
        """What a running step waits for."""
        text = self.equipment.text
        if self.state == SequenceState.SUSPENDED:
            if (held := self.plant.held) is not False:
                key = "held" if held else "held_unknown"
                return text(f"sequence.screen.head.{key}", when=self.plant.told(self.definition.suspend_when))
            missing = self.missing(step)
            return text("sequence.screen.head.missing", step=step, names=self.named(missing, lacking=True)) if missing else text(
                "sequence.screen.head.resume"
            )  # fmt: skip
        also = self.ways.beside(step)
        safe = f" · {text('sequence.screen.way_safe_runs')}" if self.is_on("aborting") else ""
        return self._wait(step, maximum) + also + safe

    def _wait(self, step: int, maximum: float | None) -> str:
        """What one step waits for."""
        text = self.equipment.text
        if 0 < step <= self.total and self.definition.steps[step - 1].orders and self.plant.pending:
            return text("sequence.screen.head.pending")
        if maximum == 0:
            return text("sequence.screen.head.stays")
        following = self.ways.next_of(step)
        if self.ways.following(step) != ((),) and (missing := self.missing(following)):
            return text("sequence.screen.head.missing", step=following, names=self.named(missing, lacking=True))
        return (
            text("sequence.screen.head.single") if self.is_on("single_step") else text("sequence.screen.head.goes_on")
        )


TOGETHER = ("step", "bit")
"""Arguments that name a permissive."""
STATES = StepState
"""For templates that compare."""


def _say(equipment: EquipmentView, key: str, **params: object) -> str:
    return equipment.text(f"sequence.screen.{key}", **params)


def _then(sequence: SequenceView) -> str:
    """What stopped it first, and what to do."""
    text = sequence.equipment.text
    parts = []
    if sequence.value("first_out_cause") == Cause.COMMAND and (why := sequence.plant.failure):
        parts.append(why)
    if sequence.first is not None:
        name, value = sequence.lacking(*sequence.first), sequence.first_value
        one = (
            text("sequence.screen.head.first", name=name, value=value)
            if value
            else text("sequence.screen.head.only", name=name)
        )
        parts.append(one)
    if sequence.is_on("needs_acknowledge"):
        parts.append(text("sequence.screen.head.acknowledge"))
    return " · ".join(parts)


def _aborted(sequence: SequenceView) -> str:
    """That it was aborted, where, and why."""
    cause = int(sequence.value("first_out_cause") or 0)
    step = int(sequence.value("first_out_at") or 0)
    name = sequence.lacking(*sequence.first) if sequence.first is not None else ""
    key = {
        Cause.ABORT_CONDITION: "by_condition",
        Cause.PERMISSIVE_LOST: "by_loss",
        Cause.OPERATOR: "by_operator",
        Cause.POWER_UP: "by_power",
        Cause.COMMAND: "by_command",
    }.get(Cause(cause) if cause in tuple(Cause) else Cause.NONE, "")
    line = sequence.equipment.text("sequence.screen.head.aborted", step=step)
    name = (
        sequence.plant.failed_order(
            int(sequence.value("first_out_at") or 0), int(sequence.value("first_out_value") or 0)
        )
        if cause == Cause.COMMAND
        else name
    )
    if key:
        line += f": {sequence.equipment.text(f'sequence.screen.head.{key}', name=name)}"
    return line


def check_asked(machine: EquipmentView, command: Command, given: Mapping[str, str]) -> None:
    """Whether there is what `command` is asked for: the permissive that `step` and `bit` of `given` name, or the step.

    Raises:
        Refused: 422 one of them is missing or no whole number; 404 there is none of that number, or the definition does not name it;
            409 it may not be forced, or is not forced.
    """
    sequence = sequence_of(machine)
    if sequence is None:
        return
    numbers: dict[str, int] = {}
    for argument in command.arguments:
        if argument.name not in TOGETHER:
            continue
        text, named = given.get(argument.name, ""), {"argument": argument.name, "label": argument.label}
        if not text:
            raise Refused("why.argument_missing", 422, **named)
        if not re.fullmatch("[0-9]{1,9}", text):
            raise Refused("why.not_a_number", 422, **named, text=text[:20])
        numbers[argument.name] = int(text)
    step, bit = numbers.get("step"), numbers.get("bit")
    if step is not None and not (0 if bit is not None else 1) <= step <= sequence.total:
        raise Refused("reason.no_such_step", 404)
    if step is None or bit is None:
        return
    if bit >= BITS:
        raise Refused("reason.no_such_bit", 404)
    one = sequence.bit(step, bit)
    if command.key == "force" and not one.named:
        raise Refused("reason.no_such_bit", 404)
    if command.key == "force" and not one.forceable:
        raise Refused("reason.not_forceable", 409)
    if command.key == "release" and not one.forced and one.force is None:
        raise Refused("reason.not_forced", 409)


def in_words(machine: EquipmentView, arguments: Mapping[str, float]) -> str:
    """The permissive that `step` and `bit` mean, by its name; empty when they mean none."""
    definition = machine.equipment.sequence
    if definition is None or not {*TOGETHER} <= arguments.keys():
        return ""
    step, bit = int(arguments["step"]), int(arguments["bit"])
    named, text = definition.permissive(step, bit), machine.text
    label = machine.words(named.label) if named else text("sequence.screen.bit", n=bit)
    return f"{text('sequence.screen.in_step', n=step) if step else text('sequence.screen.abort')} · {label}"


def row_name(machine: EquipmentView, table: str, row: RowView) -> RowName:
    """The permissive that a row of forces or falls is about."""
    sequence = sequence_of(machine)
    step, bit = int(row.number("step") or 0), int(row.number("bit") or 0)
    if sequence is None:
        return RowName(f"#{row.id}", "", row.id)
    text = machine.text
    place = text("sequence.screen.bit_of", bit=bit, step=step) if step else text("sequence.screen.abort")
    return RowName(sequence.label(step, bit), f"{place} · {sequence.title(step)}", step * BITS + bit)


def sequence_of(equipment: EquipmentView) -> SequenceView | None:
    """The sequence that a machine runs; None when it runs none."""
    definition = equipment.equipment.sequence
    return SequenceView(equipment, definition) if definition else None


def sequences_for(equipment: EquipmentView) -> list[EquipmentView]:
    """The sequences that move a machine."""
    plant = equipment.runtime.plant
    items = plant.equipment.values() if plant else ()
    found = [equipment.other(item.id) for item in items if item.sequence and item.machine == equipment.id]
    return [one for one in found if one]


NAMES = {"sequence_of": sequence_of, "sequences_for": sequences_for}
"""For templates."""


def number_of(point: PointView | None) -> float | None:
    """Value of a point; None when there is none to rely on."""
    if point is None or not point.usable or not isinstance(point.value, int | float):
        return None
    return float(point.value)


def _is(row: RowView, step: int, bit: int) -> bool:
    return row.number("step") == step and row.number("bit") == bit
