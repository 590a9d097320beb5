"""The software position limits (607Dh, CiA 402-2), between which the host may move an axis.

They use the coordinates of the position actual value (6064h), home offset included. Their defaults, the ends of the i32
range, switch them off. In some drives two limits of 0 do so, too.
"""

from steptwin.controller.motion.kernel import I32_MAX
from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError


class SoftLimits:
    """The limits of one axis, read from the dictionary at every use."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._low = dictionary.cell(od.POSITION_LIMIT_MIN)
        self._high = dictionary.cell(od.POSITION_LIMIT_MAX)
        self._zero_is_off = dictionary.traits.zero_limits_off
        dictionary.bind(self)

    def check_low(self, low: int) -> None:
        """Refuse a low limit above the high one."""
        if low > self._high.value and not (self._zero_is_off and self._high.value == 0):
            raise SdoAbortError(AbortCode.MAX_BELOW_MIN)

    def check_high(self, high: int) -> None:
        """Refuse a high limit below the low one."""
        if high < self._low.value and not (self._zero_is_off and high == 0):
            raise SdoAbortError(AbortCode.MAX_BELOW_MIN)

    def range(self) -> tuple[int, int]:
        """Return the lowest and highest allowed position. -2^31 is never allowed: the kernel's range is symmetric."""
        low = self._low.value
        if self._zero_is_off and low == self._high.value == 0:
            return -I32_MAX, I32_MAX
        return -I32_MAX if low < -I32_MAX else low, self._high.value

    def clamped(self, position_units: int) -> int:
        """Return the nearest position within the limits."""
        low, high = self.range()
        return max(low, min(position_units, high))


def hull(
    start_units: int, velocity: int, displacement_units: int, end_velocity: int, duration_ms: int
) -> tuple[int, int]:
    """Return the lowest and highest Bernstein coefficient of a segment: of p0, p0 + v0 T/3, p1 - v1 T/3 and p1.

    They bound its positions. The bounds are exact if the axis does not reverse within the segment.
    """
    end_units = start_units + displacement_units
    after_units = start_units + velocity * duration_ms // (3 * VELOCITY_PER_UNIT_PER_MS)
    before_units = end_units - end_velocity * duration_ms // (3 * VELOCITY_PER_UNIT_PER_MS)
    corners = start_units, after_units, before_units, end_units
    return min(corners), max(corners)
