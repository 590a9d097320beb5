"""Frame lengths against a bit-by-bit encoder, arbitration and timing of the virtual bus."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.bus.can_controller import CanController, ErrorState
from steptwin.emulator.bus.can_timing import frame_bits
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.frame import BITRATES, Frame
from tests.emulator.bus.bus_rig import BusRig
from tests.messages import refusing

FRAMES = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8) | st.sampled_from([bytes(8), b"\xff" * 8]))


def bits_by_hand(frame: Frame) -> int:
    """Write the frame out bit by bit: CRC by long division, a stuff bit after each run of five (ISO 11898-1)."""
    text = f"0{frame.cob_id:011b}000{len(frame.data):04b}" + "".join(f"{byte:08b}" for byte in frame.data)
    remainder = [int(bit) for bit in text] + [0] * 15
    polynomial = [int(bit) for bit in f"{0xC599:016b}"]
    for i in range(len(text)):
        if remainder[i]:
            for j, bit in enumerate(polynomial):
                remainder[i + j] ^= bit
    wire = ""
    for level in text + "".join(map(str, remainder[-15:])):
        wire += level
        if len(wire) - len(wire.rstrip(level)) == 5:
            wire += "10"[int(level)]
    return len(wire) + 1 + 2 + 7 + 3


@given(FRAMES)
def test_frame_length_against_an_encoder_by_hand(frame: Frame) -> None:
    assert frame_bits(frame) == bits_by_hand(frame)


@given(FRAMES)
def test_frame_length_lies_within_the_known_bounds(frame: Frame) -> None:
    n = len(frame.data)
    assert 47 + 8 * n <= frame_bits(frame) <= 47 + 8 * n + (33 + 8 * n) // 4


def test_frame_lengths_known_from_elsewhere() -> None:
    assert frame_bits(Frame(0, bytes(8))) == 127
    assert frame_bits(Frame(0x555, b"\x55" * 8)) == 112


@pytest.mark.parametrize("bitrate", BITRATES)
def test_a_frame_takes_its_bits(bitrate: int) -> None:
    """It is valid four bits (one of EOF, three of intermission) before the bus is free again."""
    rig = BusRig(bitrate)
    frame = Frame(0x181, b"\x12\x34")
    rig.stations[0].send(frame, 1000)
    rig.run()
    assert rig.heard == [[], [(1000 + rig.bits(frame_bits(frame) - 4), frame)]]
    rig.stations[0].send(frame, 1001)
    rig.run()
    assert rig.heard[1][1] == (1000 + rig.bits(2 * frame_bits(frame) - 4), frame)


def test_lower_identifiers_win() -> None:
    rig = BusRig()
    for station, cob_id, byte in ((1, 0x700, 1), (0, 0x080, 2), (1, 0x181, 3), (0, 0x182, 4)):
        rig.stations[station].send(Frame(cob_id, bytes((byte,))), 0)
    rig.run()
    assert [frame.data[0] for frame in rig.bus.log_frames] == [2, 3, 4, 1]


def test_a_frame_under_way_is_not_interrupted() -> None:
    rig = BusRig()
    rig.stations[0].send(Frame(0x700, b""), 0)
    rig.bus.step(0)
    rig.stations[0].send(Frame(0x000, b""), 1)
    rig.run()
    assert [frame.cob_id for frame in rig.bus.log_frames] == [0x700, 0x000]


def test_a_saturated_bus_is_always_busy() -> None:
    rig = BusRig(500_000)
    for i in range(100):
        rig.stations[i % 2].send(Frame(i, bytes(8)), 0)
    rig.run()
    assert rig.bus.log_counts[-1] == rig.bits(rig.bus.busy_bits - 4)
    assert sorted(rig.bus.log_frames) == [Frame(i, bytes(8)) for i in range(100)]
    assert len(rig.bus.log_counts) == 100


def test_every_station_but_the_sender_hears_a_frame() -> None:
    rig = BusRig(stations=3)
    frame = Frame(0x181, b"")
    rig.stations[1].send(frame, 0)
    rig.run()
    assert [[heard for _, heard in frames] for frames in rig.heard] == [[frame], [], [frame]]


def test_equal_frames_at_once_are_one_on_the_wire() -> None:
    """Two boards with the same node ids send the same boot-up messages: no station notices."""
    rig = BusRig(stations=3)
    for station in rig.stations[:2]:
        station.send(Frame(0x710, b"\0"), 0)
    rig.run()
    assert rig.bus.log_frames == [Frame(0x710, b"\0")]
    assert [len(frames) for frames in rig.heard] == [0, 0, 1]
    assert not any(station.mailboxes for station in rig.stations)


def test_two_senders_of_one_identifier_disturb_each_other_until_they_are_passive() -> None:
    """After 16 attempts the flag of the sender with the recessive bit is recessive too: the other's frame passes."""
    rig = BusRig(stations=3)
    for byte, station in ((1, rig.stations[0]), (0, rig.stations[1])):
        station.send(Frame(0x181, bytes((byte,))), 0)
    rig.run()
    assert rig.bus.error_frames == 16
    assert rig.bus.log_frames == [Frame(0x181, b"\x00"), Frame(0x181, b"\x01")]
    assert [frame.data[0] for _, frame in rig.heard[2]] == [0, 1]
    assert [len(rig.heard[0]), len(rig.heard[1])] == [0, 1]
    assert [station.errors.transmit_errors for station in rig.stations] == [128 + 8 - 1, 128 - 1, 0]
    assert rig.stations[2].errors.receive_errors == 16 - 2


def test_a_shorter_frame_of_the_same_identifier_is_dominant_first() -> None:
    """Its length stands before the data; the senders are passive already."""
    rig = BusRig(stations=3)
    for data, station in ((b"", rig.stations[0]), (bytes(2), rig.stations[1])):
        for _ in range(16):
            station.errors.sending_failed()
        station.receiving_failed(0)
        station.send(Frame(0x181, data), 0)
    rig.run()
    assert rig.bus.log_frames == [Frame(0x181, b""), Frame(0x181, bytes(2))]
    assert rig.bus.error_frames == 0


def test_an_outdone_sender_that_never_pauses_leaves_the_bus() -> None:
    """Passive, it counts 8 errors with every other frame of its rival; in between it is suspended."""
    rig = BusRig(stations=3)
    for byte, station in enumerate(rig.stations[:2]):
        for _ in range(100):
            station.send(Frame(0x181, bytes((byte,))), 0)
    while rig.stations[1].on_bus:
        assert rig.bus.next_event_counts is not None
        rig.bus.step(rig.bus.next_event_counts)
    assert rig.bus.log_frames == [Frame(0x181, b"\x00")] * 31
    assert [station.errors.transmit_errors for station in rig.stations[:2]] == [128 - 31, 256]


def test_a_sender_alone_repeats_for_ever_but_stays_on_the_bus() -> None:
    """No station acknowledges. After 16 failures it is passive, pauses 8 bits more and counts no further errors."""
    rig = BusRig(stations=1)
    frame = Frame(0x181, b"\x55")
    failed_bits = frame_bits(frame) - 11 + 6 + 8 + 3
    rig.stations[0].send(frame, 0)
    rig.run(until_counts=rig.bits(16 * failed_bits - 11))
    assert rig.errors == [(rig.bits(16 * failed_bits - 11), 0, ErrorCode.CAN_ERROR_PASSIVE, True)]
    rig.run(until_counts=rig.bits(116 * failed_bits + 100 * 8 - 11))
    assert rig.bus.error_frames == 116
    assert rig.stations[0].errors.transmit_errors == 128
    assert rig.bus.busy
    rig.bus.attach(CanController(lambda frame, counts: rig.heard[0].append((counts, frame))))
    rig.run()
    assert [heard for _, heard in rig.heard[0]] == rig.bus.log_frames == [frame]
    assert rig.stations[0].state is ErrorState.WARNING
    assert rig.errors[1:] == [(rig.bus.log_counts[0], 0, ErrorCode.CAN_ERROR_PASSIVE, False)]


def test_bus_off_lasts_128_times_11_recessive_bits() -> None:
    rig = BusRig(stations=3)
    rig.bus.throw_off(rig.stations[0], 0)
    rig.stations[0].send(Frame(0x100, b""), 0)
    rig.run(until_counts=rig.bits(128 * 11) - 1)
    assert rig.stations[0].state is ErrorState.BUS_OFF
    assert rig.bus.busy
    rig.run()
    recovered = rig.bits(128 * 11)
    sent = recovered + rig.bits(frame_bits(Frame(0x100, b"")) - 4)
    code = ErrorCode.CAN_BUS_OFF_RECOVERED
    assert rig.errors == [(recovered, 0, code, True), (sent, 0, code, False)]
    assert rig.heard[1] == [(sent, Frame(0x100, b""))]


def test_a_second_station_in_bus_off_does_not_hasten_the_first() -> None:
    rig = BusRig(stations=3)
    rig.bus.throw_off(rig.stations[0], 0)
    later = rig.bits(50 * 11)
    rig.bus.throw_off(rig.stations[1], later)
    rig.run()
    code = ErrorCode.CAN_BUS_OFF_RECOVERED
    first = rig.bits(128 * 11)
    assert rig.errors == [(first, 0, code, True), (later + first, 1, code, True)]


def test_traffic_delays_the_way_back_from_bus_off() -> None:
    """A frame brings eleven recessive bits, at its end; a sequence of idle bits that it cuts short does not count."""
    rig = BusRig(stations=3)
    rig.bus.throw_off(rig.stations[0], 0)
    frame = Frame(0x100, b"\x55")
    start = rig.bits(5 * 11 + 10)
    rig.run(until_counts=start - 1)
    rig.stations[1].send(frame, start)
    rig.run()
    recovered = start + rig.bits(frame_bits(frame)) + rig.bits((128 - 5 - 1) * 11)
    assert rig.errors == [(recovered, 0, ErrorCode.CAN_BUS_OFF_RECOVERED, True)]
    assert rig.heard[0] == []
    assert len(rig.heard[2]) == 1


class TestPower:
    """A station loses its power and has it back at once: a fresh controller takes its place."""

    FRAME = Frame(0x100, b"\x55" * 4)

    def exchange(self, rig: BusRig, number: int, now_counts: int) -> CanController:
        fresh = rig.controller(number)
        rig.bus.exchange(rig.stations[number], fresh, now_counts)
        rig.stations[number] = fresh
        return fresh

    def rig_with_a_frame_under_way(self) -> BusRig:
        rig = BusRig(stations=3)
        rig.stations[0].send(self.FRAME, 0)
        rig.stations[0].send(Frame(0x101, b""), 0)
        rig.bus.step(0)
        return rig

    def test_a_frame_breaks_off(self) -> None:
        """After six recessive bits the others see a stuff error: six bits of flag, eight of delimiter, three more."""
        rig = self.rig_with_a_frame_under_way()
        now = rig.bits(30)
        fresh = self.exchange(rig, 0, now)
        fresh.send(Frame(0x102, b""), now)
        rig.run()
        assert rig.bus.error_frames == 1
        assert rig.bus.log_frames == [Frame(0x102, b"")]
        assert rig.bus.log_counts[0] == rig.bits(30 + 6 + 6 + 8 + 3 + frame_bits(Frame(0x102, b"")) - 4)
        assert rig.bus.busy_bits == 30 + 6 + 6 + 8 + 3 + frame_bits(Frame(0x102, b""))
        assert [station.errors.receive_errors for station in rig.stations[1:]] == [0, 0]  # 1, and 1 less for a good one
        assert fresh.errors.transmit_errors == 0

    @pytest.mark.parametrize(("bits_before_end", "passes"), [(14, False), (13, True), (5, True)])
    def test_a_frame_whose_last_dominant_bit_is_out_passes(self, bits_before_end: int, *, passes: bool) -> None:
        """After the CRC its bits are recessive or sent by other stations."""
        rig = self.rig_with_a_frame_under_way()
        self.exchange(rig, 0, rig.bits(frame_bits(self.FRAME) - bits_before_end))
        rig.run()
        assert rig.bus.log_frames == [self.FRAME] * passes
        assert [len(frames) for frames in rig.heard] == [0, passes, passes]
        assert rig.bus.error_frames == (not passes)

    def test_a_frame_that_another_sends_too_goes_on(self) -> None:
        rig = BusRig(stations=3)
        for station in rig.stations[:2]:
            station.send(self.FRAME, 0)
        rig.bus.step(0)
        self.exchange(rig, 0, rig.bits(30))
        rig.run()
        assert rig.bus.log_frames == [self.FRAME]
        assert [len(frames) for frames in rig.heard] == [0, 0, 1]

    def test_a_receiver_misses_what_is_under_way(self) -> None:
        rig = self.rig_with_a_frame_under_way()
        self.exchange(rig, 1, rig.bits(30))
        rig.run()
        assert [[heard.cob_id for _, heard in frames] for frames in rig.heard] == [[], [0x101], [0x100, 0x101]]

    def test_it_ends_bus_off_at_once(self) -> None:
        rig = BusRig(stations=2)
        rig.bus.throw_off(rig.stations[0], 0)
        rig.stations[0].send(self.FRAME, 0)
        fresh = self.exchange(rig, 0, 1000)
        fresh.send(Frame(0x102, b""), 1000)
        rig.run()
        assert rig.bus.log_frames == [Frame(0x102, b"")]
        assert rig.bus.log_counts[0] == 1000 + rig.bits(frame_bits(Frame(0x102, b"")) - 4)
        assert rig.errors == []


def test_unknown_bit_rate_names_the_known_ones() -> None:
    with refusing(ValueError):
        Bus(800_000)
