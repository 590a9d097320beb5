"""Files of poses of a tool that turns in space: the header says the convention, and the arm goes on without a jump."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.trajectory_file import FileMotion, read_file_motion
from steptwin.host.robots import load_robot, read_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from tests.features.arms.arms import AR4_LIMITS, AR4_ROWS, chain_text, dh_entries
from tests.host.complaints import complaint_of

AR4 = load_robot("ar4-mk3")
PLACES = [(300.0, 0.0, 300.0), (300.0, 40.0, 280.0), (290.0, 60.0, 300.0)]
TURNS = Rotation.from_euler("ZYX", [(10.0, 20.0, 170.0), (0.0, 10.0, 165.0), (-20.0, 5.0, 175.0)], degrees=True)

COLUMNS: dict[str, tuple[str, FloatArray]] = {
    "rpy": ("roll,pitch,yaw", TURNS.as_euler("ZYX", degrees=True)[:, ::-1]),
    "quaternion": ("qx,qy,qz,qw", TURNS.as_quat()),
    "other sign": ("qx,qy,qz,qw", -TURNS.as_quat()),
    "scalar first": ("qw,qx,qy,qz", TURNS.as_quat(scalar_first=True)),
    "rounded": ("qx,qy,qz,qw", np.round(TURNS.as_quat(), 9)),
    "rotation vector": ("rotvec_x,rotvec_y,rotvec_z", TURNS.as_rotvec(degrees=True)),
    "KUKA": ("abc_a,abc_b,abc_c", TURNS.as_euler("ZYX", degrees=True)),
}


def csv(header: str, rows: list[list[float]]) -> str:
    lines = [",".join(map(repr, [float(2 * i), *row])) for i, row in enumerate(rows)]
    return "\n".join([f"t,x,y,z,{header}", *lines, ""])


def read(folder: Path, text: str, robot: Robot = AR4, units: str | None = None) -> FileMotion:
    file = folder / "poses.csv"
    file.write_text(text, encoding="utf-8")
    return read_file_motion(str(file), robot, units=units)


def complaint(folder: Path, text: str, robot: Robot = AR4) -> str:
    return complaint_of(lambda: read(folder, text, robot)).removeprefix(f"{folder}/poses.csv: ")


@pytest.mark.parametrize("name", COLUMNS)
def test_every_convention_is_the_same_motion(name: str, tmp_path: Path) -> None:
    header, turns = COLUMNS[name]
    motion = read(tmp_path, csv(header, [[*place, *turn] for place, turn in zip(PLACES, turns.tolist(), strict=True)]))
    poses = make_kinematics(AR4).forward(motion.whole.positions(np.array([0.0, 2.0, 4.0])))
    assert poses[:, :3] == pytest.approx(np.array(PLACES), abs=1e-6)
    assert np.rad2deg((Rotation.from_quat(poses[:, 3:]).inv() * TURNS).magnitude()).max() < 1e-6


@pytest.mark.parametrize(("name", "is_angle"), [("rpy", True), ("rotation vector", True), ("quaternion", False)])
def test_units_are_those_of_lengths_and_angles(name: str, is_angle: bool, tmp_path: Path) -> None:
    """A quaternion has no unit: in radians it is the same."""
    header, turns = COLUMNS[name]
    turns = np.deg2rad(turns) if is_angle else turns
    rows = [[*(mm / 1000.0 for mm in place), *turn] for place, turn in zip(PLACES, turns.tolist(), strict=True)]
    motion = read(tmp_path, csv(header, rows), units="rad,m")
    poses = make_kinematics(AR4).forward(motion.points.positions)
    assert poses[:, :3] == pytest.approx(np.array(PLACES), abs=1e-6)
    assert np.rad2deg((Rotation.from_quat(poses[:, 3:]).inv() * TURNS).magnitude()).max() < 1e-6


@pytest.mark.parametrize("count", [5, 200])
def test_through_a_stretched_wrist_no_joint_jumps(count: int, tmp_path: Path) -> None:
    """J5 goes from 20 to -20 deg: `noflip` becomes `flip` where both meet, and J4 and J6 stay where they are."""
    joints = np.linspace([0.0, 20.0, 10.0, 0.0, 20.0, 0.0], [20.0, 30.0, 0.0, 0.0, -20.0, 0.0], count)
    poses = make_kinematics(AR4).forward(joints)
    motion = read(tmp_path, csv("qx,qy,qz,qw", poses.tolist()))
    assert motion.points.positions == pytest.approx(joints, abs=1e-6)
    assert motion.points.branch == "front-up-noflip"
    line = count // 2 + 2
    assert motion.points.branch_words in (
        f"on the branch 'front-up-noflip', from line {line + 1} on 'front-up-flip'",
        f"on the branch 'front-up-noflip', from line {line} on 'front-up-flip'",
    )


ROW = [300.0, 0.0, 300.0]


@pytest.mark.parametrize(
    ("header", "values"),
    [
        (
            "qx,qy,qz,qw",
            [1.0, 0.0, 0.05, 0.0],
        ),
        ("qx,qy,qz", [1.0, 0.0, 0.0]),
        ("roll,pitch,yaw,qw", [1.0, 0.0, 0.0, 0.0]),
        ("rx,ry,rz", [1.0, 0.0, 0.0]),
        (
            "dx,dy,dz",
            [0.0, 0.0, -1.0],
        ),
    ],
    ids=str,
)
def test_what_is_no_pose(header: str, values: list[float], tmp_path: Path) -> None:
    right = [1.0, *[0.0] * (len(values) - 1)]
    complaint(tmp_path, csv(header, [[*ROW, *right], [*ROW, *values]]))


def five_axes() -> Robot:
    """The AR4 without its last joint: its tool is told a direction."""
    more = "tool = { xyz_mm = [0, 41, 0], rpy_deg = [-90, 0, 0] }"
    return read_robot(chain_text(dh_entries(AR4_ROWS[:5]), AR4_LIMITS[:5], more=more))


@pytest.mark.parametrize(
    ("header", "values"),
    [
        ("dx,dy,dz", [0.0, 0.0, 0.0]),
        (
            "qx,qy,qz,qw",
            [0.0, 1.0, 0.0, 0.0],
        ),
        ("dx,dy,dz,phi", [0.0, 0.0, -1.0, 5.0]),
    ],
    ids=str,
)
def test_an_arm_of_five_axes_takes_directions(header: str, values: list[float], tmp_path: Path) -> None:
    right = [1.0, *[0.0] * (len(values) - 1)]
    complaint(tmp_path, csv(header, [[*ROW, *right], [*ROW, *values]]), five_axes())


def test_a_direction_of_any_length_is_where_the_tool_points(tmp_path: Path) -> None:
    robot = five_axes()
    joints = np.array([[5.0, 20.0, 30.0, 10.0, 0.0], [15.0, 25.0, 20.0, 5.0, 0.0]])
    poses = make_kinematics(robot).forward(joints)
    rows = np.column_stack([poses[:, :3], 3.0 * poses[:, 3:]])
    found = make_kinematics(robot).forward(read(tmp_path, csv("dx,dy,dz", rows.tolist()), robot).points.positions)
    assert found == pytest.approx(poses, abs=1e-5)
