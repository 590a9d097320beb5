"""A line of G-code beyond a joint's range names where it leads, not where the path leaves the range."""

from pathlib import Path

import pytest

from steptwin.host.common.findings import Findings
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import read_robot
from steptwin.host.robots.new_file import robot_text, with_settings
from tests.host.complaints import complaint_of

GANTRY = read_robot(robot_text("gantry", "cartesian", *with_settings("cartesian", {})))


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("G1 X500", "line 2: X: 500.0 mm is outside 0..300 mm"),
        ("G1 X10 Y10\nG1 X500 Y20", "line 3: X: 500.0 mm is outside 0..300 mm"),
        ("G1 X10 Y10\nG1 X500 Y20\nG1 X600", "line 3: X: 500.0 mm is outside 0..300 mm"),
        ("G1 X10 Y50\nG2 X10 Y60 I0 J5\nG2 X10 Y100 I0 J20", "line 4: X: -10.0 mm is outside 0..300 mm"),
    ],
)
def test_a_line_names_where_it_leads(lines: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text(f"G21 G90 F1000\n{lines}\n", encoding="utf-8")
    text = '[[step]]\ngcode = "part.ngc"\n'
    found = Findings()
    program = parse_program(text, found, tmp_path)
    found.raise_first()
    assert said in complaint_of(lambda: compile_program(program, GANTRY))
