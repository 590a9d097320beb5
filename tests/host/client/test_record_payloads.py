"""All records encoded at once are the bytes that each record makes of itself."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.client.queue_feed import payloads
from steptwin.host.common.arrays import AxisRecords
from steptwin.protocol.pvt import I24_MAX, I24_MIN, PvtRecord
from tests.messages import refusing

I24 = st.integers(I24_MIN, I24_MAX)


@pytest.mark.slow
@given(st.lists(st.tuples(I24, I24, st.integers(0, 255)), max_size=5), st.integers(0, 10_000))
def test_they_are_those_of_each_record(fields: list[tuple[int, int, int]], first: int) -> None:
    records = (
        AxisRecords(*(list(column) for column in zip(*fields, strict=True))) if fields else AxisRecords([], [], [])
    )
    expected = [PvtRecord(*own, (first + i) % 256).encode() for i, own in enumerate(fields)]
    assert payloads(records, first) == expected


@pytest.mark.parametrize(
    "beyond", [(I24_MIN - 1, 0, 10), (I24_MAX + 1, 0, 10), (0, I24_MIN - 1, 10), (0, I24_MAX + 1, 10), (0, 0, 256)]
)
def test_a_value_beyond_its_field_is_refused(beyond: tuple[int, int, int]) -> None:
    records = AxisRecords(*([0, value] for value in beyond))
    with refusing(OverflowError):
        payloads(records, 0)
