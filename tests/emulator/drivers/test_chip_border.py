"""Nothing but its profile knows what chip a driver has: a chip of another kind runs jobs on the same board."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.drivers.driver_module import Module
from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Cubic
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.execution import execute
from steptwin.protocol.drivers import PROFILES, Coupler, DriverProfile, Fact, InputLevels
from tests.emulator.drivers.edge_counter import EDGE_COUNTER, MADE, SUBSTEPS
from tests.emulator.pins import WIRES
from tests.messages import refusing
from tests.operations import OscCapacitor

COUNTER = Module(EDGE_COUNTER)
SLOW = Fact(Coupler(10_000, 10_000), MADE)
ROBOT = load_robot("lab-scara")


COUNTERS = DriverProfile(
    name="counter",
    title="counts edges",
    chip=EDGE_COUNTER,
    clk=SLOW,
    direction=SLOW,
    switched=False,
    inputs=Fact(InputLevels(2.0), MADE),
)


@pytest.fixture
def counters(monkeypatch: pytest.MonkeyPatch) -> str:
    """Name of a profile with these chips, behind slow couplers."""
    monkeypatch.setitem(PROFILES, COUNTERS.name, COUNTERS)
    return COUNTERS.name


def tenths(drivers: str | None) -> Robot:
    """Return the laboratory arm with 10 microsteps at all joints."""
    joints = (replace(each, transmission=replace(each.transmission, microsteps=SUBSTEPS)) for each in ROBOT.joints)
    board = replace(ROBOT.board, osc_pf=None, driver_profile=drivers, current_a=None)
    return replace(ROBOT, joints=tuple(joints), board=board)


def there(robot: Robot) -> Plan:
    """Return a motion of all joints at once, of 0.6 s."""
    goal = tuple(home + way for home, way in zip(robot.home, (8.0, -6.0, 4.0, 12.0), strict=True))
    return plan(robot, joint_move(robot.joint_names, robot.home, goal, Cubic(1.0, 0.6)))


def test_it_runs_a_job_and_counts_each_edge(fast_kernel: Kernel, counters: str) -> None:
    """Ten steps a full step, neither a power of two nor of the wire's units: the verdict is as exact as ever."""
    robot, boards, starts_steps = tenths(counters), list[EmbeddedBoard](), list[float]()

    def look(board: EmbeddedBoard) -> None:
        boards.append(board)
        starts_steps.extend(board.motor_positions())

    outcome = execute(there(robot), "there", fast_kernel, on_board=look)
    assert outcome.report.passed, outcome.report.reasons
    assert [each.driver for each in boards[0].microsteps()] == [SUBSTEPS] * len(ROBOT.joints)
    ends_steps = boards[0].motor_positions()
    for start, end, axis in zip(starts_steps, ends_steps, outcome.comparison.evidence.axes, strict=True):
        np.testing.assert_array_equal(axis.step_counts, axis.clk_rise_counts)
        assert end - start == int(axis.step_signs.sum(dtype=np.int64))
        assert axis.violations.counts.size == 0
        assert axis.phases.per_full_step == SUBSTEPS


def test_a_robot_with_other_microsteps_is_refused(fast_kernel: Kernel, counters: str) -> None:
    with refusing(InputError):
        execute(there(ROBOT), "there", fast_kernel, driver_profile=counters)


def test_it_has_no_capacitor_at_osc(fast_kernel: Kernel) -> None:
    board = Board(BoardConfig((COUNTER,)), fast_kernel)
    with refusing(ValueError):
        board.operate(OscCapacitor(0, 330), 0)


def test_drivers_of_a_board_divide_a_full_step_alike() -> None:
    with refusing(ValueError):
        BoardConfig((COUNTER, WIRES))
