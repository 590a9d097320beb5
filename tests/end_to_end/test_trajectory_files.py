"""Trajectory files on the command line: the same bytes as ever, summary and warnings, the spiral at full speed."""

import json
from math import cos, sin
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import refusal
from tests.end_to_end.fingerprints import INTEGERS, fingerprint
from tests.end_to_end.test_files import CSV, MOVING_CSV, as_json

ROBOT = "teaching-scara"
WITH_A_PAUSE = """t,th1,th2,d3,th4
0,0,10,0,0
0.40007,10,20,5,0
0.9,20,20,10,-20
1.4,20,20,10,-20
2.1,0,30,10,5
"""
OVERSHOOTING = """t,th1,th2,d3,th4
0,0,40,20,0
1,-15,40,20,0
2,40,40,20,0
"""


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[list[str], list[str]]:
    """Run a motion that passes; return its lines on stdout and stderr."""
    capsys.readouterr()
    assert run(["run", ROBOT, *words]) == 0
    captured = capsys.readouterr()
    return captured.out.splitlines(), captured.err.splitlines()


def file_of(folder: Path, text: str, name: str = "motion.csv") -> str:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return str(file)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "text", "hashes"),
    [
        ("points.csv", CSV, POINTS := ("163eb4077dec2057", "d99371178eb681c5")),
        ("points.json", as_json(CSV), POINTS),
        ("moving.csv", MOVING_CSV, MOVING := ("b894ce7d5046c625", "9b6ef2920b5fa27f")),
        ("moving.json", as_json(MOVING_CSV), MOVING),
        ("pause.csv", WITH_A_PAUSE, ("7d917374d8a885f1", "4744b5b136d44838")),
    ],
)
def test_files_without_options_run_as_ever(name: str, text: str, hashes: tuple[str, str], tmp_path: Path) -> None:
    """Every edge and every frame is as it was before poses, interpolations and ramps existed."""
    assert run(["run", ROBOT, file_of(tmp_path, text, name), "--out", str(tmp_path / "out")]) == 0
    assert tuple(fingerprint(tmp_path / "out", part)[:16] for part in INTEGERS) == hashes


class TestBeforeARun:
    def test_a_summary_and_the_departures_come_first(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        file = file_of(tmp_path, OVERSHOOTING)
        out, err = said(capsys, file)
        assert out[0].startswith(f"{file}: 3 points in 2.000 s, a spline, peak speed ")
        assert out[0].endswith(" % of the limit (th1)")
        assert out[1].startswith(f"{file}: off the lines between the points by th1 ")
        assert [name for name in ("th1", "th2", "d3", "th4", "tool") if f" {name} " in out[1]] == [
            "th1", "th2", "d3", "th4", "tool",
        ]  # fmt: skip
        assert len(err) == 1
        assert err[0].startswith(f"steptwin: warning: {file}: far off the lines between the points: tool ")
        assert err[0].count("(limit") == 1  # the farthest alone
        assert err[0].endswith("; -o interpolate=linear or stop keeps closer, and so do more points")

    def test_on_stderr_with_json(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        out, err = said(capsys, file_of(tmp_path, OVERSHOOTING), "--json")
        assert json.loads("\n".join(out))["passed"] is True
        assert [line.partition(": ")[2][:8] for line in err] == ["3 points", "off the ", "warning:"]

    def test_stops_leave_nothing(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        out, err = said(capsys, file_of(tmp_path, OVERSHOOTING), "-o", "interpolate=stop")
        assert "straight lines with stops" in out[0]
        assert "off the lines" not in out[1]
        assert err == []

    @pytest.mark.slow
    def test_radians_are_asked_for(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        file = file_of(tmp_path, "t,th1,th2,d3,th4\n0,0,0.5,1,0\n2,0.6,1.0,1,0\n")
        _, err = said(capsys, file)
        asking = (
            "every joint stays below 5 % of its limits and of its range, at 0.25 % at most. Is it in s, mm and degrees?"
        )
        assert err == [
            f"steptwin: warning: {file}: {asking} -o units=rad fits, too: angles are then 57.3 times as large"
        ]
        out, err = said(capsys, file, "-o", "units=rad")
        assert err == []
        assert "peak speed 14.3 % of the limit (th1)" in out[0]

    def test_standing_still_is_not_slow(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        _, err = said(capsys, file_of(tmp_path, "t,th1,th2,d3,th4\n0,0,10,0,0\n1,0,10,0,0\n"))
        assert err == []

    def test_a_wrong_motion_is_one_line(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        text = "t,th1,th2,d3,th4\n0,0,10,0,-360\n2.5,0,10,0,360\n"
        line = refusal(capsys, "run", ROBOT, file_of(tmp_path, text))
        assert "(--stretch 1.2); only the spline exceeds it, at constant speed from point to point it is 288.0" in line


def test_options_of_files_are_for_files(capsys: pytest.CaptureFixture[str]) -> None:
    for option, value in (("-o", "interpolate=linear"), ("-o", "ramps_s=0.1"), ("-o", "units=rad,m")):
        refusal(capsys, "run", ROBOT, "carry", option, value)


def test_options_are_named_in_errors(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = file_of(tmp_path, CSV)
    for words, told in (
        (["-o", "ramps_s=0"], "option ramps_s: 0 is not above 0"),
        (["-o", "ramps_s=0.0005"], f"{file}: -o ramps_s=0.0005: 0.0005 s is not a whole number of milliseconds"),
        (["-o", "ramps_s=0.1", "-o", "interpolate=stop"], f"{file}: -o ramps_s=0.1: a motion that stops at each point"),
    ):
        assert refusal(capsys, "run", ROBOT, file, *words).startswith(told)
    moving = file_of(tmp_path, MOVING_CSV)
    assert f"{moving}: -o interpolate=spline: the file gives velocities" in refusal(
        capsys, "run", ROBOT, moving, "-o", "interpolate=spline"
    )


@pytest.mark.slow
def test_the_laboratory_spiral_at_the_speeds_of_its_paper(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """377 points in 2.173 s, for the first whole millisecond after th3 has its 130 deg/s: H. Wang et al., Table 1.

    The points begin and end in motion. From rest to rest they are refused; run-in and run-out bring them up to speed.
    """
    rows = ["t,x,y,z,phi"]
    for k in range(377):
        u = 0.05 * k
        rows.append(f"{2.173 * k / 376!r},{-300 + 5 * u * cos(u)!r},{400 + 5 * u * sin(u)!r},{u / 2!r},0")
    file = file_of(tmp_path, "\n".join(rows))
    told = refusal(capsys, "run", "lab-scara", file)
    assert told.endswith("; a run-in and a run-out of 0.079 s pass (-o ramps_s=0.079)")
    refusal(capsys, "run", "lab-scara", file, "-o", "ramps_s=0.078")
    assert run(["run", "lab-scara", file, "-o", "ramps_s=0.079", "--json"]) == 0
    captured = capsys.readouterr()
    report = json.loads(captured.out)
    assert (report["passed"], report["duration_s"]) == (True, 2.331)
    assert "377 points on the branch 'right' in 2.331 s, a spline and ramps of 0.079 s" in captured.err
    assert "peak speed 100 % of the limit (th3)" in captured.err
    assert "warning" not in captured.err
