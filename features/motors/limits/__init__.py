"""Limits of fastest motions by a robot's motors.

Their torques are rows for the planner, and their rotors judge the planned motion. Planning defines what it needs
(`host/planning/drives.py`). Pull-out torques, arms and rotors belong to the emulator, so both functions import it
when they are called.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.planning.drives import LEFT_PERCENT, DriveLimits
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.peaks import Samples, sampled
from steptwin.host.robots.robot import Robot

if TYPE_CHECKING:
    from steptwin.features.motors.limits.motor_rows import MotorLimits

__all__ = ["motor_forecast", "motor_limits"]

_REMEDY: Final = 'law = "fastest" with [limits] from = "motors" is as fast as they manage (docs/motors.md)'
_PART_MS: Final = 1 << 13
"""Milliseconds of a window whose torques are computed at once; bounds the memory."""


def motor_limits(robot: Robot, left_percent: float) -> DriveLimits:
    """Return the limits of a robot's motors that leave `left_percent` of their pull-out torque.

    Raises:
        InputError: the robot's file does not describe its motors and masses.
    """
    from steptwin.features.motors.limits.motor_rows import MotorLimits

    return MotorLimits.of(robot, left_percent)


def motor_forecast(robot: Robot, motion: Motion) -> str | None:
    """Return a warning if a robot's motors will or may slip in a motion; None if 30 % of their torque are left.

    It compares steady torques at each millisecond. Oscillations need rotors that turn (`run --motors`, or limits by
    motors in the robot's file). A robot whose file does not describe motors and masses gets no warning.
    """
    if not robot.has_motors:
        return None
    from steptwin.features.motors.limits.motor_rows import MotorLimits

    limits = MotorLimits.of(robot, 0.0)
    left, axis, at_s = min(_least_left(limits, motion, part) for samples in sampled(motion) for part in _parts(samples))
    if left >= LEFT_PERCENT - 1.0:
        return None
    needs = f"{robot.axis_names[axis]}'s motor needs {100.0 - left:.0f} % of its torque at {at_s:.3f} s"
    if left < 0.0:
        return f"{needs}: its rotor will slip; {_REMEDY}"
    usual = f"{100.0 - LEFT_PERCENT:g} %"
    return f"{needs}, more than the usual {usual}: its rotor may slip; `run --motors` turns it, and {_REMEDY}"


def _parts(samples: Samples) -> Iterator[Samples]:
    """Yield a window in parts; each begins with the last millisecond of the one before."""
    for begin in range(0, max(len(samples.t_s) - 1, 1), _PART_MS):
        yield Samples(*(each[begin : begin + _PART_MS + 1] for each in samples))


def _least_left(limits: "MotorLimits", motion: Motion, samples: Samples) -> tuple[float, int, float]:
    """Return the least torque left to a motor in a window, in percent, with its axis and its time."""
    from steptwin.features.motors.rotors.torques import needed_torque_nm
    from steptwin.features.motors.turning.poses import rotors_of

    rad, rad_s = (rotors_of(limits.robot, each) for each in (samples.positions, samples.velocities))
    rad_s2 = np.gradient(rad_s, samples.t_s, axis=0)
    available = limits.available_nm(rad_s)
    held = _held(limits.robot, motion, samples.t_s)
    used = np.zeros_like(rad)
    for arm, where in zip(limits.arms, (~held, held), strict=True):
        if where.any():
            needed = np.abs(needed_torque_nm(limits.drives, arm, rad[where], rad_s[where], rad_s2[where]))
            used[where] = needed / available[where]
    row, axis = np.unravel_index(int(np.argmax(used)), used.shape)
    return 100.0 * (1.0 - float(used[row, axis])), int(axis), float(samples.t_s[row])


def _held(robot: Robot, motion: Motion, t_s: FloatArray) -> BoolArray:
    """Return when the tool carries the payload: always, unless an output takes and leaves it."""
    held_by = robot.dynamics.payload_held_by if robot.dynamics else ""
    held = np.full(len(t_s), not held_by)
    for change in motion.output_changes if held_by else ():
        if change.output == held_by:
            held[t_s >= change.from_s] = change.on
    return held
