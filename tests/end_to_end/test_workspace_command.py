"""`steptwin workspace`: its figures, its folder, and bad arguments."""

import importlib.util
import json
from importlib.machinery import ModuleSpec
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.cli.robots import workspace as command
from steptwin.host.common.extras import installing
from tests.end_to_end.command_line import refusal

LAB = ["workspace", "lab-scara"]


@pytest.mark.slow
def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*LAB, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == {
        "robot": "lab-scara",
        "monte_carlo": {
            "samples": 100_000,
            "seed": 1,
            "counted": 100_000,
            "left_out": 0,
            "radius_min_mm": pytest.approx(338.099917, abs=1e-6),
            "radius_max_mm": pytest.approx(800.0, abs=1e-6),
            "z_min_mm": pytest.approx(-150.0, abs=0.01),
            "z_max_mm": pytest.approx(100.0, abs=0.01),
        },
        "plan": {
            "z_mm": 0.0,
            "attitude_deg": None,
            "slides": {},
            "axis_x_mm": 0.0,
            "radius_min_mm": pytest.approx(338.094609393, abs=1e-6),
            "radius_max_mm": pytest.approx(800.0, abs=1e-6),
            "area_mm2": pytest.approx(1_622_522.690, rel=1e-6),
        },
        "profile": {
            "azimuth_deg": pytest.approx(105.0, abs=1e-9),
            "attitude_deg": None,
            "slides": {},
            "axis_x_mm": 0.0,
            "radius_min_mm": pytest.approx(338.094609393, abs=1e-6),
            "radius_max_mm": pytest.approx(800.0, abs=1e-6),
            "z_min_mm": pytest.approx(-150.0, abs=1e-6),
            "z_max_mm": pytest.approx(100.0, abs=1e-6),
            "area_mm2": pytest.approx(461.905390607 * 250.0, rel=1e-7),
        },
    }


@pytest.mark.slow
def test_a_table_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--samples", "1000", "--seed", "7", "--phi", "-30", "--z", "700.5"]
    assert run(["workspace", "hybrid-arm", *arguments]) == 0
    shown = capsys.readouterr().out
    for words in (
        "plan at z = 700.5 mm", "profile at azimuth 0 deg", "346.228", "846.228", "250.000", "1000 samples with seed 7",
        "left out: the mechanism forbids them", "attitude -30 deg", "profile: upright,",
    ):  # fmt: skip
        assert words in shown


@pytest.mark.slow
def test_the_table_says_where_the_slides_stand_and_what_is_out_of_reach(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["workspace", "warehouse-scara", "--samples", "1000", "--phi", "0", "--z", "500"]) == 0
    plan, *_ = (line for line in capsys.readouterr().out.splitlines() if line.startswith("plan"))
    assert plan.split() == ["plan", "at", "z", "=", "500", "mm", "-", "-", "-", "-", "0"]
    assert run(["workspace", "warehouse-scara", "--samples", "1000", "--phi", "0"]) == 0
    assert "attitude 0 deg, sx = 0 mm, sz = 0 mm" in capsys.readouterr().out


@pytest.mark.slow
def test_the_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    folder = tmp_path / "made" / "here"
    assert run([*LAB, "--samples", "500", "--phi", "0", "--json", "--out", str(folder)]) == 0
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert f"figures, cloud and pictures are in {folder}/" in captured.err
    assert (folder / "workspace.json").read_text(encoding="utf-8") == captured.out
    for picture in ("workspace.png", "workspace-3d.png"):
        assert (folder / picture).read_bytes()[:4] == b"\x89PNG"
    head, *rows = (folder / "cloud.csv").read_text(encoding="ascii").splitlines()
    assert (head, len(rows)) == ("x_mm,y_mm,z_mm", 500)
    cloud_mm = np.array([row.split(",") for row in rows], dtype=np.float64)
    span = document["monte_carlo"]
    radii_mm = np.hypot(cloud_mm[:, 0], cloud_mm[:, 1])
    assert [radii_mm.min(), radii_mm.max()] == [span["radius_min_mm"], span["radius_max_mm"]]
    assert [cloud_mm[:, 2].min(), cloud_mm[:, 2].max()] == [span["z_min_mm"], span["z_max_mm"]]


def test_without_matplotlib_it_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def found(name: str) -> ModuleSpec | None:
        return None if name == "matplotlib" else importlib.util.find_spec(name)

    monkeypatch.setattr(command, "find_spec", found)
    assert run([*LAB, "--samples", "500", "--phi", "0", "--out", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    assert f"figures and cloud are in {tmp_path}/" in captured.out
    assert installing("plot") in captured.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cloud.csv", "workspace.json"]


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param([*LAB, "--samples", "0"], id="too few samples"),
        pytest.param([*LAB, "--samples", "10000001"], id="too many samples"),
        pytest.param([*LAB, "--samples", "many"], id="samples that are not a number"),
        pytest.param([*LAB, "--seed", "-1"], id="seed below 0"),
        pytest.param([*LAB, "--phi", "north"], id="attitude that is not a number"),
        pytest.param([*LAB, "--z", "nan"], id="height that is not finite"),
        pytest.param([*LAB, "--out", "/dev/null/x"], id="folder that cannot be"),
        pytest.param(["workspace", "lab-skara"], id="robot"),
        pytest.param(["workspace"], id="no robot"),
    ],
)
def test_bad_arguments(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, *arguments)
