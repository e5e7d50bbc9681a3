"""The one small grammar for alarms, permissives, interlocks, feedback, drawing and time-outs.

    status in (1, 2) and current >= 1.1 * rated_current
    good(status) and not bad(frequency) and 0 < f905 <= 2
    abs(frequency - frequency_setpoint) < 0.5 or age(status) > 3

Names are points of the same equipment, or `argument` for what a person entered. A text is parsed once to an allow-list of forms:
numbers, names, `+ - * /`, comparisons (chained too), `and or not`, `in (…)`, `abs() min() max()`, `good() bad() age()`. Nothing
else exists: no attribute, no index, no power, no other call. A sentence of the whole plant (`machines`) names points of other equipment
as `m1.speed`.

The result has three values. A point that is bad or has no number makes what is computed from it unknown (None); `and` and `or`
follow Kleene: what is already decided stays decided. `good()` and `bad()` are always known.
"""

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

from app.errors import ConfigurationError
from app.plant.said import said
from app.tags.batch import Value
from app.tags.quality import GOOD, NO_DATA, is_bad, is_good

Result = float | bool | None
Reading = tuple[Value, int]
"""Value and quality word."""
Look = Callable[[str], Reading]
"""Gives the reading of a point by its key; (None, NO_DATA) when it was never received."""
Age = Callable[[str], float | None]
"""Gives the age of a point by its key [s]."""

ARGUMENT = "argument"
LONGEST = 4000  # a sentence over thirty-two sensors is long
DEEPEST = 24
EXPECTED = said("mistake.grammar")

_Step = Callable[[Look, Age | None, float | None], Result]

_ARITHMETIC: Mapping[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_COMPARE: Mapping[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_CALLS: Mapping[str, Callable[[list[float]], float]] = {"abs": lambda v: abs(v[0]), "min": min, "max": max}
_QUALITY: Mapping[str, Callable[[Value, int], bool]] = {
    "good": lambda value, quality: is_good(quality) and value is not None,
    "bad": lambda value, quality: is_bad(quality) or value is None,
}
PARSER = {
    r"invalid syntax": "syntax",
    r"invalid syntax\. Perhaps you forgot a comma\?": "comma",
    r"(?P<sign>'.') was never closed": "never_closed",
    r"unmatched (?P<sign>'.')": "unmatched",
    r"invalid decimal literal": "decimal",
    r"leading zeros in decimal integer literals .*": "leading_zeros",
}
"""What Python's parser says, a pattern → the text of ours with the value that it names."""
RESERVED = frozenset({ARGUMENT, "age", *_CALLS, *_QUALITY})
"""Words that no point can be called."""


@dataclass(frozen=True, slots=True)
class Expression:
    """A parsed sentence, ready to be evaluated as often as needed."""

    text: str
    names: frozenset[str]
    """Points it reads."""
    needs_argument: bool = False
    ages: frozenset[str] = frozenset()
    """Points whose age it asks for: it changes although no value does."""
    compared: frozenset[tuple[str, float]] = frozenset()
    """Points and the numbers that it asks whether they are: `mode == 1`, `mode in (1, 2)`."""
    _step: _Step = field(default=lambda look, age, argument: None, repr=False, compare=False)

    def evaluate(
        self,
        values: Look | Mapping[str, Value | Reading],
        *,
        age: Age | None = None,
        argument: float | None = None,
    ) -> Result:
        """The value now: a number, a truth, or None when it is not known.

        `values` is asked for (value, quality) by key; a mapping may hold bare values, which count as good, and what it lacks counts
        as never received. `age` gives seconds since a point was seen.
        """
        look = values if callable(values) else _reader(values)
        return self._step(look, age, argument)

    def true(
        self,
        values: Look | Mapping[str, Value | Reading],
        *,
        age: Age | None = None,
        argument: float | None = None,
    ) -> bool | None:
        """Whether it holds: True, False, or None when it is not known."""
        return _truth(self.evaluate(values, age=age, argument=argument))


@lru_cache(maxsize=4096)
def parse(text: str, *, machines: bool = False) -> Expression:
    """`text` as an expression; with `machines` also over points of other equipment, named `equipment.point`.

    Raises:
        ConfigurationError: it is not a sentence of the grammar; names the text, the position (from 1) and what was expected.
    """
    if not text.strip():
        raise _error(text, 1, said("mistake.nothing"), EXPECTED)
    if len(text) > LONGEST:
        raise _error(
            text[:40] + "…",
            LONGEST + 1,
            said("mistake.length", length=len(text)),
            said("mistake.characters", most=LONGEST),
        )
    sentence = text.strip()
    if stranger := re.search(r"[^A-Za-z0-9_.,()+\-*/<>=!\s]", sentence):
        raise _error(sentence, stranger.start() + 1, f"`{stranger[0]}`", EXPECTED)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Python about `1in (1, 2)`, which a plant engineer never sees
            tree = ast.parse(sentence, mode="eval")
    except SyntaxError as error:
        # an offset of 0 is the parser's word for the end
        raise _error(
            sentence,
            error.offset or len(sentence),
            said("mistake.a_mistake", parser=_parser_words(error.msg)),
            EXPECTED,
        ) from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise _error(sentence, 1, said("mistake.a_mistake", parser=_parser_words(str(error))), EXPECTED) from error
    compiler = _Compiler(sentence, machines=machines)
    step = compiler.build(tree.body, 0)
    return Expression(
        text,
        frozenset(compiler.names),
        compiler.argument,
        frozenset(compiler.ages),
        frozenset(compiler.compared),
        step,
    )


def number(
    text: str | float, values: Look | Mapping[str, Value | Reading] = lambda key: (None, NO_DATA)
) -> float | None:
    """A limit or a time-out that is a number or an expression over points; None when it is not known.

    Raises:
        ConfigurationError: `text` is not a sentence of the grammar.
    """
    if isinstance(text, int | float):
        return float(text)
    result = parse(text).evaluate(values)
    return None if result is None else float(result)


class _Compiler:
    def __init__(self, text: str, *, machines: bool = False) -> None:
        self.text = text
        self.machines = machines
        self.names: set[str] = set()
        self.ages: set[str] = set()
        self.compared: set[tuple[str, float]] = set()
        self.argument = False

    def build(self, node: ast.expr, depth: int) -> _Step:
        if depth > DEEPEST:
            raise self._wrong(node, said("mistake.too_deep"), said("mistake.levels", most=DEEPEST))
        match node:
            case ast.Constant(value=bool() as truth):
                return lambda look, age, argument: truth
            case ast.Constant(value=(int() | float()) as constant) if _is_finite(constant):
                return lambda look, age, argument: constant
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.Attribute() if name := self._point(node):
                return self._name(node, name)
            case ast.UnaryOp(op=ast.Not(), operand=inner):
                return _negation(self.build(inner, depth + 1))
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return _minus(self.build(inner, depth + 1))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
                return _arithmetic(_ARITHMETIC[type(op)], self.build(left, depth + 1), self.build(right, depth + 1))
            case ast.BoolOp(op=op, values=values):
                return _kleene(isinstance(op, ast.And), [self.build(value, depth + 1) for value in values])
            case ast.Compare(left=left, ops=ops, comparators=comparators):
                return self._comparison(node, left, ops, comparators, depth)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(node, name, arguments, depth)
        raise self._wrong(node, self._as_written(node), EXPECTED)

    def _name(self, node: ast.expr, name: str) -> _Step:
        if name == ARGUMENT:
            self.argument = True
            return lambda look, age, argument: argument
        if name in RESERVED:
            raise self._wrong(node, said("mistake.no_brackets", name=name), said("mistake.as_is", what=f"{name}(…)"))
        self.names.add(name)

        def step(look: Look, age: Age | None, argument: float | None) -> Result:
            value, quality = look(name)
            if is_bad(quality) or value is None or isinstance(value, str):
                return None
            return value if math.isfinite(value) else None

        return step

    def _point(self, node: ast.expr) -> str:
        """The point that `node` names; empty when it names none."""
        match node:
            case ast.Name(id=name) if name not in RESERVED:
                return name
            case ast.Attribute(value=ast.Name(id=machine), attr=point) if self.machines:
                return f"{machine}.{point}"
        return ""

    def _comparison(
        self, node: ast.expr, left: ast.expr, ops: list[ast.cmpop], comparators: list[ast.expr], depth: int
    ) -> _Step:
        if len(ops) == 1 and isinstance(ops[0], ast.In | ast.NotIn):
            members = comparators[0]
            if not isinstance(members, ast.Tuple) or not members.elts:
                raise self._wrong(members, self._as_written(members), said("mistake.members"))
            for item in members.elts:
                self._compare(left, item)
            inside = _member(self.build(left, depth + 1), [self.build(item, depth + 1) for item in members.elts])
            return _negation(inside) if isinstance(ops[0], ast.NotIn) else inside
        if any(type(op) not in _COMPARE for op in ops):
            raise self._wrong(node, self._as_written(node), said("mistake.comparison"))
        for op, one, other in zip(ops, (left, *comparators), comparators, strict=False):
            if isinstance(op, ast.Eq | ast.NotEq):
                self._compare(one, other)
        terms = [self.build(term, depth + 1) for term in (left, *comparators)]
        return _chain([_COMPARE[type(op)] for op in ops], terms)

    def _compare(self, one: ast.expr, other: ast.expr) -> None:
        """Remember the point and the number when it is one with the other, whichever stands first."""
        for point, number in ((one, other), (other, one)):
            name, sign = self._point(point), 1
            if isinstance(number, ast.UnaryOp) and isinstance(number.op, ast.USub):
                number, sign = number.operand, -1
            if name and isinstance(number, ast.Constant) and isinstance(number.value, int | float):
                self.compared.add((name, sign * number.value))

    def _call(self, node: ast.expr, name: str, arguments: list[ast.expr], depth: int) -> _Step:
        if name in _QUALITY or name == "age":
            if len(arguments) != 1 or not self._point(arguments[0]):
                raise self._wrong(node, self._as_written(node), said("mistake.of_point", name=name))
            point = self._point(arguments[0])
            self.names.add(point)
            if name == "age":
                self.ages.add(point)
                return lambda look, age, argument: None if age is None else age(point)
            judge = _QUALITY[name]
            return lambda look, age, argument: judge(*look(point))
        if name not in _CALLS or not arguments or (name == "abs" and len(arguments) != 1):
            raise self._wrong(node, self._as_written(node), said("mistake.calls"))
        call, terms = _CALLS[name], [self.build(item, depth + 1) for item in arguments]

        def step(look: Look, age: Age | None, argument: float | None) -> Result:
            values = [term(look, age, argument) for term in terms]
            known = [float(value) for value in values if value is not None]
            return call(known) if len(known) == len(values) else None

        return step

    def _as_written(self, node: ast.expr) -> str:
        return f"`{(ast.get_source_segment(self.text, node) or self.text)[:40]}`"

    def _wrong(self, node: ast.expr, found: str, expected: str) -> ConfigurationError:
        return _error(self.text, node.col_offset + 1, found, expected)


def _reader(values: Mapping[str, Value | Reading]) -> Look:
    def look(key: str) -> Reading:
        found = values.get(key, (None, NO_DATA))
        return found if isinstance(found, tuple) else (found, NO_DATA if found is None else GOOD)

    return look


def _is_finite(constant: float) -> bool:
    try:
        return math.isfinite(constant)
    except OverflowError:  # a whole number of more than 308 digits
        return False


def _truth(value: Result) -> bool | None:
    return None if value is None else bool(value)


def _negation(inner: _Step) -> _Step:
    def step(look: Look, age: Age | None, argument: float | None) -> Result:
        value = inner(look, age, argument)
        return None if value is None else not value

    return step


def _minus(inner: _Step) -> _Step:
    def step(look: Look, age: Age | None, argument: float | None) -> Result:
        value = inner(look, age, argument)
        return None if value is None else -float(value)

    return step


def _arithmetic(compute: Callable[[float, float], float], left: _Step, right: _Step) -> _Step:
    def step(look: Look, age: Age | None, argument: float | None) -> Result:
        a, b = left(look, age, argument), right(look, age, argument)
        if a is None or b is None:
            return None
        try:
            result = compute(float(a), float(b))
        except ArithmeticError:
            return None
        return result if math.isfinite(result) else None

    return step


def _kleene(conjunction: bool, terms: list[_Step]) -> _Step:
    decided = not conjunction

    def step(look: Look, age: Age | None, argument: float | None) -> Result:
        unknown = False
        for term in terms:
            value = _truth(term(look, age, argument))
            if value is decided:
                return decided
            unknown = unknown or value is None
        return None if unknown else conjunction

    return step


def _member(left: _Step, members: list[_Step]) -> _Step:
    def step(look: Look, age: Age | None, argument: float | None) -> Result:
        value = left(look, age, argument)
        if value is None:
            return None
        others = [member(look, age, argument) for member in members]
        if value in [other for other in others if other is not None]:
            return True
        return None if None in others else False

    return step


def _chain(comparisons: list[Callable[[float, float], bool]], terms: list[_Step]) -> _Step:
    def step(look: Look, age: Age | None, argument: float | None) -> Result:
        values = [term(look, age, argument) for term in terms]
        unknown = False
        for compare, a, b in zip(comparisons, values, values[1:], strict=False):
            if a is None or b is None:
                unknown = True
            elif not compare(a, b):
                return False
        return None if unknown else True

    return step


def _parser_words(told: str) -> str:
    """What Python's parser said, as a text of ours where it is one of its common ones."""
    for pattern, key in PARSER.items():
        if match := re.fullmatch(pattern, told):
            return said(f"mistake.{key}", **match.groupdict())
    return told


def _error(text: str, position: int, found: str, expected: str) -> ConfigurationError:
    return ConfigurationError(said("mistake.expression", text=text, position=position, found=found, expected=expected))
