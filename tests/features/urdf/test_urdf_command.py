"""`steptwin new --urdf` and `steptwin urdf`: files that `check` passes, what is printed, and what is refused."""

from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot_file
from steptwin.protocol.drivers import PROFILES
from tests.end_to_end.command_line import refusal, run_json
from tests.features.arms.arms import TEXTS
from tests.features.urdf.urdfs import joint, urdf

ARM = urdf(
    *(
        joint(f"J{i + 1}", "abcdefg"[i], "abcdefg"[i + 1], f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>')
        for i, (xyz, axis) in enumerate(
            [
                ("0 0 0.1", "0 0 1"),
                ("0.06 0 0.05", "0 1 0"),
                ("0 0 0.3", "0 1 0"),
                ("0.1 0 0", "1 0 0"),
                ("0.12 0 0", "0 1 0"),
                ("0.04 0 0", "1 0 0"),
            ]
        )
    ),
    links="abcdefg",
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(ARM, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
@pytest.mark.usefixtures("folder")
def test_a_robot_of_a_urdf_runs(capsys: pytest.CaptureFixture[str]) -> None:
    document = run_json(capsys, "new", "arm.toml", "--urdf", "arm.urdf", "--set", "J1.ratio=50")
    assert (document["kind"], document["joints"]) == ("chain", [f"J{i}" for i in range(1, 7)])
    assert document["dimensions"]["notation"] == "urdf"
    assert "fill in ratio of J2, J3, J4, J5, J6: 20 stands there" in document["notes"]
    assert run_json(capsys, "check", "arm.toml")["findings"] == []
    pose = run_json(capsys, "fk", "arm.toml", "0", "0", "0", "0", "0", "0")["pose"]
    assert (pose["x_mm"], pose["z_mm"]) == (pytest.approx(320.0), pytest.approx(450.0))
    robot = load_robot_file("arm.toml")
    ends = [f"{home + 1:g}" for home in robot.home]
    rows = [["t", *robot.joint_names], ["0", *(f"{home:g}" for home in robot.home)], ["1", *ends]]
    Path("motion.csv").write_text("".join(",".join(row) + "\n" for row in rows), encoding="utf-8")
    assert run_json(capsys, "run", "arm.toml", "motion.csv")["passed"]


@pytest.mark.usefixtures("folder")
def test_what_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["new", "arm.toml", "--urdf", "arm.urdf", "--kind", "chain"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "arm.toml: a robot of the kind chain with the joints J1 J2 J3 J4 J5 J6",
        "inverse kinematics in closed form: axes 2 and 3 are parallel, axes 4, 5 and 6 meet in a point",
        "fill in ratio of J1, J2, J3, J4, J5, J6: 20 stands there",
        "fill in microsteps of J1, J2, J3, J4, J5, J6: 8 stands there",
        "fill in drivers: [board] has those of a TB6560; --set driver_profile takes others",
        "fill in switches and homing: switches are 5 beyond each range",
        "look at it with: steptwin check arm.toml",
    ]


def test_drivers_of_a_new_arm(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = run_json(capsys, "new", "arm.toml", "--urdf", "arm.urdf", "--set", "driver_profile=a4988")
    assert not any("drivers" in note for note in document["notes"])
    assert load_robot_file(folder / "arm.toml").board.profile is PROFILES["a4988"]


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    "words",
    [
        ["--urdf", "none.urdf"],
        ["--urdf", "arm.urdf", "--kind", "scara"],
        ["--urdf", "arm.urdf", "--tip", "z"],
        ["--urdf", "arm.urdf", "--set", "J9.ratio=3"],
        ["--urdf", "arm.urdf", "--set", "J1.ratio=no"],
        ["--tip", "g"],
        ["--snap", "--kind", "scara"],
    ],
)
def test_what_is_refused_writes_nothing(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "new", "arm.toml", *words)
    assert not Path("arm.toml").exists()


@pytest.mark.usefixtures("folder")
def test_a_robot_becomes_a_urdf(capsys: pytest.CaptureFixture[str]) -> None:
    Path("ar4.toml").write_text(TEXTS["AR4"], encoding="utf-8")
    assert run(["urdf", "ar4.toml"]) == 0
    text = capsys.readouterr().out
    assert run(["urdf", "--robot-file", "ar4.toml", "--out", "ar4.urdf"]) == 0
    assert capsys.readouterr().out == "ar4.urdf: the robot from base_link to tool0\n"
    assert Path("ar4.urdf").read_text(encoding="utf-8") == text
    assert run_json(capsys, "new", "back.toml", "--urdf", "ar4.urdf")["joints"] == [f"J{i}" for i in range(1, 7)]
    refusal(capsys, "urdf", "ar4.toml", "--out", "ar4.urdf")
    assert run(["urdf", "ar4.toml", "--out", "ar4.urdf", "--replace"]) == 0
    capsys.readouterr()
    refusal(capsys, "urdf", "lab-scara")
