"""`steptwin run --motors` and `steptwin motors`: whether a robot's motors keep step, from the command line."""

from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import refusal, run_json

ROBOT = "teaching-scara"
JOINTS = ["th1", "th2", "d3", "th4"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("motors") / "carry"
    assert run(["run", ROBOT, "carry", "--out", str(path)]) == 0
    return path


def test_a_stored_run_keeps_step_until_the_payload_is_too_large(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Needed and available torques make the margin; the first slip moves to earlier instants as the payload grows."""
    found = [
        run_json(capsys, "motors", str(folder), *words, exit_code=code)["motors"]
        for words, code in (((), 0), (("--payload", "40"), 1), (("--payload", "80"), 1))
    ]
    assert [verdict["kept_step"] for verdict in found] == [True, False, False]
    assert found[0]["assumed"] == ["masses"]
    assert [joint["name"] for joint in found[0]["joints"]] == JOINTS
    for joint in found[0]["joints"]:
        assert joint["margin"] == pytest.approx(1.0 - joint["torque_needed_nm"] / joint["torque_available_nm"])
        assert abs(joint["load_angle_deg"]) < 90.0
        assert (joint["first_slip_s"], joint["lost_full_steps"]) == (None, 0.0)
        assert joint["winding_celsius"] > 25.0
    margins = [min(joint["margin"] for joint in verdict["joints"]) for verdict in found]
    assert margins == sorted(margins, reverse=True)
    slips = [min(joint["first_slip_s"] or 9.0 for joint in verdict["joints"]) for verdict in found]
    assert slips == sorted(slips, reverse=True)
    lost = [joint["lost_full_steps"] for joint in found[2]["joints"] if joint["first_slip_s"] is not None]
    assert lost
    assert all(steps % 4 == 0 for steps in lost)


def test_a_run_with_motors_ends_with_their_verdict(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["run", ROBOT, "carry", "--motors"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line == f"{ROBOT} carry: PASSED" for line in lines)
    assert lines[-1] == "motors: keep step, with 0.1 kg at the tool and 24 V ([A] masses)"


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--current", "3.1"], "--current 3.1 A is not above 0 and up to 3 A"),
        (["--payload", "-1"], "--payload: -1 kg is negative"),
        (["--supply", "35"], "--supply: 35 V is outside 4.5..34 V, the TB6560AHQ's operating range"),
    ],
)
def test_what_no_driver_or_arm_can_have_is_refused(
    words: list[str], line: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert refusal(capsys, "motors", str(folder), *words) == line


def test_a_robot_without_motors_is_told_what_is_missing(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    mine = tmp_path / "mine.toml"
    mine.write_text(text[: text.index("[joints.d3.motor]")] + text[text.index("[joints.th4]") :], encoding="utf-8")
    said = "joints.d3.motor: is missing: the joint's motor is unknown (docs/motors.md)"
    assert refusal(capsys, "run", "--robot-file", str(mine), "carry", "--motors") == said
