"""Runs structured text: the part of IEC 61131-3 that docs/plc uses becomes Python, numbers wrap as their types do.

Whether the text is structured text at all says a parser that others wrote (test_text.py); this one is for what it does.
"""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from struct import pack, unpack
from types import SimpleNamespace
from typing import Any

TOKEN = re.compile(
    r"//[^\n]*|\(\*.*?\*\)|\s+|(?P<number>\d+#[0-9A-Fa-f]+|[A-Z]+#\d+|\d+\.\d+(?:[eE][+-]?\d+)?|\d+)|(?P<word>[A-Za-z_]\w*)"
    r"|(?P<sign>:=|<>|<=|>=|\.\.|[-+*/=<>()\[\],;:.])",
    re.DOTALL,
)
SIZES = {"BOOL": 1, "WORD": 16, "UINT": 16, "INT": -16, "DWORD": 32, "UDINT": 32, "DINT": -32}
WORDS = {"AND": "&", "OR": "|", "XOR": "^", "MOD": "%", "NOT": "_not"}
CONVERT = re.compile(r"([A-Z]+)_TO_([A-Z]+)$")


def wrap(kind: str, value: Any) -> Any:
    """`value` as a variable of type `kind` holds it."""
    if kind in ("REAL", "LREAL"):
        return unpack(">f", pack(">f", value))[0] if kind == "REAL" else float(value)
    if kind == "BOOL":
        return bool(value)
    size = SIZES.get(kind)
    if size is None:
        return value
    bits = abs(size)
    value = int(value) & ((1 << bits) - 1)
    return value - (1 << bits) if size < 0 and value >> (bits - 1) else value


class Parser:
    """One token after the other."""

    def __init__(self, text: str) -> None:
        self.tokens: list[str] = []
        at = 0
        while at < len(text):
            found = TOKEN.match(text, at)
            assert found, f"not structured text: {text[at : at + 40]!r}"
            if found.lastgroup:
                self.tokens.append(found[0])
            at = found.end()
        self.at = 0

    def peek(self, ahead: int = 0) -> str:
        return self.tokens[self.at + ahead] if self.at + ahead < len(self.tokens) else ""

    def take(self, *wanted: str) -> str:
        token = self.peek()
        assert not wanted or token in wanted, (
            f"{token!r}: expected {wanted} before {' '.join(self.tokens[self.at : self.at + 8])}"
        )
        self.at += 1
        return token

    def has(self, token: str) -> bool:
        if self.peek() == token:
            self.at += 1
            return True
        return False


class Program:
    """All blocks of some files."""

    def __init__(self, *paths: Path) -> None:
        self.types: dict[str, dict[str, Any]] = {}
        self.unions: set[str] = set()
        self.blocks: dict[str, Block] = {}
        for path in paths:
            parser = Parser(path.read_text("utf-8"))
            while parser.peek():
                word = parser.take("TYPE", "FUNCTION", "FUNCTION_BLOCK")
                name = parser.take()
                if word == "TYPE":
                    self._type(parser, name)
                else:
                    self.blocks[name] = Block(self, parser, name, word)

    def new(self, name: str) -> "Instance":
        """An instance of a function block."""
        return Instance(self.blocks[name])

    def initial(self, kind: Any) -> Any:
        """The first value of a variable of a type."""
        if isinstance(kind, tuple):
            low, high, of = kind
            return (
                {n: self.initial(of) for n in range(low, high + 1)} if high < 1000 else [self.initial(of)] * (high + 1)
            )
        if kind in self.types:
            union = kind in self.unions
            return (
                Union()
                if union
                else SimpleNamespace(**{name: self.initial(of) for name, of in self.types[kind].items()})
            )
        if kind in self.blocks:
            return self.new(kind)
        return {"REAL": 0.0, "LREAL": 0.0, "BOOL": False}.get(kind, 0)

    def call(self, name: str, given: Mapping[str, Any]) -> Any:
        """A function."""
        instance = self.new(name)
        return instance(**given)

    def _type(self, parser: Parser, name: str) -> None:
        parser.take(":")
        if parser.take("STRUCT", "UNION") == "UNION":
            self.unions.add(name)
        members: dict[str, Any] = {}
        while parser.peek() not in ("END_STRUCT", "END_UNION"):
            member = parser.take()
            parser.take(":")
            members[member] = kind_of(parser)
            parser.take(";")
        parser.take()
        parser.take("END_TYPE")
        self.types[name] = members


class Union:
    """A REAL and its bits."""

    bits = 0

    @property
    def Bits(self) -> int:
        return self.bits

    @Bits.setter
    def Bits(self, value: int) -> None:
        self.bits = value

    @property
    def Number(self) -> float:
        return float(unpack(">f", pack(">I", self.bits))[0])

    @Number.setter
    def Number(self, value: float) -> None:
        self.bits = unpack(">I", pack(">f", value))[0]


def kind_of(parser: Parser) -> Any:
    word = parser.take()
    if word != "ARRAY":
        return word
    parser.take("[")
    low = int(parser.take())
    parser.take("..")
    high = int(parser.take())
    parser.take("]")
    parser.take("OF")
    return low, high, kind_of(parser)


class Block:
    """A function or a function block as Python."""

    def __init__(self, program: Program, parser: Parser, name: str, word: str) -> None:
        self.program, self.name, self.function = program, name, word == "FUNCTION"
        self.kinds: dict[str, Any] = {}
        self.first: dict[str, str] = {}
        self.by_reference: set[str] = set()
        if parser.has(":"):
            self.kinds[name] = parser.take()
        while parser.peek().startswith("VAR"):
            section = parser.take()
            if parser.peek() in ("RETAIN", "CONSTANT"):
                parser.take()
            while not parser.has("END_VAR"):
                variable = parser.take()
                parser.take(":")
                self.kinds[variable] = kind_of(parser)
                if section == "VAR_IN_OUT":
                    self.by_reference.add(variable)
                if parser.has(":="):
                    self.first[variable] = self.expression(parser)
                parser.take(";")
        lines = ["def body(self, p):", *self.statements(parser, f"END_{word}", 1), "    return"]
        parser.take(f"END_{word}")
        scope: dict[str, Any] = {
            "wrap": wrap,
            "SQRT": math.sqrt,
            "ABS": abs,
            "MIN": min,
            "MAX": max,
            "_not": _not,
            "_div": _div,
        }
        exec(compile("\n".join(lines), name, "exec"), scope)
        self.body = scope["body"]
        self.scope = scope

    def statements(self, parser: Parser, ends: str, depth: int) -> list[str]:
        pad, found = "    " * depth, ["    " * depth + "pass"]
        stops = {ends, "ELSE", "ELSIF"} if ends == "END_IF" else {ends}
        while parser.peek() not in stops:
            if parser.has("IF"):
                found.append(f"{pad}if {self.expression(parser)}:")
                parser.take("THEN")
                found += self.statements(parser, "END_IF", depth + 1)
                while not parser.has("END_IF"):
                    if parser.take("ELSE", "ELSIF") == "ELSE":
                        found.append(f"{pad}else:")
                    else:
                        found.append(f"{pad}elif {self.expression(parser)}:")
                        parser.take("THEN")
                    found += self.statements(parser, "END_IF", depth + 1)
            elif parser.has("FOR"):
                found += self._loop(parser, depth)
            elif parser.has("RETURN"):
                parser.take(";")
                found.append(f"{pad}return")
            else:
                found.append(pad + self._statement(parser))
        return found

    def _loop(self, parser: Parser, depth: int) -> list[str]:
        pad, variable = "    " * depth, parser.take()
        parser.take(":=")
        first = self.expression(parser)
        parser.take("TO")
        last = self.expression(parser)
        step = self.expression(parser) if parser.has("BY") else "1"
        parser.take("DO")
        lines = self.statements(parser, "END_FOR", depth + 1)
        parser.take("END_FOR")
        return [f"{pad}for self.{variable} in range({first}, {last} + (1 if {step} > 0 else -1), {step}):", *lines]

    def _statement(self, parser: Parser) -> str:
        if parser.peek(1) == "(" and parser.peek() in self.kinds:
            name = parser.take()
            text = f"self.{name}({self._arguments(parser)})"
        else:
            target, kind = self._variable(parser)
            parser.take(":=")
            text = f"{target} = wrap({kind!r}, {self.expression(parser)})"
        parser.take(";")
        return text

    def _variable(self, parser: Parser) -> tuple[str, Any]:
        name = parser.take()
        assert name in self.kinds, f"{self.name}: {name} is not declared"
        text, kind = f"self.{name}", self.kinds[name]
        while parser.peek() in (".", "["):
            if parser.has("["):
                text += f"[{self.expression(parser)}]"
                parser.take("]")
                kind = kind[2]
            else:
                parser.take(".")
                member = parser.take()
                text += f".{member}"
                kind = self.program.types[kind][member] if kind in self.program.types else None
        return text, kind

    # expressions, by rank: OR, XOR, AND, comparison, sum, product, sign

    RANKS = (("OR",), ("XOR",), ("AND",), ("=", "<>", "<", ">", "<=", ">="), ("+", "-"), ("*", "/", "MOD"))

    def expression(self, parser: Parser, rank: int = 0) -> str:
        if rank == len(self.RANKS):
            return self._factor(parser)
        text = self.expression(parser, rank + 1)
        while parser.peek() in self.RANKS[rank]:
            sign = parser.take()
            other = self.expression(parser, rank + 1)
            python = {"=": "==", "<>": "!="}.get(sign, WORDS.get(sign, sign))
            text = f"_div({text}, {other})" if sign == "/" else f"({text} {python} {other})"
        return text

    def _factor(self, parser: Parser) -> str:
        if parser.has("-"):
            return f"(-{self._factor(parser)})"
        if parser.has("NOT"):
            return f"_not({self._factor(parser)})"
        if parser.has("("):
            text = self.expression(parser)
            parser.take(")")
            return f"({text})"
        word = parser.peek()
        if word[0].isdigit() or "#" in word:
            parser.take()
            base, _, digits = word.rpartition("#")
            return word if not base else str(int(digits, int(base) if base.isdigit() else 10))
        if word in ("TRUE", "FALSE"):
            return parser.take().capitalize()
        if parser.peek(1) == "(":
            return self._call(parser)
        return self._variable(parser)[0]

    def _call(self, parser: Parser) -> str:
        name = parser.take()
        if found := CONVERT.match(name):
            parser.take("(")
            text = self.expression(parser)
            parser.take(")")
            return f"wrap({found[2]!r}, {text})"
        if name in ("SHR", "SHL"):
            parser.take("(")
            first = self.expression(parser)
            parser.take(",")
            second = self.expression(parser)
            parser.take(")")
            return f"wrap('DWORD', {first} {'>>' if name == 'SHR' else '<<'} {second})"
        if name in ("SQRT", "ABS", "MIN", "MAX"):
            parser.take("(")
            parts = [self.expression(parser)]
            while parser.has(","):
                parts.append(self.expression(parser))
            parser.take(")")
            return f"{name}({', '.join(parts)})"
        assert name.startswith("Pogon"), name
        return f"p.call({name!r}, dict({self._arguments(parser)}))"

    def _arguments(self, parser: Parser) -> str:
        parser.take("(")
        parts = []
        while not parser.has(")"):
            name = parser.take()
            parser.take(":=")
            parts.append(f"{name}={self.expression(parser)}")
            parser.has(",")
        return ", ".join(parts)


class Instance:
    """A function block with its variables; called with its inputs."""

    def __init__(self, block: Block) -> None:
        object.__setattr__(self, "_block", block)
        for name, kind in block.kinds.items():
            setattr(self, name, None if name in block.by_reference else block.program.initial(kind))
        for name, text in block.first.items():
            setattr(self, name, wrap(block.kinds[name], eval(text, block.scope)))

    def __call__(self, **given: Any) -> Any:
        block: Block = self._block  # type: ignore[attr-defined]
        for name, value in given.items():
            kind = block.kinds[name]
            setattr(self, name, wrap(kind, value) if isinstance(kind, str) else value)
        block.body(self, block.program)
        return getattr(self, block.name) if block.function else None


def _not(value: Any) -> Any:
    return not value if isinstance(value, bool) else ~value


def _div(one: Any, other: Any) -> Any:
    return int(one / other) if isinstance(one, int) and isinstance(other, int) else one / other
