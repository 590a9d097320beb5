"""Steps that lead the tool as a file of G-code says: planned, run, and refused with file, line and word."""

from pathlib import Path

import numpy as np
import pytest

from steptwin.host.common.findings import Findings
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import CompiledProgram, compile_program, parse_program, read_program
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.twin.embedded.execution import execute
from tests.host.complaints import complaint_of

ROBOT = load_robot("teaching-scara")
HEAD = """
start = { x = 130.0, y = 0.0, z = -50.0, phi = 0.0, branch = "right" }
[frames.plate]
x = 130.0
y = 10.0
z = -60.0
phi = 90.0
[[step]]
gcode = "part.ngc"
frame = "plate"
"""
SQUARE = """G21 G90 G64 P0.05 (a square with an engraved side)
G0 X0 Y0 Z2
G1 Z0 F600
M62 P1
X10 F1200
Y10
M63 P1
X0
Y0
G0 Z2
M2
"""


GRIPPER = 'outputs = { P1 = "gripper" }'


def compiled(folder: Path, text: str, more: str = GRIPPER) -> CompiledProgram:
    (folder / "part.ngc").write_text(text, encoding="utf-8")
    found = Findings()
    program = parse_program(HEAD + more, found, folder)
    found.raise_first()
    return compile_program(program, ROBOT)


def refusal(folder: Path, text: str, more: str = "") -> str:
    return complaint_of(lambda: compiled(folder, text, more))


def test_a_square_in_its_frame_at_its_feed(tmp_path: Path) -> None:
    found = compiled(tmp_path, SQUARE)
    motion = plan(ROBOT, found.motion).motion
    t_s = np.arange(0.0, motion.duration_s, 1e-3)
    tool = make_kinematics(ROBOT).forward(motion.positions(t_s))
    cutting = tool[:, 2] < -60.0 + 1e-6
    # the frame is turned by 90 degrees: the file's x leads along y, its y along -x
    assert tool[cutting, 0].min() == pytest.approx(120.0, abs=0.01)
    assert tool[cutting, 1].max() == pytest.approx(20.0, abs=0.01)
    assert tool[-1, :3] == pytest.approx([130.0, 10.0, -58.0], abs=1e-3)
    speeds = np.linalg.norm(np.diff(tool[:, :3], axis=0), axis=1) / 1e-3
    both = cutting[:-1] & cutting[1:]
    assert 19.0 < speeds[both].max() < 1.005 * 20.0
    assert [step.notes for step in found.steps] == [
        ("11 lines: 1 path of the tool without a stop, 4 corners rounded, 0 stops at corners",)
    ]


@pytest.mark.slow
def test_it_runs_and_its_outputs_change_on_the_way(tmp_path: Path) -> None:
    planned = plan(ROBOT, compiled(tmp_path, SQUARE).motion)
    changes = planned.motion.output_changes
    at = planned.motion.positions(np.array([each.from_s for each in changes]))
    tool = make_kinematics(ROBOT).forward(at)
    assert [(each.output, each.on) for each in changes] == [("gripper", True), ("gripper", False)]
    assert tool[:, 0] == pytest.approx([130.0, 120.0], abs=0.06)
    assert tool[:, 1] == pytest.approx([10.0, 20.0], abs=0.06)
    assert execute(planned, "part").report.passed


def test_a_highest_feed_and_a_tool(tmp_path: Path) -> None:
    slow = compiled(tmp_path, SQUARE, 'feed_max_mm_s = 5.0\ntool_mm = 3.0\noutputs = { P1 = "gripper" }')
    planned = slow.motion
    tool = make_kinematics(ROBOT).forward(planned.positions(np.arange(0.0, planned.duration_s, 1e-3)))
    assert tool[:, 2].min() == pytest.approx(-57.0, abs=1e-3)
    cutting = tool[:-1, 2] < -57.0 + 1e-6
    assert (np.linalg.norm(np.diff(tool[:, :3], axis=0), axis=1)[cutting] / 1e-3).max() < 5.03


@pytest.mark.parametrize(
    ("text", "more", "message"),
    [
        ("G1 X1 F60\nG41 D1", "", "step 1: part.ngc: line 2: G41 is not understood"),
        ("G1 X1", "", "step 1 (gcode part.ngc): part.ngc: line 1: G1: F is missing"),
        (
            "M3\nG1 X1 F60",
            "",
            "step 1: part.ngc: line 1: M3: names no output of the robot; the step says",
        ),
        ("G1 X1 F60", 'outputs = { M3 = "spindle" }', "spindle"),
        ("G1 X1 F60", 'outputs = { M99 = "gripper" }', "step 1: outputs: 'M99' has no output: there are M3, M4"),
        ("G1 X400 F60", "", "step 1 (gcode part.ngc): part.ngc: line 1: the tool"),
        ("G0 X400", "", "step 1 (gcode part.ngc): part.ngc: line 1: "),
        ("G1 Z-90 F60", "", "step 1 (gcode part.ngc): part.ngc: line 1: d3: "),
        ("G1 X1 F60", "feed_max_mm_s = 0.0", "step 1: feed_max_mm_s: 0 is not above 0"),
        ("G1 X1 F60", "speed = 3", "step 1: speed: key 'speed' is unknown: did you mean speed_percent?"),
    ],
)
def test_what_is_refused(tmp_path: Path, text: str, more: str, message: str) -> None:
    told = refusal(tmp_path, text, more)
    assert message in told, told


def test_a_missing_file_and_an_unknown_frame(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text("G0 X1\n", encoding="utf-8")
    for old, new, message in (
        ("part.ngc", "none.ngc", "step 1: none.ngc: No such file or directory"),
        ('frame = "plate"', 'frame = "plat"', "step 1: frame: 'plat' is unknown: did you mean plate?"),
    ):
        found = Findings()
        parse_program(HEAD.replace(old, new), found, tmp_path)
        assert found.messages == [message]


@pytest.mark.slow
def test_the_pages_engraving_runs() -> None:
    path = Path(__file__).resolve().parents[3] / "docs" / "programs" / "engraving" / "compass.toml"
    planned = plan(ROBOT, compile_program(read_program(str(path)), ROBOT).motion)
    outcome = execute(planned, "compass")
    assert outcome.report.passed
    assert [each.on for each in planned.motion.output_changes] == [True, False]
