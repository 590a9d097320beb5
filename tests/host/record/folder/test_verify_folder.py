"""`steptwin verify` gives the same verdict again, and fails every folder that was changed."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.host.cli.app import run
from tests.host.record.folder.stored import arrays_of

Change = Callable[[dict[str, Any]], None]


def verify(capsys: pytest.CaptureFixture[str], folder: Path, exit_code: int) -> dict[str, Any]:
    capsys.readouterr()
    assert run(["verify", str(folder), "--json"]) == exit_code
    document = json.loads(capsys.readouterr().out)
    assert isinstance(document, dict)
    return document


@pytest.mark.slow
def test_a_run_passes_again_with_the_same_figures(store_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = verify(capsys, store_run, 0)
    written = json.loads((store_run / "report.json").read_text())
    assert document["passed"] is True
    assert document["reasons"] == []
    assert set(written) - set(document) == {"folder_version"}
    for axis, old in zip(document["axes"], written["axes"], strict=True):
        for key in ("name", "active_edge"):
            assert axis.pop(key) == old.pop(key)
        assert axis == pytest.approx(old, rel=1e-4, abs=2e-3)
    for key in ("joints", "bus", "simulated_s", "wall_s", "robot", "job", "duration_s", "outputs"):
        assert document[key] == written[key]
    assert document["tool"] == pytest.approx(written["tool"], rel=1e-3)


@pytest.mark.slow
def test_its_words_are_those_of_the_run(store_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["verify", str(store_run)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "warehouse-scara store: PASSED"
    assert any(line.startswith("outputs: ") for line in lines)
    assert any(line.startswith("SIMULATED ") for line in lines)


def without(arrays: dict[str, Any], index: int, *keys: str) -> None:
    for key in keys:
        arrays[key] = np.delete(arrays[key], index)


def moved(arrays: dict[str, Any], index: int, counts: int, *keys: str) -> None:
    for key in keys:
        arrays[key] = arrays[key].copy()
        arrays[key][index] += counts


def complaining(arrays: dict[str, Any], times: int) -> None:
    """Let the driver of th2 break its first limit a number of times."""
    arrays["th2_violation_counts"] = arrays["th2_clk_rise_counts"][:times]
    arrays["th2_violation_which"] = np.zeros(times, np.int8)
    arrays["th2_violation_values"] = np.full(times, 29.0)


CLK = ("th2_clk_rise_counts", "th2_clk_fall_counts")
STEP = ("th2_step_counts", "th2_step_signs")

TAMPERED: dict[str, tuple[Change, str]] = {
    "a pulse is gone": (lambda a: without(a, 99, *CLK, *STEP), "th2: unmatched steps 1 (limit 0), the first at"),
    "a pulse is gone from the pin": (lambda a: without(a, 99, *CLK), "th2: 1 steps without a CLK rise"),
    "a step is gone": (
        lambda a: without(a, 99, *STEP), "th2: 1 CLK rises without a step, though no limit was broken",
    ),
    "the last pulse is gone": (lambda a: without(a, -1, *CLK, *STEP), "th2: unmatched steps 1 (limit 0), the first at"),
    "a pulse comes 2 ms later": (lambda a: moved(a, 1, 144_000, *CLK, STEP[0]), "th2: threshold error "),
    "a step goes the other way": (
        lambda a: a.update(th2_step_signs=np.where(np.arange(a[STEP[1]].size) == 50, -1, 1) * a[STEP[1]]),
        "th2: 1 steps against the DIR pin, though no limit was broken",
    ),
    "a turn of DIR is gone": (
        lambda a: without(a, 1, "th2_dir_edge_counts", "th2_dir_levels"), "steps against the DIR pin",
    ),
    "it started elsewhere": (lambda a: a.update(th2_start_steps=a["th2_start_steps"] + 1), "th2: position error "),
    "the clock started elsewhere": (lambda a: a.update(start_counts=a["start_counts"] + 72_000), "threshold error "),
    "the driver complained": (lambda a: complaining(a, 1), "th2: driver violations 1 (limit 0)"),
    "an output did not switch": (lambda a: without(a, 0, "th3_out1_counts", "th3_out1_levels"), "switched on never"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", TAMPERED)
def test_edges_that_were_changed_fail(
    name: str, store_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, reason = TAMPERED[name]
    folder = shutil.copytree(store_run, tmp_path / "copy")
    arrays = arrays_of(folder / "edges.npz")
    change(arrays)
    np.savez(folder / "edges.npz", **arrays)
    document = verify(capsys, folder, 1)
    assert document["passed"] is False
    assert any(reason in line for line in document["reasons"]), document["reasons"]


def test_a_fall_without_a_rise_fails(store_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = shutil.copytree(store_run, tmp_path / "copy")
    arrays = arrays_of(folder / "edges.npz")
    without(arrays, 0, "th2_clk_rise_counts")
    np.savez(folder / "edges.npz", **arrays)
    assert run(["verify", str(folder)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"steptwin: {folder}/edges.npz: th2_clk_rise_counts: ")


REPORTS: dict[str, tuple[Change, str]] = {
    "fewer pulses": (lambda d: d["axes"][4].update(pulses=3), "report.json says th2.pulses = 3, the files give "),
    "a longer pulse": (
        lambda d: d["axes"][4].update(clk_high_us_min=40.0), "says th2.clk_high_us_min = 40.0, the files give 33.0",
    ),
    "another verdict": (lambda d: d.update(passed=False), "report.json says passed = False, the files give True"),
    "a shorter motion": (lambda d: d.update(duration_s=3.5), "report.json says duration_s = 3.5, the files give "),
    "an axis less": (lambda d: d["axes"].pop(), "report.json says axes = 5, the files give 6"),
    "a fault": (
        lambda d: d.update(fault={"message": "", "joints": {}, "positions_agree": True}),
        "report.json says passed = True, the files give False",
    ),
    "outputs that were not to switch": (lambda d: d["outputs"].pop(), "1 changes that were not planned (limit 0)"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", REPORTS)
def test_a_report_that_was_changed_fails(
    name: str, store_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, reason = REPORTS[name]
    folder = shutil.copytree(store_run, tmp_path / "copy")
    document = json.loads((folder / "report.json").read_text())
    change(document)
    (folder / "report.json").write_text(json.dumps(document))
    given = verify(capsys, folder, 1)
    assert any(reason in line for line in given["reasons"]), given["reasons"]
    assert "fault" not in given


@pytest.mark.slow
def test_frames_that_are_missing_fail(store_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = shutil.copytree(store_run, tmp_path / "copy")
    lines = (folder / "bus.log").read_text().splitlines(keepends=True)
    (folder / "bus.log").write_text("".join(lines[:-1]))
    told = f"report.json says bus.frames = {len(lines)}, bus.log has {len(lines) - 1}"
    assert verify(capsys, folder, 1)["reasons"] == [told]


@pytest.mark.slow
def test_a_missing_log_is_named(store_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = shutil.copytree(store_run, tmp_path / "copy")
    (folder / "bus.log").unlink()
    assert run(["verify", str(folder)]) == 2
    assert capsys.readouterr().err == f"steptwin: {folder}/bus.log: is missing\n"


def test_a_file_of_another_kind_fails(store_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = shutil.copytree(store_run, tmp_path / "copy")
    (folder / "edges.npz").write_text("junk")
    assert run(["verify", str(folder)]) == 2
    assert capsys.readouterr().err == f"steptwin: {folder}/edges.npz: cannot be read: it is not an npz file\n"


@pytest.mark.slow
def test_another_motion_fails(store_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One point of th3 is moved by a tenth of a degree, two steps and a half."""
    folder = shutil.copytree(store_run, tmp_path / "copy")
    lines = (folder / "trajectory.csv").read_text().splitlines()
    fields = lines[500].split(",")
    fields[6] = repr(float(fields[6]) + 0.1)
    lines[500] = ",".join(fields)
    (folder / "trajectory.csv").write_text("\n".join(lines))
    assert any("th3: " in line for line in verify(capsys, folder, 1)["reasons"])


def test_another_robot_fails(store_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = shutil.copytree(store_run, tmp_path / "copy")
    text = (folder / "robot.toml").read_text()
    begin = text.index("[joints.th2]")
    changed = text[:begin] + text[begin:].replace("microsteps = 16", "microsteps = 8", 1)
    assert changed != text
    (folder / "robot.toml").write_text(changed)
    assert any("th2: " in line for line in verify(capsys, folder, 1)["reasons"])


@pytest.mark.slow
def test_a_run_that_ended_in_a_fault_gives_the_fault_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["-o", "duration_s=2", "-o", "ramp_s=0.5", "--cut-stream", "0.7"]
    command = ["run", "warehouse-scara", "pull-line", *words, "--out", str(tmp_path)]
    assert run(command) == 3
    _no_pictures, fault = capsys.readouterr().err.splitlines()
    assert run(["verify", str(tmp_path)]) == 3
    again = capsys.readouterr()
    assert again.err == f"{fault}\n"
    assert "pull-line: STOPPED BY A FAULT" in again.out
    document = verify(capsys, tmp_path, 3)
    assert document["passed"] is False
    assert "th1: pvt underrun" in document["fault"]["message"]


@pytest.mark.slow
def test_a_run_that_failed_fails_again(store_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The folder is that of a run in which a driver's limit was broken twice."""
    folder = shutil.copytree(store_run, tmp_path / "copy")
    arrays = arrays_of(folder / "edges.npz")
    complaining(arrays, 2)
    np.savez(folder / "edges.npz", **arrays)
    document = json.loads((folder / "report.json").read_text())
    document["axes"][4]["violations"] = 2
    document["passed"] = False
    (folder / "report.json").write_text(json.dumps(document))
    again = verify(capsys, folder, 1)
    assert again["reasons"] == ["th2: driver violations 2 (limit 0)"]
    assert [(group["axis"], group["rule"], group["count"]) for group in again["violations"]] == [("th2", "clk_high", 2)]


@pytest.mark.parametrize(
    ("motion", "profile", "exit_code"),
    [
        (["teaching-scara", "carry"], "chip-1000pf", 1),
        pytest.param(["teaching-scara", "carry"], "chip-100pf", 0, marks=pytest.mark.slow),
        pytest.param(["lab-scara", "spiral"], "3a-module", 1, marks=pytest.mark.slow),
    ],
    ids=["chip-1000pf", "chip-100pf", "3a-module"],
)
def test_other_drivers_get_the_same_verdict(
    motion: list[str], profile: str, exit_code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Late directions and lost pulses do not contradict the pins, since a limit was broken."""
    command = [
        "run",
        *motion,
        "--machine",
        f"driver-profile={profile}",
        "--out",
        str(tmp_path),
        "--json",
    ]
    capsys.readouterr()
    assert run(command) == exit_code
    first = json.loads(capsys.readouterr().out)
    again = verify(capsys, tmp_path, exit_code)
    assert again["driver_profile"] == first["driver_profile"]
    assert again["violations"] == first["violations"]
    reasons = [[line.split(" ", 2)[:2] for line in document["reasons"]] for document in (first, again)]
    assert reasons[0] == reasons[1]


def as_live(store_run: Path, tmp_path: Path) -> Path:
    """Return the folder as a served board would have left it: without plan and verdict."""
    folder = tmp_path / "live"
    shutil.copytree(store_run, folder)
    (folder / "trajectory.csv").unlink()
    document = json.loads((folder / "report.json").read_text())
    (folder / "report.json").write_text(json.dumps(document | {"passed": None, "outputs": []}))
    return folder


@pytest.mark.slow
def test_a_live_boards_folder_takes_the_plan_of_another(
    store_run: Path, carry_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The plan includes the outputs; it must be of the same robot, and the folder must not have a plan itself."""
    live = as_live(store_run, tmp_path)
    assert run(["verify", str(live)]) == 2
    assert capsys.readouterr().err == (
        f"steptwin: {live}/trajectory.csv: is missing: a board does not know its plan; "
        "--plan DIR takes that of another run\n"
    )
    assert run(["verify", str(live), "--plan", str(store_run)]) == 0
    assert "outputs: " in capsys.readouterr().out
    assert run(["verify", str(live), "--plan", str(carry_run)]) == 2
    assert capsys.readouterr().err == f"steptwin: --plan {carry_run}: its robot.toml is not that of {live}\n"
    assert run(["verify", str(store_run), "--plan", str(store_run)]) == 2
    assert capsys.readouterr().err.endswith(" has its own plan; only a live board's folder takes another\n")
    assert run(["verify", str(live), "--plan", str(tmp_path / "nowhere")]) == 2
    assert capsys.readouterr().err.endswith("nowhere: is not a folder of a run\n")
