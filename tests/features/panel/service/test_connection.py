"""A machine that is lost: it shows at once, and comes back by itself."""

import time
from threading import Event

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.panel.service.commands import Command, DeclareHere, Enable, ResetFaults, StepJoint
from steptwin.features.panel.service.messages import RefusedError
from steptwin.features.panel.service.service import MachineService
from steptwin.host.twin.live.served_board import ServedBoard
from tests.emulator.live.live_rig import await_true
from tests.end_to_end.served import in_real_time
from tests.features.panel.service.rig import ANN, HERE, ROBOT, TH1, connection, counts


@in_real_time
def _lost_and_found(kernel: Kernel) -> None:
    served = ServedBoard(ROBOT, port=0, kernel=kernel, stand_at=list(HERE))
    busy = Event()

    def hold_up() -> None:
        if busy.is_set():
            busy.clear()
            time.sleep(1.2)

    served.call_every(0.02, hold_up)
    service = MachineService(connection(served.port), ROBOT)
    service.start()
    try:
        with served:
            await_true(lambda: service.snapshot.connected, "connected")
            service.operator.take(ANN, "Ann")
            assert _refusal(service, DeclareHere(HERE)) == ""
            await_true(lambda: service.snapshot.homed and service.snapshot.activity is None, "homed")
            assert _refusal(service, Enable()) == ""
            await_true(lambda: service.snapshot.activity is None, "enabled")
            busy.set()
            _await_grey(service, "no report from the machine for 0.35 s")
            await_true(lambda: service.snapshot.connected, "back")
        _await_grey(service, "")
        assert _refusal(service, Enable()).startswith("switch on: not connected: ")
        assert not service.stop("Bob", "a press")
        service.emergency_stop("Bob")
        with ServedBoard(ROBOT, port=served.port, kernel=kernel, stand_at=list(HERE)):
            await_true(lambda: service.snapshot.connected, "back")
            await_true(lambda: all(joint.drive_state == "FAULT" for joint in service.snapshot.joints), "held")
            assert service.snapshot.emergency_stopped
            assert not service.snapshot.homed
            assert _refusal(service, ResetFaults()) == ""
            await_true(lambda: service.snapshot.activity is None and not service.snapshot.emergency_stopped, "reset")
            assert _refusal(service, StepJoint(TH1, 1.0)) == ""
            told = f"step {TH1}: by +1 deg"  # not where the joint is, which nobody knows
            await_true(lambda: any(event.text == told for event in service.events.since()), "told")
            assert service.stop("Bob", "a press")  # its first copy found no machine: nothing was stopped by it
            assert any(event.text == "stop by Bob" for event in service.events.since())
    finally:
        service.close()


def _refusal(service: MachineService, command: Command) -> str:
    """Ask for a command from the newest snapshot that counts; return why it is refused, empty if it is not."""
    await_true(lambda: not service.snapshot.connected or counts(service), "a snapshot that counts")
    try:
        service.ask(ANN, command, service.snapshot.number)
    except RefusedError as error:
        return str(error)
    return ""


def _await_grey(service: MachineService, why: str) -> None:
    """Wait until the service says that the machine is lost, which it must within half a second."""
    lost_s = time.monotonic()
    await_true(lambda: not service.snapshot.connected, "lost")
    assert time.monotonic() - lost_s < 0.5
    assert service.snapshot.why_not
    assert why in service.snapshot.why_not
    assert service.snapshot.joints  # as last known


@pytest.mark.live
def test_a_lost_machine_shows_at_once_and_comes_back_by_itself(fast_kernel: Kernel) -> None:
    """Held up, then gone and switched on again; an emergency stop meanwhile is made when it is back."""
    _lost_and_found(fast_kernel)
