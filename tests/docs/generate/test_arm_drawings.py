"""The arm in space: what is drawn stands where the DH product puts it, whatever the robot, and always alike."""

from functools import cache
from io import BytesIO
from typing import Any

import numpy as np
import pytest

mpl = pytest.importorskip("matplotlib")

from matplotlib.figure import Figure  # noqa: E402

from docs.generate.arm_drawings import dimension_names, draw_arm_in_space, draw_link_frames  # noqa: E402
from steptwin.host.record.plots.in_space import HAND  # noqa: E402
from steptwin.host.robots import load_robot, robot_names  # noqa: E402
from steptwin.host.robots.kinematics import make_kinematics  # noqa: E402


@cache
def arm_in_space(name: str) -> Figure:
    """Return the picture of an arm for tests that only look at it."""
    return draw_arm_in_space(load_robot(name))


def position(name: str) -> tuple[float, ...]:
    """Return joints in the middle between home and the upper limits."""
    robot = load_robot(name)
    return tuple(0.7 * home + 0.3 * joint.upper for home, joint in zip(robot.home, robot.joints, strict=True))


def product(name: str, joints: tuple[float, ...]) -> list[Any]:
    """Return the frames behind each row of the table, multiplied here link by link."""
    kinematics = make_kinematics(load_robot(name))
    variables = {key: float(value[0]) for key, value in kinematics.dh_variables(np.array([joints])).items()}
    frames = [np.eye(4)]
    for row in kinematics.dh.rows:
        d, theta = (
            p.constant + (p.sign * variables[p.variable] if p.variable else 0.0) for p in (row.d_mm, row.theta_deg)
        )
        ca, sa = np.cos(np.deg2rad(row.alpha_deg)), np.sin(np.deg2rad(row.alpha_deg))
        ct, st = np.cos(np.deg2rad(theta)), np.sin(np.deg2rad(theta))
        about_x = np.array([[1, 0, 0, row.a_mm], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
        about_z = np.array([[ct, -st, 0, 0], [st, ct, 0, 0], [0, 0, 1, d], [0, 0, 0, 1]])
        pair = (about_x, about_z) if kinematics.dh.convention.value == "modified" else (about_z, about_x)
        frames.append(frames[-1] @ pair[0] @ pair[1])
    return frames


@pytest.mark.parametrize("name", robot_names())
def test_frames_stand_on_the_product_of_the_links(name: str) -> None:
    joints = position(name)
    axes: Any = draw_link_frames(load_robot(name), joints).axes[0]
    texts = {text.get_text(): np.array(text.get_position_3d()) for text in axes.texts}
    frames = product(name, joints)
    extent_mm = max(high - low for low, high in (axes.get_xlim3d(), axes.get_ylim3d(), axes.get_zlim3d()))
    seen = set()
    for label, place_mm in texts.items():
        for number in map(int, label[1:].split(",")):
            frame = frames[number]
            along = place_mm - frame[:3, 3]
            direction = frame[:3, "xyz".index(label[0])]
            assert np.linalg.norm(along) < 0.3 * extent_mm, label
            assert along @ direction == pytest.approx(np.linalg.norm(along), rel=0.15), label
            seen.add((label[0], number))
    assert seen == {(letter, number) for letter in "xyz" for number in range(len(frames))}


@pytest.mark.parametrize("name", robot_names())
def test_the_arm_is_in_view_with_equal_scales(name: str) -> None:
    robot = load_robot(name)
    axes: Any = arm_in_space(name).axes[0]
    tool_mm = make_kinematics(robot).forward(np.array([robot.home]))[0, :3]
    spans = []
    shown_mm = tool_mm if tool_mm.size else np.zeros(3)  # of a machine without a tool, the foot of its first joint
    for value, (low, high) in zip(shown_mm, (axes.get_xlim3d(), axes.get_ylim3d(), axes.get_zlim3d()), strict=True):
        assert low - 1e-6 <= value <= high + 1e-6
        spans.append(high - low)
    assert np.array(spans) / max(spans) == pytest.approx(axes.get_box_aspect() / max(axes.get_box_aspect()))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("lab-scara", {(2, "a"): "a2", (3, "a"): "a3", (4, "d"): "d5"}),
        ("warehouse-scara", {(3, "a"): "L2", (4, "a"): "L3", (5, "a"): "L5", (5, "d"): "L4"}),
        ("teaching-scara", {(2, "a"): "l2", (1, "a"): "l1", (3, "d"): "d4"}),
        ("calibration-scara", {(0, "a"): "L1", (1, "a"): "L2", (0, "d"): "d1"}),
        ("hybrid-arm", {(0, "d"): "l1", (1, "d"): "l2", (3, "a"): "l3", (3, "d"): "l4"}),
    ],
)
def test_lengths_of_the_table_carry_the_names_of_the_robot_file(
    name: str, expected: dict[tuple[int, str], str]
) -> None:
    assert dimension_names(load_robot(name)) == expected


@pytest.mark.parametrize("name", robot_names())
def test_arrows_are_as_long_as_they_say_and_joints_are_named(name: str) -> None:
    robot = load_robot(name)
    axes: Any = arm_in_space(name).axes[0]
    said = [text.get_text() for text in axes.texts]
    stated_mm = [float(text.split()[2]) for text in said if text.endswith(" mm")]
    hand = [arrow for arrow in axes.collections if mpl.colors.same_color(arrow.get_color(), HAND)]
    assert len(hand) == (0 if robot.kinematics in ("cartesian", "axes") else 1)  # it shows the tool's direction
    shafts = [np.array(arrow._segments3d)[0] for arrow in axes.collections if arrow not in hand]  # noqa: SLF001
    drawn_mm = [np.linalg.norm(shaft[-1] - shaft[0]) for shaft in shafts]
    assert drawn_mm == pytest.approx(np.repeat(stated_mm, 2))
    named = {joint for text in said if not text.endswith(" mm") for joint in text.split(", ")}
    assert named == set(robot.joint_names)


@pytest.mark.parametrize("name", ["ar4-mk3", "parol6"])
def test_no_name_of_a_joint_lies_on_another(name: str) -> None:
    """In the picture, at the size in which it is written, also where axes meet in the wrist."""
    figure = arm_in_space(name)
    figure.savefig(BytesIO(), format="png")
    axes: Any = figure.axes[0]
    places = [text.get_window_extent() for text in axes.texts]
    assert len(places) == 6
    for i, place in enumerate(places):
        assert not any(place.overlaps(other) for other in places[:i])
