"""A tool that goes straight through the stretched wrist: the goal is judged on the branch on which the arm arrives."""

from pathlib import Path

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.planning.programs import CompiledProgram, compile_program, read_program
from steptwin.host.planning.tool_by_hand import ToolStep, plan_tool_step
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics

PAROL6 = load_robot("parol6")


def compiled(folder: Path, law: str, step: str, j4_deg: float = 0.0) -> CompiledProgram:
    file = folder / "program.toml"
    file.write_text(
        f'robot = "parol6"\nlaw = "{law}"\n[[step]]\n'
        f"go = {{ J1 = 0.0, J2 = -90.0, J3 = 180.0, J4 = {j4_deg}, J5 = 20.0, J6 = 180.0 }}\n"
        f"[[step]]\n{step}\nspeed_mm_s = 20.0\n",
        encoding="utf-8",
    )
    return compile_program(read_program(file), PAROL6)


@pytest.mark.parametrize("law", ["fastest", "s-curve"])
@pytest.mark.parametrize("step", ["by = { ry = 40.0 }", "by = { x = -1.0, ry = 40.0 }"])
def test_j4_stays_and_the_wrist_passes_through(tmp_path: Path, law: str, step: str) -> None:
    """On the start's branch the goal takes J4 = 180 deg, beyond 105.47; J4 = 0 leads the tool all the way."""
    program = compiled(tmp_path, law, step)
    motion, row = program.motion, program.steps[1]
    assert [name for _, name in row.changes] == ["front-up-flip"]
    joints = motion.positions(np.linspace(row.from_s, motion.duration_s, 200))
    assert np.abs(joints[:, 3]).max() < 1e-6
    assert joints[0, 4] == pytest.approx(20.0)
    assert joints[-1, 4] < -20.0
    kinematics = make_kinematics(PAROL6)
    first, last = kinematics.forward(joints[[0, -1]])
    moved = kinematics.task.stepped(tuple(first.tolist()), {"ry": 40.0, "x": -1.0} if "x" in step else {"ry": 40.0})
    np.testing.assert_allclose(np.abs(last), np.abs(np.array(moved)), atol=1e-6)  # a quaternion has two signs


def test_so_it_does_by_hand() -> None:
    planned = plan_tool_step(PAROL6, [0.0, -90.0, 180.0, 0.0, 20.0, 180.0], ToolStep({"ry": 40.0}, 50.0))
    end = planned.motion.positions(np.array([planned.motion.duration_s]))[0]
    assert end[3] == pytest.approx(0.0, abs=1e-6)
    assert end[4] < -20.0


def test_beside_the_wrist_the_goal_is_out_of_reach_as_before(tmp_path: Path) -> None:
    """With J4 at 3 deg the wrist is not passed but turned about: J4 goes to 180 deg less."""
    with pytest.raises(InputError, match=r"is out of reach on the branch 'front-up-noflip': J4: -?1\d\d\.\d"):
        compiled(tmp_path, "fastest", "by = { ry = 40.0 }", 3.0)
