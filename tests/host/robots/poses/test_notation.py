"""The keys of an orientation mean what the makers' documents say, and nothing is guessed."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from steptwin.host.common.errors import InputError
from steptwin.host.robots.poses import ORIENTATIONS, Orientation
from steptwin.host.robots.poses.rotations import matrix
from tests.host.complaints import complaint_of

NUMBERS = (10.0, -20.0, 30.0)


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
    ("key", "values", "complaint"),
    [
        ("rpy_deg", (1.0, 2.0), "rpy_deg: has 2 numbers, it takes 3"),
        ("quaternion_xyzw", NUMBERS, "quaternion_xyzw: has 3 numbers, it takes 4"),
        (
            "quaternion_xyzw",
            (0.0, 0.0, 0.0, 1.0011),
            "quaternion_xyzw: has the length 1.0011, a rotation has 1, x y z and then the scalar w",
        ),
        ("direction", (0.0, 0.0, 0.0), "direction: 0 0 0 points nowhere; 0 0 -1 is straight down"),
    ],
)
def test_what_is_no_orientation(key: str, values: tuple[float, ...], complaint: str) -> None:
    assert complaint_of(lambda: Orientation(key, values)) == complaint


def test_every_key_refuses_no_numbers() -> None:
    for key in ORIENTATIONS:
        with pytest.raises(InputError):
            Orientation(key, ())
