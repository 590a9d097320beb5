"""Files of the tool's poses: inverse kinematics at each point, one branch, turns without jumps."""

import json
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motions.composer import Sequence, Standstill
from steptwin.host.planning.planner import plan
from steptwin.host.planning.trajectory_file import FileMotion, read_file_motion
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.robots.kinematics import make_kinematics
from tests.host.complaints import complaint_of
from tests.host.robots.kinematics.test_usual_scara import scara
from tests.laws import law_of

ROBOT = load_robot("teaching-scara")
CSV = """t,x,y,z,phi
0,150,80,-60,0
1,150,-20,-60,30
2,120,-60,-50,30
"""
NAMED = "t,x,y,z,phi,elbow\n0,150,80,-60,0,{}\n1,150,70,-60,0,\n"
JOINTS = "t,th1,th2,d3,th4\n0,0,10,0,0\n1,0,0,0,0\n"


def poses_of(csv: str) -> FloatArray:
    return np.array([[float(field) for field in line.split(",")[1:5]] for line in csv.split()[1:]])


def read(
    folder: Path, text: str, robot: str = "teaching-scara", elbow: str | None = None, suffix: str = ".csv"
) -> FileMotion:
    file = folder / f"poses{suffix}"
    file.write_text(text, encoding="utf-8")
    return read_file_motion(str(file), load_robot(robot), elbow=elbow)


def complaint(folder: Path, text: str, robot: str = "teaching-scara", elbow: str | None = None) -> str:
    return complaint_of(lambda: read(folder, text, robot, elbow)).removeprefix(f"{folder}/poses.csv: ")


@pytest.mark.parametrize("elbow", ["right", "left"])
def test_the_tool_is_at_the_poses(elbow: str, tmp_path: Path) -> None:
    """In CSV, in JSON, with the columns in another order; the branch by option or column."""
    header, *rows = CSV.split()
    points = [
        {"positions": [*map(float, row.split(",")[1:])], "time_from_start": float(row.split(",")[0])} for row in rows
    ]
    mixed = "t,phi,elbow,x,z,y\n" + "".join(
        f"{t},{phi},{elbow if t == '1' else ''},{x},{z},{y}\n" for t, x, y, z, phi in (row.split(",") for row in rows)
    )
    document = json.dumps({"joint_names": header.split(",")[1:], "points": points})
    motions = [
        read(tmp_path, CSV, elbow=elbow),
        read(tmp_path, mixed),
        read(tmp_path, mixed, elbow=elbow),
        read(tmp_path, document, elbow=elbow, suffix=".json"),
    ]
    for motion in motions:
        joints = motion.whole.positions(np.array([0.0, 1.0, 2.0]))
        assert make_kinematics(ROBOT).forward(joints) == pytest.approx(poses_of(CSV), abs=1e-9)
        assert (joints[:, 1] > 0).all() == (elbow == "right")
        assert motion.points.branch == elbow
        plan(ROBOT, motion.whole)


@pytest.mark.parametrize("name", [name for name in robot_names() if make_kinematics(load_robot(name)).task.width])
def test_every_robot_follows_its_own_tool(name: str, tmp_path: Path) -> None:
    """Poses of joint positions beside home lead back to them; slides, which no pose determines, are at home."""
    robot = load_robot(name)
    home = np.array(robot.home)
    off = np.array([0.0 if joint.name in ("sx", "sz") else 3.0 for joint in robot.joints])
    joints = np.clip(
        [home + off / 3.0, home + off, home + off / 3.0],
        [j.lower for j in robot.joints],
        [j.upper for j in robot.joints],
    )
    kinematics = make_kinematics(robot)
    task = kinematics.task
    figures = task.figures(kinematics.forward(joints)).tolist()
    rows = "".join(f"{i}," + ",".join(map(repr, pose)) + "\n" for i, pose in enumerate(figures))
    tried = [branch for branch in kinematics.branches if _reaches(robot.name, joints, branch)]
    found = read(tmp_path, f"t,{','.join(task.coordinates)}\n{rows}", name, elbow=tried[0])
    assert found.points.positions == pytest.approx(joints, abs=1e-6)


def _reaches(name: str, joints: FloatArray, branch: str) -> bool:
    """Return whether this is the branch of these joints."""
    kinematics = make_kinematics(load_robot(name))
    solved = kinematics.solve(kinematics.forward(joints), branch, joints[0]).joints
    return bool(np.allclose(solved, joints, atol=1e-6))


def test_without_a_name_it_is_the_branch_that_reaches_all(tmp_path: Path) -> None:
    """Near the shoulder's limit of 130 deg only one elbow reaches."""
    assert read(tmp_path, CSV).points.branch == "right"
    beside = "t,x,y,z,phi\n0,-60,140,-60,0\n1,-90,110,-60,0\n"
    assert read(tmp_path, beside).points.branch == "right"
    mirrored = "t,x,y,z,phi\n0,-60,-140,-60,0\n1,-90,-110,-60,0\n"
    assert read(tmp_path, mirrored).points.branch == "left"
    pose = np.array([[-60.0, -140.0, -60.0, 0.0]])
    reason = make_kinematics(ROBOT).solve(pose, "right", np.array(ROBOT.home)).reason(0)
    assert complaint(tmp_path, mirrored, elbow="right") == (
        "line 2: x -60, y -140, z -60 mm, phi 0 deg is out of reach on the branch 'right':"
        f" {reason}; the branch 'left' reaches all points (elbow=left)"
    )


def test_where_the_branch_would_have_to_change(tmp_path: Path) -> None:
    told = complaint(tmp_path, "t,x,y,z,phi\n0,-90,110,-60,0\n1,150,0,-60,0\n\n3,-90,-110,-60,0\n")
    assert told.startswith("line 5: x -90, y -110, z -60 mm, phi 0 deg is out of reach on the branch 'right': th1: ")
    assert "; the branch 'left' reaches it, but not line 2: th1: " in told
    assert told.endswith("; the arm would have to change the branch on the way, which takes a file of joints")


@pytest.mark.parametrize(
    ("text", "elbow", "told"),
    [
        (
            CSV.replace("1,150,-20", "1,250,-20"),
            None,
            "line 3: x 250, y -20, z -60 mm, phi 30 deg is out of reach on the branch 'right':"
            " shoulder to wrist 250.8 mm is outside 5..195 mm, by 55.8 mm; x 194.3, y -15.5 mm passes",
        ),
        (CSV, "rihgt", "elbow: 'rihgt' is unknown: did you mean right?"),
        (
            "t,x,y,z,phi,elbow\n0,150,80,-60,0,left\n1,150,70,-60,0,left\n2,150,60,-60,0,right\n",
            None,
            "line 4, elbow: 'right' after 'left': a file of poses keeps its branch; a file of joints can change it",
        ),
        (NAMED.format("left"), "right", "elbow=right: the file's own elbow is 'left'"),
        (NAMED.format("lef"), None, "elbow: 'lef' is unknown: did you mean left?"),
        ("t,x,y,z,phi,elbow\n0,150,80,-60,left\n", None, "line 2: 5 fields, the header has 6"),
        ("t,x,y,z,phi,elbow\n0,150,80,five,0,left\n", None, "line 2, z: 'five' is not a number"),
        ("t,x,y,z\n0,150,80,-60\n", None, "column 'phi' is missing: a pose has x y z phi"),
        ("t,x,y,z,phi,psi\n0,150,80,-60,0,0\n", None, "column 'psi' is unknown: did you mean phi?"),
        ("t,x,y,z,elbow\n0,150,80,-60,left\n", None, "column 'phi' is missing: a pose has x y z phi"),
        (JOINTS, "left", "elbow=left: is for a file of the tool's poses; this one has joints"),
        ("t,x,y,z,phi,th1\n0,150,80,-60,0,0\n", None, "joint 'x' is unknown: there are th1, th2, d3, th4"),
    ],
)  # fmt: skip
def test_mistakes(text: str, elbow: str | None, told: str, tmp_path: Path) -> None:
    assert complaint(tmp_path, text, elbow=elbow) == told


@pytest.mark.parametrize(("start_deg", "step_deg"), [(0, 50), (0, -50), (-4, 50), (-4, -50)])
def test_a_wrist_goes_on_over_several_turns(start_deg: int, step_deg: int, tmp_path: Path) -> None:
    """A tool that turns by 450 deg: th4 of the laboratory robot begins at 178 or -178 of its 360 deg, or a
    turn beside it.
    """
    rows = [f"{i},-300,400,0,{start_deg + step_deg * i}\n" for i in range(16)]
    motion = read(tmp_path, "".join(["t,x,y,z,phi\n", *rows[:10]]), "lab-scara")
    th4 = motion.points.positions[:, 3]
    assert np.diff(th4) == pytest.approx(-step_deg, abs=1e-9)
    assert np.abs(th4).max() <= 360
    assert np.ptp(motion.points.positions[:, :3], axis=0) == pytest.approx(0.0, abs=1e-9)
    told = complaint(tmp_path, "".join(["t,x,y,z,phi\n", *rows]), "lab-scara")
    assert "deg is outside -360..360 deg" in told


def test_the_tool_stands_where_poses_repeat(tmp_path: Path) -> None:
    text = "t,x,y,z,phi\n0,150,80,-60,0\n1,150,-20,-60,30\n1.5,150,-20,-60,30\n2,120,-60,-50,30\n"
    motion = read(tmp_path, text).whole
    assert [type(part.law) is Standstill for part in law_of(motion, Sequence).parts] == [False, True, False]


def test_velocities_of_the_tool_become_the_joints(tmp_path: Path) -> None:
    text = "t,x,y,z,phi,v_x,v_y,v_z,v_phi\n0,150,80,-60,0,0,0,0,0\n1,150,30,-60,10,5,-40,-3,20\n2,150,0,-60,0,0,0,0,0\n"
    motion = read(tmp_path, text).whole
    before, after = make_kinematics(ROBOT).forward(motion.positions(np.array([1 - 1e-6, 1 + 1e-6])))
    assert (after - before) / 2e-6 == pytest.approx([5, -40, -3, 20], rel=1e-5)


def test_a_tool_that_does_not_turn_needs_no_phi(tmp_path: Path) -> None:
    robot = scara(turning=False)
    kinematics = make_kinematics(robot)
    z_mm = kinematics.forward(np.array([[20.0, 60.0, 10.0]]))[0, 2]
    file = tmp_path / "poses.csv"
    rows = f"0,150,180,{z_mm},right,0,0,0\n1,150,130,{z_mm},,5,-40,-3\n2,150,110,{z_mm},,0,0,0\n"
    file.write_text(f"t,x,y,z,elbow,v_x,v_y,v_z\n{rows}", encoding="utf-8")
    motion = read_file_motion(str(file), robot).whole
    before, at, after = kinematics.forward(motion.positions(np.array([1 - 1e-6, 1, 1 + 1e-6])))[:, :3]
    assert at == pytest.approx([150, 130, z_mm], abs=1e-9)
    assert (after - before) / 2e-6 == pytest.approx([5, -40, -3], rel=1e-5)
    file.write_text(f"t,x,y,z\n0,150,180,{z_mm}\n1,150,130,{z_mm}\n1.5,150,130,{z_mm}\n", encoding="utf-8")
    assert isinstance(read_file_motion(str(file), robot).whole.law, Sequence)


def test_lines_of_the_tool_are_the_files(tmp_path: Path) -> None:
    """With joints as points the tool need not go straight; with poses it should, and it does not."""
    (*_, tool) = read(tmp_path, "t,x,y,z,phi\n0,150,80,-60,0\n1,150,-80,-60,0\n").departures()
    assert tool.what == "tool"
    assert tool.distance == pytest.approx(20.0)  # from 150, 80 to 150, -80: the radius is 170
