"""Messages about bad input."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.bad_input import (
    apart,
    at_least,
    at_most,
    by,
    nearest,
    nearest_within,
    outside,
    unknown,
    whole_ms,
)
from steptwin.host.common.choices import name_value_pairs
from steptwin.host.common.errors import InputError
from tests.host.complaints import complaint_of
from tests.messages import refusing

NUMBERS = st.floats(-1e9, 1e9)


@pytest.mark.parametrize(
    ("value", "limit", "texts"),
    [
        (200.5, 200.0, ("200.5", "200.0")),
        (200.0001, 200.0, ("200.0001", "200.0000")),
        (-0.01, 0.0, ("-0.01", "0.00")),
        (0.0, 0.0, ("0", "0")),
        (30.000000000000004, 30.0, ("30", "30")),
    ],
)
def test_two_numbers_get_enough_decimals_to_differ(value: float, limit: float, texts: tuple[str, str]) -> None:
    assert apart(value, limit) == texts


def test_many_choices_are_counted() -> None:
    names = [f"{number:02d}" for number in range(14)]
    assert str(unknown("what", "x", names[:12])) == f"what 'x' is unknown: there are {', '.join(names[:12])}"
    assert str(unknown("what", "x", names)) == f"what 'x' is unknown: there are {', '.join(names[:12])} and 2 more"


def test_the_nearest_name_is_found_whatever_its_case() -> None:
    assert str(unknown("what", "SLOW-BORD", ["slow-board", "Fast"])).endswith("did you mean slow-board?")
    assert str(unknown("what", "fasst", ["slow-board", "Fast"])).endswith("did you mean Fast?")


def test_the_beginning_of_a_name_is_near_to_it() -> None:
    assert str(unknown("what", "L1", ["kind", "l1_mm", "l2_mm"])).endswith("did you mean l1_mm?")
    assert str(unknown("what", "in", ["joint", "input"])).endswith("did you mean input?")
    assert str(unknown("what", "i", ["joint", "input"])).endswith("there are joint, input")


def test_a_name_given_twice() -> None:
    assert name_value_pairs(["a=1", " b = 2 "]) == {"a": "1", "b": "2"}
    with refusing(InputError):
        name_value_pairs(["a=1", "b=2", "a=2"])


@given(NUMBERS)
def test_a_limit_in_a_message_keeps_the_limit(limit: float) -> None:
    """Six digits leave at most a hundred-thousandth of it away."""
    assert limit - 1e-5 * abs(limit) <= float(at_most(limit)) <= limit <= float(at_least(limit))
    assert float(at_least(limit)) <= limit + 1e-5 * abs(limit)


@pytest.mark.parametrize(
    ("limit", "below", "above"),
    [
        (93.75, "93.75", "93.75"),
        (0.1, "0.1", "0.1"),
        (3276.7, "3276.7", "3276.7"),
        (200 / 3, "66.6666", "66.6667"),
        (-200 / 3, "-66.6667", "-66.6666"),
        (0, "0", "0"),
    ],
)
def test_a_limit_is_rounded_only_if_it_must(limit: float, below: str, above: str) -> None:
    assert (at_most(limit), at_least(limit)) == (below, above)


@given(NUMBERS, NUMBERS, NUMBERS)
def test_the_nearest_value_is_inside(value: float, one: float, other: float) -> None:
    lower, upper = min(one, other), max(one, other)
    if not lower <= value <= upper:
        near = float(nearest_within(value, lower, upper, "mm").removeprefix("; the nearest is ").removesuffix(" mm"))
        assert lower <= near <= upper
        limit = lower if value < lower else upper
        assert abs(near - limit) <= 1e-5 * abs(limit)


def test_limits_that_differ_in_the_last_digits_have_a_value_between_them() -> None:
    assert nearest_within(1.0, 0.12345671, 0.12345678, "deg") == "; the nearest is 0.12345678 deg"
    assert nearest_within(0.0, 0.12345671, 0.12345678, "deg") == "; the nearest is 0.12345671 deg"


def test_nothing_is_near_to_what_is_no_number() -> None:
    assert outside(float("nan"), 0, 1, "s") + nearest_within(float("nan"), 0, 1, "s") == "nan s is outside 0..1 s"


@given(st.floats(1e-9, 1e9))
def test_a_step_back_by_the_distance_is_enough(distance: float) -> None:
    back = float(by(distance, "mm").removesuffix(" mm"))
    assert (1 - 1e-9) * distance <= back <= 1.01 * distance
    assert by(0.1 + 2e-17, "mm") == "0.1 mm"
    assert by(1191.0, "mm") == "1200 mm"
    assert by(2e9, "mm") == "2e+09 mm"


@given(st.floats(-1e6, 1e6))
def test_the_nearest_time_in_whole_milliseconds_passes(value_s: float) -> None:
    try:
        whole_ms("t", value_s)
    except InputError as error:
        near_s = float(str(error).rsplit("the nearest is ", 1)[1].removesuffix(" s"))
        assert whole_ms("t", near_s) >= 1
        assert abs(near_s - value_s) <= 0.0005 + 1e-9 * abs(value_s) or value_s < 0.001


@pytest.mark.parametrize("value_s", [float("nan"), float("inf")])
def test_no_time_is_near_to_what_is_not_finite(value_s: float) -> None:
    told = complaint_of(lambda: whole_ms("t", value_s))
    assert told == f"t: {value_s} s is not a whole number of milliseconds"


def test_an_unknown_name_is_compared_with_the_first_300() -> None:
    """Each of 5000 wrong steps with each of 20 000 positions would take minutes."""
    names = [f"tray {number}" for number in range(20_000)]
    assert nearest("tray 299x", names)[0] == "tray 299"
    assert "tray 300" not in nearest("tray 300", names)
