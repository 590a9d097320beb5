"""The commands' tables in a terminal of 80 columns, for every robot: no line is longer, no word or number is broken."""

import re

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.robots.kinematics import make_kinematics
from tests.end_to_end.marks import slow_but

WIDTH = 80
ROBOTS = [name for name in robot_names() if name not in ("parol6", "thor")]
"""Those two print the tables of an AR4, whose kind they are."""


def printed(words: list[str], width: int, patch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return the lines that a command prints on a terminal of this width."""
    patch.setenv("FORCE_COLOR", "1")  # rich then takes stdout for a terminal
    patch.setenv("TERM", "xterm")
    patch.setenv("COLUMNS", str(width))
    assert run(words) == 0
    return re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out).splitlines()


def commands(robot: str) -> list[list[str]]:
    """Return the commands that print tables without a live board."""
    loaded = load_robot(robot)
    kinematics = make_kinematics(loaded)
    if not kinematics.task.width:
        return [["robots"], ["jobs", robot]]
    x_mm, y_mm, z_mm, *turn_deg = kinematics.task.figures(kinematics.forward(np.array([loaded.home])))[0].tolist()
    option = "--phi" if kinematics.task.is_flat else "--rpy"
    turned = [option, " ".join(f"{angle_deg:.9f}" for angle_deg in turn_deg)] if turn_deg else []
    place = zip(("--x", "--y", "--z"), (x_mm, y_mm, z_mm), strict=True)
    return [
        ["robots"],
        ["jobs", robot],
        ["workspace", robot, "--samples", "1000", *(turned if kinematics.task.is_flat else [])],
        ["ik", robot, *(word for option, value in place for word in (option, f"{value:.9f}")), *turned],
    ]


@pytest.mark.slow
@pytest.mark.parametrize("robot", slow_but(["teaching-scara", "lab-scara", "turntable"], ROBOTS))
def test_tables_fit(robot: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for words in commands(robot):
        wide = {word for line in printed(words, 400, monkeypatch, capsys) for word in line.split()}
        for line in printed(words, WIDTH, monkeypatch, capsys):
            whole = "─" in line or ":" in line  # the rule, and sentences, which the terminal wraps
            assert whole or len(line) <= WIDTH, line
            assert "─" in line or set(line.split()) <= wide, line


@pytest.mark.parametrize("robot", slow_but(["teaching-scara"], ROBOTS))
def test_the_report_of_a_run_fits(
    robot: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    """That of a stored run is the same."""
    if robot == "teaching-scara":
        folder = request.getfixturevalue("carry_run")
    else:
        folder = request.getfixturevalue("example_run")(robot) / "run"
    lines = printed(["verify", str(folder)], WIDTH, monkeypatch, capsys)
    start = next(i for i, line in enumerate(lines) if line.startswith("axis"))
    end = next(i for i, line in enumerate(lines) if line.startswith("CLK:"))
    assert lines[:start] == ([f"drivers: {profile}"] if (profile := load_robot(robot).board.driver_profile) else [])
    assert end - start == 2 + len(load_robot(robot).axes)
    assert max(map(len, lines[:end])) <= WIDTH
