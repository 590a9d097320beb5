"""Programs of the AR4's HMI and of the PAROL6's Commander: the same poses, and nothing left out in silence."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.foreign import LANGUAGES, TakenOver, converted
from steptwin.host.planning.programs import compile_program, parse_program, read_program
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.poses import Orientation
from steptwin.host.robots.poses.rotations import matrix
from tests.end_to_end.command_line import refusal, run_json
from tests.end_to_end.pages import ROOT
from tests.host.complaints import complaint_of

AR4 = load_robot("ar4-mk3")
NAMES = AR4.joint_names
ENDS = "J7 0 J8 0 J9 0"

PICK = f"""##BEGINNING OF PROGRAM##
Move R [*] J1 0 J2 0 J3 0 J4 0 J5 90 J6 0 {ENDS} Sp 25 Ac 10 Dc 10 Rm 80 $ N
Out On = 8

Move J [*] X 300 Y 0 Z 300 Rz 170 Ry 10 Rx -5 {ENDS} Sp 40 Ac 10 Dc 10 Rm 100 $ N
Move L [*] X 300 Y 0 Z 280 Rz 170 Ry 10 Rx -5 {ENDS} Sp 40 Ac 10 Dc 10 Rm 100 Rnd 0 $ N
Wait Time = .5
Move L [*] X 300 Y 0 Z 300 Rz 170 Ry 10 Rx -5 {ENDS} Sm 12 Ac 10 Dc 10 Rm 100 Rnd 0 $ N
Move R [*] J1 10 J2 0 J3 0 J4 0 J5 90 J6 0 {ENDS} Ss 4 Ac 10 Dc 10 Rm 80 $ N
Move PR [ PR: 1 ] [*] {ENDS} Sp 20 Ac 20 Dc 20 Rm 100 $ F
Move R [*] J1 10 J2 0 J3 0 J4 0 J5 90 J6 0 J7 50 J8 0 J9 0 Sp 20 Ac 10 Dc 10 Rm 80 $ N
Jump Tab-2
"""
OURS = """# pick.ar4: 6 lines are steps here, 4 stand as comments.
robot = "ar4-mk3"

# BEGINNING OF PROGRAM
[[step]]
go = { J1 = 0.0, J2 = 0.0, J3 = 0.0, J4 = 0.0, J5 = 90.0, J6 = 0.0 }
speed_percent = 25.0
# left out, no motion: Out On = 8
[[step]]
go = { x = 300.0, y = 0.0, z = 300.0, rotvec_deg = [170.0, 10.0, -5.0] }
speed_percent = 40.0
[[step]]
line = { x = 300.0, y = 0.0, z = 280.0, rotvec_deg = [170.0, 10.0, -5.0] }
speed_mm_s = 12.5  # there: Sp 40
[[step]]
pause = 0.5
[[step]]
line = { x = 300.0, y = 0.0, z = 300.0, rotvec_deg = [170.0, 10.0, -5.0] }
speed_mm_s = 12.0
[[step]]
go = { J1 = 10.0, J2 = 0.0, J3 = 0.0, J4 = 0.0, J5 = 90.0, J6 = 0.0 }
duration_s = 4.0
# left out, no motion that this line alone says: Move PR [ PR: 1 ] [*] J7 0 J8 0 J9 0 Sp 20 Ac 20 Dc 20 Rm 100 $ F
# left out, J7 is an axis beside the arm: Move R [*] J1 10 J2 0 J3 0 J4 0 J5 90 J6 0 J7 50 J8 0 J9 0 Sp 20 Ac 10 Dc 10 Rm 80 $ N
# left out, no motion: Jump Tab-2
"""  # noqa: E501

DANCE = """Begin()
MoveJoint(10,20,-10,0,45,0,t=4)
Delay(1)
Gripper(255,20,120)
MoveJoint( 15 , 20 , -10 , 0 , 45 , 0, v=30, a=40, poly, speed)
MoveJoint(10,20,-10,0,45,0,v=30,t=0)
MoveCart(300,40,280,10,20,-170,t=2,trap)
MovePose(300,40,280,10,20,-170,v=20,a=20)
End()
"""


def write(folder: Path, name: str, text: str) -> str:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


def complaint(folder: Path, text: str, language: str = "ar4") -> str:
    path = write(folder, "p", text)
    return complaint_of(lambda: converted(path, language, AR4)).removeprefix(f"{path}: ")


def test_a_program_of_the_ar4(tmp_path: Path) -> None:
    made = converted(write(tmp_path, "pick.ar4", PICK), "ar4", AR4, 12.5)
    assert made.text == OURS
    assert (made.taken, len(made.left_out), made.own_speeds) == (6, 4, 1)
    ours = write(tmp_path, "pick.toml", made.text)
    assert compile_program(read_program(ours), AR4).trajectory.duration_s > 10.0


def test_the_ar4s_stored_pose_and_joints(tmp_path: Path) -> None:
    """The maker's defaults.json stores both: joints, and X Y Z Rz Ry Rx as its program shows them."""
    line = f"Move J [*] X 267.292 Y -43.402 Z 412.343 Rz 9.454 Ry 121.621 Rx -1.927 {ENDS} Sp 9 Ac 9 Dc 9 Rm 9 $ N"
    program = parse_program(converted(write(tmp_path, "p", line), "ar4", AR4).text, Findings())
    end = compile_program(program, AR4).trajectory
    joints = end.positions(np.array([end.duration_s]))[0]
    assert joints == pytest.approx([-9.686, -8.991, 18.549, 7.965, 22.667, -6.458], abs=0.005)


def test_a_program_of_the_parol6(tmp_path: Path) -> None:
    made = converted(write(tmp_path, "dance.txt", DANCE), "parol6", AR4)
    steps = [line for line in made.text.splitlines() if line]
    assert steps[2:9] == [
        "[[step]]",
        "go = { J1 = 10.0, J2 = 20.0, J3 = -10.0, J4 = 0.0, J5 = 45.0, J6 = 0.0 }",
        "duration_s = 4.0",
        "[[step]]",
        "pause = 1.0",
        "# left out, no motion: Gripper(255,20,120)",
        "[[step]]",
    ]
    assert [line for line in steps if line.startswith("speed")] == [
        "speed_percent = 30.0",
        "speed_percent = 45.0",
        "speed_mm_s = 50.0  # there: t=2",
        "speed_percent = 20.0",
    ]
    assert made.left_out == ("Gripper(255,20,120)",)


def test_the_parol6s_own_example_goes_straight_down() -> None:
    """Its example_2.txt moves the joints above a place and then to it: 70 mm lower, turned by less than a degree."""
    robot = load_robot("parol6")
    above = LANGUAGES["parol6"]("MoveJoint(89.033,-49.402,174.486,-1.027,-43.341,85.596)", robot.joint_names)
    at = LANGUAGES["parol6"]("MoveCart(-41.535,300.316,17.635,6.141,-0.686,-179.224)", robot.joint_names)
    assert isinstance(above, TakenOver)
    assert isinstance(at, TakenOver)
    kinematics, place = make_kinematics(robot), at.keys["line"]
    (start,) = kinematics.forward(np.array([list(above.keys["go"].values())]))
    turn = Orientation("rotvec_deg", tuple(place["rotvec_deg"]))
    goal = np.array([place["x"], place["y"], place["z"], *turn.rotation])
    assert (start - goal)[:3] == pytest.approx([0.0, 0.0, 70.0], abs=1.1)
    assert kinematics.task.off_deg(start, goal) < 0.5


@pytest.mark.slow
@given(st.tuples(*[st.floats(-180.0, 180.0)] * 3))
def test_the_angles_of_the_parol6_are_spatialmaths(angles: tuple[float, float, float]) -> None:
    """The Commander itself reads them by SE3.RPY(..., order='xyz')."""
    spatialmath = pytest.importorskip(
        "spatialmath", reason="spatialmath-python is not installed: nothing to compare with"
    )
    step = LANGUAGES["parol6"](f"MoveCart(1,2,3,{','.join(f'{angle:.6f}' for angle in angles)})", NAMES)
    assert isinstance(step, TakenOver)
    theirs = spatialmath.SE3.RPY([round(angle, 6) for angle in angles], unit="deg", order="xyz").R
    vector = Orientation("rotvec_deg", tuple(step.keys["line"]["rotvec_deg"]))
    assert matrix(vector.rotation) == pytest.approx(theirs, abs=1e-7)


@pytest.mark.parametrize(
    ("language", "text"),
    [
        ("ar4", "Out On = 8\n"),
        ("ar4", ""),
        pytest.param("parol6", PICK, id="parol6-ar4's"),
        ("ar4", "\nMove J [*] X 1 Y 2 Z $ N"),
        ("ar4", "Move J [*] X 1 Y 2 $ N"),
        ("ar4", "Move R [*] J1 1,5 J2 2 $ N"),
        ("ar4", "Wait Time = soon"),
        ("ar4", "Wait Time = 0"),
        pytest.param("ar4", PICK.replace("Sp 25", "Sp 250"), id="ar4-too fast"),
        ("parol6", "MoveJoint(1,2,3)"),
        ("parol6", "MoveCart(1,2,3,4,5,6.t=9)"),
        ("parol6", "MoveCart(1,2,3,4,5,6,q=9)"),
        ("parol6", "MoveJoint(1,2,3,4,5,6,t=soon)"),
        ("parol6", "Delay()"),
    ],
)
def test_what_is_refused(language: str, text: str, tmp_path: Path) -> None:
    complaint(tmp_path, text, language)


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
@given(text=st.text() | st.text(alphabet="MoveJRL [*]XYZRxyz0123456789.-$N(),=tva\n"))
def test_any_line_is_read_or_refused_in_a_line(language: str, text: str) -> None:
    message = ""
    try:
        LANGUAGES[language](text.strip(), NAMES)
    except InputError as error:
        message = str(error)
    assert "\n" not in message


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
@given(text=st.text())
def test_whatever_is_left_out_stays_a_comment(
    language: str, text: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Nothing that stands in a foreign line becomes a key: signs that end a line are escaped."""
    first = {"ar4": "Wait Time = 1", "parol6": "Delay(1)"}[language]
    path = write(tmp_path_factory.mktemp("any"), "p", f"{first}\n# {text}")
    try:
        made = converted(path, language, AR4)
    except InputError:
        return
    findings = Findings()
    assert len(parse_program(made.text, findings).steps) == made.taken
    assert not findings.messages


@pytest.mark.slow
def test_the_example_of_the_docs_passes() -> None:
    made = converted(str(ROOT / "docs/examples/pick.ar4"), "ar4", AR4, 12.0)
    program = parse_program(made.text, Findings())
    assert (made.taken, made.own_speeds, made.left_out) == (10, 1, ("Out On = 8", "Out Off = 8"))
    assert not compile_program(program, AR4).fast_steps()


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, out = write(tmp_path, "pick.ar4", PICK), str(tmp_path / "pick.toml")
    words = ["convert", "ar4-mk3", source, "--from", "ar4", "--line-speed", "12.5"]
    document = run_json(capsys, *words, "--out", out)
    assert (document["robot"], document["steps"], document["own_speeds"]) == ("ar4-mk3", 6, 1)
    assert Path(out).read_text(encoding="utf-8") == OURS
    refusal(capsys, *words, "--out", out)
    refusal(capsys, *words, "--out", "pick.csv")
    refusal(capsys, *words[:-1], "0", "--out", out, "--replace")
    refusal(capsys, "convert", "lab-scara", source, "--from", "ar4", "--out", out, "--replace")


def test_joints_go_by_the_robots_own_names() -> None:
    step = LANGUAGES["ar4"](f"Move R [*] J1 1 J2 2 J3 3 J4 4 J5 5 J6 6 {ENDS} Sp 5 $ N", ("a", "b", "c", "d", "e", "f"))
    assert isinstance(step, TakenOver)
    assert step.keys["go"] == {"a": 1.0, "b": 2.0, "c": 3.0, "d": 4.0, "e": 5.0, "f": 6.0}
    assert make_kinematics(AR4).task.name == "pose"
