"""The rotor that follows the chip's field: each step by the mode in which it was made."""

from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.node.pins import Pin
from steptwin.emulator.drivers.chip import DriverChip
from steptwin.emulator.drivers.terminals import LevelChange
from tests.emulator.pins import MODES, POWER_UP, a_tb6560, at, cut, pins
from tests.one_example import one_example

LEVELS = {mode: {"M2": m2, "M1": m1} for (m2, m1), mode in MODES.items()}
STEP_COUNTS = 10_000
UP = [(1, 1)]


def powered(microsteps: int) -> DriverChip:
    """A chip that has been set to a mode in reset, at the instant 0."""
    chip = a_tb6560(330)
    chip.feed(pins(changes=(*POWER_UP[:2], *at(0, **LEVELS[microsteps]), *POWER_UP[2:]), until=1))
    return chip


def rises(count: int, first_counts: int = STEP_COUNTS) -> list[int]:
    return [first_counts + i * STEP_COUNTS for i in range(count)]


@pytest.mark.parametrize("microsteps", [1, 2, 8, 16])
def test_a_full_step_is_as_long_in_every_mode(microsteps: int) -> None:
    chip = powered(microsteps)
    counts, sixteenths = chip.feed(pins(rises(3 * microsteps), directions=UP))
    assert counts.tolist() == rises(3 * microsteps)
    assert sixteenths.tolist() == [16 // microsteps] * (3 * microsteps)
    assert (chip.position_substeps, chip.position_steps, chip.microsteps) == (48, 3 * microsteps, microsteps)
    chip.feed(pins(rises(microsteps, 10**6), directions=[(900_000, 0)]))
    assert chip.position_substeps == 32


def test_a_change_of_mode_in_reset_moves_nothing() -> None:
    """The steps before it count by the old mode, those after it by the new one; pulses in reset do not count."""
    chip = powered(16)
    changes = (*at(35_000, RESET=0), *at(45_000, **LEVELS[2]), *at(55_000, RESET=1))
    counts, sixteenths = chip.feed(pins(rises(7), directions=UP, changes=changes))
    assert counts.tolist() == [10_000, 20_000, 30_000, 60_000, 70_000]
    assert sixteenths.tolist() == [1, 1, 1, 8, 8]
    assert chip.position_substeps == 19


def test_a_change_of_mode_amid_motion_keeps_the_electrical_phase() -> None:
    """Up is against the field: after 5 sixteenths it stands at 59, whose next lower angle of half steps is 56."""
    chip = powered(16)
    counts, sixteenths = chip.feed(pins(rises(7), directions=UP, changes=at(55_000, **LEVELS[2])))
    assert counts.tolist() == [*rises(5), 55_000, *rises(2, 60_000)]
    assert sixteenths.tolist() == [1, 1, 1, 1, 1, 3, 8, 8]
    assert chip.outputs.field_substeps(np.array([54_999, 55_000])).tolist() == [59, 56]


@pytest.mark.slow
@given(
    start=st.sampled_from(list(LEVELS)),
    directions=st.lists(st.booleans(), max_size=40),
    modes=st.lists(st.tuples(st.integers(1, 41), st.sampled_from(list(LEVELS))), max_size=4),
    cuts=st.lists(st.integers(2, 42 * STEP_COUNTS), max_size=3),
)
def test_it_follows_the_field(
    start: int, directions: list[bool], modes: list[tuple[int, int]], cuts: list[int]
) -> None:
    """While there is no reset, the rotor turns as the field does, in one piece or in several."""
    turns = [(rise - 5_000, int(up)) for rise, up in zip(rises(len(directions)), directions, strict=True)]
    changes = tuple(
        LevelChange(place * STEP_COUNTS + 3_000, Pin[pin], level)
        for place, mode in sorted(modes)
        for pin, level in LEVELS[mode].items()
    )
    whole = pins(rises(len(directions)), directions=turns, changes=changes, until=50 * STEP_COUNTS)
    once, pieced = powered(start), powered(start)
    counts, sixteenths = once.feed(whole)
    for piece in cut(whole, cuts):
        pieced.feed(piece)
    instants, places = [1, *counts.tolist()], list(accumulate(sixteenths.tolist(), initial=0))
    angles = once.outputs.field_substeps(np.array(instants)).tolist()
    last_at = dict(zip(instants, places, strict=True))  # a change of mode may come at the instant of a step
    assert {(angle + last_at[instant]) % 64 for instant, angle in zip(instants, angles, strict=True)} == {angles[0]}
    assert once.position_substeps == pieced.position_substeps == places[-1]
    assert once.microsteps == pieced.microsteps == (sorted(modes)[-1][1] if modes else start)


def test_without_supply_the_mode_is_that_of_low_pins() -> None:
    assert a_tb6560(330).microsteps == 1


@pytest.mark.parametrize("start", LEVELS)
def test_it_follows_the_field_through_some_modes(start: int) -> None:
    one_example(test_it_follows_the_field, start, [True] * 7 + [False] * 5, [(3, 2), (6, 16), (9, 1)], [25_000, 60_001])
