"""Frame lengths against a bit-by-bit encoder, arbitration and timing of the virtual bus."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulator.bus import Bus
from emulator.can_timing import frame_bits
from protocol.frame import BITRATES, Frame

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


def drive(bus: Bus) -> list[tuple[int, int, Frame]]:
    """Step through all events: (counts, port, frame) of what arrives."""
    arrived = []
    while (now := bus.next_event_counts) is not None:
        delivery = bus.step(now)
        if delivery:
            arrived.append((now, *delivery))
    return arrived


@pytest.mark.parametrize("bitrate", BITRATES)
def test_a_frame_takes_its_bits(bitrate: int) -> None:
    """It is valid four bits (one of EOF, three of intermission) before the bus is free again."""
    bus = Bus(bitrate)
    frame = Frame(0x181, b"\x12\x34")
    bus.submit(0, frame, 1000)
    bits, bit_counts = frame_bits(frame), 72_000_000 // bitrate
    assert drive(bus) == [(1000 + (bits - 4) * bit_counts, 0, frame)]
    bus.submit(0, frame, 1001)
    assert drive(bus)[0][0] == 1000 + (2 * bits - 4) * bit_counts


def test_lower_identifiers_win_and_equals_keep_their_order() -> None:
    bus = Bus(1_000_000)
    for port, cob_id, byte in ((1, 0x700, 1), (0, 0x080, 2), (1, 0x181, 3), (0, 0x181, 4)):
        bus.submit(port, Frame(cob_id, bytes((byte,))), 0)
    assert [frame.data[0] for _, _, frame in drive(bus)] == [2, 3, 4, 1]


def test_a_frame_under_way_is_not_interrupted() -> None:
    bus = Bus(1_000_000)
    bus.submit(0, Frame(0x700, b""), 0)
    bus.step(0)
    bus.submit(0, Frame(0x000, b""), 1)
    assert [frame.cob_id for _, _, frame in drive(bus)] == [0x700, 0x000]


def test_a_saturated_bus_is_always_busy() -> None:
    bus = Bus(500_000)
    for i in range(100):
        bus.submit(0, Frame(i, bytes(8)), 0)
    last = drive(bus)[-1][0]
    assert last == (bus.busy_bits - 4) * bus.bit_counts
    assert list(bus.log_frames) == [Frame(i, bytes(8)) for i in range(100)]
    assert len(bus.log_counts) == 100


def test_unknown_bit_rate_names_the_known_ones() -> None:
    with pytest.raises(ValueError, match="125000, 250000, 500000, 1000000"):
        Bus(800_000)
