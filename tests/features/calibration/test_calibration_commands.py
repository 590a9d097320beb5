"""`calibrate`, and where the tool really is, in `fk`, `check`, `run` and `verify`."""

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from steptwin.host.cli.app import run
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from tests.end_to_end.command_line import refusal, run_json

NAME = "calibration-scara"
Q = ("30", "45", "50", "20")
REAL = {"link1": {"a_mm": 0.4, "theta_deg": -0.25}, "link2": {"alpha_deg": 0.06}, "link4": {"a_mm": 0.2, "d_mm": -0.5}}
MOTION = "t,th1,th2,d3,th4\n0,0,60,50,0\n0.1,0.3,59.8,50.05,0.5\n"


def tables(errors: dict[str, dict[str, float]]) -> str:
    lines = []
    for link, each in errors.items():
        lines += ["", f"[dh_errors.{link}]", *(f"{key} = {error}" for key, error in each.items())]
    return "\n".join([*lines, ""])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a robot as it really is, its measurements and its calibration."""
    folder = tmp_path_factory.mktemp("calibration")
    (folder / "real.toml").write_text(f"{load_robot(NAME).toml}{tables(REAL)}", encoding="utf-8")
    (folder / "motion.csv").write_text(MOTION, encoding="utf-8")
    measured = str(folder / "measured.csv")
    assert run(["calibrate", str(folder / "real.toml"), measured, "--simulate", "50", "--seed", "5"]) == 0
    assert run(["calibrate", NAME, measured, "--out", str(folder / "found")]) == 0
    return folder


def product(errors: dict[str, dict[str, float]]) -> FloatArray:
    """Return the tool's matrix at Q: standard DH links of the paper's table, with errors, multiplied out."""
    th1, th2, d3, th4 = map(float, Q)
    rows = [(250.0, 0.0, 300.0, th1), (350.0, 0.0, 0.0, th2), (0.0, 180.0, -d3, 0.0), (0.0, 0.0, 0.0, th4)]
    tool = np.eye(4)
    for link, row in enumerate(rows, start=1):
        off = [errors.get(f"link{link}", {}).get(key, 0.0) for key in ("a_mm", "alpha_deg", "d_mm", "theta_deg")]
        a_mm, alpha_deg, d_mm, theta_deg = np.add(row, off)
        screws = Rotation.from_euler("z", theta_deg, degrees=True), Rotation.from_euler("x", alpha_deg, degrees=True)
        for screw, shift in zip(screws, ([0.0, 0.0, d_mm], [a_mm, 0.0, 0.0]), strict=True):
            step = np.eye(4)
            step[:3, :3], step[:3, 3] = screw.as_matrix(), shift
            tool = tool @ step
    return tool


def position(document: dict[str, Any], which: str) -> list[float]:
    return [document[which][key] for key in ("x_mm", "y_mm", "z_mm")]


class TestCoefficients:
    """`--at`: how far each parameter takes the tool."""

    def test_they_are_differences_of_poses(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        """Each derivative beside what `fk` says of a file with this one error."""
        derivatives = run_json(capsys, "calibrate", NAME, "--at", " ".join(Q))["per"]
        assert len(derivatives) == 16
        for parameter in ("link1.alpha_deg", "link2.a_mm", "link2.theta_deg", "link4.d_mm"):
            link, quantity = parameter.split(".")
            poses = []
            for error in (-1e-3, 1e-3):
                file = tmp_path / f"{error}.toml"
                file.write_text(f"{load_robot(NAME).toml}{tables({link: {quantity: error}})}", encoding="utf-8")
                poses.append([*run_json(capsys, "fk", str(file), *Q)["actual_pose"].values()])
            by_difference = (np.array(poses[1]) - np.array(poses[0])) / 2e-3
            keys = ("x_mm", "y_mm", "z_mm", "rz_deg")
            assert [derivatives[parameter][key] for key in keys] == pytest.approx(by_difference, abs=1e-6)

    def test_the_errors_of_a_file_add_up(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        """The arm of docs/machines.md: the sum of the errors' parts, computed here from the DH products alone."""
        errors = {
            "link1": {"a_mm": 0.4, "alpha_deg": 0.08, "theta_deg": -0.25},
            "link2": {"a_mm": -0.3, "theta_deg": 0.15},
            "link4": {"a_mm": 0.2, "d_mm": -0.5},
        }
        file = tmp_path / "real.toml"
        file.write_text(f"{load_robot(NAME).toml}{tables(errors)}", encoding="utf-8")
        at = ("--at", " ".join(Q))
        document, nominal = (run_json(capsys, "calibrate", robot, *at) for robot in (str(file), NAME))
        assert document["per"] == nominal["per"]
        assert set(nominal["together"].values()) == {0.0}
        linear_mm = np.zeros(3)
        for link, each in errors.items():
            for quantity, error in each.items():
                less, more = (product({link: {quantity: sign * 1e-4}}) for sign in (-1.0, 1.0))
                linear_mm += error * (more - less)[:3, 3] / 2e-4
        assert linear_mm.round(3).tolist() == [1.484, -0.968, 0.846]
        assert [document["together"][key] for key in ("x_mm", "y_mm", "z_mm")] == pytest.approx(linear_mm, abs=1e-6)
        assert run(["calibrate", str(file), *at]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert " ".join(lines[0].split()) == "parameter per error x mm y mm z mm rx deg ry deg rz deg"
        assert lines[5].split() == ["link1.theta_deg", "deg", "-0.25", "-8.0822", "5.3598", *3 * ["0.0000"], "1.0000"]
        assert lines[-2].split() == ["together", "1.4840", "-0.9683", "0.8456", "0.0693", "0.0400", "-0.1000"]
        assert lines[-1] == "standard DH parameters; link1 is at the world, link4 at the tool"

    def test_what_is_refused(self, capsys: pytest.CaptureFixture[str]) -> None:
        words = "hybrid-arm: a 'hybrid-arm' is not a chain of DH links: z2 and z3 are no joints"
        assert refusal(capsys, "calibrate", "hybrid-arm", "--at", "0 0 0 0") == words
        refusal(capsys, "calibrate", NAME, "--at", "0 0 0")
        refusal(capsys, "calibrate", NAME, "m.csv", "--at", "0 0 0 0")
        refusal(capsys, "calibrate", NAME, "--at", "0 0 0 0", "--out", "found")


class TestCalibrate:
    def test_the_corrected_robot_is_where_the_real_one_is(
        self, folder: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        corrected = str(folder / "found" / "robot.toml")
        for joints in (Q, ("-100", "-90", "150", "0"), ("120", "140", "0", "300")):
            found, real = (run_json(capsys, "fk", file, *joints) for file in (corrected, str(folder / "real.toml")))
            assert position(found, "pose") == position(real, "pose")
            assert position(found, "actual_pose") == pytest.approx(position(real, "actual_pose"), abs=0.02)
            assert real["position_error_mm"] > 0.5

    def test_a_second_calibration_finds_nothing_more(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        first = json.loads((folder / "found" / "calibration.json").read_text(encoding="utf-8"))
        second = run_json(capsys, "calibrate", str(folder / "found" / "robot.toml"), str(folder / "measured.csv"))
        assert second["residual_before_mm"] == pytest.approx(first["residual_after_mm"], abs=1e-6)
        for before, after in zip(first["parameters"], second["parameters"], strict=True):
            assert after["before"] == pytest.approx(before["found"], abs=1e-6)
            assert after["found"] == pytest.approx(before["found"], abs=1e-6)

    def test_what_it_prints(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        document = run_json(capsys, "calibrate", NAME, str(folder / "measured.csv"))
        assert run(["calibrate", NAME, str(folder / "measured.csv")]) == 0
        lines = capsys.readouterr().out.splitlines()
        before, after = document["residual_before_mm"], document["residual_after_mm"]
        assert document["rank"] == 8
        assert "link1.theta_deg  deg   0.0000  -0.25" in "\n".join(lines)
        assert "  link4.d_mm acts as -1 link1.d_mm" in lines
        assert "  link4.theta_deg does not move the tool's position" in lines
        assert lines[-3] == f"rank 8 of 16 parameters, condition {document['condition']:.3g}, from 50 poses"
        assert lines[-2] == f"residual before: {before['rms']:.4f} mm rms, {before['max']:.4f} mm max"
        assert lines[-1].startswith(f"residual after: {after['rms']:.4f} mm rms, {after['max']:.4f} mm max, at line ")
        assert before["rms"] > 10 * after["rms"]

    @pytest.mark.skipif(not find_spec("matplotlib"), reason="the extra `plot` is not installed")
    def test_there_is_a_picture(self, folder: Path) -> None:
        assert (folder / "found" / "residuals.png").read_bytes().startswith(b"\x89PNG")

    def test_one_pose_written_fifty_times_is_one_pose(
        self, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """It was taken for 50, with "3 sigma 0.0000"; a file with each line twice finds what the file itself does."""
        head, *lines = (folder / "measured.csv").read_text(encoding="utf-8").splitlines(keepends=True)
        file = tmp_path / "m.csv"
        file.write_text(head + 50 * lines[0], encoding="utf-8")
        few = "too few poses for 3 parameters: 1 instead of at least 2"
        told = f"{file}: {few}; repeated poses count once, and 49 of the measurements repeat one"
        assert refusal(capsys, "calibrate", NAME, str(file)) == told
        file.write_text(head + "".join(2 * lines), encoding="utf-8")
        once = run_json(capsys, "calibrate", NAME, str(folder / "measured.csv"))
        twice = run_json(capsys, "calibrate", NAME, str(file))
        assert (once["repeated"], twice["repeated"], twice["poses"]) == (0, 50, 50)
        assert {**twice, "repeated": 0, "worst_line": once["worst_line"]} == once
        assert run(["calibrate", NAME, str(file)]) == 0
        assert "from 50 poses (50 measurements of a repeated pose: each pose counts once)" in capsys.readouterr().out

    @pytest.mark.parametrize(
        "text",
        [
            "th1,th2,d3,th4,x,y,z\n1,2,3,4,5,six,7\n",
            "th1,th2,d3,th4,x,y,z\n",
            "th1,th2,d3,th4,x,y,z\n0,0,0,0,600,0,300\n",
        ],
    )
    def test_what_is_refused(
        self, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.chdir(tmp_path)
        Path("m.csv").write_text(text, encoding="utf-8")
        refusal(capsys, "calibrate", NAME, "m.csv", "--out", "found")
        assert not Path("found").exists()
        refusal(capsys, "calibrate", NAME)


class TestSimulate:
    def test_it_writes_the_same_file_again(self, folder: Path, tmp_path: Path) -> None:
        again = tmp_path / "again.csv"
        assert run(["calibrate", str(folder / "real.toml"), str(again), "--simulate", "50", "--seed", "5"]) == 0
        assert again.read_bytes() == (folder / "measured.csv").read_bytes()

    def test_it_replaces_nothing_unasked(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        file = tmp_path / "m.csv"
        file.write_text("mine", encoding="utf-8")
        refusal(capsys, "calibrate", NAME, str(file), "--simulate", "3")
        assert file.read_text(encoding="utf-8") == "mine"
        document = run_json(capsys, "calibrate", NAME, str(file), "--replace", "--simulate", "3", "--noise-mm", "0")
        assert document["dh_errors"] is False
        assert len(file.read_text(encoding="utf-8").splitlines()) == 4

    def test_numbers_that_are_refused(self, capsys: pytest.CaptureFixture[str]) -> None:
        simulate = ("calibrate", NAME, "m.csv", "--simulate")
        refusal(capsys, *simulate, "0")
        refusal(capsys, *simulate, "3", "--noise-mm", "11")
        refusal(capsys, *simulate, "3", "--noise-mm", "x")
        refusal(capsys, *simulate, "3", "--out", "found")
        refusal(capsys, "calibrate", NAME, "--simulate", "3")
        refusal(capsys, "calibrate", NAME, "m.csv", "--seed", "3")


class TestTheActualTool:
    @pytest.mark.slow
    def test_check_of_the_corrected_file_says_how_far_away_it_is(
        self, folder: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        corrected = str(folder / "found" / "robot.toml")
        document = run_json(capsys, "check", corrected)
        assert document["findings"] == []
        errors = document["dh_errors"]
        at_home = run_json(capsys, "fk", corrected, "0", "0", "0", "0")["position_error_mm"]
        assert errors["at_home_mm"] == pytest.approx(at_home)
        assert errors["links"]["link4"]["a_mm"] == pytest.approx(0.2, abs=0.02)
        assert errors["rms_mm"] < errors["max_mm"] < 10 * errors["rms_mm"]

    def test_fk_says_both(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        document = run_json(capsys, "fk", str(folder / "real.toml"), *Q)
        assert document["pose"] == run_json(capsys, "fk", NAME, *Q)["pose"]
        off_mm = np.subtract(position(document, "actual_pose"), position(document, "pose"))
        assert document["position_error_mm"] == pytest.approx(np.linalg.norm(off_mm))
        assert run(["fk", str(folder / "real.toml"), *Q]) == 0
        nominal, actual, off = capsys.readouterr().out.splitlines()
        assert nominal == "x 307.093017 mm, y 463.074039 mm, z 250.000000 mm, attitude 55.000000 deg"
        assert actual.startswith("actual: x 309.523326 mm, ")
        assert off == "2.663668 mm away, tilted by 0.060000 deg, by the dh_errors of the robot's file"

    @pytest.mark.slow
    def test_a_run_makes_the_same_pulses_and_says_both(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        """The errors are in no pulse and in no frame; the report and the verdict of the folder know them."""
        options = (str(folder / "motion.csv"), "--kernel", "python", "--out")
        plain = run_json(capsys, "run", NAME, *options, str(folder / "plain"))
        errant = run_json(capsys, "run", str(folder / "real.toml"), *options, str(folder / "errant"))
        for name in ("edges.npz", "bus.log", "trajectory.csv"):
            assert (folder / "plain" / name).read_bytes() == (folder / "errant" / name).read_bytes()
        assert "actual_tool" not in plain
        assert errant["tool"] == plain["tool"]
        assert errant["passed"]
        off_mm = run_json(capsys, "fk", str(folder / "real.toml"), "0", "60", "50", "0")["position_error_mm"]
        within_mm = plain["tool"]["position_error_mm_max"] + 0.02  # the motion is so short that the error stays
        assert errant["actual_tool"]["position_error_mm_max"] == pytest.approx(off_mm, abs=within_mm)
        assert run_json(capsys, "verify", str(folder / "errant"))["actual_tool"] == errant["actual_tool"]
        assert run(["verify", str(folder / "errant")]) == 0
        assert "actual tool, with the robot's dh_errors: " in capsys.readouterr().out
