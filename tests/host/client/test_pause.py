"""Pause and resume: by which program, without a trajectory, and how the trajectory ends."""

from collections.abc import Callable

import pytest

from steptwin.host.client import Machine, StreamedMotion
from steptwin.host.client.pausing import pause_trajectory, resume_trajectory
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.planning.motion import OutputChange
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, Control, DigitalOutput
from steptwin.protocol.frame import Frame
from tests.host.client.machines import (
    AXES,
    ROBOT,
    STEP,
    TH1,
    TH2,
    TH3,
    WIRING,
    Neighbour,
    frames_to,
    ready,
    sdo_requests,
    silence_heartbeat,
    still,
    travelling,
)
from tests.messages import refusing

RUN = ENABLE_OPERATION | Control.START
FAR = 100 * 80 * STEP
"""Distance in units of 101 records of `travelling`."""


def controlwords(board: EmbeddedBoard, axis: int) -> list[Frame]:
    return frames_to(board, 0x210 + axis)


@pytest.mark.slow
def test_it_rests_and_goes_on_to_its_end(board: EmbeddedBoard, machine: Machine) -> None:
    """From 4 kHz at 9766 steps/s^2 the ramp takes 0.41 s."""
    run = machine.start(StreamedMotion(travelling(101), [0] * AXES))
    machine.wait(0.5)
    assert not run.halted
    asked_s = board.now_s()
    assert pause_trajectory(machine)
    assert run.halted
    assert board.now_s() - asked_s == pytest.approx(0.42, abs=0.02)
    rest_units = machine.positions_units()
    machine.wait(10.0)
    assert machine.positions_units() == rest_units
    resume_trajectory(machine)
    assert not run.halted
    machine.wait(3.0)
    assert run.ended
    assert machine.positions_units() == [0, 0, 0, FAR, 0, 0]


def test_repeated_requests_change_nothing(machine: Machine) -> None:
    run = machine.start(StreamedMotion(travelling(101), [0] * AXES))
    resume_trajectory(machine)
    machine.wait(0.5)
    assert pause_trajectory(machine)
    rest_units = machine.positions_units()
    assert pause_trajectory(machine)
    assert machine.positions_units() == rest_units
    resume_trajectory(machine)
    resume_trajectory(machine)
    machine.wait(3.0)
    assert run.ended


def test_a_trajectory_that_ends_while_it_is_halted(board: EmbeddedBoard, machine: Machine) -> None:
    """Within 0.1 s of its end a trajectory cannot halt: it ends, and the halt request does not hold the next one."""
    run = machine.start(StreamedMotion(travelling(20), [0] * AXES))
    machine.wait(0.3)
    assert pause_trajectory(machine) is False
    machine.wait(0.05)
    assert run.ended
    assert machine.positions_units() == [0, 0, 0, 19 * 80 * STEP, 0, 0]
    assert [frame.data[:2] for frame in controlwords(board, TH1)] == [b"\x1f\x01", b"\x1f\x00"]
    machine.preset([0] * AXES)
    machine.run(StreamedMotion(travelling(20), [0] * AXES), lambda _: None)


@pytest.mark.parametrize("change", [pause_trajectory, resume_trajectory])
def test_without_a_trajectory_there_is_nothing_to_halt(
    board: EmbeddedBoard, change: Callable[[Machine], object]
) -> None:
    def nothing(machine: Machine) -> None:
        with refusing(InputError) as caught:
            change(machine)
        assert caught.value.exit_code == 2

    nothing(Machine(board, ROBOT.joint_names))
    machine = ready(board)
    nothing(machine)
    machine.run(StreamedMotion(still(20, 10), [0] * AXES), lambda _: None)
    nothing(machine)
    machine.disable()
    nothing(machine)
    assert [controlwords(board, axis) for axis in range(AXES)] == [[]] * AXES


@pytest.mark.slow
def test_another_host_may_do_it(board: EmbeddedBoard, machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other host sends no SDO request, and the host that streams waits for any length of time."""
    other = Machine(Neighbour(board, monkeypatch, machine.wait), ROBOT.joint_names)
    run = machine.start(StreamedMotion(travelling(101), [0] * AXES))
    machine.wait(1.0)
    begin = len(board.bus_log)
    assert pause_trajectory(other)
    assert run.halted
    machine.wait(10.0)
    assert not run.ended
    resume_trajectory(other)
    machine.wait(2.0)
    assert run.ended
    assert not sdo_requests(board, begin)
    with refusing(InputError):
        pause_trajectory(other)


def test_another_host_hears_of_a_fault(board: EmbeddedBoard, machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    """The host that streams dies while the axes slow down: the pause raises its fault instead of reporting an end."""
    other = Machine(Neighbour(board, monkeypatch), ROBOT.joint_names)
    machine.start(StreamedMotion(travelling(101), [0] * AXES))
    machine.wait(1.0)
    silence_heartbeat(monkeypatch)
    with refusing(DeviceFaultError):
        pause_trajectory(other)


@pytest.mark.slow
def test_the_halt_bit_of_one_axis_is_enough(machine: Machine) -> None:
    """One axis' halt bit halts the group, and `resume_trajectory` clears it."""
    run = machine.start(StreamedMotion(travelling(101), [0] * AXES))
    machine.axes[TH2].write(od.CONTROLWORD, RUN | Control.HALT)
    machine.wait(10.0)
    assert run.halted
    resume_trajectory(machine)
    machine.wait(3.0)
    assert run.ended


def test_records_that_do_not_go_on_without_a_halt_are_an_error(board: EmbeddedBoard, machine: Machine) -> None:
    """The axes halt, but their reports do not arrive."""
    machine.start(StreamedMotion(travelling(101), [0] * AXES))
    for axis in machine.axes:
        board.network.unsubscribe(0x180 + axis.node_id)
    machine.axes[TH2].write(od.CONTROLWORD, RUN | Control.HALT)
    machine.wait(4.9)
    with refusing(BusError):
        machine.wait(1.0)


@pytest.mark.slow
def test_the_longest_record_and_the_slowest_ramp_are_no_error(board: EmbeddedBoard, machine: Machine) -> None:
    """With the lowest deceleration the ramp takes 16 s and its last records of 255 ms take seconds each."""
    for axis in machine.axes:
        axis.write(od.PROFILE_DECELERATION, 1)
    run = machine.start(StreamedMotion(travelling(60, 255), [0] * AXES))
    machine.wait(1.0)
    asked_s = board.now_s()
    assert pause_trajectory(machine)
    assert board.now_s() - asked_s == pytest.approx(16.33, abs=0.02)
    resume_trajectory(machine)
    machine.wait(60.0)
    assert run.ended


def test_a_fault_ends_the_waiting(board: EmbeddedBoard, machine: Machine) -> None:
    machine.start(StreamedMotion(travelling(101), [0] * AXES))
    machine.wait(0.5)
    pause_trajectory(machine)
    machine.axes[TH1].write(od.CONSUMER_HEARTBEATS[0], 0x7E << 16 | 50)
    board.network.send_message(0x77E, b"\x05")
    with refusing(DeviceFaultError):
        machine.wait(1.0)
    machine.wait(0.1)  # a failed stream is tended no more


@pytest.mark.slow
def test_an_output_waits_for_the_trajectory(board: EmbeddedBoard, machine: Machine) -> None:
    """The machine is halted at the output's time, before the host knows that this time has come."""
    th3 = machine.axes[TH3]
    run = machine.start(
        StreamedMotion(still(100, 20), [0] * AXES, (OutputChange("magnet", True, 0.5, 0.5),), wiring=WIRING)
    )
    started_s = board.now_s()
    machine.wait(0.48)
    board.wait(started_s + 0.5 - board.now_s())
    pause_trajectory(machine)
    machine.wait(5.0)
    assert th3.read(od.DIGITAL_OUTPUTS) == 0
    resume_trajectory(machine)
    machine.wait(0.03)
    assert th3.read(od.DIGITAL_OUTPUTS) == DigitalOutput.OUT1
    machine.wait(2.0)
    assert run.ended
