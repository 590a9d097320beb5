"""The commands for robots, maths and data sheets, and the installed program."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.cli.app import run


def test_robots(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robots", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    names = {robot["name"]: robot["joints"] for robot in document["robots"]}
    assert names == {
        "lab-scara": ["d1", "th2", "th3", "th4"],
        "warehouse-scara": ["sx", "sz", "L1", "th1", "th2", "th3"],
        "teaching-scara": ["th1", "th2", "d3", "th4"],
        "calibration-scara": ["th1", "th2", "d3", "th4"],
        "hybrid-arm": ["th1", "Z5", "Z6", "th4"],
        "ar4-mk3": ["J1", "J2", "J3", "J4", "J5", "J6"],
        "corexy-gantry": ["X", "Y", "Z"],
        "parol6": ["J1", "J2", "J3", "J4", "J5", "J6"],
        "thor": ["J1", "J2", "J3", "J4", "J5", "J6"],
        "turntable": ["table"],
    }
    machines = [robot["name"] for robot in document["robots"] if not robot["paper"]]
    assert machines == list(names)[-len(machines) :] == ["ar4-mk3", "corexy-gantry", "parol6", "thor", "turntable"]
    assert run(["robots"]) == 0
    shown = capsys.readouterr().out
    assert "\nwarehouse-scara: Jiang Aimin, Guo Liang, Tan Xiangquan: Development" in shown
    assert "ar4-mk3:" not in shown


def test_jobs(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["jobs", "warehouse-scara", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["robot"] == "warehouse-scara"
    jobs = {job["name"]: job["options"] for job in document["jobs"]}
    assert list(jobs) == ["drawer-pull", "store", "fetch", "every-slot", "pull-line"]
    assert "right" in jobs["pull-line"]["elbow"]
    assert jobs["store"]["slot"] == "A1 (A1, A2, B1, B2)"
    assert run(["jobs", "warehouse-scara"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"paper: {document['paper']}\ndrawer-pull: ")
    assert "duration_s" in shown


def test_fk_with_negative_joints(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fk", "warehouse-scara", *["0", "0", "200", "-60", "120", "-90"], "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["joints"] == {"sx": 0, "sz": 0, "L1": 200, "th1": -60, "th2": 120, "th3": -90}
    assert document["pose"] == pytest.approx(
        {"x_mm": 209.641016151, "y_mm": -63.301270189, "z_mm": 160, "attitude_deg": -30}, abs=1e-8
    )
    assert run(["fk", "warehouse-scara", *["0", "0", "50", "0", "0", "0"]]) == 0
    assert "x 390.000000 mm" in capsys.readouterr().out


def c(angle_deg: float) -> float:
    return float(np.cos(np.deg2rad(angle_deg)))


def s(angle_deg: float) -> float:
    return float(np.sin(np.deg2rad(angle_deg)))


def test_fk_prints_the_papers_matrices(capsys: pytest.CaptureFixture[str]) -> None:
    """Lab eqs. 1 to 5 with o_x = c4 c23 + s4 s23 and (3,3) = -1, both misprinted; each in closed form."""
    assert run(["fk", "lab-scara", "150", "30", "45", "60", "--matrices", "--json"]) == 0
    dh = json.loads(capsys.readouterr().out)["dh"]
    matrices = [np.array(link["matrix"]) for link in dh["links"]]
    assert matrices[0] == pytest.approx(np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 150], [0, 0, 0, 1]]))
    assert matrices[2][:2] == pytest.approx(np.array([[c(45), -s(45), 0, 400], [s(45), c(45), 0, 0]]))
    assert matrices[3][:3] == pytest.approx(np.array([[c(60), -s(60), 0, 400], [-s(60), -c(60), 0, 0], [0, 0, -1, 0]]))
    assert matrices[4] == pytest.approx(np.eye(4) + 150.0 * np.outer([0, 0, 1, 0], [0, 0, 0, 1]))
    assert [dh["convention"], *(link["theta"] for link in dh["links"])] == ["modified", "90", "th2", "th3", "th4", "0"]
    assert [link["theta_deg"] for link in dh["links"]] == [90, 30, 45, 60, 0]
    product = dh["product"]
    assert product["matrix"] == pytest.approx(np.linalg.multi_dot(matrices))
    assert product["n"] == pytest.approx([s(60 - 75), c(60 - 75), 0.0], abs=1e-12)
    assert product["o"] == pytest.approx([c(60) * c(75) + s(60) * s(75), s(75) * c(60) - c(75) * s(60), 0.0], abs=1e-12)
    assert product["a"] == pytest.approx([0.0, 0.0, -1.0], abs=1e-12)
    assert product["p"] == pytest.approx([-586.370330516, 449.937779555, 0.0], abs=1e-8)
    assert run(["fk", "calibration-scara", *["30", "45", "50", "20"], "--matrices"]) == 0
    shown = capsys.readouterr().out
    assert "standard (distal)" in shown
    assert ["x", "0.573576", "0.819152", "0.000000", "307.093017"] in [line.split()[-5:] for line in shown.splitlines()]


def test_fk_of_joints_that_the_mechanism_cannot_take(capsys: pytest.CaptureFixture[str]) -> None:
    """The sliders are 640 mm apart; the links reach 632.46 mm."""
    assert run(["fk", "hybrid-arm", "0", "320", "-320", "0"]) == 2
    assert "hybrid-arm: the mechanism cannot be assembled at 0 320 -320 0" in capsys.readouterr().err
    assert run(["fk", "hybrid-arm", "0", "316", "-316", "0"]) == 0


def test_ik_gives_every_branch(capsys: pytest.CaptureFixture[str]) -> None:
    pose = ["--x", "275", "--y", "169.903810568", "--z", "60", "--phi", "90"]
    assert run(["ik", "warehouse-scara", *pose, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    right, left = document["branches"]
    assert (right["name"], right["reachable"], right["reason"]) == ("right", True, None)
    assert right["joints"] == pytest.approx({"sx": 0, "sz": 0, "L1": 100, "th1": 0, "th2": 60, "th3": 30}, abs=1e-6)
    assert left["joints"]["th1"] == pytest.approx(50.569992092, abs=1e-6)
    for branch in (right, left):
        assert branch["round_trip"] == pytest.approx({"position_error_mm": 0.0, "attitude_error_deg": 0.0}, abs=1e-9)
    assert run(["ik", "warehouse-scara", *pose]) == 0
    shown = capsys.readouterr().out
    assert "50.5700" in shown
    trips = "right 0.000000000 mm 0.000000000 deg, left 0.000000000 mm 0.000000000 deg"
    assert f"round trip, forward kinematics minus the pose: {trips}\n" in shown


def test_ik_holds_the_slides_where_the_machine_stands(capsys: pytest.CaptureFixture[str]) -> None:
    pose = ["--x", "1275", "--y", "169.903810568", "--z", "560", "--phi", "90"]
    assert run(["ik", "warehouse-scara", *pose, "--near", "1000 500 100 0 60 30", "--json"]) == 0
    right, _ = json.loads(capsys.readouterr().out)["branches"]
    assert right["joints"] == pytest.approx(
        {"sx": 1000, "sz": 500, "L1": 100, "th1": 0, "th2": 60, "th3": 30}, abs=1e-6
    )


def test_ik_says_why_not(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ik", "warehouse-scara", "--x", "500", "--y", "0", "--z", "60", "--phi", "0", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    right, _ = document["branches"]
    assert right["reachable"] is False
    assert document["nearest"] == {"x_mm": 390.0, "y_mm": 0.0, "z_mm": 60.0, "attitude_deg": 0.0}
    assert "350" in right["reason"]
    assert right["joints"]["th1"] is None
    assert right["round_trip"] == {"position_error_mm": None, "attitude_error_deg": None}
    assert run(["ik", "warehouse-scara", "--x", "500", "--y", "0", "--z", "60", "--phi", "0"]) == 1
    shown = capsys.readouterr().out
    assert "left: shoulder to wrist" in shown
    assert "the nearest pose in reach: x 390 mm" in shown


def test_an_interrupt_ends_with_130(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("steptwin.host.twin.embedded.execution.execute", interrupted)
    assert run(["run", "warehouse-scara", "pull-line"]) == 130


def test_eds(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["eds"]) == 0
    assert "[60C1sub4]" in capsys.readouterr().out


@pytest.mark.live
def test_the_installed_program() -> None:
    program = Path(sys.executable).parent / "steptwin"
    shown = subprocess.run([program, "--help"], capture_output=True, text=True, check=True)
    assert "run" in shown.stdout
    refused = subprocess.run([program, "run", "nobody", "x"], capture_output=True, text=True, check=False)
    assert (refused.returncode, refused.stdout) == (2, "")


_LOADED = """import sys
before = set(sys.modules)
from steptwin.host.cli import main
sys.argv[1:] = ["--help"]
assert main() == 0
print(*sys.modules.keys() - before)"""
LIGHT = {"steptwin", "typer", "annotated_doc", "shellingham", "rich"}
"""Packages beside Python's own that `--help` may import."""
HEAVY = {"rich.markdown", "rich.syntax", "rich.traceback", "rich.pretty", "asyncio", "http.client", "multiprocessing"}
"""Modules of these, and of Python, that take long."""


@pytest.mark.live
def test_help_imports_nothing_that_is_heavy() -> None:
    """It would make every command start slowly, whatever else is installed beside this program."""
    shown = subprocess.run([sys.executable, "-c", _LOADED], capture_output=True, text=True, check=True)
    loaded = set(shown.stdout.splitlines()[-1].split())
    assert {name.partition(".")[0] for name in loaded} - sys.stdlib_module_names <= LIGHT
    assert not loaded & HEAVY
