"""Stations whose bit rate is not the host's: what they destroy, and what ISO 11898-1 makes of their error counters."""

from steptwin.emulator.bus.can_controller import ErrorState
from steptwin.emulator.bus.can_timing import frame_bits
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.frame import Frame
from tests.emulator.bus.bus_rig import BusRig

FRAME = Frame(0x181, b"\x55")
HOST, TUNED, STRANGE = range(3)
FAILED_BITS = frame_bits(FRAME) - 10 + 7 + 8 + 3
"""A frame that is destroyed at the end of its CRC: up to there, flags, delimiter, intermission."""


def rig_with_a_strange_station() -> BusRig:
    rig = BusRig(stations=3)
    rig.stations[STRANGE].tune(500_000)
    return rig


def test_an_error_active_station_destroys_the_first_16_attempts_and_then_only_listens() -> None:
    """It is the first to notice each error, and adds 8 as the sender does: both are error passive after 16."""
    rig = rig_with_a_strange_station()
    rig.stations[HOST].send(FRAME, 0)
    rig.run()
    assert rig.bus.error_frames == 16
    assert [rig.stations[i].errors.receive_errors for i in (TUNED, STRANGE)] == [15, 128]
    assert rig.stations[HOST].errors.transmit_errors == 127
    assert rig.stations[STRANGE].state is ErrorState.PASSIVE
    assert [frame for _, frame in rig.heard[TUNED]] == [FRAME]
    assert rig.heard[STRANGE] == []
    valid_bits = 16 * FAILED_BITS + 8 + frame_bits(FRAME) - 4
    assert rig.bus.log_counts[0] <= rig.bits(valid_bits)


def test_its_own_frames_are_errors_for_all_until_it_is_in_bus_off() -> None:
    rig = rig_with_a_strange_station()
    rig.stations[STRANGE].send(FRAME, 0)
    rig.run(until_counts=rig.bits(32 * (FAILED_BITS + 8)))
    assert rig.bus.error_frames == 32
    assert rig.stations[STRANGE].state is ErrorState.BUS_OFF
    assert [rig.stations[i].errors.receive_errors for i in (HOST, TUNED)] == [32, 32]
    assert rig.bus.frames == 0
    rig.stations[HOST].send(FRAME, rig.bits(32 * (FAILED_BITS + 8)))
    rig.run(until_counts=rig.bits(34 * (FAILED_BITS + 8)))
    assert [frame for _, frame in rig.heard[TUNED]] == [FRAME]


def test_a_frame_that_only_strange_stations_could_acknowledge_is_not_acknowledged() -> None:
    rig = BusRig(stations=2)
    rig.stations[1].tune(250_000)
    rig.stations[0].send(FRAME, 0)
    rig.run(until_counts=rig.bits(100 * FAILED_BITS))
    assert rig.bus.frames == 0
    assert rig.stations[0].state is ErrorState.PASSIVE
    assert rig.stations[0].errors.transmit_errors == 128
    rig.stations[1].tune(1_000_000)
    rig.run()
    assert [frame for _, frame in rig.heard[1]] == [FRAME]


def test_the_host_changes_the_bus_to_its_own_rate() -> None:
    rig = rig_with_a_strange_station()
    rig.bus.set_host_bitrate(rig.stations[HOST], 500_000)
    assert rig.bus.bitrate == 1_000_000
    rig.bus.throw_off(rig.stations[TUNED], 0)
    rig.stations[HOST].send(FRAME, 0)
    rig.run(until_counts=100 * 144)
    assert rig.bus.log_counts[0] == (frame_bits(FRAME) - 4) * 144
    assert [frame for _, frame in rig.heard[STRANGE]] == [FRAME]


def test_a_silent_station_neither_hears_nor_acknowledges_nor_destroys() -> None:
    rig = BusRig(stations=2)
    rig.stations[1].fall_silent()
    rig.stations[1].send(Frame(0x100, b""), 0)
    rig.stations[0].send(FRAME, 0)
    rig.run(until_counts=rig.bits(40 * FAILED_BITS))
    assert (rig.bus.frames, rig.heard[1]) == (0, [])
    assert (rig.errors[0][1:], len(rig.errors)) == ((0, ErrorCode.CAN_ERROR_PASSIVE, True), 1)
    rig.stations[1].tune(None)
    rig.run()
    assert {frame for _, frame in rig.heard[0] + rig.heard[1]} == {FRAME, Frame(0x100, b"")}


def test_a_silent_station_hears_frames_but_neither_acknowledges_nor_destroys_them() -> None:
    rig = BusRig(stations=3)
    rig.stations[STRANGE].silent = True
    rig.stations[STRANGE].tune(500_000)
    rig.stations[HOST].send(FRAME, 0)
    rig.run()
    assert (rig.bus.error_frames, [frame for _, frame in rig.heard[TUNED]]) == (0, [FRAME])
    pair = BusRig(stations=2)
    pair.stations[TUNED].silent = True
    pair.stations[TUNED].tune(None)
    pair.stations[HOST].send(FRAME, 0)
    pair.run(until_counts=pair.bits(1000))
    assert pair.heard[TUNED] == []
    assert pair.stations[HOST].errors.transmit_errors > 0
