"""Rules about the code itself that no linter knows."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CONTROLLER = sorted((ROOT / "controller").rglob("*.py"))


def faults(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, float | complex):
            yield f"line {node.lineno}: the constant {node.value}"
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.Div):
            yield f"line {node.lineno}: a true division"
        if isinstance(node, ast.Name) and node.id == "float":
            yield f"line {node.lineno}: float"
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = {alias.name for alias in node.names} | {getattr(node, "module", None)}
            yield from (f"line {node.lineno}: imports {name}" for name in names & {"time", "math", "logging", "random"})


@pytest.mark.parametrize("path", CONTROLLER, ids=lambda path: path.name)
def test_firmware_has_no_floats_no_clock_and_no_log(path: Path) -> None:
    assert list(faults(ast.parse(path.read_text()))) == []


def test_the_check_itself_finds_floats() -> None:
    assert len(list(faults(ast.parse("import time\nx = 1.5\ny = x / 2\nx /= 2\nz = float(3)")))) == 5


def test_the_firmware_is_where_the_check_looks() -> None:
    assert {"kernel.py", "firmware.py", "axis_node.py"} <= {path.name for path in CONTROLLER}


def test_only_the_live_tests_start_servers() -> None:
    """The others are run on as many workers as cores, which would be idle while a server does its work."""
    starting = re.compile(r"^from tests\.end_to_end\.served import .*\b(Server|serving)\b", re.MULTILINE)
    tests = {path for path in (ROOT / "tests").rglob("test_*.py") if starting.search(path.read_text(encoding="utf-8"))}
    assert {path.parent.name for path in tests} == {"live"}


def printing(tree: ast.AST) -> Iterator[str]:
    """Yield the names that print: of typer and of Python."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in {"echo", "secho"}:
            yield f"line {node.lineno}: {node.attr}"
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print":
            yield f"line {node.lineno}: print"


@pytest.mark.parametrize("path", sorted((ROOT / "host").rglob("*.py")), ids=lambda path: path.name)
def test_only_one_module_prints(path: Path) -> None:
    """There what cannot be printed is escaped: names in files, answers of devices."""
    found = list(printing(ast.parse(path.read_text(encoding="utf-8"))))
    assert bool(found) == (path == ROOT / "host" / "cli" / "output.py"), found
