"""The form over one section of a sequence's definition: its fields with what is wrong with each, and what its sentences say now."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from app.errors import ConfigurationError
from app.plant.actions import Action
from app.plant.definitions import Equipment, Plant
from app.plant.expression import Reading, parse
from app.plant.problems import Problem
from app.plant.sequence_chart import TAKES
from app.plant.sequence_definition import PREFIX
from app.plant.sequence_text import HEAD_TABLE, ROWS, TESTS, Section, mask, table_of, unnamed
from app.plant.sequences import ABORT, FOLDER
from app.tags.quality import NO_DATA
from app.web.points import EquipmentView, PointView

HEAD_NUMBERS = ("stall_after", "longest_force")
HEAD_FLAGS = ("output_while_suspended", "keep_forces")
WISHES = ("start_when", "suspend_when", "advance_when")
DEFAULTS: Mapping[str, str] = {"minimum": "0", "maximum": "0", "stall_after": "1", "longest_force": "28800"}
"""What counts when nothing is written [s]."""


@dataclass(frozen=True, slots=True)
class Field:
    """One thing that can be typed, chosen or ticked."""

    name: str
    """As the section calls it: `permissives.3.when`."""
    label: str
    value: str
    kind: str = "text"
    """text, number, flag, choice, sentence."""
    on: bool = False
    """Of a flag."""
    unit: str = ""
    choices: Sequence[tuple[str, str]] = ()
    """Value, text."""
    hint: str = ""
    """What counts when it is empty; of a flag what the file calls it."""
    wrong: str = ""
    """What was expected."""
    lang: str = ""
    required: bool = False
    names: bool = False
    """Whether the name of a value of the run may stand there."""

    @property
    def id(self) -> str:
        """For the page."""
        return "f-" + self.name.replace(".", "-")


@dataclass(frozen=True, slots=True)
class Bit:
    """One permissive or abort condition."""

    bit: str
    name: str
    """What it is called."""
    fields: Sequence[Field]
    labels: Sequence[Field]
    holds: bool | None
    """Whether its sentence is true now; None = not known."""
    now: Sequence[tuple[str, PointView]]
    """What the points that it names are called, and they themselves."""
    wrong: str = ""


@dataclass(frozen=True, slots=True)
class OrderView:
    """One order of a step, or one value of a run, branch or loop."""

    number: int
    fields: Sequence[Field]
    wrong: str = ""
    labels: Sequence[Field] = ()


@dataclass(slots=True)
class Form:
    """What the page shows of a section."""

    section: str
    fields: list[Field] = field(default_factory=list)
    labels: list[Field] = field(default_factory=list)
    actions: list[Field] = field(default_factory=list)
    bits: list[Bit] = field(default_factory=list)
    orders: list[OrderView] = field(default_factory=list)
    rows: dict[str, list[OrderView]] = field(default_factory=dict)
    """Of the whole sequence: its values of a run, branches, loops."""
    recipe: list[str] = field(default_factory=list)
    """Names of the values of a run, as times and orders write them."""
    unnamed: list[str] = field(default_factory=list)
    mask: int = 0
    broken: bool = False
    """The text is no TOML: nothing but the text can be changed."""
    commands: bool = False
    """Whether there is a machine that takes orders."""

    @property
    def shown(self) -> list[str]:
        """Names of the boxes to tick."""
        every = [*self.fields, *self.actions, *(one for bit in self.bits for one in bit.fields)]
        return [one.name for one in every if one.kind == "flag"]

    @property
    def hints(self) -> list[Field]:
        """All fields that say what is wrong with them."""
        rows = [one for bit in self.bits for one in (*bit.fields, *bit.labels)]
        lists = [row for found in self.rows.values() for row in found]
        more = [one for row in (*self.orders, *lists) for one in (*row.fields, *row.labels)]
        return [*self.fields, *self.labels, *self.actions, *rows, *more]


@dataclass(frozen=True, slots=True)
class Place:
    """A section in the list of them."""

    key: str
    label: str
    line: int
    last: int
    wrong: int
    """Mistakes in it."""


class _Fields:
    """Makes fields, each with what is wrong with it."""

    def __init__(
        self, equipment: EquipmentView, plant: Plant, data: Mapping[str, Any] | None, problems: Sequence[Problem]
    ) -> None:
        self._equipment, self._plant, self._data = equipment, plant, data or {}
        self._text = equipment.text
        name = equipment.equipment.sequence.name if equipment.equipment.sequence else ""
        self.problems = [one for one in problems if one.file == f"{FOLDER}/{name}.toml"]
        """Of this definition."""
        self.elsewhere = [one for one in problems if one not in self.problems]
        """Of the plant's other files."""

    @property
    def _recipe(self) -> list[str]:
        return [PREFIX + str(row["key"]) for row in _rows(self._data.get("recipe")) if "key" in _table(row)]

    def _labels(self, base: str, name: str, label: object) -> list[Field]:
        texts = dict.fromkeys(self._plant.languages, label) if isinstance(label, str) else _table(label)
        problems = self._wrong(base, name)
        whole = problems.get(name)
        return [
            Field(
                f"{name}.{language}",
                language,
                str(texts.get(language, "")),
                wrong=(problems[one].expected if (one := f"{name}.{language}") in problems else "")
                or (whole.expected if whole and n == 0 else ""),
                lang=language,
            )
            for n, language in enumerate(self._plant.languages)
        ]

    def _number(self, base: str, name: str, value: object, *, label: str = "", unit: str = "s") -> Field:
        last = name.rpartition(".")[2]
        hint = DEFAULTS.get(last, "")
        names = bool(base and self._recipe)
        return self._field(base, name, value, kind="number", label=label, unit=unit, hint=hint, names=names)

    def _flag(self, base: str, name: str, *, on: bool) -> Field:
        return self._field(base, name, "1", kind="flag", on=on)

    def _field(
        self,
        base: str,
        name: str,
        value: object,
        *,
        kind: str = "text",
        label: str = "",
        choices: Sequence[tuple[str, str]] = (),
        **more: Any,
    ) -> Field:
        problem = self._wrong(base, name).get(name)
        shown = "" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
        if choices and shown not in [key for key, _ in choices]:
            choices = [(shown, shown or "–"), *choices]
        label = label or self._text(f"editor.key.{name.rpartition('.')[2]}")
        wrong = problem.expected if problem else ""
        return Field(name, label, shown, kind, choices=choices, wrong=wrong, **more)

    def _wrong(self, base: str, name: str) -> dict[str, Problem]:
        """Mistakes at `name` and under it, by the name that the form gives them."""
        found: dict[str, Problem] = {}
        for one in self.problems:
            key = one.key.removeprefix(base) if one.key.startswith(base) else ""
            if key == name or key.startswith(f"{name}."):
                found.setdefault(key, one)
        return found

    def _machine(self) -> Equipment | None:
        return self._plant.equipment.get(self._equipment.equipment.machine)

    def _actions(self, machine: Equipment) -> dict[str, str]:
        """What a step may ask → as the machine's own page calls it; empty where its type has no text for it."""
        view = self._equipment.other(machine.id)
        texts = view.point("action").texts if view is not None and view.has("action") else {}
        return {action: str(texts.get(str(code), "")) for code, action in enumerate(machine.type.actions, 1)}

    def _others(self) -> list[Equipment]:
        return [one for one in self._plant.equipment.values() if one.id != self._equipment.id]

    def _label_of(self, item: Equipment) -> str:
        return self._equipment.words(item.label)

    def _words(self, label: object) -> str:
        if isinstance(label, str):
            return label
        return (
            self._equipment.words({key: text for key, text in _table(label).items() if isinstance(text, str)})
            if label
            else ""
        )


class Forms(_Fields):
    """Makes the forms of one definition, as it is written and as the plant stands."""

    # ---- the list of sections -------------------------------------------------------------------------

    def places(self, parts: Iterable[Section]) -> list[Place]:
        """The sections by name, with the number of their mistakes."""
        return [
            Place(part.key, self.title(part.key), part.line, part.last, len(self.problems_of(part))) for part in parts
        ]

    def title(self, key: str) -> str:
        """What a section is called."""
        if key == "0":
            return self._text("editor.head")
        if key == TESTS:
            return self._text("editor.tests")
        try:
            label = table_of(self._data, key).get("label")
        except LookupError:
            label = None
        return self._words(label) or self._text("editor.step_n", n=key)

    def problems_of(self, part: Section) -> list[Problem]:
        """What is wrong in a section: by its key, else by its line."""
        return [one for one in self.problems if self._section_of(one, part) == part.key]

    def place(self, one: Problem, parts: Iterable[Section]) -> str:
        """The section of a mistake."""
        return next((part.key for part in parts if self._section_of(one, part) == part.key), "0")

    @staticmethod
    def _section_of(one: Problem, part: Section) -> str:
        head, _, rest = one.key.partition(".")
        number = rest.partition(".")[0]
        if head == "steps" and number.isdecimal():
            return str(int(number) + 1)
        if head in (TESTS, HEAD_TABLE, ABORT, *ROWS):
            return TESTS if head == TESTS else "0"
        return part.key if part.text and part.line <= (one.line or 1) <= part.last else ""

    # ---- a form ---------------------------------------------------------------------------------------

    def form(self, section: str, *, broken: bool) -> Form:
        """The form over `section`; of one that is not there, and of the tests, an empty one."""
        form = Form(section, broken=broken)
        try:
            table = {} if section == TESTS else table_of(self._data, section)
        except LookupError:
            return form
        if section == TESTS or broken:
            return form
        base = "" if section == "0" else f"steps.{int(section) - 1}."
        form.unnamed = unnamed(table, section)
        form.recipe = self._recipe
        if section == "0":
            self._head(form, _table(table.get(HEAD_TABLE)))
            form.rows = {
                name: [make(f"{name}.{n}", n, _table(row)) for n, row in enumerate(_rows(table.get(name)))]
                for name, make in (("recipe", self._value_of_run), ("branches", self._branch), ("loops", self._loop))
            }
            word, name = table.get(ABORT), ABORT
        else:
            self._step(form, table, base)
            word, name = table.get("permissives"), "permissives"
        form.mask = mask(word)
        for bit, one in sorted(_table(word).items(), key=lambda pair: (len(pair[0]), pair[0])):
            form.bits.append(self._bit(base, name, bit, _table(one)))
        form.commands = any(other.type.orders for other in self._others())
        return form

    def _head(self, form: Form, head: Mapping[str, Any]) -> None:
        form.labels = self._labels("", f"{HEAD_TABLE}.label", head.get("label"))
        for key in HEAD_NUMBERS:
            form.fields.append(self._number("", f"{HEAD_TABLE}.{key}", head.get(key)))
        for key in HEAD_FLAGS:
            form.fields.append(self._flag("", f"{HEAD_TABLE}.{key}", on=head.get(key) is True))
        for key in WISHES:
            form.fields.append(self._field("", f"{HEAD_TABLE}.{key}", head.get(key), kind="sentence"))

        form.fields.append(self._place(f"{HEAD_TABLE}.abort_to", head.get("abort_to"), none=True))

    def _place(self, name: str, key: object, *, none: bool = False) -> Field:
        """A step by its key."""
        steps = [_table(row) for row in _rows(self._data.get("steps"))]
        choices = [
            (str(step.get("key", "")), f"{n} · {self._words(step.get('label')) or step.get('key', '')}")
            for n, step in enumerate(steps, 1)
        ]
        choices = [("", "–"), *choices] if none else choices
        return self._field("", name, key, kind="choice", choices=choices, required=not none)

    def _value_of_run(self, name: str, number: int, row: Mapping[str, Any]) -> OrderView:
        unit = str(row.get("unit", ""))
        numbers = [
            self._field("", f"{name}.{key}", row.get(key), kind="number", label=self._text(f"editor.{word}"), unit=unit)
            for key, word in (("minimum", "least"), ("maximum", "most"), ("default", "before"))
        ]
        fields = [
            self._field("", f"{name}.key", row.get("key"), required=True),
            self._field("", f"{name}.unit", row.get("unit")),
            *numbers,
            self._field("", f"{name}.decimals", row.get("decimals"), kind="number", hint="1"),
        ]
        labels = self._labels("", f"{name}.label", row.get("label"))
        return OrderView(number, fields, self._whole(name), labels)

    def _branch(self, name: str, number: int, row: Mapping[str, Any]) -> OrderView:
        takes = [(key, self._text(f"editor.take_{key}")) for key in TAKES]
        paths = row.get("paths")
        written = ", ".join(map(str, paths)) if isinstance(paths, list) else paths
        wrong = next((one.expected for one in self._wrong("", f"{name}.paths").values()), "")
        fields = [
            self._place(f"{name}.after", row.get("after")),
            self._field("", f"{name}.take", row.get("take"), kind="choice", choices=takes, required=True),
            replace(self._field("", f"{name}.paths", written, required=True), wrong=wrong),
            self._place(f"{name}.then", row.get("then")),
        ]
        return OrderView(number, fields, self._whole(name))

    def _loop(self, name: str, number: int, row: Mapping[str, Any]) -> OrderView:
        fields = [
            self._place(f"{name}.from", row.get("from")),
            self._place(f"{name}.to", row.get("to")),
            self._field("", f"{name}.times", row.get("times"), kind="number", required=True, names=bool(self._recipe)),
        ]
        return OrderView(number, fields, self._whole(name))

    def _whole(self, name: str) -> str:
        """What is wrong with a row as such."""
        found = self._wrong("", name).get(name)
        return found.expected if found else ""

    def _step(self, form: Form, step: Mapping[str, Any], base: str) -> None:
        form.labels = self._labels(base, "label", step.get("label"))
        form.fields = [
            self._field(base, "key", step.get("key"), required=True),
            self._number(base, "minimum", step.get("minimum")),
            self._number(base, "maximum", step.get("maximum")),
            self._flag(base, "loss_aborts", on=step.get("loss_aborts") is True),
        ]
        machine = self._machine()
        asked = step.get("actions", [])
        asked = [str(one) for one in asked] if isinstance(asked, list) else []
        wrong = {index: one.expected for index, one in self._wrong(base, "actions").items()}
        called = self._actions(machine) if machine else {}
        for action in dict.fromkeys([*called, *asked]):
            told = wrong.get(f"actions.{asked.index(action)}", "") if action in asked else ""
            label = called.get(action, "") or action
            hint = action if label != action else ""
            form.actions.append(
                Field(f"actions.{action}", label, "1", "flag", hint=hint, on=action in asked, wrong=told)
            )
        orders = step.get("orders", [])
        for number, row in enumerate(orders if isinstance(orders, list) else ()):
            form.orders.append(self._order(base, number, _table(row)))

    def _bit(self, base: str, word: str, bit: str, one: Mapping[str, Any]) -> Bit:
        name = f"{word}.{bit}"
        fields = [
            Field(
                f"{name}.bit", self._text("editor.bit"), bit, "choice", choices=[(str(n), str(n)) for n in range(16)]
            ),
            self._field(base, f"{name}.key", one.get("key"), hint=f"bit_{bit}"),
            self._field(base, f"{name}.when", one.get("when"), kind="sentence", required=True),
            self._field(base, f"{name}.value", one.get("value")),
            self._flag(base, f"{name}.forceable", on=one.get("forceable", word != ABORT) is True),
        ]
        labels = self._labels(base, f"{name}.label", one.get("label"))
        holds, now = self.now(str(one.get("when", "")))
        said = self._words(one.get("label")) or str(one.get("key") or f"bit_{bit}")
        own = self._wrong(base, name).get(name)
        return Bit(bit, said, fields, labels, holds, now, own.expected if own else "")

    def _order(self, base: str, number: int, row: Mapping[str, Any]) -> OrderView:
        name = f"orders.{number}"
        machines = [(one.id, f"{self._label_of(one)} · {one.id}") for one in self._others() if one.type.orders]
        chosen = self._plant.equipment.get(str(row.get("machine", "")))
        orders = chosen.type.orders if chosen else {}
        action = orders.get(str(row.get("action", "")))
        given = _table(row.get("values"))
        fields = [
            self._field(base, f"{name}.machine", row.get("machine"), kind="choice", choices=machines, required=True),
            self._field(
                base,
                f"{name}.action",
                row.get("action"),
                kind="choice",
                choices=[(key, self._called(chosen, one)) for key, one in orders.items()],
                required=True,
            ),
        ]
        may = action.optional if action else ()
        for value in dict.fromkeys([*(action.values if action else ()), *(key for key in given if key not in may)]):
            unit = self._unit(chosen, action, value)
            fields.append(self._number(base, f"{name}.values.{value}", given.get(value), label=value, unit=unit))
        for value in may:
            unit, hint = self._unit(chosen, action, value), self._text("editor.as_last")
            one = self._number(base, f"{name}.values.{value}", given.get(value), label=value, unit=unit)
            fields.append(replace(one, hint=hint))
        own = self._wrong(base, name).get(name)
        return OrderView(number, fields, own.expected if own else "")

    def _called(self, machine: Equipment | None, action: Action) -> str:
        """An action as the file writes it, and in words where its type has some."""
        view = self._equipment.other(machine.id) if machine and action.label else None
        return f"{action.key} · {view.t(action.label)}" if view is not None else action.key

    def _unit(self, machine: Equipment | None, action: Action | None, value: str) -> str:
        """Of the argument of the command that takes `value`, or of the action itself."""
        own = next((one for one in action.arguments if one.name == value), None) if action else None
        if own is not None:
            return own.unit
        for each in action.commands if action else ():
            command = machine.type.commands.get(each.command) if machine else None
            for argument in command.arguments if command else ():
                if argument.name == value and value in (*each.arguments, *each.optional):
                    return argument.unit
            point = machine.points.get(command.argument) if machine and command and each.value == value else None
            if point is not None:
                return point.unit
        return ""

    # ---- what holds now -------------------------------------------------------------------------------

    def now(self, sentence: str) -> tuple[bool | None, list[tuple[str, PointView]]]:
        """Whether `sentence` is true now, and the points that it names."""
        if not sentence:
            return None, []
        try:
            parsed = parse(sentence, machines=True)
        except ConfigurationError:
            return None, []
        if parsed.needs_argument or parsed.ages:
            return None, []
        said: list[tuple[str, PointView]] = []
        for name in sorted(parsed.names):
            machine, key = self._point(name)
            if machine is not None and machine.has(key):
                view = machine.point(key)
                own = machine.id == self._equipment.equipment.machine
                said.append((view.label if own else f"{machine.label}: {view.label}", view))
        return parsed.true(self._reading), said

    def _point(self, name: str) -> tuple[EquipmentView | None, str]:
        id, _, key = name.rpartition(".")
        return self._equipment.other(id or self._equipment.equipment.machine), key

    def _reading(self, name: str) -> Reading:
        machine, key = self._point(name)
        point = machine.point(key) if machine is not None and machine.has(key) else None
        return (point.value, point.quality) if point and point.state == "good" else (None, NO_DATA)


def _rows(value: object) -> Sequence[Any]:
    return value if isinstance(value, list) else ()


def _table(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
