"""Machines without a tool: their joints move, nothing is computed of a tool, and each command says so."""

from pathlib import Path

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import read_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_places_mm
from steptwin.host.robots.new_file import robot_text, with_settings
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace import has_sections, monte_carlo
from tests.host.complaints import complaint_of
from tests.messages import refusing

NONE = "table has no tool: its joints have positions, but no pose"


def table_text(name: str = "table") -> str:
    return robot_text(name, "axes", *with_settings("axes", {}))


def table() -> Robot:
    return read_robot(table_text())


def test_there_are_no_poses() -> None:
    kinematics = make_kinematics(table())
    joints = np.array([[10.0], [20.0]])
    assert kinematics.task.name == "none"
    assert kinematics.forward(joints).shape == (2, 0)
    assert kinematics.branches == ()
    for call in (
        lambda: kinematics.inverse(np.empty((1, 0))),
        lambda: kinematics.solve(np.empty((1, 0)), "any"),
        lambda: kinematics.along(np.empty((1, 0)), "any", joints[0]),
        lambda: kinematics.at(np.empty((1, 0)), "any", joints[0], joints),
        lambda: kinematics.joint_velocities(joints, np.empty((2, 0))),
    ):
        complaint_of(call)
    complaint_of(lambda: monte_carlo(table(), 10, 1))
    assert not has_sections(table())
    assert tool_places_mm(kinematics, joints).tolist() == [[0.0, 0.0, 0.0]] * 2


def test_programs_move_the_joints_alone() -> None:
    findings = Findings()
    text = (
        "[[step]]\ngo = { table = 90 }\n[[step]]\nby = { table = -30 }\n[[step]]\ncircle = { x = 1, y = 2 }\n"
        "speed_mm_s = 5\n[[step]]\nline = { z = 3 }\nspeed_mm_s = 5\n"
    )
    compiled = compile_program(parse_program(text, findings), table(), findings)
    assert findings.messages == [
        "step 4 (line to z 3): z: this machine has no tool; its joints have positions",
        "step 3 (circle of 360 deg around x 1, y 2): table has no tool to lead: `go` and `by` move its joints",
    ]
    assert [row.text for row in compiled.steps] == ["go to table 90", "by table -30"]


def test_a_line_to_a_position_of_joints_is_refused_too() -> None:
    findings = Findings()
    compile_program(parse_program("[[step]]\nline = { table = 3 }\nspeed_mm_s = 5\n", findings), table(), findings)
    assert findings.messages == ["step 1 (line to table 3): table has no tool to lead: `go` and `by` move its joints"]


@pytest.mark.parametrize("command", [["fk", "{}", "10"], ["ik", "{}", "--x", "1", "--y", "2", "--z", "3"]])
def test_commands_about_the_tool(command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "table.toml"
    file.write_text(table_text(), encoding="utf-8")
    assert run([word.format(file) for word in command]) == 2
    assert capsys.readouterr().err.strip() == f"steptwin: {NONE}"


def test_a_run_has_a_verdict_without_errors_of_a_tool(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from tests.end_to_end.command_line import run_json

    file, motion = tmp_path / "table.toml", tmp_path / "turn.csv"
    file.write_text(table_text(), encoding="utf-8")
    motion.write_text("t,table\n0,0\n1,30\n", encoding="utf-8")
    document = run_json(capsys, "run", str(file), str(motion), "--out", str(tmp_path / "out"))
    assert (document["passed"], document["tool"]) == (True, None)
    header = (tmp_path / "out" / "trajectory.csv").read_text(encoding="utf-8").partition("\n")[0]
    assert header == "t,table,v_table,a_table"
    pictures = {path.stem for path in (tmp_path / "out").glob("*.png")}
    assert pictures in ({"overview", "error"}, set())


def test_names_of_the_tools_coordinates_are_taken() -> None:
    with refusing(InputError):
        read_robot(table_text().replace("joints.table", "joints.z").replace("\ntable = ", "\nz = "))
