"""Messages about bad input."""

import pytest

from steptwin.host.cli.arguments import name_value_pairs
from steptwin.host.common.bad_input import apart, unknown
from steptwin.host.common.errors import InputError


@pytest.mark.parametrize(
    ("value", "limit", "texts"),
    [
        (200.5, 200.0, ("200.5", "200.0")),
        (200.0001, 200.0, ("200.0001", "200.0000")),
        (-0.01, 0.0, ("-0.01", "0.00")),
        (0.0, 0.0, ("0.000000000000", "0.000000000000")),
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


def test_a_name_given_twice() -> None:
    assert name_value_pairs(["a=1", " b = 2 "]) == {"a": "1", "b": "2"}
    with pytest.raises(InputError, match=r"^a is given twice: 1 and 2$"):
        name_value_pairs(["a=1", "b=2", "a=2"])
