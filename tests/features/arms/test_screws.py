"""Poses and Jacobians of chains of any joints, against the DH table's matrices and against differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.robots.kinematics.dh import Convention, DhParameter, DhRow, DhTable
from steptwin.host.robots.kinematics.serial.screws import CHUNK, screws_of
from steptwin.host.robots.poses.base_frame import BaseFrame
from steptwin.host.robots.poses.rotations import angle_deg, of_matrix, product, reversed_rotation, rotation_vector_deg
from steptwin.host.robots.poses.rotations import turned as turned_vectors

ANGLES = st.floats(-180.0, 180.0)
LENGTHS = st.floats(-300.0, 300.0)


@st.composite
def tables(draw: st.DrawFn) -> DhTable:
    """Tables of 1 to 8 joints, turning or sliding, counting either way, with rows without a joint between them."""
    rows = []
    for number in range(draw(st.integers(1, 8))):
        slides, sign = draw(st.booleans()), draw(st.sampled_from([1, -1]))
        name = f"J{number}"
        rows.append(
            DhRow(
                draw(ANGLES),
                draw(LENGTHS),
                DhParameter(draw(LENGTHS), name if slides else "", sign),
                DhParameter(draw(ANGLES), "" if slides else name, sign),
            )
        )
        if draw(st.booleans()):
            rows.append(DhRow(draw(ANGLES), draw(LENGTHS), DhParameter(draw(LENGTHS)), DhParameter(draw(ANGLES))))
    base = BaseFrame(draw(LENGTHS), draw(LENGTHS), draw(LENGTHS), draw(ANGLES))
    return DhTable(draw(st.sampled_from(Convention)), tuple(rows), base)


@pytest.mark.slow
@given(tables(), st.integers(0, 1000))
@settings(max_examples=60)
def test_poses_are_the_tables_own(table: DhTable, seed: int) -> None:
    names = table.variables
    joints = np.random.default_rng(seed).uniform(-180.0, 180.0, (5, len(names)))
    transforms = table.transforms({name: joints[:, i] for i, name in enumerate(names)})
    poses = screws_of(table, names).forward(joints)
    assert poses[:, :3] == pytest.approx(transforms[:, :3, 3], abs=1e-9)
    assert angle_deg(poses[:, 3:], of_matrix(transforms[:, :3, :3])).max() < 1e-11


@pytest.mark.slow
@given(tables(), st.integers(0, 1000))
@settings(max_examples=30)
def test_jacobians_are_differences(table: DhTable, seed: int) -> None:
    names, step = table.variables, 1e-4
    joints = np.random.default_rng(seed).uniform(-180.0, 180.0, (3, len(names)))
    screws = screws_of(table, names)
    poses, jacobians = screws.with_jacobian(joints)
    back = reversed_rotation(poses[:, 3:])
    for column, name in enumerate(names):
        per_unit = 1.0 if any(row.d_mm.variable == name for row in table.rows) else np.rad2deg(1.0)
        both = [screws.forward(joints + sign * step * np.eye(len(names))[column]) for sign in (1, -1)]
        way = turned_vectors(both[0][:, :3] - both[1][:, :3], back) / (2 * step) * per_unit
        turn = rotation_vector_deg(product(reversed_rotation(both[1][:, 3:]), both[0][:, 3:])) / (2 * step)
        assert jacobians[:, :3, column] == pytest.approx(way, abs=1e-4)
        assert jacobians[:, 3:, column] == pytest.approx(np.deg2rad(turn) * per_unit, abs=1e-6)


def test_many_at_once_are_those_alone() -> None:
    table = DhTable(Convention.MODIFIED, (DhRow(90.0, 10.0, DhParameter(20.0), DhParameter(5.0, "J1")),))
    joints = np.linspace(-180.0, 180.0, 2 * CHUNK + 3)[:, np.newaxis]
    screws = screws_of(table, ("J1",))
    every, alone = screws.forward(joints), screws.forward(joints[-1:])
    assert np.array_equal(every[-1:], alone)
