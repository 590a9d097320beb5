"""Every file and every name that the pages about the code mention exists, docs/house.md above all."""

import ast
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest

import steptwin
from steptwin.host.common.features import Feature

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
HOUSE = (DOCS / "house.md").read_text(encoding="utf-8")
PAGES = ("captures", "driver", "evidence", "faults", "firmware", "house", "motions", "protocol", "shadow")

PLACE = re.compile(
    r"(?!\w+_msgs/)([\w.-]+/[\w./-]*|[\w-]+\.(?:py|toml|md)|Makefile)(?:: (\w+(?:\.\w+)*(?:, \w+(?:\.\w+)*)*))?"
)
"""A path, perhaps with names that the file defines: `host/planning/planner.py: plan`; no type of ROS' messages."""
MEMBER = re.compile(r"([A-Z]\w+\.[a-z_]\w*)(?:\(.*\))?")
"""A member of a class, without its file: `Simulation.send`, `Machine.wait(dt_s)`."""
MODULE = re.compile(r"steptwin(\.\w+)+")
"""An import path: `steptwin.bench`, or a public name: `steptwin.Motion`."""


def code_spans(text: str) -> list[str]:
    """Return the texts between single backticks, outside of fenced blocks, each on one line."""
    unfenced = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", unfenced)]


def names_of(tree: ast.Module) -> set[str]:
    """Return the names that a module defines at its top level, and `Class.member` for its classes."""
    names = set(bound_names(tree.body))
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{member}" for member in bound_names(node.body)}
    return names


def bound_names(body: list[ast.stmt]) -> Iterator[str]:
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        yield from (target.id for target in targets if isinstance(target, ast.Name))


def faults(span: str, members: set[str]) -> Iterator[str]:
    """Say what is wrong with a code span, if it names a place in the code."""
    if place := PLACE.fullmatch(span):
        path = ROOT / place[1]
        if not path.exists():
            yield f"`{span}`: no file {place[1]}"
        elif place[2]:
            defined = names_of(ast.parse(path.read_text(encoding="utf-8")))
            yield from (f"`{span}`: no name {name}" for name in place[2].split(", ") if name not in defined)
    elif (member := MEMBER.fullmatch(span)) and member[1] not in members:
        yield f"`{span}`: no class has this member"
    elif MODULE.fullmatch(span) and span.removeprefix("steptwin.") not in steptwin.__all__:
        stem = ROOT.joinpath(*span.split("."))
        if not (stem.with_suffix(".py").exists() or (stem / "__init__.py").exists()):
            yield f"`{span}`: no module"


@pytest.fixture(scope="module")
def members() -> set[str]:
    """Every `Class.member` of the product."""
    folders = ("protocol", "controller", "emulator", "host", "features", "bench", "docs/generate")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    return {name for path in files for name in names_of(ast.parse(path.read_text(encoding="utf-8"))) if "." in name}


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_every_place_exists(page: str, members: set[str]) -> None:
    spans = code_spans((DOCS / f"{page}.md").read_text(encoding="utf-8"))
    assert [fault for span in spans for fault in faults(span, members)] == []


def test_every_folder_is_in_the_house() -> None:
    packages = [*ROOT.glob("*/__init__.py"), *ROOT.glob("host/*/__init__.py")]
    folders = {f"`{path.parent.relative_to(ROOT).as_posix()}/`" for path in packages}
    assert len(folders) > 14
    assert {folder for folder in folders if folder not in HOUSE} == set()


def test_every_extension_point_is_in_the_house() -> None:
    given = {each.name for each in fields(Feature)} - {"name"}
    assert {name for name in given if f"`{name}`" not in HOUSE} == set()


def test_it_is_short_and_says_where() -> None:
    """A newcomer reads it whole; each row of the last table names at least one place."""
    assert len(HOUSE.split()) <= 1500
    rows = [line for line in HOUSE.partition("## To add")[2].splitlines() if line.startswith("| ")][1:]
    assert 10 <= len(rows) <= 15
    for row in rows:
        assert any(PLACE.fullmatch(span) for span in code_spans(row)), row


@pytest.mark.parametrize(
    "span",
    [
        "host/planning/planer.py",
        "host/planning/planner.py: plane",
        "emulator/simulation.py: Simulation.sent",
        "Simulation.sent",
        "Simulation.sent(frame)",
        "steptwin.benches",
    ],
)
def test_the_check_itself_finds_faults(span: str, members: set[str]) -> None:
    assert len(list(faults(span, members))) == 1
    assert list(faults("emulator/simulation.py: Simulation.send", members)) == []
