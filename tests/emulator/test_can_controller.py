"""bxCAN: three mailboxes, two FIFOs of three messages, fault confinement."""

import pytest

from controller.backend import Kernel
from emulator.board import Board, BoardConfig
from emulator.bus import Bus
from emulator.can_controller import CanController
from emulator.fault_confinement import ErrorState, FaultConfinement
from emulator.simulation import Simulation
from protocol.cia402 import ErrorCode
from protocol.frame import Frame

MS = 72_000
LATENCY = 5 * MS


class Station:
    """A controller with a bus, a partner, and a note of what it says to its processor."""

    def __init__(self, read_latency_counts: int = 0) -> None:
        self.heard: list[tuple[int, Frame]] = []
        self.errors: list[tuple[int, ErrorCode, bool]] = []
        self.can = CanController(
            lambda frame, counts: self.heard.append((counts, frame)),
            self._note_error,
            lambda cob_id: cob_id != 0x7FF,
            read_latency_counts,
        )
        self.partner = CanController(lambda _frame, _counts: None)
        self.bus = Bus(1_000_000)
        self.bus.attach(self.can)
        self.bus.attach(self.partner)

    def _note_error(self, code: ErrorCode, counts: int, *, active: bool) -> None:
        self.errors.append((counts, code, active))

    def run(self) -> None:
        while (now := self.bus.next_event_counts) is not None:
            self.bus.step(now)

    @property
    def passed(self) -> list[int]:
        return [frame.cob_id for frame in self.bus.log_frames]


def test_mailboxes_go_by_identifier_and_the_queue_by_age() -> None:
    """0x100 comes too late for a mailbox: it waits behind 0x500, although it would win every arbitration."""
    station = Station()
    for cob_id in (0x400, 0x300, 0x600, 0x500, 0x100):
        station.can.send(Frame(cob_id, b""), 0)
    assert [frame.cob_id for frame in station.can.mailboxes] == [0x300, 0x400, 0x600]
    station.run()
    assert station.passed == [0x300, 0x400, 0x100, 0x500, 0x600]


def test_frames_of_one_identifier_keep_their_order() -> None:
    station = Station()
    for byte in range(5):
        station.can.send(Frame(0x300, bytes((9 - byte,))), 0)
    station.run()
    assert [frame.data[0] for frame in station.bus.log_frames] == [9, 8, 7, 6, 5]


def test_without_latency_nothing_is_stored() -> None:
    station = Station()
    for cob_id in range(0x200, 0x210):
        station.partner.send(Frame(cob_id, b""), 0)
    station.run()
    assert [counts for counts, _ in station.heard] == list(station.bus.log_counts)
    assert station.can.overruns == 0


def test_what_the_filter_does_not_pass_takes_no_place() -> None:
    station = Station(LATENCY)
    station.partner.send(Frame(0x7FF, b""), 0)
    station.run()
    assert station.can.next_due_counts is None


def test_a_late_processor_finds_three_messages_in_each_fifo() -> None:
    """SDO requests have a FIFO of their own; the first messages stay, the fourth is lost; told once for each FIFO."""
    station = Station(LATENCY)
    for cob_id in (0x200, 0x201, 0x202, 0x203, 0x204, 0x610, 0x611):
        station.partner.send(Frame(cob_id, b""), 0)
    station.run()
    due = station.bus.log_counts[0] + LATENCY
    assert station.can.next_due_counts == due
    station.can.poll(due - 1)
    assert station.heard == []
    station.can.poll(due)
    assert [frame.cob_id for _, frame in station.heard] == [0x200, 0x201, 0x202, 0x610, 0x611]
    assert station.errors == [(due, ErrorCode.CAN_OVERRUN, True)]
    assert station.can.overruns == 2
    assert station.can.next_due_counts is None


def test_states_follow_from_the_counters() -> None:
    errors = FaultConfinement()
    states = {}
    for _ in range(32):
        errors.sending_failed()
        states[errors.transmit_errors] = errors.state
    assert states[88] is ErrorState.ACTIVE
    assert states[96] is states[120] is ErrorState.WARNING
    assert states[128] is states[248] is ErrorState.PASSIVE
    assert states[256] is ErrorState.BUS_OFF


def test_receivers_never_leave_the_bus_and_recover_by_one_good_frame() -> None:
    errors = FaultConfinement()
    for _ in range(1000):
        errors.receiving_failed()
    assert errors.state is ErrorState.PASSIVE
    errors.received()
    assert (errors.receive_errors, errors.state) == (120, ErrorState.WARNING)
    errors.received()
    assert errors.receive_errors == 119


def test_a_passive_sender_without_acknowledge_counts_no_further() -> None:
    errors = FaultConfinement()
    for _ in range(100):
        errors.sending_failed(acknowledged=False)
    assert errors.transmit_errors == 128
    errors.sent()
    assert errors.state is ErrorState.WARNING


# --- what the firmware makes of it


def emergencies(simulation: Simulation, node: int) -> list[bytes]:
    return [frame.data for frame in simulation.bus.log_frames if frame.cob_id == 0x080 + node]


def simulation_with(kernel: Kernel, read_latency_counts: int = 0) -> Simulation:
    config = BoardConfig(2, (330.0, 330.0), read_latency_counts=read_latency_counts)
    return Simulation([Board(config, kernel)], Bus(1_000_000))


def payload(code: ErrorCode) -> bytes:
    return code.to_bytes(2, "little") + b"\x11" + bytes(5)


def test_an_overrun_is_reported_once_by_every_node(fast_kernel: Kernel) -> None:
    simulation = simulation_with(fast_kernel, read_latency_counts=LATENCY)
    simulation.run_until(10 * MS)
    for _ in range(8):
        simulation.host.send(Frame(0x000, b"\x01\x00"), simulation.now_counts)
    simulation.run_until(30 * MS)
    assert simulation.boards[0].can.overruns == 5
    for node in (0x10, 0x11):
        assert emergencies(simulation, node) == [payload(ErrorCode.CAN_OVERRUN)]


def test_an_answer_has_arrived_when_send_returns_however_late_the_processor(fast_kernel: Kernel) -> None:
    simulation = simulation_with(fast_kernel, read_latency_counts=LATENCY)
    heard: list[Frame] = []
    simulation.on_frame = lambda frame, _: heard.append(frame)
    simulation.send(Frame(0x610, bytes.fromhex("4000100000000000")))
    assert heard[-1] == Frame(0x590, bytes.fromhex("4300100092010400"))


@pytest.mark.parametrize("latency_us", [0, 20, 100])
def test_a_processor_in_time_never_overruns(fast_kernel: Kernel, latency_us: int) -> None:
    simulation = simulation_with(fast_kernel, read_latency_counts=72 * latency_us)
    for _ in range(100):
        simulation.host.send(Frame(0x000, b"\x01\x00"), simulation.now_counts)
    simulation.run_until(20 * MS)
    assert simulation.boards[0].can.overruns == 0


def test_error_passive_is_reported(fast_kernel: Kernel) -> None:
    simulation = simulation_with(fast_kernel)
    simulation.run_until(10 * MS)
    for _ in range(128):
        simulation.boards[0].can.receiving_failed(simulation.now_counts)
    simulation.run_until(20 * MS)
    assert emergencies(simulation, 0x10) == emergencies(simulation, 0x11) == [payload(ErrorCode.CAN_ERROR_PASSIVE)]
