"""Move axes by their own profiles: all together to a position, or one at a velocity.

The client follows the motion by the axes' status reports, so other programs may use SDO meanwhile.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.links import Link
from steptwin.host.client.reports import Listening, check_enabled, check_faults
from steptwin.host.client.waiting import POLL_S
from steptwin.host.common.errors import BusError
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, Control, Mode, Status
from steptwin.protocol.frame import COB_SYNC

VELOCITY_MIN_UNITS_PER_S: Final = 16
"""Lowest velocity: the firmware's resolution, 1/64 unit per ms, is 15.6 units/s; a lower velocity would be 0."""
_STALL_S: Final = 5.0
"""Time limit for the next step; a step takes longer only in a motion of hours."""


@dataclass(frozen=True, slots=True)
class ProfileMove:
    """The move of one axis: target position (607Ah), profile velocity (6081h) and acceleration of both ramps.

    Profile acceleration (6083h) and profile deceleration (6084h) are equal. `travel_units` is the distance to the
    target.
    """

    travel_units: int
    target_units: int
    velocity_units_per_s: int
    acceleration_units_per_s2: int


class VelocityTarget(NamedTuple):
    """The drive of one axis: signed target velocity (60FFh), and acceleration of all ramps, stops included.

    With accelerations in proportion to the velocities, the axes stay synchronous in all ramps.
    """

    axis: AxisClient
    velocity_units_per_s: int
    acceleration_units_per_s2: int


def move_together(
    link: Link, axes: Sequence[AxisClient], moves: Mapping[int, ProfileMove], progress: Callable[[float], None]
) -> None:
    """Start moves of enabled axes in the same servo tick and wait until all have reached their targets.

    Raises:
        DeviceFaultError: a drive, even one that does not move, is in fault or was stopped meanwhile.
        BusError: an axis sends no reports, does not start or does not continue.
    """
    moving = [axes[i] for i in moves]
    for axis, move in zip(moving, moves.values(), strict=True):
        _enter(axis, Mode.PROFILE_POSITION)
        axis.write(od.TARGET_POSITION, move.target_units)
        axis.write(od.PROFILE_VELOCITY, move.velocity_units_per_s)
        axis.write(od.PROFILE_ACCELERATION, move.acceleration_units_per_s2)
        axis.write(od.PROFILE_DECELERATION, move.acceleration_units_per_s2)
    for axis in axes:
        axis.drive_status = None
    _at_next_sync(link, moving, ENABLE_OPERATION | Control.START)
    longest, longest_move = max(moves.items(), key=lambda move: abs(move[1].travel_units))

    def arrived() -> bool:
        status = axes[longest].drive_status
        if status is not None:
            left = (longest_move.target_units - status.position_units) / longest_move.travel_units
            progress(min(1.0, max(0.0, 1.0 - left)))
        return all(map(_arrived, moving))

    follow(link, axes, arrived, stall_s=_STALL_S)
    for axis in moving:
        axis.write(od.CONTROLWORD, ENABLE_OPERATION)


def drive(link: Link, drives: Sequence[VelocityTarget]) -> None:
    """Drive enabled axes at velocities, all from the same servo tick on, until `halt` or their position limits."""
    together = len(drives) > 1
    for axis, velocity_units_per_s, acceleration_units_per_s2 in drives:
        axis.write(od.TARGET_VELOCITY, 0)
        _enter(axis, Mode.PROFILE_VELOCITY)
        if together:
            axis.write(od.CONTROLWORD, ENABLE_OPERATION | Control.HALT)
        axis.write(od.PROFILE_ACCELERATION, acceleration_units_per_s2)
        axis.write(od.PROFILE_DECELERATION, acceleration_units_per_s2)
        if together:
            axis.write(od.QUICK_STOP_DECELERATION, acceleration_units_per_s2)
        axis.drive_status = None
        axis.write(od.TARGET_VELOCITY, velocity_units_per_s)
    if together:
        for each in drives:
            each.axis.drive_status = None
        _at_next_sync(link, [each.axis for each in drives], ENABLE_OPERATION)


def halt(link: Link, axes: Sequence[AxisClient]) -> None:
    """End `drive` by ramps from the same servo tick on, and wait for standstill; raises as `move_together`."""
    together = len(axes) > 1
    for axis in axes:
        axis.drive_status = None
        if not together:
            axis.write(od.TARGET_VELOCITY, 0)
    if together:
        _at_next_sync(link, axes, ENABLE_OPERATION | Control.HALT)
    follow(link, axes, lambda: all(map(reports_zero_speed, axes)), stall_s=_STALL_S)
    if together:
        for axis in axes:
            axis.write(od.TARGET_VELOCITY, 0)
            axis.write(od.CONTROLWORD, ENABLE_OPERATION)


def _at_next_sync(link: Link, axes: Sequence[AxisClient], controlword: int) -> None:
    """Send a controlword that all axes obey in the same servo tick."""
    for axis in axes:
        axis.send_latched_controlword(controlword)
    link.network.send_message(COB_SYNC, b"")


def reports_zero_speed(axis: AxisClient) -> bool:
    """Return whether an axis in profile velocity reports speed 0."""
    status = axis.drive_status
    return status is not None and status.mode == Mode.PROFILE_VELOCITY and bool(status.statusword & Status.ZERO_SPEED)


def follow(link: Link, axes: Sequence[AxisClient], done: Callable[[], bool], stall_s: float = float("inf")) -> None:
    """Wait until `done` returns True; raises as `move_together`, with a stall after `stall_s` without motion."""
    listening = Listening(link, axes)
    positions: list[int | None] = [None] * len(axes)
    moved_s = link.now_s()
    while True:
        check_faults(link, axes)
        check_enabled(axes)
        if done():
            return
        listening.check()
        present = [axis.drive_status and axis.drive_status.position_units for axis in axes]
        if present != positions:
            positions, moved_s = present, link.now_s()
        elif link.now_s() - moved_s > stall_s:
            raise BusError(f"the axes have not moved for {stall_s:g} s and have not arrived")
        link.wait(POLL_S)


def _enter(axis: AxisClient, mode: Mode) -> None:
    """Set an axis' mode with the start bit cleared, because a motion starts at its rise."""
    axis.write(od.CONTROLWORD, ENABLE_OPERATION)
    axis.write(od.MODE_OF_OPERATION, mode)


def _arrived(axis: AxisClient) -> bool:
    """Return whether an axis reports that it has acknowledged the set-point and reached it."""
    status, wanted = axis.drive_status, int(Status.SET_POINT_ACKNOWLEDGED | Status.TARGET_REACHED)
    return status is not None and status.mode == Mode.PROFILE_POSITION and status.statusword & wanted == wanted
