"""An axis on both sides, by reports made by hand: how far apart the clocks of board and computer may bring them."""

from itertools import chain

import pytest

from steptwin.host.twin.shadow.axes import ComparedAxis, TwinAxis
from steptwin.host.twin.shadow.discrepancy import DiscrepancyKind
from steptwin.protocol.timer import COUNTS_PER_SECOND

STEP_UNITS = 1024
STEPS_PER_S = 1000


@pytest.mark.parametrize(("moving_s", "steps", "told"), [(0, 3, 0), (0, 4, 1), (100, 13, 0), (100, 14, 1)])
@pytest.mark.parametrize("side", [1, -1], ids=["ahead", "behind"])
def test_the_clocks_part_by_100_ppm(moving_s: int, steps: int, told: int, side: int) -> None:
    """One step is rounding; 2.25 ms are 2.25 steps of jitter, and after 100 s of motion 10 ms are 10 more of drift."""
    axis = ComparedAxis(STEP_UNITS)
    rests, moves = (TwinAxis(0, speed, 0, 0) for speed in (0, STEPS_PER_S * STEP_UNITS))
    for at_s in (1, 2, 3):  # at rest at the same place
        assert list(axis.positions(at_s * COUNTS_PER_SECOND, 0, rests)) == []
    axis.follow(4 * COUNTS_PER_SECOND, moves)
    now_counts = (4 + moving_s) * COUNTS_PER_SECOND
    found = chain.from_iterable(axis.positions(now_counts, side * steps * STEP_UNITS, moves) for _ in range(3))
    assert [each.kind for each in found] == [DiscrepancyKind.MOVING] * told
