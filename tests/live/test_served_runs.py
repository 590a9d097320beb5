"""The same run on a served board, in virtual time and replayed, and a host that is killed during a run."""

import json
import re
import signal
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.record.folder import read_edges
from tests.emulator.live.live_rig import RawClient
from tests.end_to_end.served import in_real_time, serving

POINTS = """\
t,sx,sz,L1,th1,th2,th3
0,0,0,100,0,60,30
0.4,3,1,102,-8,65,24
0.8,9,2,104,7,50,36
1.2,4,3,103,12,57,21
"""
"""Points from the robot's home on: all joints move, and some reverse."""
ROBOT = "warehouse-scara"
HOME = "0 0 100 0 60 30"
NODES = range(0x10, 0x16)
SHOWN = re.compile(r"< frame (\w+) \S+ (\w*) >")


@pytest.fixture(scope="module")
def points(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("points") / "points.csv"
    path.write_text(POINTS)
    return str(path)


@pytest.fixture(scope="module")
def virtual(points: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the points in virtual time; return the folder."""
    folder = tmp_path_factory.mktemp("virtual")
    assert run(["run", ROBOT, points, "--out", str(folder)]) == 0
    return folder


@pytest.mark.parametrize("boards", ["6", "4,2"])
@in_real_time
def test_live_it_makes_the_same_edges_as_in_virtual_time(
    boards: str, points: str, virtual: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The edges agree to the count, from the servo tick in which the motion begins, and the verifier passes them."""
    live = Path(mkdtemp(dir=tmp_path))
    with serving(ROBOT, "--machine", f"boards={boards}", "--out", str(live)) as server:
        assert server.run("home", ROBOT, "--here", HOME) == 0
        assert server.run("run", ROBOT, points) == 0
        assert server.end(signal.SIGTERM)[0] == 0
    assert json.loads((live / "report.json").read_text())["boards"] == [int(axes) for axes in boards.split(",")]
    ours, theirs = read_edges(live), read_edges(virtual)
    for axis, other in zip(ours.axes, theirs.axes, strict=True):
        assert axis.step_counts.size > 100
        assert axis.start_steps == other.start_steps
        assert axis.step_signs.sum() == other.step_signs.sum()
        for key in ("clk_rise_counts", "clk_fall_counts", "dir_edge_counts", "step_counts"):
            assert np.array_equal(getattr(axis, key) - ours.start_counts, getattr(other, key) - theirs.start_counts)
        assert np.array_equal(axis.step_signs, other.step_signs)
    capsys.readouterr()
    for plan in (
        [],
        ["--plan", str(virtual)],
    ):  # the records received; what was planned
        assert run(["verify", str(live), *plan]) == 0
        assert capsys.readouterr().out.endswith(f"{ROBOT} live: PASSED\n")
    assert run(["replay", str(live)]) == 0  # every frame at its microsecond, every edge at its count
    assert "to the microsecond" in capsys.readouterr().out


class Witness:
    """A client that sends nothing and keeps all frames that it receives."""

    def __init__(self, port: int) -> None:
        self._client = RawClient(port)
        self._seen = b""

    def await_frame(self, identifier: str) -> None:
        """Wait for the next frame with this identifier."""
        text = f"< frame {identifier} ".encode()
        self._seen += self._client.expect(text) + text

    def await_end(self) -> list[str]:
        """Return all frames until the server disconnects, as IDENTIFIER#DATA."""
        self._seen += self._client.until_hung_up()
        self._client.close()
        return [f"{identifier}#{data}" for identifier, data in SHOWN.findall(self._seen.decode("ascii"))]


@in_real_time
def test_a_host_that_is_killed_in_the_middle(points: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """After kill -9 the axes miss the heartbeat and stop; another client sees every frame; a reset is all it takes."""
    folder = Path(mkdtemp(dir=tmp_path))
    log, slow_points = folder / "run.log", folder / "slow.csv"
    slow_points.write_text(re.sub(r"^0\.(\d)", r"\g<1>0", POINTS, flags=re.MULTILINE).replace("\n1.2,", "\n120,"))
    with serving(ROBOT, "--log", str(log)) as server:
        witness = Witness(server.port)
        assert server.run("home", ROBOT, "--here", HOME) == 0
        host = server.start("run", ROBOT, str(slow_points))
        witness.await_frame("080")  # the SYNC that sets it going
        witness.await_frame("390")  # a report of the first axis' queue
        host.kill()
        host.communicate()
        for node in NODES:
            witness.await_frame(f"{0x080 + node:03X}")  # EMCY
        status = {"state": "FAULT", "error": "heartbeat lost", "moving": False, "position_known": True}
        capsys.readouterr()
        assert server.run("status", ROBOT, "--json") == 3
        axes = json.loads(capsys.readouterr().out)["axes"]
        assert [{key: axis[key] for key in status} for axis in axes] == [status] * len(NODES)
        here = " ".join(str(axis["position"]) for axis in axes)
        assert server.run("reset", ROBOT) == 0
        assert server.run("home", ROBOT, "--here", here) == 0
        assert server.run("run", ROBOT, points, "--approach") == 0
        code, stdout, _ = server.end(signal.SIGTERM)
        shown = witness.await_end()
    logged = [line.split()[2] for line in log.read_text().splitlines()]
    assert shown == logged[-len(shown) :]
    assert {frame[:3] for frame in logged[: -len(shown)]} <= {f"{0x700 + node:03X}" for node in NODES}  # boot-up
    assert code == 0
    assert "SIMULATED" in stdout
