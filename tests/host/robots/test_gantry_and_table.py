"""The machines corexy-gantry and turntable: golden values by hand, and homing from several places."""

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.session import Session
from steptwin.host.operate.status import read_status
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.twin.board_under_test import BoardUnderTest
from tests.operations import Slip

GANTRY, TABLE = load_robot("corexy-gantry"), load_robot("turntable")


@pytest.mark.parametrize(
    ("joints", "axes_steps"),
    [
        ([0, 0, 0], [0, 0, 0, 0]),
        ([250, 0, 0], [20000, -20000, 0, 0]),
        ([0, 250, 0], [20000, 20000, 0, 0]),
        ([125, 125, 200], [20000, 0, 80000, 80000]),
        ([40, 100, 2.5], [11200, 4800, 1000, 1000]),
    ],
)
def test_the_belts_by_hand(joints: list[float], axes_steps: list[float]) -> None:
    """Belts of 40 mm a turn and 3200 steps: A = X + Y, B = Y - X; screws of 400 steps/mm."""
    assert GANTRY.axis_names == ("X", "Y", "Z", "Z2")
    assert GANTRY.to_steps(np.array(joints, dtype=float)).tolist() == pytest.approx(axes_steps)
    assert GANTRY.from_steps(np.array(axes_steps)).tolist() == pytest.approx(joints)


def test_the_tool_is_where_the_slides_are() -> None:
    kinematics = make_kinematics(GANTRY)
    assert kinematics.forward(np.array([[10.0, 20.0, 30.0]])).tolist() == [[10.0, 20.0, 30.0]]
    assert kinematics.solve(np.array([[10.0, 20.0, 30.0]]), "only").joints.tolist() == [[10.0, 20.0, 30.0]]


def test_the_tables_steps_are_whole() -> None:
    assert TABLE.steps_per_unit.tolist() == [500.0]
    assert TABLE.joints[0].transmission.microsteps == 10
    assert make_kinematics(TABLE).task.width == 0


@pytest.mark.slow
@pytest.mark.parametrize("at", [(30.0, 60.0, 200.0), (251.9, 251.9, 249.0), (253.0, 240.0, 253.0)])
def test_the_gantry_finds_its_switches(at: tuple[float, float, float], fast_kernel: Kernel) -> None:
    board = BoardUnderTest(GANTRY, stand_at=at, kernel=fast_kernel)
    session = Session(board, GANTRY)
    home_robot(session)
    status = read_status(session)
    assert [axis.position_known for axis in status.axes] == [True] * 4
    assert list(board.joints().values()) == pytest.approx([125.0, 125.0, 200.0], abs=0.0126)
    assert status.skews == {"Z2": 0.0}
    assert board.violations() == []


@pytest.mark.slow
def test_homing_squares_the_screws(fast_kernel: Kernel) -> None:
    """The right screw has lost 20 full steps, 0.8 mm."""
    board = BoardUnderTest(GANTRY, stand_at=[100.0, 100.0, 240.0], kernel=fast_kernel)
    session = Session(board, GANTRY)
    board.operate(Slip(3, -20))
    board.wait(0.01)
    screws = board.motor_positions()[2:]
    assert screws[0] - screws[1] == 320
    home_robot(session, joints=["Z"])
    assert board.motor_positions()[2:] == pytest.approx([80000, 80000], abs=1)


@pytest.mark.parametrize(
    "at_deg", [-183.0, *(pytest.param(at_deg, marks=pytest.mark.slow) for at_deg in (-170.0, -20.0))]
)
def test_the_table_finds_its_switch(at_deg: float, fast_kernel: Kernel) -> None:
    board = BoardUnderTest(TABLE, stand_at=[at_deg], kernel=fast_kernel)
    home_robot(Session(board, TABLE))
    assert board.joints()["table"] == pytest.approx(0.0, abs=0.0021)
