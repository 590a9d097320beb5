"""The host's heartbeat in virtual time: when it is sent, and how the board reacts when it stops."""

import numpy as np
import pytest

from steptwin.host.client import Machine, StreamedMotion
from steptwin.host.client.lease import PERIOD_S, TIMEOUT_MS
from steptwin.host.client.pausing import pause_trajectory
from steptwin.host.client.stopping import await_standstill
from steptwin.host.common.errors import DeviceFaultError
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, State
from tests.host.client.machines import (
    AXES,
    HEARTBEAT,
    ROBOT,
    SETTINGS,
    STEP,
    TH1,
    frames_to,
    ready,
    silence_heartbeat,
    travelling,
)
from tests.messages import refusing


def beats_s(board: EmbeddedBoard) -> list[float]:
    return [counts / 72e6 for counts, frame in board.bus_log if frame.cob_id == HEARTBEAT]


def emergencies(board: EmbeddedBoard) -> list[bytes]:
    return [frame.data for axis in range(AXES) for frame in frames_to(board, 0x90 + axis)]


def states(machine: Machine) -> list[State]:
    return [axis.state() for axis in machine.axes]


def test_it_beats_while_the_client_waits(board: EmbeddedBoard, machine: Machine) -> None:
    """During one long wait, too, each heartbeat is sent at its own time."""
    board.wait(3.0)
    machine.wait(2.0)
    assert np.diff(beats_s(board)) == pytest.approx(PERIOD_S, abs=0.0005)
    assert len(beats_s(board)) == pytest.approx(5.0 / PERIOD_S, abs=2)
    assert {frame.data for frame in frames_to(board, HEARTBEAT)} == {b"\x05"}
    assert emergencies(board) == []


@pytest.mark.slow
def test_it_beats_between_the_frames_of_a_long_dialogue(board: EmbeddedBoard, machine: Machine) -> None:
    began_s = board.now_s()
    for _ in range(1600):
        machine.axes[0].read(od.DEVICE_TYPE)
    assert board.now_s() - began_s > 3 * PERIOD_S
    assert np.diff(beats_s(board)) == pytest.approx(PERIOD_S, abs=0.002)
    assert emergencies(board) == []


def test_a_host_that_dies_as_soon_as_it_has_adopted_the_board_is_missed(
    board: EmbeddedBoard, machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine.disconnect()
    board.wait(1.0)
    successor = Machine(board, ROBOT.joint_names)
    successor.adopt([[]] * AXES)
    silence_heartbeat(monkeypatch)
    board.wait(TIMEOUT_MS / 1000 + 0.5)
    assert states(successor) == [State.FAULT] * AXES
    assert [axis.error_codes for axis in successor.axes] == [[ErrorCode.HEARTBEAT_LOST]] * AXES


def test_it_begins_when_the_axes_are_configured(board: EmbeddedBoard) -> None:
    machine = Machine(board, ROBOT.joint_names)
    machine.connect()
    board.wait(1.0)
    assert beats_s(board) == []
    for _ in range(2):  # the second time the heartbeat has been started already
        machine.configure((SETTINGS,) * AXES)
        board.wait(1.0)
    assert np.diff(beats_s(board)) == pytest.approx(PERIOD_S, abs=0.002)
    for axis in machine.axes:
        assert axis.read(od.CONSUMER_HEARTBEATS[0]) == 0x7F0000 | TIMEOUT_MS
        assert axis.read(od.ABORT_CONNECTION_OPTION) == 1


def test_a_host_that_disconnects_is_not_lost(board: EmbeddedBoard, machine: Machine) -> None:
    machine.disconnect()
    left_s = board.now_s()
    board.wait(2.0)
    assert beats_s(board)[-1] <= left_s
    assert emergencies(board) == []
    assert states(machine) == [State.OPERATION_ENABLED] * AXES
    machine.disconnect()


def test_a_host_may_reconnect(board: EmbeddedBoard, machine: Machine) -> None:
    machine.disable()
    machine.disconnect()
    board.wait(2.0)
    again = ready(board)
    again.run(StreamedMotion(travelling(20), [0] * AXES), lambda _: None)
    assert emergencies(board) == []


def test_a_silent_host_is_reported_as_lost(
    board: EmbeddedBoard, machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The host feeds the queues, but its heartbeat is lost: the axes leave OPERATIONAL and report only by EMCY."""
    machine.start(StreamedMotion(travelling(101), [0] * AXES))
    machine.wait(1.0)
    silence_heartbeat(monkeypatch)
    with refusing(DeviceFaultError) as caught:
        machine.wait(1.0)
    assert caught.value.exit_code == 3
    assert board.now_s() - beats_s(board)[-1] == pytest.approx(TIMEOUT_MS / 1000, abs=0.025)
    await_standstill(board, machine.axes)
    assert [axis.error_codes for axis in machine.axes] == [[ErrorCode.HEARTBEAT_LOST]] * AXES
    assert emergencies(board) == [bytes.fromhex("308111 7f00000000")] * AXES
    assert states(machine) == [State.FAULT] * AXES


def test_a_host_that_dies_leaves_no_motion(
    board: EmbeddedBoard, machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Heartbeat and records stop: the axis ramps down from 4 kHz at 9766 steps/s^2 before its queue is dry."""
    machine.start(StreamedMotion(travelling(101), [0] * AXES))
    machine.wait(1.0)
    silence_heartbeat(monkeypatch)
    board.wait(3.0)
    lost_s = beats_s(board)[-1] + TIMEOUT_MS / 1000
    evidence = board.evidence()
    steps_s = evidence.axes[TH1].step_counts / 72e6
    assert steps_s[-1] == pytest.approx(lost_s + 0.41, abs=0.02)
    braking = np.diff(steps_s[steps_s > lost_s + 0.001])
    assert len(braking) == pytest.approx(4000 * 0.41 / 2, abs=10)
    assert np.all(np.diff(braking) > -1e-6)
    assert [axis.violations.counts.size for axis in evidence.axes] == [0] * AXES
    assert states(machine) == [State.FAULT] * AXES
    assert machine.positions_units()[TH1] == board.driver_positions()[TH1] * STEP
    assert {code for axis in machine.axes for code in axis.error_codes} == {ErrorCode.HEARTBEAT_LOST}


def test_a_paused_machine_is_watched_too(
    board: EmbeddedBoard, machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine.start(StreamedMotion(travelling(101), [0] * AXES))
    machine.wait(0.5)
    pause_trajectory(machine)
    rested_s = board.now_s()
    silence_heartbeat(monkeypatch)
    with refusing(DeviceFaultError):
        machine.wait(1.0)
    assert states(machine) == [State.FAULT] * AXES
    assert board.evidence().axes[TH1].step_counts[-1] / 72e6 < rested_s


def test_repeated_frames_stop_and_skip_what_they_have_missed(board: EmbeddedBoard) -> None:
    """A frame every 50 us is more than the bus can carry; no backlog builds up."""
    fast = board.network.send_periodic(0x77E, b"\x05", 50e-6)
    slow = board.network.send_periodic(0x77D, b"\x05", 0.01)
    board.wait(0.1)
    fast.stop()  # type: ignore[no-untyped-call]
    sent = len(frames_to(board, 0x77E))
    assert 1500 < sent < 1900
    assert len(frames_to(board, 0x77D)) == pytest.approx(10, abs=1)
    board.wait(0.1)
    assert len(frames_to(board, 0x77E)) == sent
    assert len(frames_to(board, 0x77D)) == pytest.approx(20, abs=1)
    slow.stop()  # type: ignore[no-untyped-call]
