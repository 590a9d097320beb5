"""Data types as bytes."""

from hypothesis import given
from hypothesis import strategies as st

from steptwin.protocol.entry import DataType, decode, encode


@given(st.data())
def test_datatypes_round_trip_over_their_ranges(data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from([t for t in DataType if t.size]))
    value = data.draw(st.sampled_from([kind.low, kind.high]) | st.integers(kind.low, kind.high))
    assert decode(kind, encode(kind, value)) == value
