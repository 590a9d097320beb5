"""A user's own trajectory and robot files on the command line, run on the embedded board."""

import json
from math import floor
from pathlib import Path
from typing import Any

import pytest

from steptwin.emulator.bus.can_controller import CanController
from steptwin.host.cli.app import run
from steptwin.host.robots import brought_text, load_robot
from tests.end_to_end.command_line import refusal

ROBOT = "teaching-scara"
CSV = """t,th1,th2,d3,th4
0,0,10,0,0
1,-15,40,10,-20
2.1,-30,86.2,0.5,-56
"""
END = (-30.0, 86.2, 0.5, -56.0)

MOVING_CSV = """t,th4,d3,th2,th1,v_th4,v_d3,v_th2,v_th1
0,0,0,10,0,0,0,0,0
1,-20,10,40,-15,-30,2.5,50,-15
2.1,-56,0.5,86.2,-30,0,0,0,0
"""


def as_json(csv: str) -> str:
    """Return the same points in the shape of ROS' JointTrajectory."""
    header, *rows = [line.split(",") for line in csv.split()]
    columns = [dict(zip(header, map(float, row), strict=True)) for row in rows]
    names = [name for name in header[1:] if not name.startswith("v_")]
    points = [
        {
            "positions": [column[name] for name in names],
            "velocities": [column[f"v_{name}"] for name in names if f"v_{name}" in column],
            "time_from_start": {"sec": int(column["t"]), "nanosec": round(column["t"] % 1 * 1e9)},
        }
        for column in columns
    ]
    return json.dumps({"joint_names": names, "points": points})


def steps(robot: str, joint: str, position: float) -> int:
    return floor(position * load_robot(robot).joint(joint).transmission.steps_per_unit + 0.5)


def report_of(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    """Run a motion that must pass; return its report."""
    assert run(["run", *words, "--json"]) == 0
    report: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert report["passed"] is True
    assert [axis["violations"] for axis in report["axes"]] == [0] * len(report["axes"])
    return report


@pytest.fixture
def no_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail if a frame is sent on any bus."""
    monkeypatch.setattr(CanController, "send", lambda *_: pytest.fail("a frame was sent"))


class TestATrajectoryFile:
    @pytest.mark.parametrize("moving", [False, True], ids=["positions", "velocities"])
    @pytest.mark.parametrize("suffix", [".csv", ".json"])
    def test_is_run(self, moving: bool, suffix: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        csv = MOVING_CSV if moving else CSV
        file = tmp_path / f"motion{suffix}"
        file.write_text(csv if suffix == ".csv" else as_json(csv), encoding="utf-8")
        report = report_of(capsys, ROBOT, str(file))
        assert (report["robot"], report["job"], report["duration_s"]) == (ROBOT, str(file), 2.1)
        for axis, end in zip(report["axes"], END, strict=True):
            assert abs(axis["steps_end"] - steps(ROBOT, axis["name"], end)) <= 1
            assert axis["position_error_steps_max"] <= 0.57
        assert report["axes"][1]["steps_start"] == steps(ROBOT, "th2", 10.0)

    @pytest.mark.slow
    def test_may_be_what_another_run_wrote(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        """The trajectory.csv that `--out` writes makes the same motion again."""
        first = report_of(capsys, ROBOT, "carry", "--out", str(tmp_path))
        again = report_of(capsys, ROBOT, str(tmp_path / "trajectory.csv"))
        for before, after in zip(first["axes"], again["axes"], strict=True):
            assert after["steps_end"] == before["steps_end"]
            assert after["pulses"] == before["pulses"]

    def test_may_have_brackets_in_its_name(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
    ) -> None:
        """The library that draws the progress bar takes brackets for markup, on a terminal."""
        monkeypatch.setenv("FORCE_COLOR", "1")
        (tmp_path / "[").mkdir()
        file = tmp_path / "[" / "x].csv"
        file.write_text(CSV, encoding="utf-8")
        assert report_of(capsys, ROBOT, str(file))["job"] == str(file)

    def test_has_no_options(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        file = tmp_path / "motion.csv"
        file.write_text(CSV, encoding="utf-8")
        line = refusal(capsys, "run", ROBOT, str(file), "-o", "duration_s=2")
        assert line.endswith("there are interpolate, ramps_s, units, elbow, law, left_percent")
        line = refusal(capsys, "run", ROBOT, str(file), "-o", "elbow=left")
        assert line.endswith("-o elbow=left: is for a file of the tool's poses; this one has joints")

    @pytest.mark.parametrize(
        "csv",
        [
            pytest.param(CSV.replace("-15,40,10", "-15,40,60.5"), id="position"),
            pytest.param("t,th1,th2,d3,th4\n0,0,0,0,-360\n2.5,0,0,0,360", id="speed"),
            pytest.param(MOVING_CSV.replace("-30,2.5,50", "-361,2.5,50"), id="given speed"),
            pytest.param("t,th1,th2,d3,th4\n0,0,0,0,0\n1,0,0,60,0", id="step rate"),
            pytest.param(MOVING_CSV.replace("0,0,0,10,0,0,0,0,0", "0,0,0,10,0,0,1,0,0"), id="start"),
            pytest.param(MOVING_CSV.replace("86.2,-30,0,0,0,0", "86.2,-30,0,0,0,-2"), id="end"),
            pytest.param("t,th1,th2,d3,th4\n0,0,0,0,0\n0.25,0,11,0,0", id="acceleration"),
            pytest.param(CSV.replace("-56", "five"), id="file"),
        ],
    )
    @pytest.mark.usefixtures("no_frames")
    def test_that_breaks_a_limit_is_refused(self, csv: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        """The message names joint, value, time and limit; no folder is made and no frame sent."""
        file = tmp_path / "motion.csv"
        file.write_text(csv, encoding="utf-8")
        refusal(capsys, "run", ROBOT, str(file), "--out", str(tmp_path / "out"))
        assert not (tmp_path / "out").exists()

    def test_that_is_not_there(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        refusal(capsys, "run", ROBOT, f"{tmp_path}/no.csv")


@pytest.mark.parametrize(
    "words",
    [
        [],
        [ROBOT],
        [ROBOT, "carry", "carry"],
        [ROBOT, "a.csv", "b.csv"],
        [ROBOT, "motion.txt"],
        [ROBOT, ""],
    ],
)
def test_run_takes_one_job(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "run", *words)


def own_robot(folder: Path, name: str, changes: dict[str, str], file: str = "mine.toml") -> str:
    """Write a copy of a robot of StepTwin, called `mine`, with some texts replaced; return its path."""
    text = brought_text(name)
    for old, new in {f'name = "{name}"': 'name = "mine"', **changes}.items():
        assert old in text
        text = text.replace(old, new)
    (folder / file).write_text(text, encoding="utf-8")
    return str(folder / file)


TEACHING = brought_text(ROBOT)
PART = TEACHING[TEACHING.index("[boxes.part]") :]
"""The part that its gripper carries, and the spots for it."""

TIMING = {"steplen_ns = 33_000": "steplen_ns = 35_000", "stepspace_ns = 33_666": "stepspace_ns = 31_000"}
DIRECTION = {"dirsetup_ns = 15_000": "dirsetup_ns = 2_000", "dirhold_ns = 15_000": "dirhold_ns = 20_000"}
SLOW = {"step_rate_max_hz = 15_000": "step_rate_max_hz = 12_500", "osc_pf = 330": "osc_pf = 330\nbitrate = 500_000"}


class TestARobotOfOnesOwn:
    @pytest.mark.parametrize(
        ("name", "changes", "job"),
        [
            pytest.param(
                "lab-scara",
                {"a2_mm = 400.0": "a2_mm = 420.0", "a3_mm = 400.0": "a3_mm = 380.0", "ratio = 5.0": "ratio = 4.0"}
                | {"lower = -130.0": "lower = -140.0", "negative_limit = -135.0": "negative_limit = -145.0"}
                | {"travel_per_turn = 20.0": "travel_per_turn = 25.0"}
                | TIMING,
                ["spiral"],
                id="lab",
                marks=pytest.mark.slow,
            ),
            pytest.param(
                "warehouse-scara",
                {"L2_mm = 200.0": "L2_mm = 210.0", "L5_mm = 40.0": "L5_mm = 55.5", "lower = -120.0": "lower = -90.0"}
                | {"microsteps = 16": "microsteps = 2", "speed_max = 300.0": "speed_max = 200.0"}
                | DIRECTION,
                ["pull-line", "-o", "duration_s=3", "-o", "ramp_s=0.5"],
                id="warehouse",
            ),
            pytest.param(
                "teaching-scara",
                {"l1_mm = 95.0": "l1_mm = 120.0", "upper = 60.0": "upper = 80.0", "out = 1": "out = 2"}
                | {"positive_limit = 63.0": "positive_limit = 83.0"}
                | {"microsteps = 8": "microsteps = 1", "ratio = 4.0": "ratio = 3.7"}
                | {
                    "[195.0, 0.0, ": "[220.0, 0.0, ",
                    "[137.9, 35.8, ": "[159.5, 23.3, ",
                    "grip_mm = 58.0": "grip_mm = 70.0",
                },
                ["carry", "-o", "depth_mm=70"],
                id="teaching",
                marks=pytest.mark.slow,
            ),
            pytest.param(
                "calibration-scara",
                {"L1_mm = 250.0": "L1_mm = 200.0", "alpha3_deg = 180.0": "alpha3_deg = 0.0"}
                | {"speed_max = 180.0": "speed_max = 150.0", "speed_max = 80.0": "speed_max = 75.0"}
                | SLOW,
                ["demo"],
                id="calibration",
            ),
            pytest.param(
                "hybrid-arm",
                {"h_mm = 150.0": "h_mm = 140.0", "l3_mm = 300.0": "l3_mm = 310.0", "microsteps = 8": "microsteps = 2"}
                | {"travel_per_turn = 10.0": "travel_per_turn = 8.0", "osc_pf = 330": "osc_pf = 300"}
                | TIMING,
                ["five-points", "-o", "pause-s=0.1"],
                id="hybrid",
                marks=pytest.mark.slow,
            ),
        ],
    )
    def test_of_each_kind_runs_its_job(
        self, name: str, changes: dict[str, str], job: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        file = own_robot(tmp_path, name, changes)
        report = report_of(capsys, "--robot-file", file, *job)
        assert (report["robot"], report["job"]) == ("mine", job[0])
        moved = [axis for axis in report["axes"] if axis["pulses"]]
        assert len(moved) >= 3
        for axis in moved:
            assert min(axis["clk_high_us_min"], axis["clk_low_us_min"]) >= 30
        for output in report["outputs"]:
            assert output["from_s"] <= output["changed_s"] <= output["until_s"]

    @pytest.mark.parametrize("name", ["mine.conf", "mine", "mine.toml", "[mine].csv"])
    def test_may_have_any_file_name(self, name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        file = own_robot(tmp_path, ROBOT, {}, name)
        assert report_of(capsys, "--robot-file", file, "carry")["robot"] == "mine"

    def test_may_stand_where_its_name_would(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        """The path must end in .toml; the trajectory may be a file, too."""
        motion = tmp_path / "motion.csv"
        motion.write_text(CSV, encoding="utf-8")
        report = report_of(capsys, own_robot(tmp_path, ROBOT, {}), str(motion))
        assert (report["robot"], report["job"]) == ("mine", str(motion))

    def test_has_other_dimensions_in_fk_ik_and_jobs(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        longer = {"upper = 60.0": "upper = 80.0", "positive_limit = 63.0": "positive_limit = 83.0"}
        file = own_robot(tmp_path, ROBOT, {"l1_mm = 95.0": "l1_mm = 120.0"} | longer)
        assert run(["fk", "--robot-file", file, *["0", "-90", "70", "0"], "--json"]) == 0
        pose = json.loads(capsys.readouterr().out)["pose"]
        assert pose == pytest.approx({"x_mm": 120, "y_mm": -100, "z_mm": -110, "attitude_deg": -90}, abs=1e-9)
        options = ["--x", "120", "--y", "-100", "--z", "-110", "--phi", "-90"]
        assert run(["ik", "--robot-file", file, *options, "--json"]) == 0
        _, left = json.loads(capsys.readouterr().out)["branches"]
        assert left["reachable"] is True
        assert left["joints"] == pytest.approx({"th1": 0, "th2": -90, "d3": 70, "th4": 0}, abs=1e-6)
        assert run(["jobs", "--robot-file", file, "--json"]) == 0
        (carry,) = json.loads(capsys.readouterr().out)["jobs"]
        assert carry["options"]["depth_mm"] == "0 (0..80 mm)"

    def test_may_use_brackets_in_its_names(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        """The library that prints tables takes brackets for markup."""
        file = own_robot(tmp_path, "warehouse-scara", {"[places.B1]": '[places."[/B1]:x:"]', "B1 = ": '"[/B1]:x:" = '})
        assert run(["jobs", "--robot-file", file]) == 0
        assert "[/B1]:x:" in capsys.readouterr().out

    @pytest.mark.parametrize(
        "command",
        [
            pytest.param(["run", "carry"], id="run"),
            pytest.param(["fk", "0", "0", "0", "0"], id="fk"),
            pytest.param(["ik", "--x", "1", "--y", "1", "--z", "1", "--phi", "1"], id="ik"),
            pytest.param(["jobs"], id="jobs"),
        ],
    )
    @pytest.mark.usefixtures("no_frames")
    def test_is_given_once_and_is_right(
        self, command: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        name, *rest = command
        file = own_robot(tmp_path, ROBOT, {})
        assert ROBOT in refusal(capsys, name, ROBOT, *rest, "--robot-file", file)
        if name in {"ik", "jobs"}:  # the others take their first word for a robot
            assert refusal(capsys, *command) == "ROBOT is missing: a robot's name, or --robot-file FILE"
        wrong = own_robot(tmp_path, ROBOT, {"microsteps = 8": "microsteps = 4"}, "wrong")
        line = f"{wrong}: joints.d3.microsteps: 4 is not one of chip-330pf's 1, 2, 8, 16: the nearest are 2 and 8"
        assert refusal(capsys, *command, "--robot-file", wrong) == line
        missing = f"{tmp_path}/none"
        assert refusal(capsys, *command, "--robot-file", missing) == f"{missing}: No such file or directory"

    @pytest.mark.parametrize(
        ("name", "changes", "job"),
        [
            pytest.param(
                ROBOT, {"[outputs]": "[places.x]", "gripper = { joint =": "th1 = 1 #", PART: ""},
                ["carry", "-o", "depth_mm=5"], id="no gripper",
            ),
            pytest.param("warehouse-scara", {"[places.A1]": "[places.C1]"}, ["store"], id="no place"),
            pytest.param(
                "warehouse-scara", {"upper = 120.0": "upper = 10.0", "lower = -120.0": "lower = -10.0"}
                | {"th1 = -60.0": "th1 = 0.0"}, ["pull-line"], id="narrower limits",
            ),
            pytest.param("lab-scara", {"a2_mm = 400.0": "a2_mm = 100.0"}, ["spiral"], id="shorter arm"),
        ],
    )  # fmt: skip
    @pytest.mark.usefixtures("no_frames")
    def test_that_cannot_do_the_job_says_why(
        self,
        name: str,
        changes: dict[str, str],
        job: list[str],
        capsys: pytest.CaptureFixture[str],
        tmp_path: Path,
    ) -> None:
        file = own_robot(tmp_path, name, changes)
        refusal(capsys, "run", "--robot-file", file, *job, "--out", str(tmp_path / "out"))
        assert not (tmp_path / "out").exists()
