"""A server or a host that is held up amid a motion, for longer than the axes wait for a heartbeat of their host."""

import json
import re
import signal
import time
from pathlib import Path
from tempfile import mkdtemp

import pytest

from steptwin.host.cli.app import run
from tests.emulator.live.live_rig import TIMEOUT_S, RawClient
from tests.end_to_end.served import Server, in_real_time, kept_serving, serving

ROBOT = "warehouse-scara"
HOME = "0 0 100 0 60 30"
STALL_S = 0.4
"""Longer than the time-out of the host's heartbeat, 0.35 s."""
STALLS = 3
POINTS = """\
t,sx,sz,L1,th1,th2,th3
0,0,0,100,0,60,30
4,3,1,102,-8,65,24
"""


def hold_up_amid(server: Server, *words: str) -> None:
    """Run a command, which must succeed, and hold the server up some times while the axes move."""
    witness = RawClient(server.port)
    command = server.start(*words)
    witness.expect(b"< frame 77F ")  # the host's heartbeat begins before the motion
    for _ in range(STALLS):
        for _ in range(5):
            witness.expect(b"< frame 193 ")  # th1's report of its state, every 100 ms at least
        with server.held_up():
            time.sleep(STALL_S)
    out, err = command.communicate(timeout=TIMEOUT_S)
    witness.close()
    assert (command.returncode, err) == (0, ""), out


SLOW = ("-o", "units=mm,deg")
"""Says that a file which hardly moves the robot means it."""


@in_real_time
def test_a_run_ends_verified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No axis misses a heartbeat, no queue runs dry, every pulse is right; and the server tells what happened."""
    out = Path(mkdtemp(dir=tmp_path))
    points = out / "points.csv"
    points.write_text(POINTS)
    with serving(ROBOT, "--out", str(out / "live")) as server:
        assert server.run("home", ROBOT, "--here", HOME) == 0
        hold_up_amid(server, "run", ROBOT, str(points), *SLOW)
        code, told, _ = server.end(signal.SIGTERM)
    assert code == 0
    assert run(["verify", str(out / "live")]) == 0
    assert capsys.readouterr().out.endswith(f"{ROBOT} live: PASSED\n")
    report = json.loads((out / "live" / "report.json").read_text())
    stalls = report["real_time"]["stalls"]
    assert stalls["count"] >= STALLS
    assert stalls["longest_ms"] >= 900 * STALL_S
    assert report["wall_s"] - report["simulated_s"] == pytest.approx(stalls["total_ms"] / 1000, abs=0.2)
    text = (
        f"computer too slow: the board's clock stood {stalls['count']} times, {stalls['total_ms'] / 1000:.2f} s in all"
    )
    assert text in told
    assert server.slowness
    assert server.slowness[0].startswith("steptwin: warning: computer too slow: the board's clock stood ")


@pytest.mark.parametrize("words", [("jog", ROBOT, "th1", "2", "--seconds", "4"), ("home", ROBOT, "--together")])
@in_real_time
def test_other_motions_end_in_order(words: tuple[str, ...]) -> None:
    with kept_serving(ROBOT) as server:
        assert server.run("home", ROBOT, "--here", HOME) == 0
        hold_up_amid(server, *words)


@in_real_time
def test_a_host_that_is_held_up_itself(tmp_path: Path) -> None:
    """To the axes it is dead; the message says why."""
    out = Path(mkdtemp(dir=tmp_path))
    points = out / "points.csv"
    points.write_text(POINTS)
    with kept_serving(ROBOT) as server:
        assert server.run("home", ROBOT, "--here", HOME) == 0
        witness = RawClient(server.port)
        command = server.start("run", ROBOT, str(points), *SLOW)
        witness.expect(b"< frame 080 ")  # the SYNC that sets it going
        for _ in range(5):
            witness.expect(b"< frame 393 ")
        command.send_signal(signal.SIGSTOP)
        witness.expect(b"< frame 093 ")  # EMCY
        time.sleep(STALL_S)
        command.send_signal(signal.SIGCONT)
        _, err = command.communicate(timeout=TIMEOUT_S)
        witness.close()
        assert command.returncode == 3
        told = re.fullmatch(
            r"steptwin: \w+: heartbeat lost \(EMCY 0x8130\); "
            r"this computer was too slow: this program was held up for (\d+) ms\n",
            err,
        )
        assert told, err
        assert int(told[1]) >= 250 + 1000 * STALL_S  # the axes' time-out, less a period of the heartbeat, and the rest
