"""Check rules about the code itself that no linter knows; `make lint` runs `python -m tests.rules`."""

import ast
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from steptwin.host.common.features import features
from tests.house import ROOT, House
from tests.messages import GOLDEN, exists

SIBLINGS_MAX: Final = 30  # files and folders in a folder, which a reader can hold in the head
PARAMETERS_MAX: Final = 12  # of a function, `self` and `cls` aside
SAME_FILE_NAMES_MAX: Final = 2


def floats_and_clocks(tree: ast.AST) -> Iterator[str]:
    """Yield what the firmware must not have: floats, true divisions, a clock, a log."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, float | complex):
            yield f"{node.lineno}: the constant {node.value}"
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.Div):
            yield f"{node.lineno}: a true division"
        if isinstance(node, ast.Name) and node.id == "float":
            yield f"{node.lineno}: float"
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = {alias.name for alias in node.names} | {getattr(node, "module", None)}
            yield from (f"{node.lineno}: imports {name}" for name in names & {"time", "math", "logging", "random"})


def printing(tree: ast.AST) -> Iterator[str]:
    """Yield the calls that print, of typer and of Python."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in {"echo", "secho"}:
            yield f"{node.lineno}: {node.attr}"
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print":
            yield f"{node.lineno}: print"


def firmware_faults(house: House) -> Iterator[str]:
    """Yield where the firmware has a float, a clock or a log."""
    for path, tree in house.trees.items():
        if path.startswith("controller/"):
            yield from (f"{path}:{fault}" for fault in floats_and_clocks(tree))


def printing_faults(house: House) -> Iterator[str]:
    """Yield where host and features print outside the one module that escapes names in files and answers of devices."""
    for path, tree in house.trees.items():
        if path.startswith(("host/", "features/")) and path != "host/cli/output.py":
            yield from (f"{path}:{fault}" for fault in printing(tree))


def house_faults(house: House) -> Iterator[str]:
    """Yield names that exist twice, full folders and long lists of parameters."""
    yield from (f"class {name}: {', '.join(paths)}" for name, paths in house.classes_twice().items())
    yield from (
        f"{folder}: {count} entries, {SIBLINGS_MAX} is the most"
        for folder, count in house.siblings().items()
        if count > SIBLINGS_MAX
    )
    yield from (f"{name}: {count} files" for name, count in house.file_names().items() if count > SAME_FILE_NAMES_MAX)
    yield from (
        f"{name}: {count} parameters, {PARAMETERS_MAX} is the most"
        for name, count in house.parameters().items()
        if count > PARAMETERS_MAX
    )


def needs_faults(house: House) -> Iterator[str]:
    """Yield where a feature imports another one that it does not say it needs."""
    for path, tree in house.trees.items():
        if path.startswith("features/") and (name := path.split("/")[1]) in features():
            for node in ast.walk(tree):
                other = str(getattr(node, "module", "")).removeprefix("steptwin.features.").partition(".")[0]
                if other != name and other in features() and other not in features()[name].needs:
                    yield f"{path}: imports the feature {other}, which features/{name}/__init__.py does not need"


def server_faults(root: Path) -> Iterator[str]:
    """Yield tests outside tests/live that start servers: others run on as many workers as cores, which would wait."""
    starting = re.compile(r"^from tests\.end_to_end\.served import .*\b(Server|serving)\b", re.MULTILINE)
    for path in sorted((root / "tests").rglob("test_*.py")):
        if path.parent.name != "live" and starting.search(path.read_text(encoding="utf-8")):
            yield f"{path.relative_to(root)}: starts a server outside tests/live"


def stale_messages() -> Iterator[str]:
    """Yield entries of the golden messages whose test is gone."""
    names = json.loads(GOLDEN.read_text(encoding="utf-8"))
    return (f"{name}: no such test, which `python -m tests.messages` takes out" for name in names if not exists(name))


def main() -> int:
    """Print each broken rule; return 1 if there is one."""
    house = House(ROOT)
    faults = [
        *(fault for check in (firmware_faults, printing_faults, house_faults, needs_faults) for fault in check(house)),
        *server_faults(ROOT),
        *stale_messages(),
    ]
    sys.stdout.writelines(f"{fault}\n" for fault in faults)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
