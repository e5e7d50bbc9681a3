"""`[options]`, `[presets]` and `[[checks]]` of device.toml: what a plant file may say of one machine, and what it must obey."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from app.errors import ConfigurationError
from app.plant import expression
from app.plant.plant_files.languages import languages
from app.plant.said import said, said_by
from app.plant.tables import Table, is_number, read_label, span
from app.plant.type_files.names import KEY, NAME_EXPECTED

STEPS = "steps"
"""Option of a type whose equipment runs a sequence: its number of steps."""
MOST_STEPS = 200
SPAN_EXPECTED = said("mistake.two_numbers", pair="[low, high]", order="low <= high")
BY_DEFINITION: Mapping[str, tuple[float, float, float]] = {
    STEPS: (8.0, 1.0, float(MOST_STEPS)),
    "program": (0.0, 0.0, float(2**32 - 1)),
    "longest_force": (28_800.0, 1.0, 7 * 86_400.0),
    "keep_forces": (0.0, 0.0, 1.0),
}
"""Options that no plant file sets, as the definition of the sequence gives them (`sequences.options`) → default, lowest, highest."""


@dataclass(frozen=True, slots=True)
class OptionCheck:
    """What must hold between the options of a machine: `[[checks]]` of device.toml."""

    expression: str
    """A sentence over options that are numbers."""
    option: str
    """The one that is blamed."""
    expected: str | Mapping[str, str]
    """What was expected of it, or language → that; `{name}` is an option's value."""

    def holds(self, options: Mapping[str, float]) -> bool:
        """Whether `options` meet it."""
        return expression.parse(self.expression).true(options) is True

    def told(self, options: Mapping[str, object]) -> str:
        """What was expected, with the values of `options`.

        Raises:
            LookupError, ValueError: it names what is no option.
        """
        if isinstance(self.expected, str):
            return self.expected.format(**options)
        for text in self.expected.values():
            text.format(**options)
        return said_by(self.expected, **options)


@dataclass(slots=True)
class Options:
    """The options of a type: numbers with their limits, and tables of words, parameters and numbers."""

    owner: str
    values: dict[str, object] = field(default_factory=dict)
    """Default by name; of a table: an empty one."""
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    choices: dict[str, Mapping[str, Sequence[str]]] = field(default_factory=dict)
    parameters: dict[str, bool] = field(default_factory=dict)
    numbers: dict[str, dict[str, tuple[float, float]]] = field(default_factory=dict)
    whole: set[str] = field(default_factory=set)
    """Numbers that have no fraction: their register has none."""
    follows: dict[str, str] = field(default_factory=dict)
    """Those whose default is a sentence over options above them: what a machine says of these decides."""
    presets: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def defaults(self) -> dict[str, float]:
        """Those that are numbers."""
        return {name: value for name, value in self.values.items() if isinstance(value, float)}

    def check_expression(self, table: Table, key: str, text: str) -> None:
        """Note a problem when `text` is no sentence over options that are numbers."""
        try:
            unknown = expression.parse(text).names - set(self.defaults)
        except ConfigurationError as error:
            table.note(key, text, error.args[0])
        else:
            for name in sorted(unknown):
                table.note(key, text, said("mistake.options_only", owner=self.owner, name=name))

    def check_whole(self, head: Table, option: str, expected: str) -> None:
        """An option that counts slots, or whose register has no fraction, has whole numbers only."""
        given = {f"options.{option}.default": self.values[option]}
        given |= {f"presets.{name}.{option}": one[option] for name, one in self.presets.items() if option in one}
        for key, value in given.items():
            if isinstance(value, float) and not value.is_integer():
                head.note(key, value, expected)


def read_options(head: Table, owner: str, *, sequence: bool) -> Options:
    """What device.toml says of them; of a type that runs a sequence also those that its definition gives."""
    options = Options(owner)
    for key, table in head.tables("options"):
        _read_option(options, key, table)
    options.presets = dict(_presets(head, options.ranges))
    if sequence:
        _add_definition(head, options)
    return options


def read_checks(head: Table, options: Options, *, usual: bool = True) -> Iterator[OptionCheck]:
    """`[[checks]]`: what must hold between options; the defaults, and every preset, must meet them unless the type is not as it is
    `usual`ly, with other numbers of repeated rows, whose options a plant file must tell."""
    defaults, known = options.defaults, languages()
    for row in head.rows("checks"):
        sentence, option = row.text("expression"), row.text("option", choices=list(defaults))
        many = isinstance(row.data.get("expected"), dict)
        told = (read_label(row, "expected", known, known) or "") if many else row.text("expected")
        check = OptionCheck(sentence, option, told)
        options.check_expression(row, "expression", check.expression)
        try:
            check.told(defaults)
        except (LookupError, ValueError) as error:
            row.note("expected", row.data["expected"], said("mistake.options_in_braces", why=error))
            continue
        for name, given in ({"default": {}, **options.presets} if usual else {}).items():
            if not row.source.problems and not check.holds({**defaults, **given}):
                row.note("expression", check.expression, said("mistake.check_holds", name=name))
        row.done()
        yield check


def read_span(name: str, table: Table) -> tuple[float, float]:
    """`name = [low, high]`."""
    match table.raw(name):
        case [low, high] if is_number(low) and is_number(high) and low <= high:
            return float(low), float(high)
        case other:
            table.note(name, other, SPAN_EXPECTED)
            return 0.0, 0.0


def _read_option(options: Options, key: str, table: Table) -> None:
    if table.has("default"):
        low, high = float(table.number("low")), float(table.number("high"))
        options.ranges[key] = (low, high)
        options.values[key] = _default(options, key, table, low, high)
        if table.flag("whole"):
            options.whole.add(key)
    else:
        options.values[key] = {}
        words = table.table("words")
        options.choices[key] = {word: words.items(word) for word in words.data}
        options.parameters[key] = table.flag("parameters")
        numbers = table.table("numbers")
        options.numbers[key] = {name: read_span(name, numbers) for name in numbers.data}
    table.done()


def _default(options: Options, key: str, table: Table, low: float, high: float) -> float:
    """The number `default`, or what its sentence gives with the defaults of the options above it."""
    given = table.data["default"]
    if not isinstance(given, str):
        return float(table.number("default", low=low, high=high))
    table.raw("default")
    before = len(table.source.problems)
    options.check_expression(table, "default", given)
    if len(table.source.problems) > before:
        return low
    value = expression.number(given, options.defaults)
    if value is None or not low <= value <= high:
        table.note("default", given, span("number", low, high))
        return low
    options.follows[key] = given
    return value


def _presets(head: Table, ranges: Mapping[str, tuple[float, float]]) -> Iterator[tuple[str, dict[str, float]]]:
    """`[presets.model]`: other defaults of options that are numbers."""
    for name, table in head.tables("presets"):
        if not re.fullmatch(KEY, name):
            table.note("", name, NAME_EXPECTED)
        for key in ranges:
            table.raw(key)
        given = {
            key: float(table.number(key, low=low, high=high)) for key, (low, high) in ranges.items() if table.has(key)
        }
        table.done()
        yield name, given


def _add_definition(head: Table, options: Options) -> None:
    """The options that no plant file sets: a sequence has as many steps as its definition."""
    for key, (default, low, high) in BY_DEFINITION.items():
        if key in options.values:
            head.note(f"options.{key}", said("mistake.given"), said("mistake.no_option"))
        options.values[key] = default
        options.ranges[key] = (low, high)
