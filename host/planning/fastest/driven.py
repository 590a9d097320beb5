"""Time a path as fast as its drives manage, and let their rotors decide.

Torques that suffice at a steady speed may not do: a plan that leaves 30 % of them can make the arm swing on its motors
until a rotor slips. So the motion is averaged over the time that the drives name, and the rotors turn by it. One that
slips, or would if it were somewhat faster, is made gentler and smoother in turn, until they keep step.
"""

from dataclasses import replace
from typing import Final, NamedTuple

from steptwin.host.common.errors import InputError
from steptwin.host.planning.fastest.drives import DriveLimits, DrivesOnPath, PathLoad
from steptwin.host.planning.fastest.executed import LimitedPath, TimedPath, timed
from steptwin.host.planning.fastest.rows import PathRates
from steptwin.host.robots.robot import Robot


class _Change(NamedTuple):
    """What is changed in a motion that the rotors refuse: its averaging time, by a factor, and the torque left."""

    smoother: float = 1.0
    left_percent: float = 0.0


_CHANGES: Final = (
    *(_Change(left_percent=5.0), _Change(left_percent=5.0), _Change(smoother=1.25)),
    *(_Change(left_percent=5.0), _Change(smoother=1.25), _Change(left_percent=10.0)),
)
"""Changes one after the other: a little more torque that is left costs less time than a longer average."""
TRIES_MAX: Final = len(_CHANGES)


class WeakDrivesError(InputError):
    """The drives do not manage a path at any pace that was tried."""


def driven(
    robot: Robot, path: LimitedPath, limits: DriveLimits, load: PathLoad, from_ms: int = 0, tries: int = TRIES_MAX
) -> TimedPath:
    """Return the fastest motion from rest to rest along a path at which the drives keep step.

    Raises WeakDrivesError if weights alone need too much torque, or if the rotors still refuse the motion after as many
    changes as `tries`; the message says what they did.
    """
    rates = path.rates()
    drives = drives_along(limits, rates, load)
    average_s, refused = drives.average_s, ""
    for number, change in enumerate((_Change(), *_CHANGES[:tries]), 1):
        average_s *= change.smoother
        if change.left_percent:
            limits = limits.left_more(change.left_percent)
            drives = drives_along(limits, rates, load)
        found = timed(robot, path, average_s, from_ms, drives)
        trial = drives.tried(found.motion, found.law.at(found.motion.curve.x)[0], average_s)
        if not trial.refused:
            return replace(found, drives=replace(trial.answer, tries=number))
        refused = f"{trial.refused} in a motion that leaves {trial.answer.left_percent:.0f} % of the torque"
    changed = f", the last of {tries + 1} that were tried" if tries else ""
    raise WeakDrivesError(f"{refused}, averaged over {average_s:.3f} s{changed}: the motors do not keep step")


def drives_along(limits: DriveLimits, rates: PathRates, load: PathLoad) -> DrivesOnPath:
    """Return the drives on a path; raise WeakDrivesError if weights alone need too much."""
    try:
        return limits.along(rates, load)
    except InputError as error:
        raise WeakDrivesError(str(error)) from error
