"""Rotations against scipy's, which shares no code with ours."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots.poses import ORIENTATIONS, Orientation
from steptwin.host.robots.poses.rotations import (
    angle_deg,
    matrix,
    of_matrix,
    of_rotation_vector,
    of_rpy_deg,
    product,
    reversed_rotation,
    rotation_vector_deg,
    rpy_deg,
    turned,
    wrapped_deg,
)
from tests.host.complaints import complaint_of

COUNT = 500
NUMBERS = (10.0, -20.0, 30.0)


def rotations(seed: int = 1) -> FloatArray:
    return Rotation.random(COUNT, rng=np.random.default_rng(seed)).as_quat()


def same(first: FloatArray, second: FloatArray) -> bool:
    """Whether quaternions are the same rotations, whatever their signs."""
    return bool(np.abs(np.abs(np.sum(first * second, axis=-1)) - 1.0).max() < 1e-14)


def test_one_after_the_other() -> None:
    first, second = rotations(1), rotations(2)
    assert same(product(second, first), (Rotation.from_quat(second) * Rotation.from_quat(first)).as_quat())
    assert same(product(reversed_rotation(first), first), np.array([0.0, 0.0, 0.0, 1.0]))


def test_vectors() -> None:
    vectors = np.random.default_rng(3).normal(size=(COUNT, 3))
    assert turned(vectors, rotations()) == pytest.approx(Rotation.from_quat(rotations()).apply(vectors), abs=1e-14)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (rpy_deg, lambda q: Rotation.from_quat(q).as_euler("xyz", degrees=True)),
        (rotation_vector_deg, lambda q: Rotation.from_quat(q).as_rotvec(degrees=True)),
        (matrix, lambda q: Rotation.from_quat(q).as_matrix()),
    ],
    ids=["rpy", "rotation vector", "matrix"],
)
def test_notations(ours: Callable[[FloatArray], FloatArray], theirs: Callable[[FloatArray], FloatArray]) -> None:
    assert ours(rotations()) == pytest.approx(theirs(rotations()), abs=1e-11)


@pytest.mark.parametrize(
    ("there", "back"), [(rpy_deg, of_rpy_deg), (rotation_vector_deg, of_rotation_vector), (matrix, of_matrix)]
)
def test_there_and_back(there: Callable[[FloatArray], FloatArray], back: Callable[[FloatArray], FloatArray]) -> None:
    assert same(back(there(rotations())), rotations())


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("angle", [0.0, 1e-9, 90.0, 179.9999999, 180.0])
def test_matrices_of_turns_about_the_axes(axis: int, angle: float) -> None:
    """Half turns have no scalar part: each of the other components is the largest once."""
    quaternion = of_rotation_vector(angle * np.eye(3)[axis])
    assert same(of_matrix(matrix(quaternion)), quaternion)


@given(st.floats(1e-12, 179.0))
def test_small_angles_are_not_lost(angle: float) -> None:
    assert angle_deg(of_rpy_deg(np.zeros(3)), of_rotation_vector(np.array([0.0, angle, 0.0]))) == pytest.approx(angle)


def test_both_signs_of_a_quaternion_are_no_angle_apart() -> None:
    """Theirs is at most 1e-6 deg, by an arc cosine."""
    assert np.abs(angle_deg(rotations(), -rotations())).max() < 1e-12
    theirs = np.rad2deg((Rotation.from_quat(rotations(1)) * Rotation.from_quat(rotations(2)).inv()).magnitude())
    assert angle_deg(rotations(2), -rotations(1)) == pytest.approx(theirs, abs=1e-6)


def test_angles_end_at_180_and_begin_behind_minus_180() -> None:
    found = wrapped_deg(np.array([-180.0, 180.0, 180.5, -180.5, 540.0, 0.1, np.nan]))
    assert found.tolist()[:-1] == [180.0, 180.0, -179.5, 179.5, 180.0, 0.1]
    assert np.isnan(found[-1])


@pytest.mark.parametrize("pitch", [90.0, -90.0, 89.9995, -89.9995])
def test_straight_up_the_roll_is_0(pitch: float) -> None:
    quaternion = of_rpy_deg(np.array([10.0, pitch, 25.0]))
    roll, found, _ = rpy_deg(quaternion).tolist()
    assert (roll, found) == (0.0, pytest.approx(pitch, abs=1e-5))
    assert angle_deg(of_rpy_deg(rpy_deg(quaternion)), quaternion) < 0.001


def test_just_below_it_is_not() -> None:
    assert rpy_deg(of_rpy_deg(np.array([10.0, 89.998, 25.0]))) == pytest.approx([10.0, 89.998, 25.0], abs=1e-6)


@pytest.mark.parametrize(
    ("key", "values", "wanted"),
    [
        ("rpy_deg", NUMBERS, Rotation.from_euler("ZYX", NUMBERS[::-1], degrees=True)),
        ("abc_deg", NUMBERS, Rotation.from_euler("ZYX", NUMBERS, degrees=True)),
        ("rotvec_deg", NUMBERS, Rotation.from_rotvec(NUMBERS, degrees=True)),
        ("quaternion_xyzw", (0.0, 0.0, 0.6, 0.8), Rotation.from_quat([0.0, 0.0, 0.6, 0.8])),
    ],
)
def test_each_key(key: str, values: tuple[float, ...], wanted: Rotation) -> None:
    orientation = Orientation(key, values)
    assert matrix(orientation.rotation) == pytest.approx(wanted.as_matrix(), abs=1e-15)
    assert orientation.direction == pytest.approx(wanted.apply([0.0, 0.0, 1.0]), abs=1e-15)


@pytest.mark.parametrize("key", [key for key in ORIENTATIONS if key != "direction"])
def test_a_rotation_is_written_under_each_key(key: str) -> None:
    rotation = Rotation.from_euler("ZYX", (40.0, -30.0, 20.0), degrees=True)
    orientation = Orientation.of(key, rotation.as_quat())
    assert matrix(orientation.rotation) == pytest.approx(rotation.as_matrix(), abs=1e-12)
    if key == "abc_deg":
        assert orientation.values == pytest.approx((40.0, -30.0, 20.0))


def test_the_ar4s_stored_pose() -> None:
    """AR4.py writes a rotation vector with its labels reversed; the same pose as roll, pitch, yaw is quite another."""
    vector = Orientation("rotvec_deg", (9.454, 121.621, -1.927))
    rpy = Orientation("rpy_deg", (175.5, 57.9, 168.6))
    assert np.abs(matrix(vector.rotation) - matrix(rpy.rotation)).max() < 0.002


def test_a_direction_has_the_length_1() -> None:
    assert Orientation("direction", (0.0, 0.0, -3.0)).direction == pytest.approx([0.0, 0.0, -1.0])


def test_a_rounded_quaternion_is_made_a_rotation() -> None:
    assert np.linalg.norm(Orientation("quaternion_xyzw", (0.0, 0.0, 0.707, 0.707)).rotation) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("rpy_deg", (1.0, 2.0)),
        ("quaternion_xyzw", NUMBERS),
        ("quaternion_xyzw", (0.0, 0.0, 0.0, 1.0011)),
        ("direction", (0.0, 0.0, 0.0)),
    ],
)
def test_what_is_no_orientation(key: str, values: tuple[float, ...]) -> None:
    complaint_of(lambda: Orientation(key, values))


def test_every_key_refuses_no_numbers() -> None:
    for key in ORIENTATIONS:
        with pytest.raises(InputError):
            Orientation(key, ())
