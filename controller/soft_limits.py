"""The software position limits 0x607D (CiA 402-2): within which an axis may be sent.

They are positions as 0x6064 shows them, home offset included. After power-up they are the ends of the i32 range, which
switches them off.
"""

from steptwin.controller.kernel import I32_MAX
from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

_LOW, _HIGH = od.POSITION_LIMIT_MIN, od.POSITION_LIMIT_MAX


class SoftLimits:
    """One axis' limits, as the dictionary has them at each moment."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._read_low, self._read_high = dictionary.reader(_LOW), dictionary.reader(_HIGH)

    def range(self) -> tuple[int, int]:
        """Lowest and highest position that the axis may be sent to; the kernel's range is symmetric."""
        return max(self._read_low(), -I32_MAX), self._read_high()

    def clamped(self, position_units: int) -> int:
        """The nearest position within the limits; where these contradict each other, the low one."""
        low, high = self.range()
        return max(low, min(position_units, high))


def hull(
    start_units: int, velocity: int, displacement_units: int, end_velocity: int, duration_ms: int
) -> tuple[int, int]:
    """Bounds of a segment's positions: the Bernstein coefficients of its cubic, p0, p0 + v0 T/3, p1 - v1 T/3, p1.

    They are exact where the axis does not turn round within the segment.
    """
    end_units = start_units + displacement_units
    after_units = start_units + velocity * duration_ms // (3 * VELOCITY_PER_UNIT_PER_MS)
    before_units = end_units - end_velocity * duration_ms // (3 * VELOCITY_PER_UNIT_PER_MS)
    corners = start_units, after_units, before_units, end_units
    return min(corners), max(corners)
