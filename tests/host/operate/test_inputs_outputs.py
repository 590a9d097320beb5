"""Digital outputs of a live board by their names in the robot's file."""

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.operate.inputs_outputs import switch_output
from steptwin.host.operate.session import Session
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalOutput
from tests.host.client.machines import TH3
from tests.host.operate.sessions import ROBOT, CommandLine
from tests.messages import refusing


def test_outputs_by_name(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    assert steptwin.json("outputs warehouse-scara")["outputs"] == {"magnet": False, "lock": False}
    assert steptwin.json("outputs warehouse-scara lock on")["outputs"] == {"magnet": False, "lock": True}
    axis = Session(board, ROBOT).machine.axes[TH3]
    assert axis.read(od.DIGITAL_OUTPUTS) == DigitalOutput.OUT2
    exit_code, out, _ = steptwin.run("outputs warehouse-scara")
    assert (exit_code, out.split()[-8:]) == (0, ["magnet", "th3", "OUT1", "off", "lock", "th3", "OUT2", "on"])
    assert steptwin.json("outputs warehouse-scara lock off")["outputs"] == {"magnet": False, "lock": False}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("magnets on", "output of warehouse-scara 'magnets' is unknown: did you mean magnet?"),
        ("magnet", "after the robot: nothing, or NAME and on or off, not magnet"),
        ("magnet 1", "after the robot: nothing, or NAME and on or off, not magnet 1"),
    ],
)
def test_outputs_that_do_not_exist(steptwin: CommandLine, words: str, message: str) -> None:
    assert steptwin.run(f"outputs warehouse-scara {words}") == (2, "", f"steptwin: {message}\n")


def test_an_unknown_output_is_not_switched(board: EmbeddedBoard) -> None:
    with refusing(InputError):
        switch_output(Session(board, ROBOT), "gripper", on=True)
