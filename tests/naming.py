"""Find the tests that cannot run without something that they name, such as the robots of a feature.

A test names it in its own text or in what it uses: functions, constants and fixtures of its module, of its helpers and
of the files conftest.py above it. Docstrings do not count. A module whose import would fail is left out as a whole.
"""

import ast
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self


@dataclass(frozen=True, slots=True)
class _Text:
    """A part of a module: whether its constants and imports match the pattern, and the identifiers in it."""

    matches: bool
    identifiers: frozenset[str]

    @classmethod
    def of(cls, node: ast.AST, pattern: re.Pattern[str]) -> Self:
        parts = list(ast.walk(node))
        docs = {id(part.value) for part in parts if isinstance(part, ast.Expr)}
        texts = [part.value for part in parts if isinstance(part, ast.Constant) and id(part) not in docs]
        texts += [f"{part.module}." for part in parts if isinstance(part, ast.ImportFrom)]
        names = (getattr(part, key, None) for part in parts for key in ("id", "attr", "arg"))
        matches = any(isinstance(text, str) and pattern.search(text) for text in texts)
        return cls(matches, frozenset(name for name in names if isinstance(name, str)))

    def names(self, unusable: set[str]) -> bool:
        return self.matches or not unusable.isdisjoint(self.identifiers)


@dataclass(frozen=True, slots=True)
class _Statement:
    """A statement of a module or class.

    Attributes:
        text: its text.
        defines: the names that it defines.
        calls: calls by an import of the module, other than those of pytest, which do nothing then.
        parts: the statements of a class of tests.
    """

    text: _Text
    defines: frozenset[str]
    calls: Sequence[_Text]
    parts: "Sequence[_Statement]" = ()

    @classmethod
    def of(cls, node: ast.stmt, pattern: re.Pattern[str]) -> Self:
        executed: Sequence[ast.AST] = (
            node.decorator_list if isinstance(node, ast.ClassDef | ast.FunctionDef) else [node]
        )
        calls = [part for each in executed for part in ast.walk(each) if isinstance(part, ast.Call)]
        parts = node.body if isinstance(node, ast.ClassDef) and node.name.startswith("Test") else []
        stored = (part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store))
        return cls(
            _Text.of(node, pattern),
            frozenset([node.name] if isinstance(node, ast.ClassDef | ast.FunctionDef) else stored),
            [_Text.of(call, pattern) for call in calls if not _of_pytest(call.func)],
            [cls.of(part, pattern) for part in parts],
        )


def _of_pytest(function: ast.expr) -> bool:
    while isinstance(function, ast.Attribute):
        function = function.value
    return isinstance(function, ast.Name) and function.id == "pytest"


@dataclass(slots=True)
class _Module:
    """A module of tests: its imports and other statements, the names that cannot be used, and whether it is broken."""

    path: Path
    imports: Sequence[ast.ImportFrom]
    statements: Sequence[_Statement]
    unusable: set[str] = field(default_factory=set)
    is_broken: bool = False


def tests_naming(pattern: re.Pattern[str], root: Path) -> Iterator[str]:
    """Yield the tests that name something or use what names it: folders, files and node ids of pytest."""
    modules: dict[str, _Module] = {}
    for path in (file.relative_to(root) for file in sorted((root / "tests").rglob("*.py"))):
        body = ast.parse((root / path).read_bytes()).body
        imports = [each for each in body if isinstance(each, ast.ImportFrom)]
        others = [_Statement.of(each, pattern) for each in body if not isinstance(each, ast.Import | ast.ImportFrom)]
        modules[".".join(path.with_suffix("").parts)] = _Module(path, imports, others)
    while sum(_spread(module, modules, pattern) for module in modules.values()):
        pass
    for module in modules.values():
        path = module.path
        if module.is_broken and path.name == "conftest.py":
            yield path.parent.as_posix()
        elif module.is_broken and path.name.startswith("test_"):
            yield path.as_posix()
        elif path.name.startswith("test_"):
            unusable = _unusable(module, modules)
            yield from (f"{path.as_posix()}::{test}" for test in _tests(module.statements, unusable))


def _spread(module: _Module, modules: dict[str, _Module], pattern: re.Pattern[str]) -> bool:
    """Find what cannot be used in a module by what is known of others; return whether there is more than before."""
    before = len(module.unusable), module.is_broken
    for imported in module.imports:
        source = modules.get(imported.module or "")
        module.is_broken |= bool(pattern.search(f"{imported.module}.")) or (source is not None and source.is_broken)
        if source is not None:
            module.unusable |= {each.asname or each.name for each in imported.names if each.name in source.unusable}
    for statement in module.statements:
        unusable = _unusable(module, modules)
        module.is_broken |= any(call.names(unusable) for call in statement.calls)
        if statement.text.names(unusable) and not statement.parts:
            module.unusable |= statement.defines
    return (len(module.unusable), module.is_broken) != before


def _unusable(module: _Module, modules: dict[str, _Module]) -> set[str]:
    """Return the names that cannot be used in a module, with those of fixtures in the files conftest.py above it."""
    above = (modules.get(".".join((*folder, "conftest"))) for folder in _folders(module.path))
    return module.unusable.union(*(each.unusable for each in above if each is not None))


def _folders(path: Path) -> Iterator[Sequence[str]]:
    """Return the folders from that of all tests to that of a file, each by its parts."""
    return (path.parts[:count] for count in range(1, len(path.parts)))


def _tests(statements: Sequence[_Statement], unusable: set[str]) -> Iterator[str]:
    """Yield the tests among statements that name something; of a class, those of its methods or the whole class."""
    for statement in statements:
        (name,) = statement.defines if len(statement.defines) == 1 else ("",)
        if statement.parts:
            own = set(unusable)
            while new := {each for part in statement.parts if part.text.names(own) for each in part.defines} - own:
                own |= new
            found = list(_tests([part for part in statement.parts if not part.parts], own))
            yield from (f"{name}::{each}" for each in found)
        elif name.startswith("test_") and statement.text.names(unusable):
            yield name
