"""The commands as programs against a served board, in real time, each its own process."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

PROGRAM = [sys.executable, "-c", "from steptwin.host.cli import main; main()"]
ROBOT = "warehouse-scara"
TIMEOUT_S = 120.0
END_ERROR_STEPS_MAX = 0.5 + 1 / 16


class Served:
    """A served board and the command line that talks to it."""

    def __init__(self, port: int) -> None:
        self._connect = ["--connect", f"127.0.0.1:{port}"]

    def start(self, *words: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [*PROGRAM, *words, *self._connect], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    def run(self, *words: str) -> tuple[int, str, str]:
        process = self.start(*words)
        out, err = process.communicate(timeout=TIMEOUT_S)
        return process.returncode, out, err

    def json(self, *words: str) -> dict[str, Any]:
        exit_code, out, err = self.run(*words, "--json")
        assert (exit_code, err) == (0, "")
        document: dict[str, Any] = json.loads(out)
        return document

    def await_streaming(self, running: subprocess.Popen[str]) -> None:
        while not self.json("status", ROBOT)["streaming"]:
            assert running.poll() is None, running.communicate()


@contextmanager
def serving() -> Iterator[Served]:
    server = subprocess.Popen([*PROGRAM, "serve", ROBOT, "--port", "0"], stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    try:
        ports = (re.search(r"socketcand at 127\.0\.0\.1:(\d+)", line) for line in server.stdout)
        port = next(found[1] for found in ports if found)
        yield Served(int(port))
    finally:
        server.terminate()
        server.communicate(timeout=TIMEOUT_S)


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    """A board that was homed."""
    with serving() as board:
        board.json("home", ROBOT, "--together")
        yield board


def test_a_run_ends_where_planned(served: Served) -> None:
    document = served.json("run", ROBOT, "drawer-pull", "--approach")
    assert document["passed"]
    assert all(abs(axis["error_steps"]) <= END_ERROR_STEPS_MAX for axis in document["axes"])


def test_a_run_that_is_stopped(served: Served) -> None:
    """By another process, in the middle: exit code 3, and the machine knows where it is."""
    running = served.start("run", ROBOT, "drawer-pull", "--approach")
    served.await_streaming(running)
    stopped = served.json("stop", ROBOT)
    out, err = running.communicate(timeout=TIMEOUT_S)
    assert (running.returncode, out) == (3, "")
    assert re.fullmatch(r"steptwin: \w+: was stopped, the drive is in QUICK STOP ACTIVE\n", err)
    assert {(axis["state"], axis["position_known"]) for axis in stopped["axes"]} == {("QUICK STOP ACTIVE", True)}
    served.json("move", ROBOT, "th1=10")
    off = served.json("estop", ROBOT)
    assert {(axis["state"], axis["position_known"]) for axis in off["axes"]} == {("SWITCH ON DISABLED", True)}


def test_others_look_on(served: Served) -> None:
    assert served.run("doctor", ROBOT)[0] == 0
    frames = served.json("monitor", ROBOT, "--service", "tpdo", "--node", "th1", "--count", "3")["frames"]
    assert {(frame["service"], frame["node"]) for frame in frames} == {("tpdo", "th1")}
