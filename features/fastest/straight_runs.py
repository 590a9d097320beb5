"""Runs of a path on which the joints go straight from rest to rest: the S-curve by their jerk is the fastest motion.

An S-curve is a speed with straight ramps, averaged over the time in which its acceleration rises. A motion that is
averaged over twice that time has the same jerk where it turns from speeding up to slowing down, else only half of it.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from steptwin.features.fastest.rows import PathLimits, PathRates, jerks_max, moved_joints, with_axes
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.laws import SCurve
from steptwin.host.robots.robot import Robot

_EVEN: Final = 1e-9
"""Part by which a direction or a limit may differ on a straight run."""
_WITHIN: Final = 1.0 - 2e-7
"""Part of the limits that is used: the last digits of a cubic must not exceed them."""


def straight_runs(robot: Robot, rates: PathRates, limits: PathLimits, stops: FloatArray) -> Mapping[int, SCurve]:
    """Return the S-curves of the straight runs between stops, by the numbers of the runs.

    Runs whose limits change, or whose joints do not all have a `jerk_max`, have none.
    """
    found = dict[int, SCurve]()
    jerks = jerks_max(robot)
    if not np.isfinite(jerks).any():
        return found
    seams = np.searchsorted(rates.s, stops) + 1  # at a stop the place is there twice
    for run, (begin, end) in enumerate(zip([0, *seams], [*seams, len(rates.s)], strict=True)):
        own = slice(begin, end)
        moved = moved_joints(robot, rates.first[own])
        columns = (rates.first, rates.tool, limits.speeds, limits.accelerations, limits.tool)
        if not (np.isfinite(jerks[moved]).all() and all(_is_even(values[own]) for values in columns)):
            continue
        slopes = np.abs(with_axes(robot, rates.first[begin : begin + 1])[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            by_tool = np.nanmin(np.append(limits.tool[begin] / rates.tool[begin], np.inf))
            speed = min((limits.speeds[begin] / slopes).min(), by_tool)
            acceleration = (limits.accelerations[begin] / slopes).min()
        jerk = (jerks[moved] / np.abs(rates.first[begin, moved])).min()
        length = float(rates.s[end - 1] - rates.s[begin])
        found[run] = SCurve.fastest(length, _WITHIN * float(speed), _WITHIN * float(acceleration), float(jerk))
    return found


def ramps(curve: SCurve, begin: float) -> tuple[FloatArray, FloatArray]:
    """Return the places and the squares of the speeds of an S-curve from a place on, before averaging over `jerk_s`."""
    ramp = curve.speed * (curve.ramp_s - curve.jerk_s) / 2.0
    square = curve.speed**2
    return begin + np.array([0.0, ramp, curve.distance - ramp, curve.distance]), np.array([0.0, square, square, 0.0])


def _is_even(values: FloatArray) -> bool:
    """Return whether rows of values are the same."""
    first = values[0]
    with np.errstate(invalid="ignore"):
        return bool((np.nan_to_num(np.abs(values - first)) <= _EVEN * np.abs(first).max()).all())
