"""bxCAN: three mailboxes, two FIFOs of three messages, fault confinement."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.bus.can_controller import CanController, ErrorState, FaultConfinement
from steptwin.emulator.simulation import Simulation
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.frame import Frame
from tests.emulator.bus.bus_rig import SenderOff
from tests.emulator.pins import WIRES
from tests.emulator.simulations import MS

LATENCY = 5 * MS


class Station:
    """A controller on a bus with a partner; it notes the messages and errors that its processor gets."""

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


def test_mailboxes_in_order_and_a_call_for_each_frame_sent() -> None:
    sent: list[tuple[int, int]] = []
    can = CanController(
        lambda _frame, _counts: None, on_sent=lambda frame, counts: sent.append((counts, frame.cob_id)), in_order=True
    )
    bus = Bus(1_000_000)
    bus.attach(can)
    bus.attach(CanController(lambda _frame, _counts: None))
    order = [0x400, 0x300, 0x600, 0x300, 0x300, 0x100]
    for cob_id in order:
        can.send(Frame(cob_id, b""), 0)
    while (now := bus.next_event_counts) is not None:
        bus.step(now)
    assert [frame.cob_id for frame in bus.log_frames] == order
    assert sent == list(zip(bus.log_counts, order, strict=True))


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


def test_filtered_messages_take_no_place_in_a_fifo() -> None:
    station = Station(LATENCY)
    station.partner.send(Frame(0x7FF, b""), 0)
    station.run()
    assert station.can.next_due_counts is None


def test_a_late_processor_finds_three_messages_in_each_fifo() -> None:
    """SDO requests have a FIFO of their own; the first three messages stay, the fourth is lost."""
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


@pytest.mark.parametrize(("cob_id", "other"), [(0x200, 0x610), (0x610, 0x200)])
@pytest.mark.parametrize(("messages", "lost"), [(3, 0), (4, 1)])
def test_each_fifo_holds_three(cob_id: int, other: int, messages: int, lost: int) -> None:
    station = Station(LATENCY)
    for _ in range(messages):
        station.partner.send(Frame(cob_id, b""), 0)
    for _ in range(3):
        station.partner.send(Frame(other, b""), 0)
    station.run()
    station.can.poll(2 * LATENCY)
    assert station.can.overruns == lost
    assert [frame.cob_id for _, frame in station.heard] == sorted([cob_id] * 3 + [other] * 3)
    assert [code for _, code, _ in station.errors] == [ErrorCode.CAN_OVERRUN] * lost


def test_an_overrun_is_over_when_the_fifos_are_emptied_without_one() -> None:
    station = Station(LATENCY)
    fetched = []
    for messages in (4, 5, 3, 3):
        for _ in range(messages):
            station.partner.send(Frame(0x200, b""), station.bus.log_counts[-1] if station.bus.log_counts else 0)
        station.run()
        fetched.append(station.can.next_due_counts or 0)
        station.can.poll(fetched[-1])
    assert station.errors == [(fetched[0], ErrorCode.CAN_OVERRUN, True), (fetched[2], ErrorCode.CAN_OVERRUN, False)]
    assert station.can.overruns == 3


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


def test_counters_fall_by_one_with_each_good_frame_and_never_below_zero() -> None:
    errors = FaultConfinement()
    errors.sending_failed()
    errors.receiving_failed()
    for _ in range(2):
        errors.sent()
        errors.received()
    assert (errors.transmit_errors, errors.receive_errors) == (6, 0)
    for _ in range(10):
        errors.sent()
    assert errors.transmit_errors == 0


@pytest.mark.parametrize(
    ("failures", "state", "after_a_good_one"),
    [
        (95, ErrorState.ACTIVE, 94),
        (96, ErrorState.WARNING, 95),
        (127, ErrorState.WARNING, 126),
        (128, ErrorState.PASSIVE, 127),
        (129, ErrorState.PASSIVE, 120),
        (300, ErrorState.PASSIVE, 120),
    ],
)
def test_a_receiver_counts_ones(failures: int, state: ErrorState, after_a_good_one: int) -> None:
    errors = FaultConfinement()
    for _ in range(failures):
        errors.receiving_failed()
    assert errors.state is state
    errors.received()
    assert errors.receive_errors == after_a_good_one


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
    config = BoardConfig((WIRES,) * 2, read_latency_counts=read_latency_counts)
    return Simulation([Board(config, kernel)], Bus(1_000_000))


def payload(code: ErrorCode) -> bytes:
    """Generic and communication error; nothing is left of them with the code 0."""
    return code.to_bytes(2, "little") + (b"\x11" if code else b"\x00") + bytes(5)


def test_an_overrun_is_reported_once_by_every_node_and_over_with_the_next_message(fast_kernel: Kernel) -> None:
    simulation = simulation_with(fast_kernel, read_latency_counts=LATENCY)
    simulation.run_until(10 * MS)
    for _ in range(8):
        simulation.host.send(Frame(0x000, b"\x01\x00"), simulation.now_counts)
    simulation.run_until(30 * MS)
    assert simulation.boards[0].can.overruns == 5
    for node in (0x10, 0x11):
        assert emergencies(simulation, node) == [payload(ErrorCode.CAN_OVERRUN)]
    simulation.send(Frame(0x000, b"\x01\x00"))
    for node in (0x10, 0x11):
        assert emergencies(simulation, node) == [payload(ErrorCode.CAN_OVERRUN), payload(ErrorCode.NONE)]


def test_an_answer_has_arrived_when_send_returns_however_late_the_processor(fast_kernel: Kernel) -> None:
    simulation = simulation_with(fast_kernel, read_latency_counts=LATENCY)
    heard: list[Frame] = []
    simulation.host.receive = lambda frame, _: heard.append(frame)
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
    assert simulation.boards[0].can.state is ErrorState.PASSIVE
    assert simulation.boards[0].firmware.nodes[1].dictionary.read(od.ERROR_REGISTER) == b"\x11"
    simulation.run_until(20 * MS)
    assert emergencies(simulation, 0x10) == emergencies(simulation, 0x11) == [payload(ErrorCode.CAN_ERROR_PASSIVE)]
    simulation.send(Frame(0x000, b"\x01\x00"))
    for node in (0x10, 0x11):
        assert emergencies(simulation, node) == [payload(ErrorCode.CAN_ERROR_PASSIVE), payload(ErrorCode.NONE)]


@pytest.mark.slow
def test_the_way_back_from_bus_off_is_reported(fast_kernel: Kernel) -> None:
    """After it the first frame to pass is the first node's EMCY; with it the error is over."""
    simulation = simulation_with(fast_kernel)
    simulation.run_until(10 * MS)
    before = len(simulation.bus.log_frames)
    simulation.bus.throw_off(simulation.boards[0].can, simulation.now_counts)
    simulation.send(Frame(0x610, bytes.fromhex("4001100000000000")))
    back = 10 * MS + 128 * 11 * simulation.bus.bit_counts
    simulation.run_until(20 * MS)
    assert simulation.bus.log_counts[before] > back
    for node in (0x10, 0x11):
        expected = [payload(ErrorCode.CAN_BUS_OFF_RECOVERED), payload(ErrorCode.NONE)]
        assert emergencies(simulation, node) == expected


def test_send_waits_for_a_board_that_leaves_the_bus_with_its_answer(fast_kernel: Kernel) -> None:
    simulation = Simulation([Board(BoardConfig((WIRES,)), fast_kernel)], Bus(1_000_000))
    simulation.bus.filters.begin(SenderOff((0x590,)))
    simulation.run_until(10 * MS)
    simulation.send(Frame(0x610, bytes.fromhex("4000100000000000")))
    assert Frame(0x590, bytes.fromhex("4300100092010400")) in simulation.bus.log_frames
    assert simulation.now_counts > 10 * MS + 128 * 11 * simulation.bus.bit_counts
