"""Homing through the whole firmware, on a machine with switches, held against the figures of CiA 402-2."""

import pytest

from controller.backend import Kernel
from protocol.cia402 import DigitalInput
from tests.controller.homing_bench import HomingBench, Machine

NEGATIVE, POSITIVE, HOME = DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME
LEFT, RIGHT = -600, 600
"""The limit switches are closed at these positions and beyond."""
FIRST, LAST = -20, 30
"""The home switch of methods 23 to 30 is closed from here to there: less than the way to stop from the fast speed."""
EDGE = 10
"""The home switch of methods 19 to 22 is closed from here on, or up to here."""

FIGURES: dict[int, tuple[int, int]] = {
    17: (LEFT + 1, 1),
    18: (RIGHT - 1, -1),
    19: (EDGE - 1, -1),
    20: (EDGE, 1),
    21: (EDGE + 1, 1),
    22: (EDGE, -1),
    23: (FIRST - 1, -1),
    24: (FIRST, 1),
    25: (LAST, -1),
    26: (LAST + 1, 1),
    27: (LAST + 1, 1),
    28: (LAST, -1),
    29: (FIRST, 1),
    30: (FIRST - 1, -1),
}
"""The step on which a method's edge is seen, and in which direction the axis crosses it."""

DIRECTIONS: dict[int, tuple[int, int, int]] = {
    17: (1, -1, -1),
    18: (1, 1, -1),
    19: (1, -1, -1),
    20: (1, -1, -1),
    21: (1, 1, -1),
    22: (1, 1, -1),
    23: (1, -1, 1),
    24: (1, -1, 1),
    25: (1, 1, 1),
    26: (1, 1, 1),
    27: (-1, 1, -1),
    28: (-1, 1, -1),
    29: (-1, -1, -1),
    30: (-1, -1, -1),
}
"""Where a method moves first, starting left of the switch, on it (19 to 22: no further from its edge), right of it."""

STARTS = (-640, -600, -599, -300, -21, -20, 9, 10, 11, 30, 31, 300, 599, 600, 640)


def machine(method: int, position: int) -> Machine:
    """A slider with limit switches at both ends and the home switch that the method is for."""
    home = {
        19: lambda p: p >= EDGE,
        20: lambda p: p >= EDGE,
        21: lambda p: p <= EDGE,
        22: lambda p: p <= EDGE,
    }.get(method, lambda p: FIRST <= p <= LAST)
    switches = {NEGATIVE: lambda p: p <= LEFT, POSITIVE: lambda p: p >= RIGHT, HOME: home}
    return Machine(position, switches)


@pytest.mark.parametrize("method", FIGURES)
def test_home_is_the_same_step_wherever_the_axis_starts(fast_kernel: Kernel, method: int) -> None:
    edge, _ = FIGURES[method]
    for start in STARTS:
        bench = HomingBench(fast_kernel, machine(method, start))
        bench.home(method)
        assert bench.zero_steps == edge, start
