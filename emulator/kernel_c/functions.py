"""Translate the kernel's functions to C: signatures, statements, docstrings and comments."""

import ast
from collections.abc import Iterator
from functools import cache, cached_property
from typing import Final

from steptwin.emulator.kernel_c.expressions import BOOL, CValue, Expressions, Scope, TranslationError
from steptwin.emulator.kernel_c.ranges import Range, promised
from steptwin.emulator.kernel_c.source import PUBLIC, RECORD_OF, Source, width_of

_WIDTH: Final = 110
_ROUNDS: Final = 4
"""Rounds in which the ranges of variables without a promise must settle; a growing one needs a promise."""
COUNT: Final = "axis_count"
"""The parameter that says how many records a copy of all axes copies."""


def comment(text: str, indent: str = "") -> list[str]:
    """Write a text as a C comment; its paragraphs and indented lines stay."""
    lines = [line.rstrip() for line in text.strip().splitlines()]
    if len(lines) == 1 and len(lines[0]) <= _WIDTH:
        return [f"{indent}/* {lines[0]} */"]
    body = [f"{indent} * {line}".rstrip() for line in lines]
    return [f"{indent}/*", *body, f"{indent} */"]


def wrapped(text: str) -> list[str]:
    """Break a long list of parameters after its commas."""
    parts = text.split(", ")
    lines = [parts[0]]
    for part in parts[1:]:
        if len(lines[-1]) + len(part) + 2 > _WIDTH:
            lines[-1] += ","
            lines.append(part)
        else:
            lines[-1] += f", {part}"
    return lines


class Function:
    """One function of the kernel in C."""

    def __init__(self, source: Source, node: ast.FunctionDef, helpers: set[str]) -> None:
        self._source = source
        self._node = node
        self._helpers = helpers
        self._commented = node.lineno

    # --- signature

    @property
    def signature(self) -> str:
        """The declaration without a semicolon."""
        parameters = ", ".join(self._parameter(argument) for argument in self._node.args.args)
        static = "" if self._node.name in PUBLIC else "static "
        text = f"{static}{self._returned}st_{self._node.name}({parameters})"
        return "\n    ".join(wrapped(text))

    @property
    def documentation(self) -> list[str]:
        """The docstring as a comment."""
        return comment(ast.get_docstring(self._node) or "")

    @property
    def result_structure(self) -> list[str]:
        """The structure that a function with several results returns, or nothing."""
        if not isinstance(self._node.returns, ast.Subscript):
            return []
        members = [f"    {self._type(width)} {name};" for name, width in self._results()]
        return [
            f"/* What st_{self._node.name} returns. */",
            "typedef struct {",
            *members,
            f"}} st_{self._node.name}_result;",
        ]

    def _results(self) -> list[tuple[str, str]]:
        assert isinstance(self._node.returns, ast.Subscript)
        assert isinstance(self._node.returns.slice, ast.Tuple)
        widths = [width_of(part) or "" for part in self._node.returns.slice.elts]
        returned = next(part.value for part in ast.walk(self._node) if isinstance(part, ast.Return))
        assert isinstance(returned, ast.Tuple)
        return list(zip([ast.unparse(part) for part in returned.elts], widths, strict=True))

    @property
    def _returned(self) -> str:
        if isinstance(self._node.returns, ast.Subscript):
            return f"st_{self._node.name}_result "
        width = width_of(self._node.returns)
        return f"{self._type(width)} " if width else "bool "

    @staticmethod
    def _type(width: str) -> str:
        return f"int{promised(width).bits}_t"

    def _parameter(self, argument: ast.arg) -> str:
        width = width_of(argument.annotation)
        if width:
            return f"{self._type(width)} {argument.arg}"
        kind = ast.unparse(argument.annotation) if argument.annotation else ""
        if kind == "Rows":
            return f"uint32_t *const *{argument.arg}"
        if kind == "Edges":
            return f"uint32_t *{argument.arg}"
        constant = "" if argument.arg in written(self._source, self._node.name) else "const "
        return f"{constant}st_{RECORD_OF[kind]} *{argument.arg}"

    # --- body

    def body(self) -> list[str]:
        """Return the lines of the body; raise TranslationError where the subset is left."""
        inferred: dict[str, Range] = {}
        for _ in range(_ROUNDS):
            before = dict(inferred)
            self._commented = self._node.body[0].end_lineno or 0
            lines = list(self._once(inferred))
            if inferred == before:
                return lines
        changing = sorted(name for name in inferred if inferred[name] != before.get(name))
        raise TranslationError(f"{self._node.name}: {', '.join(changing)} needs a promise")

    def _once(self, inferred: dict[str, Range]) -> Iterator[str]:
        self._inferred = inferred
        self._booleans = {
            part.targets[0].id
            for part in ast.walk(self._node)
            if isinstance(part, ast.Assign) and isinstance(part.targets[0], ast.Name)
            if isinstance(part.value, ast.Constant) and isinstance(part.value.value, bool)
        }
        parameters = self._node.args.args
        storage = {a.arg: ast.unparse(a.annotation) for a in parameters if a.annotation and not width_of(a.annotation)}
        self._scope = Scope(storage, {})
        for name, known in {**self._promises, **inferred}.items():
            self._scope.variables[name] = CValue(name, known, f"int{known.bits}_t", simple=True)
        for name in self._booleans:
            self._scope.variables[name] = CValue(name, Range(0, 1), BOOL, simple=True)
        self._expressions = Expressions(self._source, self._scope, self._helpers)
        self._declared = {argument.arg for argument in parameters}
        yield from self._block(self._node.body[1:], "    ")  # without the docstring

    @cached_property
    def _promises(self) -> dict[str, Range]:
        found = [(argument.arg, width_of(argument.annotation)) for argument in self._node.args.args]
        found += [
            (part.target.id, width_of(part.annotation))
            for part in ast.walk(self._node)
            if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)
        ]
        return {name: promised(width) for name, width in found if width}

    def _block(self, statements: list[ast.stmt], indent: str) -> Iterator[str]:
        for i, statement in enumerate(statements):
            yield from self._comments_before(statement.lineno, indent)
            for name in self._to_declare(statement, statements[i + 1 :]):
                self._declared.add(name)
                yield f"{indent}{self._variable_type(name)} {name};"
            lines = list(self._statement(statement, indent))
            trailing = self._source.comments.get(statement.lineno)
            if trailing and statement.lineno > self._commented:
                self._commented = statement.lineno
                yield from comment(trailing[1], indent)
            yield from lines

    def _to_declare(self, statement: ast.stmt, following: list[ast.stmt]) -> list[str]:
        """Return the variables that are assigned within a compound statement and used after it or in two branches."""
        if not isinstance(statement, ast.If | ast.While | ast.For):
            return []
        later = {part.id for node in following for part in ast.walk(node) if isinstance(part, ast.Name)}
        found = []
        for name in sorted(self._assigned(statement)):
            if name not in self._declared and name in later and name in self._promises | self._inferred:
                found.append(name)
        return found

    @staticmethod
    def _assigned(statement: ast.stmt) -> set[str]:
        return {
            part.id for part in ast.walk(statement) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
        }

    def _comments_before(self, line: int, indent: str) -> Iterator[str]:
        lines = [self._source.comments[at][1] for at in range(self._commented + 1, line) if at in self._source.comments]
        self._commented = max(self._commented, line - 1)
        if lines:
            yield from comment("\n".join(lines), indent)

    def _variable_type(self, name: str) -> str:
        known = self._scope.variables.get(name)
        return known.type if known else "int32_t"

    def _statement(self, node: ast.stmt, indent: str) -> Iterator[str]:
        match node:
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                yield from self._assign(name, value, indent)
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                yield from self._assign(name, value, indent)
            case ast.Assign(targets=[ast.Subscript(slice=ast.Slice()) as target], value=ast.Name(id=copied)):
                bytes_copied = f"(size_t){COUNT} * sizeof({copied}[0])"
                yield f"{indent}(void)memcpy({ast.unparse(target.value)}, {copied}, {bytes_copied});"
            case ast.Assign(targets=[ast.Subscript() as target], value=value):
                yield self._store(target, value, indent)
            case ast.AugAssign(target=ast.Name(id=name)):
                yield from self._assign(name, self._expanded(node), indent)
            case ast.AugAssign(target=ast.Subscript() as target):
                yield self._store(target, self._expanded(node), indent)
            case ast.Expr(value=ast.Call() as call):
                yield f"{indent}(void){self._expressions.value(call).text};"
            case ast.Return(value=ast.expr() as value):
                yield f"{indent}return {self._returned_text(value)};"
            case ast.If():
                yield from self._if(node, indent)
            case ast.While():
                yield f"{indent}while ({self._expressions.condition(node.test)}) {{"
                yield from self._scoped(node.body, indent)
                yield f"{indent}}}"
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=bounds)):
                yield from self._for(node, name, bounds, indent)
            case _:
                raise self._expressions.error(node, f"{ast.unparse(node)} is not translated")

    @staticmethod
    def _expanded(node: ast.AugAssign) -> ast.BinOp:
        """Write x += y as x + y."""
        read = ast.parse(ast.unparse(node.target), mode="eval").body
        return ast.copy_location(ast.BinOp(read, node.op, node.value), node)

    def _scoped(self, statements: list[ast.stmt], indent: str) -> Iterator[str]:
        """Translate a block whose declarations end with it."""
        outside = set(self._declared)
        yield from self._block(statements, indent + "    ")
        self._declared = outside

    def _assign(self, name: str, value: ast.expr, indent: str) -> Iterator[str]:
        promise = self._promises.get(name)
        found = self._expressions.value(value, promise)
        if promise is None and name not in self._booleans:
            self._inferred[name] = found.range.union(self._inferred.get(name, found.range))
            self._scope.variables.setdefault(name, CValue(name, found.range, f"int{found.range.bits}_t", simple=True))
        kind = self._variable_type(name)
        declared = "" if name in self._declared else f"{kind} "
        self._declared.add(name)
        yield f"{indent}{declared}{name} = {found.to(kind)};"

    def _store(self, target: ast.Subscript, value: ast.expr, indent: str) -> str:
        found = self._expressions.value(value)
        if isinstance(target.value, ast.Name) and self._scope.storage.get(target.value.id) == "Edges":
            index = self._expressions.value(target.slice)
            return f"{indent}{target.value.id}[{index.text}] = (uint32_t){found.operand};"
        text, member = self._expressions.cell(target)
        storage, _ = member.storage
        return f"{indent}{text} = {found.to(storage)};"

    def _returned_text(self, value: ast.expr) -> str:
        if isinstance(value, ast.Tuple):
            parts = [
                self._expressions.value(part).to(self._type(width))
                for part, (_, width) in zip(value.elts, self._results(), strict=True)
            ]
            return f"({self._returned.strip()}){{{', '.join(parts)}}}"
        found = self._expressions.value(value)
        return found.text if self._returned == "bool " else found.to(self._returned.strip())

    def _if(self, node: ast.If, indent: str, opening: str = "") -> Iterator[str]:
        yield f"{opening or indent}if ({self._expressions.condition(node.test)}) {{"
        yield from self._scoped(node.body, indent)
        if len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
            yield from self._if(node.orelse[0], indent, f"{indent}}} else ")
            return
        if node.orelse:
            yield f"{indent}}} else {{"
            yield from self._scoped(node.orelse, indent)
        yield f"{indent}}}"

    def _for(self, node: ast.For, name: str, bounds: list[ast.expr], indent: str) -> Iterator[str]:
        values = [self._expressions.value(bound) for bound in bounds]
        first, last = (CValue("0", Range(0, 0), "int32_t"), values[0]) if len(values) == 1 else values[:2]
        step = f"{name}++" if len(values) < 3 else f"{name} += {values[2].text}"
        covered = first.range.union(Range(last.range.low, last.range.high - 1))
        self._scope.variables[name] = CValue(name, covered, f"int{covered.bits}_t", simple=True)
        kind = f"int{covered.bits}_t"
        yield f"{indent}for ({kind} {name} = {first.text}; {name} < {last.operand}; {step}) {{"
        yield from self._scoped(node.body, indent)
        yield f"{indent}}}"


@cache
def written(source: Source, name: str) -> frozenset[str]:
    """Return the storage parameters that a function writes to, itself or through those that it calls."""
    function = source.functions[name]
    found = {
        part.value.id
        for part in ast.walk(function)
        if isinstance(part, ast.Subscript) and isinstance(part.ctx, ast.Store) and isinstance(part.value, ast.Name)
    }
    for call in (part for part in ast.walk(function) if isinstance(part, ast.Call) and isinstance(part.func, ast.Name)):
        called = source.functions.get(ast.unparse(call.func))
        if called:
            passed = zip(called.args.args, call.args, strict=True)
            found |= {ast.unparse(own) for parameter, own in passed if parameter.arg in written(source, called.name)}
    return frozenset(found)
