"""Teaching on a served board in real time: step to a place, save it, go elsewhere, return; by the commands."""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.twin.live.served_board import ServedBoard
from tests.end_to_end.served import in_real_time

ROBOT = load_robot("teaching-scara")
BESIDE = [30.0, 40.0, 10.0, 0.0]


def tool_of(joints: list[float]) -> list[float]:
    return [float(each) for each in make_kinematics(ROBOT).forward(np.array([joints]))[0]]


@in_real_time
def test_a_taught_position_is_reached_again(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = f"{mkdtemp(dir=tmp_path)}/taught.toml"
    with ServedBoard(ROBOT, port=0, stand_at=BESIDE, kernel=fast_kernel) as served:
        for words in (
            ["home", ROBOT.name, "--here", " ".join(map(str, BESIDE))],
            ["jog", ROBOT.name, "d3", "+5", "--speed", "100"],
            ["jog", ROBOT.name, "y", "-4mm"],
            ["positions", "save", "pick", ROBOT.name, "--file", file],
            ["move", ROBOT.name, "th1=0", "d3=0"],
            ["move", ROBOT.name, "--to", "pick", "--file", file],
        ):
            code = run([*words, "--connect", f"127.0.0.1:{served.port}"])
            assert code == 0, capsys.readouterr().err
    x_mm, y_mm, z_mm, attitude_deg = tool_of(BESIDE)
    ends: list[float] = served.report()["joints"]["end"]
    assert tool_of(ends) == pytest.approx([x_mm, y_mm - 4.0, z_mm - 5.0, attitude_deg], abs=0.1)
