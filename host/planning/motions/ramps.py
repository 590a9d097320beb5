"""Run-in and run-out: bring a motion that starts or ends at speed up to it from rest, and back to rest."""

from math import ceil

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.joint_move import change_times_s
from steptwin.host.planning.motions.sampled import Sampled
from steptwin.host.planning.motions.sequence import Sequence
from steptwin.host.planning.trajectory import REST_TOLERANCE, Trajectory
from steptwin.host.robots.robot import Robot


def with_ramps(motion: Trajectory, ramps_s: float) -> Sequence:
    """Return a motion without switchings between a run-in and a run-out, each where it starts or ends at speed.

    A ramp lasts `ramps_s`, has constant acceleration and goes straight on in joint space: the run-in begins
    v ramps_s / 2 before the motion's first position, v being the velocity there. The motion itself stays as it is.

    Raises:
        InputError: `ramps_s` is not a whole number of milliseconds above 0, or the motion starts and ends at rest.
    """
    if whole_ms(f"ramps_s={ramps_s:g}", ramps_s) <= 0:
        raise InputError(f"ramps_s={ramps_s:g}: is not above 0 s")
    (first, last), (start, end) = _ends(motion)
    names, rest, ramp_times_s = motion.joint_names, np.zeros_like(start), np.array([0.0, ramps_s])
    parts: list[Trajectory] = [motion]
    if _moves(start):
        places = np.array([first - start * ramps_s / 2, first])
        parts.insert(0, Sampled.hermite(names, ramp_times_s, places, np.array([rest, start])))
    if _moves(end):
        places = np.array([last, last + end * ramps_s / 2])
        parts.append(Sampled.hermite(names, ramp_times_s, places, np.array([end, rest])))
    if len(parts) == 1:
        raise InputError(f"ramps_s={ramps_s:g}: the motion starts and ends at rest")
    ends_ms = np.cumsum([whole_ms("the duration", part.duration_s) for part in parts])
    return Sequence(names, tuple(parts), (0, *ends_ms.tolist()), ())


def shortest_ramps_s(robot: Robot, motion: Trajectory, stretch: float = 1.0) -> float:
    """Return the shortest ramps, in whole milliseconds, within the robot's accelerations; 0 without speed.

    `stretch` is the factor by which the motion with its ramps will be slower.
    """
    _, velocities = _ends(motion)
    needed_ms = 1000.0 * float(change_times_s(robot, velocities).max()) / stretch**2
    return ceil(needed_ms * (1 - 1e-12)) / 1000 if _moves(velocities) else 0.0


def _ends(motion: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Return the positions and the velocities at both ends, each of shape (2, joints)."""
    t_s = np.array([0.0, motion.duration_s])
    return motion.positions(t_s), motion.velocities(t_s)


def _moves(velocities: FloatArray) -> bool:
    return bool(np.abs(velocities).max() > REST_TOLERANCE)
