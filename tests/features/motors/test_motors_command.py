"""`steptwin run --motors` and `steptwin motors`: whether a robot's motors keep step, from the command line."""

import json
import re
import shutil
from pathlib import Path

import pytest

from steptwin.features.motors.sizing import resonance
from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot
from tests.end_to_end.command_line import refusal, run_json

ROBOT = "teaching-scara"
JOINTS = ["th1", "th2", "d3", "th4"]


@pytest.fixture
def folder(carry_run: Path, tmp_path: Path) -> Path:
    return shutil.copytree(carry_run, tmp_path / "carry")


@pytest.mark.slow
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
    firsts = [min(verdict["joints"], key=lambda joint: joint["first_slip_s"] or 9.0)["name"] for verdict in found[1:]]
    assert [verdict["first_slip"]["name"] for verdict in found[1:]] == firsts
    lost = [joint["lost_full_steps"] for joint in found[2]["joints"] if joint["first_slip_s"] is not None]
    assert lost
    assert all(steps % 4 == 0 for steps in lost)


@pytest.mark.slow
def test_a_run_with_motors_ends_with_their_verdict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is kept in the run's folder, too."""
    assert run(["run", ROBOT, "carry", "--motors", "--out", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(
        rf"{ROBOT}: keeps step, with \d+ % of \w+'s torque left at \d\.\d{{3}} s and \d+ turns a minute", lines[0]
    )
    assert any(line == f"{ROBOT} carry: PASSED" for line in lines)
    assert "motors: keep step, with 0.1 kg at the tool and 24 V ([A] masses)" in lines
    kept = json.loads((tmp_path / "motors.json").read_text(encoding="utf-8"))
    assert kept["kept_step"] is True
    assert [joint["name"] for joint in kept["joints"]] == JOINTS
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["motors"]["kept_step"] is True
    assert run(["verify", str(tmp_path)]) == 0
    (tmp_path / "motors.json").write_text(json.dumps(kept | {"supply_v": 25.0}), encoding="utf-8")
    capsys.readouterr()
    assert run(["verify", str(tmp_path)]) == 1
    assert "report.json says motors = " in capsys.readouterr().out


@pytest.mark.slow
def test_a_stored_run_tells_its_borders_and_draws_its_motors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both sides of each border in JSON; four pictures in a folder of their own. The run turns the shoulder alone."""
    monkeypatch.setattr(resonance, "_RATES", 4)  # a coarse picture is drawn in a tenth of the time
    motion, folder, out = tmp_path / "turn.csv", tmp_path / "run", tmp_path / "pictures"
    motion.write_text("t,th1,th2,d3,th4\n0,0,0,20,0\n0.4,15,0,20,0\n0.8,30,0,20,0\n", encoding="utf-8")
    assert run(["run", ROBOT, str(motion), "--out", str(folder)]) == 0
    capsys.readouterr()
    document = run_json(capsys, "motors", str(folder), "--margin", "--out", str(out))
    for quantity in ("current_a", "payload_kg", "stretch"):
        border = document["margins"][quantity]
        assert border["keeps"] is not None
        if border["slips"] is not None:
            assert border["joint"] in JOINTS
            assert (border["slips"] - border["keeps"]) * (border["limit"] - border["keeps"]) > 0
    tool = document["motors"]["tool"]
    assert 0.0 < tool["position_mm_end"] < tool["position_mm_max"] < 5.0
    assert document["motors"]["supply_v_min"] < 24.0 <= document["motors"]["supply_v_max"]
    assert sorted(path.name for path in out.iterdir()) == [
        "motor-load.png", "motor-resonance.png", "motor-tool.png", "motor-torque.png"
    ]  # fmt: skip


@pytest.mark.slow
def test_a_robot_tells_which_motors_would_do(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["motors", ROBOT, "--payload", "0.5", "--current", "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:3] == ["joint", "motor", "A"]
    own = {words[0]: words for line in lines if (words := line.split()) and words[0] in JOINTS}
    assert list(own) == JOINTS
    assert sum(line.startswith("17HS19-2004S1 ") for line in lines) == 1
    assert lines[-1] == "motors: with 0.5 kg at the tool and 24 V ([A] masses)"
    document = run_json(capsys, "motors", ROBOT)
    assert [joint["name"] for joint in document["joints"]] == JOINTS
    assert document["assumed"] == ["masses"]


@pytest.mark.parametrize(
    "words",
    [
        ["motors", "teaching-scar"],
        ["motors", ROBOT, "--margin"],
        ["motors", ROBOT, "--out", "x"],
        ["motors", ROBOT, "--current", "0"],
        ["motors"],
    ],
)
def test_a_subject_that_is_neither_or_takes_no_such_option_is_refused(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    refusal(capsys, *words)


@pytest.mark.parametrize(
    "words",
    [
        ["--current", "3.1"],
        ["--payload", "-1"],
        ["--supply", "35"],
    ],
)
def test_what_no_driver_or_arm_can_have_is_refused(
    words: list[str], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refusal(capsys, "motors", str(folder), *words)


def test_a_robot_without_motors_is_told_what_is_missing(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    mine = tmp_path / "mine.toml"
    mine.write_text(text[: text.index("[joints.d3.motor]")] + text[text.index("[joints.th4]") :], encoding="utf-8")
    said = "joints.d3.motor: is missing: the joint's motor is unknown (docs/motors.md)"
    assert refusal(capsys, "run", "--robot-file", str(mine), "carry", "--motors") == said


@pytest.mark.slow
def test_motors_in_the_loop_tell_what_they_tell_after_the_run(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With too heavy a payload the run fails, and says which rotor slips, when, and how far away it ends."""
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    mine = tmp_path / "mine.toml"
    mine.write_text(text.replace("payload_kg = 0.1", "payload_kg = 80.0"), encoding="utf-8")
    words = ("run", "--robot-file", str(mine), "carry")
    out = tmp_path / "out"
    slipped = run_json(capsys, *words, "--motors=loop", "--out", str(out), exit_code=1)
    (reason,) = slipped["reasons"][:1]
    assert reason in run_json(capsys, "verify", str(out), exit_code=1)["reasons"]
    after = run_json(capsys, *words, "--motors", exit_code=1)
    assert slipped["passed"] is False
    assert "full steps away" in slipped["reasons"][0]
    first = [
        min((joint["first_slip_s"], joint["name"]) for joint in each["motors"]["joints"] if joint["first_slip_s"])
        for each in (slipped, after)
    ]
    assert first[0] == first[1]
    refusal(capsys, *words, "--motors=lop")


@pytest.mark.slow
def test_a_server_warns_of_homings_that_stall(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The warning comes before the wrong port is refused; our own robots' files give no reason for one."""
    steep = tmp_path / "steep.toml"
    steep.write_text(load_robot("lab-scara").toml.replace("acceleration = 45.0", "acceleration = 720.0"))
    for robot, warned in (("lab-scara", []), (str(steep), ["th2: homing stalls at 720 deg/s2"])):
        assert run(["serve", robot, "--machine", "motors", "--port", "70000"]) == 2
        *warnings, refusal = capsys.readouterr().err.splitlines()
        assert [line.removeprefix("steptwin: warning: ").partition(" where")[0] for line in warnings] == warned
        assert "--port 70000" in refusal
