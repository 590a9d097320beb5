"""Read a run from its folder: everything that the verifier and the pictures need, from the files alone."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.planning.trajectory_file import trajectory_of_csv
from steptwin.host.record.folder.cutting import evidence_until
from steptwin.host.record.folder.edges import read_edges
from steptwin.host.record.folder.layout import EDGES, RECORDING, ROBOT, TRAJECTORY, existing_file
from steptwin.host.record.folder.motion import read_motion
from steptwin.host.record.folder.recording_layout import PLAN, unfinished
from steptwin.host.record.folder.report import StoredReport, read_report
from steptwin.host.record.folder.shelf_file import read_shelf
from steptwin.host.record.folder.unfinished import UnfinishedRecording, read_unfinished
from steptwin.host.robots import load_robot_file
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Comparison, Evidence, Expectation, compare
from steptwin.host.verify.wiring import output_changes
from steptwin.protocol.timer import COUNTS_PER_SECOND

_ReadMotion = Callable[[float], Trajectory]
"""Reads the plan up to an instant of the motion, in seconds."""


@dataclass(frozen=True, slots=True)
class StoredRun:
    """A run read from its folder: robot, report, and a new comparison of plan and evidence.

    The comparison of a recording that has no end goes as far as the recording does.
    """

    robot: Robot
    report: StoredReport
    comparison: Comparison

    @property
    def duration_s(self) -> float:
        """Duration of the planned motion, as far as it is compared."""
        return self.comparison.expected.trajectory.duration_s

    @property
    def interruption(self) -> str | None:
        """How far a recording goes that has no end; None if it has one."""
        recording = self.report.recording
        if recording is None:
            return None
        motion = (
            f"{self.duration_s:.3f} s into the last motion" if recording.mark.in_motion else "its last motion had ended"
        )
        return f"{recording.interruption}, {motion}"


def read_robot(folder: Path) -> Robot:
    """Return a folder's robot; raise InputError if its file is missing or wrong."""
    return load_robot_file(str(existing_file(folder, ROBOT)))


def check_axes(path: Path, evidence: Evidence, robot: Robot) -> None:
    """Raise InputError, naming the evidence's file, unless its axes are the robot's joints."""
    names = tuple(axis.name for axis in evidence.axes)
    if names != robot.joint_names:
        raise InputError(f"{path}: axes: {' '.join(names)}, but {ROBOT} has {' '.join(robot.joint_names)}")


def read_recording(folder: Path) -> UnfinishedRecording | None:
    """Return the recording without an end that a folder holds; None if it holds none. Raises as its reader does."""
    return read_unfinished(folder) if unfinished(folder) else None


def read_evidence(folder: Path) -> Evidence:
    """Return a folder's evidence without the outputs' names, as far as it was recorded; raises as `read_run` does."""
    recording = read_recording(folder)
    return read_edges(folder) if recording is None else recording.evidence()


def read_run(folder: Path, plan_folder: Path | None = None) -> StoredRun:
    """Read a folder and compare its evidence with its own plan, or with that of `plan_folder`.

    Args:
        folder: the folder of a run, or of a live board's recording, also one that has no end.
        plan_folder: for a live board's folder, the folder of the run whose plan the board has executed; by default the
            folder's own plan, made of the PVT records that it has received.

    Raises:
        InputError: a file is missing or cannot be read (the message names file and key), or `plan_folder` must not
            replace the folder's own plan.
        ContradictionError: the files contradict themselves or each other.
    """
    report, robot = read_report(folder), read_robot(folder)
    recording = report.recording
    read = _own_motion(folder, robot, report) if plan_folder is None else _motion_of(plan_folder, folder, report, robot)
    motion = read(inf)
    evidence = read_edges(folder) if recording is None else recording.evidence()
    check_axes(folder / (RECORDING if recording else EDGES), evidence, robot)
    if plan_folder is not None or report.passed is not None:  # a plan of PVT records alone has no outputs
        evidence = replace(evidence, outputs=output_changes(robot, evidence.axes))
    if recording is not None:
        motion, evidence = _as_far(read, motion, evidence, recording)
    stock = None
    if "shelf" in report.document and report.passed is not None:
        shelf, stock = read_shelf(folder)
        evidence = replace(evidence, shelf=shelf)
    return StoredRun(robot, report, compare(Expectation.of(robot, motion, stock), evidence))


def _as_far(
    read: _ReadMotion, motion: Trajectory, evidence: Evidence, recording: UnfinishedRecording
) -> tuple[Trajectory, Evidence]:
    """Cut plan and evidence at the last point that was recorded, unless the whole motion was."""
    until_s = (recording.mark.until_counts - evidence.start_counts) / COUNTS_PER_SECOND
    if motion.duration_s <= until_s:
        return motion, evidence
    with prefixed(f"{recording.folder}: the recording ends {until_s:.3f} s into the motion: "):
        motion = read(until_s)
    return motion, evidence_until(evidence, evidence.start_counts + round(motion.duration_s * COUNTS_PER_SECOND))


def _own_motion(folder: Path, robot: Robot, report: StoredReport) -> _ReadMotion:
    recording = report.recording
    planned = (folder / TRAJECTORY).exists() if recording is None else recording.mark.no_plan is None
    if report.passed is None and not planned:
        reason = report.document.get("no_plan") or "a board does not know its plan"
        raise InputError(f"{folder / TRAJECTORY}: is missing: {reason}; plan_folder=DIR takes that of another run")
    if recording is None:
        return lambda until_s: read_motion(folder, robot, report.switchings, until_s)
    text = recording.plan_text()

    def read(until_s: float) -> Trajectory:
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
    switchings = read_report(plan_folder).switchings
    return lambda until_s: read_motion(plan_folder, robot, switchings, until_s)
