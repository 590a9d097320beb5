"""docs/tutorial.md, "In a browser": what a reader does on the page, by the desk, and what is seen of it once more."""

import json
import time
from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.kinds.machine import EmergencyStop
from steptwin.features.faults.kinds.wiring import StuckSwitch
from steptwin.features.panel.desk.commands import HomeAll, ResetFaults, RunMotion
from steptwin.features.panel.desk.desk import Desk
from steptwin.features.panel.desk.jogs import JointJog, ToolJog
from steptwin.features.panel.desk.words import RefusedError
from steptwin.features.view.model import Replay
from steptwin.host.cli.app import run
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.live.served_board import ServedBoard
from steptwin.protocol.cia402 import DigitalInput
from tests.emulator.live.live_rig import await_true
from tests.end_to_end.served import in_real_time
from tests.features.panel.desk.rig import ANN, Rig, connection

LAB = load_robot("lab-scara")
SPIRAL = plan(LAB, make_job(LAB, "spiral"))


@in_real_time
def _a_quarter_of_an_hour(kernel: Kernel, folder: Path) -> None:
    with ServedBoard(LAB, port=0, kernel=kernel, out=folder, replace=True) as served:
        desk = Desk(connection(served.port), LAB)
        it = Rig(served, desk)
        try:
            await_true(lambda: desk.snapshot.connected, "connected")
            desk.operators.take(ANN, "Ann")
            it.do(HomeAll())
            for jog in (JointJog("th2", 10.0), ToolJog("x", 20.0)):
                desk.release(ANN, it.pressed(jog))
                it.idle()
            _pause_and_resume(it)
            _stop_by_the_button(it)
            it.do(_spiral())
            assert desk.results[-1].passed
            _press_the_machines_stop(it)
            served.operate(StuckSwitch(0, DigitalInput.NEGATIVE_LIMIT, closed=True))
            desk.release(ANN, it.pressed(JointJog("th2", -10.0)))
            it.idle()
            _is_the_spiral(folder)
        finally:
            desk.close()
    _is_the_spiral(folder)
    assert run(["verify", str(folder)]) == 1  # the machine was stopped after the spiral
    assert json.loads((folder / "report.json").read_text())["next_motion_s"] is not None


def _spiral() -> RunMotion:
    return RunMotion(SPIRAL, "spiral", approach=True)


def _pause_and_resume(it: Rig) -> None:
    desk = it.desk
    it.ask(_spiral())
    await_true(lambda: bool(desk.snapshot.activity and desk.snapshot.activity.pausable), "run")
    desk.pause("Ann")
    await_true(lambda: bool(desk.snapshot.activity and desk.snapshot.activity.paused), "paused")
    desk.resume(ANN, desk.snapshot.number)
    it.idle()
    assert desk.results[-1].passed


def _stop_by_the_button(it: Rig) -> None:
    desk = it.desk
    it.ask(_spiral())
    await_true(lambda: bool(desk.snapshot.activity and desk.snapshot.activity.pausable), "run")
    time.sleep(1.0)
    desk.emergency_stop("Ann")
    await_true(lambda: all(joint.error for joint in desk.snapshot.joints), "held")
    it.idle()
    it.do(ResetFaults())
    await_true(lambda: not desk.snapshot.emergency_stopped, "reset")


def _press_the_machines_stop(it: Rig) -> None:
    it.served.operate(EmergencyStop(pressed=True))
    await_true(lambda: it.desk.snapshot.emergency_stopped, "pressed")
    with pytest.raises(RefusedError, match="held by an emergency stop"):
        it.desk.ask(ANN, HomeAll(), it.desk.snapshot.number)
    it.served.operate(EmergencyStop(pressed=False))
    it.do(ResetFaults())
    await_true(lambda: not it.desk.snapshot.emergency_stopped, "reset")


def _is_the_spiral(folder: Path) -> None:
    replay = Replay.of_folder(folder)
    assert replay.run.no_plan is None
    assert replay.run.duration_s == pytest.approx(18.8)
    errors_steps = [abs(joint.error_steps) for joint in replay.at(replay.counts_at(9.4)).joints]
    assert max(errors_steps) < 0.6


def test_the_page_ends_with_a_replay_of_the_spiral(fast_kernel: Kernel, tmp_path: Path) -> None:
    """While the panel is open and after Ctrl-C, whatever has moved the machine since."""
    _a_quarter_of_an_hour(fast_kernel, tmp_path / "first")
