"""Chains of URDFs: their poses against products of rotations written out here, angles, limits and what is told."""

import re
from math import atan2, degrees, pi
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.robots import read_robot
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.kinematics.kinds import make_kinematics
from tests.features.urdf.urdfs import Matrix, joint, moved, placed, product, robot_of, urdf
from tests.messages import refusing


def frame_at(text: str, *positions: float) -> Matrix:
    """The tool's transform of a robot file, in mm."""
    kinematics = make_kinematics(read_robot(text))
    return [list(row) for row in tool_frames(kinematics, np.array([positions]))[0].tolist()]


MIXED = urdf(
    joint("mount", "a", "b", '<origin xyz="0.1 -0.2 0.3" rpy="0.1 0.2 0.3"/>', kind="fixed"),
    joint("J1", "b", "c", '<origin xyz="0 0 0.16977" rpy="-1.2 0.4 2"/><axis xyz="0 0 -3"/>'),
    joint("J2", "c", "d"),
    joint("bend", "d", "e", '<origin rpy="0 1.5707963267948966 0.7"/>', kind="fixed"),
    joint("J3", "e", "f", '<origin xyz="0.05 0 0.01" rpy="0.3 0 0"/><axis xyz="0 3 4"/>', kind="prismatic"),
    joint("J4", "f", "g", '<origin xyz="0 0.02 0"/><axis xyz="0 1 0"/>', kind="continuous"),
    joint("flange", "g", "h", '<origin xyz="0 0 0.041"/>', kind="fixed"),
    joint("tip", "h", "i", '<origin xyz="0.001 0 0" rpy="3 0 0"/>', kind="fixed"),
)
"""Every kind of joint, origins and axes that are left out, axes that are not 1 long, fixed joints everywhere."""


@pytest.mark.parametrize("seed", range(5))
def test_poses_are_the_product_of_all_origins_and_joints(seed: int, tmp_path: Path) -> None:
    q1, q2, d3, q4 = np.random.default_rng(seed).uniform([-2, -2, -2, -3], [2, 2, 2, 3]).tolist()
    expected = product(
        placed((0.1, -0.2, 0.3), (0.1, 0.2, 0.3)),
        placed((0, 0, 0.16977), (-1.2, 0.4, 2)),
        moved((0, 0, -3), q1),
        moved((1, 0, 0), q2),
        placed((0, 0, 0), (0, pi / 2, 0.7)),
        placed((0.05, 0, 0.01), (0.3, 0, 0)),
        moved((0, 3, 4), d3, slides=True),
        placed((0, 0.02, 0), (0, 0, 0)),
        moved((0, 1, 0), q4),
        placed((0, 0, 0.041), (0, 0, 0)),
        placed((0.001, 0, 0), (3, 0, 0)),
    )
    found = frame_at(
        robot_of(tmp_path, MIXED, "i", held="J4").text, *np.rad2deg([q1, q2]), 1000 * d3, float(np.rad2deg(q4))
    )
    for ours, theirs in zip(found[:3], expected, strict=False):
        assert ours[:3] == pytest.approx(theirs[:3], abs=1e-12)
        assert ours[3] == pytest.approx(1000 * theirs[3], abs=1e-9)


def test_from_another_base_the_frames_before_it_are_left_out(tmp_path: Path) -> None:
    found = robot_of(tmp_path, MIXED, tip="d", base="b")
    assert found.joints == ("J1", "J2")
    assert frame_at(found.text, 0, 0)[2][3] == pytest.approx(169.77, abs=1e-12)


def test_numbers_keep_their_few_digits(tmp_path: Path) -> None:
    text = urdf(joint("J1", "a", "b", '<origin xyz="0 0 0.16977" rpy="0 1.5707963267948966 0"/>'), links="ab")
    assert (
        "J1 = { xyz_mm = [0.0, 0.0, 169.77], rpy_deg = [0.0, 90.0, 0.0], axis = [1.0, 0.0, 0.0] }\n"
        in robot_of(tmp_path, text).text
    )


def test_a_quaternion_is_a_turn_as_well(tmp_path: Path) -> None:
    half = 0.5**0.5
    text = urdf(joint("J1", "a", "b", f'<origin xyz="1 0 0" quat_xyzw="0 0 {half} {half}"/>'), links="ab")
    assert "rpy_deg = [0.0, 0.0, 90.0]" in robot_of(tmp_path, text).text


def test_a_rounded_quaternion_is_made_a_turn(tmp_path: Path) -> None:
    """Its length is 1.00072: the turn about x by 2 atan(0.36 / 0.9337) is what it says."""
    text = urdf(joint("J1", "a", "b", '<origin quat_xyzw="0.36 0 0 0.9337"/>'), links="ab")
    (roll,) = re.findall(r"J1 = { rpy_deg = \[(.*?), 0.0, 0.0\]", robot_of(tmp_path, text).text)
    assert float(roll) == pytest.approx(2 * degrees(atan2(0.36, 0.9337)), abs=1e-9)


def test_fixed_frames_before_the_first_joint_are_the_base(tmp_path: Path) -> None:
    fixed = joint("F", "a", "b", '<origin xyz="0.1 0 0.2"/>', "fixed")
    geometry = robot_of(tmp_path, urdf(fixed, joint("J1", "b", "c", '<origin xyz="0 0 0.3"/>'), links="abc")).geometry
    assert geometry["base"] == {"xyz_mm": [100.0, 0.0, 200.0]}
    chain = geometry["chain"]
    assert isinstance(chain, dict)
    assert chain["J1"]["xyz_mm"] == [0.0, 0.0, 300.0]


@pytest.mark.parametrize(
    ("angle", "is_told", "snapped_deg"),
    [
        (pi / 2, False, 90.0),
        (pi / 2 + 0.9e-9, False, 90.0),
        (pi / 2 + 1.1e-9, True, 90.0),
        (1.5708, True, 90.0),
        (-3.14159, True, -180.0),
        (0.261799, True, 15.0),
        (1e-5, True, 0.0),
        (pi / 2 - 1.99e-5, True, 90.0),
        (pi / 2 - 2.01e-5, False, 90.0 - 2.01e-5 * 180 / pi),
        (1.57, False, 1.57 * 180 / pi),
    ],
)
def test_angles_near_a_multiple_of_15_degrees(angle: float, is_told: bool, snapped_deg: float, tmp_path: Path) -> None:
    text = urdf(joint("J1", "a", "b", f'<origin rpy="0 0 {angle!r}"/>'), links="ab")
    for snap, expected_deg, ways in (
        (False, np.rad2deg(angle), "--snap makes them exact"),
        (True, snapped_deg, "are now exact"),
    ):
        made = robot_of(tmp_path, text, snap=snap)
        told = f"angles within 2e-5 rad of multiples of 15 deg, at J1: {ways}"
        assert (told in made.notes) == is_told
        rpy_deg = made.geometry["chain"]["J1"].get("rpy_deg", [0.0, 0.0, 0.0])
        assert rpy_deg == pytest.approx([0.0, 0.0, expected_deg], abs=1e-9)


def test_limits_become_degrees_and_mm_and_speeds_stay_below_the_files(tmp_path: Path) -> None:
    robot = read_robot(robot_of(tmp_path, MIXED, "i", held="J4").text)
    one, _, three, four = robot.joints
    assert one.unit is Unit.DEG
    assert (one.lower, one.upper) == pytest.approx((-114.591559026, 143.239448783), abs=1e-8)
    assert (three.unit, three.lower, three.upper) == (Unit.MM, -2000.0, 2500.0)
    assert (four.lower, four.upper) == (-180.0, 180.0)
    assert one.speed_max == 57.0  # 1 rad/s is 57.3
    assert four.speed_max == 130.0  # none in the file: motor and driver


def notes(folder: Path, *joints: str, **settings: str) -> tuple[str, ...]:
    return robot_of(folder, urdf(*joints, links="abc"), **settings).notes  # type: ignore[arg-type]


def limited(name: str, ends: str, lower: object, upper: object, more: str = 'effort="1" velocity="1"') -> str:
    return joint(name, ends[0], ends[1], f'<limit lower="{lower}" upper="{upper}" {more}/>')


QUARTERS = "limits are -90..90 deg at every revolute joint: probably a placeholder; set those of the machine"


def test_limits_that_are_placeholders(tmp_path: Path) -> None:
    first = limited("J1", "ab", -1.57, 1.57)
    assert QUARTERS in notes(tmp_path, first, limited("J2", "bc", -1.5708, 1.5708))
    assert QUARTERS not in notes(tmp_path, first, limited("J2", "bc", -1.5708, 1.6))
    assert QUARTERS in notes(tmp_path, first, limited("J2", "bc", -1.5708, 1.5725))
    assert QUARTERS not in notes(tmp_path, first, limited("J2", "bc", -1.5708, 1.5727))
    assert QUARTERS not in notes(tmp_path, first, joint("J2", "b", "c", kind="fixed"))


def test_efforts_and_velocities_that_are_placeholders(tmp_path: Path) -> None:
    effort = "effort is below 0 at J1: a placeholder, as its other limits may be"
    still = "no velocity above 0 at J1: speed_max follows from motor and driver alone"
    second = limited("J2", "bc", -1, 1)
    for more, told in (
        ('effort="-1" velocity="1"', [effort]),
        ('effort="0" velocity="0"', [still]),
        ('effort="0"', [still]),
        ('effort="0" velocity="0.1"', []),
    ):
        found = notes(tmp_path, limited("J1", "ab", -1, 1, more), second)
        assert [note for note in found if note in (effort, still)] == told


def test_what_is_to_be_filled_in_is_told_until_it_is_set(tmp_path: Path) -> None:
    endless, sliding = joint("J1", "a", "b", kind="continuous"), joint("J2", "b", "c", kind="prismatic")
    fill = [note for note in notes(tmp_path, endless, sliding) if note.startswith("fill in ")]
    assert fill == [
        "fill in lower and upper of J1, continuous in the URDF: -180..180 deg stands there",
        "fill in ratio of J1: 20 stands there",
        "fill in travel_per_turn of J2: 8 stands there",
        "fill in microsteps of J1, J2: 8 stands there",
        "fill in drivers: [board] has those of a TB6560; --set driver_profile takes others",
        "fill in switches and homing: switches are 5 beyond each range",
    ]
    some = {"J1__lower": "-720", "J1__upper": "720", "J1__ratio": "50", "J2__microsteps": "16"}
    text = urdf(endless, sliding, links="abc")
    made = robot_of(tmp_path, text, **some)  # type: ignore[arg-type]
    assert [note for note in made.notes if note.startswith("fill in ")] == [
        fill[2],
        "fill in microsteps of J1: 8 stands there",
        *fill[4:],
    ]
    first, second = read_robot(made.text).joints
    assert (first.lower, first.upper, first.transmission.ratio, second.transmission.microsteps) == (-720, 720, 50, 16)


def wrist(offset_m: float, shoulder: str = "0 1 0") -> str:
    """A six-axis arm whose axis 6 is beside axis 4 by an offset."""
    axes = ("0 0 1", shoulder, "0 1 0", "1 0 0", "0 1 0", "1 0 0")
    places = ("0 0 0.1", "0.06 0 0.05", "0 0 0.3", "0.1 0 0", "0.12 0 0", f"0.04 0 {offset_m}")
    return urdf(
        *(
            joint(f"J{i + 1}", "abcdefg"[i], "abcdefg"[i + 1], f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>')
            for i, (xyz, axis) in enumerate(zip(places, axes, strict=True))
        ),
        links="abcdefg",
    )


_NUMERIC = "numeric, from the branches of an arm whose wrist's axes meet"


@pytest.mark.parametrize(
    ("offset_m", "note"),
    [
        (0.0, "in closed form: axes 2 and 3 are parallel, axes 4, 5 and 6 meet in a point"),
        (0.9e-7, "in closed form: axes 2 and 3 are parallel, axes 4, 5 and 6 meet in a point"),
        (
            1.1e-7,
            f"{_NUMERIC}: axes 4, 5 and 6 miss one point by 0.00011 mm",
        ),
        (
            0.0009,
            f"{_NUMERIC}: axes 4, 5 and 6 miss one point by 0.9 mm",
        ),
    ],
)
def test_wrist_axes_that_miss_are_told_in_mm(offset_m: float, note: str, tmp_path: Path) -> None:
    assert f"inverse kinematics {note}" in robot_of(tmp_path, wrist(offset_m)).notes


def test_wrist_axes_that_miss_are_told_beside_another_reason(tmp_path: Path) -> None:
    found = robot_of(tmp_path, wrist(0.002, "0 1 0.1")).notes
    assert found[:2] == (
        "inverse kinematics numeric, from the present joints: axes 2 and 3 are not parallel",
        "inverse kinematics numeric for another reason as well: axes 4, 5 and 6 miss one point by 2 mm",
    )
    assert len([note for note in robot_of(tmp_path, wrist(0.0, "0 1 0.1")).notes if "miss" in note]) == 0


def row_of(count: int) -> str:
    ends = "abcdefghi"
    return urdf(*(joint(f"J{i}", ends[i], ends[i + 1]) for i in range(count)), links=ends[: count + 1])


@pytest.mark.parametrize(("count", "held"), [(4, ["J0"]), (7, ["J0"]), (8, ["J0", "J1"])])
def test_more_joints_than_the_tool_takes_are_held(count: int, held: list[str], tmp_path: Path) -> None:
    with refusing(InputError):
        robot_of(tmp_path, row_of(count))
    made = robot_of(tmp_path, row_of(count), held=",".join(held))
    assert read_robot(made.text).geometry["held"] == tuple(held)
    for enough in (1, 2, 3, 5, 6):
        assert "held" not in robot_of(tmp_path, row_of(enough)).geometry


def test_what_the_tool_is_told_may_be_set(tmp_path: Path) -> None:
    made = robot_of(tmp_path, row_of(5), task="position", held="J0, J4")
    assert (made.geometry["task"], made.geometry["held"]) == ("position", ["J0", "J4"])
    with refusing(InputError):
        robot_of(tmp_path, row_of(5), task="all")


def test_names_that_a_table_of_a_robot_file_cannot_have(tmp_path: Path) -> None:
    made = robot_of(tmp_path, urdf(joint("Joint 1", "a", "b"), links="ab"))
    assert made.joints == ("Joint_1",)
    assert "renamed, to letters, digits, - and _: 'Joint 1' is Joint_1" in made.notes
