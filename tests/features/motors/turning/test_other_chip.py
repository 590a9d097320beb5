"""Motors turn at drivers with a chip of another kind, too."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.motors.options import MotorOptions
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.execution import execute
from steptwin.protocol.drivers import PROFILES
from tests.emulator.drivers.edge_counter import SUBSTEPS
from tests.emulator.drivers.test_chip_border import COUNTERS, tenths, there


def test_motors_turn_with_it(fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PROFILES, COUNTERS.name, COUNTERS)
    robot, boards = tenths(COUNTERS.name), list[EmbeddedBoard]()
    execute(there(robot), "there", fast_kernel, extras=[MotorOptions(motors=True)], on_board=boards.append)
    rotors, held = boards[0].rotor_positions(), boards[0].held_positions()
    for name, rotor, place in zip(robot.joint_names, rotors, held, strict=True):
        assert rotor == pytest.approx(place, abs=2 * SUBSTEPS), name
    assert boards[0].rotor_slips() == [0.0] * len(robot.joints)
