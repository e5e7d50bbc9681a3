"""A sentence of the grammar (plant/expression.py) as people read it: names for points, words for numbers that have a word.

`drive_horizontal == 1 and pressure > 80` is told as `Travel drive: Ready and Hydraulic pressure > 80.0 bar`.
"""

import ast
from collections.abc import Callable, Mapping

from app.web import format as fmt
from app.web.points import PointView

Named = Callable[[str], tuple[str, PointView | None]]
"""A name of a sentence → what the point is called, with its machine where that is another one, and how it is drawn."""
Text = Callable[..., str]
SIGNS: Mapping[type[ast.AST], str] = {
    ast.Eq: "=", ast.NotEq: "≠", ast.Lt: "<", ast.LtE: "≤", ast.Gt: ">", ast.GtE: "≥",
    ast.Add: "+", ast.Sub: "\N{MINUS SIGN}", ast.Mult: "×", ast.Div: "÷",
}  # fmt: skip


def told(sentence: str, named: Named, text: Text, lang: str) -> str:
    """`sentence`, which the grammar has taken, in words; empty for none."""
    return _Teller(named, text, lang).told(ast.parse(sentence.strip(), mode="eval").body) if sentence.strip() else ""


class _Teller:
    def __init__(self, named: Named, text: Text, lang: str) -> None:
        self._named, self._text, self._lang = named, text, lang

    def told(self, node: ast.expr) -> str:
        """One part of a sentence that is true or not."""
        if isinstance(node, ast.BoolOp):
            word = self._text("sentence.and" if isinstance(node.op, ast.And) else "sentence.or")
            return f" {word} ".join(
                f"({self.told(one)})" if isinstance(one, ast.BoolOp) else self.told(one) for one in node.values
            )
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return self._text("sentence.not", what=self.told(node.operand))
        if isinstance(node, ast.Compare):
            return self._compared(node)
        if isinstance(node, ast.Name | ast.Attribute):
            label, point = self._named(ast.unparse(node))
            return f"{label}: {point.texts['1']}" if point and "1" in point.texts else label
        return self._amount(node, None)

    def _compared(self, node: ast.Compare) -> str:
        sides = [node.left, *node.comparators]
        point = next((found for side in sides if (found := self._point(side))), None)
        if len(node.ops) == 1 and isinstance(node.ops[0], ast.In | ast.NotIn | ast.Eq) and self._point(node.left):
            right = node.comparators[0]
            values = right.elts if isinstance(right, ast.Tuple) else [right]
            if isinstance(right, ast.Tuple) or (point and point.texts):
                said = " / ".join(self._amount(value, point) for value in values)
                line = f"{self._amount(node.left, None)}: {said}"
                return self._text("sentence.not", what=line) if isinstance(node.ops[0], ast.NotIn) else line
        parts = [self._amount(sides[0], point)]
        for sign, side in zip(node.ops, sides[1:], strict=True):
            parts += [SIGNS[type(sign)], self._amount(side, point)]
        return " ".join(parts)

    def _point(self, node: ast.expr) -> PointView | None:
        return self._named(ast.unparse(node))[1] if isinstance(node, ast.Name | ast.Attribute) else None

    def _amount(self, node: ast.expr, beside: PointView | None) -> str:
        """A number; beside a point that it is compared with in its word or its unit."""
        if isinstance(node, ast.Name | ast.Attribute):
            return self._named(ast.unparse(node))[0]
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            if beside is None:
                return f"{node.value:g}"
            word = beside.texts.get(f"{node.value:.15g}")
            return word or fmt.quantity(node.value, beside.decimals, beside.unit, self._lang)
        if isinstance(node, ast.UnaryOp):
            return f"\N{MINUS SIGN}{self._amount(node.operand, beside)}"
        if isinstance(node, ast.BinOp):
            return f"{self._amount(node.left, None)} {SIGNS[type(node.op)]} {self._amount(node.right, None)}"
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            said = [self._amount(one, beside) for one in node.args]
            if node.func.id == "abs":
                return f"|{said[0]}|"
            if node.func.id in ("good", "bad", "age"):
                return self._text(f"sentence.{node.func.id}", what=said[0])
            return f"{node.func.id}({'; '.join(said)})"
        return self.told(node)
