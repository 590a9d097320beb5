"""Words for bad input."""

import pytest

from host.inputs import apart


@pytest.mark.parametrize(
    ("value", "limit", "texts"),
    [
        (200.5, 200.0, ("200.5", "200.0")),
        (200.0001, 200.0, ("200.0001", "200.0000")),
        (-0.01, 0.0, ("-0.01", "0.00")),
        (0.0, 0.0, ("0.000000000000", "0.000000000000")),
    ],
)
def test_two_numbers_are_told_apart(value: float, limit: float, texts: tuple[str, str]) -> None:
    assert apart(value, limit) == texts
