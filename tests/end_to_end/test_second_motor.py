"""A gantry whose beam has a motor at each end, by its file alone: run, verify, draw, replay."""

import json
from pathlib import Path

import cantools
import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import run_json
from tests.host.robots.gantries import gantry_text

POINTS = "t,X,Y\n0,200,150\n0.5,190,145\n1,200,150\n"


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    robot, points = tmp_path / "gantry.toml", tmp_path / "points.csv"
    robot.write_text(gantry_text())
    points.write_text(POINTS)
    return str(robot), str(points)


@pytest.mark.slow
def test_a_run_and_its_folder(files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "out")
    report = run_json(capsys, "run", *files, "--out", out)
    assert report["passed"]
    assert [axis["name"] for axis in report["axes"]] == ["X", "Y", "Y2"]
    assert report["axes"][1] == {**report["axes"][2], "name": "Y"}
    assert report["joints"] == {"names": ["X", "Y"], "start": [200.0, 150.0], "end": [200.0, 150.0]}
    zeros = {"skew_max": 0.0, "skew_end": 0.0, "limit": 3.0}
    assert report["skews"] == [{"first": "Y", "second": "Y2", "unit": "mm", **zeros}]
    header = (tmp_path / "out" / "trajectory.csv").read_text().splitlines()[0]
    assert header.startswith("t,X,Y,")
    assert "Y2" not in header
    assert run(["verify", out]) == 0
    assert run(["replay", out]) == 0
    assert run(["trace", out, "--format", "vcd", "--out", str(tmp_path / "trace.vcd")]) == 0


@pytest.mark.slow
def test_its_pictures(files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    run_json(capsys, "run", *files, "--out", str(out))
    assert run(["plot", str(out)]) == 0
    for picture in ("joints", "error", "step-rates", "timing"):
        assert (out / f"{picture}.png").exists()


def test_the_database_has_the_second_motors_node(files: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["dbc", files[0]]) == 0
    database = cantools.database.load_string(capsys.readouterr().out, "dbc")
    assert isinstance(database, cantools.database.can.Database)
    assert {node.name: node.comment for node in database.nodes}["Y2"] == "axis position = 1 Y"


def test_check_says_what_the_second_motor_follows(files: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    document = run_json(capsys, "check", files[0])
    assert json.dumps(document).count("axis Y2 = Y") == 1
