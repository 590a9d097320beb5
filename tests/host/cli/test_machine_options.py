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

KEYS = {
    field.metadata[SPELLING].key
    for made in (MachineOptions, *(options() for _, options in giving("machine_options")))
    for field in fields(made)
    if SPELLING in field.metadata
}


@pytest.mark.parametrize(
    ("command", "without"),
    [
        ("run", {"firmware", "image", "node", "motors"}),
        ("serve", set()),
        ("replay", {"faults", "motors", "firmware", "image", "node"}),
    ],
)
def test_help_lists_the_keys(command: str, without: set[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run([command, "--help"]) == 0
    told = re.sub(r"[│\s]+", " ", capsys.readouterr().out)
    listed = told.partition("(docs/robot-files.md): ")[2].partition(". ")[0]
    assert {each.partition("=")[0] for each in re.split(r", (?=[a-z])", listed)} == KEYS - without


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ("-m stand_at=0", "--machine 'stand_at' is unknown: did you mean stand-at?"),
        ("-m faults", "--machine faults: needs a value: faults=FILE"),
        ("-m motors=1", "--machine motors=1: takes no value"),
        ("-m boards=4,2 -m boards=3,3", "--machine boards=3,3: boards is given twice"),
        ("-m bitrate=", "--machine bitrate=: is not a whole number of bit/s"),
    ],
)
def test_a_key_that_is_wrong(options: str, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["serve", "lab-scara", *options.split()]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"steptwin: {line}"


@pytest.mark.slow
def test_a_run_on_two_boards(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["run", "teaching-scara", "carry", "--machine", "boards=3,1", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["boards"], document["passed"]) == ([3, 1], True)
    assert run(["run", "teaching-scara", "carry", "-m", "boards=3,1", "-m", "crystal=100,-100", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["crystal_ppm"] == [100, -100]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("run teaching-scara carry -m boards=9", "--machine boards=9: a board drives 1 to 8 axes, not 9; try 4"),
        (
            "run teaching-scara carry -m boards=3;1",
            "--machine boards=3;1: does not list the axes of each board, as in 4,2",
        ),
        ("run teaching-scara carry -m crystal=1,2", "--machine crystal=1,2: has 2 numbers, but the boards are 1"),
        ("run teaching-scara carry -m boards=4 --connect h", "--machine boards: is for a run in virtual time"),
        ("run teaching-scara carry -m 'stand-at=0 0 x 0'", "--machine stand-at=0 0 x 0: 'x' is not a number"),
        ("serve lab-scara -m bitrate=many", "--machine bitrate=many: is not a whole number of bit/s"),
        ("serve lab-scara -m bitrate=7", "--machine bitrate=7: is not one of 125000, "),
        ("serve lab-scara -m node=64", "--machine node=64: does not name an EDS, as in 0x40=device.eds"),
        ("serve lab-scara -m node=x=io.eds", "--machine node=x=io.eds: 'x' is no node id, as in 0x40=device.eds"),
        ("serve lab-scara -m node=0x13=io.eds", "--machine node=0x13=io.eds: 0x10 to 0x13 are the axes' ids; try 0x14"),
        ("serve lab-scara -m node=0x80=io.eds", "--machine node=0x80=io.eds: a node id is from 1 to 127, such as 0x14"),
        ("serve lab-scara -m node=0=io.eds", "--machine node=0x00=io.eds: a node id is from 1 to 127"),
        ("serve lab-scara -m node=0x7f=io.eds", "--machine node=0x7F=io.eds: 0x7F is the id of the host's heartbeat"),
        ("serve lab-scara -m node=0x40=no.eds", "--machine node=0x40=no.eds: No such file or directory"),
        ("serve lab-scara -m node=0x40=pyproject.toml", "--machine node=0x40=pyproject.toml: "),
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
