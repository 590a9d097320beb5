"""What cannot be an arm, or cannot be reached by one: a line with the value, the limit and what would do."""

from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot
from tests.end_to_end.command_line import refusal, run_json
from tests.features.urdf.urdfs import joint, urdf

AR4 = load_robot("ar4-mk3").toml
ROW = [joint(f"J{i + 1}", "abcdefg"[i], "bcdefgh"[i], f'<axis xyz="0 {i % 2} {1 - i % 2}"/>') for i in range(7)]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def of_urdf(capsys: pytest.CaptureFixture[str], text: str) -> str:
    """What `new` says of a URDF, which writes no file."""
    Path("arm.urdf").write_text(text, encoding="utf-8")
    told = refusal(capsys, "new", "arm.toml", "--urdf", "arm.urdf", "--tip", "h")
    assert not Path("arm.toml").exists()
    return told


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            urdf(*ROW),
            "arm.urdf: 7 joints move the tool, its place and turn take 3, 5 or 6: hold 1 where they stand, as in"
            " --set held=J1",
        ),
        (
            urdf(*ROW).replace('lower="-2" upper="2.5"', 'lower="2" upper="-2.5"', 1),
            "arm.urdf: joint 'J1': upper limit -143.239 deg is not above the lower, 114.592 deg: give the machine's by"
            " --set J1.lower=VALUE --set J1.upper=VALUE",
        ),
        (
            urdf(*ROW).replace('axis xyz="0 1 0"', 'axis xyz="0 0 0"', 1),
            "arm.urdf: joint 'J2': axis 0 0 0 is no direction; 0 0 1 is along z",
        ),
        (
            urdf(*ROW).replace('name="J3" type="revolute"', 'name="J3" type="floating"'),
            "arm.urdf: joint 'J3': is of the type 'floating', a chain has revolute, continuous, prismatic and fixed"
            " joints: --base d begins behind it, --tip c ends before it",
        ),
        (
            urdf(*ROW[:6], joint("J7", "g", "h", '<mimic joint="J6"/>')),
            "arm.urdf: joint 'J7': follows 'J6' (mimic), a chain's joints have a motor each: --tip g ends before it",
        ),
        (
            urdf(*ROW).replace('xyz="0 0 1"', 'xyz="0 0 ${one}"'),
            "arm.urdf: joint 'J1': axis is xacro, not a URDF: run xacro first, as in: xacro robot.xacro > robot.urdf",
        ),
        (
            urdf(*ROW).replace("<robot", '<!DOCTYPE robot [<!ENTITY a "b">]><robot'),
            "arm.urdf: has !DOCTYPE, which no URDF needs: it is not read, take it out",
        ),
        (
            urdf(*ROW).replace("<robot", '<!entity a "b"><robot'),
            "arm.urdf: has !ENTITY, which no URDF needs: it is not read, take it out",
        ),
    ],
    ids=["seven joints", "limits", "axis", "floating", "mimic", "xacro", "document type", "entity"],
)
def test_what_no_arm_is_made_of(text: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert of_urdf(capsys, text) == told


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ("upper = 170.0 ", "upper = -170.5 ", "joints.J1.upper: -170.5 deg is not above lower, -170 deg"),
        (
            "microsteps = 4 ",
            "microsteps = 48 ",
            "joints.J1.microsteps: 48 is not one of the drivers' 1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 100,"
            " 125, 128, 256: the nearest are 40 and 50",
        ),
        ("dirsetup_ns = 15_000", "dirsetup_ns = 4_999", "board.dirsetup_ns: 4999 ns is too short for dm542: at least"),
        ("d_mm = 41.0", 'd_mm = "long"', "kinematics.chain.J6.d_mm: 'long' is not a number"),
    ],
)
def test_what_no_robot_file_says(before: str, after: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("arm.toml").write_text(AR4.replace(before, after, 1), encoding="utf-8")
    assert run(["fk", "arm.toml", "0", "0", "0", "0", "0", "0"]) == 2
    assert capsys.readouterr().err.startswith(f"steptwin: arm.toml: {told}")


@pytest.mark.usefixtures("folder")
def test_a_chip_that_lacks_the_microsteps(capsys: pytest.CaptureFixture[str]) -> None:
    text = AR4.replace('"dm542"', '"a4988"').replace("microsteps = 4 ", "microsteps = 64 ", 1)
    Path("arm.toml").write_text(text, encoding="utf-8")
    refusal(capsys, "fk", "arm.toml", "0", "0", "0", "0", "0", "0")


def test_a_pose_out_of_reach(capsys: pytest.CaptureFixture[str]) -> None:
    """Each branch says why, and what would do; the exit code is that of an answer, not of bad input."""
    pose = ["--x", "900", "--y", "0", "--z", "300", "--rpy", "0 90 0"]
    document = run_json(capsys, "ik", "ar4-mk3", *pose, exit_code=1)
    assert {branch["reason"] for branch in document["branches"]} == {
        "shoulder to wrist 805.4 mm is outside 82.37..527.63 mm, by 278 mm",
        "shoulder to wrist 932.3 mm is outside 82.37..527.63 mm, by 405 mm",
    }
    assert document["nearest"]["x_mm"] == pytest.approx(616.4, abs=0.05)
