"""A robot on its base, as a user runs it: the same steps for the same path, moved along with the base."""

from math import cos, radians, sin
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot
from tests.end_to_end.command_line import run_json

PHI_DEG = 150.0
BASE = f"\n[base]\nx_mm = 800.0\ny_mm = -300.0\nz_mm = 60.0\nphi_deg = {PHI_DEG}\n"
PROGRAM = """
start = {{ {start} }}
[[step]]
line = {{ {goal} }}
speed_mm_s = 120.0
[[step]]
by = {{ z = -10.0 }}
speed_mm_s = 30.0
"""
START, GOAL = (120.0, 40.0, -40.0, 10.0), (150.0, -30.0, -45.0, 25.0)
"""Tool poses from the base of the classroom robot."""


@pytest.fixture
def robot(tmp_path: Path) -> str:
    file = tmp_path / "placed.toml"
    file.write_text(load_robot("teaching-scara").toml + BASE, encoding="utf-8")
    return str(file)


def moved(pose: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    x_mm, y_mm, z_mm, phi_deg = pose
    c, s = cos(radians(PHI_DEG)), sin(radians(PHI_DEG))
    return 800.0 + c * x_mm - s * y_mm, -300.0 + s * x_mm + c * y_mm, z_mm + 60.0, phi_deg + PHI_DEG


def words_of(pose: tuple[float, ...]) -> str:
    return ", ".join(f"{key} = {value!r}" for key, value in zip(("x", "y", "z", "phi"), pose, strict=True))


@pytest.mark.slow
def test_a_straight_line_in_the_station_takes_the_same_steps(
    robot: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reports = []
    for number, (which, place) in enumerate((("teaching-scara", tuple), (robot, moved))):
        program = tmp_path / f"program-{number}.toml"
        text = PROGRAM.format(start=words_of(place(START)), goal=words_of(place(GOAL)))  # type: ignore[operator]
        program.write_text(text, encoding="utf-8")
        reports.append(run_json(capsys, "run", which, str(program), "--out", str(tmp_path / f"run-{number}")))
    own, there = reports
    keys = ("name", "steps_start", "steps_end", "pulses", "reversals")
    assert [[axis[key] for key in keys] for axis in own["axes"]] == [
        [axis[key] for key in keys] for axis in there["axes"]
    ]
    assert own["passed"]
    assert there["passed"]
    rows = (tmp_path / "run-1" / "trajectory.csv").read_text(encoding="utf-8").splitlines()
    header = rows[0].split(",")
    first = dict(zip(header, rows[1].split(","), strict=True))
    at = [float(first[key]) for key in ("tool_x", "tool_y", "tool_z")]
    assert at == pytest.approx(moved(START)[:3], abs=1e-3)
    assert run(["verify", str(tmp_path / "run-1")]) == 0


@pytest.mark.slow
def test_a_job_moves_along_with_the_base(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By default the helix stands where it stood, seen from the base: unturned, it takes the very same steps."""
    file = tmp_path / "placed.toml"
    file.write_text(f"{load_robot('hybrid-arm').toml}\n[base]\nx_mm = -512.0\nz_mm = 256.0\n", encoding="utf-8")
    short = ("helix", "-o", "turns=1", "-o", "duration_s=8", "-o", "samples=31")
    own, there = (run_json(capsys, "run", which, *short) for which in ("hybrid-arm", str(file)))
    assert there["passed"]
    assert [axis["pulses"] for axis in own["axes"]] == [axis["pulses"] for axis in there["axes"]]
    assert [axis["steps_end"] for axis in own["axes"]] == [axis["steps_end"] for axis in there["axes"]]


def test_the_matrices_begin_with_the_base(robot: str, capsys: pytest.CaptureFixture[str]) -> None:
    joints = ("30", "60", "20", "15")
    document = run_json(capsys, "fk", robot, *joints, "--matrices")
    own = run_json(capsys, "fk", "teaching-scara", *joints, "--matrices")
    c, s = cos(radians(PHI_DEG)), sin(radians(PHI_DEG))
    matrix = [[c, -s, 0.0, 800.0], [s, c, 0.0, -300.0], [0.0, 0.0, 1.0, 60.0], [0.0, 0.0, 0.0, 1.0]]
    base = document["dh"].pop("base")
    assert base.pop("matrix") == [pytest.approx(row) for row in matrix]
    assert base == {"x_mm": 800.0, "y_mm": -300.0, "z_mm": 60.0, "phi_deg": 150.0}
    assert document["dh"]["links"] == own["dh"]["links"]
    pose = tuple(own["pose"].values())
    assert [*document["pose"].values()][:3] == pytest.approx(moved(pose)[:3])
    assert run(["fk", robot, *joints, "--matrices"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split() == ["S_0T", "x", "-0.866025", "-0.500000", "0.000000", "800.000000"] for line in lines)
    assert "base" not in own["dh"]


@pytest.mark.slow
def test_the_sections_axis_is_told_in_the_station(robot: str, capsys: pytest.CaptureFixture[str]) -> None:
    document = run_json(capsys, "workspace", robot, "--samples", "100")
    assert [document["plan"][key] for key in ("axis_x_mm", "axis_y_mm")] == [800.0, -300.0]
