"""What a joint's drive would have to be for fewer steps: another microstep setting, or another lead or ratio."""

from dataclasses import replace

from steptwin.host.common.bad_input import at_least, at_most
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.transmission import MICROSTEPS


def with_fewer_steps(joint: Joint, part: float) -> tuple[Joint, str]:
    """Return the joint with a drive that makes at most this part of its steps, and the robot file's key and value.

    The drive keeps as many microsteps as it can. If full steps are still too many, it keeps its microsteps and has a
    longer travel per motor turn: a longer lead of the screw, or a smaller ratio of the gears.
    """
    old = joint.transmission
    fitting = [microsteps for microsteps in MICROSTEPS if microsteps <= part * old.microsteps]
    if fitting:
        drive, key, value = replace(old, microsteps=max(fitting)), "microsteps", str(max(fitting))
    elif joint.unit is Unit.MM:
        key, value = "travel_per_turn", at_least(old.travel_per_turn / part)
        drive = replace(old, travel_per_turn=float(value))
    else:
        key, value = "ratio", at_most(old.ratio * part)
        drive = replace(old, ratio=float(value))
    return replace(joint, transmission=drive), f"{key} = {value}"
