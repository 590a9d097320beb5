"""The positioning option code (60F2h) and the position range limit (607Bh) in profile position."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.modes.profile_position import TurnDirection, travel_units
from steptwin.controller.motion.backend import Kernel
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode, Status
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.modes.profile_bench import AT_ONCE, RELATIVE, ProfileBench
from tests.controller.units import STEP
from tests.one_example import one_example

TURN = 3200 * STEP


@pytest.fixture
def pp(fast_kernel: Kernel) -> ProfileBench:
    return ProfileBench(fast_kernel, Mode.PROFILE_POSITION)


@pytest.fixture
def turning(pp: ProfileBench) -> ProfileBench:
    """An axis whose turn has 3200 steps, from 0 on."""
    assert pp.write(od.POSITION_RANGE_MIN, 0) == 0
    assert pp.write(od.POSITION_RANGE_MAX, TURN - 1) == 0
    return pp


def reached(board: ProfileBench, target_steps: int, bits: int = 0) -> float:
    board.set_point(target_steps * STEP, bits)
    board.until(Status.TARGET_REACHED)
    return board.value(od.POSITION_DEMAND) / STEP


@pytest.mark.parametrize("option", [*range(3), *range(0x40, 0x43), *range(0x80, 0x83), *range(0xC0, 0xC3)])
def test_options_offered(pp: ProfileBench, option: int) -> None:
    assert pp.write(od.POSITIONING_OPTION, option) == 0


@pytest.mark.parametrize("option", [3, 4, 0x08, 0x10, 0x20, 0x43, 0x100, 0x8000])
def test_others_are_refused(pp: ProfileBench, option: int) -> None:
    assert pp.write(od.POSITIONING_OPTION, option) == 0x0609_0030


def test_a_relative_target_in_motion_counts_from_what_the_option_names(pp: ProfileBench) -> None:
    for option, source in ((0, None), (1, od.POSITION_DEMAND), (2, od.POSITION_ACTUAL)):
        assert reached(pp, 0) == 0
        pp.write(od.POSITIONING_OPTION, option)
        pp.set_point(2000 * STEP)
        pp.wait(200)
        base = 2000 * STEP if source is None else pp.value(source)
        assert 100 * STEP < base <= 2000 * STEP
        pp.set_point(1000 * STEP, RELATIVE | AT_ONCE)
        pp.until(Status.TARGET_REACHED)
        assert pp.value(od.POSITION_DEMAND) == base + 1000 * STEP


@pytest.mark.parametrize(
    ("option", "positions"),
    [
        (0x00, [3000, 100, 1700]),
        (0x40, [-200, -3100, -4700]),
        (0x80, [3000, 3300, 4900]),
        (0xC0, [-200, 100, 1700]),  # 1700 is half a turn ahead: positive
    ],
)
def test_targets_3000_100_1700_by_each_direction(turning: ProfileBench, option: int, positions: list[int]) -> None:
    turning.write(od.POSITIONING_OPTION, option)
    assert [reached(turning, target) for target in (3000, 100, 1700)] == positions


@pytest.mark.parametrize("option", [0x40, 0x80, 0xC0])
def test_a_target_where_the_axis_stands_moves_nothing(turning: ProfileBench, option: int) -> None:
    turning.write(od.POSITIONING_OPTION, option)
    assert [reached(turning, target) for target in (0, 3200, -3200)] == [0, 0, 0]


def test_a_set_point_that_waits_begins_where_the_one_before_it_ends(turning: ProfileBench) -> None:
    turning.write(od.POSITIONING_OPTION, 0x80)
    turning.set_point(2000 * STEP)
    turning.set_point(1000 * STEP)
    turning.until(Status.TARGET_REACHED)
    assert turning.value(od.POSITION_DEMAND) == 4200 * STEP


def test_the_direction_leaves_relative_targets_and_axes_without_turns(pp: ProfileBench) -> None:
    pp.write(od.POSITIONING_OPTION, 0x80)
    assert reached(pp, -500) == -500
    pp.write(od.POSITION_RANGE_MIN, 0)
    assert reached(pp, -100, RELATIVE) == -600


def test_a_turn_has_a_length(pp: ProfileBench) -> None:
    assert pp.write(od.POSITION_RANGE_MIN, 10) == 0
    for high in (9, 10):
        assert pp.write(od.POSITION_RANGE_MAX, high) == AbortCode.MAX_BELOW_MIN
    assert pp.write(od.POSITION_RANGE_MAX, 11) == 0


@pytest.mark.slow
@given(st.integers(-(10**9), 10**9), st.integers(-(10**9), 10**9), st.integers(2, 10**7))
def test_ways_end_at_the_target_and_keep_their_direction(start: int, target: int, turn: int) -> None:
    """The shortest way is the shorter of the other two."""
    negative, positive, shortest = (travel_units(start, target, turn, TurnDirection(number)) for number in (1, 2, 3))
    assert all((start + way - target) % turn == 0 for way in (negative, positive, shortest))
    assert -turn < negative <= 0 <= positive < turn
    assert shortest == min(positive, negative, key=abs)


@pytest.mark.parametrize(("start", "target", "turn"), [(0, 3, 10), (7, -20, 10), (-3, 2, 10), (5, 5, 2)])
def test_some_ways(start: int, target: int, turn: int) -> None:
    one_example(test_ways_end_at_the_target_and_keep_their_direction, start, target, turn)
