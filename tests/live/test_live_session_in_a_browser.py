"""docs/live-session.md, "In a browser": what a reader does on the page, by its service, and what is seen of it."""

import json
import time
from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.kinds.machine import EmergencyStop
from steptwin.features.faults.kinds.wiring import StuckSwitch
from steptwin.features.panel.service.commands import HomeAll, JointJog, ResetFaults, RunMotion, ToolJog
from steptwin.features.panel.service.messages import RefusedError
from steptwin.features.panel.service.service import MachineService
from steptwin.features.view.model import Replay
from steptwin.host.cli.app import run
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.live.served_board import ServedBoard
from steptwin.protocol.cia402 import DigitalInput
from tests.emulator.live.live_rig import await_true
from tests.end_to_end.served import in_real_time
from tests.features.panel.service.rig import ANN, Rig, connection

LAB = load_robot("lab-scara")
SPIRAL = plan(LAB, make_job(LAB, "spiral"))


@in_real_time
def _a_quarter_of_an_hour(kernel: Kernel, folder: Path) -> None:
    with ServedBoard(LAB, port=0, kernel=kernel, out=folder, replace=True) as served:
        service = MachineService(connection(served.port), LAB)
        service.start()
        it = Rig(served, service)
        try:
            await_true(lambda: service.snapshot.connected, "connected")
            service.operator.take(ANN, "Ann")
            it.do(HomeAll())
            for jog in (JointJog("th2", 10.0), ToolJog("x", 20.0)):
                service.release(ANN, it.pressed(jog))
                it.idle()
            _pause_and_resume(it)
            _stop_by_the_button(it)
            it.do(_spiral())
            assert service.results[-1].passed
            _press_the_machines_stop(it)
            served.operate(StuckSwitch(0, DigitalInput.NEGATIVE_LIMIT, closed=True))
            service.release(ANN, it.pressed(JointJog("th2", -10.0)))
            it.idle()
            _is_the_spiral(folder)
        finally:
            service.close()
    _is_the_spiral(folder)
    assert run(["verify", str(folder)]) == 1  # the machine was stopped after the spiral
    assert json.loads((folder / "report.json").read_text())["next_motion_s"] is not None


def _spiral() -> RunMotion:
    return RunMotion(SPIRAL, "spiral", approach=True)


def _pause_and_resume(it: Rig) -> None:
    service = it.service
    it.ask(_spiral())
    await_true(lambda: bool(service.snapshot.activity and service.snapshot.activity.pausable), "run")
    service.pause("Ann")
    await_true(lambda: bool(service.snapshot.activity and service.snapshot.activity.paused), "paused")
    service.resume(ANN, service.snapshot.number)
    it.idle()
    assert service.results[-1].passed


def _stop_by_the_button(it: Rig) -> None:
    service = it.service
    it.ask(_spiral())
    await_true(lambda: bool(service.snapshot.activity and service.snapshot.activity.pausable), "run")
    time.sleep(1.0)
    service.emergency_stop("Ann")
    await_true(lambda: all(joint.error for joint in service.snapshot.joints), "held")
    it.idle()
    it.do(ResetFaults())
    await_true(lambda: not service.snapshot.emergency_stopped, "reset")


def _press_the_machines_stop(it: Rig) -> None:
    it.served.operate(EmergencyStop(pressed=True))
    await_true(lambda: it.service.snapshot.emergency_stopped, "pressed")
    with pytest.raises(RefusedError, match="held by an emergency stop"):
        it.service.ask(ANN, HomeAll(), it.service.snapshot.number)
    it.served.operate(EmergencyStop(pressed=False))
    it.do(ResetFaults())
    await_true(lambda: not it.service.snapshot.emergency_stopped, "reset")


def _is_the_spiral(folder: Path) -> None:
    replay = Replay.of_folder(folder)
    assert replay.run.no_plan is None
    assert replay.run.duration_s == pytest.approx(18.8)
    errors_steps = [abs(joint.error_steps) for joint in replay.at(replay.counts_at(9.4)).joints]
    assert max(errors_steps) < 0.6


def test_the_page_ends_with_a_replay_of_the_spiral(fast_kernel: Kernel, tmp_path: Path) -> None:
    """While the panel is open and after Ctrl-C, whatever has moved the machine since."""
    _a_quarter_of_an_hour(fast_kernel, tmp_path / "first")
