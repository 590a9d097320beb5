"""The user unit: both conversions against fractions, and what a master writes is what it reads."""

from fractions import Fraction
from math import floor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.protocol import od
from steptwin.protocol.dictionary import UserUnit

REVOLUTION = 3_276_800
"""Wire units in a revolution of the motor."""
MILLIDEG, MICROMETRES = (1, 1, 360_000, 1), (1, 1, 8_000, 1)
"""Motor and shaft revolutions of the gear, feed and its shaft revolutions: of a motor's shaft, of an 8 mm screw."""
GEARED_MILLIDEG = (50, 1, 360_000, 1)


def unit_of(motor: int, shaft: int, feed: int, feed_shaft: int) -> UserUnit:
    return UserUnit.of(
        {
            od.GEAR_MOTOR_REVOLUTIONS: motor,
            od.GEAR_SHAFT_REVOLUTIONS: shaft,
            od.FEED_UNITS: feed,
            od.FEED_SHAFT_REVOLUTIONS: feed_shaft,
        }
    )


def nearest(value: Fraction) -> int:
    """Round half up."""
    return floor(value + Fraction(1, 2))


@pytest.mark.parametrize(
    ("factors", "user", "wire"),
    [
        (MILLIDEG, 90_000, 819_200),
        (MILLIDEG, 1, 9),
        (MILLIDEG, -1, -9),
        (MICROMETRES, 1_000, 409_600),
        (MICROMETRES, 1, 410),
        (MICROMETRES, -8_000, -REVOLUTION),
        (GEARED_MILLIDEG, 360_000, 50 * REVOLUTION),
        (GEARED_MILLIDEG, 1, 455),
        ((1, 1, REVOLUTION, 1), 12_345, 12_345),
        ((1, 1, 1_310_720, 1), 1, 3),  # 2.5: half up
        ((1, 1, 1_310_720, 1), -1, -2),
        ((3, 2, 360, 7), 240, 7 * REVOLUTION),
    ],
)
def test_golden_numbers(factors: tuple[int, int, int, int], user: int, wire: int) -> None:
    unit = unit_of(*factors)
    assert unit.to_wire(user) == wire
    assert unit.to_user(wire) == user


def test_the_default_is_the_wire_unit() -> None:
    assert unit_of(1, 1, REVOLUTION, 1) == unit_of(2, 4, 2 * REVOLUTION, 4) == UserUnit(1, 1)


factors = st.tuples(*[st.integers(1, 2**32 - 1)] * 4)
sizes = st.tuples(st.integers(1, 2**80), st.integers(1, 2**80)).map(sorted)
numbers = st.integers(-(2**33), 2**33)


@given(factors, numbers, numbers)
def test_both_ways_are_those_of_fractions(factors: tuple[int, int, int, int], user: int, wire: int) -> None:
    motor, shaft, feed, feed_shaft = factors
    size = Fraction(REVOLUTION) * Fraction(motor, shaft) / Fraction(feed, feed_shaft)
    unit = unit_of(*factors)
    assert unit.to_wire(user) == nearest(user * size)
    assert unit.to_user(wire) == nearest(wire / size)


@given(sizes, numbers)
def test_a_number_comes_back_where_no_unit_is_smaller_than_the_boards(size: list[int], user: int) -> None:
    unit = UserUnit(wire=size[1], user=size[0])
    assert unit.to_user(unit.to_wire(user)) == user


@given(sizes, numbers)
def test_what_the_board_counts_is_shown_to_half_a_unit_and_with_no_more_digits(size: list[int], wire: int) -> None:
    unit = UserUnit(wire=size[1], user=size[0])
    shown = unit.to_user(wire)
    assert abs(shown - Fraction(wire * unit.user, unit.wire)) <= Fraction(1, 2)
    assert abs(shown) <= abs(wire)


def test_smaller_units_would_lose_numbers() -> None:
    """Why they are refused: several numbers of a master would be the same place."""
    unit = unit_of(1, 1, 2 * REVOLUTION, 1)
    assert [unit.to_wire(user) for user in (0, 1, 2, 3)] == [0, 1, 1, 2]
