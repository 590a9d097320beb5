"""`steptwin check pick.toml`: everything that is wrong in a program, or the table of its steps."""

from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.robots import brought_text
from tests.end_to_end.command_line import refusal, run_json

ARM = brought_text("teaching-scara")
STEPS = "[[step]]\ngo = { th1 = 20 }\n"
FAST = """
start = { th2 = 60 }
robot = "teaching-scara"
[[step]]
go = { th1 = 60 }
duration_s = 0.2
[[step]]
by = { z = -50 }
speed_mm_s = 90
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    return tmp_path / "pick.toml"


def findings(capsys: pytest.CaptureFixture[str], program: Path, text: str) -> list[str]:
    program.write_text(text, encoding="utf-8")
    found: list[str] = run_json(capsys, "check", str(program), exit_code=2)["findings"]
    return found


def test_mistakes_of_every_kind_are_found_at_once(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A step that cannot be read, an unknown name, a place out of reach and a speed, in one program."""
    text = (
        'robot = "teaching-scara"\n[[step]]\ngo = { th1 = 60 }\nduration_s = 0.2\n[[step]]\nfly = 3\n'
        "[[step]]\ngo = 'tray'\n[[step]]\ngo = { th1 = 0, th2 = 60, d3 = 0, th4 = 0 }\n"
        "[[step]]\ngo = { x = 500 }\n[[sequences.s]]\noutput = 'lamp'\non = true\n"
    )
    found = findings(capsys, program, text)
    assert [message.split(" (")[0].split(":")[0] for message in found] == [
        "step 2", "step 3", "sequences.s step 1", "step 5", "step 1",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("robot", "complaint"),
    [
        ("teaching-scra", "robot: 'teaching-scra' is unknown: did you mean teaching-scara?"),
        ("my-scara", "robot: 'my-scara' is unknown: did you mean my-scara.toml, the file beside it?"),
        ("my-scra.toml", "robot: {folder}/my-scra.toml: there is no such file: did you mean my-scara.toml?"),
        ("x.toml", "robot: {folder}/x.toml: there is no such file, counted from the program's folder"),
        ("wrong.toml", "robot: {folder}/wrong.toml: joints.th1.ratio: is missing"),
        (None, "robot: is missing: name it in the file, or behind it"),
    ],
)
def test_a_wrong_robot_hides_nothing_else(
    robot: str | None, complaint: str, program: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (program.parent / "my-scara.toml").write_text(ARM, encoding="utf-8")
    (program.parent / "wrong.toml").write_text(ARM.replace("ratio = 4.0", "", 1), encoding="utf-8")
    head = "" if robot is None else f'robot = "{robot}"\n'
    found = findings(capsys, program, f"{head}{STEPS}[[step]]\ngo = 'tray'\n")
    unknown = "step 2 (go to tray): position 'tray' is unknown: there are none"
    assert found == [complaint.format(folder=program.parent), unknown]


def test_the_robot_s_file_counts_from_the_program_s_folder(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm = program.parent / "my-scara.toml"
    arm.write_text(ARM.replace('name = "teaching-scara"', 'name = "mine"'), encoding="utf-8")
    program.write_text(f'robot = "my-scara.toml"\n{STEPS}', encoding="utf-8")
    assert run_json(capsys, "check", str(program))["robot"] == "mine"
    other = refusal(capsys, "run", "teaching-scara", str(program))
    assert other.endswith("robot: the program is for mine in my-scara.toml, not for teaching-scara")
    program.write_text(f'robot = "my-scara"\n{STEPS}', encoding="utf-8")
    told = refusal(capsys, "run", str(arm), str(program))
    assert told.endswith("is for my-scara, not for mine; did you mean my-scara.toml, the file beside it?")


def test_steps_that_are_too_fast_are_told_with_the_stretch_that_does(
    program: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program.write_text(FAST, encoding="utf-8")
    assert run(["check", str(program)]) == 2
    first, second, advice = capsys.readouterr().err.splitlines()
    assert first.startswith(f"{program}: step 1 (go to th1 60): th1: a speed of ")
    assert second.startswith(f"{program}: step 2 (by z -50): d3: a speed of ")
    assert advice.startswith(f"{program}: or the whole program: ")
    assert advice.endswith("; --stretch auto finds it")


@pytest.mark.slow
def test_a_program_that_is_too_fast_does_not_run(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program.write_text(FAST, encoding="utf-8")
    first = f"{program}: step 1 (go to th1 60): th1: a speed of "
    told = refusal(capsys, "run", "teaching-scara", str(program))
    assert told.startswith(first)
    assert "; 1 more step is too fast; or the whole program: " in told
    told = refusal(capsys, "run", "teaching-scara", str(program), "--stretch", "1.01")
    assert told.startswith(f"{program}: step 1 (go to th1 60): th1: ")


def test_names_of_files_here_are_recognised(
    program: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file without its suffix, a program in the place of the robot, and a program with several mistakes."""
    monkeypatch.chdir(program.parent)
    program.write_text(f"{STEPS}fly = 1\n{STEPS}swim = 1", encoding="utf-8")
    robot = "robot 'pick' is unknown: did you mean pick.toml, the file here?"
    assert refusal(capsys, "run", "pick", "carry") == robot
    job = "job 'pick' is unknown: did you mean pick.toml, the file here?"
    assert refusal(capsys, "run", "teaching-scara", "pick") == job
    refusal(capsys, "run", "pick.toml")
    several = refusal(capsys, "run", "teaching-scara", "pick.toml")
    assert several.startswith("pick.toml: step 1: fly: key 'fly' is unknown: ")
    assert several.endswith("; more is wrong, `steptwin check` tells it all")


def test_the_table_shows_the_passes_of_a_repetition(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program.write_text(
        'robot = "teaching-scara"\n[[step]]\nrepeat = 2\nsteps = [{ pause = 1 }]\n[[step]]\npause = 0.5\n',
        encoding="utf-8",
    )
    assert run(["check", str(program)]) == 0
    heads, _, *lines, _ = capsys.readouterr().out.splitlines()
    assert heads.split()[:3] == ["step", "pass", "what"]
    assert [line.split()[:3] for line in lines] == [["1.1", "1", "pause"], ["1.1", "2", "pause"], ["2", "-", "pause"]]
    assert [step["pass"] for step in run_json(capsys, "check", str(program))["steps"]] == [[1], [2], []]


@pytest.mark.parametrize("name", ["mine.csv", "mine.yaml"])
def test_a_trajectory_is_for_run(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    refusal(capsys, "check", name)
