"""SYNC with and without a counter (CiA 301, sections 7.2.5 and 7.5.2.19)."""

import pytest

from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.pdo import ProcessData
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError


@pytest.mark.parametrize(
    ("overflow", "data", "counter"),
    [(0, b"", 0), (0, b"\1", None), (2, b"", None), (2, b"\2", 2), (240, b"\xf0", 240), (240, b"\1\1", None)],
)
def test_sync_carries_a_counter_if_an_overflow_value_is_set(overflow: int, data: bytes, counter: int | None) -> None:
    dictionary = ObjectDictionary(0x10)
    sync = ProcessData(dictionary)
    dictionary.write(od.SYNC_COUNTER_OVERFLOW, bytes((overflow,)))
    assert sync.sync_counter(data) == counter


@pytest.mark.parametrize(
    ("overflow", "period_us", "code"),
    [
        (1, 0, AbortCode.VALUE_RANGE),
        (241, 0, AbortCode.VALUE_TOO_HIGH),
        (0, 1000, AbortCode.DEVICE_STATE),
        (2, 1000, AbortCode.DEVICE_STATE),
    ],
)
def test_overflow_values_that_are_refused(overflow: int, period_us: int, code: AbortCode) -> None:
    dictionary = ObjectDictionary(0x10)
    ProcessData(dictionary)
    dictionary.write(od.COMMUNICATION_CYCLE_PERIOD, period_us.to_bytes(4, "little"))
    with pytest.raises(SdoAbortError) as caught:
        dictionary.write(od.SYNC_COUNTER_OVERFLOW, bytes((overflow,)))
    assert caught.value.code is code
