"""Programs as users run them: the examples of docs/programs, the blocks of docs/programs.md, inputs and time-outs."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.common.errors import WaitTimeoutError
from steptwin.host.common.findings import Findings
from steptwin.host.operate.running import execute_live
from steptwin.host.operate.session import Session
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.input_changes import InputChange
from steptwin.host.twin.machine.machine_options import MachineOptions
from tests.end_to_end.command_line import refusal, run_json
from tests.end_to_end.marks import slow_but
from tests.end_to_end.pages import ROOT, blocks_of, read_page
from tests.messages import refusing

EXAMPLES = {name: ROOT / "docs" / "programs" / f"{name}.toml" for name in robot_names()}
WAITING_FOR = {"teaching-scara": "part_ready"}
"""The input for which each example waits at its start; the others wait for none."""
VERBS = {
    "teaching-scara": {"wait", "repeat", "call"},
    "calibration-scara": {"circle", "arc", "line"},
    "lab-scara": {"through"},
    "warehouse-scara": {"output", "call"},
    "hybrid-arm": {"repeat", "call", "go"},
    "ar4-mk3": {"go", "line", "call", "pause", "by"},
    "parol6": {"go", "line", "call", "pause", "by", "output"},
    "thor": {"go", "line", "call", "pause", "by", "output"},
    "corexy-gantry": {"go", "line", "call", "by", "circle", "output"},
    "turntable": {"go", "by", "call", "repeat", "pause", "output"},
}
"""Steps that each robot's example shows."""
BLOCKS = [text for language, text in blocks_of(read_page("docs/programs.md")) if language == "toml"]
STEPS = [text for text in BLOCKS[1:] if "gcode =" not in text]
"""Those without files; docs/programs/engraving shows a step of G-code."""
HEAD = 'robot = "teaching-scara"\nstart = { x = 107.0, y = 110.0, z = -40.0, phi = 70.0 }\n'

WAITING = """
robot = "teaching-scara"
[[step]]
by = { th1 = 10.0 }
[[step]]
repeat = 1
steps = [{ wait = "part_ready", on = false, timeout_s = 0.5 }, { wait = "part_ready", on = true, timeout_s = 0.5 }]
[[step]]
by = { th1 = -10.0 }
"""


@pytest.fixture
def waiting(tmp_path: Path) -> str:
    file = tmp_path / "waiting.toml"
    file.write_text(WAITING)
    return str(file)


@pytest.mark.slow
@pytest.mark.parametrize("robot", robot_names())
def test_each_robot_has_an_example(
    robot: str, capsys: pytest.CaptureFixture[str], example_run: Callable[[str], Path]
) -> None:
    """It shows its steps, it is right, and its run passes, also when it is verified again from its files."""
    program = str(EXAMPLES[robot])
    text = EXAMPLES[robot].read_text()
    assert [verb for verb in sorted(VERBS[robot]) if f"{verb} = " not in text] == []
    checked = run_json(capsys, "check", program)
    assert (checked["robot"], checked["findings"]) == (robot, [])
    folder = example_run(robot) / "run"
    document = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert document["passed"]
    waited_s = sum(wait["stood_s"] for wait in document.get("waits", []))
    assert document["duration_s"] == pytest.approx(checked["duration_s"] + waited_s)
    assert run(["verify", str(folder)]) == 0


@pytest.mark.slow
def test_an_output_may_be_told_the_level_that_it_has(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file, folder = tmp_path / "again.toml", str(tmp_path / "out")
    levels = ("false", "true", "true", "false")
    text = "".join(f'[[step]]\noutput = "gripper"\non = {on}\n[[step]]\npause = 0.2\n' for on in levels)
    file.write_text(f"{text}[[step]]\nby = {{ X = 1.0 }}\n")
    document = run_json(capsys, "run", "corexy-gantry", str(file), "--out", folder)
    assert document["passed"], document["reasons"]
    assert [output["already"] for output in document["outputs"]] == [True, False, True, False]
    assert run(["verify", folder]) == 0
    assert "\noutputs: gripper off already, gripper on 0." in capsys.readouterr().out


LIKE_AR4 = ("parol6", "thor")
"""Arms of the same kind, whose examples have the same steps."""
COMES_S = (0.0, 0.1, 0.3, 4.0)
"""When the input comes on: at once, within the 250 ms that are queued before the start, and up to seconds later."""


@pytest.mark.slow
@pytest.mark.parametrize("comes_s", COMES_S[::3])
@pytest.mark.parametrize("robot", WAITING_FOR)
def test_an_example_waits_for_its_input(capsys: pytest.CaptureFixture[str], robot: str, comes_s: float) -> None:
    document = run_json(capsys, "run", robot, str(EXAMPLES[robot]), "--input", f"{WAITING_FOR[robot]}=on@{comes_s}")
    assert document["passed"]
    first, *others = document["waits"]
    assert (first["input"], first["at_s"]) == (WAITING_FOR[robot], 0.0)
    assert comes_s + 0.23 <= first["stood_s"] <= comes_s + 0.31
    assert [wait["stood_s"] for wait in others] == pytest.approx([0.26] * len(others), abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("robot", WAITING_FOR)
def test_an_example_whose_input_never_comes_names_the_time_out(capsys: pytest.CaptureFixture[str], robot: str) -> None:
    assert run(["run", robot, str(EXAMPLES[robot])]) == 3
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert line.startswith(f"steptwin: step 1.1.1, pass 1: the input {WAITING_FOR[robot]} was not on within 30 s; ")
    assert "STOPPED BY A WAIT THAT TIMED OUT" in said.out


@pytest.mark.slow
class TestLive:
    """The examples on a live board, as `run --connect` makes them, in virtual time."""

    @pytest.mark.parametrize("comes_s", COMES_S)
    @pytest.mark.parametrize("robot", WAITING_FOR)
    def test_an_example_waits_for_its_input(self, fast_kernel: Kernel, robot: str, comes_s: float) -> None:
        board, session, example = self.standing(robot, fast_kernel)
        board.change_inputs([InputChange(WAITING_FOR[robot], on=True, at_s=comes_s)])
        outcome = execute_live(session, example, "example", approach=True)
        assert outcome.passed
        assert comes_s + 0.23 <= outcome.waits[0].stood_s <= comes_s + 0.31

    @pytest.mark.parametrize("robot", WAITING_FOR)
    def test_an_example_whose_input_never_comes_names_the_time_out(self, fast_kernel: Kernel, robot: str) -> None:
        _, session, example = self.standing(robot, fast_kernel)
        with refusing(WaitTimeoutError):
            execute_live(session, example, "example", approach=True)

    @pytest.mark.parametrize("robot", [name for name in robot_names() if name not in {*WAITING_FOR, *LIKE_AR4}])
    def test_the_others_run(self, fast_kernel: Kernel, robot: str) -> None:
        _, session, example = self.standing(robot, fast_kernel)
        assert execute_live(session, example, "example", approach=True).passed

    def standing(self, name: str, kernel: Kernel) -> tuple[EmbeddedBoard, Session, Plan]:
        """Return a board whose robot stands where its example starts, and the example."""
        robot = load_robot(name)
        program = parse_program(EXAMPLES[name].read_text(), Findings())
        example = plan(robot, compile_program(program, robot).motion)
        board = EmbeddedBoard(robot, kernel, MachineOptions(stand_at=example.start_joints))
        session = Session(board, robot)
        with session.charge("preset", needs=()) as charge:
            machine = charge.enable()
            machine.preset(example.start_units)
        return board, session, example


def test_no_example_is_left_out() -> None:
    waiting = {robot for robot, path in EXAMPLES.items() if "wait = " in path.read_text()}
    assert waiting == WAITING_FOR.keys()
    assert sorted(path.stem for path in (ROOT / "docs" / "programs").glob("*.toml")) == sorted(robot_names())


@pytest.mark.slow
def test_the_page_s_first_program_runs(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "pick.toml"
    file.write_text(BLOCKS[0])
    assert run_json(capsys, "run", "teaching-scara", str(file))["passed"]


@pytest.mark.slow
@pytest.mark.parametrize("block", slow_but([text for text in STEPS if "pallets" not in text], STEPS))
def test_the_page_s_steps_can_be_made(block: str) -> None:
    findings = Findings()
    program = parse_program(HEAD + block, findings)
    assert findings.messages == []
    robot = load_robot("teaching-scara")
    plan(robot, compile_program(program, robot).motion)


@pytest.mark.slow
def test_inputs_change_at_their_times(waiting: str, capsys: pytest.CaptureFixture[str]) -> None:
    document = run_json(capsys, "run", "teaching-scara", waiting, "--input", "part_ready=on@0.9")
    first, second = document["waits"]
    assert (first["input"], first["on"], second["on"]) == ("part_ready", False, True)
    assert second["at_s"] == pytest.approx(first["at_s"] + first["stood_s"] + 0.01)
    assert run(["run", "teaching-scara", waiting, "--input", "part_ready=on@0.9"]) == 0
    assert "waited: part_ready off for 0.2" in capsys.readouterr().out


@pytest.mark.slow
def test_a_time_out_is_exit_code_3_with_input_step_and_seconds(
    waiting: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = str(tmp_path / "out")
    assert run(["run", "teaching-scara", waiting, "--out", out]) == 3
    *_, line = capsys.readouterr().err.splitlines()
    assert line.startswith("steptwin: step 2.2: the input part_ready was not on within 0.5 s; stopped at th1 = ")
    assert run(["verify", out]) == 3


@pytest.mark.parametrize(
    "change",
    [
        "part_ready",
        "part_ready=on",
        "part_ready=1@2",
        "=on@2",
        "part_ready=on@-1",
        "part_ready=on@x",
        "part=on@1",
    ],
)
def test_wrong_inputs_are_refused(waiting: str, capsys: pytest.CaptureFixture[str], change: str) -> None:
    refusal(capsys, "run", "teaching-scara", waiting, "--input", change)


def test_saved_positions_are_found_beside_the_program(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    saved = tmp_path / "saved.toml"
    saved.write_text('robot = "teaching-scara"\n[positions]\ntray = { th1 = 20.0 }\n')
    program = tmp_path / "program.toml"
    head = 'robot = "teaching-scara"\npositions_file = "saved.toml"\n'
    program.write_text(f'{head}[[step]]\ngo = "tray"\n')
    assert run_json(capsys, "run", "teaching-scara", str(program))["joints"]["end"][0] == pytest.approx(20.0, abs=0.02)
    program.write_text(f'{head}[positions]\ntray = {{ th1 = 3.0 }}\n[[step]]\ngo = "tray"\n')
    refusal(capsys, "run", "teaching-scara", str(program))
    saved.write_text('robot = "lab-scara"\n[positions]\nshelf = { th1 = 20.0 }\n')
    refusal(capsys, "run", "teaching-scara", str(program))
    saved.unlink()
    refusal(capsys, "run", "teaching-scara", str(program))
