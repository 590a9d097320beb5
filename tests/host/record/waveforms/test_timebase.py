"""Compare time scales with exact fractions, on both sides of every rounding."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.record.waveforms import SCALES, TimeScale
from steptwin.host.record.waveforms.signal import COUNTS

UNIT_S = {"1us": Fraction(1, 10**6), "100ns": Fraction(1, 10**7), "10ns": Fraction(1, 10**8)}
ANY_COUNTS = st.integers(0, 72_000_000 * 3600 * 24)
"""Any instant of a day."""


@pytest.mark.parametrize("name", SCALES)
@given(counts=ANY_COUNTS)
def test_an_instant_is_at_most_half_a_unit_off(name: str, counts: int) -> None:
    off = SCALES[name].unit(counts) * UNIT_S[name] - Fraction(counts, 72_000_000)
    assert abs(off) <= UNIT_S[name] / 2


@pytest.mark.parametrize("name", SCALES)
def test_the_name_is_the_unit(name: str) -> None:
    assert SCALES[name].vcd.replace(" ", "") == name
    assert SCALES[name].unit(72_000_000) == 1 / UNIT_S[name]


@pytest.mark.parametrize(
    ("name", "counts", "unit"),
    [
        ("1us", 35, 0),
        ("1us", 36, 1),
        ("1us", 107, 1),
        ("1us", 108, 2),
        ("100ns", 3, 0),
        ("100ns", 4, 1),
        ("10ns", 1, 1),
    ],
)
def test_rounding_on_both_sides(name: str, counts: int, unit: int) -> None:
    assert SCALES[name].unit(counts) == unit


@pytest.mark.parametrize("scale", [*SCALES.values(), COUNTS], ids=[*SCALES, "counts"])
@given(unit=st.integers(0, 10**12))
def test_the_last_count_of_a_unit(scale: TimeScale, unit: int) -> None:
    last = scale.last_counts(unit)
    assert scale.unit(last) <= unit < scale.unit(last + 1)


@given(first=ANY_COUNTS)
def test_at_10_ns_every_count_has_an_instant_of_its_own(first: int) -> None:
    units = SCALES["10ns"].rounded(np.arange(first, first + 100))
    assert (np.diff(units) >= 1).all()
    np.testing.assert_array_equal(np.rint(units * 0.72), np.arange(first, first + 100))


def test_counts_stay_as_they_are() -> None:
    assert COUNTS.unit(123_456_789_012) == 123_456_789_012
