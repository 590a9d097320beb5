"""The chip's bxCAN as a station on the emulated bus: frames, bit rates, silence, errors, bus-off and recovery."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, Final

import pytest

from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.bus.can_controller import CanController
from steptwin.features.stm32.can_node import ImageStation
from steptwin.features.stm32.chip import can
from steptwin.protocol.frame import Frame
from tests.features.stm32.conftest import Bench

_MCR, _MSR, _TSR, _RF0R, _RF1R, _IER, _ESR, _BTR = (can.CAN + 4 * word for word in range(8))
_MAILBOX, _RECEIVED, _FMR = can.CAN + 0x180, can.CAN + 0x1B0, can.CAN + 0x200
_1M: Final = 0x001E0001
_BIT_COUNTS: Final = 72


class _Wire:
    """A chip, a host and their bus at 1 Mbit/s."""

    def __init__(self) -> None:
        self.bench = Bench()
        self.bus = Bus(1_000_000)
        self.heard: list[Frame] = []
        self.host = CanController(lambda frame, _: self.heard.append(frame))
        firmware: Any = SimpleNamespace(chip=self.bench.chip, clock=None)
        self.station = ImageStation(firmware)
        self.bus.attach(self.host)
        self.bus.attach(self.station)

    @property
    def now_counts(self) -> int:
        return self.bench.chip.now_counts

    def begin(self, *, timing: int = _1M, control: int = 0) -> None:
        """Let the chip enter normal mode and pass all frames to FIFO 0."""
        bench = self.bench
        bench.write(_MCR, can.INRQ)
        bench.write(_BTR, timing)
        for at, value in ((_FMR, 1), (can.CAN + 0x20C, 1), (can.CAN + 0x21C, 1), (_FMR, 0)):
            bench.write(at, value)
        bench.write(_MCR, control)
        self.run(20 * _BIT_COUNTS)

    def run(self, counts: int) -> None:
        """Let time pass for bus and chip."""
        end = self.now_counts + counts
        self.station.follow(self.now_counts)
        while self.now_counts < end:
            event = self.bus.next_event_counts
            self.bench.chip.run(max(min(end if event is None else event, end), self.now_counts))
            self.bus.step(self.now_counts)
            self.station.follow(self.now_counts)

    def request(self, mailbox: int, cob_id: int, data: bytes = b"") -> None:
        """Let the chip request a frame."""
        place = _MAILBOX + 16 * mailbox
        self.bench.write(place + 4, len(data))
        self.bench.write(place + 8, int.from_bytes(data[:4], "little"))
        self.bench.write(place + 12, int.from_bytes(data[4:], "little"))
        self.bench.write(place, cob_id << 21 | 1)

    def counters(self) -> tuple[int, int]:
        """Return TEC and REC."""
        value = self.bench.read(_ESR)
        return value >> 16 & 0xFF, value >> 24


@pytest.fixture
def wire() -> Iterator[_Wire]:
    """Return a chip that is off the bus yet."""
    made = _Wire()
    yield made
    made.bench.chip.close()


def test_frames_go_out_by_identifier_and_come_in_with_their_data(wire: _Wire) -> None:
    wire.begin()
    wire.request(0, 0x300, b"\x01")
    wire.request(1, 0x123, bytes(range(8)))
    wire.host.send(Frame(0x200, b"\xaa\xbb\xcc\xdd\xee"), wire.now_counts)
    wire.run(500 * _BIT_COUNTS)
    assert wire.bus.log_frames == [
        Frame(0x123, bytes(range(8))),
        Frame(0x200, b"\xaa\xbb\xcc\xdd\xee"),
        Frame(0x300, b"\x01"),
    ]
    assert wire.heard == [wire.bus.log_frames[0], wire.bus.log_frames[2]]
    # mailbox 0 has lost the arbitration to the host once, which RQCP's next request clears
    assert wire.bench.read(_TSR) & 0xFFFF == 0x0303
    assert [wire.bench.read(_RECEIVED + at) for at in (0, 4, 8, 12)] == [0x200 << 21, 5, 0xDDCCBBAA, 0xEE]


def test_a_frame_is_not_repeated_with_nart_after_a_lost_arbitration(wire: _Wire) -> None:
    wire.begin(control=can.NART)
    wire.host.send(Frame(0x100, b""), wire.now_counts)
    wire.request(0, 0x300)
    wire.run(500 * _BIT_COUNTS)
    assert wire.bus.log_frames == [Frame(0x100, b"")]
    assert wire.bench.read(_TSR) & 0xFF == can.RQCP | can.ALST


def test_time_stamps_are_bit_times_of_the_beginning(wire: _Wire) -> None:
    wire.begin(control=can.TTCM)
    stamps = []
    for _ in range(2):
        wire.host.send(Frame(0x100, b""), wire.now_counts)
        wire.run(200 * _BIT_COUNTS)
        stamps.append(wire.bench.read(_RECEIVED + 4) >> 16)
        wire.bench.write(_RF0R, can.RFOM)
    assert stamps[1] - stamps[0] == pytest.approx(200, abs=1)


@pytest.mark.parametrize(
    ("timing", "rate"),
    [
        (_1M, 1_000_000),
        (0x00050008, 500_000),
        (0x001C0003, 562_500),  # 12 % off 500 kbit/s
    ],
)
def test_the_bit_rate_is_that_of_btr_and_pclk1(wire: _Wire, timing: int, rate: int) -> None:
    wire.bench.write(_MCR, can.INRQ)
    wire.bench.write(_BTR, timing)
    assert wire.station.rate_of(wire.bench.chip.cells) == rate


def test_a_rate_within_the_tolerance_of_the_segments_is_that_of_the_bus(wire: _Wire) -> None:
    wire.bench.write(_MCR, can.INRQ)
    # 7 quanta with SJW = 1 may be off by 1 / 70: 36 MHz / (7 * 41) is 0.35 % off 125 kbit/s, 36 MHz / (7 * 40) 2.9 %
    for timing, rate in ((0x00130028, 125_000), (0x00130027, 128_571)):
        wire.bench.write(_BTR, timing)
        assert wire.station.rate_of(wire.bench.chip.cells) == rate


def test_a_wrong_bit_rate_gives_errors_and_a_sentence(wire: _Wire) -> None:
    wire.begin(timing=0x00050008)
    wire.request(0, 0x123)
    wire.host.send(Frame(0x200, b""), wire.now_counts)
    wire.run(20_000 * _BIT_COUNTS)
    assert wire.bus.log_frames == []
    assert wire.bench.read(_ESR) & can.BOFF
    assert wire.station.error(1_000_000) == (
        "CAN: BTR = 0x00050008 makes 500000 bit/s of PCLK1 = 36 MHz; the bus has 1000000 bit/s, so no frame can be sent"
        " or received"
    )


def test_an_unacknowledged_frame_counts_to_error_passive_with_lec(wire: _Wire) -> None:
    wire.host.power_down()
    wire.begin()
    wire.bus.exchange(wire.host, wire.host, wire.now_counts)
    wire.request(0, 0x123)
    wire.run(60 * _BIT_COUNTS)
    assert wire.counters() == (8, 0)
    wire.run(20_000 * _BIT_COUNTS)
    assert wire.counters() == (128, 0)  # no further in error passive: it may be alone
    assert wire.bench.read(_ESR) & 0x77 == can.EPVF | can.EWGF | can.ACKNOWLEDGE_ERROR << 4
    assert wire.bench.read(_TSR) & 0xFF == can.TERR


def test_a_silent_controller_hears_but_acknowledges_nothing(wire: _Wire) -> None:
    wire.begin(timing=can.SILM | _1M)
    wire.host.send(Frame(0x200, b""), wire.now_counts)
    wire.request(0, 0x123)
    wire.run(1000 * _BIT_COUNTS)
    assert wire.bus.log_frames == []
    other = CanController(lambda *_: None)
    wire.bus.attach(other)
    wire.run(1000 * _BIT_COUNTS)
    assert wire.bus.log_frames == [Frame(0x200, b"")]
    assert wire.bench.read(_RF0R) & 3 == 1
    assert wire.bench.read(_TSR) >> 26 & 1 == 0


@pytest.mark.parametrize("automatic", [True, False])
def test_bus_off_ends_after_128_sequences_by_itself_or_after_initialisation(wire: _Wire, automatic: bool) -> None:
    wire.begin(control=can.ABOM if automatic else 0)
    wire.bus.throw_off(wire.station, wire.now_counts)
    assert wire.bench.read(_ESR) & can.BOFF
    assert wire.station.error(1_000_000) == "CAN: the controller went into bus-off, 1 times"
    recovery_counts = 128 * 11 * _BIT_COUNTS
    wire.request(0, 0x123)
    wire.run(recovery_counts - 20 * _BIT_COUNTS)
    assert wire.bench.read(_ESR) & can.BOFF
    wire.run(200 * _BIT_COUNTS)
    assert bool(wire.bench.read(_ESR) & can.BOFF) is not automatic
    if not automatic:
        wire.bench.write(_MCR, can.INRQ)
        wire.run(10)
        wire.bench.write(_MCR, 0)
        wire.run(recovery_counts + 500 * _BIT_COUNTS)
        assert not wire.bench.read(_ESR) & can.BOFF
    assert wire.bus.log_frames == [Frame(0x123, b"")]
