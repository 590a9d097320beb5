"""Run a plan from start to verdict: check the start, switch the board on, stream, wait for the end, verify."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, Unpack

import numpy as np

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.features.faults.engine import Engine
from steptwin.features.faults.report import ScenarioReport, not_begun
from steptwin.features.faults.reporting import RunEnd, scenario_report
from steptwin.host.client import Machine, Progress, StreamedMotion, object_dictionary
from steptwin.host.client.drive_status import FAULT_STATES
from steptwin.host.client.lease import TIMEOUT_MS
from steptwin.host.client.stopping import await_rest
from steptwin.host.client.waiting import REST_TIMEOUT_S
from steptwin.host.client.words import error_text
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError, StepTwinError, WaitTimeoutError
from steptwin.host.common.features import giving
from steptwin.host.operate.inputs_outputs import plan_made, streamed_motion, waits_made
from steptwin.host.operate.setting_up import objects_of, set_up
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.trajectory import waits_of
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.outcome import Outcome, RunFault
from steptwin.host.twin.machine.input_changes import InputChange
from steptwin.host.twin.machine.machine_options import MachineKeywords, MachineOptions
from steptwin.host.verify import Comparison, Expectation, Report, RunInfo, compare, verify_comparison
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, ErrorCode
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
        plan: the motion, checked and converted by `plan`.
        job: name of the motion in reports.
        kernel: form of the firmware's kernel; by default the fastest one that is installed. All make the same edges.
        cut_stream_s: send only the points before this time of the motion, as a host that hangs would.
        inputs: changes of the machine's digital inputs during the motion.
        progress: called with the part of the stream, from 0 to 1, that has been sent.
        on_board: called with the board before anything happens, for a caller who wants to look at it afterwards.
        machine: how the emulated machine differs from the robot's file, and what happens to it: the fields of
            `MachineOptions`; by default it stands at the plan's start. The plan is not told; the outcome says whether
            each fault of a scenario was answered as documented.

    Raises:
        InputError: the machine does not stand at the plan's start, the stream is cut outside the motion, or the
            drivers, their switches, or an input do not exist, or a feature's options do not fit, or the boards have not
            as many axes as the robot, or a crystal is too far off, or the boards run other firmware.
        DeviceFaultError, BusError: the board could not be set up, or no motion began: with a scenario, a
            `NotBegunError` as well, which has its report. A fault in motion is part of the outcome instead.
    """
    robot = plan.robot
    options = MachineOptions(**machine)
    if options.firmware is not None:
        raise InputError(f"firmware={options.firmware}: a run's host speaks to StepTwin's firmware only")
    if options.stand_at is None:
        options = replace(options, stand_at=plan.start_joints)
    else:
        plan.check_start(options.joints(robot))
    motion = streamed_motion(plan) if cut_stream_s is None else _cut(streamed_motion(plan), plan, cut_stream_s)
    kernel = kernel or fastest_kernel()
    object_dictionary()  # made once in a process: no part of what the emulation takes
    started_s = time.perf_counter()
    board = EmbeddedBoard(
        robot,
        kernel,
        options,
        commissioned=False,  # `set_up` writes every setting
        waits_for={wait.input for wait in waits_of(plan.trajectory)},
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
        duration_s=made.trajectory.duration_s,
        bus=board.bus_report(),
        simulated_s=board.now_s(),
        wall_s=time.perf_counter() - started_s,
    )
    expected = {
        feature.name: left
        for feature, leaves in giving("expected")
        if (left := leaves(robot, made.trajectory, feature.options_in(options.extras))) is not None
    }
    comparison = compare(Expectation.of(robot, made.trajectory, expected), board.evidence())
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
        _played(board, comparison, report, fault),
        tuple(board.operations.requests()),
        axes_per_board=tuple(options.axes_per_board or ()),
        crystals_ppm=options.crystals_ppm,
    )
    for name, seen in settled.items():
        outcome = outcome.with_feature(name, seen)
    return outcome


def _cut(motion: StreamedMotion, plan: Plan, cut_s: float) -> StreamedMotion:
    """Return what comes before a time; raise InputError if that is outside the motion."""
    count = int(np.searchsorted(plan.times_ms[1:], cut_s * 1000, side="right"))
    if not 0 < count < len(plan.times_ms) - 1:
        first_s, end_s = plan.times_ms[1] / 1000, plan.times_ms[-1] / 1000
        raise InputError(f"cut_stream_s={cut_s:g}: must be from {first_s:g} s to below {end_s:g} s")
    waits = tuple(wait for wait in motion.waits if wait.at_s < cut_s)
    return motion._replace(records=plan.records(count), waits=waits)


def _drive(
    machine: Machine, board: EmbeddedBoard, plan: Plan, motion: StreamedMotion, progress: Progress
) -> RunFault | None:
    """Set a machine up, stream a plan to it, and disconnect; return the fault that ended it after its start, if any."""
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
    """Stream a plan to a machine that is set up; return the fault that ended it after its start, if any."""
    try:
        machine.run(motion, progress)
        machine.disable()
    except DeviceFaultError as error:
        if not board.started:
            raise
        await_rest(board, machine.axes)
        return _fault(error, machine, board, plan)
    return None


def _given_up(error: BusError | DeviceFaultError, board: EmbeddedBoard) -> RunFault:
    """Return the fault of a run whose host could not go on in motion because of a scenario.

    Raises the error itself without a scenario; `NotBegunError`, with the scenario's report, if no motion began.
    """
    engine = board.engine
    if engine is None:
        raise error
    if not board.started:
        end = RunEnd(engine.target.moment(), board.evidence(), stopped=True, ended_s=0.0)
        played = scenario_report(engine, end)
        reasons = (*played.reasons, f"no motion began: {error}")
        raise not_begun(error, replace(played, reasons=reasons)) from error
    if isinstance(error, DeviceFaultError):
        raise error
    return _without_host(error, board, engine)


def _without_host(error: BusError, board: EmbeddedBoard, engine: Engine) -> RunFault:
    """Let the machine outlive a host that has ended, as one does that has an error of the bus."""
    message = outlive(board, engine, str(error))
    robot, counted = board.robot, board.counted_units()
    return RunFault(
        message,
        {
            name: [each.code for each in engine.emergencies if each.axis == axis and each.code]
            for axis, name in enumerate(robot.axis_names)
        },
        dict(zip(robot.joint_names, robot.to_positions(np.array(counted)).tolist(), strict=True)),
        positions_agree=counted == _driver_units(board, robot),
    )


def _driver_units(board: EmbeddedBoard, robot: Robot) -> list[float]:
    """Return the positions of the motors by their drivers' steps, in wire units."""
    return [
        steps * UNITS_PER_FULL_STEP // joint.transmission.microsteps
        for steps, joint in zip(board.motor_positions(), robot.axes, strict=True)
    ]


def _played(
    board: EmbeddedBoard, comparison: Comparison, report: Report, fault: RunFault | None
) -> ScenarioReport | None:
    """Return the report of the board's scenario; None without one."""
    if board.engine is None:
        return None
    evidence = comparison.evidence
    last_counts = max((int(axis.step_counts[-1]) for axis in evidence.axes if axis.step_counts.size), default=0)
    stood_s = (last_counts - evidence.start_counts) / COUNTS_PER_SECOND
    end = RunEnd(
        moment=board.engine.target.moment(),
        evidence=evidence,
        stopped=fault is not None,
        ended_s=report.run.duration_s if fault is None else round(stood_s, 3),
        reasons=report.reasons if fault is None else (),
    )
    return scenario_report(board.engine, end)


def _fault(error: DeviceFaultError, machine: Machine, board: EmbeddedBoard, plan: Plan) -> RunFault:
    reported = machine.positions_units()
    counted = _driver_units(board, plan.robot)
    joints = dict(zip(plan.robot.joint_names, plan.robot.to_positions(np.array(reported)).tolist(), strict=True))
    codes = {axis.name: axis.error_codes for axis in machine.axes}
    timed_out = isinstance(error, WaitTimeoutError)
    return RunFault(str(error), codes, joints, positions_agree=reported == counted, timed_out=timed_out)


_LOOK_S: Final = 0.01
_MISSED_S: Final = TIMEOUT_MS / 1000 + 0.1
"""Time after which all axes have missed the host's heartbeat, and said so."""


def outlive(board: EmbeddedBoard, engine: Engine, why: str) -> str:
    """Let a machine come to rest without its host, and another host take over if there is one; return what was said.

    Args:
        board: the board.
        engine: the engine that plays its scenario.
        why: what has become of the host.
    """
    restart_counts = board.host.restart_counts
    taken_over = ""
    if restart_counts is not None:
        board.pass_time((restart_counts - board.now_counts) / COUNTS_PER_SECOND)
        taken_over = _restart(board)
    elif not board.host.hangs:
        passed_s = 0.0
        while passed_s < _MISSED_S or (board.moving and passed_s < REST_TIMEOUT_S):
            board.pass_time(_LOOK_S)
            passed_s += _LOOK_S
    said = [each for each in engine.emergencies if each.code and each.code != ErrorCode.GROUP_STOPPED]
    if said:
        last = said[-1]
        why = f"{why}; {board.robot.axis_names[last.axis]}: {error_text(last.code)} (EMCY 0x{last.code:04X})"
    return why + taken_over


def _restart(board: EmbeddedBoard) -> str:
    """Let another host take over, as an operator does: wait for rest, reset the faults, enable; return what it says."""
    board.host_restarts()
    machine = Machine(board, board.robot.axis_names)
    try:
        await_rest(board, machine.axes)
        for axis in machine.axes:
            if axis.state() in FAULT_STATES:
                axis.write(od.CONSUMER_HEARTBEATS[0], 0)  # of the host that is gone
                axis.write(od.CONTROLWORD, 0)
                axis.write(od.CONTROLWORD, Control.FAULT_RESET)
        machine.adopt([objects_of(joint, board.robot.board, moves=True) for joint in board.robot.axes])
        machine.start_nodes()
        machine.enable()
        machine.disconnect()
    except StepTwinError as error:
        return f"; the next host could not take over: {error}"
    return "; the next host has taken over"
