"""`steptwin new`: files that `check` passes and every command works with at once."""

import re
from pathlib import Path

import numpy as np
import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.operate.doctor import examine
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.session import Session
from steptwin.host.robots import load_robot, load_robot_file, read_robot, robot_names
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import dimensions
from steptwin.host.robots.kinematics.kinds import kinds
from steptwin.host.robots.new_file import new_motors, robot_text, with_settings
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.protocol.drivers import PROFILES
from tests.end_to_end.command_line import PROGRAM, refusal, run_json
from tests.end_to_end.terminal import Terminal

SCARAS = [
    {"lift": "first", "tool_rotation": "true", "tool": "up"},
    {"lift": "none", "tool_rotation": "false", "tool": "down"},
]
"""Besides the usual SCARA: lift last, a tool that turns and points down."""
CASES: list[tuple[str, dict[str, str]]] = [
    *((kind, {}) for kind in kinds()),
    *(("scara", options) for options in SCARAS),
    ("cartesian", {"axes": "ZXYC", "Z.upper": "50"}),
    ("chain", {"J1.d_mm": "200", "J2.a_mm": "30", "J5.upper": "100"}),
    *(("chain", {"joints": str(joints)}) for joints in range(1, 6)),
    ("axes", {"joints": "4"}),
    ("axes", {"joints": "8", "axis8.ratio": "3"}),
    *(("cartesian", {"driver_profile": drivers}) for drivers in PROFILES),
]


def short_move(robot_file: Path) -> str:
    """Return a CSV in which every joint goes from home to a little further into its range."""
    robot = load_robot_file(str(robot_file))
    middle = [(joint.lower + joint.upper) / 2 for joint in robot.joints]
    ends = [home + 0.02 * (there - home) + 0.5 for home, there in zip(robot.home, middle, strict=True)]
    rows = [["t", *robot.joint_names], ["0", *map(str, robot.home)], ["1", *map(str, ends)]]
    return "".join(",".join(row) + "\n" for row in rows)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "options"),
    [pytest.param(*case, id="-".join([case[0], *case[1].values()])) for case in CASES],
)
def test_every_kind_makes_a_robot_that_runs(
    kind: str, options: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "my-arm.toml"
    words = [word for key, value in options.items() for word in ("--set", f"{key}={value}")]
    document = run_json(capsys, "new", str(file), "--kind", kind, *words)
    assert document["kind"] == kind
    robot = load_robot_file(str(file))
    assert (robot.name, robot.kinematics) == ("my-arm", kind)
    assert list(robot.joint_names) == document["joints"]
    assert run_json(capsys, "check", str(file))["findings"] == []
    motion = tmp_path / "motion.csv"
    motion.write_text(short_move(file), encoding="utf-8")
    assert run_json(capsys, "run", str(file), str(motion))["passed"]
    home = [f"{position:g}" for position in robot.home]
    if kind != "axes":
        pose = run_json(capsys, "fk", str(file), *home)["pose"]
        assert all(value is not None for value in pose.values())


@pytest.mark.parametrize("kind", [kind for kind in kinds() if kind in robot_names()])
def test_the_kinds_of_the_five_robots_begin_with_their_values(kind: str) -> None:
    ours, new = load_robot(kind), read_robot(robot_text("mine", kind, *with_settings(kind, {})))
    assert new.geometry == ours.geometry
    assert new.home == ours.home
    assert [(j.name, j.lower, j.upper, j.transmission) for j in new.joints] == [
        (j.name, j.lower, j.upper, j.transmission) for j in ours.joints
    ]
    assert new.places == ours.places
    assert new.outputs == ours.outputs


def test_the_arm_of_200_and_150_mm_with_a_4_mm_screw() -> None:
    settings = {"l1_mm": "200", "l2_mm": "150", "d3.travel_per_turn": "4", "d3.microsteps": "8", "d3.upper": "60"}
    text = robot_text("arm", "scara", *with_settings("scara", settings))
    lift = read_robot(text).joint("d3")
    assert lift.transmission.steps_per_unit == 400
    assert (lift.speed_max, lift.step_rate_max_hz) == (30, 12_000)  # 80 % of 15 kHz
    assert (lift.upper, lift.switches.positive_limit, lift.switches.negative_limit) == (60, 65, -5)
    assert "speed_max = 30.0         # mm/s, 12000 steps/s\n" in text


@pytest.mark.slow
@given(st.floats(0.5, 100.0), st.sampled_from([1, 2, 8, 16]), st.floats(0.2, 200.0), st.sampled_from([1, 2, 8, 16]))
def test_the_driver_and_the_motor_follow_every_highest_speed(
    lead_mm: float, lift_microsteps: int, ratio: float, arm_microsteps: int
) -> None:
    settings = {
        "d3.travel_per_turn": repr(lead_mm),
        "d3.microsteps": str(lift_microsteps),
        "th1.ratio": repr(ratio),
        "th1.microsteps": str(arm_microsteps),
    }
    robot = read_robot(robot_text("arm", "scara", *with_settings("scara", settings)))
    for joint in robot.joints:
        assert joint.step_rate_max_hz <= 12_000 * (1 + 1e-9)
        assert joint.speed_max / joint.transmission.travel_per_rev <= 8.0 * (1 + 1e-9)


def with_motors(text: str) -> str:
    """Return a new robot's file with its lines for motors, which are comments in it."""
    head, _, lines = text.partition("# Would the motors keep step?")
    return head + "\n".join(line.removeprefix("# ") for line in lines.splitlines()[3:]) + "\n"


@pytest.mark.parametrize("kind", kinds())
def test_motors_are_comments_that_only_need_to_be_uncommented(kind: str) -> None:
    text = robot_text("mine", kind, *with_settings(kind, {}))
    bare, driven = read_robot(text), read_robot(with_motors(text))
    assert (bare.dynamics, {joint.motor for joint in bare.joints}) == (None, {None})
    assert driven.dynamics is not None
    assert all(joint.motor is not None and joint.link is not None for joint in driven.joints)


GIVEN = {"th1.motor": "17HS19-1684S1", "d3.mass_kg": "0", "supply_v": "30"}


@pytest.mark.parametrize("given", [dict([each]) for each in GIVEN.items()], ids=list(GIVEN))
def test_one_figure_of_the_motors_brings_the_others(given: dict[str, str]) -> None:
    geometry, joints = with_settings("scara", given)
    robot = read_robot(robot_text("arm", "scara", geometry, joints))
    assert robot.dynamics is not None
    assert robot.dynamics.supply_v == float(given.get("supply_v", "24"))
    models = [joint.motor.model for joint in robot.joints if joint.motor is not None]
    assert models == 4 * [given.get("th1.motor", "17HS19-2004S1")]
    masses = {joint.name: joint.link.mass_kg for joint in robot.joints if joint.link is not None}
    assert masses == {"th1": 0.5, "th2": 0.5, "d3": float(given.get("d3.mass_kg", "0.5")), "th4": 0.5}
    bodies = {joint.name: (joint.link.centre_mm[0], joint.link.inertia_kgm2[1]) for joint in robot.joints if joint.link}
    assert bodies["th1"] == (100.0, 0.0017)  # a rod of 0.5 kg and 200 mm: m l^2 / 12
    assert bodies["d3"] == (0.0, 0.0)


@pytest.mark.parametrize("drivers", PROFILES)
def test_the_supply_that_is_assumed_suits_all_drivers(drivers: str) -> None:
    made = with_settings("axes", {"driver_profile": drivers, "table.motor": "17HS19-2004S1"})
    assert read_robot(robot_text("table", "axes", *made)).dynamics is not None


def test_what_is_said_of_motors_is_not_marked_as_assumed() -> None:
    geometry, joints = with_settings("axes", {"table.motor": "17HS19-1684S1", "table.mass_kg": "2", "supply_v": "36"})
    motors = new_motors(geometry, joints)
    assert motors.assumptions({"table": Unit.DEG}) == []
    marked = [line.split(" ")[0] for line in motors.text({"table": Unit.DEG}).splitlines() if "ASSUMED" in line]
    assert marked == ["friction_nm", "centre_mm", "inertia_kgm2"]


@pytest.mark.slow
def test_a_gantry_with_a4988_holds_its_highest_speed_by_torque(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """8 turns a second at 24 V and 1 A, with slides of 0.5 kg (docs/robot-files.md has these figures)."""
    file = tmp_path / "gantry.toml"
    settings = {"driver_profile": "a4988"}
    file.write_text(with_motors(robot_text("gantry", "cartesian", *with_settings("cartesian", settings))))
    own = run_json(capsys, "motors", str(file))["joints"][0]["own"]
    assert (own["rpm"], own["current_a"], own["would_do"]) == (480, 1.0, True)
    assert round(own["torque_available_nm"], 2) == 0.17
    assert round(own["torque_needed_nm"], 3) == 0.027


def test_a_shorter_arm_is_the_usual_one_with_the_rest_at_0() -> None:
    usual = make_kinematics(read_robot(robot_text("arm", "chain", *with_settings("chain", {}))))
    for joints in range(1, 6):
        robot = read_robot(robot_text("arm", "chain", *with_settings("chain", {"joints": str(joints)})))
        given = np.array([[20.0, 10.0, -30.0, 40.0, 50.0][:joints]])
        whole = np.concatenate([given, np.zeros((1, 6 - joints))], axis=1)
        arm = make_kinematics(robot)
        tool, of_usual = (each.dh.transforms(each.dh_variables(at)) for each, at in ((arm, given), (usual, whole)))
        assert np.allclose(tool, of_usual, atol=1e-9)


def test_the_help_names_the_kinds_and_their_keys(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["new", "--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for name, kind in kinds().items():
        assert f" {name}: {' '.join(dimensions(kind.geometry)) or 'no dimensions'} " in shown


@pytest.mark.parametrize(
    "words",
    [
        ["--kind", "scra"],
        [],
        ["--kind", "scara", "--set", "l4_mm=3"],
        ["--kind", "scara", "--set", "l1_mm=long"],
        ["--kind", "scara", "--set", "lift=frist"],
        ["--kind", "scara", "--set", "tool_rotation=1"],
        ["--kind", "scara", "--set", "d1.upper=3"],
        ["--kind", "scara", "--set", "d3.ratio=3"],
        ["--kind", "scara", "--set", "ratio=3"],
        ["--kind", "scara", "--set", "d3.microsteps=4"],
        ["--kind", "scara", "--set", "d3.microsteps=8.5"],
        ["--kind", "scara", "--set", "l1_mm=-3"],
        ["--kind", "scara", "--set", "d3.upper=-3"],
        ["--kind", "axes", "--set", "joints=9"],
        ["--kind", "axes", "--set", "joints=four"],
        ["--kind", "chain", "--set", "joints=0"],
        ["--kind", "scara", "--set", "joints=4"],
        ["--kind", "chain", "--set", "joints=4", "--set", "J5.a_mm=3"],
        ["--kind", "scara", "--set", "driver_profile=a4989"],
        ["--kind", "scara", "--set", "driver_profile=generic"],
        ["--kind", "scara", "--set", "driver_profile=a3967", "--set", "d3.microsteps=16"],
        ["--kind", "scara", "--set", "l1_mm"],
    ],
)
def test_wrong_settings_write_nothing(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "my-arm.toml"
    refusal(capsys, "new", str(file), *words)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_at_a_question_ends_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt() -> str:
        raise typer.Abort

    monkeypatch.setattr("steptwin.host.cli.run.new._asked_kind", interrupt)
    assert run(["new", str(tmp_path / "my-arm.toml")]) == 130
    assert capsys.readouterr() == ("", "\n")
    assert not list(tmp_path.iterdir())


def test_microsteps_may_be_written_as_a_fraction() -> None:
    _, joints = with_settings("scara", {"d3.microsteps": "1/2"})
    assert [joint.microsteps for joint in joints if joint.name == "d3"] == [2]


def test_it_replaces_only_when_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "my-arm.toml"
    file.write_text("mine", encoding="utf-8")
    refusal(capsys, "new", str(file), "--kind", "scara")
    assert file.read_text(encoding="utf-8") == "mine"
    assert run(["new", str(file), "--kind", "scara", "--replace"]) == 0
    assert load_robot_file(str(file)).kinematics == "scara"


@pytest.mark.parametrize("original", robot_names())
def test_a_robot_that_is_there_is_copied_under_the_new_name(
    original: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "my-own.toml"
    document = run_json(capsys, "new", str(file), "--from", original)
    robot, there = load_robot_file(file), load_robot(original)
    assert (robot.name, document["from"], document["kind"]) == ("my-own", original, there.kinematics)
    changed = [line for line in robot.toml.splitlines() if line not in there.toml.splitlines()]
    assert changed == ['name = "my-own"']


@pytest.mark.parametrize(
    "words",
    [
        ["--from", "ar4-mk4"],
        ["--from", "ar4-mk3", "--kind", "chain"],
        ["--from", "ar4-mk3", "--set", "J1.ratio=9"],
        ["--from", "ar4-mk3", "--urdf", "a.urdf"],
    ],
)
def test_copies_that_cannot_be(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "new", str(tmp_path / "mine.toml"), *words)
    assert not list(tmp_path.iterdir())


def test_a_robot_file_ends_in_toml(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = "does not end in .toml: a robot file does, such as"
    for name, suggested in (("my-arm", "my-arm.toml"), ("a b", "'a b.toml'")):
        told = refusal(capsys, "new", str(tmp_path / name), "--kind", "scara")
        assert told == f"{tmp_path / name}: {words} {suggested}"
    assert run(["new", str(tmp_path / "a b.toml"), "--kind", "scara"]) == 0
    assert capsys.readouterr().out.endswith(f"look at it with: steptwin check '{tmp_path / 'a b.toml'}'\n")


@pytest.mark.slow
def test_on_a_terminal_it_asks(tmp_path: Path) -> None:
    """A wrong answer is asked for again; an empty one is the usual value; what makes no robot is asked for again."""
    with Terminal([*PROGRAM, "new", "my-arm.toml", "--set", "base_mm=90"], tmp_path) as terminal:
        terminal.await_text("kind [scara]: ")
        for answer in ("scra", "scara", "-200", "200", "150", "nowhere", "none"):
            terminal.type(f"{answer}\n")
        terminal.await_text("kinematics.l1_mm: -200 is not above 0")
        terminal.await_text("lift: 'nowhere' is not one of first, last, none")
        terminal.type("\n" * 9 + "-200" + "\n" * 11)
        terminal.await_text("joints.th1.upper: -200 deg is not above lower, -130 deg")
        terminal.type("\n" * 12)
        terminal.await_text("th1.upper, shoulder, belt: greatest position in deg [-200]: ")
        terminal.type("130" + "\n" * 11)
        assert terminal.await_exit() == 0
        assert "kind 'scra' is unknown: did you mean scara" in terminal.written
        assert "base_mm," not in terminal.written
    robot = load_robot_file(str(tmp_path / "my-arm.toml"))
    assert (robot.geometry["l1_mm"], robot.geometry["base_mm"]) == (200, 90)
    assert robot.joint_names == ("th1", "th2", "th3")


def test_every_number_has_a_comment_or_a_plain_name() -> None:
    """What the file asks its user, and what was derived, is explained beside it."""
    text = robot_text("arm", "scara", *with_settings("scara", {}))
    for key in ("l1_mm", "drop_mm", "bitrate", "speed_max", "acceleration_max", "microsteps", "ratio", "method"):
        lines = re.findall(rf"^{key} = .*$", text, re.MULTILINE)
        assert lines
        assert all(" # " in line for line in lines)


@pytest.mark.slow
@pytest.mark.parametrize("kind", kinds())
def test_every_kind_is_homed_as_it_stands(kind: str, fast_kernel: Kernel) -> None:
    """A board is made for the file; all axes find their limit switches, go to home and are fit to move."""
    robot = read_robot(robot_text("mine", kind, *with_settings(kind, {})))
    near_the_switches = {joint.name: joint.lower + 0.5 for joint in robot.joints}
    session = Session(BoardUnderTest(robot, stand_at=near_the_switches, kernel=fast_kernel), robot)
    states = home_robot(session, together=True)
    assert [state.position_known for state in states] == [True] * len(robot.joints)
    assert [state.position for state in states] == pytest.approx(robot.home, abs=0.02)
    assert [check for check in examine(session) if not check.passed] == []


def test_a_program_names_the_file_of_its_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A line of an arm whose tool does not turn, for the robot file's path, its name, and another robot."""
    file, program = tmp_path / "my-arm.toml", tmp_path / "line.toml"
    assert run(["new", str(file), "--kind", "scara", "--set", "lift=none", "--set", "tool_rotation=false"]) == 0
    for robot in (str(file), "my-arm"):
        text = f'robot = "{robot}"\n[[step]]\nline = {{ x = 150, y = 200 }}\nspeed_mm_s = 40\n'
        program.write_text(text, encoding="utf-8")
        assert run_json(capsys, "check", str(program), str(file))["findings"] == []
    assert run_json(capsys, "run", str(file), str(program))["passed"]
    refusal(capsys, "run", "lab-scara", str(program))


@pytest.mark.parametrize(("settings", "coupled"), [(["belts=corexy"], True), (["belts=each"], False), ([], False)])
def test_a_gantry_may_have_the_belts_of_a_corexy(settings: list[str], coupled: bool, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    assert run(["new", str(file), "--kind", "cartesian", *(word for each in settings for word in ("--set", each))]) == 0
    robot = load_robot_file(str(file))
    assert bool(robot.coupling.matrix) is coupled
    assert robot.geometry == {"axes": "XYZ"}
    if coupled:
        assert robot.coupling.to_axes(np.array([3.0, 5.0, 1.0])).tolist() == [8.0, 2.0, 1.0]


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (["belts=h-bot"], "belts: 'h-bot' is neither each nor corexy"),
        (["belts=corexy", "axes=XZ"], "belts: corexy moves X and Y, but axes is 'XZ'"),
    ],
)
def test_belts_that_cannot_be(
    settings: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.toml"
    assert run(["new", str(file), "--kind", "cartesian", *(word for each in settings for word in ("--set", each))]) == 2
    assert told in capsys.readouterr().err
    assert not file.exists()


def test_a_motor_that_is_given_is_no_comment(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "arm.toml"
    assert run(["new", str(file), "--kind", "scara", "--set", "th1.motor=23HS22-2804S"]) == 0
    lines = file.read_text(encoding="utf-8").splitlines()
    at = lines.index("[joints.th1.motor]")
    assert lines[at + 1 : at + 3] == [
        'model = "23HS22-2804S" # or the figures of its datasheet',
        "friction_nm = 0.01     # ASSUMED: of motor and gear, at the motor's shaft",
    ]
    refusal(capsys, "new", str(file), "--kind", "scara", "--replace", "--set", "th1.motor=23HS22")
