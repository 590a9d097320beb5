"""What an axis node says about its drive without being asked: TPDO1, at every change and ten times a second."""

import struct
from typing import Final, NamedTuple

from steptwin.protocol.cia402 import Mode, State, Status

_LAYOUT: Final = struct.Struct("<Hbi")


class DriveStatus(NamedTuple):
    """The statusword with the state that it shows, the mode of operation and the position by the step counter."""

    statusword: int
    state: State
    mode: int
    position_units: int

    @classmethod
    def decode(cls, data: bytes) -> "DriveStatus":
        """Read it from the seven bytes of TPDO1; ValueError for any other length and for bits that are no state's."""
        if len(data) != _LAYOUT.size:
            raise ValueError(f"a drive's status has {_LAYOUT.size} bytes, not {len(data)}")
        statusword, mode, position_units = _LAYOUT.unpack(data)
        return cls(statusword, State.of(statusword), mode, position_units)

    @property
    def in_fault(self) -> bool:
        """Whether the drive is in fault or on its way there."""
        return self.state in (State.FAULT, State.FAULT_REACTION_ACTIVE)

    @property
    def interpolating(self) -> bool:
        """Whether the axis is executing PVT records, at rest or not."""
        active = self.state is State.OPERATION_ENABLED and self.mode == Mode.INTERPOLATED_POSITION
        return active and bool(self.statusword & Status.IP_ACTIVE)

    @property
    def halted(self) -> bool:
        """Whether the axis rests amid its records because its group is halted."""
        return self.interpolating and bool(self.statusword & Status.TARGET_REACHED)


def stands(statusword: int, mode: int) -> bool:
    """Whether an axis rests; in profile velocity "target reached" is said of the velocity instead."""
    following = State.of(statusword) is State.OPERATION_ENABLED and mode == Mode.PROFILE_VELOCITY
    return bool(statusword & (Status.ZERO_SPEED if following else Status.TARGET_REACHED))
