"""Programs of an arm whose tool does not turn by itself: lines are straight, the attitude follows from the arm."""

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import CompiledProgram, compile_program, parse_program
from steptwin.host.robots.kinematics import make_kinematics
from tests.host.robots.kinematics.test_usual_scara import scara
from tests.messages import refusing

ROBOT = scara(turning=False)
KINEMATICS = make_kinematics(ROBOT)


def compiled(steps: str) -> CompiledProgram:
    read = Findings()
    program = parse_program(f"start = {{ th1 = 20, th2 = 60, d3 = 10 }}\n{steps}", read)
    assert not read.messages
    return compile_program(program, ROBOT)


@pytest.mark.parametrize(
    "step",
    [
        "line = { x = 150, y = 180 }",
        "by = { x = -40, y = 30, z = -20 }",
        "arc = { via = { x = 120, y = 260 }, to = { x = 60, y = 250 } }",
        "through = [{ x = 120, y = 260 }, { x = 60, y = 250 }]",
    ],
)
def test_the_tool_follows_its_path(step: str) -> None:
    program = compiled(f"[[step]]\n{step}\nspeed_mm_s = 40")
    plan(ROBOT, program.motion)
    t_s = np.arange(0, round(1000 * program.motion.duration_s) + 1) / 1000
    poses = KINEMATICS.forward(program.motion.positions(t_s))
    speeds = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1) * 1000
    assert speeds.max() < 60
    assert np.ptp(poses[:, 3]) > 1
    velocities = program.motion.velocities(t_s)
    assert np.all(np.isfinite(velocities))


def test_a_line_is_straight() -> None:
    program = compiled("[[step]]\nline = { x = 150, y = 180 }\nspeed_mm_s = 40")
    t_s = np.linspace(0, program.motion.duration_s, 500)
    places = KINEMATICS.forward(program.motion.positions(t_s))[:, :2]
    way = places[-1] - places[0]
    off = (places - places[0]) @ np.array([-way[1], way[0]]) / np.linalg.norm(way)
    assert np.abs(off).max() < 1e-9
    assert places[-1] == pytest.approx([150, 180])


def test_a_position_may_leave_phi_out_or_give_the_one_that_follows() -> None:
    program = compiled("[[step]]\ngo = { x = 150, y = 180 }")
    end = program.motion.positions(np.array([program.motion.duration_s]))
    phi_deg = KINEMATICS.forward(end)[0, 3]
    compiled(f"[[step]]\ngo = {{ x = 150, y = 180, phi = {phi_deg:.4f} }}")
    compiled(f"[[step]]\nline = {{ x = 150, y = 180, phi = {phi_deg:.4f} }}\nspeed_mm_s = 40")


@pytest.mark.parametrize(("verb", "pace"), [("go", ""), ("line", "speed_mm_s = 40")])
def test_another_phi_is_refused(verb: str, pace: str) -> None:
    with refusing(InputError):
        compiled(f"[[step]]\n{verb} = {{ x = 150, y = 180, phi = 10 }}\n{pace}")


def test_the_tool_cannot_be_turned() -> None:
    with refusing(InputError):
        compiled("[[step]]\nby = { phi = 10 }\nspeed_mm_s = 40")
