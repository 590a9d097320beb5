"""`run --stretch` and `--speed`: what a refusal says would pass, on the command line."""

import json
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import refusal, run_json

ROBOT = "teaching-scara"
CSV = "t,th1,th2,d3,th4\n0,0,10,0,0\n0.2,-15,40,5,-20\n0.5,-30,86.2,0.5,-56\n"
PROGRAM = """
[[step]]
go = { th1 = 40 }
duration_s = 0.3
[[step]]
output = "gripper"
on = true
[[step]]
go = { th1 = 0 }
duration_s = 0.25
"""


@pytest.fixture(params=["points.csv", "program.toml"])
def motion(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """A file whose motion is too fast."""
    file = tmp_path / request.param
    file.write_text(CSV if file.suffix == ".csv" else PROGRAM, encoding="utf-8")
    return str(file)


def told_stretch(line: str) -> float:
    """Return the factor that a refusal names as option."""
    return float(line.rsplit("times slower passes (--stretch ", 1)[1].removesuffix(")"))


@pytest.mark.slow
def test_what_a_refusal_names_passes_and_less_does_not(motion: str, capsys: pytest.CaptureFixture[str]) -> None:
    factor = told_stretch(refusal(capsys, "run", ROBOT, motion))
    document = run_json(capsys, "run", ROBOT, motion, "--stretch", str(factor))
    assert document["passed"]
    assert told_stretch(refusal(capsys, "run", ROBOT, motion, "--stretch", f"{factor - 0.006:.3f}")) == factor
    assert run_json(capsys, "run", ROBOT, motion, "--stretch", "auto")["axes"] == document["axes"]


def test_it_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["run", ROBOT, "carry", "--stretch", "2", "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == "stretched 2 times: 2.000 s instead of 1.000 s\n"
    assert json.loads(captured.out)["duration_s"] == 2.0


@pytest.mark.slow
def test_what_need_not_be_slower_stays_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    as_it_is = run_json(capsys, "run", ROBOT, "carry")
    assert run(["run", ROBOT, "carry", "--stretch", "auto", "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == "not stretched: it is slow enough\n"
    assert json.loads(captured.out)["axes"] == as_it_is["axes"]


def test_too_fast_a_job_names_the_stretch_of_the_job_itself(capsys: pytest.CaptureFixture[str]) -> None:
    line = refusal(capsys, "run", ROBOT, "carry", "--stretch", "0.05")
    factor = float(line.rsplit("; --stretch ", 1)[1].removesuffix(" passes"))
    assert 0.05 < factor < 1
    assert run_json(capsys, "run", ROBOT, "carry", "--stretch", str(factor))["passed"]


@pytest.mark.parametrize(
    "words",
    [
        ["--stretch", "slow"],
        ["--stretch", "0"],
        ["--stretch", "1001"],
        ["--stretch", "-5"],
        ["--stretch", "10000"],
    ],
)
def test_other_values_are_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "run", ROBOT, "carry", *words)
