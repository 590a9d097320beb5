"""Nothing but its profile knows what chip a driver has: a chip of another kind runs jobs on the same board."""

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.drivers.driver_module import Module
from steptwin.emulator.faults.drivers import OscCapacitor
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.execution import execute
from steptwin.protocol.drivers import PROFILES, Coupler, DriverProfile, Fact, InputLevels
from tests.emulator.drivers.edge_counter import EDGE_COUNTER, MADE, SUBSTEPS
from tests.emulator.pins import WIRES

COUNTER = Module(EDGE_COUNTER)
SLOW = Fact(Coupler(10_000, 10_000), MADE)
ROBOT = load_robot("lab-scara")


@pytest.fixture
def counters(monkeypatch: pytest.MonkeyPatch) -> str:
    """Name of a profile with these chips, behind slow couplers."""
    profile = DriverProfile(
        name="counter",
        title="counts edges",
        chip=EDGE_COUNTER,
        clk=SLOW,
        direction=SLOW,
        switched=False,
        inputs=Fact(InputLevels(2.0), MADE),
    )
    monkeypatch.setitem(PROFILES, "counter", profile)
    return "counter"


def test_it_runs_a_job_with_the_same_edges_and_counts_each(fast_kernel: Kernel, counters: str) -> None:
    planned, boards = plan(ROBOT, make_job(ROBOT, "spiral", {})), list[EmbeddedBoard]()
    starts_steps: list[float] = []

    def look(board: EmbeddedBoard) -> None:
        boards.append(board)
        starts_steps.extend(board.motor_positions())

    usual = execute(planned, "spiral", fast_kernel).comparison.evidence
    outcome = execute(planned, "spiral", fast_kernel, driver_profile=counters, on_board=look)
    assert outcome.report.passed is False, "the drivers make steps of another size than the robot's file says"
    for axis, other in zip(outcome.comparison.evidence.axes, usual.axes, strict=True):
        for name in ("clk_rise_counts", "clk_fall_counts", "dir_edge_counts", "step_counts", "step_signs"):
            np.testing.assert_array_equal(getattr(axis, name), getattr(other, name))
        assert axis.violations.counts.size == 0
    assert [each.driver for each in boards[0].microsteps()] == [SUBSTEPS] * len(ROBOT.joints)
    for joint, start, end, axis in zip(
        ROBOT.joints, starts_steps, boards[0].motor_positions(), usual.axes, strict=True
    ):
        full_steps = int(axis.step_signs.sum(dtype=np.int64)) / SUBSTEPS
        assert end - start == pytest.approx(full_steps * joint.transmission.microsteps)


def test_motors_turn_with_it(fast_kernel: Kernel, counters: str) -> None:
    """The way is 16/10 of what was planned, in the same time: the third motor falls out of step, the others do not."""
    boards = list[EmbeddedBoard]()
    planned = plan(ROBOT, make_job(ROBOT, "spiral", {}))
    execute(planned, "spiral", fast_kernel, driver_profile=counters, motors=True, on_board=boards.append)
    rotors, held = boards[0].rotor_positions(), boards[0].held_positions()
    for joint, rotor, place in zip(ROBOT.joints, rotors, held, strict=True):
        assert rotor == pytest.approx(place, abs=2 * joint.transmission.microsteps), joint.name
    assert [slip == 0.0 for slip in boards[0].rotor_slips()] == [True, True, False, True]


def test_it_has_no_capacitor_at_osc(fast_kernel: Kernel) -> None:
    board = Board(BoardConfig((COUNTER,)), fast_kernel)
    with pytest.raises(ValueError, match="a edge counter has no capacitor at OSC"):
        board.operate(OscCapacitor(0, 330), 0)


def test_drivers_of_a_board_divide_a_full_step_alike() -> None:
    with pytest.raises(ValueError, match="the drivers of a board do not divide a full step alike"):
        BoardConfig((COUNTER, WIRES))
