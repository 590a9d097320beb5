"""Data types as bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.protocol.entry import DataType, decode, encode


@pytest.mark.slow
@given(st.data())
def test_datatypes_round_trip_over_their_ranges(data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from([t for t in DataType if t.size]))
    value = data.draw(st.sampled_from([kind.low, kind.high]) | st.integers(kind.low, kind.high))
    assert decode(kind, encode(kind, value)) == value


@pytest.mark.parametrize("kind", [kind for kind in DataType if kind.size])
def test_the_ends_of_a_range_round_trip(kind: DataType) -> None:
    for value in (kind.low, kind.low + 1, kind.high):
        assert decode(kind, encode(kind, value)) == value
