"""The live commands on a served board in real time."""

import re
import subprocess

from tests.emulator.live.live_rig import TIMEOUT_S
from tests.end_to_end.served import Server, in_real_time, kept_serving

ROBOT = "warehouse-scara"
HOME = "0 0 100 0 60 30"
END_ERROR_STEPS_MAX = 0.5 + 1 / 16


def await_streaming(server: Server, running: subprocess.Popen[str]) -> None:
    while not server.json("status", ROBOT)["streaming"]:
        assert running.poll() is None, running.communicate()


@in_real_time
def test_a_homed_machine_runs_a_job_to_its_planned_end() -> None:
    with kept_serving(ROBOT) as server:
        server.json("home", ROBOT, "--together")
        document = server.json("run", ROBOT, "pull-line", "--approach", "-o", "duration_s=4", "-o", "ramp_s=1")
    assert document["passed"]
    assert all(abs(axis["error_steps"]) <= END_ERROR_STEPS_MAX for axis in document["axes"])


@in_real_time
def test_a_run_that_is_stopped() -> None:
    """Another process stops it long before its end: exit code 3, and the machine's position stays known."""
    with kept_serving(ROBOT) as server:
        assert server.run("home", ROBOT, "--here", HOME) == 0
        running = server.start("run", ROBOT, "pull-line", "--approach", "-o", "duration_s=120")
        await_streaming(server, running)
        stopped = server.json("stop", ROBOT)
        out, err = running.communicate(timeout=TIMEOUT_S)
        assert (running.returncode, out) == (3, "")
        assert re.fullmatch(r"steptwin: \w+: was stopped, the drive is in QUICK STOP ACTIVE\n", err)
        assert {(axis["state"], axis["position_known"]) for axis in stopped["axes"]} == {("QUICK STOP ACTIVE", True)}
        server.json("move", ROBOT, "th1=10")
        off = server.json("estop", ROBOT)
        assert {(axis["state"], axis["position_known"]) for axis in off["axes"]} == {("FAULT", True)}


@in_real_time
def test_programs_that_only_watch() -> None:
    with kept_serving(ROBOT) as server:
        assert server.run("home", ROBOT, "--here", HOME) == 0
        assert server.json("doctor", ROBOT)["passed"]
        frames = server.json("monitor", ROBOT, "--service", "tpdo", "--node", "th1", "--count", "3")["frames"]
        assert {(frame["service"], frame["node"]) for frame in frames} == {("tpdo", "th1")}
