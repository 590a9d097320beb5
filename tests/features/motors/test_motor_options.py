"""Motors that turn with a board: with what options of a machine they do not go."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.motors.options import MotorOptions
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.host.twin.machine.machine_options import MachineOptions, merged
from tests.messages import refusing

TURNING = MotorOptions(motors=True)


def test_crystals_must_be_exact(fast_kernel: Kernel) -> None:
    for crystals in ((), (0, 0)):
        MachineOptions(crystal_ppm=crystals, extras=[TURNING]).check_features()
    MachineOptions(crystal_ppm=1, extras=[MotorOptions()]).check_features()
    with refusing(InputError):
        BoardUnderTest(load_robot("lab-scara"), kernel=fast_kernel, crystal_ppm=1, extras=[TURNING])


def test_options_that_are_given_go_over_others() -> None:
    assert merged([MotorOptions()], [TURNING]) == merged([TURNING], [MotorOptions()]) == (TURNING,)


@pytest.mark.parametrize("extras", [[], [MotorOptions()]])
def test_without_them_rotors_are_where_the_drivers_put_them(extras: list[MotorOptions], fast_kernel: Kernel) -> None:
    board = BoardUnderTest(load_robot("lab-scara"), kernel=fast_kernel, extras=extras)
    assert not board.motors_turn
    assert board.settled(board.evidence()) == {}
