"""Halt and resume the group's trajectory time by a ramp within every axis' deceleration limit.

See `group_time` for the formula. The speeds come from the segments that the ramp will cover, as far as they are queued.
"""

from collections.abc import Sequence

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.board_motion import STOP_MAX_MS, TICKS_PER_SECOND, BoardMotion


def ramp_group(motion: BoardMotion, decelerations_units_per_s2: Sequence[int]) -> None:
    """Halt or resume the group, as its axes request, from the next tick on, within each axis' deceleration limit."""
    group = motion.group
    # Where the plan has every axis at rest, v dr/dt is 0 at any slope: the rate may change at once.
    moves = any(motion.planned_velocity(axis) for axis in group.members)
    group.ramp(motion.tick, _full_ramp_ticks(motion, decelerations_units_per_s2) if moves else 0)


def _full_ramp_ticks(motion: BoardMotion, decelerations_units_per_s2: Sequence[int]) -> int:
    """Return the shortest ramp between full rate and 0 that keeps |v dr/dt| within every axis' deceleration D.

    That is T = |v| / D, with v the highest speed in the T/2 of trajectory time that the ramp covers at most. A longer
    ramp covers more segments, which may be faster: so T is increased until it suffices. Like a stop it lasts at most
    STOP_MAX_MS.
    """
    needed, ticks = 1, 0
    while needed > ticks:
        ticks = needed
        for axis in motion.group.members:
            velocity = _fastest_units_per_s(motion, axis, ticks // 2 + 1)
            needed = max(needed, -(-velocity * TICKS_PER_SECOND // decelerations_units_per_s2[axis]))
        needed = min(needed, STOP_MAX_MS * k.TICKS_PER_MS)
    return ticks


def _fastest_units_per_s(motion: BoardMotion, axis: int, ahead_ticks: int) -> int:
    """Bound the planned speed over a time ahead, by the Bernstein coefficients of the segments' velocities."""
    per_unit_q16 = motion.config(axis).microsteps << 2
    left_ticks = ahead_ticks + motion.elapsed_ticks(axis)
    fastest = 0
    for a, b, c, duration_ticks in motion.planned_segments(axis):
        if left_ticks <= 0:
            break
        rate_q16 = max(abs(a), abs(a + b), abs(a + 2 * b + 3 * c))
        fastest = max(fastest, -(-rate_q16 * TICKS_PER_SECOND // (per_unit_q16 * duration_ticks)))
        left_ticks -= duration_ticks
    return fastest
