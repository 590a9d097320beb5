"""Motions that the axes make by themselves: to a position, all at once, or at a velocity.

They are followed by what the axes report without being asked, so that other programs on the bus may use SDO meanwhile.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import DriveStatus
from steptwin.host.client.link import Link
from steptwin.host.client.run import POLL_S, check_enabled, check_faults
from steptwin.host.common.errors import BusError
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, Control, Mode, Status
from steptwin.protocol.frame import COB_SYNC

_SILENCE_S: Final = 1.0
"""Ten times the status report's event timer: a board that says nothing for so long is gone."""
_STALL_S: Final = 5.0
"""The slowest motion takes less for a step, but one of hours."""


@dataclass(frozen=True, slots=True)
class ProfileMove:
    """Where one axis goes and how, in the objects' own units: 0x607A, 0x6081, and 0x6083 and 0x6084 alike."""

    target_units: int
    velocity_units_per_s: int
    acceleration_units_per_s2: int


def move_together(
    link: Link, axes: Sequence[AxisClient], moves: Sequence[ProfileMove], progress: Callable[[float], None]
) -> None:
    """Move enabled axes, which start in the same servo tick, and wait until all have arrived.

    Raises:
        DeviceFaultError: a drive is in fault or was stopped on the way.
        BusError: an axis falls silent, does not start or does not go on.
    """
    starts = [axis.read(od.POSITION_ACTUAL) for axis in axes]
    for axis, move in zip(axes, moves, strict=True):
        _enter(axis, Mode.PROFILE_POSITION)
        axis.write(od.TARGET_POSITION, move.target_units)
        axis.write(od.PROFILE_VELOCITY, move.velocity_units_per_s)
        axis.write(od.PROFILE_ACCELERATION, move.acceleration_units_per_s2)
        axis.write(od.PROFILE_DECELERATION, move.acceleration_units_per_s2)
        axis.drive_status = None
    for axis in axes:
        axis.send_latched_controlword(ENABLE_OPERATION | Control.START)
    link.network.send_message(COB_SYNC, b"")
    longest = max(range(len(axes)), key=lambda i: abs(moves[i].target_units - starts[i]))
    way_units = moves[longest].target_units - starts[longest]

    def arrived() -> bool:
        status = axes[longest].drive_status
        if status is not None and way_units:
            progress((status.position_units - starts[longest]) / way_units)
        return all(map(_arrived, axes))

    follow(link, axes, arrived, stall_s=_STALL_S)
    for axis in axes:
        axis.write(od.CONTROLWORD, ENABLE_OPERATION)


def drive_at(axis: AxisClient, velocity_units_per_s: int, acceleration_units_per_s2: int) -> None:
    """Let an enabled axis take a velocity, and keep it, until `halt_axis` or a soft limit stops it."""
    axis.write(od.TARGET_VELOCITY, 0)
    _enter(axis, Mode.PROFILE_VELOCITY)
    axis.write(od.PROFILE_ACCELERATION, acceleration_units_per_s2)
    axis.write(od.PROFILE_DECELERATION, acceleration_units_per_s2)
    axis.drive_status = None
    axis.write(od.TARGET_VELOCITY, velocity_units_per_s)


def halt_axis(link: Link, axis: AxisClient) -> None:
    """End `drive_at` by its own ramp and wait until the axis rests; raises as `move_together` does."""
    axis.drive_status = None
    axis.write(od.TARGET_VELOCITY, 0)
    follow(link, [axis], lambda: stands(axis), stall_s=_STALL_S)


def stands(axis: AxisClient) -> bool:
    """Whether an axis that `drive_at` moves says that it stands."""
    status = axis.drive_status
    return status is not None and status.mode == Mode.PROFILE_VELOCITY and bool(status.statusword & Status.ZERO_SPEED)


def follow(link: Link, axes: Sequence[AxisClient], done: Callable[[], bool], stall_s: float = float("inf")) -> None:
    """Wait for a motion's end; raises as `move_together` does."""
    watched = tuple(axes)
    heard: list[DriveStatus | None] = [None] * len(axes)
    heard_s = [link.now_s()] * len(axes)
    positions = [status and status.position_units for status in heard]
    moved_s = link.now_s()
    while True:
        check_faults(link, watched)
        check_enabled(watched)
        if done():
            return
        now_s = link.now_s()
        for i, axis in enumerate(axes):
            if axis.drive_status is not heard[i]:
                heard[i], heard_s[i] = axis.drive_status, now_s
            elif now_s - heard_s[i] > _SILENCE_S:
                raise BusError(f"{axis.name}: no status for {_SILENCE_S:g} s")
        present = [status and status.position_units for status in heard]
        if present != positions:
            positions, moved_s = present, now_s
        elif now_s - moved_s > stall_s:
            raise BusError(f"the axes have not moved for {stall_s:g} s and have not arrived")
        link.wait(POLL_S)


def _enter(axis: AxisClient, mode: Mode) -> None:
    """With the start bit clear, since a motion starts with its rise."""
    axis.write(od.CONTROLWORD, ENABLE_OPERATION)
    axis.write(od.MODE_OF_OPERATION, mode)


def _arrived(axis: AxisClient) -> bool:
    """The set-point is acknowledged, so it has been taken, and none is left to reach."""
    status, wanted = axis.drive_status, Status.SETPOINT_ACKNOWLEDGED | Status.TARGET_REACHED
    return (
        status is not None and status.mode == Mode.PROFILE_POSITION and (status.statusword & int(wanted)) == int(wanted)
    )
