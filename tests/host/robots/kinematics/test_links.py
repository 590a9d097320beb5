"""The parts that pictures draw: where they end, what stays as long as it is, and the DH frames that they go through."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import ArmPart, Kinematics, Role, make_kinematics
from steptwin.host.robots.kinematics.dh import DhTable
from tests.features.papers.mechanisms import ALL, HYBRID, LAB, WAREHOUSE, Mechanism, each_mechanism
from tests.host.robots.kinematics.test_usual_scara import COMBINATIONS, drawn, scara

USUAL = [
    (make_kinematics(robot), drawn(robot, 50, seed=11))
    for robot in (scara(*combination, tool_mm=30.0 * combination[1]) for combination in COMBINATIONS)
]
PAPERS = [(each.kinematics, each.random_joints(50, seed=11)) for each in ALL]
each_arm = pytest.mark.parametrize(("kinematics", "joints"), PAPERS + USUAL)


def part(parts: tuple[ArmPart, ...], name: str) -> FloatArray:
    """Return the points of one part, of shape (n, points, 3)."""
    (found,) = (one for one in parts if one.name == name)
    return found.points_mm


def lengths_mm(points_mm: FloatArray) -> FloatArray:
    """Return the lengths of a part's straight pieces, shape (n, points - 1)."""
    return np.asarray(np.linalg.norm(np.diff(points_mm, axis=1), axis=2))


def frames(kinematics: Kinematics, joints: FloatArray) -> list[FloatArray]:
    """Return the origin of each frame of the DH table, each of shape (n, 3)."""
    table, variables = kinematics.dh, kinematics.dh_variables(joints)
    tables = (DhTable(table.convention, table.rows[: row + 1]) for row in range(len(table.rows)))
    return [each.transforms(variables)[:, :3, 3] for each in tables]


@each_arm
def test_the_last_point_is_the_tools_tip(kinematics: Kinematics, joints: FloatArray) -> None:
    tips_mm = kinematics.links(joints)[-1].points_mm[:, -1]
    assert tips_mm == pytest.approx(kinematics.forward(joints)[:, :3], abs=1e-9)


@each_arm
def test_ends_of_links_are_frames_of_the_dh_table(kinematics: Kinematics, joints: FloatArray) -> None:
    """The last link begins at a frame. It ends above, below or at another, because a lift behind it moves that one."""
    origins, parts = frames(kinematics, joints), kinematics.links(joints)
    last_mm = [one for one in parts if one.role is Role.LINK][-1].points_mm
    assert min(np.abs(origin - last_mm[:, -2]).max() for origin in origins[:-1]) < 1e-9
    assert min(np.abs(origin[:, :2] - last_mm[:, -1, :2]).max() for origin in origins) < 1e-9
    assert parts[-1].points_mm[:, -1] == pytest.approx(origins[-1], abs=1e-9)


@each_arm
def test_links_keep_their_lengths_and_hang_together(kinematics: Kinematics, joints: FloatArray) -> None:
    parts = kinematics.links(joints)
    for one in parts:
        if one.role in (Role.LINK, Role.SLIDE):
            of_each = lengths_mm(one.points_mm)
            assert of_each == pytest.approx(np.broadcast_to(of_each[0], of_each.shape), abs=1e-9), one.name
    chain = [one for one in parts if one.role is Role.LINK]
    last = chain[-1].points_mm[:, -1]
    assert parts[-1].points_mm[:, 0] == pytest.approx(last, abs=1e-9)
    assert all(one.points_mm.shape[0] == len(joints) for one in parts)


@each_mechanism
def test_each_row_is_computed_alone(mechanism: Mechanism) -> None:
    joints = mechanism.random_joints(5, seed=2)
    together = mechanism.kinematics.links(joints)
    for i in range(5):
        for one, alone in zip(together, mechanism.kinematics.links(joints[i : i + 1]), strict=True):
            assert one.points_mm[i] == pytest.approx(alone.points_mm[0], abs=1e-12)


def test_the_lab_arm_at_zero() -> None:
    parts = LAB.kinematics.links(np.array([[100.0, 0.0, 0.0, 0.0]]))
    assert part(parts, "column d1")[0].tolist() == [[0, 0, -150], [0, 0, 250]]
    assert part(parts, "slide d1")[0].mean(axis=0) == pytest.approx([0, 0, 100])
    assert part(parts, "first link")[0] == pytest.approx(np.array([[0, 0, 100], [0, 400, 100]]), abs=1e-9)
    assert part(parts, "tool")[0] == pytest.approx(np.array([[0, 800, 100], [0, 800, -50], [0, 800, -50]]), abs=1e-9)
    assert part(parts, "hand")[0, 1] == pytest.approx([0, 864, -50])


def test_the_warehouse_robots_slides() -> None:
    joints = np.array([[0.0, 0.0, 100.0, 0.0, 60.0, 30.0], [700.0, 250.0, 100.0, 0.0, 60.0, 30.0]])
    parts = WAREHOUSE.kinematics.links(joints)
    fixed, moved = part(parts, "rail sx"), (700.0, 0.0, 250.0)
    assert fixed[0].tolist() == fixed[1].tolist() == [[0, -210, 0], [2000, -210, 0]]
    assert part(parts, "mast sz")[1].tolist() == [[700, -210, 0], [700, -210, 1000]]
    assert part(parts, "slide sz")[1].mean(axis=0) == pytest.approx([700, -210, 250])
    assert part(parts, "bracket")[1].tolist() == [[700, -210, 250], [700, 0, 250]]
    assert part(parts, "column L1")[1].tolist() == [[700, 0, 250], [700, 0, 450]]
    for name in ("first link", "second link", "tool", "hand", "slide L1"):
        before_mm, after_mm = part(parts, name)
        assert after_mm - before_mm == pytest.approx(np.broadcast_to(moved, before_mm.shape))


def test_the_sliders_of_the_hybrid_arm() -> None:
    joints = HYBRID.random_joints(50, seed=4)
    parts = HYBRID.kinematics.links(joints)
    for column, name in ((1, "Z5"), (2, "Z6")):
        link_mm, screw_mm = part(parts, f"link {name}"), part(parts, f"screw {name}")
        assert lengths_mm(link_mm) == pytest.approx(350.0)
        assert link_mm[:, 0, 2] == pytest.approx(400.0 + joints[:, column])
        assert link_mm[:, 0, :2] == pytest.approx(screw_mm[:, 0, :2])
        assert part(parts, f"slider {name}").mean(axis=1) == pytest.approx(link_mm[:, 0])
    assert part(parts, "link Z5")[:, 1] == pytest.approx(part(parts, "link Z6")[:, 1])
    apart_mm = part(parts, "screw Z6")[:, 0, :2] - part(parts, "screw Z5")[:, 0, :2]
    assert np.hypot(*apart_mm.T) == pytest.approx(300.0)
    assert lengths_mm(part(parts, "arm")) == pytest.approx(300.0)


def test_the_third_chain_of_the_hybrid_arm_keeps_its_platform_level() -> None:
    """A parallelogram: the guide is parallel to the link of Z5, and the platform's pivots stay above each other."""
    parts = HYBRID.kinematics.links(HYBRID.random_joints(50, seed=4))
    guide_mm, link_mm, platform_mm = (part(parts, name) for name in ("guide link", "link Z5", "platform"))
    assert np.diff(guide_mm, axis=1) == pytest.approx(np.diff(link_mm, axis=1), abs=1e-9)
    assert guide_mm[:, 1] == pytest.approx(platform_mm[:, 1])
    assert np.diff(platform_mm, axis=1)[:, 0] == pytest.approx(np.broadcast_to([0.0, 0.0, 52.5], (50, 3)), abs=1e-9)
