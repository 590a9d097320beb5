"""Streaming on the embedded board: refused records, long and short segments, and the frames sent for them."""

from dataclasses import replace
from math import floor

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client import Machine, StreamedMotion
from steptwin.host.common.arrays import AxisRecords, FloatArray
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import JointFunctions, Motion
from steptwin.host.planning.planner import plan
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import DISABLE_VOLTAGE
from tests.host.client.machines import AXES, ROBOT, START, TH1, connected, frames_to, ready, still, travelling
from tests.messages import refusing


def run(machine: Machine, records: tuple[AxisRecords, ...]) -> None:
    machine.run(StreamedMotion(records, [0] * AXES), lambda _: None)


@pytest.mark.parametrize("refused", [5, 100], ids=["before the start", "on the way"])
def test_a_refused_record_ends_the_run_with_its_number(board: EmbeddedBoard, refused: int) -> None:
    """A record of 200 000 units in 10 ms means 19.5 kHz of steps, which the board refuses."""
    records = list(still(200, 10))
    displacements = [0] * 200
    displacements[refused] = 200_000
    records[TH1] = records[TH1]._replace(displacements_units=displacements)
    machine = ready(board)
    with refusing(DeviceFaultError):
        run(machine, tuple(records))
    assert machine.axes[TH1].error_codes == [0xFF03]


@pytest.mark.slow
def test_records_that_wait_for_a_place_in_a_full_queue_are_sent_once(board: EmbeddedBoard) -> None:
    """Segments of 255 ms free a place four times a second; the client must not take the wait for a loss."""
    run(ready(board), still(100, 255))
    assert [len(frames_to(board, 0x510 + axis)) for axis in range(AXES)] == [100] * AXES


@pytest.mark.slow
@pytest.mark.parametrize("point_ms", [1, 2, 3])
def test_short_segments_do_not_starve(fast_kernel: Kernel, point_ms: int) -> None:
    """A queue of 64 records of 1 ms lasts 64 ms, so the board must report free places more often."""
    planned = plan(ROBOT, make_job(ROBOT, "pull-line", {"duration_s": "2", "ramp_s": "0.5"}), point_ms)
    outcome = execute(planned, "pull-line", fast_kernel)
    assert outcome.fault is None
    assert outcome.report.passed, outcome.report.reasons


@pytest.mark.slow
def test_status_reports_follow_the_shortest_segment(board: EmbeddedBoard) -> None:
    """Short segments shorten the nodes' event timer, longer ones restore it, and long ones leave it alone."""
    machine = ready(board)
    write_timer = bytes.fromhex("2b021805")
    run(machine, still(40, 10))
    assert frames_to(board, 0x610, write_timer) == []
    for duration_ms, timer_ms in ((1, 20), (3, 60), (5, 100), (255, 100)):
        machine.preset([0] * AXES)
        run(machine, still(20, duration_ms))
        assert [axis.read(od.address_of(od.TPDO_COMMUNICATION[2], od.PDO_EVENT_TIMER)) for axis in machine.axes] == [
            timer_ms
        ] * AXES
    assert len(frames_to(board, 0x610, write_timer)) == 3


@pytest.mark.parametrize("off_units", [-0.6, -0.4, 0.0, 0.4])
@pytest.mark.parametrize("half_step", [400.5, -400.5])
def test_the_machine_stands_where_the_firmware_puts_it(fast_kernel: Kernel, off_units: float, half_step: float) -> None:
    """The firmware rounds to wire units, then to steps: 0.4 units below half a step count as half a step."""
    sx = ROBOT.joints[0].transmission
    units_per_step = 16_384 // sx.microsteps
    units = half_step * units_per_step + off_units
    board = EmbeddedBoard(ROBOT, fast_kernel, MachineOptions(stand_at=[units / sx.wire_units_per_unit, *START[1:]]))
    machine = ready(board)
    machine.preset([floor(units + 0.5), *[0] * (AXES - 1)])
    assert machine.positions_units()[0] == board.driver_positions()[0] * units_per_step


def at_full_speed(step_rate_hz: float) -> Motion:
    """Return a motion of sx at its driver's highest step rate, between two ramps of constant acceleration."""
    speed = step_rate_hz / ROBOT.joints[0].transmission.steps_per_unit

    def positions(t_s: FloatArray) -> FloatArray:
        ramps = (np.minimum(t_s, 0.2) ** 2 - np.maximum(t_s - 0.8, 0) ** 2) / 0.4
        return np.outer(speed * (ramps + np.maximum(t_s - 0.2, 0)), np.eye(AXES)[0]) + START

    def velocities(t_s: FloatArray) -> FloatArray:
        return np.outer(speed * np.clip(np.minimum(t_s, 1 - t_s) / 0.2, 0, 1), np.eye(AXES)[0])

    return Motion(ROBOT.joint_names, 1.0, JointFunctions(positions, velocities), (0.2, 0.8))


def without_reserve() -> Robot:
    """Return a robot whose CLK is a hair too slow for 15 kHz: 33 000 ns are 2376 counts, 33 667 ns are 2425."""
    board = replace(ROBOT.board, stepspace_ns=33_667, step_rate_max_hz=14_999)
    fast = replace(ROBOT.joints[0], speed_max=1e3, acceleration_max=1e4)
    return replace(ROBOT, board=board, joints=(fast, *ROBOT.joints[1:]))


def test_the_planner_refuses_what_the_firmware_would(fast_kernel: Kernel) -> None:
    """The limit is 72 MHz / 4801 counts = 14 996.9 Hz; the planner and the board draw it alike."""
    robot = without_reserve()
    assert robot.board.driver_rate_max_hz == 72e6 / 4801
    assert ROBOT.board.driver_rate_max_hz == 15_000
    with refusing(InputError):
        plan(robot, at_full_speed(14_998.0))
    outcome = execute(plan(robot, at_full_speed(14_996.0)), "full speed", fast_kernel)
    assert outcome.fault is None


def set_heartbeats(machine: Machine, period_ms: int) -> None:
    for axis in machine.axes:
        axis.write(od.PRODUCER_HEARTBEAT_TIME, period_ms)


@pytest.mark.slow
def test_a_bus_that_the_nodes_fill_is_a_bus_error(fast_kernel: Kernel) -> None:
    slow = replace(ROBOT, board=replace(ROBOT.board, bitrate=125_000))
    machine = connected(EmbeddedBoard(slow, fast_kernel, MachineOptions(stand_at=START)))
    with refusing(BusError) as caught:
        set_heartbeats(machine, period_ms=1)
    assert caught.value.exit_code == 4


def test_an_axis_that_was_cut_off_in_motion_must_be_homed_first(board: EmbeddedBoard) -> None:
    machine = ready(board)
    machine.start(StreamedMotion(travelling(20), [0] * AXES))
    machine.wait(0.1)
    machine.axes[TH1].write(od.CONTROLWORD, DISABLE_VOLTAGE)
    machine.axes[TH1].enable()
    with refusing(DeviceFaultError):
        machine.start(StreamedMotion(still(5, 20), [0] * AXES))
