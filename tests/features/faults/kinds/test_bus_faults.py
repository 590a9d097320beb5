"""Faults of the bus: the attempts that they strike, and their effects."""

import pytest

from steptwin.emulator.bus.can_controller import ErrorState
from steptwin.emulator.bus.can_timing import frame_bits
from steptwin.emulator.bus.frame_filter import FiltersInForce
from steptwin.features.faults.kinds.bus import (
    BusFault,
    FrameCorruption,
    FrameDelay,
    FrameDuplicate,
    FrameLoss,
    SenderOff,
)
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.frame import Frame
from tests.emulator.bus.bus_rig import BusRig
from tests.messages import refusing

FRAME = Frame(0x200, b"\x55")
BITS = frame_bits(FRAME)
ERROR_BITS = BITS - 13 + 7 + 8 + 3
"""Bits of a disturbed frame: up to the end of the CRC, then error flag and echo, delimiter, intermission."""


def rig_with(*faults: BusFault, stations: int = 2) -> BusRig:
    return BusRig(stations=stations, faults=faults)


def test_a_loss_is_acknowledged_but_not_heard() -> None:
    rig = rig_with(FrameLoss((0x200,), skip=1, count=1))
    for byte in range(3):
        rig.stations[0].send(Frame(0x200, bytes((byte,))), 0)
    rig.run()
    assert [frame.data[0] for _, frame in rig.heard[1]] == [0, 2]
    assert [frame.data[0] for frame in rig.bus.log_frames] == [0, 1, 2]


def test_a_loss_may_concern_one_receiver_only() -> None:
    rig = rig_with(FrameLoss(receiver=2), stations=4)
    rig.stations[0].send(FRAME, 0)
    rig.run()
    assert [len(frames) for frames in rig.heard] == [0, 1, 0, 1]


def test_a_disturbed_frame_costs_an_error_frame_and_is_sent_again() -> None:
    rig = rig_with(FrameCorruption(count=2), stations=3)
    rig.stations[0].send(FRAME, 0)
    rig.run()
    assert rig.heard[1] == rig.heard[2] == [(rig.bits(2 * ERROR_BITS + BITS - 4), FRAME)]
    assert rig.bus.busy_bits == 2 * ERROR_BITS + BITS
    assert rig.bus.error_frames == 2
    assert rig.stations[0].errors.transmit_errors == 2 * 8 - 1
    assert rig.stations[1].errors.receive_errors == 2 - 1
    assert rig.bus.log_frames == [FRAME]


def test_a_doubled_frame_is_heard_twice_and_sent_once_for_its_sender() -> None:
    """The error flag, echo and delimiter follow the end of frame; then it is sent again."""
    rig = rig_with(FrameDuplicate(), stations=3)
    sent: list[int] = []
    rig.stations[0].on_sent = lambda _, counts: sent.append(counts)
    rig.stations[0].send(FRAME, 0)
    rig.run()
    first, second = (rig.bits(begin + BITS - 4) for begin in (0, BITS + 7 + 8))
    assert rig.heard[1] == rig.heard[2] == [(first, FRAME), (second, FRAME)]
    assert sent == [second]
    assert rig.stations[0].errors.transmit_errors == 8 - 1
    assert rig.stations[1].errors.receive_errors == 0
    assert (rig.bus.frames, rig.bus.error_frames, rig.bus.busy_bits) == (2, 1, 2 * BITS + 15)
    assert rig.bus.log_frames == [FRAME, FRAME]


def test_a_frame_that_nobody_takes_is_not_doubled() -> None:
    rig = rig_with(FrameDuplicate(count=1), stations=1)
    rig.stations[0].send(FRAME, 0)
    rig.run(rig.bits(BITS))
    assert (rig.bus.frames, rig.stations[0].mailboxes) == (0, [FRAME])


class TestThrownOff:
    """A station leaves the bus at any instant, and sends its frame after 128 times 11 recessive bits."""

    @pytest.mark.parametrize("bits", [0, 20, BITS - 14])
    def test_a_frame_that_it_was_sending_breaks_off(self, bits: int) -> None:
        rig = rig_with(stations=3)
        rig.stations[0].send(FRAME, 0)
        rig.bus.step(0)
        rig.bus.throw_off(rig.stations[0], rig.bits(bits))
        assert not rig.stations[0].on_bus
        rig.run()
        assert rig.bus.log_frames == [FRAME]
        assert rig.bus.error_frames == 1
        assert rig.bus.log_counts[0] == rig.bits(bits + 12 + 127 * 11 + 11 + BITS - 4)
        assert rig.stations[1].errors.receive_errors == 0

    def test_another_stations_frame_does_not_reach_it(self) -> None:
        rig = rig_with(stations=3)
        rig.stations[0].send(FRAME, 0)
        rig.bus.step(0)
        rig.bus.throw_off(rig.stations[1], rig.bits(20))
        rig.run()
        assert [len(frames) for frames in rig.heard] == [0, 0, 1]
        assert rig.stations[1].on_bus

    def test_one_that_is_off_already_stays_so_no_longer(self) -> None:
        returns = []
        for again in (False, True):
            rig = rig_with(stations=3)
            rig.bus.throw_off(rig.stations[0], 0)
            if again:
                rig.bus.throw_off(rig.stations[0], rig.bits(500))
            rig.run()
            returns.append([error[0] for error in rig.errors if error[2] is ErrorCode.CAN_BUS_OFF_RECOVERED])
        assert returns[0] == returns[1] == [[rig.bits(128 * 11)][0]]


def test_a_lower_identifier_goes_before_a_repetition() -> None:
    rig = rig_with(FrameCorruption((0x200,), count=1))
    rig.stations[0].send(FRAME, 0)
    rig.bus.step(0)
    rig.stations[1].send(Frame(0x100, b""), 1)
    rig.run()
    assert rig.bus.log_frames == [Frame(0x100, b""), FRAME]


def test_32_disturbances_in_a_row_throw_the_sender_off() -> None:
    """A passive sender pauses 8 bits more; the 128 x 11 recessive bits begin with its last error delimiter."""
    rig = rig_with(FrameCorruption(count=32))
    rig.stations[0].send(FRAME, 0)
    rig.run()
    passive = rig.bits(16 * ERROR_BITS - 11)
    off = rig.bits(32 * ERROR_BITS + 16 * 8 - 11)
    back = off + rig.bits(128 * 11)
    sent = back + rig.bits(BITS - 4)
    assert [error for error in rig.errors if error[1] == 0] == [
        (passive, 0, ErrorCode.CAN_ERROR_PASSIVE, True),
        (back, 0, ErrorCode.CAN_BUS_OFF_RECOVERED, True),
        (back, 0, ErrorCode.CAN_ERROR_PASSIVE, False),
        (sent, 0, ErrorCode.CAN_BUS_OFF_RECOVERED, False),
    ]
    assert rig.heard[1] == [(sent, FRAME)]
    assert rig.stations[0].errors.transmit_errors == 0


def test_a_sender_thrown_off_sends_when_it_is_back() -> None:
    rig = rig_with(SenderOff((0x200,), count=1))
    rig.stations[0].send(FRAME, 0)
    rig.bus.step(0)
    assert rig.stations[0].state is ErrorState.BUS_OFF
    assert rig.bus.busy
    rig.run()
    assert not rig.bus.busy
    assert rig.heard[1] == [(rig.bits(128 * 11 + BITS - 4), FRAME)]


def test_a_delay_holds_up_its_sender_once() -> None:
    rig = rig_with(FrameDelay((0x200,), delay_counts=1_000_000))
    rig.stations[0].send(FRAME, 0)
    rig.stations[0].send(Frame(0x201, b""), 0)
    rig.stations[1].send(Frame(0x300, b""), 0)
    rig.run()
    assert rig.bus.log_frames == [Frame(0x300, b""), FRAME, Frame(0x201, b"")]
    assert rig.bus.log_counts[1] == 1_000_000 + rig.bits(BITS - 4)


@pytest.mark.parametrize("all_faults", [False, True])
def test_the_end_of_a_delay_lets_its_sender_go(*, all_faults: bool) -> None:
    """It waits for the pause of an error passive station at most, 8 bits."""
    day = FrameDelay((0x200,), delay_counts=86_400 * 72_000_000)
    rig = rig_with(day)
    rig.stations[0].send(FRAME, 0)
    rig.run(1_000_000)
    assert rig.bus.log_frames == []
    if all_faults:
        rig.bus.end_filters(1_000_000)
    else:
        rig.bus.end_filter(day, 1_000_000)
    rig.run()
    assert rig.bus.log_frames == [FRAME]
    assert rig.bus.log_counts[0] == 1_000_000 + rig.bits(BITS - 4 + 8)


def test_the_end_of_another_fault_leaves_a_delay() -> None:
    delay, loss = FrameDelay((0x200,), delay_counts=1_000_000), FrameLoss((0x300,))
    rig = rig_with(delay, loss)
    rig.stations[0].send(FRAME, 0)
    rig.run(1000)
    rig.bus.end_filter(loss, 1000)
    rig.run()
    assert rig.bus.log_counts[0] == 1_000_000 + rig.bits(BITS - 4)


def test_a_fault_strikes_from_its_beginning_to_its_end() -> None:
    """The end is that of the very fault, not of an equal one."""
    faults, fault = FiltersInForce(), FrameLoss()
    struck = []
    for counts in range(0, 300, 50):
        if counts == 100:
            faults.begin(fault)
        faults.end(FrameLoss() if counts < 200 else fault)
        if faults.strike(FRAME, counts):
            struck.append(counts)
    assert struck == [100, 150]
    assert faults.struck == [(counts, fault, FRAME) for counts in struck]


def test_a_rate_is_drawn_from_the_seed() -> None:
    def strikes(seed: int) -> list[bool]:
        faults = FiltersInForce()
        faults.reseed(seed)
        faults.begin(FrameLoss(rate=0.3))
        return [faults.strike(FRAME, 0) is not None for _ in range(1000)]

    assert strikes(1) == strikes(1) != strikes(2)
    assert 250 < sum(strikes(1)) < 350


def test_impossible_rates_and_delays_are_refused() -> None:
    with refusing(ValueError):
        FrameLoss(rate=1.5)
    with refusing(ValueError):
        FrameDelay(delay_counts=0)
