"""Bad input: one line on stderr that names value, limit and the nearest valid choice, exit code 2, no frame sent."""

import dataclasses
import re
from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.bus.can_controller import CanController
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from tests.end_to_end.command_line import refusal
from tests.messages import refusing

RUN = ["run", "warehouse-scara", "pull-line"]


@pytest.fixture
def frames(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Record every frame that is sent on any bus."""
    sent: list[object] = []
    monkeypatch.setattr(CanController, "send", lambda _station, frame, _now: sent.append(frame))
    return sent


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(["run", "warehouse-skara", "pull-line"], id="robot"),
        pytest.param(["run", "warehouse-scara", "drawer-pul"], id="job"),
        pytest.param(["run", "warehouse-scara", __file__], id="kind of file"),
        pytest.param([*RUN, "-o", "elbo=left"], id="option of a job"),
        pytest.param([*RUN, "-o", "elbow=lft"], id="elbow"),
        pytest.param([*RUN, "-o", "duration_s"], id="no value"),
        pytest.param([*RUN, "-o", "ramp_s=1", "-o", "ramp_s=2"], id="two values"),
        pytest.param([*RUN, "--kernel", "c"], id="kernel"),
        pytest.param([*RUN, "-o", "duration_s=soon"], id="no number"),
        pytest.param([*RUN, "-o", "ramp_s=6"], id="ramps longer than the motion"),
        pytest.param([*RUN, "-o", "L1_mm=250"], id="joint limit"),
        pytest.param([*RUN, "-o", "duration_s=0.6", "-o", "ramp_s=0.24"], id="joint speed"),
        pytest.param([*RUN, "-o", "duration_s=0.2", "-o", "ramp_s=0.1"], id="step rate of the driver"),
        pytest.param([*RUN, "-o", "duration_s=1.0005"], id="duration in whole ms"),
        pytest.param([*RUN, "--machine", "stand-at=0 0 100 0 61 30"], id="start elsewhere"),
        pytest.param([*RUN, "--machine", "stand-at=0 0 100"], id="too few joints"),
        pytest.param([*RUN, "--machine", "stand-at=0 0 a 0 0 0"], id="joint that is not a number"),
        pytest.param([*RUN, "--out", "/dev/null/x"], id="folder that cannot be"),
        pytest.param([*RUN, "--machine", "driver-profile=slow-blue"], id="driver"),
        pytest.param([*RUN, "--out", ""], id="folder without a name"),
        pytest.param([*RUN, "--machine", "stand-at=0 0 nan 0 60 30"], id="nan"),
        pytest.param(["fk", "warehouse-scara", *["0", "0", "inf", "0", "60", "30"]], id="fk of inf"),
        pytest.param(
            ["ik", "warehouse-scara", *["--x", "1e300", "--y", "0", "--z", "0", "--phi", "0"]], id="ik far out"
        ),
        pytest.param([*RUN, "--jsn"], id="option of the command"),
        pytest.param(["rum"], id="command"),
        pytest.param(["run", "warehouse-scara"], id="missing argument"),
        pytest.param(["fk", "warehouse-scara", "1", "2"], id="fk with too few joints"),
        pytest.param(["fk", "warehouse-scara", *["0", "0", "0", "0", "0", "x"]], id="fk with no number"),
        pytest.param(["fk", "wharehouse", *"000000"], id="fk of an unknown robot"),
        pytest.param(["ik", "warehouse-scara", "--x", "1"], id="ik without all of the pose"),
        pytest.param(["jobs", "warehouse"], id="jobs of an unknown robot"),
    ],
)
def test_one_line_and_exit_code_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str], frames: list[object]
) -> None:
    refusal(capsys, *arguments)
    assert frames == []


def test_a_robot_without_homing_is_told_of_here(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message comes before the bus is opened."""
    homed = load_robot("teaching-scara").toml
    path = tmp_path / "mine.toml"
    path.write_text(re.sub(r"^\[joints\.th1\.homing\]\n(?:.+\n)+", "", homed, flags=re.MULTILINE))
    refusal(capsys, "home", str(path), "--connect", "127.0.0.1:1")


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


@pytest.mark.slow
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
