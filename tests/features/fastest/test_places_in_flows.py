"""Outputs on the way behind and before corners of joint moves and lines: they change where the tool is at the place.

The oracle knows no path parameter: it looks when the planned tool, seen every 0.1 ms, comes to the place on the line.
"""

from typing import cast

import numpy as np
import pytest

from steptwin.features.fastest.chain import ChainDrives
from steptwin.features.fastest.corners import flowing
from steptwin.features.fastest.drives import LoadChange
from steptwin.features.fastest.flowing_legs import FlowingLegs
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.motions.tool_move import present_branch
from steptwin.host.planning.paths import StraightLine
from steptwin.host.planning.programs import CompiledProgram
from steptwin.host.planning.programs.paces import JointPace, ToolPace
from tests.features.fastest.test_flowing import ROBOT, compiled
from tests.host.planning.programs.test_compiling import tool

LATE_S = 0.003
GO = "[[step]]\ngo = {{ th1 = {th1}, th2 = {th2}, d3 = {d3} }}\nblend_mm = {r}\n"
LINE = "[[step]]\nby = {{ x = {x}, y = {y} }}\nspeed_mm_s = {speed}\noutputs = [{outputs}]\n{more}\n"


def line(x: float, y: float, places_mm: list[float], speed: float = 60.0, more: str = "") -> str:
    outputs = ", ".join(f"{{ gripper = {str(i % 2 == 0).lower()}, at_mm = {at} }}" for i, at in enumerate(places_mm))
    return LINE.format(x=x, y=y, speed=speed, outputs=outputs, more=more)


def there_s(program: CompiledProgram, begin: FloatArray, goal: FloatArray, at_mm: float) -> float:
    """Return when the tool is on the straight line at a length, seen every 0.1 ms."""
    t_s = np.arange(0.0, program.motion.duration_s, 1e-4)
    places = tool(program.motion.positions(t_s))[:, :3]
    along = (goal - begin) / np.linalg.norm(goal - begin)
    return float(t_s[np.argmin(np.linalg.norm(places - (begin + at_mm * along), axis=1))])


@pytest.mark.parametrize(
    ("th1", "th2", "d3", "r_mm", "x", "y"),
    [(60.0, 60.0, 30.0, 12.0, 18.0, -38.0), (20.0, 110.0, 20.0, 15.0, 35.0, -20.0)],
)
def test_outputs_behind_a_joint_move_change_where_the_tool_is_there(
    th1: float, th2: float, d3: float, r_mm: float, x: float, y: float
) -> None:
    length = float(np.hypot(x, y))
    places_mm = [r_mm + 1.0, r_mm + 9.0, length - 4.0]
    move = GO.format(th1=th1, th2=th2, d3=d3, r=r_mm)
    program = compiled(move + line(x, y, [*places_mm[:2], -4.0], speed=20.0))
    goal = tool(program.motion.positions(np.array([program.motion.duration_s])))[0, :3]
    begin = goal - [x, y, 0.0]
    for change, at_mm in zip(program.motion.output_changes, places_mm, strict=True):
        late_s = change.from_s - there_s(program, begin, goal, at_mm)
        assert -1.5e-4 <= late_s <= LATE_S


def test_outputs_before_a_joint_move_and_in_the_rounding_change_where_the_tool_is_nearest() -> None:
    begin = tool(np.array([[20.0, 80.0, 20.0, 0.0]]))[0, :3]
    goal = begin + np.array([-40.0, 10.0, 0.0])
    places_mm = [10.0, 25.0, 33.0]  # the rounding begins 12 mm before the end, at 29.2 mm
    program = compiled(
        line(-40.0, 10.0, places_mm, speed=20.0, more="blend_mm = 12") + "[[step]]\ngo = { th1 = -20, d3 = 5 }\n"
    )
    for change, at_mm in zip(program.motion.output_changes, places_mm, strict=True):
        late_s = change.from_s - there_s(program, begin, goal, at_mm)
        assert -1.5e-4 <= late_s <= LATE_S + 0.02 * (at_mm > 29.2)  # there it passes beside the place, for some 10 ms


def test_the_payload_is_taken_and_left_where_the_tool_is_on_the_line_behind_the_corner() -> None:
    legs = FlowingLegs(ROBOT, np.array([20.0, 80.0, 20.0, 0.0]))
    begin = legs.add_joints(legs.start, np.array([60.0, 60.0, 30.0, 0.0]), JointPace(blend_mm=12.0))
    pose = tool(begin[np.newaxis])[0]
    line = StraightLine(tuple(pose.tolist()), tuple((pose + np.array([18.0, -38.0, 0.0, 0.0])).tolist()))
    legs.add_path(begin, line, present_branch(ROBOT, begin), ToolPace(speed_mm_s=60.0))
    flow = flowing(ROBOT, legs.legs, legs.radii_mm)
    unasked = cast("DriveLimits", None)  # where the payload hangs asks no drive
    load = ChainDrives(unasked, changes=((), (LoadChange(15.0, 25.0, held=True),))).along(flow, 0).load
    (taken,) = load.changes
    places = tool(flow.path.at(np.array([taken.from_s, taken.until_s]))[0])[:, :3]
    assert np.linalg.norm(places - pose[:3], axis=1) == pytest.approx([15.0, 25.0], abs=1e-6)
