"""The options of the emulated machine on the command line and in Python: written once, the same everywhere."""

import json
import re
from dataclasses import fields

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.common.features import giving
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.host.twin.machine.machine_options import AS_FILED, SPELLING, MachineOptions

OPTIONS = {
    field.metadata[SPELLING].option
    for made in (MachineOptions, *(options() for _, options in giving("machine_options")))
    for field in fields(made)
    if SPELLING in field.metadata
}


def boxes(capsys: pytest.CaptureFixture[str], command: str) -> dict[str, set[str]]:
    """Return the options in each box of a command's help."""
    assert run([command, "--help"]) == 0
    found: dict[str, set[str]] = {}
    for line in capsys.readouterr().out.splitlines():
        if title := re.match(r"╭─ (.*?) ─", line):
            options = found[title[1]] = set()
        elif option := re.match(r"│ (--[\w-]+)", line):
            options.add(option[1])
    return found


@pytest.mark.parametrize(
    ("command", "without"),
    [
        ("run", {"--bitrate", "--firmware", "--node"}),
        ("serve", set()),
        ("replay", {"--faults", "--motors", "--firmware", "--node"}),
    ],
)
def test_commands_show_them_in_a_box(command: str, without: set[str], capsys: pytest.CaptureFixture[str]) -> None:
    """The --bitrate of `run` is that of a live board."""
    found = boxes(capsys, command)
    assert found["Emulated machine"] == OPTIONS - without
    assert ("--connect" in found.get("Live board", ())) == (command == "run")


@pytest.mark.slow
def test_a_run_on_two_boards(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["run", "teaching-scara", "carry", "--boards", "3,1", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["boards"], document["passed"]) == ([3, 1], True)
    assert run(["run", "teaching-scara", "carry", "--boards", "3,1", "--crystal", "100,-100", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["crystal_ppm"] == [100, -100]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("run teaching-scara carry --boards 9", "--boards 9: a board drives 1 to 8 axes, not 9; try 4"),
        ("run teaching-scara carry --boards 3;1", "--boards 3;1: does not list the axes of each board, as in 4,2"),
        ("run teaching-scara carry --crystal 1,2", "--crystal 1,2: has 2 numbers, but the boards are 1"),
        ("run teaching-scara carry --boards 4 --connect h", "--boards: is for a run in virtual time"),
        ("run teaching-scara carry --stand-at '0 0 x 0'", "--stand-at 0 0 x 0: 'x' is not a number"),
        ("serve lab-scara --bitrate many", "--bitrate many: is not a whole number of bit/s"),
        ("serve lab-scara --bitrate 7", "--bitrate 7: is not one of 125000, "),
        ("serve lab-scara --node 64", "--node 64: does not name an EDS, as in 0x40=device.eds"),
        ("serve lab-scara --node x=io.eds", "--node x=io.eds: 'x' is no node id, as in 0x40=device.eds"),
        ("serve lab-scara --node 0x13=io.eds", "--node 0x13=io.eds: 0x10 to 0x13 are the axes' ids; try 0x14"),
        ("serve lab-scara --node 0x80=io.eds", "--node 0x80=io.eds: a node id is from 1 to 127, such as 0x14"),
        ("serve lab-scara --node 0=io.eds", "--node 0x00=io.eds: a node id is from 1 to 127"),
        ("serve lab-scara --node 0x7f=io.eds", "--node 0x7F=io.eds: 0x7F is the id of the host's heartbeat"),
        ("serve lab-scara --node 0x40=no.eds", "--node 0x40=no.eds: No such file or directory"),
        ("serve lab-scara --node 0x40=pyproject.toml", "--node 0x40=pyproject.toml: "),
    ],
)
def test_what_is_wrong_is_told_by_the_options_name(words: str, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([word.strip("'") for word in re.findall(r"'[^']*'|\S+", words)]) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"steptwin: {line}")


def test_a_board_of_a_test_takes_all_of_them(fast_kernel: Kernel) -> None:
    robot = load_robot("lab-scara")
    board = BoardUnderTest(robot, kernel=fast_kernel, stand_at={"th2": 5.0}, axes_per_board=[2, 2], bitrate=500_000)
    assert board.bus_report().bitrate == 500_000
    assert board.joints()["th2"] == pytest.approx(5.0, abs=0.01)


def test_given_options_go_over_others() -> None:
    other = MachineOptions(axes_per_board=(4, 2), bitrate=500_000, dip_microsteps={"th1": 8})
    assert AS_FILED.over(other) == other
    assert MachineOptions(bitrate=125_000).over(other) == MachineOptions(
        axes_per_board=(4, 2), bitrate=125_000, dip_microsteps={"th1": 8}
    )
