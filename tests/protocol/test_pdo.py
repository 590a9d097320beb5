"""PDOs: decoding and encoding by their mapping, transmission, and changes of their parameters (CiA 301, 7.5.2.36)."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.frame import COB_ID_INVALID, COB_ID_NO_RTR
from steptwin.protocol.pdo import ProcessData, act_on_sync
from steptwin.protocol.pvt import PvtRecord
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

NODE = 0x10
INVALID = COB_ID_INVALID


def process_data() -> tuple[ObjectDictionary, ProcessData]:
    dictionary = ObjectDictionary(NODE)
    pdos = ProcessData(dictionary)
    assert pdos.refresh(0)
    return dictionary, pdos


def write(dictionary: ObjectDictionary, index: int, subindex: int, value: int) -> None:
    address = od.address_of(index, subindex)
    size = dictionary.entries[address].data_type.size
    dictionary.write(address, value.to_bytes(size, "little"))


def refused(dictionary: ObjectDictionary, index: int, subindex: int, value: int) -> AbortCode:
    with pytest.raises(SdoAbortError) as caught:
        write(dictionary, index, subindex, value)
    return caught.value.code


@pytest.mark.slow
@given(
    st.integers(-(1 << 23), (1 << 23) - 1),
    st.integers(-(1 << 23), (1 << 23) - 1),
    st.integers(0, 255),
    st.integers(0, 255),
)
def test_a_pvt_record_arrives_as_it_was_sent(displacement: int, velocity: int, duration_ms: int, sequence: int) -> None:
    dictionary, pdos = process_data()
    record = PvtRecord(displacement, velocity, duration_ms, sequence)
    assert pdos.receive_pdos[3].receive(record.encode()) is ErrorCode.NONE
    assert (
        tuple(map(dictionary.get, (od.PVT_DISPLACEMENT, od.PVT_END_VELOCITY, od.PVT_DURATION_MS, od.PVT_SEQUENCE)))
        == record
    )


ADDRESSES = {
    "b": od.SUPPORTED_HOMING_METHODS[0],
    "B": od.PVT_SEQUENCE,
    "h": 0x2002_01,
    "H": od.CONTROLWORD,
    "3": od.PVT_DISPLACEMENT,
    "i": 0x607A_00,
    "I": 0x1003_01,
}
"""An entry of each type, by its code in `struct`; "3" is INTEGER24."""
RANGES = {"b": 8, "B": 8, "h": 16, "H": 16, "3": 24, "i": 32, "I": 32}


def packed(code: str, value: int) -> bytes:
    return struct.pack("<i", value)[:3] if code == "3" else struct.pack(f"<{code}", value)


def values(code: str) -> st.SearchStrategy[int]:
    """Any value of a type, and its ends more often."""
    low = 0 if code.isupper() else -(1 << RANGES[code] - 1)
    high = low + (1 << RANGES[code]) - 1
    return st.sampled_from([low, -1 if low else high, high]) | st.integers(low, high)


@pytest.mark.slow
@settings(max_examples=60)
@given(st.sampled_from(["bhi", "BHI", "3HbB", "iI", "I3B", "h", "Hb", "B3I", "bBhH"]), st.data())
def test_every_mapping_is_taken_apart_as_struct_packs_it(mapping: str, data: st.DataObject) -> None:
    """Also where the frame is longer than the mapping."""
    dictionary, pdos = process_data()
    for number, code in enumerate(mapping, start=1):
        word = ADDRESSES[code] << 8 | RANGES[code]
        dictionary.set(od.address_of(od.RPDO_MAPPING[3], number), word)
    dictionary.set(od.address_of(od.RPDO_MAPPING[3]), len(mapping))
    pdos.invalidate()
    pdos.refresh(0)
    sent = [data.draw(values(code)) for code in mapping]
    frame = b"".join(map(packed, mapping, sent))
    spare = data.draw(st.binary(max_size=8 - len(frame)))
    said = pdos.receive_pdos[3].receive(frame + spare)
    assert said is (ErrorCode.PDO_TOO_LONG if spare else ErrorCode.NONE)
    assert [dictionary.get(ADDRESSES[code]) for code in mapping] == sent
    assert dictionary.get(od.RPDO_VALUES_REFUSED) == 0


def test_default_cob_ids_follow_the_predefined_connection_set() -> None:
    _, pdos = process_data()
    assert [pdo.cob_id for pdo in pdos.receive_pdos] == [0x210, 0x310, 0x410, 0x510]
    assert [pdo.cob_id & 0x7FF for pdo in pdos.transmit_pdos] == [0x190, 0x290, 0x390, 0x490]
    assert [pdo.exists for pdo in pdos.transmit_pdos] == [True, False, True, True]
    assert [pdo.synchronous for pdo in pdos.receive_pdos] == [False, True, True, False]


def test_a_synchronous_rpdo_waits_for_sync_and_the_last_one_counts() -> None:
    dictionary, pdos = process_data()
    pdos.receive_pdos[1].receive(b"\x06\x00")
    pdos.receive_pdos[1].receive(b"\x1f\x00")
    assert dictionary.get(od.CONTROLWORD) == 0
    act_on_sync(pdos.receive_pdos)
    assert dictionary.get(od.CONTROLWORD) == 0x1F
    dictionary.set(od.CONTROLWORD, 0)
    act_on_sync(pdos.receive_pdos)
    assert dictionary.get(od.CONTROLWORD) == 0


def test_length_errors() -> None:
    dictionary, pdos = process_data()
    assert pdos.receive_pdos[0].receive(b"\x06\x00") is ErrorCode.PDO_TOO_SHORT
    assert dictionary.get(od.CONTROLWORD) == 0
    assert pdos.receive_pdos[0].receive(b"\x06\x00\x07\xff") is ErrorCode.PDO_TOO_LONG
    assert (dictionary.get(od.CONTROLWORD), dictionary.get(od.MODE_OF_OPERATION)) == (6, 7)


def test_values_that_the_dictionary_refuses_are_dropped_and_counted() -> None:
    dictionary, pdos = process_data()
    assert pdos.receive_pdos[0].receive(b"\x06\x00\x63") is ErrorCode.NONE
    assert (dictionary.get(od.CONTROLWORD), dictionary.get(od.MODE_OF_OPERATION)) == (6, 0)
    assert (dictionary.get(od.RPDO_VALUES_REFUSED), dictionary.get(od.RPDO_LAST_REFUSED)) == (1, 0x6060_0008)
    pdos.receive_pdos[0].receive(b"\x07\x00\x63")
    pdos.invalidate()
    pdos.refresh(0)
    assert dictionary.get(od.RPDO_VALUES_REFUSED) == 2


class TestTransmission:
    def test_change_is_sent_at_once_then_inhibited(self) -> None:
        dictionary, pdos = process_data()
        pdo = pdos.transmit_pdos[0]
        dictionary.set(od.STATUSWORD, 0x1234)
        dictionary.set(od.POSITION_ACTUAL, -2)
        pdos.changed(od.STATUSWORD)
        frame = pdo.poll(0)
        assert frame is not None
        assert (frame.cob_id, frame.data.hex(" ")) == (0x190, "34 12 00 fe ff ff ff")
        pdos.changed(od.STATUSWORD)
        assert pdo.due_us == 5_000
        assert pdo.poll(4_999) is None
        assert pdo.poll(5_000) is not None

    def test_event_timer_repeats_it(self) -> None:
        _, pdos = process_data()
        pdo = pdos.transmit_pdos[0]
        assert pdo.due_us == 100_000
        assert pdo.poll(99_999) is None
        assert pdo.poll(100_000) is not None
        assert pdo.due_us == 200_000

    def test_changes_of_entries_that_are_not_mapped_do_not_send(self) -> None:
        _, pdos = process_data()
        pdos.changed(od.ERROR_CODE)
        assert [pdo.due_us for pdo in pdos.transmit_pdos] == [100_000, None, 100_000, 0]

    @pytest.mark.parametrize(
        ("transmission", "mapping", "sampled"),
        [
            (254, (0x6064_0020,), True),
            (254, (0x6041_0010, 0x6064_0020), True),
            (255, (0x6064_0020,), True),
            (255, (0x1001_0008, 0x606C_0020), True),
            (255, (0x6041_0010, 0x6064_0020), False),
            (255, (0x6064_0020, 0x6061_0008), False),
            (255, (0x60FD_0020, 0x6064_0020), False),
            (255, (0x603F_0010, 0x6064_0020), False),
            (255, (0x2012_0308, 0x6064_0020), False),
            (254, (), False),
            (255, (), False),
        ],
    )
    def test_any_change_counts_for_type_254_and_where_none_is_announced(
        self, transmission: int, mapping: tuple[int, ...], *, sampled: bool
    ) -> None:
        """Sent when the node becomes OPERATIONAL, then within 1 ms of each change; by no timer."""
        dictionary, pdos = process_data()
        write(dictionary, 0x1801, 2, transmission)
        write(dictionary, 0x1A01, 0, 0)
        for number, word in enumerate(mapping, start=1):
            write(dictionary, 0x1A01, number, word)
        write(dictionary, 0x1A01, 0, len(mapping))
        pdos.refresh(0)
        pdo = pdos.transmit_pdos[1]
        sent = []
        for now_us in range(0, 10_000, 250):
            if now_us in (3_250, 3_500, 7_000):
                for word in mapping:
                    dictionary.set(word >> 8, now_us & 0xFF)
            if pdo.poll(now_us) is not None:
                sent.append(now_us)
        assert sent == ([0, 4_000, 7_000] if sampled else [])

    def test_changes_are_sent_at_most_at_the_inhibit_rate(self) -> None:
        dictionary, pdos = process_data()
        for subindex, value in ((2, 254), (3, 25)):
            write(dictionary, 0x1801, subindex, value)
        pdos.refresh(0)
        pdo, sent = pdos.transmit_pdos[1], []
        for now_us in range(0, 10_000, 250):
            dictionary.set(od.POSITION_ACTUAL, now_us)
            if pdo.poll(now_us) is not None:
                sent.append(now_us)
        assert sent == [0, 2_500, 5_000, 7_500]

    def test_the_event_timer_sends_what_has_not_changed(self) -> None:
        dictionary, pdos = process_data()
        for subindex, value in ((2, 254), (5, 7)):
            write(dictionary, 0x1801, subindex, value)
        pdos.refresh(0)
        pdo = pdos.transmit_pdos[1]
        assert [us for us in range(0, 22_000, 500) if pdo.poll(us) is not None] == [0, 7_000, 14_000, 21_000]

    @pytest.mark.parametrize(("transmission", "sent"), [(1, [1, 1, 1, 1]), (3, [0, 0, 1, 0]), (0, [1, 0, 0, 0])])
    def test_synchronous_types_count_syncs(self, transmission: int, sent: list[int]) -> None:
        dictionary, pdos = process_data()
        write(dictionary, 0x1801, 2, transmission)
        pdos.refresh(0)
        pdo = pdos.transmit_pdos[1]
        assert [int(pdo.on_sync() is not None) for _ in range(4)] == sent

    def test_type_240_waits_for_the_240th(self) -> None:
        dictionary, pdos = process_data()
        write(dictionary, 0x1801, 2, 240)
        pdos.refresh(0)
        sent = [pdos.transmit_pdos[1].on_sync() is not None for _ in range(480)]
        assert [i for i, now in enumerate(sent, start=1) if now] == [240, 480]

    def test_type_0_is_sent_at_the_first_sync_and_at_the_sync_after_a_change(self) -> None:
        dictionary, pdos = process_data()
        write(dictionary, 0x1801, 2, 0)
        pdos.refresh(0)
        pdo = pdos.transmit_pdos[1]
        assert [pdo.on_sync() is not None for _ in range(2)] == [True, False]
        dictionary.set(od.POSITION_ACTUAL, 1)
        assert [pdo.on_sync() is not None for _ in range(2)] == [True, False]
        pdos.changed(od.POSITION_ACTUAL)
        assert [pdo.on_sync() is not None for _ in range(2)] == [True, False]

    def test_the_sync_with_the_start_value_is_the_first_that_counts(self) -> None:
        dictionary, pdos = process_data()
        write(dictionary, 0x1019, 0, 5)
        write(dictionary, 0x1801, 2, 2)
        write(dictionary, 0x1801, 6, 3)
        pdos.refresh(0)
        pdo = pdos.transmit_pdos[1]
        counters = [1, 2, 3, 4, 5, 1, 2, 3]
        assert [pdo.on_sync(counter) is not None for counter in counters] == [0, 0, 0, 1, 0, 1, 0, 1]

    def test_without_a_sync_counter_the_start_value_is_ignored(self) -> None:
        dictionary, pdos = process_data()
        write(dictionary, 0x1801, 6, 3)
        pdos.refresh(0)
        assert pdos.transmit_pdos[1].on_sync() is not None


class TestConfiguration:
    def test_the_prescribed_order_works(self) -> None:
        """Invalidate, empty the mapping, map, set the count, validate."""
        dictionary, pdos = process_data()
        write(dictionary, 0x1800, 1, 0x190 | COB_ID_NO_RTR | INVALID)
        write(dictionary, 0x1A00, 0, 0)
        write(dictionary, 0x1A00, 1, 0x606C_0020)
        write(dictionary, 0x1A00, 0, 1)
        write(dictionary, 0x1800, 1, 0x191 | COB_ID_NO_RTR)
        assert pdos.refresh(0)
        dictionary.set(od.VELOCITY_ACTUAL, 5)
        pdos.changed(od.VELOCITY_ACTUAL)
        frame = pdos.transmit_pdos[0].poll(0)
        assert frame is not None
        assert (frame.cob_id, frame.data.hex()) == (0x191, "05000000")

    def test_a_valid_cob_id_keeps_its_identifier(self) -> None:
        dictionary, _ = process_data()
        assert refused(dictionary, 0x1400, 1, 0x211) is AbortCode.VALUE_RANGE
        write(dictionary, 0x1400, 1, 0x210)

    @pytest.mark.parametrize(
        "identifier", [0x000, 0x07F, 0x101, 0x180, 0x581, 0x610, 0x67F, 0x6E0, 0x6FF, 0x701, 0x710, 0x7FF, 0x800]
    )
    def test_identifiers_of_other_services_are_refused(self, identifier: int) -> None:
        dictionary, _ = process_data()
        write(dictionary, 0x1400, 1, 0x210 | INVALID)
        assert refused(dictionary, 0x1400, 1, identifier) is AbortCode.VALUE_RANGE

    @pytest.mark.parametrize("identifier", [0x080, 0x081, 0x100, 0x181, 0x580, 0x600, 0x680, 0x6DF, 0x700])
    def test_identifiers_beside_them_are_free(self, identifier: int) -> None:
        dictionary, _ = process_data()
        write(dictionary, 0x1400, 1, 0x210 | INVALID)
        write(dictionary, 0x1400, 1, identifier)
        assert dictionary.get(0x1400_01) == identifier

    @pytest.mark.parametrize(("transmission", "valid"), [(240, True), (241, False), (253, False), (254, True)])
    def test_transmission_types(self, transmission: int, valid: bool) -> None:
        dictionary, _ = process_data()
        if valid:
            write(dictionary, 0x1800, 2, transmission)
        else:
            assert refused(dictionary, 0x1800, 2, transmission) is AbortCode.VALUE_RANGE

    def test_mapping_is_closed_while_the_pdo_is_valid(self) -> None:
        dictionary, _ = process_data()
        assert refused(dictionary, 0x1600, 0, 0) is AbortCode.DEVICE_STATE
        assert refused(dictionary, 0x1600, 1, 0) is AbortCode.DEVICE_STATE

    @pytest.mark.parametrize("subindex", [3, 6])
    def test_inhibit_time_and_start_value_are_fixed_while_the_pdo_is_valid(self, subindex: int) -> None:
        dictionary, _ = process_data()
        assert refused(dictionary, 0x1800, subindex, 1) is AbortCode.DEVICE_STATE
        write(dictionary, 0x1800, 1, 0x190 | INVALID)
        write(dictionary, 0x1800, subindex, 1)
        assert dictionary.get(od.address_of(0x1800, subindex)) == 1

    def test_entries_are_closed_while_the_count_is_not_zero(self) -> None:
        dictionary, _ = process_data()
        write(dictionary, 0x1400, 1, 0x210 | INVALID)
        assert refused(dictionary, 0x1600, 1, 0x6040_0010) is AbortCode.DEVICE_STATE

    @pytest.mark.parametrize(
        "word",
        [
            pytest.param(0x9999_0010, id="no such object"),
            pytest.param(0x6041_0010, id="not for receiving"),
            pytest.param(0x6040_0008, id="wrong width"),
            pytest.param(0x1018_0120, id="constant"),
        ],
    )
    def test_entries_that_cannot_be_mapped(self, word: int) -> None:
        dictionary, _ = process_data()
        write(dictionary, 0x1400, 1, 0x210 | INVALID)
        write(dictionary, 0x1600, 0, 0)
        assert refused(dictionary, 0x1600, 1, word) is AbortCode.CANNOT_BE_MAPPED

    def test_64_bits_fit_and_more_do_not(self) -> None:
        dictionary, _ = process_data()
        write(dictionary, 0x1800, 1, 0x190 | INVALID)
        write(dictionary, 0x1A00, 0, 0)
        for i, word in enumerate((0x6064_0020, 0x6062_0020, 0x6061_0008), start=1):
            write(dictionary, 0x1A00, i, word)
        assert refused(dictionary, 0x1A00, 0, 3) is AbortCode.PDO_TOO_LONG
        write(dictionary, 0x1A00, 0, 2)
        assert dictionary.get(0x1A00_00) == 2

    def test_a_count_over_empty_entries_is_refused(self) -> None:
        dictionary, _ = process_data()
        write(dictionary, 0x1400, 1, 0x210 | INVALID)
        write(dictionary, 0x1600, 0, 0)
        assert refused(dictionary, 0x1600, 0, 3) is AbortCode.CANNOT_BE_MAPPED

    def test_parameters_are_closed_outside_pre_operational(self) -> None:
        dictionary, pdos = process_data()
        pdos.configurable = False
        for index, subindex in ((0x1400, 1), (0x1400, 2), (0x1800, 3), (0x1800, 5), (0x1600, 0), (0x1A00, 1)):
            assert refused(dictionary, index, subindex, 0) is AbortCode.DEVICE_STATE


DUMMIES = {
    "BOOLEAN": 0x0001_0001,
    "INTEGER8": 0x0002_0008,
    "INTEGER16": 0x0003_0010,
    "INTEGER32": 0x0004_0020,
    "UNSIGNED8": 0x0005_0008,
    "UNSIGNED16": 0x0006_0010,
    "UNSIGNED32": 0x0007_0020,
}
"""Dummy entries as a mapping names them: index, sub-index 0, bits (CiA 301, table 44)."""


def remapped(*words: int) -> tuple[ObjectDictionary, ProcessData]:
    """Return a node whose RPDO1 maps these."""
    dictionary, pdos = process_data()
    write(dictionary, 0x1400, 1, 0x210 | INVALID)
    write(dictionary, 0x1600, 0, 0)
    for number, word in enumerate(words, start=1):
        write(dictionary, 0x1600, number, word)
    write(dictionary, 0x1600, 0, len(words))
    write(dictionary, 0x1400, 1, 0x210)
    assert pdos.refresh(0)
    return dictionary, pdos


class TestDummies:
    @pytest.mark.parametrize("word", DUMMIES.values(), ids=DUMMIES)
    def test_each_leaves_its_bits_out(self, word: int) -> None:
        dictionary, pdos = remapped(word, 0x6040_0010)
        bits = word & 0xFF
        frame = (0x001F << bits | (1 << bits) - 1).to_bytes(-(-(bits + 16) // 8), "little")
        assert pdos.receive_pdos[0].receive(frame) is ErrorCode.NONE
        assert dictionary.get(od.CONTROLWORD) == 0x1F
        assert dictionary.get(od.RPDO_VALUES_REFUSED) == 0
        assert pdos.receive_pdos[0].receive(frame[:-1]) is ErrorCode.PDO_TOO_SHORT

    @pytest.mark.parametrize("word", DUMMIES.values(), ids=DUMMIES)
    def test_none_can_be_sent_or_read(self, word: int) -> None:
        dictionary, _ = process_data()
        write(dictionary, 0x1A01, 0, 0)
        assert refused(dictionary, 0x1A01, 1, word) is AbortCode.CANNOT_BE_MAPPED
        with pytest.raises(SdoAbortError) as caught:
            dictionary.read(word >> 8)
        assert caught.value.code is AbortCode.NO_OBJECT

    @pytest.mark.parametrize("word", [0x0005_0010, 0x0005_0108, 0x0008_0020, 0x0010_0018, 0x0001_0008])
    def test_other_widths_places_and_types_are_refused(self, word: int) -> None:
        dictionary, _ = process_data()
        write(dictionary, 0x1400, 1, 0x210 | INVALID)
        write(dictionary, 0x1600, 0, 0)
        assert refused(dictionary, 0x1600, 1, word) is AbortCode.CANNOT_BE_MAPPED

    def test_they_count_towards_the_64_bits(self) -> None:
        remapped(DUMMIES["UNSIGNED32"], 0x607A_0020)
        with pytest.raises(SdoAbortError) as caught:
            remapped(DUMMIES["UNSIGNED32"], 0x607A_0020, DUMMIES["BOOLEAN"])
        assert caught.value.code is AbortCode.PDO_TOO_LONG
