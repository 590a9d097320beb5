"""A host that falls silent and returns: heartbeat consumer (1016h) and the reactions by 6007h and 1029h."""

import pytest

from steptwin.protocol import od
from steptwin.protocol.cia402 import AbortConnection, ErrorCode, State
from steptwin.protocol.nmt import ErrorBehaviour, NmtState
from tests.controller.bench_board import BenchBoard
from tests.controller.units import STEP

HOST = 0x7F


def watch_host(board: BenchBoard, *axes: int, timeout_ms: int = 50) -> None:
    for axis in axes:
        assert board.write(od.CONSUMER_HEARTBEATS[0], HOST << 16 | timeout_ms, axis) == 0


def beat(board: BenchBoard) -> None:
    board.send(0x700 + HOST, b"\x05")


def moving(board: BenchBoard) -> None:
    """Run both axes at 4 kHz, axis 1 backwards, with records for 1 s."""
    for axis in (0, 1):
        assert board.write(od.QUICK_STOP_DECELERATION, 40_000 * STEP, axis) == 0
    board.enable()
    for axis in (0, 1):
        sign = 1 - 2 * axis
        board.record(sign * 40 * STEP, sign * 4 * STEP * 64, 20, 0, axis)
        for sequence in range(1, 50):
            board.record(sign * 80 * STEP, sign * 4 * STEP * 64, 20, sequence, axis)
    board.start()


def states(board: BenchBoard) -> list[State]:
    return [node.drive.state for node in board.firmware.nodes]


def errors(board: BenchBoard, axis: int) -> list[str]:
    return [data.hex() for data in board.frames(0x090 + axis)]


def test_nothing_is_watched_by_default(pair: BenchBoard) -> None:
    beat(pair)
    assert pair.firmware.dropped_frames == 1
    pair.wait(100_000)
    assert errors(pair, 0) == []


def test_a_host_that_sends_heartbeats_is_not_lost(pair: BenchBoard) -> None:
    watch_host(pair, 0, 1)
    moving(pair)
    for _ in range(10):
        beat(pair)
        pair.wait(49)
    assert states(pair) == [State.OPERATION_ENABLED] * 2
    assert errors(pair, 0) == []


def test_a_lost_host_stops_all_its_axes_in_the_same_time(pair: BenchBoard) -> None:
    watch_host(pair, 0, 1)
    moving(pair)
    beat(pair)
    pair.wait(50.1)
    assert states(pair) == [State.FAULT_REACTION_ACTIVE] * 2
    assert errors(pair, 0) == errors(pair, 1) == ["3081117f00000000"]
    assert [node.nmt_state for node in pair.firmware.nodes] == [NmtState.PRE_OPERATIONAL] * 2
    pair.wait(99)
    assert states(pair) == [State.FAULT_REACTION_ACTIVE] * 2
    pair.wait(2)
    assert states(pair) == [State.FAULT] * 2
    assert pair.value(od.POSITION_DEMAND, 0) == -pair.value(od.POSITION_DEMAND, 1)
    for axis in (0, 1):
        assert pair.value(od.ERROR_CODE, axis) == ErrorCode.HEARTBEAT_LOST
        assert abs(pair.value(od.FOLLOWING_ERROR_ACTUAL, axis)) <= 0.57 * STEP


def test_one_axis_that_listens_stops_the_whole_group(pair: BenchBoard) -> None:
    watch_host(pair, 1)
    moving(pair)
    beat(pair)
    pair.wait(160)
    assert states(pair) == [State.FAULT] * 2
    assert [pair.value(od.ERROR_CODE, axis) for axis in (0, 1)] == [ErrorCode.GROUP_STOPPED, ErrorCode.HEARTBEAT_LOST]
    assert [node.nmt_state for node in pair.firmware.nodes] == [NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL]


def test_without_group_stop_the_others_run_on(pair: BenchBoard) -> None:
    pair.write(od.GROUP_STOP, 0, axis=1)
    watch_host(pair, 1)
    moving(pair)
    beat(pair)
    pair.wait(160)
    assert states(pair) == [State.OPERATION_ENABLED, State.FAULT]


@pytest.mark.parametrize(
    ("option", "at_once", "at_last"),
    [
        (AbortConnection.NO_ACTION, State.OPERATION_ENABLED, State.OPERATION_ENABLED),
        (AbortConnection.FAULT_SIGNAL, State.FAULT_REACTION_ACTIVE, State.FAULT),
        (AbortConnection.DISABLE_VOLTAGE, State.SWITCH_ON_DISABLED, State.SWITCH_ON_DISABLED),
        (AbortConnection.QUICK_STOP, State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED),
    ],
)
def test_reactions(pair: BenchBoard, option: AbortConnection, at_once: State, at_last: State) -> None:
    for axis in (0, 1):
        assert pair.write(od.ABORT_CONNECTION_OPTION, option, axis) == 0
    watch_host(pair, 0, 1)
    moving(pair)
    beat(pair)
    pair.wait(50.1)
    assert states(pair) == [at_once] * 2
    assert errors(pair, 0) == ["3081117f00000000"]
    pair.wait(200)
    assert states(pair) == [at_last] * 2
    assert pair.firmware.motion.axes[0].running is (option is AbortConnection.NO_ACTION)


@pytest.mark.parametrize(
    ("behaviour", "before", "after"),
    [
        (ErrorBehaviour.PRE_OPERATIONAL, NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL),
        (ErrorBehaviour.PRE_OPERATIONAL, NmtState.STOPPED, NmtState.STOPPED),
        (ErrorBehaviour.NO_CHANGE, NmtState.OPERATIONAL, NmtState.OPERATIONAL),
        (ErrorBehaviour.STOPPED, NmtState.OPERATIONAL, NmtState.STOPPED),
        (ErrorBehaviour.STOPPED, NmtState.PRE_OPERATIONAL, NmtState.STOPPED),
    ],
)
def test_error_behaviour(pair: BenchBoard, behaviour: ErrorBehaviour, before: NmtState, after: NmtState) -> None:
    assert pair.write(od.COMMUNICATION_ERROR_BEHAVIOUR, behaviour) == 0
    watch_host(pair, 0)
    pair.nmt({NmtState.OPERATIONAL: 1, NmtState.STOPPED: 2, NmtState.PRE_OPERATIONAL: 128}[before])
    beat(pair)
    pair.wait(51)
    assert pair.firmware.nodes[0].nmt_state is after
    assert errors(pair, 0) == ([] if before is NmtState.STOPPED else ["3081117f00000000"])
    assert pair.value(od.ERROR_REGISTER) == 0x11


def test_a_drive_that_is_off_reports_and_stays_as_it_is(pair: BenchBoard) -> None:
    watch_host(pair, 0)
    beat(pair)
    pair.wait(51)
    assert states(pair)[0] is State.SWITCH_ON_DISABLED
    assert errors(pair, 0) == ["3081117f00000000"]
    beat(pair)
    assert errors(pair, 0)[1:] == ["0000000000000000"]
    assert pair.value(od.ERROR_REGISTER) == 0


def test_a_host_that_comes_back_resets_the_fault_and_works_on(pair: BenchBoard) -> None:
    """The fault reset resolves the error, or the heartbeat if it comes later."""
    watch_host(pair, 0, 1)
    moving(pair)
    beat(pair)
    pair.wait(200)
    pair.write(od.CONTROLWORD, 0x80, axis=1)
    assert (states(pair)[1], errors(pair, 1)[1:], pair.value(od.ERROR_REGISTER, 1)) == (
        State.SWITCH_ON_DISABLED,
        [],
        0x11,
    )
    beat(pair)
    assert (errors(pair, 0)[1:], errors(pair, 1)[1:]) == ([], ["0000000000000000"])
    pair.write(od.CONTROLWORD, 0x80, axis=0)
    assert errors(pair, 0)[1:] == ["0000000000000000"]
    pair.wait(51)
    assert errors(pair, 0)[2:] == ["3081117f00000000"], "it is watched again"


def test_a_communication_reset_ends_the_watch(pair: BenchBoard) -> None:
    watch_host(pair, 0)
    beat(pair)
    pair.nmt(0x82)
    pair.wait(100)
    assert errors(pair, 0) == []
    assert pair.value(od.CONSUMER_HEARTBEATS[0]) == 0


def test_a_halted_machine_whose_host_is_lost_ends_in_fault(pair: BenchBoard) -> None:
    """In a halt trajectory time stands still; the fault reaction must not wait for a resume that never comes."""
    watch_host(pair, 0, 1, timeout_ms=500)
    moving(pair)
    beat(pair)
    for axis in (0, 1):
        pair.write(od.CONTROLWORD, 0x11F, axis)
    pair.wait(499)
    assert states(pair) == [State.OPERATION_ENABLED] * 2
    pair.wait(250)
    assert states(pair) == [State.FAULT] * 2
    assert not pair.firmware.motion.axes[0].running


@pytest.mark.parametrize("option", [AbortConnection.FAULT_SIGNAL, AbortConnection.QUICK_STOP])
def test_a_jogging_axis_stops_too(pair: BenchBoard, option: AbortConnection) -> None:
    pair.write(od.ABORT_CONNECTION_OPTION, option)
    pair.write(od.QUICK_STOP_DECELERATION, 40_000 * STEP)
    watch_host(pair, 0, timeout_ms=500)
    pair.enable(mode=3)
    beat(pair)
    pair.write(od.TARGET_VELOCITY, 2_000 * STEP)
    pair.wait(499)
    assert pair.value(od.VELOCITY_ACTUAL) > 0
    pair.wait(200)
    assert states(pair)[0] is (State.FAULT if option is AbortConnection.FAULT_SIGNAL else State.SWITCH_ON_DISABLED)
    assert not pair.firmware.motion.axes[0].running
