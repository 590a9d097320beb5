"""The loop's constraint equations, solved numerically, beside the closed form, and where they have no solution."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from tests.features.papers.loop_closure import CLOSED_MM, LoopClosure
from tests.host.complaints import complaint_of

ROBOT = load_robot("hybrid-arm")
ARM = make_kinematics(ROBOT)
LOOP = LoopClosure.of(ROBOT)


def helix() -> FloatArray:
    t_s = np.arange(241) / 3
    w = 2 * np.pi * t_s / 20
    return np.column_stack([350 + 80 * np.cos(w), 150 + 80 * np.sin(w), 500 + 3 * t_s, np.zeros(241)])


def test_the_papers_first_simulation_gives_the_joints() -> None:
    """The tool is driven along the helix; golden joints of the closed form, and all samples."""
    poses = helix()
    found = LOOP.driven_at_the_tool(poses)
    assert found.joints[0, :3] == pytest.approx([19.230672376, -63.383045955, -116.976396230], abs=1e-8)
    assert found.joints[210, :3] == pytest.approx([29.054604099, 84.986301555, 176.315560878], abs=1e-8)
    assert found.joints == pytest.approx(ARM.solve(poses, "(+,+)").joints, abs=1e-9)
    assert found.poses == pytest.approx(poses, abs=1e-9)
    assert found.residual <= CLOSED_MM
    assert found.steps <= 6
    assert (np.sin(np.deg2rad(found.slopes_deg)) > 0.0).all()  # both sliders stay below the platform


def test_the_papers_second_simulation_gives_the_tool() -> None:
    joints = ARM.solve(helix(), "(+,+)").joints
    assert LOOP.driven_at_the_joints(joints).poses == pytest.approx(helix(), abs=1e-9)


@pytest.mark.parametrize("th1_deg", [-165.0, -90.0, 10.0, 179.0])
@pytest.mark.parametrize(("z2_mm", "z3_mm"), [(-149.0, 100.0), (0.0, 316.0), (149.0, 500.0)])
def test_every_part_of_the_workspace_is_reached(th1_deg: float, z2_mm: float, z3_mm: float) -> None:
    """Also from one end of it, where the search begins in the middle."""
    rho, angle = 400.0 + z2_mm, np.deg2rad(th1_deg)
    pose = np.array([[rho * np.cos(angle), rho * np.sin(angle), 280.0 + z3_mm, 20.0]])
    found = LOOP.driven_at_the_tool(pose)
    left, right = (z3_mm - np.sqrt(350.0**2 - (z2_mm + side) ** 2) for side in (150.0, -150.0))
    assert found.joints[0, :3] == pytest.approx([th1_deg, left, right], abs=1e-8)


def test_a_loop_that_cannot_close_is_an_error() -> None:
    """The sliders are 640 mm apart, the links reach 632.46 mm."""
    words = "sample 1: the loop of the mechanism does not close within 30 Newton steps"
    joints = np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 320.0, -320.0, 0.0]])
    assert complaint_of(lambda: LOOP.driven_at_the_joints(joints)) == words
