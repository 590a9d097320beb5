"""What a joint's drive would have to be for fewer steps: another microstep setting, another lead or ratio, or both."""

from dataclasses import replace
from typing import Final

from steptwin.host.common.bad_input import at_least, at_most
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.transmission import MICROSTEPS, Transmission

_ROUNDING: Final = 1e-12
"""Part of a ratio that is taken for a rounding error of its computation."""


def with_fewer_steps(joint: Joint, part: float) -> tuple[Transmission, str]:
    """Return a drive that makes at most this part of the joint's steps, and the robot file's keys and values.

    The drive keeps as many microsteps as it can. If full steps are still too many, it has a longer travel per motor
    turn as well: a longer lead of the screw, or a smaller ratio of the gears.
    """
    old = joint.transmission
    microsteps = max((number for number in MICROSTEPS if number <= part * old.microsteps), default=min(MICROSTEPS))
    drive = replace(old, microsteps=microsteps)
    changed = [f"microsteps = {microsteps}"] if drive != old else []
    part *= (1 + _ROUNDING) * old.microsteps / microsteps
    if part >= 1:
        return drive, changed[0]
    if joint.unit is Unit.MM:
        longer = at_least(old.travel_per_turn / part)
        drive, setting = replace(drive, travel_per_turn=float(longer)), f"travel_per_turn = {longer}"
    else:
        smaller = at_most(old.ratio * part)
        drive, setting = replace(drive, ratio=float(smaller)), f"ratio = {smaller}"
    return drive, " with ".join([*changed, setting])
