"""Run a plan from start to verdict: check the start, switch the board on, stream, wait for the end, verify."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.host.client import Machine, Progress, StreamedMotion, object_dictionary
from steptwin.host.client.stopping import await_standstill
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError, WaitTimeoutError
from steptwin.host.common.features import giving
from steptwin.host.operate.inputs_outputs import plan_made, streamed_motion, waits_made
from steptwin.host.operate.setting_up import set_up
from steptwin.host.planning.plan import Plan
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.outcome import Outcome, RunEnd, RunFault, not_begun
from steptwin.host.twin.machine.input_changes import InputChange
from steptwin.host.twin.machine.machine_options import MachineKeywords, MachineOptions
from steptwin.host.verify import Comparison, Expectation, Report, RunInfo, compare, verify_comparison
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.timer import COUNTS_PER_SECOND


def execute(
    plan: Plan,
    job: str,
    kernel: Kernel | None = None,
    *,
    cut_stream_s: float | None = None,
    inputs: Sequence[InputChange] = (),
    progress: Progress = lambda _: None,
    on_board: Callable[[EmbeddedBoard], None] = lambda _: None,
    **machine: Unpack[MachineKeywords],
) -> Outcome:
    """Run a plan on an embedded board in virtual time, and verify every pulse.

    Args:
        plan: the motion from `plan`.
        job: name of the motion in reports.
        kernel: form of the firmware's kernel; by default the fastest one that is installed. All make the same edges.
        cut_stream_s: send only the points before this time of the motion, as a hanging host does.
        inputs: changes of the machine's digital inputs during the motion.
        progress: called with the fraction of the stream that has been sent, from 0 to 1.
        on_board: called with the board before the run, for later examination.
        machine: differences from the robot's file, and operations on the machine: the fields of `MachineOptions`; by
            default it is at the plan's start. The plan does not depend on them; the outcome has the verdicts of
            features that act on the run.

    Raises:
        InputError: the machine is not at the plan's start, the stream is cut outside the motion, drivers, their
            switches, or an input do not exist, a feature's options do not fit, the boards' axes do not match the
            robot's, a crystal is too far off, or the boards run other firmware.
        DeviceFaultError, BusError: the setup failed, or no motion began; also a `NotBegunError` if features have
            verdicts. A fault during motion is part of the outcome instead.
    """
    robot = plan.robot
    options = MachineOptions(**machine)
    if options.program() is not None:
        raise InputError("firmware: a run's host speaks to StepTwin's firmware only")
    if options.stand_at is None:
        options = replace(options, stand_at=plan.start_joints)
    else:
        plan.check_start(options.joints(robot))
    motion = streamed_motion(plan) if cut_stream_s is None else _cut(streamed_motion(plan), plan, cut_stream_s)
    kernel = kernel or fastest_kernel()
    object_dictionary()  # happens once in a process; it is no part of the measured time
    started_s = time.perf_counter()
    board = EmbeddedBoard(
        robot,
        kernel,
        options,
        commissioned=False,  # `set_up` writes every setting
        waits_for={wait.input for wait in plan.motion.waits},
    )
    on_board(board)
    board.change_inputs(inputs)
    host = Machine(board, robot.axis_names)
    fault = _drive(host, board, plan, motion, progress)
    timed_out = fault is not None and fault.timed_out
    made = plan_made(plan, host.holds_ms, timed_out=timed_out)
    run = RunInfo(
        robot=robot.name,
        job=job,
        duration_s=made.motion.duration_s,
        bus=board.bus_report(),
        simulated_s=board.now_s(),
        wall_s=time.perf_counter() - started_s,
    )
    expected = {
        feature.name: left
        for feature, leaves in giving("expected")
        if (left := leaves(robot, made.motion, feature.options_in(options.extras))) is not None
    }
    comparison = compare(Expectation.of(robot, made.motion, expected), board.evidence())
    settled = board.settled(comparison.evidence)
    report = verify_comparison(comparison, run)
    outcome = Outcome(
        made,
        comparison,
        report,
        board.bus_log,
        fault,
        board.driver_profile.name,
        waits_made(plan, host.holds_ms, timed_out=timed_out),
        board.verdicts(_end(comparison, report, fault)),
        tuple(board.operations.requests()),
        axes_per_board=tuple(options.axes_per_board or ()),
        crystals_ppm=options.crystals_ppm,
    )
    for name, seen in settled.items():
        outcome = outcome.with_feature(name, seen)
    return outcome


def _cut(motion: StreamedMotion, plan: Plan, cut_s: float) -> StreamedMotion:
    """Return the part before a time; raise InputError if that is outside the motion."""
    count = int(np.searchsorted(plan.times_ms[1:], cut_s * 1000, side="right"))
    if not 0 < count < len(plan.times_ms) - 1:
        first_s, end_s = plan.times_ms[1] / 1000, plan.times_ms[-1] / 1000
        raise InputError(f"cut_stream_s={cut_s:g}: must be from {first_s:g} s to below {end_s:g} s")
    waits = tuple(wait for wait in motion.waits if wait.at_s < cut_s)
    return motion._replace(records=plan.records(count), waits=waits)


def _drive(
    machine: Machine, board: EmbeddedBoard, plan: Plan, motion: StreamedMotion, progress: Progress
) -> RunFault | None:
    """Set up a machine, stream a plan to it, and disconnect; return the fault that ended the motion, if any."""
    try:
        set_up(machine, plan.robot, plan.start_units)
        fault = _run(machine, board, plan, motion, progress)
        machine.disconnect()
    except (BusError, DeviceFaultError) as error:
        return _given_up(error, board)
    return fault


def _run(
    machine: Machine, board: EmbeddedBoard, plan: Plan, motion: StreamedMotion, progress: Progress
) -> RunFault | None:
    """Stream a plan to a machine that is set up; return the fault that ended the motion, if any."""
    try:
        machine.run(motion, progress)
        machine.disable()
    except DeviceFaultError as error:
        if not board.started:
            raise
        await_standstill(board, machine.axes)
        return _fault(error, machine, board, plan)
    return None


def _given_up(error: BusError | DeviceFaultError, board: EmbeddedBoard) -> RunFault:
    """Return the fault of a run whose host could not continue because of a feature.

    Raises the error itself if no feature is the cause; `NotBegunError`, with the features' verdicts, if no motion
    began.
    """
    if not board.started:
        end = RunEnd(board.evidence(), stopped=True, ended_s=0.0, not_begun=f"no motion began: {error}")
        verdicts = board.verdicts(end)
        if verdicts:
            raise not_begun(error, verdicts) from error
    elif isinstance(error, BusError):
        for part in board.parts.values():
            if (fault := part.outlive(board, error)) is not None:
                return fault
    raise error


def driver_units(board: EmbeddedBoard, robot: Robot) -> list[float]:
    """Return the positions of the motors by the steps of their drivers, in wire units."""
    return [
        steps * UNITS_PER_FULL_STEP // joint.transmission.microsteps
        for steps, joint in zip(board.motor_positions(), robot.axes, strict=True)
    ]


def _end(comparison: Comparison, report: Report, fault: RunFault | None) -> RunEnd:
    """Return the end of a run."""
    evidence = comparison.evidence
    last_counts = max((int(axis.step_counts[-1]) for axis in evidence.axes if axis.step_counts.size), default=0)
    stood_s = (last_counts - evidence.start_counts) / COUNTS_PER_SECOND
    return RunEnd(
        evidence,
        stopped=fault is not None,
        ended_s=report.run.duration_s if fault is None else round(stood_s, 3),
        reasons=report.reasons if fault is None else (),
    )


def _fault(error: DeviceFaultError, machine: Machine, board: EmbeddedBoard, plan: Plan) -> RunFault:
    reported = machine.positions_units()
    counted = driver_units(board, plan.robot)
    joints = dict(zip(plan.robot.joint_names, plan.robot.to_positions(np.array(reported)).tolist(), strict=True))
    codes = {axis.name: axis.error_codes for axis in machine.axes}
    timed_out = isinstance(error, WaitTimeoutError)
    return RunFault(str(error), codes, joints, positions_agree=reported == counted, timed_out=timed_out)
