"""Curves with two poses a millionth of a millimetre apart, as fast as the limits allow."""

import pytest

from steptwin.host.common.findings import Findings
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import load_robot

CURVE = """
start = {{ X = 120, Y = 100, Z = 20 }}
[[step]]
through = [{{ x = 121, y = 104 }}, {{ x = {near}, y = 104 }}, {{ x = {x}, y = {y} }}]
law = "fastest"
speed_mm_s = 40
"""


@pytest.mark.parametrize(
    ("near", "x", "y"), [("121.0000011", 123, 108), ("121.00002", 123, 108), ("121.000002", 112, 104)]
)
def test_it_is_planned(near: str, x: float, y: float) -> None:
    program = parse_program(CURVE.format(near=near, x=x, y=y), Findings())
    assert 0.3 < compile_program(program, load_robot("corexy-gantry")).motion.duration_s < 3.0
