"""A board knows its robot: commands for another one are refused with both names, unless forced."""

import json
import runpy
from pathlib import Path

import pytest

from steptwin.host.cli.app import command_named
from steptwin.host.cli.commands import command_table
from steptwin.host.operate.session import Session
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from tests.end_to_end.pages import blocks_of, read_page
from tests.host.operate.sessions import ROBOT, CommandLine

FOREIGN = "d1: node 0x10 belongs to the robot warehouse-scara, not to lab-scara"
STOPS = ("stop", "estop")
WITHOUT_FORCE = ("serve", "inject", "doctor", "conform", "monitor", "shadow", *STOPS)


@pytest.mark.parametrize(
    "command",
    [
        "status lab-scara",
        "home lab-scara",
        "home lab-scara --here '150 0 90 0'",
        "move lab-scara th2=5",
        "jog lab-scara d1 5 --seconds 1",
        "run lab-scara spiral --approach",
        "pause lab-scara",
        "resume lab-scara",
        "speed lab-scara 50",
        "reset lab-scara",
        "outputs lab-scara",
        "ros2-bridge lab-scara",
    ],
)
@pytest.mark.usefixtures("session")
def test_another_robots_command_is_refused(steptwin: CommandLine, command: str) -> None:
    assert steptwin.run(command) == (2, "", f"steptwin: {FOREIGN}; --force goes on all the same\n")


def test_every_live_command_can_be_forced() -> None:
    table = command_table()
    forced = {name for name in table if any("--force" in option.opts for option in command_named(name).params)}
    live = {name for name, row in table.items() if row.group == "Live board"}
    assert len(live) == 20
    assert forced == live - {*WITHOUT_FORCE} | {"run"}


@pytest.mark.usefixtures("session")
def test_it_can_be_forced(steptwin: CommandLine) -> None:
    document = steptwin.json("status lab-scara --force")
    assert [axis["name"] for axis in document["axes"]] == ["d1", "th2", "th3", "th4"]
    assert steptwin.json("reset lab-scara --force")["robot"] == "lab-scara"


@pytest.mark.parametrize("command", STOPS)
def test_a_stop_is_never_refused(steptwin: CommandLine, session: Session, command: str) -> None:
    """But it says that the board has other axes, here two, which still hold the machine."""
    exit_code, out, err = steptwin.run(f"{command} lab-scara")
    assert exit_code == 2
    assert err == f"steptwin: {FOREIGN}; lab-scara's axes were stopped, but the board may have others that move\n"
    assert "d1" in out
    assert "position" not in out
    exit_code, out, _ = steptwin.run(f"{command} lab-scara --json")
    assert exit_code == 2
    assert [axis["position"] for axis in json.loads(out)["axes"]] == [None] * 4
    states = [axis.state().name for axis in session.machine.axes]
    stopped = {"stop": "QUICK_STOP_ACTIVE", "estop": "FAULT"}[command]
    assert states == [stopped] * 4 + ["OPERATION_ENABLED"] * 2


def test_doctor_names_both(steptwin: CommandLine, session: Session) -> None:
    exit_code, out, _ = steptwin.run("doctor lab-scara")
    assert exit_code == 3  # a setting differs as well
    assert "[FAIL] d1 robot: warehouse-scara, not lab-scara\n" in out
    exit_code, out, _ = steptwin.run("doctor warehouse-scara")
    assert exit_code == 0
    assert "[ OK ] sx robot: warehouse-scara\n" in out
    for axis in session.machine.axes:
        axis.write_text(od.ROBOT_NAME, "")
    exit_code, out, _ = steptwin.run("doctor warehouse-scara")
    assert exit_code == 0
    assert out.count(" robot: the axis carries no robot's name (docs/protocol.md)\n") == len(ROBOT.joints)


def test_a_board_without_a_name_may_be_any_robots(steptwin: CommandLine, session: Session) -> None:
    for axis in session.machine.axes:
        axis.write_text(od.ROBOT_NAME, "")
    assert steptwin.json("status lab-scara")["robot"] == "lab-scara"


def test_one_axis_of_another_robot_is_enough(steptwin: CommandLine, session: Session) -> None:
    session.machine.axes[3].write_text(od.ROBOT_NAME, "my arm")
    exit_code, _, err = steptwin.run("move warehouse-scara th1=1")
    assert exit_code == 2
    assert err.startswith("steptwin: th1: node 0x13 belongs to the robot my arm, not to warehouse-scara; ")


def test_a_board_is_commissioned_as_the_page_says(board: EmbeddedBoard, tmp_path: Path) -> None:
    (block,) = [text for _, text in blocks_of(read_page("docs/protocol.md")) if "0x2016" in text]
    page = tmp_path / "commissioning.py"
    page.write_text(block, encoding="ascii")
    runpy.run_path(str(page), {"network": board.network})
    session = Session(board, ROBOT)
    board.network.nmt.state = "RESET"
    names = [axis.read_text(od.ROBOT_NAME) for axis in session.machine.axes]
    assert names == ["lab-scara"] * 4 + [ROBOT.name] * 2
