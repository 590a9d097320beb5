"""What a target means in profile position: the positioning option code (60F2h, CiA 402-2).

Bits 1 and 0 say what a relative target counts from: 0 the last target, or the position demand if there has been none
since the axis was stopped or enabled; 1 the position demand (6062h); 2 the position actual value (6064h). Both are read
as the set-point is given.

Bits 7 and 6 say how an absolute target of an axis that turns without end is reached: 0 as on a straight axis, 1 in
negative direction only, 2 in positive direction only, 3 by the shortest way, which is the positive one for half a turn.
A turn goes from the least to the greatest position of the position range limit (607Bh), both included. While that is
the whole i32 range, as after power-up, there are no turns, and the direction has no effect. Relative targets are not
changed. The drive counts on from turn to turn: the position demand and the position actual value are not wrapped.
"""

from enum import IntEnum
from typing import Final

from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.entry import DataType


class RelativeTo(IntEnum):
    """Bits 1 and 0 of the positioning option code."""

    LAST_TARGET = 0
    DEMAND = 1
    ACTUAL = 2


class TurnDirection(IntEnum):
    """Bits 7 and 6 of the positioning option code."""

    STRAIGHT = 0
    NEGATIVE = 1
    POSITIVE = 2
    SHORTEST = 3


_DIRECTION_SHIFT: Final = 6
_TWO_BITS: Final = 3


def way_units(from_units: int, target_units: int, turn_units: int, direction: TurnDirection) -> int:
    """Return the way to a target on an axis that turns without end, in units; `turn_units` is a whole turn."""
    ahead_units = (target_units - from_units) % turn_units
    behind_units = ahead_units - turn_units if ahead_units else 0
    if direction is TurnDirection.STRAIGHT:
        return target_units - from_units
    if direction is TurnDirection.NEGATIVE:
        return behind_units
    if direction is TurnDirection.POSITIVE or 2 * ahead_units <= turn_units:
        return ahead_units
    return behind_units


class Positioning:
    """Turns the target position of one axis into the position to move to."""

    def __init__(self, context: AxisContext) -> None:
        self._motion = context.motion
        self._dictionary = context.dictionary
        context.dictionary.bind(self)

    def check_low(self, low: int) -> None:
        """Refuse a range that is not longer than a position."""
        if low >= self._dictionary.get(od.POSITION_RANGE_MAX):
            raise SdoAbortError(AbortCode.MAX_BELOW_MIN)

    def check_high(self, high: int) -> None:
        """Refuse a range that is not longer than a position."""
        if high <= self._dictionary.get(od.POSITION_RANGE_MIN):
            raise SdoAbortError(AbortCode.MAX_BELOW_MIN)

    def target_units(self, *, relative: bool, last_target_units: int | None, from_units: int) -> int:
        """Return the position that the target position (607Ah) means.

        `from_units` is where the motion to it will begin: the target before it, or the position demand.
        """
        wanted_units, option = self._dictionary.get(od.TARGET_POSITION), self._dictionary.get(od.POSITIONING_OPTION)
        if relative:
            return wanted_units + self._base_units(RelativeTo(option & _TWO_BITS), last_target_units)
        low, high = self._dictionary.get(od.POSITION_RANGE_MIN), self._dictionary.get(od.POSITION_RANGE_MAX)
        if (low, high) == (DataType.INTEGER32.low, DataType.INTEGER32.high):
            return wanted_units
        return from_units + way_units(
            from_units, wanted_units, high - low + 1, TurnDirection(option >> _DIRECTION_SHIFT)
        )

    def _base_units(self, base: RelativeTo, last_target_units: int | None) -> int:
        if base is RelativeTo.ACTUAL:
            return self._motion.counter_units
        if base is RelativeTo.DEMAND or last_target_units is None:
            return self._motion.demand_units
        return last_target_units
