"""Homing a robot by its switches, and declaring where it stands."""

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.operate.homing import declare
from steptwin.host.operate.moving import move
from steptwin.host.operate.session import Session
from steptwin.host.twin.embedded_board import EmbeddedBoard
from tests.host.operate.sessions import HOME, ROBOT, CommandLine

HOME_TEXT = " ".join(map(str, HOME))


def test_homing_ends_at_home(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    document = steptwin.json("home warehouse-scara --together")
    assert all(axis["position_known"] for axis in document["axes"])
    assert [axis["position"] for axis in document["axes"]] == pytest.approx(HOME, abs=0.05)
    counted = [steps / spu for steps, spu in zip(board.driver_positions(), ROBOT.steps_per_unit, strict=True)]
    assert counted == pytest.approx(HOME, abs=0.05)
    move(Session(board, ROBOT), HOME)


def test_the_machine_may_stay_at_its_switches(steptwin: CommandLine) -> None:
    document = steptwin.json("home warehouse-scara --together --stay")
    assert all(axis["position_known"] for axis in document["axes"])
    assert [axis["position"] for axis in document["axes"]] != pytest.approx(HOME, abs=0.05)


def test_declaring_the_position(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    before = board.driver_positions()
    document = steptwin.json(f"home warehouse-scara --here '{HOME_TEXT}'")
    assert all(axis["position_known"] for axis in document["axes"])
    assert board.driver_positions() == before
    assert steptwin.run("home warehouse-scara --here '1 2' ")[0] == 2
    assert steptwin.run(f"home warehouse-scara --here '{HOME_TEXT}' --stay")[0] == 2
    with pytest.raises(InputError, match=r"^sx: .* is outside "):
        declare(Session(board, ROBOT), [-5000.0, *HOME[1:]])
