"""A machine that is lost: it shows at once, and comes back by itself."""

import time
from threading import Event

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.panel.desk.commands import DeclareHere, Enable, ResetFaults, StepJoint
from steptwin.features.panel.desk.desk import Desk
from steptwin.features.panel.desk.requests import Command
from steptwin.features.panel.desk.words import RefusedError
from steptwin.host.twin.live.served_board import ServedBoard
from tests.emulator.live.live_rig import await_true
from tests.end_to_end.served import in_real_time
from tests.features.panel.desk.rig import ANN, HERE, ROBOT, TH1, connection, counts


@in_real_time
def _lost_and_found(kernel: Kernel) -> None:
    served = ServedBoard(ROBOT, port=0, kernel=kernel, stand_at=list(HERE))
    busy = Event()

    def hold_up() -> None:
        if busy.is_set():
            busy.clear()
            time.sleep(1.2)

    served.call_every(0.02, hold_up)
    desk = Desk(connection(served.port), ROBOT)
    try:
        with served:
            await_true(lambda: desk.snapshot.connected, "connected")
            desk.operators.take(ANN, "Ann")
            assert _refusal(desk, DeclareHere(HERE)) == ""
            await_true(lambda: desk.snapshot.homed and desk.snapshot.activity is None, "homed")
            assert _refusal(desk, Enable()) == ""
            await_true(lambda: desk.snapshot.activity is None, "enabled")
            busy.set()
            _await_grey(desk, "no report from the machine for 0.35 s")
            await_true(lambda: desk.snapshot.connected, "back")
        _await_grey(desk, "")
        assert _refusal(desk, Enable()).startswith("switch on: not connected: ")
        assert not desk.stop("Bob", "a press")
        desk.emergency_stop("Bob")
        with ServedBoard(ROBOT, port=served.port, kernel=kernel, stand_at=list(HERE)):
            await_true(lambda: desk.snapshot.connected, "back")
            await_true(lambda: all(joint.drive_state == "FAULT" for joint in desk.snapshot.joints), "held")
            assert desk.snapshot.emergency_stopped
            assert not desk.snapshot.homed
            assert _refusal(desk, ResetFaults()) == ""
            await_true(lambda: desk.snapshot.activity is None and not desk.snapshot.emergency_stopped, "reset")
            assert _refusal(desk, StepJoint(TH1, 1.0)) == ""
            told = f"step {TH1}: by +1 deg"  # not where the joint is, which nobody knows
            await_true(lambda: any(event.text == told for event in desk.events.since()), "told")
            assert desk.stop("Bob", "a press")  # its first copy found no machine: nothing was stopped by it
            assert any(event.text == "stop by Bob" for event in desk.events.since())
    finally:
        desk.close()


def _refusal(desk: Desk, command: Command) -> str:
    """Ask for a command from the newest snapshot that counts; return why it is refused, empty if it is not."""
    await_true(lambda: not desk.snapshot.connected or counts(desk), "a snapshot that counts")
    try:
        desk.ask(ANN, command, desk.snapshot.number)
    except RefusedError as error:
        return str(error)
    return ""


def _await_grey(desk: Desk, why: str) -> None:
    """Wait until the desk says that the machine is lost, which it must within half a second."""
    lost_s = time.monotonic()
    await_true(lambda: not desk.snapshot.connected, "lost")
    assert time.monotonic() - lost_s < 0.5
    assert desk.snapshot.why_not
    assert why in desk.snapshot.why_not
    assert desk.snapshot.joints  # as last known


@pytest.mark.live
def test_a_lost_machine_shows_at_once_and_comes_back_by_itself(fast_kernel: Kernel) -> None:
    """Held up, then gone and switched on again; an emergency stop meanwhile is made when it is back."""
    _lost_and_found(fast_kernel)
