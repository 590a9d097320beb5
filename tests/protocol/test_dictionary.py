"""The object dictionary as the firmware uses it: counters, and the getters and setters of hot paths."""

import pytest

from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.dictionary import ObjectDictionary

GAPS, MODE = od.PVT_GAPS, od.MODE_OF_OPERATION
GAPS_MAX = 0xFFFF
FOLLOWING_WINDOW, POSITION = od.FOLLOWING_ERROR_WINDOW, od.POSITION_ACTUAL


def test_a_counter_stays_at_its_greatest_value() -> None:
    dictionary = ObjectDictionary(0x10)
    dictionary.set(od.PVT_GAPS, GAPS_MAX - 1)
    for counted in (GAPS_MAX, GAPS_MAX):
        dictionary.count(GAPS)
        assert dictionary.get(od.PVT_GAPS) == counted


def test_a_reader_follows_the_value_through_a_reset() -> None:
    dictionary = ObjectDictionary(0x10)
    read = dictionary.reader(FOLLOWING_WINDOW).get
    default = read()
    dictionary.set(od.FOLLOWING_ERROR_WINDOW, 5)
    assert read() == 5
    dictionary.reset()
    assert read() == default != 5


def test_a_reader_is_the_hook_where_the_value_lives_elsewhere() -> None:
    dictionary = ObjectDictionary(0x10)
    places = [7]
    dictionary.read_hooks[POSITION] = lambda: places[0]
    read = dictionary.reader(POSITION).get
    assert read() == 7
    places[0] = -8
    assert read() == dictionary.get(od.POSITION_ACTUAL) == -8


def test_a_writer_stores_where_there_is_nothing_to_check() -> None:
    dictionary = ObjectDictionary(0x10)
    write = dictionary.writer(FOLLOWING_WINDOW).put
    write(5)
    assert dictionary.get(od.FOLLOWING_ERROR_WINDOW) == 5
    dictionary.reset()
    write(6)
    assert dictionary.get(od.FOLLOWING_ERROR_WINDOW) == 6


@pytest.mark.parametrize(("value", "code"), [(241, AbortCode.VALUE_TOO_HIGH), (240, None), (0, None)])
def test_a_writer_keeps_the_range(value: int, code: AbortCode | None) -> None:
    """The synchronous counter overflow value (1019h) is at most 240."""
    dictionary = ObjectDictionary(0x10)
    dictionary.set(od.SYNC_COUNTER_OVERFLOW, 3)
    write = dictionary.writer(od.SYNC_COUNTER_OVERFLOW).put
    if code is None:
        write(value)
        assert dictionary.get(od.SYNC_COUNTER_OVERFLOW) == value
        return
    with pytest.raises(SdoAbortError) as caught:
        write(value)
    assert caught.value.code is code
    assert dictionary.get(od.SYNC_COUNTER_OVERFLOW) == 3


def test_a_writer_tells_the_hook_before_it_stores() -> None:
    dictionary = ObjectDictionary(0x10)
    heard: list[tuple[int, int]] = []
    dictionary.write_hooks[MODE] = lambda mode: heard.append((mode, dictionary.get(od.MODE_OF_OPERATION)))
    dictionary.writer(MODE).put(7)
    assert (heard, dictionary.get(od.MODE_OF_OPERATION)) == ([(7, 0)], 7)
