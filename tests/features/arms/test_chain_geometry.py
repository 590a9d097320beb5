"""Chains in robot files: one arm in three notations, and what is wrong in one line each."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from steptwin.host.common.errors import InputError
from steptwin.host.robots import read_robot
from tests.features.arms.arms import (
    AR4_LIMITS,
    AR4_ROWS,
    TEXTS,
    arm,
    chain_text,
    dh_entries,
    kinematics_of,
    random_joints,
)

AR4_FRAMES = {
    "J1": "xyz_mm = [0, 0, 169.77], axis = [0, 0, 1]",
    "J2": "xyz_mm = [64.2, 0, 0], rpy_deg = [-90, 0, 0], axis = [0, 0, 2]",
    "J3": "xyz_mm = [0, -305, 0], rpy_deg = [0, 0, 0], axis = [0, 0, 1]",
    "J4": "xyz_mm = [0, 0, 0], rpy_deg = [0, 90, 0], axis = [0, 0, 1]",
    "J5": "xyz_mm = [0, 0, 222.63], rpy_deg = [0, -90, 0], axis = [0, 0, 0.5]",
    "J6": "rpy_deg = [0, 90, 0], axis = [0, 0, 1]",
}
"""The AR4 as a URDF writes it: the frames of the joints, all but the wrist's signs as in the DH table."""


def test_the_same_arm_from_frames_and_from_dh() -> None:
    frames = read_robot(chain_text(AR4_FRAMES, AR4_LIMITS, "urdf", "tool = { xyz_mm = [0, 0, 41] }"))
    kinematics, joints = kinematics_of(frames), random_joints(frames, 200)
    ours = kinematics_of(arm("AR4")).forward(joints)
    assert kinematics.forward(joints)[:, :3] == pytest.approx(ours[:, :3], abs=1e-9)
    assert kinematics.has_closed_form


@pytest.mark.parametrize("seed", range(5))
def test_frames_of_any_kind_are_one_dh_table(seed: int) -> None:
    """The product of the frames as they are written, multiplied out here by scipy's rotations."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 9))
    names = ", ".join(f'"J{i}"' for i in range(3, count))
    held = f'held = [{names}]\ntask = "position"\n'
    frames = [(rng.uniform(-200, 200, 3), rng.uniform(-180, 180, 3), rng.normal(size=3)) for _ in range(count)]
    chain = {
        f"J{i}": f"xyz_mm = {xyz.tolist()}, rpy_deg = {rpy.tolist()}, axis = {axis.tolist()}"
        for i, (xyz, rpy, axis) in enumerate(frames)
    }
    robot = read_robot(chain_text(chain, [(-180.0, 180.0)] * count, "urdf", held))
    joints = random_joints(robot, 20)
    for row in joints:
        place, turn = np.zeros(3), Rotation.identity()
        for angle, (xyz, rpy, axis) in zip(row, frames, strict=True):
            place = place + turn.apply(xyz)
            turn = turn * Rotation.from_euler("xyz", rpy, degrees=True)
            turn = turn * Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle, degrees=True)
        assert kinematics_of(robot).forward(row[np.newaxis])[0, :3] == pytest.approx(place, abs=1e-6)


def complaints(text: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        read_robot(text)
    return list(caught.value.messages)


SEVEN = {**dh_entries(AR4_ROWS), "J7": "theta_deg = 0.0, alpha_deg = 0.0, d_mm = 10.0, a_mm = 0.0"}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            chain_text(SEVEN, [*AR4_LIMITS, (0, 1)]),
            "kinematics.chain: 7 joints for a pose of 6 coordinates: hold 1 of them where they stand, such as"
            ' held = ["J1"]',
        ),
        (
            TEXTS["AR4"].replace("lower = -170.000000\nupper = 170.000000", "lower = 170.000000\nupper = -170.000000"),
            "joints.J1.upper: -170 deg is not above lower, 170 deg",
        ),
        (
            TEXTS["Thor"].replace("axis = [1, 0, 0]", "axis = [0, 0, 0]", 1),
            "kinematics.chain.J2.axis: 0 0 0 is no direction; 0 0 1 is along z",
        ),
        (TEXTS["AR4"].replace("d_mm = 169.77, ", ""), "kinematics.chain.J1.d_mm: is missing"),
        (
            TEXTS["AR4"].replace("a_mm = 64.2", "a_mm = 64.2, axis = [0, 0, 1]"),
            "kinematics.chain.J2.axis: key 'axis' is unknown: there are theta_deg, alpha_deg, d_mm, a_mm, slides",
        ),
        (
            TEXTS["AR4"].replace("modified-dh", "craig"),
            "kinematics.notation: 'craig' is not one of modified-dh, standard-dh, urdf",
        ),
        (
            TEXTS["AR4"].replace("\n[kinematics.chain]", 'held = ["J9"]\n[kinematics.chain]'),
            "kinematics.held: joint 'J9' is unknown: there are J1, J2, J3, J4, J5, J6",
        ),
        (
            TEXTS["AR4"].replace("\n[kinematics.chain]", 'task = "direction"\n[kinematics.chain]'),
            "kinematics.chain: 6 joints for a direction of 5 coordinates: hold 1 of them where they stand, such as"
            ' held = ["J1"]',
        ),
        (
            TEXTS["Thor"].replace("J1", "x"),
            "kinematics.chain.x: is the name of a coordinate of the tool; Jx is free",
        ),
        (
            TEXTS["Thor"].replace("xyz_mm = [0, 0, 160]", "xyz_mm = [0, 160]"),
            "kinematics.chain.J3.xyz_mm: has 2 values, but it takes three: x, y, z",
        ),
    ],
)
def test_one_line_each(text: str, complaint: str) -> None:
    found = [message for message in complaints(text) if message.startswith(complaint.partition(":")[0])]
    assert found[0].startswith(complaint)


def test_joints_that_the_file_does_not_describe() -> None:
    text = TEXTS["AR4"].replace("[joints.J6]", "[joints.J7]").replace("\nJ6 = 0.0", "\nJ7 = 0.0")
    assert complaints(text)[0] == "joints.J7: this 'chain' has no such joint: did you mean J6?"
