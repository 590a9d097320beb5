"""A robot whose elbow motor sits on the base, by its file alone: run and verify."""

import json
import re
from pathlib import Path

import cantools
import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.operate.moving import move_within
from steptwin.host.operate.session import Session
from steptwin.host.record.waveforms.signal import HeldValues, everything
from steptwin.host.twin.board_under_test import BoardUnderTest
from tests.end_to_end.command_line import run_json
from tests.host.robots.coupled import STEPS_PER_DEG, UNITS_PER_DEG, coupled_robot, coupled_text

POINTS = "t,th1,th2,d3,th4\n0,0,0,0,0\n1,30,40,10,-20\n2,-20,35,5,10\n3,0,0,0,0\n"


@pytest.fixture
def robot(tmp_path: Path) -> str:
    path = tmp_path / "belt.toml"
    path.write_text(coupled_text())
    return str(path)


@pytest.fixture
def points(tmp_path: Path) -> str:
    path = tmp_path / "points.csv"
    path.write_text(POINTS)
    return str(path)


@pytest.mark.slow
def test_a_run_and_its_folder(robot: str, points: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    report = run_json(capsys, "run", robot, points, "--out", str(out))
    assert report["passed"]
    assert report["joints"]["end"] == pytest.approx([0.0] * 4, abs=0.03)
    assert run(["verify", str(out)]) == 0
    stored = json.loads((out / "report.json").read_text())
    assert stored["axes"] == report["axes"]
    assert report["axes"][1]["pulses"] > report["axes"][0]["pulses"]
    rows = [line.split(",") for line in (out / "trajectory.csv").read_text().splitlines()]
    (at_1_s,) = [row for row in rows if row[0] == "1.0"]
    assert [float(value) for value in at_1_s[1:5]] == pytest.approx([30.0, 40.0, 10.0, -20.0])
    assert run(["trace", str(out), "--format", "npz", "--out", str(tmp_path / "trace.npz")]) == 0


@pytest.mark.parametrize(("axis_steps", "elbow_deg"), [((320, 0), -9.0), ((0, 320), 9.0), ((320, 320), 0.0)])
def test_waveforms_show_joint_positions(axis_steps: tuple[int, int], elbow_deg: float, fast_kernel: Kernel) -> None:
    """The elbow's position changes with the steps of both motors: 320 of each are 9 deg."""
    board = BoardUnderTest(coupled_robot(), stand_at=[0.0] * 4, kernel=fast_kernel)
    units = [round(steps / STEPS_PER_DEG * UNITS_PER_DEG) for steps in (*axis_steps, 0, 0)]
    session = Session(board, board.robot)
    with session.charge("move", needs=()) as charge:
        machine = charge.enable()
        machine.preset([0] * 4)
        move_within(session, [0] * 4, units)
    states = [HeldValues(np.empty(0, np.int64), np.empty(0, np.int64), 0)] * 4
    signals = everything(board.evidence(), board.robot, states)
    (elbow,) = [signal.changes for signal in signals if (signal.axis, signal.quantity) == ("th2", "position_deg")]
    assert isinstance(elbow, HeldValues)
    assert elbow.values[-1] == pytest.approx(elbow_deg)
    assert (
        elbow.counts.size == np.unique(np.concatenate([board.pins(name).step_counts for name in ("th1", "th2")])).size
    )


def test_the_database_says_what_an_axis_position_is(robot: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["dbc", robot]) == 0
    database = cantools.database.load_string(capsys.readouterr().out, "dbc")
    assert isinstance(database, cantools.database.can.Database)
    comments = {node.name: node.comment for node in database.nodes}
    assert comments["th2"] == "axis position = 1 th1 + 1 th2"
    assert comments["th1"] is None
    assert run(["dbc", "teaching-scara"]) == 0
    assert not re.search("^CM_", capsys.readouterr().out, re.MULTILINE)
