"""Translate expressions of the kernel's integer subset, each with the range of its values.

Arithmetic is done in 32 bits where operands and result fit, else in 64; what does not fit 64 is an error. So nothing
overflows as long as the promises hold. C's and Python's operators differ where values are negative: `//` rounds down,
`<<` is a product there, and `>>` is C's only because a static assertion demands it.
"""

import ast
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from steptwin.emulator.kernel_c.ranges import Range, corners, promised
from steptwin.emulator.kernel_c.source import RECORD_OF, Source, width_of

BOOL: Final = "bool"
_TRUTH: Final = Range(0, 1)
_COMPARISONS: Final = {ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}


class TranslationError(Exception):
    """The kernel's source leaves the subset that can be translated; the message names line and reason."""


@dataclass(frozen=True, slots=True)
class CValue:
    """A translated expression: its text, its range, and its type in C: bool, int32_t or int64_t."""

    text: str
    range: Range
    type: str
    simple: bool = False
    """True if the text needs no parentheses within a larger expression."""

    @property
    def operand(self) -> str:
        """The text as an operand."""
        return self.text if self.simple else f"({self.text})"

    def to(self, type_name: str) -> str:
        """Return the text converted to a C type: explicitly where C would narrow."""
        if type_name == self.type or (type_name == "int64_t" and self.type != BOOL):
            return self.text
        return f"({type_name}){self.operand}"


@dataclass(slots=True, eq=False)
class Scope:
    """What is known within a function: the kinds of its storage parameters and the ranges of its variables."""

    storage: dict[str, str]
    variables: dict[str, CValue]


class Expressions:
    """Translates the expressions of one function, and collects the helpers that they need."""

    def __init__(self, source: Source, scope: Scope, helpers: set[str]) -> None:
        self._source = source
        self._scope = scope
        self._helpers = helpers
        self._by_node: dict[type[ast.expr], Callable[..., CValue]] = {
            ast.Constant: self._constant,
            ast.Name: self._name,
            ast.BinOp: self._binary,
            ast.UnaryOp: self._unary,
            ast.BoolOp: self._logical,
            ast.Compare: self._compare,
            ast.IfExp: self._choice,
            ast.Subscript: self._cell,
            ast.Call: self._call,
        }
        self._by_operator: dict[type[ast.operator], Callable[[CValue, CValue, Range | None], CValue | None]] = {
            ast.Add: self._sum,
            ast.Sub: self._difference,
            ast.Mult: self._product,
            ast.LShift: self._left_shift,
            ast.RShift: self._right_shift,
            ast.BitAnd: self._and,
            ast.BitXor: self._exclusive_or,
            ast.FloorDiv: self._quotient,
            ast.Mod: self._remainder,
        }

    def value(self, node: ast.expr, promise: Range | None = None) -> CValue:
        """Translate an expression; a promise about its value bounds the outermost operation."""
        translate = self._by_node.get(type(node))
        if translate is None:
            raise self.error(node, f"{type(node).__name__} is not translated")
        try:
            if isinstance(node, ast.BinOp):
                return self._binary(node, promise)
            return translate(node)
        except OverflowError as error:
            raise self.error(node, f"{ast.unparse(node)}: {error}; promise the width of a part of it") from error

    @staticmethod
    def error(node: ast.AST, reason: str) -> TranslationError:
        """Return an error that names the line."""
        return TranslationError(f"kernel.py, line {getattr(node, 'lineno', 0)}: {reason}")

    def condition(self, node: ast.expr) -> str:
        """Translate a condition."""
        value = self.value(node)
        return value.text if value.type == BOOL else f"{value.operand} != 0"

    def _constant(self, node: ast.Constant) -> CValue:
        if isinstance(node.value, bool):
            return CValue("true" if node.value else "false", _TRUTH, BOOL, simple=True)
        if not isinstance(node.value, int):
            raise self.error(node, f"{node.value!r} is no integer")
        known = Range(node.value, node.value)
        if known.bits == 64:
            return CValue(f"INT64_C({node.value})", known, "int64_t", simple=True)
        return CValue(str(node.value), known, "int32_t", simple=True)

    def _name(self, node: ast.Name) -> CValue:
        if node.id in self._scope.variables:
            return self._scope.variables[node.id]
        if node.id in self._source.constants:
            value = self._source.constants[node.id]
            known = Range(value, value)
            return CValue(f"ST_{node.id}", known, f"int{known.bits}_t", simple=True)
        raise self.error(node, f"{node.id} is not known here")

    def _binary(self, node: ast.BinOp, promise: Range | None = None) -> CValue:
        if isinstance(node.op, ast.Mult) and isinstance(node.right, ast.Name) and node.right.id.endswith("_FIELDS"):
            return self.value(node.left)  # the index of a record, not of its first cell
        combine = self._by_operator.get(type(node.op))
        found = combine(self.value(node.left), self.value(node.right), promise) if combine else None
        if found is None:
            raise self.error(node, f"{ast.unparse(node)} is not translated for these ranges")
        return found

    def _sum(self, left: CValue, right: CValue, promise: Range | None) -> CValue:
        a, b = left.range, right.range
        return self._arithmetic("+", left, right, Range(a.low + b.low, a.high + b.high), promise)

    def _difference(self, left: CValue, right: CValue, promise: Range | None) -> CValue:
        a, b = left.range, right.range
        return self._arithmetic("-", left, right, Range(a.low - b.high, a.high - b.low), promise)

    def _product(self, left: CValue, right: CValue, promise: Range | None) -> CValue:
        return self._arithmetic("*", left, right, corners(left.range, right.range), promise)

    def _left_shift(self, left: CValue, right: CValue, promise: Range | None) -> CValue | None:
        if right.range.low != right.range.high:
            return None
        factor = 1 << right.range.low
        result = corners(left.range, Range(factor, factor))
        if left.range.low >= 0:
            return self._arithmetic("<<", left, right, result, promise)
        return self._arithmetic("*", left, self._constant(ast.Constant(factor)), result, promise)

    @staticmethod
    def _right_shift(left: CValue, right: CValue, _promise: Range | None) -> CValue | None:
        if right.range.low != right.range.high:
            return None
        shifted = Range(left.range.low >> right.range.low, left.range.high >> right.range.low)
        return CValue(f"{left.operand} >> {right.operand}", shifted, left.type)

    def _and(self, left: CValue, right: CValue, _promise: Range | None) -> CValue | None:
        """Translate `&` with a mask that is never negative."""
        a, mask = left.range, right.range
        if mask.low < 0:
            return None
        return self._arithmetic("&", left, right, Range(0, min(mask.high, a.high) if a.low >= 0 else mask.high), None)

    def _exclusive_or(self, left: CValue, right: CValue, _promise: Range | None) -> CValue | None:
        if min(left.range.low, right.range.low) < 0:
            return None
        bits = max(left.range.high, right.range.high).bit_length()
        return self._arithmetic("^", left, right, Range(0, (1 << bits) - 1), None)

    @staticmethod
    def _remainder(left: CValue, right: CValue, _promise: Range | None) -> CValue | None:
        if left.range.low < 0 or right.range.low < 0 or not left.range.bits == right.range.bits == 32:
            return None
        return CValue(f"{left.operand} % {right.operand}", Range(0, right.range.high - 1), "int32_t")

    @staticmethod
    def _arithmetic(sign: str, left: CValue, right: CValue, result: Range, promise: Range | None) -> CValue:
        if promise is not None:
            result = Range(max(result.low, promise.low), min(result.high, promise.high))
        wide = "int64_t" in (left.type, right.type) or result.bits == 64
        first = left.operand
        if wide and left.type != "int64_t" and (right.type != "int64_t" or sign == "<<"):
            first = f"(int64_t){left.operand}"
        return CValue(f"{first} {sign} {right.operand}", result, "int64_t" if wide else "int32_t")

    def _quotient(self, left: CValue, right: CValue, _promise: Range | None) -> CValue:
        a, b = left.range, right.range
        if b.low < 0 or b.high >= 1 << 31:
            raise OverflowError("the divisor may be negative or beyond 31 bits")
        # 0 is excluded by the kernel: no axis has a segment of no duration or a chord of length 0.
        least = max(b.low, 1)
        quotient = Range(min(a.low // least, a.low // b.high), max(a.high // least, a.high // b.high))
        if b.low == b.high and b.low & (b.low - 1) == 0:
            return CValue(f"{left.operand} >> {b.low.bit_length() - 1}", quotient, left.type)
        if a.low >= 0 and left.type == right.type == "int32_t":
            return CValue(f"{left.operand} / {right.operand}", quotient, "int32_t")
        divisor = f"(uint32_t){right.operand}"
        if a.low >= 0:
            text = f"(int64_t){self._need('st_divide')}((uint64_t){left.operand}, {divisor})"
        else:
            text = f"{self._need('st_floor_divide')}({left.text}, {divisor})"
        narrow = quotient.bits == 32
        return CValue(f"(int32_t){text}" if narrow else text, quotient, "int32_t" if narrow else "int64_t")

    def _need(self, helper: str) -> str:
        self._helpers.add(helper)
        return helper

    def _unary(self, node: ast.UnaryOp) -> CValue:
        if isinstance(node.op, ast.Not):
            inner = self.value(node.operand)
            return CValue(f"!{inner.operand}", _TRUTH, BOOL, simple=True)
        if isinstance(node.op, ast.USub):
            inner = self.value(node.operand)
            negated = Range(-inner.range.high, -inner.range.low)
            wide = inner.type == "int64_t" or negated.bits == 64
            cast = "(int64_t)" if wide and inner.type != "int64_t" else ""
            return CValue(f"-{cast}{inner.operand}", negated, "int64_t" if wide else "int32_t")
        raise self.error(node, f"{ast.unparse(node)} is not translated")

    def _logical(self, node: ast.BoolOp) -> CValue:
        sign = " && " if isinstance(node.op, ast.And) else " || "
        parts = [self.value(part) for part in node.values]
        texts = [part.operand if part.type == BOOL else f"({part.operand} != 0)" for part in parts]
        return CValue(sign.join(texts), _TRUTH, BOOL)

    def _compare(self, node: ast.Compare) -> CValue:
        left, right = self.value(node.left), self.value(node.comparators[0])
        if len(node.ops) != 1 or type(node.ops[0]) not in _COMPARISONS:
            raise self.error(node, f"{ast.unparse(node)} is not translated")
        return CValue(f"{left.operand} {_COMPARISONS[type(node.ops[0])]} {right.operand}", _TRUTH, BOOL)

    def _choice(self, node: ast.IfExp) -> CValue:
        first, second = self.value(node.body), self.value(node.orelse)
        kind = "int64_t" if "int64_t" in (first.type, second.type) else first.type
        text = f"{self.condition(node.test)} ? {first.operand} : {second.operand}"
        return CValue(text, first.range.union(second.range), kind)

    def _cell(self, node: ast.Subscript) -> CValue:
        text, member = self.cell(node)
        return CValue(text, member, f"int{member.bits}_t", simple=True)

    def cell(self, node: ast.Subscript) -> tuple[str, Range]:
        """Translate a cell, `axes[base + FIELD]` or `group[FIELD]`; return text and promise."""
        if not isinstance(node.value, ast.Name) or node.value.id not in self._scope.storage:
            raise self.error(node, f"{ast.unparse(node)} is no storage")
        record = RECORD_OF.get(self._scope.storage[node.value.id])
        field = node.slice.right if isinstance(node.slice, ast.BinOp) else node.slice
        if not isinstance(field, ast.Name) or field.id not in self._source.fields:
            raise self.error(node, f"{ast.unparse(node)} names no field")
        owner, member = self._source.fields[field.id]
        if owner != record:
            raise self.error(node, f"{field.id} is a field of {owner}, not of {record}")
        if isinstance(node.slice, ast.BinOp):
            return f"{node.value.id}[{self.value(node.slice.left).text}].{member.name}", member.range
        return f"{node.value.id}->{member.name}", member.range

    def _call(self, node: ast.Call) -> CValue:
        if not isinstance(node.func, ast.Name):
            raise self.error(node, f"{ast.unparse(node)} is not translated")
        name = node.func.id
        if name in {"int", "bool"}:
            return self.value(node.args[0])
        if name in {"min", "max"}:
            return self._extreme(name, [self.value(arg) for arg in node.args])
        if name == "abs":
            inner = self.value(node.args[0])
            size = max(abs(inner.range.low), abs(inner.range.high))
            bits = 64 if inner.type == "int64_t" or Range(-size, size).bits == 64 else 32
            return CValue(f"{self._need(f'st_abs_{bits}')}({inner.text})", Range(0, size), f"int{bits}_t", simple=True)
        return self._own_call(node, name)

    def _extreme(self, name: str, values: list[CValue]) -> CValue:
        found = values[0]
        pick = min if name == "min" else max
        for value in values[1:]:
            both = Range(pick(found.range.low, value.range.low), pick(found.range.high, value.range.high))
            kind = "int64_t" if "int64_t" in (found.type, value.type) else "int32_t"
            helper = self._need(f"st_{name}_{kind[3:5]}")
            found = CValue(f"{helper}({found.text}, {value.text})", both, kind, simple=True)
        return found

    def _own_call(self, node: ast.Call, name: str) -> CValue:
        function = self._source.functions.get(name)
        if function is None:
            raise self.error(node, f"{name} is not a function of the kernel")
        arguments = []
        for parameter, argument in zip(function.args.args, node.args, strict=True):
            width = width_of(parameter.annotation)
            if width:
                bits = promised(width).bits
                arguments.append(self.value(argument).to(f"int{bits}_t"))
            else:
                arguments.append(ast.unparse(argument))  # storage: the parameter, or a row of it
        text = f"st_{name}({', '.join(arguments)})"
        width = width_of(function.returns)
        if width:
            return CValue(text, promised(width), f"int{promised(width).bits}_t", simple=True)
        return CValue(text, _TRUTH, BOOL, simple=True)
