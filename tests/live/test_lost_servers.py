"""Recordings of servers that come to a bad end: killed, interrupted twice, or with a disk that is full."""

import json
import resource
import signal
import subprocess
import time
from pathlib import Path
from tempfile import mkdtemp

import pytest

from steptwin.host.cli.app import run
from steptwin.host.record.folder import read_edges, read_recording
from tests.emulator.live.live_rig import TIMEOUT_S
from tests.end_to_end.command_line import refusal, run_json
from tests.end_to_end.served import Server, in_real_time, serving

ROBOT = "warehouse-scara"
HOME = "0 0 100 0 60 30"
POINTS = """\
t,sx,sz,L1,th1,th2,th3
0,0,0,100,0,60,30
2,9,2,104,7,50,36
4,4,3,103,12,57,21
"""
POLL_S = 0.02
BYTES_LEFT = 2_000


@pytest.fixture(scope="module")
def points(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("points") / "points.csv"
    path.write_text(POINTS)
    return str(path)


def start_motion(server: Server, points: str, folder: Path) -> subprocess.Popen[str]:
    """Start a run on the server; return when its recording goes 0.6 s into the motion."""
    assert server.run("home", ROBOT, "--here", HOME) == 0
    client = server.start("run", ROBOT, points, "-o", "interpolate=stop")
    given_up_s = time.monotonic() + TIMEOUT_S
    while not in_motion(folder):
        assert client.poll() is None, client.communicate()
        assert time.monotonic() < given_up_s
        time.sleep(POLL_S)
    return client


def in_motion(folder: Path) -> bool:
    recording = read_recording(folder)
    assert recording
    mark = recording.mark
    return mark.in_motion and mark.until_counts > mark.start_counts + 43_200_000


def said(stderr: str) -> list[str]:
    """Return the lines on stderr, without the warning that this computer is too slow."""
    return [line for line in stderr.splitlines() if "computer too slow" not in line]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@in_real_time
def test_a_killed_server_leaves_a_recording_that_nothing_replaces_unasked(
    points: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is verified as far as it goes, and says that it has no end."""
    folder = Path(mkdtemp(dir=tmp_path))
    with serving(ROBOT, "--out", str(folder)) as server:
        client = start_motion(server, points, folder)
        server.process.kill()
        client.communicate(timeout=TIMEOUT_S)
    document = run_json(capsys, "verify", str(folder), exit_code=1)
    assert document["passed"] is False
    assert document["reasons"] == [document["interruption"]]
    assert document["interruption"].startswith("the recording has no end: it goes to ")
    assert document["interruption"].endswith(" s into the last motion; so far it is right")
    assert all(axis["pulses"] > 20 for axis in document["axes"])
    assert run(["verify", str(folder)]) == 1
    assert f"{ROBOT} live: INCOMPLETE\n  the recording has no end: " in capsys.readouterr().out
    for form in ("vcd", "vcd-full"):
        assert run(["trace", str(folder), "--format", form, "--out", str(tmp_path / "trace"), "--replace"]) == 0
        assert f"steptwin: warning: {folder}: the recording has no end" in capsys.readouterr().err
        assert (tmp_path / "trace").stat().st_size > 10_000
    before = contents(folder)
    held = f"--out {folder}: holds the recording of a live board that was interrupted, or still runs: "
    free = f"take another folder, such as {folder}-2"
    assert refusal(capsys, "serve", ROBOT, "--port", "0", "--out", str(folder)) == f"{held}{free}, or --replace"
    assert refusal(capsys, "run", ROBOT, points, "--out", str(folder)) == f"{held}{free}"
    assert contents(folder) == before
    with serving(ROBOT, "--out", str(folder), "--replace") as server:
        assert server.end(signal.SIGTERM)[0] == 0
    assert not read_recording(folder)
    assert not read_edges(folder).axes[0].step_counts.size


@in_real_time
def test_two_signals_at_once_end_it_in_order(points: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for pause_s in (0, 0.01):
        folder = Path(mkdtemp(dir=tmp_path))
        with serving(ROBOT, "--out", str(folder), "--json") as server:
            client = start_motion(server, points, folder)
            server.process.send_signal(signal.SIGINT)
            time.sleep(pause_s)
            code, out, err = server.end(signal.SIGINT)
            client.communicate(timeout=TIMEOUT_S)
        assert (code, said(err)) == (0, [])
        report = json.loads((folder / "report.json").read_text())
        assert sorted(report.pop("files")) == ["bus.log", "edges.npz", "robot.toml"]
        assert report == json.loads(out) | {"folder_version": 1}
        assert not read_recording(folder)
        assert read_edges(folder).axes[0].step_counts.size > 20
        refused = refusal(capsys, "serve", ROBOT, "--port", "0", "--out", str(folder))
        assert refused.startswith(f"--out {folder}: holds the recording of a live board: take another folder, such as")


@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="the system cannot limit another process' files")
@in_real_time
def test_a_full_disk_ends_the_recording_and_not_the_motion(
    points: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A limit of the size of files, set amid the motion, stands for the end of the disk."""
    folder = Path(mkdtemp(dir=tmp_path))
    log = folder / "alone.log"
    with serving(ROBOT, "--out", str(folder), "--log", str(log)) as server:
        client = start_motion(server, points, folder)
        bytes_max = (folder / "bus.log").stat().st_size + BYTES_LEFT
        resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE, (bytes_max, bytes_max))
        out, err = client.communicate(timeout=TIMEOUT_S)
        assert (client.returncode, said(err)) == (0, []), out
        assert server.run("status", ROBOT) == 0
        code, stdout, stderr = server.end(signal.SIGTERM)
    recording = read_recording(folder)
    assert recording
    assert recording.mark.in_motion
    ends = f": File too large: the recording in {folder} ends at {recording.until_s:.3f} s"
    *warnings, error = said(stderr)
    assert code == 1
    assert error.startswith(f"steptwin: {folder}/")
    assert error.endswith(ends)
    assert len(warnings) == 2
    of_log, of_folder = sorted(warnings, key=lambda line: "the recording in" in line)
    assert of_folder == error.replace("steptwin: ", "steptwin: warning: ") + "; the board runs on"
    assert of_log.startswith(f"steptwin: warning: {log}: File too large: the bus log ends at ")
    assert "edges and bus log are in" not in stdout
    assert "SIMULATED" in stdout
    document = run_json(capsys, "verify", str(folder), exit_code=1)
    assert document["reasons"] == [document["interruption"]]
    assert document["bus"]["frames"] == recording.mark.frames <= len((folder / "bus.log").read_text().splitlines())
    assert not [path for path in folder.rglob("*") if path.is_file() and not path.stat().st_size]
