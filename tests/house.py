"""Measure the product's house: lines, files, folders, names and parameters.

The product is all Python of bench, controller, docs/generate, emulator, host, protocol and steptwin. For the figures of
now, beside those of other commits by the same rules: `python -m tests.house [COMMIT ...]`.
"""

import ast
import subprocess
import sys
import tarfile
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parent.parent
PARTS: Final = ("bench", "controller", "docs/generate", "emulator", "features", "host", "protocol", "steptwin")
CORE: Final = ("controller", "emulator", "host", "protocol")
NOT_LISTED: Final = {"__pycache__", "py.typed"}
"""Entries of folders that are no part of the house."""
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class House:
    """The product's files under a root folder."""

    root: Path

    @cached_property
    def sources(self) -> dict[str, str]:
        """The text of each file, by its path from the root; what `steptwin` links to counts once."""
        paths = (path for part in PARTS for path in (self.root / part).rglob("*.py"))
        inside = (path.relative_to(self.root) for path in paths)
        return {
            str(path): (self.root / path).read_text(encoding="utf-8")
            for path in sorted(inside)
            if path.parts[0] != "steptwin" or len(path.parts) == 2
        }

    @cached_property
    def trees(self) -> dict[str, ast.Module]:
        """The syntax of each file."""
        return {path: ast.parse(source) for path, source in self.sources.items()}

    def lines(self, *folders: str) -> int:
        """Return the number of lines of all files, or of those in some folders."""
        return sum(
            source.count("\n") for path, source in self.sources.items() if not folders or Path(path).parts[0] in folders
        )

    def importing_features(self) -> list[str]:
        """Return the files of the core that import a feature."""
        return [
            path
            for path, tree in self.trees.items()
            if Path(path).parts[0] in CORE and any(module.startswith("steptwin.features") for module in _imported(tree))
        ]

    def code_lines(self) -> int:
        """Return the number of lines that are neither empty nor a comment nor within a docstring."""
        return sum(len(_code_lines(self.sources[path], tree)) for path, tree in self.trees.items())

    def small_files(self) -> list[str]:
        """Return the files under 40 lines."""
        return [path for path, source in self.sources.items() if source.count("\n") < 40]

    def used_once(self) -> list[str]:
        """Return the modules that exactly one other module imports."""
        names = {_module(path): path for path in self.sources}
        importers: dict[str, set[str]] = defaultdict(set)
        for path, tree in self.trees.items():
            for module in _imported(tree):
                if names.get(module, path) != path:
                    importers[names[module]].add(path)
        return [path for path in self.sources if len(importers[path]) == 1]

    def siblings(self) -> dict[str, int]:
        """Return the number of files and folders in each folder."""
        found: dict[str, set[str]] = defaultdict(set)
        for path in self.sources:
            folder = Path(path).parent
            found[str(folder)] |= {
                entry.name for entry in (self.root / folder).iterdir() if entry.name not in NOT_LISTED
            }
        return {folder: len(entries) for folder, entries in found.items() if folder != "steptwin"}

    def classes_twice(self) -> dict[str, list[str]]:
        """Return the files of each class name that more than one class has."""
        found: dict[str, list[str]] = defaultdict(list)
        for path, tree in self.trees.items():
            for node in ast.walk(tree):
                if isinstance(node, ast.ClassDef):
                    found[node.name].append(path)
        return {name: paths for name, paths in sorted(found.items()) if len(paths) > 1}

    def file_names(self) -> Counter[str]:
        """Return how many files have each name; `__init__`, `__main__` and features, which are alike, aside."""
        names = (Path(path).name for path in self.sources if Path(path).parts[0] != "features")
        return Counter(name for name in names if not name.startswith("__"))

    def parameters(self) -> dict[str, int]:
        """Return the number of parameters of each function, `self` and `cls` aside."""
        return {
            f"{path}: {node.name} (line {node.lineno})": _parameters(node)
            for path, tree in self.trees.items()
            for node in ast.walk(tree)
            if isinstance(node, Function)
        }

    def phrases(self) -> int:
        """Return how often docstrings and comments say "in which", "of which" or "at which"."""
        return sum(source.count(f"{word} which") for source in self.sources.values() for word in ("in", "of", "at"))

    def places(self) -> int:
        """Return the number of rows of "To add ..." in docs/house.md."""
        text = (self.root / "docs" / "house.md").read_text(encoding="utf-8")
        rows = text.partition("## To add")[2].partition("\n## ")[0].splitlines()
        return sum(line.startswith("| ") for line in rows) - 1

    def figures(self) -> Iterator[tuple[str, int]]:
        """Yield each figure with what it counts."""
        counts = self.parameters().values()
        yield "lines of product Python", self.lines()
        yield "lines of the core", self.lines(*CORE)
        yield "lines of features", self.lines("features")
        yield "files of the core that import a feature", len(self.importing_features())
        yield "lines of code", self.code_lines()
        yield "files", len(self.sources)
        yield "files under 40 lines", len(self.small_files())
        yield "modules with one importer", len(self.used_once())
        yield "most files and folders in a folder", max(self.siblings().values())
        yield "class names used twice or more", len(self.classes_twice())
        yield "file names used three times or more", sum(count > 2 for count in self.file_names().values())
        yield "functions with 7 parameters or more", sum(count >= 7 for count in counts)
        yield "most parameters", max(counts)
        yield '"in which", "of which", "at which"', self.phrases()
        yield 'rows of "to add"', self.places()


def _code_lines(source: str, tree: ast.Module) -> set[int]:
    rows = source.splitlines()
    lines = {number for number, row in enumerate(rows, 1) if row.strip() and not row.strip().startswith("#")}
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            lines -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines


def _module(path: str) -> str:
    name = path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
    return name if name.startswith(("docs", "steptwin")) else f"steptwin.{name}"


def _imported(tree: ast.Module) -> Iterator[str]:
    """Yield the modules that a file imports anywhere, as `from a import b` may name a module or what is in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def _parameters(function: Function) -> int:
    arguments = function.args
    names = [each.arg for each in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def of_commit(commit: str, folder: Path) -> House:
    """Return the house of a commit, unpacked into a folder."""
    packed = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=BytesIO(packed)) as archive:
        archive.extractall(folder, filter="tar")
    return House(folder)


def main(commits: list[str]) -> None:
    """Print the figures of the commits and of now, a column each."""
    with tempfile.TemporaryDirectory() as folder:
        houses = [of_commit(commit, Path(folder, commit)) for commit in commits]
        columns = [dict(house.figures()) for house in (*houses, House(ROOT))]
    rows = [("", *(f"{name[:8]:>8}" for name in (*commits, "now")))]
    rows += [(what, *(f"{column[what]:8}" for column in columns)) for what in columns[-1]]
    sys.stdout.writelines(f"{what:40} {' '.join(cells)}\n" for what, *cells in rows)


if __name__ == "__main__":
    main(sys.argv[1:])
