"""The rules of `python -m tests.rules` find what they look for; `make lint` applies them to the code."""

import ast
from pathlib import Path

import pytest

from tests.house import ROOT, House
from tests.messages import same
from tests.mutations import MUTATIONS
from tests.rules import floats_and_clocks, house_faults, printing


def test_floats_and_clocks_are_found() -> None:
    tree = ast.parse("import time\nx = 1.5\ny = x / 2\nx /= 2\nz = float(3)")
    assert len(list(floats_and_clocks(tree))) == 5
    assert len(list(printing(ast.parse("print(1)\ntyper.echo(2)\nsprint(3)")))) == 2


def test_the_house_is_counted(tmp_path: Path) -> None:
    source = """class Axis:
    '''Two lines,
    no code.'''

    def move(self, a, b, *, c): ...
"""
    for name in ("controller/axis.py", "controller/motion/axis.py", "host/move.py"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("from steptwin.controller.axis import Axis\n" if "host" in name else source)
    house = House(tmp_path)
    assert house.parameters()["controller/axis.py: move (line 5)"] == 3
    assert house.used_once() == ["controller/axis.py"]
    assert (house.lines(), house.code_lines()) == (11, 5)
    assert house.siblings()["controller"] == 2
    assert house.file_names()["axis.py"] == 2
    assert list(house_faults(house)) == ["class Axis: controller/axis.py, controller/motion/axis.py"]


@pytest.mark.parametrize(
    ("message", "golden", "expected"),
    [
        ("th1: 1.234 deg", "th1: 1.235 deg", True),
        ("th1: 1.234 deg", "th1: 1.236 deg", False),
        ("th1: 12 deg", "th1: 13 deg", False),
        ("th1: 1.23 deg", "th1: 1.230 deg", False),
        ("th1: 1.23 deg", "th2: 1.23 deg", False),
        ("0x1A.5", "0x1A.5", True),
    ],
)
def test_messages_are_compared_by_words_and_rounded_numbers(message: str, golden: str, expected: bool) -> None:
    assert same(message, golden) is expected


def test_every_mutation_has_its_place() -> None:
    """`python -m tests.mutations` takes too long to see it there."""
    assert [str(each) for each in MUTATIONS if (ROOT / each.path).read_text("utf-8").count(each.right) != 1] == []
