"""A connection that is lost in motion: every event of 6007h with every option code, and 1029h for errors of the bus."""

from collections.abc import Callable
from typing import NamedTuple

import pytest

from steptwin.protocol import od
from steptwin.protocol.cia402 import AbortConnection, ErrorCode, Mode, State, Status
from steptwin.protocol.nmt import ErrorBehaviour, NmtCommand, NmtState
from tests.controller.bench_board import BenchBoard
from tests.controller.node.test_lost_host import HOST, beat, errors, moving, states, watch_host
from tests.controller.units import STEP

NO_ACTION, FAULT, DISABLE, QUICK_STOP = AbortConnection
RAMP_MS = 100
"""From 4 kHz with the deceleration that `moving` sets."""


def lose_heartbeat(board: BenchBoard, *axes: int) -> None:
    watch_host(board, *axes or (0, 1))
    beat(board)
    board.wait(50.01)


def bus_off(board: BenchBoard, *_axes: int) -> None:
    board.firmware.on_bus_off(board.now)
    board.firmware.poll(board.now)


def nmt(command: NmtCommand) -> Callable[..., None]:
    def send(board: BenchBoard, *axes: int) -> None:
        for node in [0x10 + axis for axis in axes] or [0]:
            board.nmt(command, node)

    return send


class Cause(NamedTuple):
    lose: Callable[..., None]
    code: int
    nmt_state: NmtState


CAUSES = {
    "heartbeat": Cause(lose_heartbeat, 0x8130, NmtState.PRE_OPERATIONAL),
    "bus-off": Cause(bus_off, 0x8140, NmtState.PRE_OPERATIONAL),
    "NMT stop": Cause(nmt(NmtCommand.STOP), 0x8100, NmtState.STOPPED),
    "reset communication": Cause(nmt(NmtCommand.RESET_COMMUNICATION), 0x8100, NmtState.PRE_OPERATIONAL),
}
of_every_cause = pytest.mark.parametrize("cause", CAUSES.values(), ids=CAUSES)


def set_option(board: BenchBoard, option: AbortConnection) -> None:
    for axis in (0, 1):
        assert board.write(od.ABORT_CONNECTION_OPTION, option, axis) == 0


def known(board: BenchBoard) -> list[bool]:
    return [board.has(Status.POSITION_KNOWN, axis) for axis in (0, 1)]


def demands(board: BenchBoard) -> list[int]:
    return [board.value(od.POSITION_DEMAND, axis) for axis in (0, 1)]


def homed_and_moving(board: BenchBoard) -> None:
    """As `moving`, with known positions."""
    board.enable(Mode.HOMING)
    for axis in (0, 1):
        for controlword in (0x1F, 0x0F, 0x00):
            assert board.write(od.CONTROLWORD, controlword, axis) == 0
    assert known(board) == [True] * 2
    moving(board)
    board.wait(100)


@of_every_cause
@pytest.mark.parametrize(
    ("option", "at_once", "at_last"),
    [
        (NO_ACTION, State.OPERATION_ENABLED, State.OPERATION_ENABLED),
        (FAULT, State.FAULT_REACTION_ACTIVE, State.FAULT),
        (DISABLE, State.SWITCH_ON_DISABLED, State.SWITCH_ON_DISABLED),
        (QUICK_STOP, State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED),
    ],
)
def test_every_option_in_motion(
    pair: BenchBoard, cause: Cause, option: AbortConnection, at_once: State, at_last: State
) -> None:
    set_option(pair, option)
    homed_and_moving(pair)
    cause.lose(pair)
    began, at = demands(pair), pair.now
    assert states(pair) == [at_once] * 2
    assert [node.nmt_state for node in pair.firmware.nodes] == [cause.nmt_state] * 2
    pair.wait(RAMP_MS - 2)
    assert states(pair) == [at_once] * 2
    pair.wait(3)
    assert states(pair) == [at_last] * 2
    assert pair.firmware.motion.axes[0].running is (option is NO_ACTION)
    assert known(pair) == [option is not DISABLE] * 2
    ways = [abs(now - then) / STEP for now, then in zip(demands(pair), began, strict=True)]
    ramp_steps = 4_000 * RAMP_MS / 2000
    assert pair.now > at
    if option is NO_ACTION:
        assert all(way > 390 for way in ways)
    elif option is DISABLE:
        assert ways == [0, 0]
    else:
        assert ways == pytest.approx([ramp_steps] * 2, abs=5)


@of_every_cause
def test_the_fault_is_reported_with_the_causes_own_code(pair: BenchBoard, cause: Cause) -> None:
    homed_and_moving(pair)
    cause.lose(pair)
    pair.wait(RAMP_MS + 1)
    assert [pair.value(od.ERROR_CODE, axis) for axis in (0, 1)] == [cause.code] * 2
    assert pair.value(od.ERROR_REGISTER) == 0x11
    pair.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)  # a stopped node sends no EMCY
    assert pair.errors() == [cause.code]


@of_every_cause
def test_one_axis_stops_its_group_by_a_fault(pair: BenchBoard, cause: Cause) -> None:
    if cause is CAUSES["bus-off"]:
        assert pair.write(od.ABORT_CONNECTION_OPTION, NO_ACTION, 0) == 0
    homed_and_moving(pair)
    cause.lose(pair, 1)
    pair.wait(RAMP_MS + 1)
    assert states(pair) == [State.FAULT] * 2
    assert [pair.value(od.ERROR_CODE, axis) for axis in (0, 1)] == [ErrorCode.GROUP_STOPPED, cause.code]
    assert demands(pair)[0] == -demands(pair)[1], "both ramps take the same time"


@pytest.mark.parametrize("cause", ["heartbeat", "bus-off"])
@pytest.mark.parametrize(
    ("behaviour", "before", "after"),
    [
        (ErrorBehaviour.PRE_OPERATIONAL, NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL),
        (ErrorBehaviour.PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
        (ErrorBehaviour.NO_CHANGE, NmtState.OPERATIONAL, NmtState.OPERATIONAL),
        (ErrorBehaviour.NO_CHANGE, NmtState.PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
        (ErrorBehaviour.STOPPED, NmtState.OPERATIONAL, NmtState.STOPPED),
        (ErrorBehaviour.STOPPED, NmtState.PRE_OPERATIONAL, NmtState.STOPPED),
    ],
)
@pytest.mark.parametrize("option", AbortConnection)
def test_every_error_behaviour_in_motion(
    pair: BenchBoard, cause: str, behaviour: ErrorBehaviour, before: NmtState, after: NmtState, option: AbortConnection
) -> None:
    set_option(pair, option)
    for axis in (0, 1):
        assert pair.write(od.COMMUNICATION_ERROR_BEHAVIOUR, behaviour, axis) == 0
    homed_and_moving(pair)
    if before is NmtState.PRE_OPERATIONAL:
        pair.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    CAUSES[cause].lose(pair)
    assert [node.nmt_state for node in pair.firmware.nodes] == [after] * 2
    pair.wait(200)
    assert pair.firmware.motion.axes[0].running is (option is NO_ACTION)


def test_pre_operational_leaves_the_drive_alone(pair: BenchBoard) -> None:
    """It is none of the events of 6007h: SDOs still command the drive."""
    homed_and_moving(pair)
    pair.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    pair.wait(100)
    assert states(pair) == [State.OPERATION_ENABLED] * 2
    assert pair.firmware.motion.axes[0].running
    assert pair.write(od.CONTROLWORD, 0x02) == 0
    pair.wait(RAMP_MS + 1)
    assert pair.state() is State.SWITCH_ON_DISABLED


def test_only_entering_stopped_counts(pair: BenchBoard) -> None:
    """The drive is enabled again while the node is stopped: a second NMT stop changes nothing."""
    set_option(pair, NO_ACTION)
    homed_and_moving(pair)
    pair.nmt(NmtCommand.STOP)
    for node in pair.firmware.nodes:
        node.dictionary.set(od.ABORT_CONNECTION_OPTION, FAULT)
    pair.nmt(NmtCommand.STOP)
    pair.wait(10)
    assert states(pair) == [State.OPERATION_ENABLED] * 2


@of_every_cause
@pytest.mark.parametrize("option", AbortConnection)
def test_a_drive_that_is_off_stays_as_it_is(pair: BenchBoard, cause: Cause, option: AbortConnection) -> None:
    set_option(pair, option)
    pair.nmt(NmtCommand.START)
    cause.lose(pair)
    pair.wait(10)
    assert states(pair) == [State.SWITCH_ON_DISABLED] * 2
    assert pair.value(od.ERROR_CODE) == 0


@of_every_cause
def test_an_axis_that_stands_enabled_goes_into_fault(pair: BenchBoard, cause: Cause) -> None:
    pair.enable()
    cause.lose(pair)
    assert states(pair) == [State.FAULT] * 2


class TestBusOff:
    """The error is reported once, and ends with the first frame after it, or with the fault reset."""

    @staticmethod
    def recover(board: BenchBoard) -> None:
        for active in (True, False):
            board.firmware.on_can_error(ErrorCode.CAN_BUS_OFF_RECOVERED, board.now, active=active)
            board.firmware.poll(board.now)
            board.wait(0.1)

    def test_in_fault_it_stays_until_the_fault_reset(self, pair: BenchBoard) -> None:
        homed_and_moving(pair)
        bus_off(pair)
        pair.wait(RAMP_MS + 1)
        self.recover(pair)
        assert errors(pair, 0) == ["4081110000000000"]
        assert pair.write(od.CONTROLWORD, 0x80) == 0
        assert (pair.state(), errors(pair, 0)[1:]) == (State.SWITCH_ON_DISABLED, ["0000000000000000"])

    @pytest.mark.parametrize("option", [NO_ACTION, DISABLE, QUICK_STOP])
    def test_without_fault_it_ends_by_itself(self, pair: BenchBoard, option: AbortConnection) -> None:
        set_option(pair, option)
        homed_and_moving(pair)
        bus_off(pair)
        self.recover(pair)
        assert errors(pair, 0) == ["4081110000000000", "0000000000000000"]


class TestResetCommunication:
    """The boot-up message comes first, then the fault; the drive stops while the node can be configured."""

    def test_order_of_the_frames(self, pair: BenchBoard) -> None:
        homed_and_moving(pair)
        pair.sent.clear()
        pair.nmt(NmtCommand.RESET_COMMUNICATION, 0x10)
        of_axis = [frame for _, frame in pair.sent if frame.cob_id & 0x7F == 0x10]
        assert [(frame.cob_id, frame.data.hex()) for frame in of_axis] == [
            (0x710, "00"),
            (0x090, "0081118200000000"),
        ]
        assert pair.value(od.STATUSWORD) & 0x4F == 0x0F
        pair.wait(RAMP_MS + 1)
        assert pair.write(od.CONTROLWORD, 0x80) == 0
        assert errors(pair, 0)[-1] == "0000000000000000"


class TestResetApplication:
    """The axis stops as its option code says; the node is silent until it stands, then boots with its defaults."""

    @pytest.mark.parametrize(
        ("option", "ramps"), [(NO_ACTION, False), (FAULT, True), (DISABLE, False), (QUICK_STOP, True)]
    )
    def test_every_option_in_motion(self, pair: BenchBoard, option: AbortConnection, *, ramps: bool) -> None:
        set_option(pair, option)
        homed_and_moving(pair)
        began = demands(pair)
        pair.sent.clear()
        pair.nmt(NmtCommand.RESET_NODE)
        if ramps:
            assert pair.sent == [], "the node is silent while its axis stops"
            assert [node.nmt_state for node in pair.firmware.nodes] == [NmtState.INITIALISING] * 2
            pair.wait(RAMP_MS - 2)
            assert pair.firmware.motion.axes[0].running
            assert pair.sent == []
            pair.wait(3)
        assert pair.frames(0x710) == pair.frames(0x711) == [b"\0"]
        assert not pair.firmware.motion.axes[0].running
        assert states(pair) == [State.SWITCH_ON_DISABLED] * 2
        assert [node.nmt_state for node in pair.firmware.nodes] == [NmtState.PRE_OPERATIONAL] * 2
        assert known(pair) == [ramps] * 2, "an axis that was cut in motion does not know its position"
        way_steps = 4_000 * RAMP_MS / 2000 if ramps else 0
        ways = [abs(now - then) / STEP for now, then in zip(demands(pair), began, strict=True)]
        assert ways == pytest.approx([way_steps] * 2, abs=2)
        assert pair.value(od.ERROR_CODE) == pair.value(od.ERROR_REGISTER) == 0
        assert pair.value(od.ABORT_CONNECTION_OPTION) == FAULT, "application parameters have their defaults"
        standing = demands(pair)
        pair.wait(500)
        assert demands(pair) == standing

    def test_one_axis_stops_its_group(self, pair: BenchBoard) -> None:
        homed_and_moving(pair)
        pair.nmt(NmtCommand.RESET_NODE, 0x11)
        pair.wait(RAMP_MS + 1)
        assert states(pair) == [State.FAULT, State.SWITCH_ON_DISABLED]
        assert pair.value(od.ERROR_CODE, 0) == ErrorCode.GROUP_STOPPED
        assert demands(pair)[0] == -demands(pair)[1]

    def test_a_node_that_waits_for_its_reset_hears_nothing_else(self, pair: BenchBoard) -> None:
        assert pair.write(od.PRODUCER_HEARTBEAT_TIME, 10) == 0
        homed_and_moving(pair)
        pair.nmt(NmtCommand.RESET_NODE)
        pair.sent.clear()
        for command in NmtCommand:
            pair.nmt(command)
        pair.send(0x610, bytes.fromhex("4041600000000000"))
        pair.send(0x080, b"")
        pair.send(0x700 + HOST, b"\x05")
        pair.wait(RAMP_MS - 5)
        assert pair.sent == []
        pair.wait(10)
        assert pair.frames(0x710) == [b"\0"]

    @pytest.mark.parametrize("reaction", [0, 1, 2])
    def test_the_fault_reaction_selects_the_ramp(self, pair: BenchBoard, reaction: int) -> None:
        for axis in (0, 1):
            assert pair.write(od.FAULT_REACTION_OPTION, reaction, axis) == 0
            assert pair.write(od.PROFILE_DECELERATION, 20_000 * STEP, axis) == 0
        homed_and_moving(pair)
        pair.nmt(NmtCommand.RESET_NODE)
        assert bool(pair.frames(0x710)[1:]) is (reaction == 0)
        pair.wait({0: 1, 1: 2 * RAMP_MS + 1, 2: RAMP_MS + 1}[reaction])
        assert len(pair.frames(0x710)) == 2
        assert known(pair) == [reaction != 0] * 2
