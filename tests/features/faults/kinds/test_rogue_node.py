"""Stations that are no part of the machine: a second master, a babbling node, and controllers thrown off the bus."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.bus.can_timing import frame_bits
from steptwin.emulator.operations import Scheduled
from steptwin.emulator.simulation import BusOverloadError, Simulation
from steptwin.features.faults.kinds.bus import Babble, BusOff, BusRepair, RogueFrame
from steptwin.protocol import od
from steptwin.protocol.cia402 import AbortConnection, ErrorCode, State
from steptwin.protocol.frame import COB_EMCY, COB_NMT, COB_SYNC, Frame
from steptwin.protocol.nmt import NmtState
from steptwin.protocol.pvt import PvtRecord
from tests.emulator.pins import WIRES
from tests.emulator.simulations import MS, STEP, wait
from tests.messages import refusing

NODE = 0x10
NOTHING = Frame(COB_NMT, bytes(8))
"""A frame that wins each arbitration and that nobody obeys."""
OTHER = Frame(0x7FF, bytes(8))


class Rig:
    """A board of one axis that begins a motion of 80 ms: 40 steps in two records of 40 ms."""

    def __init__(self, kernel: Kernel, bitrate: int = 1_000_000) -> None:
        self.board = Board(BoardConfig((WIRES,)), kernel)
        self.simulation = Simulation([self.board], Bus(bitrate))
        wait(self.simulation, 5)
        self.simulation.send(Frame(COB_NMT, b"\x01\x00"))
        for word in (0x06, 0x07, 0x0F):
            self.simulation.send(Frame(0x200 + NODE, bytes((word, 0, 7))))
        self.simulation.send(record(0, 64 * STEP // 2))
        for cob_id, data in ((0x300 + NODE, b"\x1f\x00"), (COB_SYNC, b"")):
            self.simulation.send(Frame(cob_id, data))

    @property
    def state(self) -> State:
        return self.board.firmware.nodes[0].drive.state

    def emergencies(self) -> list[int]:
        frames = self.simulation.bus.log_frames
        return [int.from_bytes(frame.data[:2], "little") for frame in frames if frame.cob_id == COB_EMCY + NODE]


def record(sequence: int, velocity: int) -> Frame:
    return Frame(0x500 + NODE, PvtRecord(20 * STEP, velocity, 40, sequence).encode())


@pytest.fixture
def rig(fast_kernel: Kernel) -> Rig:
    return Rig(fast_kernel)


class TestBabble:
    @pytest.mark.parametrize(("for_ms", "codes"), [(36, []), (44, [ErrorCode.PVT_UNDERRUN])])
    def test_that_outlasts_the_queue_is_an_underrun(self, rig: Rig, for_ms: int, codes: list[ErrorCode]) -> None:
        """The host's next record waits for the bus; the motion in execution ends 40 ms after its start."""
        begin = rig.simulation.now_counts
        rig.simulation.operate(Babble(NOTHING, 100, for_ms * 10))
        rig.simulation.host.send(record(1, 0), begin)
        wait(rig.simulation, 200)
        log = zip(rig.simulation.bus.log_counts, rig.simulation.bus.log_frames, strict=True)
        came = next(counts for counts, frame in log if frame == record(1, 0))
        assert came - begin == pytest.approx(for_ms * MS, abs=MS)
        assert rig.emergencies() == codes
        assert rig.state is (State.FAULT if codes else State.OPERATION_ENABLED)
        if not codes:
            assert rig.board.position_steps(0) == 40

    def test_leaves_no_gap_and_ends_by_itself(self, rig: Rig) -> None:
        wait(rig.simulation, 100)
        frames = len(rig.simulation.bus.log_frames)
        busy_bits, now = rig.simulation.bus.busy_bits, rig.simulation.now_counts
        rig.simulation.operate(Babble(Frame(0x7FF, bytes(8)), 47, 1000))
        wait(rig.simulation, 40)
        bits = (rig.simulation.now_counts - now) // rig.simulation.bus.bit_counts
        assert rig.simulation.bus.busy_bits - busy_bits == pytest.approx(bits, abs=200)
        wait(rig.simulation, 60)
        sent = [frame for frame in rig.simulation.bus.log_frames[frames:] if frame.cob_id == 0x7FF]
        assert len(sent) == pytest.approx(47_000 / frame_bits(sent[0]), abs=3)

    def test_without_end_is_an_overloaded_bus(self, fast_kernel: Kernel) -> None:
        rig = Rig(fast_kernel, 125_000)
        rig.simulation.operate(Babble(NOTHING, 900, 10_000))
        with refusing(BusOverloadError):
            rig.simulation.send(Frame(0x7FF, b""))

    def test_ends_with_the_bus_repair(self, rig: Rig) -> None:
        rig.simulation.operate(Babble(NOTHING, 100, 1_000_000))
        rig.simulation.operate(Babble(OTHER, 100, 1_000_000))
        wait(rig.simulation, 10)
        rig.simulation.operate(BusRepair())
        wait(rig.simulation, 2)
        self.is_silent(rig)

    def test_ends_by_its_own_end_and_no_other_does(self, rig: Rig) -> None:
        rig.simulation.operate(Babble(NOTHING, 100, 1_000_000))
        rig.simulation.operate(Babble(OTHER, 100, 1_000_000))
        wait(rig.simulation, 10)
        rig.simulation.operate(Babble(NOTHING, 100, 0))
        wait(rig.simulation, 2)
        frames = len(rig.simulation.bus.log_frames)
        wait(rig.simulation, 10)
        assert {frame for frame in rig.simulation.bus.log_frames[frames:] if frame in (NOTHING, OTHER)} == {OTHER}
        rig.simulation.operate(Babble(OTHER, 100, 0))
        wait(rig.simulation, 2)
        self.is_silent(rig)

    def test_one_that_is_to_come_is_not_ended(self, rig: Rig) -> None:
        begins = rig.simulation.now_counts + 10 * MS
        rig.simulation.schedule([Scheduled(begins, Babble(NOTHING, 100, 20))])
        rig.simulation.operate(BusRepair())
        wait(rig.simulation, 20)
        assert rig.simulation.bus.log_frames.count(NOTHING) > 10

    @staticmethod
    def is_silent(rig: Rig) -> None:
        frames = len(rig.simulation.bus.log_frames)
        wait(rig.simulation, 200)
        assert not {NOTHING, OTHER} & {*rig.simulation.bus.log_frames[frames:]}

    @pytest.mark.parametrize(
        ("period_us", "count"),
        [
            (46, 1),
            (10_000_001, 1),
            (47, -1),
            (47, 1_000_001),
        ],
    )
    def test_impossible_ones_are_refused(self, period_us: int, count: int) -> None:
        Babble(NOTHING, 47, 1_000_000)
        Babble(NOTHING, 10_000_000, 1)
        with refusing(ValueError):
            Babble(NOTHING, period_us, count)


class TestSecondMaster:
    """A board obeys whoever sends: CANopen has no master's name in its frames."""

    def test_stops_the_drive_by_a_controlword(self, rig: Rig) -> None:
        wait(rig.simulation, 10)
        rig.simulation.operate(RogueFrame(Frame(0x200 + NODE, b"\x02\x00\x07")))
        wait(rig.simulation, 100)
        assert rig.state in (State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED)
        assert 0 < rig.board.position_steps(0) < 40
        assert rig.emergencies() == []

    def test_stops_the_node_by_nmt_and_its_motion_with_it_which_it_tells_later(self, rig: Rig) -> None:
        """A stopped node takes no records and sends no EMCY; it keeps what it has to tell until it is started."""
        rig.simulation.schedule([Scheduled(rig.simulation.now_counts + 10 * MS, RogueFrame(Frame(COB_NMT, b"\2\0")))])
        wait(rig.simulation, 20)
        rig.simulation.send(record(1, 0))
        wait(rig.simulation, 100)
        assert rig.state is State.FAULT
        assert rig.emergencies() == []
        rig.simulation.send(Frame(COB_NMT, b"\x01\x00"))
        wait(rig.simulation, 10)
        assert rig.emergencies() == [ErrorCode.COMMUNICATION]
        assert 0 < rig.board.position_steps(0) < 15

    @pytest.mark.parametrize("frame", [Frame(COB_SYNC, b""), record(0, 64 * STEP // 2)])
    def test_may_repeat_a_sync_or_a_record(self, rig: Rig, frame: Frame) -> None:
        wait(rig.simulation, 10)
        rig.simulation.operate(RogueFrame(frame))
        rig.simulation.send(record(1, 0))
        wait(rig.simulation, 100)
        assert rig.state is State.OPERATION_ENABLED
        assert rig.board.position_steps(0) == 40
        assert rig.emergencies() == []

    def test_is_answered_on_the_identifier_that_the_host_reads_too(self, rig: Rig) -> None:
        heard: list[Frame] = []
        rig.simulation.host.receive = lambda frame, _: heard.append(frame)
        rig.simulation.operate(RogueFrame(Frame(0x600 + NODE, bytes.fromhex("4000100000000000"))))
        wait(rig.simulation, 5)
        assert [frame for frame in heard if frame.cob_id == 0x580 + NODE] == [
            Frame(0x580 + NODE, bytes.fromhex("4300100092010400"))
        ]


class TestBusOff:
    @pytest.mark.parametrize(
        ("option", "state", "steps"),
        [(AbortConnection.NO_ACTION, State.FAULT, (20, 30)), (AbortConnection.FAULT_SIGNAL, State.FAULT, (0, 5))],
    )
    def test_of_the_board_is_told_when_it_is_over(
        self, rig: Rig, option: AbortConnection, state: State, steps: tuple[int, int]
    ) -> None:
        """The host's frame, which nobody acknowledges, is repeated again and again, and each attempt leaves but one
        sequence of recessive bits. Without an action the motion goes on until its queue is empty."""
        rig.board.firmware.nodes[0].dictionary.set(od.ABORT_CONNECTION_OPTION, option)
        now = rig.simulation.now_counts
        rig.simulation.operate(BusOff(0))
        rig.simulation.host.send(record(1, 0), now)
        wait(rig.simulation, 100)
        log = zip(rig.simulation.bus.log_counts, rig.simulation.bus.log_frames, strict=True)
        told = [counts for counts, frame in log if frame.cob_id == COB_EMCY + NODE]
        assert rig.emergencies()[0] == ErrorCode.CAN_BUS_OFF_RECOVERED
        assert 128 * 11 <= (told[0] - now) / rig.simulation.bus.bit_counts < 128 * 150
        assert rig.state is state
        assert steps[0] <= rig.board.position_steps(0) <= steps[1]
        assert rig.board.firmware.nodes[0].nmt_state is NmtState.PRE_OPERATIONAL

    def test_of_the_host_delays_its_frames(self, rig: Rig) -> None:
        now = rig.simulation.now_counts
        rig.simulation.operate(BusOff(None))
        rig.simulation.send(record(1, 0))
        assert (rig.simulation.now_counts - now) / rig.simulation.bus.bit_counts > 128 * 11
        wait(rig.simulation, 100)
        assert (rig.emergencies(), rig.board.position_steps(0)) == ([], 40)
