"""The drawer pull as a user runs it: `steptwin run warehouse-scara pull-line`, held against the reference figures.

The figures were computed from the paper's geometry independently of this project: joints rounded to steps at 1001
samples. A board that interpolates and steps with hysteresis may end one step beside them and make two more pulses at
each reversal.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import run_json
from tests.run_pictures import with_pictures

COMMAND = ["run", "warehouse-scara", "pull-line"]
QUICK = [*COMMAND, "-o", "duration_s=2", "-o", "ramp_s=0.5"]
"""The same steps in a fifth of the time."""


RIGHT = {"start": (0, 2667, 800), "net": (-1846, 662, 710), "pulses": (1846, 880, 710)}
LEFT = {"start": (2248, -2667, 2651), "net": (-1320, -662, 1189), "pulses": (1320, 880, 1189)}
RIGHT_END_DEG = (-41.528098726, 74.895689865, 56.632408861)
LEFT_END_DEG = (20.879608989, -74.895689865, 144.016080876)


@pytest.mark.parametrize(
    ("words", "duration_s", "frames"),
    [(QUICK, 2, (1400, 2000)), pytest.param(COMMAND, 10, (6000, 9000), marks=pytest.mark.slow)],
    ids=["in 2 s", "in 10 s"],
)
@pytest.mark.parametrize(
    ("elbow", "figures", "end_deg"), [("right", RIGHT, RIGHT_END_DEG), ("left", LEFT, LEFT_END_DEG)]
)
def test_reference_figures(
    capsys: pytest.CaptureFixture[str],
    elbow: str,
    figures: dict[str, tuple[int, ...]],
    end_deg: tuple[float, ...],
    words: list[str],
    duration_s: int,
    frames: tuple[int, int],
) -> None:
    report = run_json(capsys, *words, "-o", f"elbow={elbow}")
    check_contract(report)
    assert report["passed"] is True
    assert report["duration_s"] == duration_s
    axes = {axis["name"]: axis for axis in report["axes"]}
    assert list(axes) == ["sx", "sz", "L1", "th1", "th2", "th3"]
    for name in ("sx", "sz", "L1"):
        assert axes[name]["pulses"] == 0
        assert axes[name]["steps_end"] == axes[name]["steps_start"]
    for i, name in enumerate(("th1", "th2", "th3")):
        axis = axes[name]
        assert axis["steps_start"] == figures["start"][i]
        assert abs(axis["steps_end"] - axis["steps_start"] - figures["net"][i]) <= 1
        assert abs(axis["pulses"] - figures["pulses"][i]) <= 2
        assert axis["reversals"] == (1 if name == "th2" else 0)
        assert axis["timing_error_us_p50"] <= 0.0005 * axis["mean_step_interval_us"]
        step_deg = 1 / {"th1": 44.4, "th2": 44.4, "th3": 26.6}[name]
        assert report["joints"]["end"][3 + i] == pytest.approx(end_deg[i], abs=0.57 * step_deg)
    for axis in axes.values():
        assert axis["position_error_steps_max"] <= 0.57
        assert axis["violations"] == 0
        if axis["pulses"]:
            assert axis["clk_high_us_min"] >= 30
            assert axis["clk_low_us_min"] >= 30
    assert report["tool"]["position_error_mm_max"] <= 0.12
    assert report["tool"]["attitude_error_deg_max"] <= 0.05
    assert report["bus"]["bitrate"] == 1_000_000
    assert frames[0] <= report["bus"]["frames"] <= frames[1]
    assert 7 <= report["bus"]["load_percent"] <= 16


def check_contract(report: dict[str, Any]) -> None:
    """The JSON document has at least these keys; users' programs rely on them."""
    assert set(report) >= {
        "robot", "job", "duration_s", "passed", "axes", "joints", "tool", "bus", "simulated_s", "wall_s",
    }  # fmt: skip
    assert set(report["axes"][3]) >= {
        "name", "steps_start", "steps_end", "pulses", "reversals", "peak_rate_hz", "position_error_steps_max",
        "timing_error_us_p50", "timing_error_us_p99", "timing_error_us_max", "clk_high_us_min", "clk_low_us_min",
        "violations",
    }  # fmt: skip
    assert set(report["joints"]) == {"names", "start", "end"}
    assert set(report["tool"]) == {"position_error_mm_max", "position_error_mm_rms", "attitude_error_deg_max"}
    assert set(report["bus"]) == {"bitrate", "frames", "load_percent"}
    assert report["simulated"] is True


@pytest.mark.slow
def test_faster_and_elsewhere(capsys: pytest.CaptureFixture[str]) -> None:
    """In 2 s, with slides and lift elsewhere, the arm makes the same counts at another place."""
    options = ["sx_mm=1000", "sz_mm=250.003", "L1_mm=150"]
    report = run_json(capsys, *QUICK, *(word for option in options for word in ("-o", option)))
    assert report["passed"] is True
    assert report["axes"][0]["steps_end"] == 40_000
    assert report["axes"][1]["steps_end"] == 40_000  # 250.003 mm lies between two steps of 6.25 um
    assert [axis["pulses"] for axis in report["axes"][3:]] == pytest.approx([1846, 880, 710], abs=2)


def folder_bytes(folder: Path) -> dict[str, bytes]:
    """All files are compared but the pictures and the report, which holds the wall time."""
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.suffix not in {".json", ".png"}}


@pytest.mark.slow
def test_two_runs_and_both_kernels_give_the_same_bytes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    pytest.importorskip("numba", reason="the extra `fast` (numba) is not installed")
    short = [*COMMAND, "-o", "travel_mm=4", "-o", "duration_s=0.1", "-o", "ramp_s=0.04"]
    for name, kernel in (("first", "numba"), ("second", "numba"), ("plain", "python")):
        run_json(capsys, *short, "--out", str(tmp_path / name), "--kernel", kernel)
    first = folder_bytes(tmp_path / "first")
    assert set(first) == {"robot.toml", "trajectory.csv", "edges.npz", "bus.log", "trace.vcd"}
    assert first == folder_bytes(tmp_path / "second") == folder_bytes(tmp_path / "plain")


FILES = {"report.json", "robot.toml", "trajectory.csv", "edges.npz", "bus.log", "trace.vcd", "shelf.json"}
PICTURES = ["joints", "step-rates", "tool-path", "error", "timing"]


@pytest.fixture(scope="module")
def pictured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run with its pictures."""
    pytest.importorskip("matplotlib", reason="the extra `plot` (matplotlib) is not installed")
    out = tmp_path_factory.mktemp("pictured")
    with with_pictures():
        assert run([*QUICK, "--json", "--out", str(out)]) == 0
    return out


@pytest.mark.slow
def test_a_stored_run_has_the_pictures_of_the_run(
    pictured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They agree byte by byte, even those of errors, though the folder's cubics only approximate the plan."""
    assert {path.name for path in pictured.iterdir()} == FILES | {f"{name}.png" for name in PICTURES}
    words = ["--what", ",".join(PICTURES[:3]), "--what", ",".join(PICTURES[3:]), "--out", str(tmp_path)]
    made = [str(tmp_path / f"{name}.png") for name in PICTURES]
    assert run_json(capsys, "plot", str(pictured), *words) == {"files": made}
    for name in PICTURES:
        assert (tmp_path / f"{name}.png").read_bytes() == (pictured / f"{name}.png").read_bytes(), name


@pytest.mark.slow
def test_the_folder_holds_the_evidence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "deep" / "folder"
    report = run_json(capsys, *QUICK, "--out", str(out))
    stored = json.loads((out / "report.json").read_text())
    assert set(stored.pop("files")) | {"report.json", "trace.vcd"} == FILES
    assert stored == report
    assert report["folder_version"] == 1
    assert {path.name for path in out.iterdir()} == FILES
    header, first, *rest = (out / "trajectory.csv").read_text().splitlines()
    assert header == (
        "t,sx,sz,L1,th1,th2,th3,v_sx,v_sz,v_L1,v_th1,v_th2,v_th3,a_sx,a_sz,a_L1,a_th1,a_th2,a_th3,"
        "tool_x,tool_y,tool_z,tool_phi,tool_nx,tool_ny,tool_nz,tool_ox,tool_oy,tool_oz"
    )
    values = [float(x) for x in first.split(",")]
    assert values[:13] == pytest.approx([0, 0, 0, 100, 0, 60, 30, *[0] * 6], abs=1e-8)
    assert values[19:] == pytest.approx([275, 169.903810568, 60, 90, 0, 1, 0, -1, 0, 0], abs=1e-6)
    assert len(rest) == 200
    with np.load(out / "edges.npz") as edges:
        assert len(edges["th1_step_counts"]) == report["axes"][3]["pulses"]
        assert edges["th1_step_signs"].sum() == report["axes"][3]["steps_end"] - report["axes"][3]["steps_start"]
        assert (edges["th1_clk_fall_counts"] - edges["th1_clk_rise_counts"]).min() >= 2160
    log = (out / "bus.log").read_text().splitlines()
    assert len(log) == report["bus"]["frames"]
    assert log[0] == "(0000000000.000054) steptwin0 710#00"
    assert sum(" 080#" in line for line in log) == 1


@pytest.mark.slow
def test_the_report_for_people_says_all_that_matters(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No digit of it is lost in a narrow terminal."""
    monkeypatch.setenv("COLUMNS", "40")
    assert run(QUICK) == 0
    captured = capsys.readouterr()
    assert "SIMULATED" in captured.out
    assert captured.out.rstrip().endswith("PASSED")
    assert captured.err == ""
    (th1,) = [line.split() for line in captured.out.splitlines() if line.startswith("th1")]
    assert th1[:4] == ["th1", "0", "-1846", "1846"]


class TestAHangingHost:
    @pytest.mark.slow
    def test_the_board_stops_itself_by_a_ramp_and_knows_where_it_is(
        self, capsys: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        """After the cut, step intervals only grow, and the last step comes before the ramp ends."""
        assert run([*COMMAND, "--cut-stream", "3", "--json", "--out", str(tmp_path)]) == 3
        captured = capsys.readouterr()
        report = json.loads(captured.out)
        assert report["passed"] is False
        fault = report["fault"]
        assert fault["positions_agree"] is True
        assert fault["codes"]["th1"] == ["0xFF01"]
        assert set(fault["codes"]) == {"sx", "sz", "L1", "th1", "th2", "th3"}
        # At 3 s th1 turns with 5.8 deg/s and stops within a few hundredths of a degree.
        assert fault["joints"]["th1"] == pytest.approx(-12.205, abs=0.1)
        assert fault["joints"]["L1"] == 100
        assert "EMCY 0xFF01" in captured.err.splitlines()[-1]
        with np.load(tmp_path / "edges.npz") as edges:
            t_s = (edges["th1_step_counts"] - edges["start_counts"]) / 72e6
        after = t_s[t_s > 3.0]
        assert len(after) <= 4
        assert t_s[-1] < 3.0 + 0.05
        assert np.all(np.diff(after) > 0)

    def test_a_cut_must_lie_within_the_motion(self, capsys: pytest.CaptureFixture[str]) -> None:
        """A cut that leaves no point, or all points, is refused."""
        for seconds in ("0", "0.009", "10"):
            assert run([*COMMAND, "--cut-stream", seconds]) == 2
            assert "--cut-stream" in capsys.readouterr().err
