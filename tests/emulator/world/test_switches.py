"""Switches as data: where they are closed, and how far it is to the next change."""

from itertools import count

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.emulator.world.switches import AxisSwitches, Switch
from steptwin.protocol.cia402 import DigitalInput
from tests.messages import refusing

NEGATIVE, POSITIVE, HOME = DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME

ends = st.integers(-50, 50)
SWITCHES = st.one_of(
    st.builds(
        lambda end, spare: Switch(0, NEGATIVE, to_substeps=end, hysteresis_substeps=spare), ends, st.integers(0, 5)
    ),
    st.builds(
        lambda end, spare: Switch(0, POSITIVE, from_substeps=end, hysteresis_substeps=spare),
        ends,
        st.integers(0, 5),
    ),
    st.builds(
        lambda end, width, spare: Switch(0, HOME, end, end + width, spare), ends, st.integers(0, 20), st.integers(0, 5)
    ),
)


@pytest.mark.parametrize(
    ("switch", "closed", "open_"),
    [
        (Switch(0, NEGATIVE, to_substeps=-7), (-1000, -8, -7), (-6, 0, 1000)),
        (Switch(0, POSITIVE, from_substeps=7), (7, 8, 1000), (-1000, 0, 6)),
        (Switch(0, HOME, -2, 3), (-2, 0, 3), (-3, 4)),
        (Switch(0, HOME, 5, 5), (5,), (4, 6)),
    ],
)
def test_it_is_closed_from_end_to_end(switch: Switch, closed: tuple[int, ...], open_: tuple[int, ...]) -> None:
    assert all(switch.closed_at(position, before=False) for position in closed)
    assert not any(switch.closed_at(position, before=False) for position in open_)


def test_hysteresis_keeps_it_closed_a_little_farther_out() -> None:
    switch = Switch(0, HOME, 0, 10, hysteresis_substeps=3)
    places = [-1, 0, -1, -3, -4, -3, -1, 0, 10, 13, 14, 11, 10]
    seen, closed = [], False
    for place in places:
        closed = switch.closed_at(place, before=closed)
        seen.append(closed)
    assert seen == [False, True, True, True, False, False, False, True, True, True, False, False, True]


@given(SWITCHES, st.integers(-100, 100), st.booleans())
def test_the_distance_is_the_way_to_the_next_change(switch: Switch, position: int, closed: bool) -> None:
    """Try every position around: none that is nearer changes the switch, one at the distance does."""
    closed = switch.closed_at(position, before=closed)
    distance = switch.substeps_to_change(position, closed=closed)
    assert distance >= 1

    def changed(steps: int) -> bool:
        return switch.closed_at(position + steps, before=closed) != closed

    assert not any(changed(steps) for steps in range(1 - distance, distance))
    assert changed(distance) or changed(-distance)


def test_an_axis_has_all_of_its_own() -> None:
    axis = AxisSwitches([Switch(0, NEGATIVE, to_substeps=-5), Switch(0, HOME, -6, 20), Switch(0, POSITIVE, 30)], -5)
    assert axis.levels == NEGATIVE | HOME
    assert axis.substeps_to_change == 1
    axis.move(12)
    assert (axis.position_substeps, axis.levels, axis.substeps_to_change) == (7, HOME, 12)
    axis.move(23)
    assert (axis.levels, axis.substeps_to_change) == (POSITIVE, 1)


@settings(max_examples=50)
@given(st.lists(SWITCHES, min_size=1, max_size=3), st.integers(-60, 60), st.lists(st.integers(-40, 40), max_size=6))
def test_the_distance_goes_with_the_axis(switches: list[Switch], position: int, moves: list[int]) -> None:
    """After each move it is the way to the nearest position, on either side, at which a switch changes."""
    axis = AxisSwitches(switches, position)
    closed = [switch.closed_at(position, before=False) for switch in switches]

    def at(place: int) -> list[bool]:
        return [switch.closed_at(place, before=before) for switch, before in zip(switches, closed, strict=True)]

    for move in (0, *moves):
        position += move
        after = at(position)
        assert axis.move(move) == (after != closed)
        closed = after
        nearest = next(way for way in count(1) if not closed == at(position - way) == at(position + way))
        assert axis.substeps_to_change == nearest


def test_an_axis_without_switches_has_no_way_to_one() -> None:
    axis = AxisSwitches([], 5)
    assert not axis
    assert (axis.move(3), axis.position_substeps, axis.substeps_to_change) == (False, 8, 0)


@pytest.mark.parametrize(
    "arguments",
    [
        (0, DigitalInput.ESTOP, 1),
        (0, HOME),
        (0, HOME, 4, 3),
        (0, HOME, 4, 4, -1),
    ],
)
def test_impossible_switches_are_refused(arguments: tuple[int, ...]) -> None:
    with refusing(ValueError):
        Switch(*arguments)  # type: ignore[arg-type]


def test_a_switch_that_sticks_keeps_its_level_until_it_is_free_again() -> None:
    """Closed, then open, then free, while the axis stands where the home switch is closed."""
    axis = AxisSwitches([Switch(0, HOME, 0, 10)], 5)
    for closed, levels in ((True, HOME), (False, DigitalInput(0)), (None, HOME)):
        axis.stick(HOME, closed=closed)
        assert axis.levels == levels
    axis.move(-20)
    for closed, levels in ((True, HOME), (False, DigitalInput(0)), (None, DigitalInput(0))):
        axis.stick(HOME, closed=closed)
        assert axis.levels == levels


def test_a_wire_that_is_cut_looks_as_it_does_until_it_is_mended() -> None:
    axis = AxisSwitches([Switch(0, HOME, 0, 10)], 5)
    for closed, levels in ((False, DigitalInput(0)), (True, HOME), (False, DigitalInput(0)), (None, HOME)):
        axis.cut(HOME, closed=closed)
        assert axis.levels == levels
