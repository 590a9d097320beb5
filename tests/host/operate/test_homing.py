"""Homing a robot by its switches, and declaring where it stands."""

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.operate.homing import declare, home_robot
from steptwin.host.operate.moving import move
from steptwin.host.operate.session import Session
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from tests.host.client.machines import TH1
from tests.host.operate.sessions import HOME, ROBOT, CommandLine
from tests.messages import refusing

HOME_TEXT = " ".join(map(str, HOME))


@pytest.mark.slow
def test_homing_ends_at_home(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    document = steptwin.json("home warehouse-scara --together")
    assert all(axis["position_known"] for axis in document["axes"])
    assert [axis["position"] for axis in document["axes"]] == pytest.approx(HOME, abs=0.05)
    counted = [steps / spu for steps, spu in zip(board.driver_positions(), ROBOT.steps_per_unit, strict=True)]
    assert counted == pytest.approx(HOME, abs=0.05)
    move(Session(board, ROBOT), HOME)


@pytest.mark.slow
def test_the_machine_may_stay_at_its_switches(steptwin: CommandLine) -> None:
    document = steptwin.json("home warehouse-scara --together --stay")
    assert all(axis["position_known"] for axis in document["axes"])
    assert [axis["position"] for axis in document["axes"]] != pytest.approx(HOME, abs=0.05)


@pytest.mark.slow
def test_one_joint_is_homed_and_the_others_stay(session: Session, board: EmbeddedBoard) -> None:
    move(session, [position + 5.0 for position in HOME])
    before = board.driver_positions()
    states = home_robot(session, joints=["th1"])
    after = board.driver_positions()
    assert [i for i in range(6) if after[i] != before[i]] == [TH1]
    assert [state.position_known for state in states] == [True] * 6
    assert after[TH1] / ROBOT.steps_per_unit[TH1] == pytest.approx(HOME[TH1], abs=0.05)
    for names in (["th9"], list[str]()):
        with refusing(InputError):
            home_robot(session, joints=names)


def test_declaring_the_position(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    before = board.driver_positions()
    document = steptwin.json(f"home warehouse-scara --here '{HOME_TEXT}'")
    assert all(axis["position_known"] for axis in document["axes"])
    assert board.driver_positions() == before
    assert steptwin.run("home warehouse-scara --here '1 2' ")[0] == 2
    assert steptwin.run(f"home warehouse-scara --here '{HOME_TEXT}' --stay")[0] == 2
    with refusing(InputError):
        declare(Session(board, ROBOT), [-5000.0, *HOME[1:]])
