"""`steptwin serve` as a program: its output, its records, its end."""

import json
import os
import re
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from steptwin.controller.motion.backend import fastest_kernel
from steptwin.emulator.board.board import Board
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.simulation import Simulation
from steptwin.host.cli.app import run
from steptwin.host.record.folder import read_edges
from steptwin.host.robots import load_robot
from steptwin.host.twin.machine.boards import board_configs, steps_at_joints
from steptwin.protocol.frame import Frame
from steptwin.protocol.pvt import PvtRecord
from tests.emulator.live.live_rig import TIMEOUT_S, RawClient
from tests.end_to_end.command_line import PROGRAM
from tests.end_to_end.pages import blocks_of, read_page
from tests.end_to_end.served import in_real_time, serving

ROBOT = "warehouse-scara"
STEPS_AT_MS = {0: 0, 10: 0, 70: 40, 110: 25}
"""Positions in steps at which the fourth axis rests, by time in ms; a cubic connects two of them."""
RECORDS = [
    PvtRecord(1024 * (STEPS_AT_MS[end] - STEPS_AT_MS[begin]), 0, end - begin, sequence)
    for sequence, (begin, end) in enumerate(pairwise(STEPS_AT_MS))
]


def frames_of_a_motion() -> list[Frame]:
    """Return NMT start, enabling in interpolated position mode, PVT records and the SYNC that starts them."""
    node = 0x13
    enabling = [Frame(0x200 + node, bytes((word, 0, 7))) for word in (0x06, 0x07, 0x0F)]
    records = [Frame(0x500 + node, record.encode()) for record in RECORDS]
    start = [Frame(0x300 + node, b"\x1f\x00"), Frame(0x080, b"")]
    return [Frame(0x000, b"\x01\x00"), *enabling, *records, *start]


def in_virtual_time() -> list[int]:
    """Return when the same frames make steps in virtual time, in counts from the tick after the SYNC."""
    robot = load_robot(ROBOT)
    simulation = Simulation([Board(board_configs(robot)[0], fastest_kernel())], Bus(robot.board.bitrate))
    for frame in frames_of_a_motion():
        simulation.send(frame)
        if frame.cob_id == 0x080:
            start_counts = -(-simulation.bus.log_counts[simulation.bus.log_frames.index(frame)] // 18_000) * 18_000
    simulation.run_until(simulation.now_counts + 72_000_000)
    counts: list[int] = (simulation.boards[0].trace(3).step_counts - start_counts).tolist()
    return counts


def move(client: RawClient) -> None:
    """Send the motion frame by frame and wait until it has ended."""
    for frame in frames_of_a_motion():
        client.send(f"< send {frame.cob_id:x} {len(frame.data)} {frame.data.hex(' ')} >".encode())
    flags = 1 << 4
    while flags & 1 << 4:  # the queue runs, says object 0x2012:03
        client.send(b"< send 613 8 40 12 20 3 0 0 0 0 >")
        client.expect(b" 4F122003")
        flags = int(client.expect(b" >")[:2], 16)


def test_a_session_and_its_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, log = tmp_path / "out", tmp_path / "run.log"
    with serving(ROBOT, "--out", str(out), "--log", str(log), "--control-port", "0", "--json") as server:
        assert server.banner[0].startswith("SIMULATED warehouse-scara: sx sz L1 th1 th2 th3, nodes 0x10 to 0x15")
        control = re.fullmatch(r"control port at (\S+), for steptwin inject --control (\S+)", server.banner[2])
        assert control
        assert run(["inject", ROBOT, "switch", "sx", "-", "free", "--control", control[2]]) == 0
        assert capsys.readouterr().out == f"SIMULATED {ROBOT}: switch - of sx: open\n"
        listener, client = RawClient(server.port), RawClient(server.port)
        move(client)
        listener.expect(b"< frame 080 ")
        code, stdout, stderr = server.end(signal.SIGTERM)
        assert listener.until_hung_up()
        for one in (listener, client):
            one.close()
    assert (code, stderr) == (0, "")
    report = json.loads(stdout)
    files = {"report.json", "robot.toml", "trajectory.csv", "edges.npz", "bus.log"}
    stored = json.loads((out / "report.json").read_text())
    assert set(stored.pop("files")) == files - {"report.json"}
    assert stored == report | {"folder_version": 1}
    assert {path.name for path in out.iterdir()} == files
    th1 = report["axes"][3]
    assert (th1["steps_start"], th1["steps_end"], th1["pulses"], th1["violations"]) == (0, 25, 55, 0)
    assert report["simulated"] is True
    assert report["passed"] is None
    counted = {"served": 1, "disconnected": {}, "requests": 2, "refused": 0}
    assert report["control"] == {"address": control[1]} | counted
    assert [operation["do"] for operation in report["operations"]] == ["switch"]
    assert report["clients"] == {"served": 2, "disconnected": {}, "foreign_frames": 0}
    real_time = report["real_time"]
    assert real_time["ticks"]["count"] >= 300  # of 110 ms; those simulated with the last frame do not count
    for late in (real_time["ticks"], real_time["frames"]):
        assert 0 <= late["late_us_p50"] <= late["late_us_p99"] <= late["late_us_max"]
    lines = log.read_text().splitlines()
    assert lines == (out / "bus.log").read_text().splitlines()
    assert len(lines) == report["bus"]["frames"]
    assert lines[0] == "(0000000000.000054) steptwin0 710#00"
    evidence = read_edges(out)
    assert [axis.name for axis in evidence.axes] == list(load_robot(ROBOT).joint_names)
    assert (evidence.axes[3].step_counts - evidence.start_counts).tolist() == in_virtual_time()
    assert evidence.axes[3].pins["enable"].levels.tolist() == [1]
    assert run(["trace", str(out)]) == 0
    assert "th1_step" in (out / "trace.vcd").read_text()
    assert run(["verify", str(out)]) == 0
    assert capsys.readouterr().out.endswith("warehouse-scara live: PASSED\n")


@in_real_time
def test_ctrl_c_ends_it_as_well_after_what_docs_live_md_shows() -> None:
    ((_, python),) = [block for block in blocks_of(read_page("docs/live.md")) if block[0] == "python"]
    with serving(ROBOT, "--machine", "stand-at=0 0 200 -60 120 -90") as server:
        session = python.replace("29536", str(server.port))
        shown = subprocess.run(
            [sys.executable, "-W", "error", "-c", session], capture_output=True, text=True, check=False
        )
        assert (shown.returncode, shown.stderr) == (0, "")
        assert "SIMULATED" in shown.stdout
        code, stdout, stderr = server.end(signal.SIGINT)
    assert (code, stderr) == (0, "")  # no status line where there is no terminal
    steps = steps_at_joints(load_robot(ROBOT), [0, 0, 200, -60, 120, -90])[3]
    assert ["th1", str(steps), str(steps), "0", "0"] in [line.split() for line in stdout.splitlines()]
    assert "SIMULATED" in stdout.splitlines()[-1]


def test_on_an_interface_of_python_can_with_a_terminal() -> None:
    """On a terminal, the status line shows the board's state until the end."""
    terminal, stderr = os.openpty()
    process = subprocess.Popen(
        [*PROGRAM, "serve", ROBOT, "-i", "virtual", "-c", "here", "-m", "bitrate=250000"],
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        env={**os.environ, "COLUMNS": "80", "TERM": "xterm"},
    )
    os.close(stderr)
    status = b""
    while b"late, ms" not in status:
        status += os.read(terminal, 4096)
    process.send_signal(signal.SIGTERM)
    out, _ = process.communicate(timeout=TIMEOUT_S)
    os.close(terminal)
    assert process.returncode == 0
    assert b"SIMULATED warehouse-scara 0:0" in status
    assert b"virtual here, " in status
    assert "250 kbit/s" in out.splitlines()[0]
    assert out.splitlines()[1] == "on python-can's interface virtual here"
    assert "frames late, ms (p50 p99 max): " in out


def test_other_machines_may_be_allowed() -> None:
    with serving(ROBOT, "--host", "0.0.0.0", "--allow-remote") as server:
        RawClient(server.port).close()
        code, _, stderr = server.end(signal.SIGTERM)
    assert code == 0
    assert "warning" in stderr
    assert "other machines can drive this board" in stderr


def test_no_edge_is_lost_between_two_takes() -> None:
    """Pieces of a trace, put together, are the whole trace."""
    robot = load_robot(ROBOT)
    assert steps_at_joints(robot, list(robot.home))[3] == 0
    board = Board(board_configs(robot)[0], fastest_kernel())
    simulation = Simulation([board], Bus(robot.board.bitrate))
    for frame in frames_of_a_motion():
        simulation.send(frame)
    pieces = []
    for _ in range(300):
        simulation.run_until(simulation.now_counts + 33_333)
        pieces.append(board.take_trace(3))
    whole = [(piece.step_counts, piece.step_signs, piece.clk_fall_counts, piece.dir_levels) for piece in pieces]
    steps, signs, falls, levels = (np.concatenate(arrays) for arrays in zip(*whole, strict=True))
    assert len(steps) == len(falls) == 55
    assert np.all(np.diff(steps) > 0)
    assert signs.sum() == pieces[-1].position_steps == 25
    assert len(levels) == 2
    assert sum(piece.step_counts.size > 0 for piece in pieces) > 10
