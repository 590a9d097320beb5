"""Read a run from its folder: everything that the verifier and the pictures need, from the files alone."""

from dataclasses import dataclass, replace
from pathlib import Path

from steptwin.host.common.errors import InputError
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.record.folder.edges import read_edges
from steptwin.host.record.folder.layout import EDGES, ROBOT, TRAJECTORY, existing_file
from steptwin.host.record.folder.motion import read_motion
from steptwin.host.record.folder.report import StoredReport, read_report
from steptwin.host.robots import load_robot_file
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Comparison, Evidence, Expectation, compare
from steptwin.host.verify.wiring import output_changes


@dataclass(frozen=True, slots=True)
class StoredRun:
    """A run read from its folder: robot, report, and a new comparison of plan and evidence."""

    robot: Robot
    report: StoredReport
    comparison: Comparison

    @property
    def duration_s(self) -> float:
        """Duration of the planned motion."""
        return self.comparison.expected.trajectory.duration_s


def read_robot(folder: Path) -> Robot:
    """Return a folder's robot; raise InputError if its file is missing or wrong."""
    return load_robot_file(str(existing_file(folder, ROBOT)))


def check_axes(path: Path, evidence: Evidence, robot: Robot) -> None:
    """Raise InputError, naming the evidence's file, unless its axes are the robot's joints."""
    names = tuple(axis.name for axis in evidence.axes)
    if names != robot.joint_names:
        raise InputError(f"{path}: axes: {' '.join(names)}, but {ROBOT} has {' '.join(robot.joint_names)}")


def read_run(folder: Path, plan_folder: Path | None = None) -> StoredRun:
    """Read a folder and compare its evidence with its own plan, or with that of `plan_folder`.

    Args:
        folder: the run's folder.
        plan_folder: a folder of the same robot, from which to take the planned trajectory and changes of outputs. A
            live board's folder may need it: the board knows only the PVT records that it has received.

    Raises:
        InputError: a file is missing or cannot be read (the message names file and key), or `plan_folder` must not
            replace the folder's own plan.
        ContradictionError: the files contradict themselves or each other.
    """
    report, robot = read_report(folder), read_robot(folder)
    motion = _motion(folder, robot, report) if plan_folder is None else _motion_of(plan_folder, folder, report, robot)
    evidence = read_edges(folder)
    check_axes(folder / EDGES, evidence, robot)
    if plan_folder is not None or report.passed is not None:  # a plan of PVT records alone has no outputs
        evidence = replace(evidence, outputs=output_changes(robot, evidence.axes))
    return StoredRun(robot, report, compare(Expectation.of(robot, motion), evidence))


def _motion(folder: Path, robot: Robot, report: StoredReport) -> Trajectory:
    if report.passed is None and not (folder / TRAJECTORY).exists():
        reason = report.document.get("no_plan") or "a board does not know its plan"
        raise InputError(f"{folder / TRAJECTORY}: is missing: {reason}; plan_folder=DIR takes that of another run")
    return read_motion(folder, robot, report.switchings)


def _motion_of(plan_folder: Path, folder: Path, report: StoredReport, robot: Robot) -> Trajectory:
    if report.passed is not None:
        raise InputError(
            f"plan_folder={plan_folder}: {folder} has its own plan; only a live board's folder takes another"
        )
    if read_robot(plan_folder) != robot:
        raise InputError(f"plan_folder={plan_folder}: its {ROBOT} is not that of {folder}")
    return read_motion(plan_folder, robot, read_report(plan_folder).switchings)
