"""Boards with more to send than the bus carries: memory stays flat, SDO is answered, the loss is counted and said."""

from collections.abc import Callable

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.transmit_queue import BURST_FRAMES_MAX, PLACES, QUIET_US, Service
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.bus.can_controller import MAILBOXES
from steptwin.emulator.simulation import Simulation
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Overrun
from steptwin.protocol.emergency import PLACES as EMCY_PLACES
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_ID_INVALID,
    COB_ID_NO_RTR,
    COB_NMT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    COB_SYNC,
    COB_TPDO,
    FIRST_NODE_ID,
    Frame,
)
from steptwin.protocol.nmt import ErrorBehaviour, NmtCommand
from steptwin.protocol.objects import ASYNCHRONOUS
from tests.emulator.pins import WIRES
from tests.emulator.simulations import MS, wait
from tests.operations import EmergencyStop

AXES = 6
NODES = range(FIRST_NODE_ID, FIRST_NODE_ID + AXES)
QUEUE_MAX = AXES * (sum(PLACES.values()) + len(COB_TPDO))
ANSWER_FRAMES_MAX = 2 * (BURST_FRAMES_MAX + MAILBOXES + AXES)
"""Most frames from an SDO request to its answer: a burst before each of them, frames in mailboxes, an EMCY of each."""
ALL_NODES = 0


class Flooded:
    """A board of six axes on a bus, and a host that keeps what it hears."""

    def __init__(self, kernel: Kernel) -> None:
        self.board = Board(BoardConfig((WIRES,) * AXES), kernel)
        self.bus = Bus(1_000_000)
        self.simulation = Simulation([self.board], self.bus)
        self.heard: list[Frame] = []
        self.simulation.host.receive = lambda frame, _: self.heard.append(frame)

    @property
    def waiting(self) -> int:
        return len(self.board.firmware.transmit) + len(self.board.can.mailboxes)

    def value(self, address: int, axis: int = 0) -> int:
        return self.board.firmware.nodes[axis].dictionary.get(address)

    def nmt(self, command: NmtCommand) -> None:
        self.give(Frame(COB_NMT, bytes((command, ALL_NODES))))

    def give(self, frame: Frame) -> None:
        """Leave a frame with the host's controller, which sends it when the bus lets it."""
        self.simulation.host.send(frame, self.simulation.now_counts)

    def set_tpdo(self, node: int, number: int, transmission_type: int, event_timer_ms: int) -> None:
        """Configure a TPDO without inhibit time."""
        place = od.TPDO_COMMUNICATION[number]
        cob_id = COB_ID_NO_RTR | COB_TPDO[number] + node
        for subindex, value in (
            (od.PDO_COB_ID, COB_ID_INVALID | cob_id),
            (od.PDO_TRANSMISSION_TYPE, transmission_type),
            (od.PDO_INHIBIT_TIME, 0),
            (od.PDO_EVENT_TIMER, event_timer_ms),
            (od.PDO_COB_ID, cob_id),
        ):
            size = self.board.firmware.nodes[0].dictionary.entries[od.address_of(place, subindex)].data_type.size
            head = bytes((0x23 | 4 - size << 2,)) + place.to_bytes(2, "little") + bytes((subindex,))
            self.simulation.send(Frame(COB_SDO_REQUEST + node, head + value.to_bytes(4, "little")))

    def answer_frames(self, flood: Callable[[], None]) -> int:
        """Ask for the vendor by SDO amid a flood; return how many frames the board sends up to the answer."""
        before = len(self.bus.log_frames)
        self.give(Frame(COB_SDO_REQUEST + FIRST_NODE_ID, bytes.fromhex("4018100100000000")))
        for _ in range(100):
            flood()
            later = [frame for frame in self.bus.log_frames[before:] if frame.cob_id != COB_SYNC]
            for frames, frame in enumerate(later):
                if frame.cob_id == COB_SDO_RESPONSE + FIRST_NODE_ID:
                    return frames
        pytest.fail("no answer")

    def emergencies(self, axis: int = 0) -> list[tuple[int, int, int]]:
        """Code, register and detail of each EMCY of an axis."""
        cob_id = COB_EMCY + FIRST_NODE_ID + axis
        datas = [frame.data for frame in self.heard if frame.cob_id == cob_id]
        return [(int.from_bytes(data[:2], "little"), data[2], int.from_bytes(data[3:], "little")) for data in datas]


@pytest.fixture
def flooded(fast_kernel: Kernel) -> Flooded:
    flooded = Flooded(fast_kernel)
    wait(flooded.simulation, 10)
    return flooded


OVERRUN = (ErrorCode.CAN_OVERRUN, 0x11, Overrun.TRANSMIT_QUEUE)
OVER = (ErrorCode.NONE, 0, 0)


class TestFastTpdos:
    """24 TPDOs of 1 ms: 24 000 frames a second, on a bus that carries 8600 of them."""

    @pytest.fixture
    def overloaded(self, flooded: Flooded) -> Flooded:
        for node in NODES:
            for number in range(len(COB_TPDO)):
                flooded.set_tpdo(node, number, ASYNCHRONOUS, event_timer_ms=1)
        flooded.nmt(NmtCommand.START)
        wait(flooded.simulation, 50)
        return flooded

    @pytest.mark.slow
    def test_the_queue_is_bounded_and_every_loss_is_counted(self, overloaded: Flooded) -> None:
        def fate() -> int:
            sent = sum(frame.cob_id & 0x780 in COB_TPDO for frame in overloaded.bus.log_frames)
            lost = sum(overloaded.value(od.FRAMES_LOST, axis) for axis in range(AXES))
            return sent + lost + overloaded.waiting

        before = fate()
        for _ in range(3):
            wait(overloaded.simulation, 100)
            assert overloaded.waiting <= AXES * len(COB_TPDO) + MAILBOXES
        assert fate() - before == pytest.approx(300 * AXES * len(COB_TPDO), abs=AXES * len(COB_TPDO))
        assert all(overloaded.value(od.FRAMES_LOST, axis) > 0 for axis in range(AXES))

    @pytest.mark.slow
    def test_sdo_is_answered(self, overloaded: Flooded) -> None:
        for _ in range(5):
            frames = overloaded.answer_frames(lambda: wait(overloaded.simulation, 1))
            assert frames <= ANSWER_FRAMES_MAX

    @pytest.mark.slow
    def test_the_loss_is_an_error_once_and_ends_a_second_after_the_flood(self, overloaded: Flooded) -> None:
        wait(overloaded.simulation, 1100)
        assert [overloaded.emergencies(axis) for axis in range(AXES)] == [[OVERRUN]] * AXES
        overloaded.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        wait(overloaded.simulation, 100)
        quiet_ms = QUIET_US / 1000
        wait(overloaded.simulation, quiet_ms - 103)
        assert overloaded.emergencies() == [OVERRUN]
        wait(overloaded.simulation, 5)
        assert [overloaded.emergencies(axis) for axis in range(AXES)] == [[OVERRUN, OVER]] * AXES
        assert overloaded.value(od.ERROR_REGISTER) == 0


def test_tpdos_that_fit_are_not_lost(flooded: Flooded) -> None:
    """24 TPDOs of 3 ms are 8000 frames a second."""
    for node in NODES:
        for number in range(len(COB_TPDO)):
            flooded.set_tpdo(node, number, ASYNCHRONOUS, event_timer_ms=3)
    flooded.nmt(NmtCommand.START)
    wait(flooded.simulation, 200)
    assert [flooded.value(od.FRAMES_LOST, axis) for axis in range(AXES)] == [0] * AXES
    assert not any(flooded.emergencies(axis) for axis in range(AXES))


def test_a_flood_of_syncs(flooded: Flooded) -> None:
    """A SYNC each 100 us wants six TPDOs, which take 700 us."""
    for node in NODES:
        flooded.set_tpdo(node, 1, 1, event_timer_ms=0)
    flooded.nmt(NmtCommand.START)

    def syncs() -> None:
        for _ in range(10):
            flooded.give(Frame(COB_SYNC, b""))
            wait(flooded.simulation, 0.1)

    syncs()
    for _ in range(5):
        assert flooded.answer_frames(syncs) <= ANSWER_FRAMES_MAX
        assert flooded.waiting <= 3 * AXES
    assert flooded.value(od.FRAMES_LOST) > 100
    assert flooded.emergencies() == [OVERRUN]


@pytest.mark.slow
def test_a_flood_of_resets(flooded: Flooded) -> None:
    """NMT has the best identifier of all: boot-up messages cannot be sent before the last reset."""
    for _ in range(20):
        for _ in range(5):
            flooded.nmt(NmtCommand.RESET_COMMUNICATION)
        wait(flooded.simulation, 0.2)
        assert flooded.waiting <= QUEUE_MAX
    flooded.heard.clear()
    wait(flooded.simulation, 1500)
    for axis, node in enumerate(NODES):
        assert Frame(COB_HEARTBEAT + node, b"\0") in flooded.heard
        assert flooded.emergencies(axis)[-1:] in ([], [OVER])
        assert flooded.value(od.ERROR_REGISTER, axis) == 0


class TestEmergencies:
    """Two RPDOs of other lengths in turn are an error and its end each time; one EMCY a second may be sent."""

    INHIBIT_MS = 1000

    @pytest.fixture
    def errors(self, flooded: Flooded) -> Flooded:
        write_u16 = bytes.fromhex("2B15100010270000")
        flooded.simulation.send(Frame(COB_SDO_REQUEST + FIRST_NODE_ID, write_u16))
        flooded.nmt(NmtCommand.START)
        wait(flooded.simulation, 1)
        return flooded

    def alternate(self, flooded: Flooded, errors: int) -> None:
        for _ in range(errors):
            for data in (b"", bytes(4)):
                flooded.simulation.send(Frame(COB_RPDO[2] + FIRST_NODE_ID, data))

    @pytest.mark.slow
    def test_the_queue_is_bounded_and_no_fault_goes_unsignalled(self, errors: Flooded) -> None:
        for node in NODES:
            for word in (6, 7):
                write_u16 = bytes((0x2B, 0x40, 0x60, 0, word, 0, 0, 0))
                errors.simulation.send(Frame(COB_SDO_REQUEST + node, write_u16))
        self.alternate(errors, 40)
        errors.simulation.operate(EmergencyStop(pressed=True))
        wait(errors.simulation, 1)
        self.alternate(errors, 40)
        lost, sent = errors.value(od.EMCYS_LOST), len(errors.emergencies())
        wait(errors.simulation, (EMCY_PLACES + 5) * self.INHIBIT_MS)
        heard = errors.emergencies()
        assert len(heard) - sent == EMCY_PLACES + 1  # the last is the end of the overrun
        codes = [code for code, _, _ in heard]
        assert {ErrorCode.ESTOP, ErrorCode.PDO_TOO_SHORT, ErrorCode.CAN_OVERRUN} < set(codes)
        assert heard[-1][0] == ErrorCode.NONE
        assert heard[-1][1] == errors.value(od.ERROR_REGISTER)
        produced = 2 * 80 + 1 + 2  # an error and its end each; the e-stop; the overrun and its end
        assert len(heard) + lost == produced

    def test_an_error_more_than_there_are_places(self, errors: Flooded) -> None:
        """The first EMCY is sent at once; then half as many errors as places fit, each with its end."""
        self.alternate(errors, (EMCY_PLACES + 1) // 2)
        assert errors.value(od.EMCYS_LOST) == 0
        self.alternate(errors, 1)
        assert errors.value(od.EMCYS_LOST) > 0


def test_emergencies_wait_for_the_bus_and_none_is_lost(flooded: Flooded) -> None:
    """A host that is faster than the board's EMCYs: more of them than the driver has places for."""
    flooded.nmt(NmtCommand.START)
    wait(flooded.simulation, 5)
    node = flooded.board.firmware.nodes[0]
    node.dictionary.set(od.COMMUNICATION_ERROR_BEHAVIOUR, ErrorBehaviour.NO_CHANGE)
    flooded.bus.throw_off(flooded.board.can, flooded.simulation.now_counts)
    now_us = flooded.simulation.now_counts // (MS // 1000)
    errors = PLACES[Service.EMCY]
    for number in range(2 * errors):
        node.on_rpdo(0, b"" if number % 2 == 0 else bytes(3), now_us)
        flooded.board.poll(flooded.simulation.now_counts)
    wait(flooded.simulation, 1000)
    codes = [code for code, _, _ in flooded.emergencies()]
    assert codes.count(ErrorCode.PDO_TOO_SHORT) == errors
    assert flooded.value(od.FRAMES_LOST) == flooded.value(od.EMCYS_LOST) == 0
