"""An axis on both sides, by reports made by hand: how far apart the sides may be on the way and after a homing."""

from itertools import chain

import pytest

from steptwin.features.shadow.axes import ComparedAxis, DriveReport, TwinAxis
from steptwin.features.shadow.discrepancy import DiscrepancyKind
from steptwin.protocol.cia402 import Mode, Status
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


FULL_STEP_UNITS = 16384
LEAVING_UNITS_PER_S = 100_000
MS = COUNTS_PER_SECOND // 1000
KNOWN = Status.POSITION_KNOWN | Status.TARGET_REACHED


@pytest.mark.parametrize(
    ("ahead_units", "known", "seen", "told_steps"),
    [
        (2 * FULL_STEP_UNITS, True, True, []),
        (2 * FULL_STEP_UNITS + 103, True, True, [32.1]),
        (-4 * FULL_STEP_UNITS, True, True, [-64.0]),
        (4 * FULL_STEP_UNITS, False, True, []),
        (99_000, True, False, []),
        (101_000, True, False, [98.6]),
    ],
    ids=["two full steps", "more", "less", "position unknown before", "unseen at the switch", "unseen, and too much"],
)
def test_a_homing_tells_the_steps_that_were_lost(
    ahead_units: int, known: bool, seen: bool, told_steps: list[float]
) -> None:
    """Where a board was not seen leaving its switch, 100 ms of the search's highest speed are no difference."""
    axis = ComparedAxis(STEP_UNITS)
    sides = (axis.board, axis.twin)
    for side in sides:
        side.take(0, DriveReport(0x0237 | (KNOWN if known else 0), Mode.PROFILE_POSITION, 0))
        side.take(1 * MS, DriveReport(0x0237, Mode.HOMING, 0))
    searches = TwinAxis(0, -10 * LEAVING_UNITS_PER_S, LEAVING_UNITS_PER_S, 0)
    assert list(axis.positions(2 * MS, ahead_units if seen else 9 * ahead_units, searches)) == []
    leaves = TwinAxis(LEAVING_UNITS_PER_S // 10, LEAVING_UNITS_PER_S, LEAVING_UNITS_PER_S, 0)
    assert list(axis.positions(102 * MS, leaves.position_units + ahead_units, leaves)) == []
    for side in sides:
        side.take(150 * MS, DriveReport(0x0237 | KNOWN | Status.HOMING_ATTAINED, Mode.HOMING, 0))
    assert [each.error_steps for each in axis.homings()] == told_steps
    assert list(axis.homings()) == [], "it is told once"
