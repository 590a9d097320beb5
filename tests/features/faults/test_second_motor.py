"""A gantry whose beam has a motor at each end: one that loses steps skews the beam."""

from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import run_json
from tests.host.robots.gantries import gantry_text

POINTS = "t,X,Y\n0,200,150\n0.5,190,145\n1,200,150\n"


def slip(full_steps: int) -> str:
    return f'name = "slip"\n[[fault]]\nat_s = 0.5\ndo = "slip"\njoint = "Y2"\nfull_steps = {full_steps}\n'


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    robot, points = tmp_path / "gantry.toml", tmp_path / "points.csv"
    robot.write_text(gantry_text())
    points.write_text(POINTS)
    return str(robot), str(points)


@pytest.mark.parametrize(("full_steps", "too_far"), [(12, False), (16, True), (-16, True)])
def test_a_motor_that_loses_steps_skews_the_beam(
    full_steps: int, too_far: bool, files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """12 full steps are 2.4 mm and 16 are 3.2 mm, both sides of the 3 mm allowed; the beam's middle is off by half."""
    scenario = tmp_path / "slip.toml"
    scenario.write_text(slip(full_steps))
    report = run_json(capsys, "run", *files, "--machine", f"faults={scenario}")
    assert not report["passed"]
    (skew,) = report["skews"]
    apart_mm = full_steps * 0.2
    assert skew["skew_max"] == pytest.approx(abs(apart_mm), abs=1e-9)
    assert skew["skew_end"] == pytest.approx(apart_mm, abs=1e-9)
    assert report["joints"]["end"] == pytest.approx([200.0, 150.0 + apart_mm / 2])
    reason = f"Y2: up to {abs(apart_mm):g} mm apart from Y (limit 3)"
    assert (reason in report["reasons"]) == too_far


def test_the_report_for_people_tells_the_skew(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = tmp_path / "slip.toml"
    scenario.write_text(slip(-12))
    assert run(["run", *files, "--machine", f"faults={scenario}"]) == 0
    assert "Y2: up to 2.4000 mm apart from Y, at the end -2.4000 mm" in capsys.readouterr().out
