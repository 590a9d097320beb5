"""`steptwin check my-arm.toml`: everything that is wrong in a robot file, or what it amounts to."""

from importlib.resources import files
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import run_json

TEXT = (files("steptwin.host.robots") / "teaching-scara.toml").read_text(encoding="utf-8")

WRONG = {
    "travel_per_turn = 5.0": "travel_per_trun = 5.0",
    "l2_mm = 100.0": "l2_mm = '100'",
    "osc_pf = 330": "osc_pf = 12",
    "bitrate = 1_000_000": "bitrate = 999",
    "microsteps = 16": "microsteps = 4",
    "ratio = 4.0": "",
    "th4 = 0.0 #": "th5 = 0.0 #",
    'joint = "th4", out = 1': 'joint = "th4", out = 9',
}
"""Mistakes in as many tables; each replaces the first occurrence."""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    return tmp_path / "my-arm.toml"


def test_all_mistakes_are_named_at_once(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = TEXT
    for old, new in WRONG.items():
        assert old in text
        text = text.replace(old, new, 1)
    arm.write_text(text, encoding="utf-8")
    messages = run_json(capsys, "check", str(arm), exit_code=2)["findings"]
    for words in (
        "joints.d3.travel_per_trun: key 'travel_per_trun' is unknown: did you mean travel_per_turn?",
        "kinematics.l2_mm: '100' is not a number",
        "board.osc_pf: 12 pF makes the TB6560's oscillator faster",
        "board.bitrate: 999 is not one of",
        "joints.th1.ratio: is missing",
        "home.th5: key 'th5' is unknown: did you mean th4",
        "outputs.gripper.out: 9 is not from 1",
    ):
        assert len([message for message in messages if words in message]) == 1, (words, messages)
    assert len(messages) == 7  # the wrong microsteps stand beside a missing ratio, without which there is no joint


def test_the_key_that_is_meant_is_not_called_missing(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm.write_text(TEXT.replace("travel_per_turn", "travel_per_rev"), encoding="utf-8")
    assert run(["check", str(arm)]) == 2
    line = f"{arm}: joints.d3.travel_per_rev: key 'travel_per_rev' is unknown: did you mean travel_per_turn?\n"
    assert capsys.readouterr().err == line


def test_mistakes_of_several_joints_beside_impossible_dimensions(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = TEXT.replace("speed_max = 180.0", "speed_max = 999.0").replace("l1_mm = 95.0", "l1_mm = 0.0")
    arm.write_text(text, encoding="utf-8")
    assert run_json(capsys, "check", str(arm), exit_code=2)["findings"] == [
        "kinematics: links of 0 and 100 mm make no arm",
        "joints.th1.speed_max: 999 deg/s takes 35.5 kHz of steps, more than the driver's 15.0 kHz;"
        " speed_max = 421.875 or microsteps = 2 would do",
        "joints.th2.speed_max: 999 deg/s takes 35.5 kHz of steps, more than the driver's 15.0 kHz;"
        " speed_max = 421.875 or microsteps = 2 would do",
    ]


def test_a_right_file_says_what_it_amounts_to(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """5 mm of lead at 1/8 step are 320 steps/mm; stretched to folded at 150 deg the arm of 95 + 100 mm reaches
    195 to sqrt(95^2 + 100^2 - 2 * 95 * 100 cos 30) = 50.70 mm.
    """
    arm.write_text(TEXT, encoding="utf-8")
    document = run_json(capsys, "check", str(arm))
    assert (document["kind"], document["findings"], document["robot"]) == ("robot", [], "teaching-scara")
    lift = next(joint for joint in document["joints"] if joint["name"] == "d3")
    assert (lift["lower"], lift["upper"], lift["unit"], lift["steps_per_unit"]) == (0, 60, "mm", 320)
    assert (lift["speed_max"], lift["step_rate_max_hz"], lift["homing_method"]) == (40, 12800, 17)
    assert lift["step_rate_percent"] == pytest.approx(85.333, abs=1e-3)
    assert document["reach"]["radius_mm"] == pytest.approx([50.7003, 195.0], abs=1e-3)
    assert document["reach"]["z_mm"] == pytest.approx([-100, -40])
    assert run(["check", str(arm)]) == 0
    out = capsys.readouterr().out
    assert "the tool reaches r = 50.7..195.0 mm at z = -40 mm, an area of " in out
    assert f"{document['reach']['area_mm2'] / 100:.0f} cm2; z = -100.0..-40.0 mm" in out


def test_a_robot_file_needs_no_robot(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm.write_text(TEXT, encoding="utf-8")
    assert run(["check", str(arm), "lab-scara"]) == 2
    assert capsys.readouterr().err == f"{arm}: is a robot itself: leave lab-scara out\n"


def test_a_file_of_no_kind(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm.write_text("name = 'x'\n", encoding="utf-8")
    assert run(["check", str(arm)]) == 2
    words = "has none of step, steps, sequences, kinematics, joints, board: it is no program and no robot"
    assert capsys.readouterr().err == f"steptwin: {arm}: {words}\n"
