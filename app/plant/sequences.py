"""Definitions of sequences: `<plant>/sequences/<name>.toml`, one file each; several machines may share one.

    [sequence]
    label = { hr = "Prijevoz koluta", en = "Coil transport", de = "Bundtransport", cs = "Přeprava svitku" }
    output_while_suspended = false
    stall_after = 1.0                                   seconds
    keep_forces = false
    longest_force = 28800                               seconds
    start_when = "c1.automatic == 1"                    in automatic: starts when it becomes true; sentences of the whole plant
    suspend_when = "m1.fault != 0"                      stands still while it is true, or not known
    advance_when = "c1.button == 1"                     in single step: goes on when it becomes true
    abort_to = "rest"                                   its safe steps begin there; [[branches]], [[loops]]: sequence_chart.py;
                                                        values of a run, [[recipe]]: sequence_recipe.py

    [[steps]]                                           in order
    key = "lower"
    label = { … }
    minimum = 1.0                                       seconds
    maximum = 30.0                                      seconds; 0 = stay
    loss_aborts = true
    actions = ["lower"]                                 of the machine's type, device.toml [actions]
    [[steps.orders]]                                    commands of any machine through the gate, when the step is entered
    machine = "m1"
    action = "run_forward"                              of its type, device.toml [actions.orders]
    values = { frequency = 30 }
    [steps.permissives.3]                               bit 0–15; a bit that nobody names counts as fulfilled
    key = "pressure_ok"                                 else bit_3
    label = { … }                                       in positive wording
    missing = { … }                                     what is so while it is not met; else "missing: " and the label
    when = "pressure > 80"                              over the points of the machine, and of any as m1.speed
    value = "pressure"                                  kept with a first-out
    forceable = true
    [abort.0]                                           the same; not forceable unless it says so

    [[tests]]
    name = "one coil from the mandrel to saddle 2"
    given = { winding = 1 }                             presets of the simulated machine
    when = [{ at = 0, command = "start" }, { at = 9, fault = 3 }, { at = 15, set = { pressure = 20 } },
            { at = 16, command = "force", arguments = { step = 2, bit = 3, duration = 60 } }]
    then = [{ within = 120, state = "done" }, { step = "lift", within = 30 }, { never = "collision == 1" },
            { first_out = "pressure_ok" }, { at = 20, expect = "horizontal > 100" }]

Without a machine the device itself knows its permissives (a virtual one takes them from its training registers), the presets are the words,
`word_0` (abort conditions) to `word_<steps>`. Nobody here evaluates `when`, `value` and `actions` then: of a real PLC they say what its own
program does, and are part of its check sum; on a simulated link they are a mistake.
"""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType
from typing import Any
from zlib import crc32

from app.blocks.sequence import ALL, BITS, SequenceState
from app.errors import ConfigurationError
from app.plant import expression
from app.plant.definitions import Equipment, Kind, Link, Plant, Point, Texts, Type
from app.plant.problems import Problem
from app.plant.said import Plain, said
from app.plant.sequence_chart import chart_lines, read_chart
from app.plant.sequence_definition import (
    PREFIX,
    RecipeValue,
    SequenceDefinition,
    SequenceOrder,
    SequencePermissive,
    SequenceStep,
    SequenceTest,
)
from app.plant.sequence_plant import check_order, check_points, others, own
from app.plant.sequence_recipe import check_names, check_time, named, read_recipe, refers
from app.plant.tables import MISSING, Source, Table, meant_as_toml, one_of, perhaps, span
from app.plant.type_files.names import KEY, KEY_EXPECTED
from app.plant.type_files.options import MOST_STEPS, STEPS

FOLDER = "sequences"
"""Of a plant folder."""
NAME = r"[a-z][a-z0-9_]{0,31}"
LONGEST_TIME = 36_000.0
"""Of a step, as the device takes it [s]."""
LONGEST_TEST = 3_600.0
"""Simulated time of a test [s]."""
RUNNING = (SequenceState.RUNNING.value, SequenceState.SUSPENDED.value)
"""Values of the status point of a sequence that runs."""
STATES = tuple(state.name.lower() for state in SequenceState)
ABORT = "abort"
POINT = rf"({NAME}\.)?{KEY}"
"""A point of the machine, or of any."""
NO_TESTS = said("mistake.no_tests")
ORDERS = ("command", "fault", "set")
"""What a row of `when` may do."""
SIGHTS = ("state", "step", "expect", "first_out", "never")
"""What a row of `then` may ask for."""

ReadLabel = Callable[[Table, str], Texts]
"""(table, key) → the label in every language that it has; notes what is wrong."""


@dataclass(slots=True)
class _File:
    """A definition with what only a machine can judge."""

    source: Source
    definition: SequenceDefinition
    recipe: tuple[RecipeValue, ...] = ()
    signals: list[tuple[Table, str, str]] = field(default_factory=list)
    """Sentences of permissives; an empty one needs a device that knows its signals itself."""
    values: list[tuple[Table, str, str]] = field(default_factory=list)
    """Points whose value is kept."""
    actions: list[tuple[Table, str, str]] = field(default_factory=list)
    commands: list[tuple[Table, str, Mapping[str, float]]] = field(default_factory=list)
    """Rows of tests with a command, and its arguments."""
    presets: list[tuple[Table, str, object]] = field(default_factory=list)
    orders: list[tuple[Table, SequenceOrder]] = field(default_factory=list)
    wishes: list[tuple[Table, str, str]] = field(default_factory=list)
    """Sentences by which the plant starts, suspends, advances it."""
    sentences: list[tuple[Table, str, str]] = field(default_factory=list)
    """What tests look at."""


class SequenceFiles:
    """The definition files of one plant folder; each is read once, with all its mistakes."""

    def __init__(self, folder: Path, label: ReadLabel, drafts: Mapping[str, str] = MappingProxyType({})) -> None:
        """`drafts`: name → the text that is read in place of its file."""
        self.folder = folder / FOLDER
        self._drafts = drafts
        self._label = label
        self._files: dict[str, _File] = {}
        self._checked: set[object] = set()

    @property
    def problems(self) -> list[Problem]:
        """Everything found so far."""
        return [problem for file in self._files.values() for problem in file.source.problems]

    def names(self) -> list[str]:
        """Definitions that the folder has."""
        if not self.folder.resolve().is_relative_to(self.folder.parent.resolve()):
            return []  # a link to a folder that is none of our business
        return sorted(path.stem for path in self.folder.glob("*.toml") if re.fullmatch(NAME, path.stem))

    def read(self, name: str) -> SequenceDefinition | None:
        """The definition `name`, as far as it can be read when its file has mistakes, which `problems` has then; None when it has no step.

        The file must be there (`names`).
        """
        if name not in self._files:
            self._files[name] = self._read(name)
        definition = self._files[name].definition
        return definition if definition.steps else None

    def unread_without_machine(self, item: Equipment) -> list[str]:
        """Keys of the definition of `item` that have a meaning with a machine only: sentences, values, actions."""
        file = self._files[item.sequence.name] if item.sequence else None
        if file is None:
            return []
        asked = [
            *((table, key) for table, key, text in (*file.signals, *file.wishes) if text and own(_names(text))),
            *((table, key) for table, key, text in (*file.values, *file.actions) if text and "." not in text),
        ]
        return [".".join((*table.path, key)) for table, key in asked]

    def check(self, item: Equipment, machine: Equipment | None, *, forgotten: bool = False) -> None:
        """Note what the definition of `item` asks for that its machine, or its own type, does not have.

        `forgotten`: the machine was meant and not named, which is told already; nothing is held against its lack.
        """
        file = self._files[item.sequence.name] if item.sequence else None
        kinds = (item.type.name, machine and (machine.type.name, *machine.tables.items()), forgotten)
        if file is None or (item.sequence and (item.sequence.name, kinds) in self._checked):
            return
        self._checked.add((file.definition.name, kinds))
        if machine is not None:
            self._check_machine(file, machine)
        for table, key, arguments in file.commands:
            _check_command(table, key, arguments, item)
        if forgotten:
            return
        ranges = machine.type.simulation_presets if machine else _words(file.definition)
        owner = machine.type.name if machine else said("mistake.without_machine")
        for table, key, given in file.presets:
            name = key.rpartition(".")[2]
            if name not in ranges:
                table.note(key, given, said("mistake.preset_of", owner=owner, known=one_of(sorted(ranges), name)))
            elif isinstance(given, int | float) and not ranges[name][0] <= given <= ranges[name][1]:
                low, high = ranges[name]
                table.note(key, given, span("number", low, high))
        looked = machine or item
        signals = {key: point for key, point in looked.points.items() if _is_signal(point)}
        for table, key, text in file.sentences:
            _check_signals(table, key, text, signals, looked)

    def check_plant(
        self, item: Equipment, found: Mapping[str, Equipment], links: Mapping[str, Link], broken: Collection[str]
    ) -> None:
        """Note what the definition of `item` asks of other machines that the plant does not have, or that may not be.

        `broken`: machines whose own mistakes are told; nothing is known of them.
        """
        file = self._files[item.sequence.name] if item.sequence else None
        kinds = (item.id, "plant")
        if file is None or kinds in self._checked:
            return
        self._checked.add(kinds)
        for table, key, text in (*file.signals, *file.wishes):
            asked = others(_names(text), broken)
            values = [name for name in asked if file.definition.is_recipe(name)]
            check_names(table, key, text, values, file.recipe)
            check_points(table, key, text, [name for name in asked if name not in values], found)
        for table, key, name in file.values:
            check_points(table, key, name, others([name], broken), found)
        for table, order in file.orders:
            if order.machine not in broken:
                check_order(table, order, item, found, links, file.recipe)
        if file.orders and file.definition.tests:
            table = file.orders[0][0]
            table.source.note(("tests",), said("mistake.tests", number=len(file.definition.tests)), NO_TESTS)

    def _check_machine(self, file: _File, machine: Equipment) -> None:
        known = {key: point for key, point in machine.points.items() if _is_signal(point)}
        for table, key, text in file.signals:
            if not text:
                table.note(key, MISSING, said("mistake.sentence_over", machine=machine.id))
            else:
                _check_signals(table, key, text, known, machine)
        for table, key, text in file.wishes:
            _check_signals(table, key, text, known, machine)
        for table, key, name in file.values:
            if "." not in name and name not in known:
                table.note(key, name, said("mistake.own_point", machine=machine.id, near=_near(name, known)))
        for table, key, action in file.actions:
            if machine.type.actions and action not in machine.type.actions:
                expected = one_of(list(machine.type.actions), action)
                table.note(key, action, said("mistake.action_of", type=machine.type.name, known=expected))

    # ---- one file -------------------------------------------------------------------------------------

    def _read(self, name: str) -> _File:
        source = Source(
            self.folder / f"{name}.toml",
            f"{FOLDER}/{name}.toml",
            inside=self.folder.parent,
            draft=self._drafts.get(name),
        )
        file = _File(source, SequenceDefinition(name, {}, ()))
        if source.problems:
            return file
        root = source.table()
        head = root.table("sequence", required=True, expected=said("mistake.with_label", table="[sequence]"))
        if not root.has("sequence"):
            head = Table(source, ("sequence",), {"label": name})
        file.recipe = read_recipe(root, self._label)
        rows = list(root.rows("steps"))
        if not root.has("steps") or root.data["steps"] == []:
            root.note("steps", MISSING, said("mistake.at_least_one", what="[[steps]]"))
        elif len(rows) > MOST_STEPS:
            root.note("steps", said("mistake.steps", number=len(rows)), said("mistake.most_steps", most=MOST_STEPS))
        steps: list[SequenceStep] = []
        for row in rows[:MOST_STEPS]:
            steps.append(self._step(file, row, [step.key for step in steps]))
        definition = SequenceDefinition(
            name,
            label=self._label(head, "label"),
            steps=tuple(steps),
            abort=tuple(self._permissives(file, root, ABORT, forceable=False)),
            output_while_suspended=head.flag("output_while_suspended"),
            stall_after=float(head.number("stall_after", 1.0, 0.1, 600)),
            keep_forces=head.flag("keep_forces"),
            longest_force=float(head.number("longest_force", 28_800.0, 1, 7 * 86_400)),
            start_when=_wish(file, head, "start_when"),
            suspend_when=_wish(file, head, "suspend_when"),
            advance_when=_wish(file, head, "advance_when"),
            chart=read_chart(root, head, steps, file.recipe),
            recipe=file.recipe,
        )
        head.done()
        tests: list[SequenceTest] = []
        for row in root.rows("tests"):
            tests.append(self._test(file, row, definition, [test.name for test in tests]))
        root.done()
        file.definition = replace(definition, tests=tuple(tests))
        return file

    def _step(self, file: _File, row: Table, others: Sequence[str]) -> SequenceStep:
        key = row.text("key", pattern=NAME, expected=KEY_EXPECTED)
        if key in (*others, ABORT):
            row.note("key", key, said("mistake.step_key", taken=ABORT))
        times, of_recipe = _times(file, row)
        actions: list[str] = []
        for index, action in enumerate(row.items("actions", [], said("mistake.list_of_actions"))):
            if not isinstance(action, str) or not re.fullmatch(KEY, action):
                row.note(f"actions.{index}", action, said("mistake.action"))
            elif action in actions:
                row.note(f"actions.{index}", action, said("mistake.action_once"))
            else:
                actions.append(action)
                file.actions.append((row, f"actions.{index}", action))
        step = SequenceStep(
            key,
            self._label(row, "label"),
            *times,
            row.flag("loss_aborts"),
            tuple(actions),
            tuple(self._permissives(file, row, "permissives", forceable=True)),
            tuple(_order(file, each) for each in row.rows("orders")),
            of_recipe,
        )
        row.done()
        return step

    def _permissives(self, file: _File, parent: Table, name: str, *, forceable: bool) -> list[SequencePermissive]:
        """A word of permissives, in order of its bits."""
        found: dict[int, SequencePermissive] = {}
        keys: set[str] = set()
        for number, table in parent.tables(name, said("mistake.bit_table", table=f"[{name}.<bit>]")):
            bit = int(number) if re.fullmatch(r"[0-9]{1,4}", number) else -1
            if not 0 <= bit < BITS:
                table.note("", number, said("mistake.bit", most=BITS - 1))
            elif bit in found:
                table.note("", number, said("mistake.bit_once", bit=bit))
            key = table.text("key", f"bit_{max(bit, 0)}", pattern=NAME, expected=KEY_EXPECTED)
            if key in keys:
                table.note("key" if table.has("key") else "", key, said("mistake.bit_key"))
            keys.add(key)
            when, value = table.text("when", ""), table.text("value", "", pattern=POINT, expected=said("mistake.point"))
            permissive = SequencePermissive(
                key, bit, self._label(table, "label"), when, value, table.flag("forceable", forceable),
                self._label(table, "missing") if table.has("missing") else {},
            )  # fmt: skip
            if _is_sentence(table, "when", when) if when else not table.has("when"):
                file.signals.append((table, "when", when))
            if value:
                file.values.append((table, "value", value))
            table.done()
            found.setdefault(bit, permissive)
        return [found[bit] for bit in sorted(found)]

    # ---- its tests ------------------------------------------------------------------------------------

    def _test(self, file: _File, row: Table, definition: SequenceDefinition, others: Sequence[str]) -> SequenceTest:
        name = row.text("name")
        if name in others:
            row.note("name", name, said("mistake.test_name"))
        given = self._presets(file, row, "given")
        when = [self._order(file, each) for each in row.rows("when")]
        then = [self._sight(file, each, definition) for each in row.rows("then")]
        if not row.data.get("then"):
            row.note("then", MISSING, said("mistake.test_rows"))
        row.done()
        when.sort(key=lambda order: float(order["at"]))
        return SequenceTest(name, given, tuple(when), tuple(then))

    def _presets(self, file: _File, row: Table, key: str) -> dict[str, float]:
        table = row.table(key)
        given: dict[str, float] = {}
        for name in table.data:
            number = table.number(name)
            if number is table.data[name]:
                given[name] = float(number)
                file.presets.append((table, name, number))
        return given

    def _order(self, file: _File, row: Table) -> dict[str, Any]:
        """A row of `when`: a time and what happens then."""
        order: dict[str, Any] = {"at": float(row.number("at", low=0, high=LONGEST_TEST))}
        _one(row, ORDERS)
        if row.has("command"):
            order["command"] = row.text("command")
            arguments = {name: float(row.table("arguments").number(name)) for name in row.table("arguments").data}
            if row.has("arguments"):
                order["arguments"] = arguments
            if order["command"]:
                file.commands.append((row, order["command"], arguments))
        if row.has("fault"):
            order["fault"] = row.whole("fault")
        if row.has("set"):
            order["set"] = self._presets(file, row, "set")
            if row.data["set"] == {}:
                row.note("set", said("mistake.empty"), said("mistake.presets", example="{ pressure = 20 }"))
        row.done()
        return order

    def _sight(self, file: _File, row: Table, definition: SequenceDefinition) -> dict[str, Any]:
        """A row of `then`: what must be seen, and when."""
        sight: dict[str, Any] = {}
        _one(row, SIGHTS)
        times = [key for key in ("within", "at") if row.has(key)]
        if row.has("never"):
            for key in times:
                row.note(key, row.data[key], said("mistake.no_time"))
        elif len(times) == 2 or (not times and not row.has("first_out") and any(key in row.data for key in SIGHTS)):
            row.note("at" if times else "within", row.data.get("at", MISSING), said("mistake.within_or_at"))
        for key in times:
            sight[key] = float(row.number(key, low=0, high=LONGEST_TEST))
        if row.has("state"):
            sight["state"] = row.text("state", choices=STATES)
        if row.has("step"):
            sight["step"] = row.text("step", choices=[step.key for step in definition.steps])
        if row.has("first_out"):
            words = (definition.abort, *(step.permissives for step in definition.steps))
            keys = dict.fromkeys(each.key for word in words for each in word)
            sight["first_out"] = row.text("first_out", choices=list(keys))
        for key in ("expect", "never"):
            if row.has(key):
                sight[key] = row.text(key)
                if sight[key] and _is_sentence(row, key, sight[key]):
                    file.sentences.append((row, key, sight[key]))
        for key in ("within", "at"):
            row.raw(key)
        row.done()
        return sight


def unused(plant: Plant) -> list[str]:
    """Definition files that no equipment of `plant` uses, relative to its folder; hidden ones (of an editor) are none."""
    used = {f"{item.sequence.name}.toml" for item in plant.equipment.values() if item.sequence}
    found = meant_as_toml(plant.folder / FOLDER)
    return [f"{FOLDER}/{path.name}" for path in found if path.name not in used and not path.name.startswith(".")]


def canonical(definition: SequenceDefinition) -> str:
    """What makes the program of a device: steps, actions, conditions. One line each; times and labels are no part of it."""

    def lines() -> Iterator[str]:
        for number in range(len(definition.steps) + 1):
            if number:
                step = definition.steps[number - 1]
                yield f"step {number} {step.key} loss_aborts={int(step.loss_aborts)} actions={','.join(step.actions)}"
                yield from (f"  {name} = {PREFIX}{key}" for name, key in step.recipe.items())
                yield from (f"  order {order}" for order in step.orders)
            else:
                yield ABORT
            for each in definition.permissives(number):
                yield f"  {each.bit} {each.key} forceable={int(each.forceable)} value={each.value} when={each.when}"

        yield from (f"recipe {one.key} {one.low:g} {one.high:g}" for one in definition.recipe)
        yield from (f"{key} {text}" for key, text in definition.wishes.items())
        yield from chart_lines(definition.chart)

    return "".join(f"{line}\n" for line in lines())


def checksum(definition: SequenceDefinition) -> int:
    """CRC-32 of `canonical` in UTF-8: a device that runs another program says another number."""
    return crc32(canonical(definition).encode())


def options(definition: SequenceDefinition) -> dict[str, float]:
    """The options that its equipment has by its definition (`BY_DEFINITION`)."""
    return {
        STEPS: float(len(definition.steps)),
        "program": float(checksum(definition)),
        "longest_force": definition.longest_force,
        "keep_forces": float(definition.keep_forces),
    }


def program(definition: SequenceDefinition) -> SequenceDefinition:
    """`definition` without what a device does not know (labels, tests): equal for two that run alike."""

    def bare(word: Sequence[SequencePermissive]) -> tuple[SequencePermissive, ...]:
        return tuple(replace(each, label={}, missing={}) for each in word)

    steps = tuple(replace(step, label={}, permissives=bare(step.permissives)) for step in definition.steps)
    recipe = tuple(replace(one, label={}) for one in definition.recipe)
    abort = bare(definition.abort)
    return replace(definition, name="", label={}, steps=steps, abort=abort, tests=(), recipe=recipe)


def _words(definition: SequenceDefinition) -> dict[str, tuple[float, float]]:
    return {f"word_{number}": (0.0, float(ALL)) for number in range(len(definition.steps) + 1)}


def _is_signal(point: Point) -> bool:
    """Whether the machine itself has it, as a number."""
    return point.register is not None and point.register.readable and point.kind is not Kind.TEXT


def _is_sentence(table: Table, key: str, text: str) -> bool:
    """Whether `text` is one of the grammar that needs no person and no clock; notes it when not."""
    try:
        parsed = expression.parse(text, machines=True)
    except ConfigurationError as error:
        table.note(key, text, error.args[0])
        return False
    if parsed.needs_argument:
        table.note(key, text, said("mistake.no_argument"))
        return False
    if parsed.ages:
        table.note(key, text, said("mistake.no_age"))
        return False
    return True


def _names(text: str) -> frozenset[str]:
    return expression.parse(text, machines=True).names if text else frozenset()


def _wish(file: _File, head: Table, key: str) -> str:
    """A sentence of `[sequence]`; empty when there is none, or none that can be read."""
    text = head.text(key, "")
    if text and _is_sentence(head, key, text):
        file.wishes.append((head, key, text))
        return text
    return ""


def _times(file: _File, row: Table) -> tuple[tuple[float, float], dict[str, str]]:
    """Least and greatest time of a step, and which of them are values of the run."""
    least, most, of_recipe = [0.0, 0.0], [0.0, 0.0], dict[str, str]()
    for n, key in enumerate(("minimum", "maximum")):
        value = named(row, key, file.recipe)
        if value is not None:
            check_time(row, key, value, LONGEST_TIME)
            of_recipe[key], least[n], most[n] = value.key, value.low, value.high
        elif not refers(row.data.get(key)):
            least[n] = most[n] = float(row.number(key, 0.0, 0, LONGEST_TIME))
    if most[1] > 0 and least[1] < most[0] and of_recipe.get("minimum") != of_recipe.get("maximum", ""):
        key = "mistake.maximum_of_run" if "minimum" in of_recipe else "mistake.maximum"
        row.note("maximum", row.data.get("maximum"), said(key, low=f"{most[0]:g}"))
    defaults = {one.key: one.default for one in file.recipe}
    minimum, maximum = (defaults.get(of_recipe.get(key, ""), least[n]) for n, key in enumerate(("minimum", "maximum")))
    return (minimum, maximum), of_recipe


def _order(file: _File, row: Table) -> SequenceOrder:
    """A row of `[[steps.orders]]`."""
    values, numbers, of_recipe = row.table("values"), dict[str, float](), dict[str, str]()
    for name in values.data:
        value = named(values, name, file.recipe)
        if value is not None:
            of_recipe[name], numbers[name] = value.key, value.default
        elif not refers(values.data[name]):
            numbers[name] = float(values.number(name))
    order = SequenceOrder(
        row.text("machine", pattern=NAME, expected=said("mistake.equipment")),
        row.text("action", pattern=KEY, expected=said("mistake.action_of_type")),
        numbers,
        of_recipe,
    )
    row.done()
    if order.machine and order.action and order.values.keys() == values.data.keys():
        file.orders.append((row, order))
    return order


def _check_signals(table: Table, key: str, text: str, known: Mapping[str, Point], machine: Equipment) -> None:
    for name in sorted(_names(text) - set(known) - set(others(_names(text)))):
        if name in machine.points:
            table.note(key, text, said("mistake.own_points", machine=machine.id, point=name))
        else:
            table.note(key, text, said("mistake.points_of", machine=machine.id, point=name, near=_near(name, known)))


def _near(name: str, known: Iterable[str]) -> str:
    """What was perhaps meant; a machine has too many points to name them all."""
    near = get_close_matches(name, list(known), n=1)
    return perhaps(near[0] if near else "")


def _check_command(row: Table, command: str, given: Mapping[str, float], item: Equipment) -> None:
    """A command of the sequence itself, with a number for each of its arguments; whether it takes them, the device says."""
    orders = {name: each for name, each in item.type.commands.items() if each.code}
    if command not in orders:
        row.note(
            "command", command, said("mistake.command_of", type=item.type.name, known=one_of(sorted(orders), command))
        )
        return
    kinds = {argument.name: argument.type for argument in orders[command].arguments}
    for name in kinds:
        if name not in given:
            row.note(f"arguments.{name}", MISSING, said("mistake.needs", what=command, values=", ".join(kinds)))
    for name, value in given.items():
        if name not in kinds:
            row.note(
                f"arguments.{name}",
                value,
                said("mistake.argument_of", command=command, known=one_of(list(kinds), name)),
            )
        elif kinds[name] is not Type.F32 and not (value.is_integer() and abs(value) < 2**31):
            row.note(f"arguments.{name}", value, said("mistake.whole"))


def _one(row: Table, names: Sequence[str]) -> None:
    """Exactly one of `names` must be in the row."""
    given = [name for name in names if row.has(name)]
    for name in names:
        row.raw(name)
    if len(given) != 1:
        row.note(
            "",
            Plain(", ".join(given)) if given else said("mistake.nothing"),
            said("mistake.exactly_one", names=", ".join(names)),
        )
