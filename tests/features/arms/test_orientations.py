"""Orientations on the command line: each option means what its name says, one a pose, and the rest is one line."""

from pathlib import Path

import pytest
from scipy.spatial.transform import Rotation

from steptwin.host.cli.app import run
from steptwin.host.robots.poses.rotations import LEVEL_DEG
from tests.end_to_end.command_line import refusal, run_json
from tests.features.arms.arms import AR4_LIMITS, AR4_ROWS, chain_text, dh_entries

PLACE = ["--x", "300", "--y", "20", "--z", "280"]


@pytest.fixture
def five_axes(tmp_path: Path) -> str:
    path = tmp_path / "five.toml"
    more = "tool = { xyz_mm = [0, 41, 0], rpy_deg = [-90, 0, 0] }"
    path.write_text(chain_text(dh_entries(AR4_ROWS[:5]), AR4_LIMITS[:5], more=more), encoding="utf-8")
    return str(path)


def joints(capsys: pytest.CaptureFixture[str], *words: str) -> list[float]:
    document = run_json(capsys, "ik", "ar4-mk3", *PLACE, *words)
    return list(document["branches"][0]["joints"].values())


def test_each_option_by_its_convention(capsys: pytest.CaptureFixture[str]) -> None:
    """Rz(10) Ry(20) Rx(170), as scipy has it."""
    turn = Rotation.from_euler("ZYX", [10.0, 20.0, 170.0], degrees=True)
    options = {
        "--rpy": "170 20 10",
        "--abc": "10 20 170",
        "--quaternion": " ".join(map(repr, turn.as_quat().tolist())),
        "--rotvec": ",".join(map(repr, turn.as_rotvec(degrees=True).tolist())),
    }
    first, *others = (joints(capsys, option, text) for option, text in options.items())
    for other in others:
        assert other == pytest.approx(first, abs=1e-9)


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["--rpy", "1 2"],
        ["--rpy", "a 2 3"],
        ["--quaternion", "nan 0 0 0"],
        ["--quaternion", "1.0011 0 0 0"],
        ["--rpy", "1 2 3", "--abc", "1 2 3"],
        ["--direction", "0 0 -1"],
        ["--phi", "3"],
    ],
)
def test_what_is_no_pose(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "ik", "ar4-mk3", *PLACE, *words)


def test_a_quaternion_just_within_its_rounding(capsys: pytest.CaptureFixture[str]) -> None:
    assert joints(capsys, "--quaternion", "1.0009 0 0 0") == joints(capsys, "--quaternion", "1 0 0 0")


def test_the_spin_of_five_axes_follows(five_axes: str, capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "ik", five_axes, *PLACE)
    refusal(capsys, "ik", five_axes, *PLACE, "--rpy", "180 0 0")
    assert run(["ik", five_axes, *PLACE, "--direction", "0 0 -2"]) == 0


def test_a_move_is_refused_before_the_board_is_asked(five_axes: str, capsys: pytest.CaptureFixture[str]) -> None:
    """There is no board at this address: a wrong pose is told first."""
    words = ["--rpy", "1 2 3", "--connect", "127.0.0.1:1"]
    refusal(capsys, "move", five_axes, *words)
    refusal(capsys, "move", "lab-scara", *words)


@pytest.mark.parametrize(("q5", "is_told"), [("0", True), ("0.0009", True), ("0.0011", False)])
def test_straight_up_it_is_said_that_the_roll_is_0(q5: str, is_told: bool, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fk", "ar4-mk3", "0", "0", "0", "0", q5, "0"]) == 0
    assert ("(at this pitch roll and yaw are one turn, all of it yaw)" in capsys.readouterr().out) is is_told
    assert LEVEL_DEG == 89.999
