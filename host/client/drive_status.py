"""Decode TPDO1: the report of a drive's status, sent at every change and ten times per second."""

import struct
from typing import Final, NamedTuple

from steptwin.protocol.cia402 import Mode, State, Status

FAULT_STATES: Final = (State.FAULT, State.FAULT_REACTION_ACTIVE)
STOPPED: Final = (State.QUICK_STOP_ACTIVE, *FAULT_STATES)
"""States of a drive after a stop or a fault."""
# Bound once: access to an enum's member costs time, for every axis at every poll.
_ENABLED: Final = State.OPERATION_ENABLED
_INTERPOLATED: Final = int(Mode.INTERPOLATED_POSITION)
_IP_ACTIVE: Final = int(Status.IP_ACTIVE)
_LAYOUT: Final = struct.Struct("<Hbi")


class DriveStatus(NamedTuple):
    """One report: statusword, its state, mode of operation, and position by the step counter."""

    statusword: int
    state: State
    mode: int
    position_units: int

    @classmethod
    def decode(cls, data: bytes) -> "DriveStatus":
        """Decode the seven bytes of TPDO1; raise ValueError for another length or a statusword without state."""
        if len(data) != _LAYOUT.size:
            raise ValueError(f"a drive's status has {_LAYOUT.size} bytes, not {len(data)}")
        statusword, mode, position_units = _LAYOUT.unpack(data)
        return cls(statusword, State.of(statusword), mode, position_units)

    @property
    def in_fault(self) -> bool:
        """True while the drive is in fault or in its fault reaction."""
        return self.state in FAULT_STATES

    @property
    def interpolating(self) -> bool:
        """True while the axis executes PVT records, even if they hold it at standstill."""
        active = self.state is _ENABLED and self.mode == _INTERPOLATED
        return active and bool(self.statusword & _IP_ACTIVE)

    @property
    def homing(self) -> bool:
        """True while a homing is in progress."""
        ended = self.statusword & (Status.TARGET_REACHED | Status.HOMING_ERROR)
        return self.state is _ENABLED and self.mode == Mode.HOMING and not ended

    @property
    def halted(self) -> bool:
        """True while the axis is at standstill within its records, because its group is halted."""
        return self.interpolating and bool(self.statusword & Status.TARGET_REACHED)


def at_rest(statusword: int, mode: int) -> bool:
    """Return whether an axis is at standstill; in profile velocity, "target reached" does not mean standstill."""
    following = State.of(statusword) is State.OPERATION_ENABLED and mode == Mode.PROFILE_VELOCITY
    return bool(statusword & (Status.ZERO_SPEED if following else Status.TARGET_REACHED))
