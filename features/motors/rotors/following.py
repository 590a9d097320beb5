"""Joints of a mechanism that follow the rotors: in proportion, or as the platform on two sliders.

Two links of length l join the platform to sliders at heights a and b on upright screws, h to the left and to the right
of the middle. With the platform at (p, q), above the line from slider to slider,

    (p + h)^2 + (q - a)^2 = l^2        (p - h)^2 + (q - b)^2 = l^2

Differentiated once and twice, with the slopes s = (p + h)/(q - a) and r = (p - h)/(q - b) and sliders without
acceleration:

    a' = q' + s p'        0 = q'' + s p'' + s' p'        s' = p' (1 + s^2) / (q - a)
    b' = q' + r p'        0 = q'' + r p'' + r' p'        r' = p' (1 + r^2) / (q - b)

The functions are plain, as those of `rotor_kernel`; a pair is PAIR_FIELDS numbers.
"""

from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

from steptwin.controller.motion.kernel import kernel_function
from steptwin.features.motors.rotors.rotor_kernel import PLACE, RATE, STATE_FIELDS

LEFT = 0
"""Index of the left slider's body, -1 without a pair. The other three indices are sliding joints, too."""
RIGHT = 1
"""Index of the right slider's body."""
ACROSS = 2
"""Index of the body that slides by p."""
UP = 3
"""Index of the body that slides by q."""
HALF = 4
"""h in m."""
LENGTH = 5
"""l in m."""
PAIR_FIELDS = 6

SINGULAR = 1e-9
"""Limit of singular poses: rise of a link in m, or ratio of the platform's height to the sliders' distance."""


@dataclass(frozen=True, slots=True)
class FollowingSliders:
    """Two sliders that carry a platform.

    Attributes:
        left: index of the left slider's body.
        right: index of the right slider's body.
        across: index of the body that slides by p.
        up: index of the body that slides by q.
        half_m: half the distance between the screws.
        length_m: of each link.
    """

    left: int
    right: int
    across: int
    up: int
    half_m: float
    length_m: float

    def numbers(self) -> list[float]:
        """Return the pair as numbers for `follow`."""
        return [*map(float, (self.left, self.right, self.across, self.up)), self.half_m, self.length_m]


NO_PAIR = (-1.0, -1.0, -1.0, -1.0, 0.0, 0.0)
"""Pair of a mechanism without one: all joints follow in proportion."""


class ArmArrays(NamedTuple):
    """A mechanism in the storage of the compiled functions.

    Attributes:
        bodies: the tree, BODY_FIELDS numbers of `mechanics` for each body.
        slopes: bodies x axes, rad or m of each joint for each rad of a rotor; those of a platform change with its pose.
        offsets: the joints' positions with all rotors at 0, one for each body.
        pair: PAIR_FIELDS numbers.
        body_count: number of bodies.
        axis_count: number of axes.
        gravity_m_s2: against z.
    """

    bodies: list[float]
    slopes: list[float]
    offsets: list[float]
    pair: list[float]
    body_count: int
    axis_count: int
    gravity_m_s2: float


class JointArrays(NamedTuple):
    """Joints of the bodies at one instant; working storage.

    Attributes:
        places: positions s in rad and m, one for each body.
        rates: ds/dt.
        drifts: part of the joint accelerations that does not come from the rotors'; 0 for joints in proportion.
        motion: MOTION_FIELDS numbers of `mechanics` for each body.
    """

    places: list[float]
    rates: list[float]
    drifts: list[float]
    motion: list[float]


@kernel_function
def follow(arm: ArmArrays, state: list[float], joints: JointArrays) -> None:
    """Compute positions, rates and drifts of the joints, and the platform's slopes, from the rotors' `state`."""
    pair, slopes, offsets, axis_count = arm.pair, arm.slopes, arm.offsets, arm.axis_count
    places, rates = joints.places, joints.rates
    across, up = int(pair[ACROSS]), int(pair[UP])
    for body in range(arm.body_count):
        if body in (across, up):
            continue
        place, rate = offsets[body], 0.0
        for axis in range(axis_count):
            slope = slopes[body * axis_count + axis]
            place += slope * state[axis * STATE_FIELDS + PLACE]
            rate += slope * state[axis * STATE_FIELDS + RATE]
        places[body], rates[body] = place, rate
    if pair[LEFT] >= 0.0:
        follow_sliders(pair, slopes, places, rates, joints.drifts, axis_count)


@kernel_function
def follow_sliders(
    pair: list[float], slopes: list[float], places: list[float], rates: list[float], drifts: list[float],
    axis_count: int,
) -> None:  # fmt: skip
    """Compute the platform's part. If slipped rotors make a pose impossible, keep the last pose."""
    left, right, across, up = int(pair[LEFT]), int(pair[RIGHT]), int(pair[ACROSS]), int(pair[UP])
    half = pair[HALF]
    apart = places[left] - places[right]
    square = 4.0 * pair[LENGTH] * pair[LENGTH] / (4.0 * half * half + apart * apart) - 1.0
    if square <= 4.0 * SINGULAR * SINGULAR:
        return
    k = sqrt(square)
    p = apart * k / 2.0
    q = (places[left] + places[right]) / 2.0 + half * k
    left_rise, right_rise = q - places[left], q - places[right]
    if abs(left_rise) < SINGULAR or abs(right_rise) < SINGULAR:
        return
    steep, other_steep = (p + half) / left_rise, (p - half) / right_rise
    between = steep - other_steep
    rate = (rates[left] - rates[right]) / between
    turning = rate * (1.0 + steep * steep) / left_rise
    other_turning = rate * (1.0 + other_steep * other_steep) / right_rise
    drift = -(turning - other_turning) * rate / between
    places[across], places[up] = p, q
    rates[across], rates[up] = rate, rates[left] - steep * rate
    drifts[across], drifts[up] = drift, -steep * drift - turning * rate
    for axis in range(axis_count):
        slope = (slopes[left * axis_count + axis] - slopes[right * axis_count + axis]) / between
        slopes[across * axis_count + axis] = slope
        slopes[up * axis_count + axis] = slopes[left * axis_count + axis] - steep * slope
