"""Read a run from its folder: plan and evidence for the verifier and the pictures."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.planning.motion import JointLaw, Motion
from steptwin.host.planning.trajectory_file import trajectory_of_csv
from steptwin.host.record.folder.edges_file import evidence_until, read_edges
from steptwin.host.record.folder.layout import EDGES, RECORDING, ROBOT, TRAJECTORY, StoppedError, existing_file
from steptwin.host.record.folder.motion import read_motion
from steptwin.host.record.folder.report_file import StoredReport, read_feature, read_report
from steptwin.host.record.folder.unfinished import PLAN, UnfinishedRecording, read_unfinished, unfinished
from steptwin.host.robots import load_robot_file
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import AS_PLANNED, Comparison, Evidence, Expectation, compare
from steptwin.host.verify.counted import CountedSteps, counted_steps
from steptwin.host.verify.switching import output_edges
from steptwin.protocol.timer import COUNTS_PER_SECOND

_BEFORE_COUNTS: Final = COUNTS_PER_SECOND // 1000
"""Time from t = 0 to the first step: one millisecond."""
_RATE_OVER_S: Final = 0.02
"""Averaging time of speeds."""


@dataclass(frozen=True, slots=True, eq=False)
class CountedLaw(JointLaw):
    """The joints' positions by the drivers' counts."""

    robot: Robot
    axes: tuple[CountedSteps, ...]

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions after the steps at each instant, shape (n, joints)."""
        counts = [axis.positions[np.searchsorted(axis.time_s, t_s, side="right")] for axis in self.axes]
        return self.robot.from_steps(np.column_stack(counts))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities over 20 ms around each instant, shape (n, joints)."""
        half_s = _RATE_OVER_S / 2
        return (self.positions(t_s + half_s) - self.positions(t_s - half_s)) / _RATE_OVER_S


def counts_alone(robot: Robot, evidence: Evidence) -> Comparison:
    """Return the counts of a recording from its first step on, without a plan, ideal steps or pairs.

    Time is the clock's, since there is no plan.

    Raises:
        InputError: no driver has counted a step.
    """
    firsts = [int(axis.step_counts[0]) for axis in evidence.axes if axis.step_counts.size]
    if not firsts:
        raise InputError("no driver has counted a step: nothing has moved")
    axes = tuple(replace(axis, rates=AS_PLANNED) for axis in evidence.axes)
    evidence = replace(evidence, start_counts=max(0, min(firsts) - _BEFORE_COUNTS), axes=axes)
    microsteps = (joint.transmission.microsteps for joint in robot.axes)
    counted = tuple(
        counted_steps(axis, evidence.start_counts, planned)
        for axis, planned in zip(evidence.axes, microsteps, strict=True)
    )
    end_s = max(float(axis.time_s[-1]) for axis in counted if axis.time_s.size) + 0.001
    motion = Motion(robot.joint_names, end_s, CountedLaw(robot, counted))
    return Comparison(Expectation.of(robot, motion), evidence, (), counted, ())


_ReadMotion = Callable[[float], Motion]
"""Reads the plan up to an instant of the motion in seconds."""


@dataclass(frozen=True, slots=True)
class StoredRun:
    """A run read from its folder: robot, report, and a new comparison of plan and evidence.

    The comparison of a recording without an end stops where the recording does. `no_plan` is the reason why it has only
    the drivers' counts; None if there is a plan.
    """

    robot: Robot
    report: StoredReport
    comparison: Comparison
    no_plan: str | None = None

    @property
    def duration_s(self) -> float:
        """Duration of the planned motion, up to the end of the comparison."""
        return self.comparison.expected.motion.duration_s

    @property
    def interruption(self) -> str | None:
        """Text about a recording without an end, with its last instant; None if it has an end."""
        recording = self.report.recording
        if recording is None:
            return None
        motion = (
            f"{self.duration_s:.3f} s into the last motion" if recording.mark.in_motion else "its last motion had ended"
        )
        return f"{recording.interruption}, {motion}"


def read_robot(folder: Path) -> Robot:
    """Return a folder's robot; raise InputError if its file is missing or invalid."""
    return load_robot_file(existing_file(folder, ROBOT))


def check_axes(path: Path, evidence: Evidence, robot: Robot) -> None:
    """Raise InputError, naming the evidence's file, if its axes are not the robot's joints."""
    names = tuple(axis.name for axis in evidence.axes)
    if names != robot.axis_names:
        raise InputError(f"{path}: axes: {' '.join(names)}, but {ROBOT} has {' '.join(robot.axis_names)}")


def stored_motion(folder: Path, robot: Robot) -> Motion:
    """Return the motion of a folder without its outputs; raise InputError if its file is missing or invalid."""
    return read_motion(folder, robot, ())


def read_recording(folder: Path) -> UnfinishedRecording | None:
    """Return a folder's recording without an end; None if there is none. Raises as its reader does."""
    return read_unfinished(folder) if unfinished(folder) else None


def read_evidence(folder: Path) -> Evidence:
    """Return a folder's recorded evidence without the outputs' names; raises as `read_run`."""
    recording = read_recording(folder)
    return read_edges(folder) if recording is None else recording.evidence()


def read_run(folder: Path, plan_folder: Path | None = None, *, counts_suffice: bool = False) -> StoredRun:
    """Read a folder and compare its evidence with its own plan, or with that of `plan_folder`.

    Args:
        folder: folder of a run, or of a live board's recording, even without an end.
        plan_folder: for a live board's folder, folder of the run with the executed plan; by default the folder's own
            plan, made from the received PVT records.
        counts_suffice: True to read a live board's folder without a plan, by the drivers' counts alone.

    Raises:
        InputError: a file is missing or unreadable (the message names file and key), or `plan_folder` must not replace
            the folder's own plan.
        ContradictionError: the files contradict themselves or each other.
    """
    report, robot = read_report(folder), read_robot(folder)
    recording = report.recording
    no_plan = _no_plan(folder, report) if plan_folder is None else None
    if no_plan and counts_suffice:
        return _read_counts(folder, robot, report, no_plan)
    read = _own_motion(folder, robot, report) if plan_folder is None else _motion_of(plan_folder, folder, report, robot)
    motion = read(inf)
    evidence = read_edges(folder) if recording is None else recording.evidence()
    check_axes(folder / (RECORDING if recording else EDGES), evidence, robot)
    if report.next_motion_s is not None:
        evidence = evidence_until(evidence, round(report.next_motion_s * COUNTS_PER_SECOND))
    if plan_folder is not None or report.passed is not None:  # a plan of PVT records alone has no outputs
        evidence = replace(evidence, outputs=output_edges(robot, evidence.axes))
    if recording is not None:
        motion, evidence = _as_far(read, motion, evidence, recording)
    stored = {
        feature.name: read_feature(folder, feature.name)
        for feature, _ in giving("judge")
        if feature.name in report.document and report.passed is not None
    }
    evidence = replace(evidence, features={name: seen for name, (seen, _) in stored.items()})
    expected = Expectation.of(robot, motion, {name: planned for name, (_, planned) in stored.items()})
    return StoredRun(robot, report, compare(expected, evidence, report.gates))


def _as_far(
    read: _ReadMotion, motion: Motion, evidence: Evidence, recording: UnfinishedRecording
) -> tuple[Motion, Evidence]:
    """Cut plan and evidence at the last recorded point, if the motion was not recorded whole."""
    until_s = evidence.trajectory_s(recording.mark.until_counts)
    if motion.duration_s <= until_s:
        return motion, evidence
    with prefixed(f"{recording.folder}: the recording ends {until_s:.3f} s into the motion: "):
        motion = read(until_s)
    rates, until_counts = evidence.axes[0].rates, recording.mark.until_counts
    return motion, evidence_until(
        evidence, rates.instant_counts(motion.duration_s, evidence.start_counts, until_counts)
    )


def _no_plan(folder: Path, report: StoredReport) -> str | None:
    """Return why a live board's folder has no plan; None if it has one. Any other folder must have one."""
    recording = report.recording
    planned = (folder / TRAJECTORY).exists() if recording is None else recording.mark.no_plan is None
    if report.passed is not None or planned:
        return None
    return str(report.document.get("no_plan") or "a board does not know its plan")


def _read_counts(folder: Path, robot: Robot, report: StoredReport, no_plan: str) -> StoredRun:
    evidence = read_evidence(folder)
    source = folder / (RECORDING if report.recording else EDGES)
    check_axes(source, evidence, robot)
    with prefixed(f"{source}: "):
        return StoredRun(robot, report, counts_alone(robot, evidence), no_plan)


def _own_motion(folder: Path, robot: Robot, report: StoredReport) -> _ReadMotion:
    recording = report.recording
    if reason := _no_plan(folder, report):
        if report.stop:
            raise StoppedError(f"{folder}: was {report.stop}, so there is no plan to verify: {reason}")
        raise InputError(f"{folder / TRAJECTORY}: is missing: {reason}; plan_folder=DIR takes that of another run")
    if recording is None:
        return lambda until_s: read_motion(folder, robot, report.output_changes, until_s)
    text = recording.plan_text()

    def read(until_s: float) -> Motion:
        with prefixed(f"{folder / RECORDING / PLAN}: "):
            return trajectory_of_csv(text, robot, until_s)

    return read


def _motion_of(plan_folder: Path, folder: Path, report: StoredReport, robot: Robot) -> _ReadMotion:
    if report.passed is not None:
        raise InputError(
            f"plan_folder={plan_folder}: {folder} has its own plan; only a live board's folder takes another"
        )
    if read_robot(plan_folder) != robot:
        raise InputError(f"plan_folder={plan_folder}: its {ROBOT} is not that of {folder}")
    output_changes = read_report(plan_folder).output_changes
    return lambda until_s: read_motion(plan_folder, robot, output_changes, until_s)
