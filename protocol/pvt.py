"""The PVT record, a position-velocity-time point in one 8-byte PDO, and its flow control.

Each record carries a sequence number. The device accepts the next number only. It ignores records that it already has
and drops records after a gap, so a host may resend records at any time. The host sends no more records than the device
has reported free places.
"""

from enum import Enum, IntEnum
from typing import Final, NamedTuple

QUEUE_DEPTH: Final = 64
SEQUENCE_MODULUS: Final = 256

I24_MIN: Final = -(1 << 23)
I24_MAX: Final = (1 << 23) - 1
DURATION_MAX_MS: Final = 255
VELOCITY_PER_UNIT_PER_MS: Final = 64
"""Unit of the record's velocity: 1/64 wire unit per millisecond."""


class PvtRecord(NamedTuple):
    """One cubic segment: displacement from the previous record's end, end velocity, duration."""

    displacement_units: int
    end_velocity: int
    duration_ms: int
    sequence: int

    def encode(self) -> bytes:
        """Return the eight bytes of RPDO4; raise OverflowError if a value exceeds its field."""
        return (
            self.displacement_units.to_bytes(3, "little", signed=True)
            + self.end_velocity.to_bytes(3, "little", signed=True)
            + bytes((self.duration_ms, self.sequence))
        )


class PvtStatus(NamedTuple):
    """PVT status (2012h) as TPDO3 carries it."""

    next_sequence: int
    free: int
    flags: int
    executing: int
    clock_us: int

    @classmethod
    def decode(cls, data: bytes) -> "PvtStatus":
        """Return the status in the eight bytes of TPDO3; raise ValueError for any other length."""
        if len(data) != 8:
            raise ValueError(f"a PVT status has 8 bytes, not {len(data)}")
        return cls(data[0], data[1], data[2], data[3], int.from_bytes(data[4:8], "little"))


class PvtFlag(IntEnum):
    """Flags of the PVT status (2012h:03); combined bits are plain integers."""

    GAP = 1
    OVERFLOW = 2
    UNDERRUN = 4
    REJECTED = 8
    RUNNING = 16
    ARMED = 32
    LOW = 64
    EMPTY = 128


class Verdict(Enum):
    """The device's decision on a received record."""

    PUSH = "push"
    STALE = "already there: ignored"
    GAP = "records are missing before it: dropped"
    FULL = "no room: dropped"


def judge(sequence: int, next_sequence: int, free: int) -> Verdict:
    """Decide on a record by its sequence number modulo 256: a number up to 128 behind the expected one is old."""
    ahead = (sequence - next_sequence) % SEQUENCE_MODULUS
    if ahead >= SEQUENCE_MODULUS // 2:
        return Verdict.STALE
    if ahead:
        return Verdict.GAP
    return Verdict.PUSH if free else Verdict.FULL
