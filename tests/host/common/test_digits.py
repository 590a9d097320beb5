"""Whole numbers in digits."""

import pytest

from steptwin.host.common.numbers import DIGITS_MAX, digits_in


@pytest.mark.parametrize(("text", "number"), [("0", 0), ("007", 7), ("9" * DIGITS_MAX, 10**DIGITS_MAX - 1)])
def test_digits_spell_a_number(text: str, number: int) -> None:
    assert digits_in(text) == number


@pytest.mark.parametrize("text", ["", "-1", "+1", "1_0", "1.0", " 1", "３", "٣", "²", "9" * 5000])
def test_other_texts_spell_none(text: str) -> None:
    assert digits_in(text) is None
