"""Bad input: one line on stderr that names value, limit and the nearest valid choice, exit code 2, no frame sent."""

import dataclasses
import re
from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.bus.can_controller import CanController
from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from tests.messages import refusing

RUN = ["run", "warehouse-scara", "pull-line"]


@pytest.fixture
def frames(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Record every frame that is sent on any bus."""
    sent: list[object] = []
    monkeypatch.setattr(CanController, "send", lambda _station, frame, _now: sent.append(frame))
    return sent


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        pytest.param(["run", "warehouse-skara", "pull-line"], ["warehouse-skara", "warehouse-scara"], id="robot"),
        pytest.param(["run", "warehouse-scara", "drawer-pul"], ["drawer-pul", "drawer-pull"], id="job"),
        pytest.param(
            ["run", "warehouse-scara", __file__], ["test_bad_input.py", ".csv, .json, .yaml"], id="kind of file"
        ),
        pytest.param([*RUN, "-o", "elbo=left"], ["elbo", "elbow"], id="option of a job"),
        pytest.param([*RUN, "--elbow", "lft"], ["lft", "left"], id="elbow"),
        pytest.param([*RUN, "-o", "duration_s"], ["duration_s", "NAME=VALUE"], id="no value"),
        pytest.param([*RUN, "-o", "ramp_s=1", "-o", "ramp_s=2"], ["ramp_s", "twice", "1", "2"], id="two values"),
        pytest.param([*RUN, "--kernel", "c"], ["'--kernel': 'c' is not one of", "numba"], id="kernel"),
        pytest.param([*RUN, "-o", "duration_s=soon"], ["duration_s", "soon"], id="no number"),
        pytest.param([*RUN, "-o", "ramp_s=6"], ["ramp", "6", "5"], id="ramps longer than the motion"),
        pytest.param([*RUN, "-o", "L1_mm=250"], ["L1", "250", "200"], id="joint limit"),
        pytest.param(
            [*RUN, "-o", "duration_s=0.6", "-o", "ramp_s=0.24"], ["th1", "deg/s", "120", "t ="], id="joint speed"
        ),
        pytest.param(
            [*RUN, "-o", "duration_s=0.2", "-o", "ramp_s=0.1"],
            ["th1", "kHz", "15", "t ="],
            id="step rate of the driver",
        ),
        pytest.param([*RUN, "-o", "duration_s=1.0005"], ["1.0005", "millisecond"], id="duration in whole ms"),
        pytest.param([*RUN, "--stand-at", "0 0 100 0 61 30"], ["th2", "60", "61", "deg"], id="start elsewhere"),
        pytest.param([*RUN, "--stand-at", "0 0 100"], ["--stand-at", "3", "6"], id="too few joints"),
        pytest.param([*RUN, "--stand-at", "0 0 a 0 0 0"], ["--stand-at", "'a'"], id="joint that is not a number"),
        pytest.param([*RUN, "--out", "/dev/null/x"], ["--out", "/dev/null"], id="folder that cannot be"),
        pytest.param(
            [*RUN, "--driver-profile", "slow-blue"], ["driver profile", "slow-blue", "slow-blue-board"], id="driver"
        ),
        pytest.param([*RUN, "--out", ""], ["--out", "empty"], id="folder without a name"),
        pytest.param([*RUN, "--stand-at", "0 0 nan 0 60 30"], ["--stand-at", "nan", "finite"], id="nan"),
        pytest.param(["fk", "warehouse-scara", *["0", "0", "inf", "0", "60", "30"]], ["inf", "finite"], id="fk of inf"),
        pytest.param(
            ["ik", "warehouse-scara", *["--x", "1e300", "--y", "0", "--z", "0", "--phi", "0"]],
            ["--x", "1e300"],
            id="ik far out",
        ),
        pytest.param([*RUN, "--jsn"], ["--jsn", "--json"], id="option of the command"),
        pytest.param(["rum"], ["rum", "run"], id="command"),
        pytest.param(["run", "warehouse-scara"], ["JOB"], id="missing argument"),
        pytest.param(["fk", "warehouse-scara", "1", "2"], ["2", "6", "sx"], id="fk with too few joints"),
        pytest.param(["fk", "warehouse-scara", *["0", "0", "0", "0", "0", "x"]], ["'x'"], id="fk with no number"),
        pytest.param(["fk", "wharehouse", *"000000"], ["wharehouse", "warehouse-scara"], id="fk of an unknown robot"),
        pytest.param(["ik", "warehouse-scara", "--x", "1"], ["--y"], id="ik without all of the pose"),
        pytest.param(["jobs", "warehouse"], ["warehouse-scara"], id="jobs of an unknown robot"),
    ],
)
def test_one_line_and_exit_code_2(
    arguments: list[str], words: list[str], capsys: pytest.CaptureFixture[str], frames: list[object]
) -> None:
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1
    assert captured.err.startswith("steptwin: ")
    for word in words:
        assert word in captured.err
    assert frames == []


def test_a_robot_without_homing_is_told_of_here(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message comes before the bus is opened."""
    homed = load_robot("teaching-scara").toml
    path = tmp_path / "mine.toml"
    path.write_text(re.sub(r"^\[joints\.th1\.homing\]\n(?:.+\n)+", "", homed, flags=re.MULTILINE))
    assert run(["home", str(path), "--connect", "127.0.0.1:1"]) == 2
    told = "th1: the robot's file has no homing for it; say where it stands by --here"
    assert capsys.readouterr() == ("", f"steptwin: {told}\n")


@pytest.mark.parametrize(("offset_deg", "accepted"), [(0.0112, True), (0.0113, False)])
def test_the_start_may_be_half_a_step_off(fast_kernel: Kernel, offset_deg: float, accepted: bool) -> None:
    """th1 makes steps of 0.0225 deg."""
    robot = load_robot("warehouse-scara")
    planned = plan(robot, make_job(robot, "pull-line", {"duration_s": "1", "ramp_s": "0.4"}))
    standing = [0.0, 0.0, 100.0, offset_deg, 60.0, 30.0]
    if accepted:
        assert execute(planned, "pull-line", fast_kernel, stand_at=standing).fault is None
    else:
        with refusing(InputError):
            execute(planned, "pull-line", fast_kernel, stand_at=standing)


def test_a_driver_that_is_slower_than_the_firmware_believes_fails_the_run(fast_kernel: Kernel) -> None:
    """With 1000 pF at OSC the chip needs pulses of 90 us: it counts nothing, and the report shows it."""
    robot = load_robot("warehouse-scara")
    slow = dataclasses.replace(robot, board=dataclasses.replace(robot.board, osc_pf=1000))
    planned = plan(slow, make_job(slow, "pull-line", {"duration_s": "2", "ramp_s": "0.5"}))
    report = execute(planned, "pull-line", fast_kernel).report
    th1 = report.axes[3]
    assert not report.passed
    assert th1.violations == th1.pulses > 1800
    assert th1.steps_end == th1.steps_start
    assert any("th1" in reason and "violations" in reason for reason in report.reasons)
