"""Closed form of arms of six rotary joints with axis 2 parallel to axis 3 and axes 4, 5 and 6 through a point.

It uses the axes at zero, with any offsets, without DH parameters or sign conventions. D is the motion of the tool from
zero to its pose, E_i the rotation about axis k_i by q_i, and w the wrist's point, w_0 at zero:

    D w_0 = E1 E2 E3 w_0 = w                      the wrist's axes do not move w_0
    k2 . Rot(-k1, q1) (w - r1) = k2 . (w_0 - r1)  turns about k2 and k3 keep the part along them: two q1
    |E3 w_0 - r2| = |E1^-1 w - r2|                in the plane across k2: two q3, then q2 by an angle
    k4 . R36 k6 = k4 . Rot(k5, q5) k6             R36 = R03^-1 R06: two q5, then q4 and q6 by angles

An equation A cos q + B sin q = C has the solutions atan2(B, A) +- atan2(sqrt(A^2 + B^2 - C^2), C). The three signs are
a branch; its name follows from the arm's shape.

Source of the subproblems: B. Paden, "Kinematics and control of robot manipulators", PhD thesis, Berkeley 1986; K. M.
Lynch, F. C. Park, "Modern Robotics", section 6.1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from steptwin.features.arms.wrist_rates import Column, ConstantAxis, Vectors, WristRates, constant, weighted
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.robots.kinematics.serial.chain_geometry import ArmAxes

MISS_MAX_MM: Final = 1e-4
"""Largest miss of the wrist's axes: the rounding of angles in files."""
TILT_MAX: Final = 1e-7
"""Sine of the largest angle between axes 2 and 3, and of the least angle between neighbouring axes of the wrist."""

NAMES: Final = tuple(
    f"{shoulder}-{elbow}-{wrist}"
    for shoulder, elbow, wrist in product(("front", "rear"), ("up", "down"), ("noflip", "flip"))
)
"""Names of the branches: the side of axis 1 with the wrist, the side of the line from shoulder to wrist with the elbow,
and the sign of the angle between axes 4 and 6.
"""

_FREE_MM: Final = 1e-9
"""Distance of the wrist from axis 1 below which q1 is free."""
_FREE: Final = 1e-6
"""Sine of the angle between axes 4 and 6 below which q4 is free: only its sum with q6 has an effect."""
_CLAMPED: Final = 1e-12
"""Largest overshoot beyond the stretched arm that counts as rounding."""

Signs = tuple[Column | float, Column | float, Column | float]
"""Signs in the equations of q1, q3 and q5: numbers, or columns of shape (n,)."""


def wrist_miss_mm(axes: ArmAxes) -> float:
    """Return the miss of the wrist's axes: the largest distance between axes 4, 5 and 6."""
    (before, on_five), (behind, on_five_too) = (nearest_points(axes, i, 4) for i in (3, 5))
    pairs = ((before, on_five), (behind, on_five_too), (on_five, on_five_too))
    return max(float(np.linalg.norm(first - second)) for first, second in pairs)


def nearest_points(axes: ArmAxes, first: int, second: int) -> tuple[FloatArray, FloatArray]:
    """Return the nearest points of two axes that are not parallel."""
    lines = np.stack([axes.directions[first], -axes.directions[second]], axis=1)
    between = axes.points_mm[second] - axes.points_mm[first]
    along = np.linalg.lstsq(lines, between, rcond=None)[0]
    a = axes.points_mm[first] + along[0] * axes.directions[first]
    return a, axes.points_mm[second] + along[1] * axes.directions[second]


def why_not(axes: ArmAxes) -> str:
    """Return why an arm has no such closed form, as text; empty if it has."""
    if len(axes.slides) != 6 or any(axes.slides):
        return "it takes six rotary joints"
    directions = axes.directions
    if np.linalg.norm(np.cross(directions[1], directions[2])) > TILT_MAX:
        return "axes 2 and 3 are not parallel"
    if any(np.linalg.norm(np.cross(directions[i], directions[j])) < TILT_MAX for i, j in ((0, 1), (3, 4), (4, 5))):
        return "neighbouring axes are parallel"
    miss_mm = wrist_miss_mm(axes)
    return f"axes 4, 5 and 6 miss one point by {miss_mm:.3g} mm" if miss_mm > MISS_MAX_MM else ""


class Reach(NamedTuple):
    """Margin of each equation until it has no solution, arrays of shape (n,).

    Attributes:
        axis_mm: distance of the wrist from axis 1.
        shoulder_mm: distance of the wrist from axis 2, NaN where q1 has no solution.
        beside: required cosine of the angle between axes 4 and 6, from -1 to 1.
    """

    axis_mm: FloatArray
    shoulder_mm: FloatArray
    beside: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """One branch.

    Attributes:
        joints: shape (n, 6), in rad, NaN without a solution.
        reach: margins of the equations.
        is_free: shape (n,), True where q4 is free: only its sum with q6, or its difference, has an effect.
    """

    joints: FloatArray
    reach: Reach
    is_free: BoolArray

    def cut(self, end: int) -> "Solved":
        """Return the solutions of the first `end` poses."""
        return Solved(self.joints[:end], Reach(*(values[:end] for values in self.reach)), self.is_free[:end])

    @classmethod
    def joined(cls, parts: Sequence["Solved"]) -> "Solved":
        """Return the solutions of all parts, concatenated."""
        reach = (np.concatenate(values) for values in zip(*(part.reach for part in parts), strict=True))
        joints, free = (np.concatenate([getattr(part, name) for part in parts]) for name in ("joints", "is_free"))
        return cls(joints, Reach(*reach), free)


class _Shoulder(NamedTuple):
    """Quantities that depend on q1."""

    q1: Column
    cosine: Column
    sine: Column
    ahead: Column
    """The wrist from axis 2, across k2: component along f; `up` is the one along g."""
    up: Column
    six: Vectors
    """R06 k6 turned back by q1; `side` is R06 x6."""
    side: Vectors


class _Elbow(NamedTuple):
    """Quantities that depend on q2 and q3: k6 and x6 seen from link 3, along k4 and across it."""

    q2: Column
    q3: Column
    six: Vectors
    side: Vectors


class _Wrist(NamedTuple):
    """Quantities that depend on q4, q5 and q6."""

    q4: Column
    q5: Column
    q6: Column
    beside: Column
    is_free: BoolArray


class SphericalWrist:
    """Closed form of one arm; made by `closed_form`.

    Args:
        axes: the arm's axes at zero; `why_not` must be empty for them.
        slack: relative distance out of reach that still gives the joints of the edge.
    """

    def __init__(self, axes: ArmAxes, slack: float = _CLAMPED) -> None:
        self._slack = slack
        k, r, wrist = axes.directions, axes.points_mm, nearest_points(axes, 3, 4)[1]
        self._r1 = constant(r[0])
        self._first, self._second = ConstantAxis(-k[0]), ConstantAxis(-k[1])
        # --- the tool's frame: the wrist, k6, and a vector x6 across it
        x6 = _unit(k[4] - (k[4] @ k[5]) * k[5])
        back = axes.home_rotation.T
        self._in_tool = [back @ (wrist - axes.home_mm), back @ k[5], back @ x6]
        # --- q1
        self._k1, self._k2 = constant(k[0]), constant(k[1])
        self._skew = float(k[0] @ k[1])
        self._beside = constant(np.cross(k[1], k[0]))
        self.offset_mm: float = float(k[1] @ (wrist - r[0]))
        self._between = r[0] - r[1]
        # --- q3 and q2, in the plane of f and g = k2 x f
        self._f = _unit(np.cross(k[1], k[0]))
        self._g = np.cross(k[1], self._f)
        self._k3 = 1.0 if k[1] @ k[2] > 0.0 else -1.0
        plane = np.stack([self._f, self._g])
        self._upper, self._fore = plane @ (r[2] - r[1]), plane @ (wrist - r[2])
        self.lengths_mm: tuple[float, float] = float(np.linalg.norm(self._upper)), float(np.linalg.norm(self._fore))
        across = float(self._upper[0] * self._fore[1] - self._upper[1] * self._fore[0])
        self._elbow_rad = float(np.arctan2(-self._k3 * across, self._upper @ self._fore))
        # --- the wrist, in the frame of k4, f4 and g4
        f4 = _unit(k[4] - (k[3] @ k[4]) * k[3])
        self._frame = [constant(v) for v in (k[3], f4, np.cross(k[3], f4))]
        basis = np.stack([k[3], f4, np.cross(k[3], f4)])
        self._six, self._x6, self._y6 = (_turning(basis, k[4], v) for v in (k[5], x6, np.cross(k[5], x6)))
        a5, b5, c5 = self._six[0]
        self._wrist_rad, self._wrist_size, self._wrist_rest = float(np.arctan2(b5, a5)), float(np.hypot(a5, b5)), c5
        self.is_square: bool = abs(self._wrist_rest) < _CLAMPED and abs(self._wrist_size - 1.0) < _CLAMPED
        """True if axis 5 is square to both neighbours; then an angle near 0 is exact to the last digit."""
        self.rates: WristRates = WristRates(axes, wrist)
        """Speeds of the joints for a velocity of the tool."""
        self.signs: dict[str, tuple[float, float, float]] = {}
        self._name_branches(r, k)

    # --- names

    def _name_branches(self, r: FloatArray, k: FloatArray) -> None:
        """Find the signs of each name: the signs of q1, q3 and q5 determine the arm's shape at every pose."""
        to_second = r[1] - r[0]
        ahead = to_second - (to_second @ k[0]) * k[0]
        ahead -= (ahead @ k[1]) * k[1]
        forward = 1.0 if np.linalg.norm(ahead) < MISS_MAX_MM else float(np.sign(ahead @ self._f))
        for s1, s3, s5 in product((1.0, -1.0), repeat=3):
            shoulder = "front" if s1 * forward > 0.0 else "rear"  # q1 = atan2(B, A) + s1 delta has the wrist at s1 f
            up = "up" if s3 * self._k3 * s1 > 0.0 else "down"
            self.signs[f"{shoulder}-{up}-{'noflip' if s5 > 0.0 else 'flip'}"] = (s1, s3, s5)

    def signs_of(self, joints: FloatArray) -> Signs:
        """Return the signs of the branch of joints of shape (n, 6), in rad; each of shape (n,)."""
        q3, q5 = joints[:, 2], joints[:, 4]
        return (
            np.where(self._ahead_mm(joints) >= 0.0, 1.0, -1.0),
            np.where(np.sin(q3 - self._elbow_rad) >= 0.0, 1.0, -1.0),
            np.where(np.sin(q5 - self._wrist_rad) >= 0.0, 1.0, -1.0),
        )

    def names_of(self, joints: FloatArray) -> list[str]:
        """Return the branch names of joints of shape (n, 6), in rad."""
        names = {signs: name for name, signs in self.signs.items()}
        return [names[s1, s3, s5] for s1, s3, s5 in np.column_stack(self.signs_of(joints)).tolist()]

    def name_of(self, joints: FloatArray) -> str:
        """Return the branch name of joints of shape (6,), in rad."""
        return self.names_of(joints[np.newaxis])[0]

    def measures(self, joints: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the distances of joints of shape (n, 6), in rad, from singularities, each of shape (n,), 0 at one.

        They are the wrist's distance from axis 1 across the arm's plane as a fraction of the reach, and the sines of
        elbow and wrist.
        """
        return (
            np.abs(self._ahead_mm(joints)) / sum(self.lengths_mm),
            np.abs(np.sin(joints[:, 2] - self._elbow_rad)),
            np.abs(np.sin(joints[:, 4] - self._wrist_rad)),
        )

    def _ahead_mm(self, joints: FloatArray) -> FloatArray:
        """Return the wrist's distance from axis 1 along f."""
        q2, turned = joints[:, 1], self._k3 * joints[:, 2]
        fore = _turned2(self._fore, np.cos(turned), np.sin(turned))
        ahead, up = self._upper[0] + fore[0], self._upper[1] + fore[1]
        return np.asarray(np.cos(q2) * ahead - np.sin(q2) * up - self._between @ self._f)

    # --- solving

    def solve(self, poses: FloatArray, signs: Signs, near: FloatArray | None) -> Solved:
        """Return one branch for poses of shape (n, 7) in the base's frame.

        A free q1 or q4 is taken from `near`, of shape (6,) or (n, 6), in rad, by default 0.
        """
        wrist, six, side = self._targets(poses)
        s1, s3, s5 = signs
        shoulder, axis_mm, shoulder_ok = self._shoulder(wrist, six, side, s1, near)
        elbow, shoulder_mm = self._elbow(shoulder, s3)
        return self._solved(shoulder, elbow, self._wrist(elbow, s5, near), axis_mm, shoulder_mm, shoulder_ok)

    def solve_all(self, poses: FloatArray, near: FloatArray | None) -> dict[str, Solved]:
        """Return every branch by name; shared results are computed once."""
        targets = self._targets(poses)
        found: dict[tuple[float, float, float], Solved] = {}
        for s1 in (1.0, -1.0):
            shoulder, axis_mm, shoulder_ok = self._shoulder(*targets, s1, near)
            for s3 in (1.0, -1.0):
                elbow, shoulder_mm = self._elbow(shoulder, s3)
                for s5 in (1.0, -1.0):
                    wrist = self._wrist(elbow, s5, near)
                    found[s1, s3, s5] = self._solved(shoulder, elbow, wrist, axis_mm, shoulder_mm, shoulder_ok)
        return {name: found[self.signs[name]] for name in NAMES}

    def _targets(self, poses: FloatArray) -> tuple[Vectors, Vectors, Vectors]:
        """Return the wrist from axis 1, R06 k6 and R06 x6."""
        px, py, pz, x, y, z, w = np.ascontiguousarray(poses.T)
        xx, yy, zz, xy, xz, yz, xw, yw, zw = x * x, y * y, z * z, x * y, x * z, y * z, x * w, y * w, z * w
        rows = (
            (1.0 - 2.0 * (yy + zz), 2.0 * (xy - zw), 2.0 * (xz + yw)),
            (2.0 * (xy + zw), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - xw)),
            (2.0 * (xz - yw), 2.0 * (yz + xw), 1.0 - 2.0 * (xx + yy)),
        )
        to_wrist, six, side = (Vectors(*(weighted(constant(v), row) for row in rows)) for v in self._in_tool)
        place = (px - self._r1[0], py - self._r1[1], pz - self._r1[2])
        return Vectors(*(a + b for a, b in zip(place, to_wrist, strict=True))), six, side

    def _shoulder(
        self, wrist: Vectors, six: Vectors, side: Vectors, sign: Column | float, near: FloatArray | None
    ) -> tuple[_Shoulder, Column, BoolArray]:
        along = weighted(self._k1, wrist) if self._skew else None
        a, b = weighted(self._k2, wrist), -weighted(self._beside, wrist)
        c: Column | float = self.offset_mm
        if along is not None:
            a, c = a - self._skew * along, self.offset_mm - self._skew * along
        square = a * a + b * b
        radius = np.sqrt(square)
        rest = square - c * c
        ok = rest >= -self._slack * square
        q1 = np.arctan2(b, a) + sign * np.arctan2(np.sqrt(np.maximum(rest, 0.0)), c)
        free = radius < _FREE_MM
        if free.any():
            q1 = np.where(free, _near(near, 0), q1)
        cosine, sine = np.cos(q1), np.sin(q1)
        seen = self._first.turned(wrist, cosine, sine)
        return (
            _Shoulder(
                q1,
                cosine,
                sine,
                weighted(constant(self._f), seen) + float(self._f @ self._between),
                weighted(constant(self._g), seen) + float(self._g @ self._between),
                self._first.turned(six, cosine, sine),
                self._first.turned(side, cosine, sine),
            ),
            radius,
            ok,
        )

    def _elbow(self, shoulder: _Shoulder, sign: Column | float) -> tuple[_Elbow, Column]:
        upper_mm, fore_mm = self.lengths_mm
        ahead, up = shoulder.ahead, shoulder.up
        square = ahead * ahead + up * up
        x = (square - (upper_mm**2 + fore_mm**2)) / (2.0 * upper_mm * fore_mm)
        inside = np.abs(x) <= 1.0 + self._slack
        x = np.where(inside, np.clip(x, -1.0, 1.0), np.nan)
        bend = np.arctan2(np.sqrt((1.0 - x) * (1.0 + x)), x)
        q3 = self._elbow_rad + sign * bend
        turned = self._k3 * q3
        fore = _turned2(self._fore, np.cos(turned), np.sin(turned))
        e_f, e_g = self._upper[0] + fore[0], self._upper[1] + fore[1]
        q2 = np.arctan2(e_f * up - e_g * ahead, e_f * ahead + e_g * up)
        both = q2 + turned
        cosine, sine = np.cos(both), np.sin(both)
        six, side = (
            Vectors(*(weighted(row, self._second.turned(v, cosine, sine)) for row in self._frame))
            for v in (shoulder.six, shoulder.side)
        )
        return _Elbow(q2, q3, six, side), np.sqrt(square)

    def _wrist(self, elbow: _Elbow, sign: Column | float, near: FloatArray | None) -> _Wrist:
        z_k, z_f, z_g = elbow.six
        c = (z_k - self._wrist_rest) / self._wrist_size
        sine = np.hypot(z_f, z_g) if self.is_square else np.sqrt(np.maximum((1.0 - c) * (1.0 + c), 0.0))
        q5 = self._wrist_rad + sign * np.arctan2(sine, c)
        c5, s5 = np.cos(q5), np.sin(q5)
        _, n_f, n_g = (_at(row, c5, s5) for row in self._six)
        dot, cross = n_f * z_f + n_g * z_g, n_f * z_g - n_g * z_f
        size = np.sqrt(dot * dot + cross * cross)
        q4 = np.arctan2(cross, dot)
        free = size < _FREE * _FREE
        if free.any():
            q4 = np.where(free, _near(near, 3), q4)
            c4, s4 = np.cos(q4), np.sin(q4)
        else:
            c4, s4 = dot / size, cross / size
        x = self._seen(self._x6, c5, s5, c4, s4, elbow.side)
        y = self._seen(self._y6, c5, s5, c4, s4, elbow.side)
        return _Wrist(q4, q5, np.arctan2(y, x), c, free)

    def _seen(
        self, rows: Sequence[Sequence[float]], c5: Column, s5: Column, c4: Column, s4: Column, side: Vectors
    ) -> Column:
        """Return the component of R36 x6 along a vector that q5 and q4 have turned."""
        along, across, beside = (_at(row, c5, s5) for row in rows)
        return along * side.x + (c4 * across - s4 * beside) * side.y + (s4 * across + c4 * beside) * side.z

    def _solved(
        self,
        shoulder: _Shoulder,
        elbow: _Elbow,
        wrist: _Wrist,
        axis_mm: Column,
        shoulder_mm: Column,
        ok: BoolArray,
    ) -> Solved:
        q4, q5, q6, beside, is_free = wrist
        joints = np.stack(np.broadcast_arrays(shoulder.q1, elbow.q2, elbow.q3, q4, q5, q6), axis=1)
        bad = ~(ok & (np.abs(beside) <= 1.0 + self._slack) & np.isfinite(elbow.q3))
        if bad.any():
            joints[bad] = np.nan
        return Solved(joints, Reach(axis_mm, np.where(ok, shoulder_mm, np.nan), beside), is_free)


@lru_cache(maxsize=16)
def closed_form(axes: ArmAxes, slack: float = _CLAMPED) -> SphericalWrist:
    """Return the closed form of an arm with an empty `why_not`."""
    return SphericalWrist(axes, slack)


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector))


def _turned2(vector: FloatArray, cosine: Column, sine: Column) -> tuple[Column, Column]:
    """Return a constant vector of the plane after rotations."""
    x, y = constant(vector)
    return x * cosine - y * sine, x * sine + y * cosine


def _turning(basis: FloatArray, axis: FloatArray, vector: FloatArray) -> list[tuple[float, ...]]:
    """Return, for each vector of a basis, the weights of cos q, sin q and 1 in its component of Rot(axis, q) vector."""
    along = (axis @ vector) * axis
    return [constant(np.array([row @ (vector - along), row @ np.cross(axis, vector), row @ along])) for row in basis]


def _at(weights: Sequence[float], cosine: Column, sine: Column) -> Column:
    a, b, c = weights
    turning = weighted((a, b), (cosine, sine))
    return turning + c if c else turning


def _near(near: FloatArray | None, joint: int) -> FloatArray | float:
    return 0.0 if near is None else near[..., joint]
