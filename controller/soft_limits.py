"""The software position limits 0x607D (CiA 402-2): within which an axis may be sent.

They are positions as 0x6064 shows them, home offset included. After power-up they are the ends of the i32 range, which
switches them off.
"""

from controller.kernel import I32_MAX
from protocol.dictionary import ObjectDictionary


def soft_limits(dictionary: ObjectDictionary) -> tuple[int, int]:
    """Lowest and highest position that an axis may be sent to; the kernel's range is symmetric."""
    return max(dictionary.get(0x607D, 1), -I32_MAX), dictionary.get(0x607D, 2)


def clamped(dictionary: ObjectDictionary, position_units: int) -> int:
    """The nearest position within the limits; where these contradict each other, the low one."""
    low, high = soft_limits(dictionary)
    return max(low, min(position_units, high))
