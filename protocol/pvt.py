"""The PVT record and its flow control: position-velocity-time points over one 8-byte PDO.

A record carries its sequence number. The device takes exactly the next one, ignores what it already has and drops
what comes after a gap, so that a host may resend freely; the host counts credits against the free places reported.
"""

from enum import Enum, IntEnum
from typing import NamedTuple

QUEUE_DEPTH = 64
SEQUENCE_MODULUS = 256

I24_MIN, I24_MAX = -(1 << 23), (1 << 23) - 1
DURATION_MAX_MS = 255
VELOCITY_PER_UNIT_PER_MS = 64
"""The record's velocity counts in 1/64 unit per millisecond."""


class PvtRecord(NamedTuple):
    """One cubic segment as it travels: from the previous record's end, to this displacement and velocity."""

    displacement_units: int
    end_velocity: int
    duration_ms: int
    sequence: int

    def encode(self) -> bytes:
        """The eight bytes of RPDO4; OverflowError if a field leaves its width."""
        return (
            self.displacement_units.to_bytes(3, "little", signed=True)
            + self.end_velocity.to_bytes(3, "little", signed=True)
            + bytes((self.duration_ms, self.sequence))
        )


class PvtStatus(NamedTuple):
    """Object 0x2012 as TPDO3 carries it."""

    next_sequence: int
    free: int
    flags: int
    executing: int
    clock_us: int

    @classmethod
    def decode(cls, data: bytes) -> "PvtStatus":
        """Read it from the eight bytes of TPDO3; ValueError for any other length."""
        if len(data) != 8:
            raise ValueError(f"a PVT status has 8 bytes, not {len(data)}")
        return cls(data[0], data[1], data[2], data[3], int.from_bytes(data[4:8], "little"))


class PvtFlag(IntEnum):
    """Bits of object 0x2012:03; combined they are plain integers."""

    GAP = 1
    OVERFLOW = 2
    UNDERRUN = 4
    REJECTED = 8
    RUNNING = 16
    ARMED = 32
    LOW = 64
    EMPTY = 128


class Verdict(Enum):
    """What the device does with a record that has arrived."""

    PUSH = "push"
    STALE = "already there: ignored"
    GAP = "records are missing before it: dropped"
    FULL = "no room: dropped"


def judge(sequence: int, next_sequence: int, free: int) -> Verdict:
    """Decide on a record by its distance from the one expected, modulo 256: half the circle behind is old."""
    ahead = (sequence - next_sequence) % SEQUENCE_MODULUS
    if ahead >= SEQUENCE_MODULUS // 2:
        return Verdict.STALE
    if ahead:
        return Verdict.GAP
    return Verdict.PUSH if free else Verdict.FULL
