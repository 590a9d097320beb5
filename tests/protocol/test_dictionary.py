"""The object dictionary as the firmware uses it: counters, and the getters and setters of hot paths."""

import pytest

from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

GAPS, MODE = od.PVT_GAPS, od.MODE_OF_OPERATION
GAPS_MAX = 0xFFFF
FOLLOWING_WINDOW, POSITION = od.FOLLOWING_ERROR_WINDOW, od.POSITION_ACTUAL


def test_a_counter_stays_at_its_greatest_value() -> None:
    dictionary = ObjectDictionary(0x10)
    dictionary.set(od.PVT_GAPS, GAPS_MAX - 1)
    for counted in (GAPS_MAX, GAPS_MAX):
        dictionary.cell(GAPS).count()
        assert dictionary.get(od.PVT_GAPS) == counted


def test_a_reader_follows_the_value_through_a_reset() -> None:
    dictionary = ObjectDictionary(0x10)
    read = dictionary.cell(FOLLOWING_WINDOW).get
    default = read()
    dictionary.set(od.FOLLOWING_ERROR_WINDOW, 5)
    assert read() == 5
    dictionary.reset()
    assert read() == default != 5


def test_a_reader_asks_the_firmware_where_the_value_lives_elsewhere() -> None:
    dictionary = ObjectDictionary(0x10)
    places = [7]
    dictionary.cell(POSITION).supply = lambda: places[0]
    read = dictionary.cell(POSITION).get
    assert read() == 7
    places[0] = -8
    assert read() == dictionary.get(od.POSITION_ACTUAL) == -8


def test_a_writer_stores_where_there_is_nothing_to_check() -> None:
    dictionary = ObjectDictionary(0x10)
    write = dictionary.cell(FOLLOWING_WINDOW).put
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
    write = dictionary.cell(od.SYNC_COUNTER_OVERFLOW).put
    if code is None:
        write(value)
        assert dictionary.get(od.SYNC_COUNTER_OVERFLOW) == value
        return
    with pytest.raises(SdoAbortError) as caught:
        write(value)
    assert caught.value.code is code
    assert dictionary.get(od.SYNC_COUNTER_OVERFLOW) == 3


def test_the_firmware_obeys_before_the_value_is_stored() -> None:
    dictionary = ObjectDictionary(0x10)
    heard: list[tuple[int, int]] = []
    dictionary.cell(MODE).obey = lambda mode: heard.append((mode, dictionary.get(od.MODE_OF_OPERATION)))
    dictionary.cell(MODE).put(7)
    assert (heard, dictionary.get(od.MODE_OF_OPERATION)) == ([(7, 0)], 7)


@pytest.mark.parametrize(("value", "shown"), [(1 << 31, (1 << 31) - 1), (-(1 << 40), -(1 << 31)), (-5, -5)])
def test_a_value_beyond_the_type_is_shown_as_the_end_of_its_range(value: int, shown: int) -> None:
    dictionary = ObjectDictionary(0x10)
    dictionary.cell(POSITION).supply = lambda: value
    assert dictionary.get(POSITION) == shown
    assert dictionary.read(POSITION) == shown.to_bytes(4, "little", signed=True)


@pytest.mark.parametrize("mode", [2, 10, -1])
def test_a_choice_takes_none_but_its_values(mode: int) -> None:
    dictionary = ObjectDictionary(0x10)
    with pytest.raises(SdoAbortError) as caught:
        dictionary.cell(MODE).put(mode)
    assert caught.value.code is AbortCode.VALUE_RANGE
    assert dictionary.get(MODE) == 0


class Charge:
    """A part that has the name of the firmware's."""

    token = 3

    def claim(self, token: int) -> None:
        self.token = token

    def release(self, _token: int) -> None:
        raise SdoAbortError(AbortCode.DEVICE_STATE)


def test_a_part_is_bound_by_the_name_of_its_class() -> None:
    dictionary = ObjectDictionary(0x10)
    dictionary.bind(Charge())
    assert dictionary.get(od.CHARGE_TOKEN) == 3
    dictionary.cell(od.CHARGE_TOKEN).put(8)
    assert dictionary.get(od.CHARGE_TOKEN) == 8
    with pytest.raises(SdoAbortError):
        dictionary.cell(od.CHARGE_RELEASE).put(8)


def test_a_quantity_read_from_the_bus_in_wire_units() -> None:
    """90 degrees of the motor in thousandths; a window that is off; the end of a turn."""
    dictionary = ObjectDictionary(0x10)
    assert dictionary.wire_units(od.POSITION_ACTUAL, 90_000) == 90_000
    dictionary.write(od.FEED_UNITS, (360_000).to_bytes(4, "little"))
    assert dictionary.wire_units(od.POSITION_ACTUAL, 90_000) == 90_000  # only the drive obeys a factor
    dictionary.change_factor(od.FEED_UNITS, 360_000)
    assert dictionary.wire_units(od.POSITION_ACTUAL, 90_000) == 819_200
    assert dictionary.wire_units(od.FOLLOWING_ERROR_WINDOW, 0xFFFF_FFFF) == 0xFFFF_FFFF
    assert dictionary.wire_units(od.POSITION_RANGE_MAX, 359_999) == 3_276_799
