"""Files in radians and metres, as MoveIt writes them; and files that are questioned, since they hardly move a robot."""

import json
from functools import partial
from math import pi, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.planning.trajectory_file import doubt, read_file_motion, read_trajectory
from steptwin.host.robots import load_robot
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")
TIMES_S = (0.0, 1.0, 2.5)
DEG_MM = ((0.0, 30.0, 0.0, 0.0), (40.0, 60.0, 10.0, 5.0), (-20.0, 45.0, 25.0, -90.0))
"""Positions of th1, th2, d3 and th4."""
NAMES = ("th1", "th2", "d3", "th4")
FACTORS = {"deg": 1.0, "rad": radians(1.0), "mm": 1.0, "m": 0.001}


def csv(folder: Path, angle: str = "deg", length: str = "mm", rows: Any = DEG_MM) -> str:
    """Write the points in these units; return the file's name."""
    factors = (FACTORS[angle], FACTORS[angle], FACTORS[length], FACTORS[angle])
    lines = ["t,th1,th2,d3,th4"]
    for t_s, row in zip(TIMES_S, rows, strict=True):
        lines.append(",".join(map(repr, (t_s, *(value * factor for value, factor in zip(row, factors, strict=True))))))
    path = folder / f"{angle}-{length}.csv"
    path.write_text("\n".join(lines))
    return str(path)


@pytest.mark.parametrize(
    ("angle", "length", "units"),
    [
        ("rad", "m", "rad,m"),
        ("rad", "m", "m, rad"),
        ("rad", "mm", "rad"),
        ("rad", "mm", "mm,rad"),
        ("deg", "m", "m"),
        ("deg", "mm", "deg,mm"),
        ("deg", "mm", None),
    ],
)
def test_a_file_in_other_units_is_the_same_motion(angle: str, length: str, units: str | None, tmp_path: Path) -> None:
    motion = read_trajectory(csv(tmp_path, angle, length), ROBOT, units=units)
    assert motion.positions(np.array(TIMES_S)) == pytest.approx(np.array(DEG_MM), abs=1e-9)


def test_poses_and_velocities_have_the_units_too(tmp_path: Path) -> None:
    path = tmp_path / "pose.csv"
    path.write_text(f"t,x,y,z,phi,v_x,v_y,v_z,v_phi\n0,0.15,0.06,-0.05,{pi / 6},0,0,0,0\n1,0.16,0.05,-0.04,0,0,0,0,0\n")
    points = read_file_motion(str(path), ROBOT, units="rad,m").points
    assert points.tool_mm == pytest.approx(np.array([[150, 60, -50], [160, 50, -40]]))
    path.write_text("t,th1,th2,d3,th4,v_th1,v_th2,v_d3,v_th4\n0,0,0.5,0,0,0,0,0,0\n1,0.1,0.5,0.01,0,0.2,0,0.01,0\n")
    points = read_file_motion(str(path), ROBOT, units="rad,m", ramps_s=0.2).points
    assert points.velocities is not None
    assert points.velocities[1] == pytest.approx([11.459155902616466, 0, 10, 0])


@pytest.mark.parametrize(
    "units",
    [
        "radian",
        "rad,deg",
        "m,m",
        "",
    ],
)
def test_other_units_are_refused(units: str, tmp_path: Path) -> None:
    with refusing(InputError):
        read_trajectory(csv(tmp_path), ROBOT, units=units)


# --- as MoveIt writes it


def moveit(**changes: Any) -> dict[str, Any]:
    """Return a moveit_msgs/RobotTrajectory, its joints in another order, in radians and metres, planned at 10 Hz."""
    order = (2, 1, 0, 3)
    factors = (0.001, radians(1), radians(1), radians(1))
    points = [
        {
            "positions": [row[i] * factor for i, factor in zip(order, factors, strict=True)],
            "velocities": [0.0] * 4,
            "accelerations": [0.1, -0.2, 0.3, 0.0],
            "effort": [],
            "time_from_start": {"sec": int(t_s), "nanosec": round(1e9 * (t_s % 1.0)) + nanosec},
        }
        for t_s, row, nanosec in zip(TIMES_S, DEG_MM, (0, 317_000, 219_411), strict=True)
    ]
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "base_link"}
    joints = {"header": header, "joint_names": [NAMES[i] for i in order], "points": points}
    empty = {"header": header, "joint_names": [], "points": []}
    return {"joint_trajectory": joints, "multi_dof_joint_trajectory": empty} | changes


def written(folder: Path, document: object) -> str:
    path = folder / "moveit.json"
    path.write_text(json.dumps(document))
    return str(path)


def test_what_moveit_plans_is_read(tmp_path: Path) -> None:
    motion = read_file_motion(written(tmp_path, moveit()), ROBOT, units="rad,m")
    assert motion.points.times_s.tolist() == [0.0, 1.0, 2.5]
    assert motion.points.rounded_s == pytest.approx(0.000317)
    assert motion.points.unread == ("accelerations",)
    assert motion.whole.positions(np.array(TIMES_S)) == pytest.approx(np.array(DEG_MM), abs=1e-9)
    assert plan(ROBOT, motion.whole).motion.duration_s == 2.5


def test_times_are_rounded_to_the_nearest_millisecond(tmp_path: Path) -> None:
    document = moveit()
    document["joint_trajectory"]["points"][1]["time_from_start"]["nanosec"] = 600_000
    points = read_file_motion(written(tmp_path, document), ROBOT, units="rad,m").points
    assert points.times_s.tolist() == [0.0, 1.001, 2.5]
    assert points.rounded_s == pytest.approx(0.0004)


def test_without_velocities_only_the_end_is_rounded(tmp_path: Path) -> None:
    document = moveit()
    for point in document["joint_trajectory"]["points"]:
        point["velocities"] = []
    motion = read_file_motion(written(tmp_path, document), ROBOT, units="rad,m")
    assert motion.points.times_s.tolist() == [0.0, 1.000317, 2.5]


@pytest.mark.parametrize(
    ("document", "told"),
    [
        (
            moveit(multi_dof_joint_trajectory={"points": [{}]}),
            "multi_dof_joint_trajectory: has points; a motion of",
        ),
        (moveit(joint_trajectory=[]), "joint_trajectory: "),
        (moveit(other=1), "'other' is unknown"),
    ],
)
def test_what_is_no_motion_of_joints_is_refused(document: object, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        read_trajectory(written(tmp_path, document), ROBOT)
    assert told in str(refused.value)


def test_accelerations_are_numbers_although_they_are_not_read(tmp_path: Path) -> None:
    document = moveit()
    document["joint_trajectory"]["points"][1]["accelerations"] = [1, 2, "three", 4]
    with refusing(InputError):
        read_trajectory(written(tmp_path, document), ROBOT)


# --- files that are questioned

ASKED = "every joint stays below 5 % of its limits and of its range, at {} % at most. Is it in s, mm and degrees?"


def doubted(path: str, stretch: float = 1.0) -> str | None:
    motion = read_file_motion(path, ROBOT)
    planned = plan_stretched(ROBOT, motion.whole, stretch)
    return doubt(motion, planned, lambda units: read_file_motion(path, ROBOT, units=units))


@pytest.mark.parametrize(
    ("angle", "length", "end"),
    [
        ("rad", "m", " units=rad,m fits, too: angles are then 57.3 times, lengths 1000 times as large"),
        ("rad", "mm", " units=rad fits, too: angles are then 57.3 times as large"),
    ],
)
@pytest.mark.parametrize("stretch", [1.0, 3.0])
def test_radians_and_metres_are_asked_for(angle: str, length: str, end: str, stretch: float, tmp_path: Path) -> None:
    rows = [(th1, th2, d3 if length == "m" else 1.0, th4) for th1, th2, d3, th4 in DEG_MM]
    told = doubted(csv(tmp_path, angle, length, rows), stretch)
    assert told is not None
    assert told.startswith("every joint stays below 5 % of its limits and of its range, at ")
    assert told.endswith(f"Is it in s, mm and degrees?{end}")


def test_the_right_units_are_not_questioned(tmp_path: Path) -> None:
    assert doubted(csv(tmp_path)) is None
    assert doubted(csv(tmp_path), 100.0) is None  # slow on purpose


def slow(folder: Path, th1_deg: float, seconds: float) -> str:
    path = folder / "slow.csv"
    path.write_text(f"t,th1,th2,d3,th4\n0,0,30,0,0\n{seconds},{th1_deg},30,0,0\n")
    return str(path)


@pytest.mark.parametrize(("th1_deg", "asked"), [(12.99, True), (13.01, False), (0.0, False)])
def test_the_range_decides(th1_deg: float, asked: bool, tmp_path: Path) -> None:
    """th1 has 260 degrees, of which 13 are 5 %; a motion that stands still is not questioned."""
    assert (doubted(slow(tmp_path, th1_deg, 20.0)) is not None) is asked


@pytest.mark.parametrize(("seconds", "asked"), [(2.16, True), (2.14, False)])
def test_the_limits_decide(seconds: float, asked: bool, tmp_path: Path) -> None:
    """Of the 180 deg/s of th1 9 are 5 %; a spline over 12.9 deg in T has 1.5 * 12.9 / T in its middle."""
    told = doubted(slow(tmp_path, 12.9, seconds))
    assert (told is not None) is asked


def test_milliseconds_are_asked_for(tmp_path: Path) -> None:
    told = doubted(slow(tmp_path, 12.0, 500.0))
    assert told == ASKED.format("4.6") + " times in ms fit, too: divide them by 1000"


def test_what_fits_in_no_other_units_is_still_asked(tmp_path: Path) -> None:
    told = doubted(slow(tmp_path, 12.0, 3.0))
    assert told == ASKED.format("4.6")


def test_the_page_asks_with_the_titles_of_its_own_choice(tmp_path: Path) -> None:
    motions = pytest.importorskip("steptwin.features.panel.page.motions")
    content = Path(csv(tmp_path, "rad", "m")).read_bytes()
    upload = partial(motions.UploadedMotion, ROBOT, "mine.csv", content)
    _, told = motions.plan_upload(upload(1.0))
    assert "Is it in s, mm and degrees? “radians, m” fits, too: angles are then 57.3 times" in told
    planned, told = motions.plan_upload(upload(1.0, "rad,m"))
    assert told is None
    assert planned.motion.positions(np.array(TIMES_S)) == pytest.approx(np.array(DEG_MM), abs=1e-9)
