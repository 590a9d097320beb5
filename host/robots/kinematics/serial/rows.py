"""Convert fixed transforms to rows of a DH table, so that any chain of frames becomes one table.

Every transform consists of two screws about z and one about x between them, which is about the common normal of both z
axes:


    T = Rz(first) Tz(first) . Rx(alpha) Tx(a) . Rz(second) Tz(second)

Source: J. J. Craig, "Introduction to Robotics", section 3.4: the frames of links are laid along common normals.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Values
from steptwin.host.robots.kinematics.dh import Convention, DhParameter, DhRow
from steptwin.host.robots.poses.rotations import matrix, of_rpy_deg

_PARALLEL: Final = 1e-9
"""Sine of the angle between two axes below which they count as parallel: their common normal is not unique."""
_DECIMALS: Final = 12
"""Decimals of a row's numbers; further ones are rounding errors."""

Triple = Annotated[tuple[float, float, float], Values("it takes three: x, y, z")]


@dataclass(frozen=True, slots=True)
class FixedFrame(FileTable):
    """A fixed transform.

    Attributes:
        xyz_mm: its place.
        rpy_deg: its roll, pitch and yaw.
    """

    xyz_mm: Triple = (0.0, 0.0, 0.0)
    rpy_deg: Triple = (0.0, 0.0, 0.0)

    @property
    def matrix(self) -> FloatArray:
        """Shape (4, 4): the homogeneous transform."""
        transform = np.eye(4)
        transform[:3, :3] = matrix(of_rpy_deg(np.array(self.rpy_deg)))
        transform[:3, 3] = self.xyz_mm
        return transform


@dataclass(frozen=True, slots=True)
class _Screws:
    """The parameters of the two screws about z and of the one about x between them, in degrees and mm."""

    first_deg: float
    first_mm: float
    alpha_deg: float
    a_mm: float
    second_deg: float
    second_mm: float

    @classmethod
    def of(cls, transform: FloatArray) -> "_Screws":
        """Decompose a transform into screws."""
        turn, place = transform[:3, :3], transform[:3, 3]
        sine = float(np.hypot(turn[0, 2], turn[1, 2]))
        if sine < _PARALLEL:
            first = float(np.arctan2(place[1], place[0])) if np.hypot(*place[:2]) > _PARALLEL else 0.0
            alpha = 0.0 if turn[2, 2] > 0.0 else np.pi
            second = float(np.arctan2(turn[1, 0], turn[0, 0]))
            second = second - first if alpha == 0.0 else first - second
            first_mm, second_mm = float(place[2]), 0.0
        else:
            first = float(np.arctan2(turn[0, 2], -turn[1, 2]))
            alpha, second = float(np.arctan2(sine, turn[2, 2])), float(np.arctan2(turn[2, 0], turn[2, 1]))
            second_mm = float(place @ [np.sin(first), -np.cos(first), 0.0]) / sine
            first_mm = float(place[2]) - second_mm * float(turn[2, 2])
        a_mm = float(place @ [np.cos(first), np.sin(first), 0.0])
        numbers = (np.rad2deg(first), first_mm, np.rad2deg(alpha), a_mm, np.rad2deg(second), second_mm)
        return cls(*(float(np.round(number, _DECIMALS)) + 0.0 for number in numbers))


def rows_around(fixed: Sequence[FloatArray], joints: Mapping[str, bool]) -> Iterator[DhRow]:
    """Yield the rows, in the modified convention, of joints along z with fixed transforms around them.

    There is one more transform than joints. `joints` tells by name whether a joint slides. Screws about the same axis
    become one row; the first and the last row are omitted if they change nothing.
    """
    screws = [_Screws.of(transform) for transform in fixed]
    yield from _row(0.0, 0.0, screws[0].first_mm, screws[0].first_deg)
    for before, after, (name, slides) in zip(screws, screws[1:], joints.items(), strict=False):
        d_mm, theta_deg = before.second_mm + after.first_mm, before.second_deg + after.first_deg
        d = DhParameter(d_mm, name if slides else "")
        yield DhRow(before.alpha_deg, before.a_mm, d, DhParameter(_wrapped(theta_deg), "" if slides else name))
    last = screws[-1]
    yield from _row(last.alpha_deg, last.a_mm, last.second_mm, last.second_deg)


def fixed_rows(transform: FloatArray, convention: Convention) -> Iterator[DhRow]:
    """Yield the rows of a fixed transform, which may be none."""
    screws = _Screws.of(transform)
    if convention is Convention.MODIFIED:
        yield from _row(0.0, 0.0, screws.first_mm, screws.first_deg)
        yield from _row(screws.alpha_deg, screws.a_mm, screws.second_mm, screws.second_deg)
    else:
        yield from _row(screws.alpha_deg, screws.a_mm, screws.first_mm, screws.first_deg)
        yield from _row(0.0, 0.0, screws.second_mm, screws.second_deg)


def _row(alpha_deg: float, a_mm: float, d_mm: float, theta_deg: float) -> Iterator[DhRow]:
    if alpha_deg or a_mm or d_mm or theta_deg:
        yield DhRow(alpha_deg, a_mm, DhParameter(d_mm), DhParameter(theta_deg))


def _wrapped(angle_deg: float) -> float:
    """Return an angle in (-180, 180]."""
    return 180.0 - (180.0 - angle_deg) % 360.0


def turned_onto(axis: FloatArray) -> FloatArray:
    """Return the smallest rotation, of shape (4, 4), that turns z onto a unit vector."""
    x, y, z = axis.tolist()
    transform = np.eye(4)
    if z < -1.0 + _PARALLEL:
        transform[:3, :3] = np.diag([1.0, -1.0, -1.0])
    else:
        transform[:3, :3] = [
            [1.0 - x * x / (1.0 + z), -x * y / (1.0 + z), x],
            [-x * y / (1.0 + z), 1.0 - y * y / (1.0 + z), y],
            [-x, -y, z],
        ]
    return transform
