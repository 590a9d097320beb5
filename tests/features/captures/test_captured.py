"""`steptwin verify --capture` and `steptwin capture`, as a user types them."""

import json
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.record.folder import read_run
from tests.features.captures.analyser import probes_of, seen_by, write_session

MAPS = ["--map", "th1=D0,D1", "--map", "th2=D2,D3", "--map", "d3=D4,D5", "--map", "th4=D6,D7"]


PATH = ["--capture", "SR", "--path", "teaching-scara carry"]
SR = ["--capture", "SR", "--robot", "teaching-scara"]


@pytest.fixture(scope="module")
def carry(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run and a capture of it."""
    folder = tmp_path_factory.mktemp("captured")
    assert run(["run", "teaching-scara", "carry", "--out", str(folder / "carry")]) == 0
    evidence = read_run(folder / "carry").comparison.evidence
    write_session(folder / "a.sr", seen_by(probes_of(evidence), 50.0, 0.01), 8e6)
    return folder


def told(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    capsys.readouterr()
    code = run([*words])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.slow
def test_a_capture_is_verified_and_its_folder_again(carry: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = carry / "seen"
    words = ["verify", "--capture", str(carry / "a.sr"), *MAPS, "--plan", str(carry / "carry"), "--out", str(out)]
    code, said, _ = told(capsys, *words)
    assert code == 0
    assert "teaching-scara capture of carry: PASSED" in said
    assert "the analyser's clock +50.1" in said
    assert {path.name for path in out.iterdir()} >= {
        "report.json",
        "edges.npz",
        "trajectory.csv",
        "trace.vcd",
    }
    code, said, _ = told(capsys, "verify", str(out), "--json")
    document = json.loads(said)
    assert (code, document["passed"], document["simulated"]) == (0, True, False)
    code, said, _ = told(capsys, "verify", "--capture", str(out / "trace.vcd"), "--plan", str(out))
    assert (code, "PASSED" in said) == (0, True)


def test_a_folder_of_a_capture_that_failed_fails_again_for_the_same_reasons(
    carry: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, maps = carry / "inverted", [*MAPS[:3], "th2=D2,!D3", *MAPS[4:]]
    words = ["verify", "--capture", str(carry / "a.sr"), *maps, "--plan", "teaching-scara carry", "--out", str(out)]
    code, said, _ = told(capsys, *words, "--json")
    first = json.loads(said)
    assert (code, first["reasons"][0]) == (1, "th2 turns the other way: map its DIR as D3")
    code, said, _ = told(capsys, "verify", str(out), "--json")
    assert (code, json.loads(said)["reasons"]) == (1, first["reasons"])


@pytest.mark.slow
def test_without_a_plan_and_by_every_driver(carry: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said, _ = told(
        capsys, "verify", "--capture", str(carry / "a.sr"), *MAPS, "--robot", "teaching-scara", "--json"
    )
    assert (code, json.loads(said)["axes"][1]["steps"]) == (0, 3064)
    words = [*MAPS, "--plan", "teaching-scara carry", "--driver-profile", "all"]
    code, said, _ = told(capsys, "verify", "--capture", str(carry / "a.sr"), *words)
    assert code == 0
    assert "with slow-blue-board: misses 5128 pulses, from 0.0" in said
    assert "with tmc2209: misses none" in said


@pytest.mark.slow
def test_by_path(carry: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The folder of a run has the path; pulses that the drivers miss fail, too."""
    words = ["verify", "--capture", str(carry / "a.sr"), *MAPS, "--path", str(carry / "carry"), "--controller", "other"]
    code, said, _ = told(capsys, *words)
    assert code == 0
    lines = said.splitlines()
    assert lines[1:3] == [
        "step rule of other: each count within 1.20 steps of the path; any rule by which a count is within a step",
        "by path, at any speed: 5128 steps along 67.376 mm",
    ]
    assert lines[-3:] == [
        "th1 th2 d3 th4: clk_period 66.67 us (datasheet): kept",
        "no path shows pulses that cancel before their axis turns around, such as one lost and one extra on the same"
        " line; and by this rule one step lost or extra, if its axis ends between two steps",
        "teaching-scara capture of carry, by path: PASSED",
    ]
    code, said, _ = told(capsys, *words, "--driver-profile", "slow-blue-board", "--json")
    document = json.loads(said)
    assert (code, document["passed"], document["path"]["passed"]) == (1, False, True)
    assert document["reasons"][0].startswith("th1: clk_low 150 us (quoted): broken, 1064 times")
    assert {limit["grade"] for limit in document["capture"]["limits"]} == {"quoted", "stated"}


def test_steps_at_both_edges_have_no_limits(carry: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["verify", "--capture", str(carry / "a.sr"), *MAPS, "--path", "teaching-scara carry", "--both-edges"]
    code, said, _ = told(capsys, *words)
    assert code == 1
    assert "drivers' limits are not judged: none of the drivers here steps at both edges" in said
    assert "reason: th2 makes 2 times the planned steps: " in said


def test_what_a_capture_holds(carry: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said, _ = told(capsys, "capture", str(carry / "a.sr"))
    assert code == 0
    assert said.startswith(f"{carry / 'a.sr'}: sigrok session, ")
    assert " at 8e+06 Hz" in said


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ([], "DIR is missing: the folder of a run, or --capture FILE"),
        (["DIR", "--glitch", "1us"], "--glitch: is for --capture FILE"),
        (["DIR", "--capture", "a.sr"], "DIR DIR and --capture a.sr: give only one of them"),
        (
            ["--capture", "SR"],
            "--plan DIR or --plan 'ROBOT JOB' is missing, or --path, or --robot ROBOT without a plan",
        ),
        (["--capture", "SR", "--plan", "carry"], "--plan carry: is neither a folder nor 'ROBOT JOB' nor 'ROBOT FILE'"),
        (
            [*SR],
            "SR: no channel is called th1_step: --map th1=STEP,DIR names",
        ),
        (
            [*SR, "--glitch", "1"],
            "--glitch 1: is no time with a unit, such as 1us",
        ),
        (
            [*SR, "--tolerance-steps", "0"],
            "--tolerance-steps 0: is not above 0",
        ),
        (
            [*SR, "--clock-ppm", "none"],
            "--clock-ppm: 'none' is not a number",
        ),
        ([*SR, "--out", "x"], "--out: needs --plan, beside which"),
        (
            [*SR, "--rate", "1MHz"],
            "SR: tells its sampling rate, 8e+06 Hz: leave",
        ),
        ([*SR, "--controller", "grbl"], "--controller: is for --path"),
        ([*SR, "--both-edges"], "--both-edges: is for --path"),
        (
            [*SR, "--path", "teaching-scara carry"],
            "--robot teaching-scara: --path teaching-scara carry names the robot",
        ),
        ([*PATH, "--plan", "out"], "--path teaching-scara carry and --plan out: give only one of them"),
        ([*PATH, "--controller", "smoothie"], "--controller smoothie: there are klipper, grbl, grblhal, marlin, linux"),
        (
            [*PATH, "--controller", "grbl", "--both-edges"],
            "--both-edges: grbl steps at one edge of STEP; at both may klipper, grblhal, marlin, other",
        ),
        ([*PATH, "--out", "x"], "--out: is for --plan; --path has no time law"),
        ([*PATH, "--tolerance-steps", "2"], "--tolerance-steps: is for --plan; --path has no time law"),
        ([*PATH, "--clock-ppm", "exact"], "--clock-ppm: is for --plan; --path has no time law"),
        (["--capture", "SR", "--path", "teaching-scara carry 3"], "--path: '3' is not of the form NAME=VALUE"),
        (
            ["--capture", "SR", "--path", "teaching-scara carry dept=3"],
            "option 'dept' is unknown: did you mean depth_mm?",
        ),
        (["--capture", "SR", "--path", "carry"], "--path carry: is neither a folder nor 'ROBOT JOB' nor 'ROBOT FILE'"),
        (
            ["--capture", "SR", "--path", "warehouse-scara pull-line", *MAPS],
            "--map d3=D4,D5: axis 'd3' is unknown: there are sx",
        ),
    ],
)
def test_bad_input_is_one_line(carry: Path, words: list[str], why: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = told(capsys, "verify", *(word.replace("SR", str(carry / "a.sr")) for word in words))
    assert code == 2
    assert why.removeprefix("SR: ") in err
    assert err.count("\n") == 1
