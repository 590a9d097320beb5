"""Programs of a robot whose motions are shaped: their steps have the times of the executed motion."""

from itertools import pairwise

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import load_robot, parse_robot

PLAIN = load_robot("corexy-gantry")
ROBOT = parse_robot(
    "\n".join([PLAIN.toml, *(f'[shaping.{name}]\nkind = "ei"\nfrequency_hz = 20.0\ndamping = 0.0' for name in "XYZ")]),
    "own.toml",
)
PROGRAM = """
start = { X = 50.0, Y = 50.0, Z = 50.0 }
[[step]]
line = { x = 90.0 }
speed_mm_s = 80.0
[[step]]
output = "gripper"
on = true
[[step]]
line = { y = 90.0 }
speed_mm_s = 80.0
[[step]]
pause = 0.2
[[step]]
line = { x = 20.0 }
speed_mm_s = 80.0
"""


def test_steps_begin_and_end_where_the_shaped_motion_has_them() -> None:
    program = parse_program(PROGRAM, Findings())
    plain, shaped = compile_program(program, PLAIN), compile_program(program, ROBOT)
    assert plain.changed is None
    assert plain.executed is plain.motion
    assert plan(ROBOT, shaped.motion).motion.duration_s == shaped.executed.duration_s
    ends = [(row.from_s, row.from_s + row.duration_s) for row in shaped.steps]
    assert [end for _, end in ends] == pytest.approx([*(begin for begin, _ in ends[1:]), shaped.executed.duration_s])
    longer_ms = [round(1000 * (b.duration_s - a.duration_s)) for a, b in zip(plain.steps, shaped.steps, strict=True)]
    assert longer_ms == [50, 0, 50, 0, 50]
    velocities = shaped.executed.velocities(np.array([begin for begin, _ in ends]))
    assert np.abs(velocities).max() < 1e-12
    (change,) = shaped.executed.output_changes
    assert change.from_s == pytest.approx(shaped.steps[1].from_s)


def test_a_step_that_is_too_fast_is_named() -> None:
    """The third step alone is too fast in 0.3 of the time, later than the first two and their shapers."""
    slow, fast = PROGRAM.replace("speed_mm_s = 80.0", "speed_mm_s = 30.0"), "line = { y = 90.0 }\nspeed_mm_s = "
    compiled = compile_program(parse_program(slow.replace(f"{fast}30.0", f"{fast}180.0"), Findings()), ROBOT)
    with pytest.raises(InputError) as refused, compiled.explained(0.3):
        plan_stretched(ROBOT, compiled.motion, 0.3)
    assert str(refused.value).startswith("step 3 (line to y 90): Y: ")


def test_a_step_keeps_the_limits_that_its_shaped_motion_keeps() -> None:
    compiled = compile_program(parse_program(PROGRAM, Findings()), ROBOT)
    peaks = [max(peak.percent for peak in row.peaks) for row in compiled.steps if row.peaks]
    plain = compile_program(parse_program(PROGRAM, Findings()), PLAIN)
    before = [max(peak.percent for peak in row.peaks) for row in plain.steps if row.peaks]
    assert all(shaped <= 1.001 * each for shaped, each in zip(peaks, before, strict=True))
    assert [each.text for each, _ in pairwise(compiled.steps)] == [each.text for each, _ in pairwise(plain.steps)]
