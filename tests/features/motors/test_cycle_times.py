"""`steptwin motors ROBOT --program`: how long a program takes by the torque that its motors are to have left."""

import json
from pathlib import Path

import pytest

from steptwin.host.cli.app import run

PROGRAM = """
law = "fastest"
start = "a"
[positions]
a = { d1 = 100.0, th2 = -30.0, th3 = 60.0, th4 = 0.0 }
b = { d1 = 100.0, th2 = 0.0, th3 = 30.0, th4 = 20.0 }
[[step]]
go = "b"
speed_percent = 100.0
"""


@pytest.fixture
def program(tmp_path: Path) -> str:
    path = tmp_path / "swing.toml"
    path.write_text(PROGRAM, encoding="utf-8")
    return str(path)


@pytest.mark.slow
def test_more_torque_left_takes_longer_and_a_stronger_motor_is_faster(
    program: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("steptwin.features.motors.sizing.fitting.LEFT_PERCENT", (30.0, 70.0))
    words = ["motors", "lab-scara", "--program", program, "--instead", "th2=23HS22-2804S", "--json"]
    assert run(words) == 0
    document = json.loads(capsys.readouterr().out)
    own, stronger = ([each["duration_s"] for each in times] for times in document["cycles"].values())
    assert own[1] > 1.2 * own[0] > document["by_joints_s"]
    assert stronger[1] < own[1]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--instead", "th2=23HS22-2804S"], "--instead th2=23HS22-2804S: goes with --program"),
        (["--instead", "th9=23HS22-2804S", "--program", "PROGRAM"], "--instead: joint 'th9' is unknown"),
        (["--instead", "th2=nothing", "--program", "PROGRAM"], "--instead: model: 'nothing' is unknown"),
        (["--program", "none.toml"], "none.toml: No such file"),
    ],
)
def test_each_mistake(words: list[str], message: str, program: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["motors", "lab-scara", *(program if word == "PROGRAM" else word for word in words)]) == 2
    assert message in capsys.readouterr().err
