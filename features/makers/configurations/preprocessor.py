"""Read the defines of C headers as the preprocessor leaves them, and evaluate those that are numbers."""

import ast
import operator
import re
from collections.abc import Callable, Iterator
from math import pi
from typing import Any, Final

from steptwin.features.makers.configurations.machine import Figure
from steptwin.host.common.bad_input import prefixed, shortened
from steptwin.host.common.errors import InputError

_EXPRESSION_CHARS_MAX: Final = 500
_DEPTH_MAX: Final = 20
"""Names that stand for expressions with names, and so on, at most."""
_DEFINE: Final = re.compile(r"#\s*define\s+(\w+)(?!\()\s*(.*)")
_DIRECTIVE: Final = re.compile(r"#\s*(if|ifdef|ifndef|elif|else|endif)\b\s*(.*)")
_TERNARY: Final = re.compile(r"\(?([^?:]+)\?([^?:]+):([^?:]+?)\)?")
_OPERATIONS: Final[dict[type, Callable[..., Any]]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.UAdd: operator.pos, ast.USub: operator.neg, ast.Not: operator.not_,
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}  # fmt: skip
_TESTS: Final[dict[str, Callable[[list[bool]], bool]]] = {
    "ENABLED": all, "ALL": all, "BOTH": all, "defined": all, "ANY": any, "EITHER": any,
    "DISABLED": lambda there: not any(there), "NONE": lambda there: not any(there),
}  # fmt: skip
"""Marlin's macros that ask which names are defined, by what they say of it."""


class Defines:
    """The defines of headers, in the order in which they are read.

    Attributes:
        texts: what stands behind each name.
    """

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}

    def read(self, text: str) -> None:
        """Read a header; conditions are evaluated by what has been defined so far."""
        branches: list[tuple[bool, bool]] = []  # of each open #if: whether this branch holds, whether one has held
        for line in _lines(text):
            if directive := _DIRECTIVE.match(line):
                self._branch(branches, directive[1], directive[2])
            elif all(holds for holds, _ in branches) and (define := _DEFINE.match(line)):
                self.texts[define[1]] = define[2].strip()

    def _branch(self, branches: list[tuple[bool, bool]], word: str, condition: str) -> None:
        if word in ("if", "ifdef", "ifndef"):
            here = all(holds for holds, _ in branches)
            holds = here and (
                self.holds(condition) if word == "if" else (condition.strip() in self.texts) == (word == "ifdef")
            )
            branches.append((holds, holds))
        elif branches:
            _, once = branches.pop()
            if word != "endif":
                here = all(holds for holds, _ in branches)
                holds = here and not once and (word == "else" or self.holds(condition))
                branches.append((holds, once or holds))

    def has(self, name: str) -> bool:
        """Return whether a name is defined, and not as false."""
        return self.texts.get(name, "0") not in ("false", "0")

    def holds(self, condition: str) -> bool:
        """Return whether a condition holds; one that is not understood does not."""
        text = re.sub(r"!(?!=)", " not ", condition.replace("&&", " and ").replace("||", " or "))
        try:
            return bool(self._value(text, in_condition=True))
        except (InputError, TypeError):
            return False

    def figure(self, name: str, factor: float = 1.0) -> Figure | None:
        """Return a number; None if the name is not defined. Raises InputError for what is not understood."""
        text = self.texts.get(name)
        return None if not text else self.figure_of(name, text, factor)

    def figures(self, name: str, factor: float = 1.0) -> list[Figure]:
        """Return the numbers of a list in braces, none if it is not defined; raises as `figure`."""
        text = self.texts.get(name)
        if not text:
            return []
        if not text.startswith("{"):
            raise InputError(f"{name}: {shortened(text)!r} is no list, as in {{ 80, 80, 400 }}")
        parts = re.split(r",(?![^()]*\))", text.strip("{} "))
        return [self.figure_of(name, part.strip(), factor) for part in parts if part.strip()]

    def figure_of(self, name: str, text: str, factor: float) -> Figure:
        """Return the number of an expression behind a name."""
        with prefixed(f"{name}: "):
            value = self._value(text)
            if isinstance(value, str):
                raise InputError(f"{shortened(text)!r} is no number")
            return Figure(float(value) * factor, f"{name} {shortened(text)}")

    def _value(self, text: str, depth: int = 0, *, in_condition: bool = False) -> Any:
        if len(text) > _EXPRESSION_CHARS_MAX or depth > _DEPTH_MAX:
            raise InputError(f"{shortened(text)!r} is too long an expression")
        if ternary := _TERNARY.fullmatch(text.strip()):
            return self._value(ternary[2 if self.holds(ternary[1]) else 3], depth + 1)
        plain = re.sub(r"(?<=[\d.])[fFuUlL]+\b", "", text).strip()
        try:
            tree = ast.parse(plain, mode="eval").body
        except SyntaxError:
            raise InputError(f"{shortened(text)!r} is not understood") from None
        return _Evaluation(self, depth, in_condition=in_condition).visit(tree)

    def value_of(self, name: str, depth: int, *, in_condition: bool) -> Any:
        """Return the value of a name: in conditions one without a value is true, and an unknown one is 0."""
        text = self.texts.get(name)
        if text in ("true", "false"):
            return text == "true"
        if text:
            return self._value(text, depth + 1, in_condition=in_condition)
        if not in_condition:
            raise InputError(f"{shortened(name)!r} is not understood")
        return 0 if text is None else 1


class _Evaluation(ast.NodeVisitor):
    """Evaluates an expression of + - * / ( ), comparisons, names and tests of names."""

    def __init__(self, defines: Defines, depth: int, *, in_condition: bool) -> None:
        self._defines = defines
        self._depth = depth
        self._in_condition = in_condition

    def generic_visit(self, node: ast.AST) -> Any:
        raise InputError(f"{shortened(ast.unparse(node))!r} is not understood")

    def visit_Constant(self, node: ast.Constant) -> Any:
        return node.value if isinstance(node.value, int | float) else self.generic_visit(node)

    def visit_Name(self, node: ast.Name) -> Any:
        if node.id in ("true", "false"):
            return node.id == "true"
        if node.id == "M_PI":
            return pi
        return self._defines.value_of(node.id, self._depth, in_condition=self._in_condition)

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        return self._operate(node, node.op, node.left, node.right)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        return self._operate(node, node.op, node.operand)

    def visit_Compare(self, node: ast.Compare) -> Any:
        return self._operate(node, node.ops[0], node.left, *node.comparators)

    def visit_BoolOp(self, node: ast.BoolOp) -> Any:
        join = all if isinstance(node.op, ast.And) else any
        return join([bool(self.visit(each)) for each in node.values])

    def visit_Call(self, node: ast.Call) -> Any:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        there = [isinstance(each, ast.Name) and self._defines.has(each.id) for each in node.args]
        if name == "TERN" and len(node.args) == 3:
            return self.visit(node.args[1 if there[0] else 2])
        return _TESTS[name](there) if name in _TESTS else self.generic_visit(node)

    def _operate(self, node: ast.AST, operation: ast.AST, *operands: ast.expr) -> Any:
        operate = _OPERATIONS.get(type(operation))
        if operate is None or len(operands) > 2:
            return self.generic_visit(node)
        try:
            return operate(*map(self.visit, operands))
        except ZeroDivisionError:
            raise InputError(f"{shortened(ast.unparse(node))!r} divides by 0") from None


def _lines(text: str) -> Iterator[str]:
    """Yield a header's lines without comments, continued ones as one."""
    text = re.sub(r"/\*.*?\*/", " ", re.sub(r"\\\r?\n", " ", text), flags=re.DOTALL)
    for line in text.splitlines():
        yield line.partition("//")[0].strip()
