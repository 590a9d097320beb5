"""Run the kernel with its promises checked: every annotated width, at every assignment, argument, cell and return."""

import ast
from functools import cache
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import module_from_spec
from types import CodeType, ModuleType
from typing import Any, Final

from steptwin.controller.motion.backend import Kernel, python_kernel
from steptwin.emulator.kernel_c.ranges import promised
from steptwin.emulator.kernel_c.source import PATH, kernel_source, width_of

_CHECK: Final = "keep_promise"


def keep_promise(value: int, width: str, name: str) -> int:
    """Return the value; raise OverflowError if it is not what a width promises."""
    allowed = promised(width)
    if not allowed.low <= value <= allowed.high:
        raise OverflowError(f"{name} is {value}, but {width} promises {allowed.low} to {allowed.high}")
    return value


@cache
def checked_kernel() -> Kernel:
    """Return the kernel in plain Python with all promises checked."""
    module = _checked_module()
    plain = python_kernel()
    return Kernel(
        name="python",
        cells=plain.cells,
        rows=plain.rows,
        singly=plain.singly,
        push=module.push,
        next_segment=module.next_segment,
        advance=module.advance,
        demand_rate=module.demand_rate,
    )


def _checked_module() -> ModuleType:
    loader = _CheckingLoader("checked_kernel", str(PATH))
    module = module_from_spec(ModuleSpec(loader.name, loader, origin=str(PATH)))
    setattr(module, _CHECK, keep_promise)
    loader.exec_module(module)
    return module


class _CheckingLoader(SourceFileLoader):
    """Loads the kernel's source with checks in it."""

    def get_code(self, fullname: str) -> CodeType:
        """Compile the source instead of taking the compiled file, which has no checks."""
        del fullname
        return compile(
            ast.fix_missing_locations(_Checks().visit(ast.parse(PATH.read_text(encoding="utf-8")))), self.path, "exec"
        )


class _Checks(ast.NodeTransformer):
    """Puts a check around each value that an annotation makes a promise about."""

    def __init__(self) -> None:
        self._widths: dict[str, str] = {}
        self._fields = {
            node.target.id: width
            for node in kernel_source().tree.body
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
            if (width := width_of(node.annotation))
        }
        self._returned: list[str | None] = []

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        widths = [(arg.arg, width_of(arg.annotation)) for arg in node.args.args]
        widths += [
            (part.target.id, width_of(part.annotation))
            for part in ast.walk(node)
            if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)
        ]
        self._widths = {name: width for name, width in widths if width}
        results: list[ast.expr | None] = [node.returns]
        if isinstance(node.returns, ast.Subscript) and isinstance(node.returns.slice, ast.Tuple):
            results = [*node.returns.slice.elts]
        self._returned = [width_of(part) for part in results]
        checks = [
            ast.Expr(_check(ast.Name(arg.arg, ast.Load()), width, f"{node.name}: {arg.arg}"))
            for arg in node.args.args
            if (width := width_of(arg.annotation))
        ]
        self.generic_visit(node)
        node.body[:0] = checks
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AnnAssign:
        if node.value and self._widths:
            node.value = self._checked(node.target, node.value)
        return node

    def visit_Assign(self, node: ast.Assign) -> ast.Assign:
        if len(node.targets) == 1:
            node.value = self._checked(node.targets[0], node.value)
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> list[ast.stmt]:
        read: Any = ast.parse(ast.unparse(node.target), mode="eval").body
        return [node, ast.Expr(self._checked(node.target, read))]

    def visit_Return(self, node: ast.Return) -> ast.Return:
        if isinstance(node.value, ast.Tuple):
            parts = zip(node.value.elts, self._returned, strict=True)
            node.value.elts = [_check(part, width, "returned") if width else part for part, width in parts]
        elif node.value and self._returned[0]:
            node.value = _check(node.value, self._returned[0], "returned")
        return node

    def _checked(self, target: ast.expr, value: ast.expr) -> ast.expr:
        width = self._widths.get(target.id) if isinstance(target, ast.Name) else None
        if isinstance(target, ast.Subscript):
            field = target.slice.right if isinstance(target.slice, ast.BinOp) else target.slice
            width = self._fields.get(field.id) if isinstance(field, ast.Name) else None
        return _check(value, width, ast.unparse(target)) if width else value


def _check(value: ast.expr, width: str, name: str) -> ast.Call:
    return ast.Call(ast.Name(_CHECK, ast.Load()), [value, ast.Constant(width), ast.Constant(name)], [])
