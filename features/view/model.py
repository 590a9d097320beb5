"""A stored run at any instant: joints, pins and currents, and the edges before and after.

An instant is a whole number of counts of the board's timer since power-up, so each edge has its own. The data stay
here; a page gets windows of them.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from steptwin.features.view.marks import RunMark, bus_marks, output_marks, violation_marks
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.record.folder import BUS_LOG, StoredRun, read_run
from steptwin.host.record.folder.layout import existing_file
from steptwin.host.record.path_error import PathError, path_error
from steptwin.host.record.recorded_machine import RecordedMachine
from steptwin.host.record.waveforms import Changes, Signal, phases, pins, whole_record
from steptwin.host.robots.kinematics import Role
from steptwin.host.robots.poses import Task
from steptwin.host.verify.switching import output_edges
from steptwin.protocol.timer import COUNTS_PER_SECOND

PATH_INSTANTS: Final = 2001
_EXTENT_INSTANTS: Final = 201
"""Instants of the motion at which the whole arm is examined; the tool's path has PATH_INSTANTS."""
_COURSE_INSTANTS: Final = 4001
"""Instants when the distance of two runs' tools is computed."""
LEAD_S: Final = 1.0
"""Time before the motion's start that the slider covers; steps reach earlier events, such as switching on."""

POINTS_MAX: Final = 400
"""Largest number of changes of one signal that a window shows singly; more would merge into a band."""
_ALWAYS: Final = ("step", "dir")
_CURRENTS: Final = ("phase_a_ma", "phase_b_ma")


@dataclass(frozen=True, slots=True)
class Span:
    """A part of a record, in counts since power-up, with both ends."""

    from_counts: int
    to_counts: int


@dataclass(frozen=True, slots=True, eq=False)
class Lane:
    """One signal in a window.

    Attributes:
        axis: name of the axis.
        quantity: name of the pin, or of a current.
        counts: shape (n,), the start of the window, then the instants of the changes.
        values: shape (n,), the value after each of these instants.
        changes: number of changes in the window; if there are too many, only the first value is shown.
    """

    axis: str
    quantity: str
    counts: Int64Array
    values: NDArray[Any]
    changes: int

    @property
    def crowded(self) -> bool:
        """True if there are too many changes to show."""
        return self.changes >= self.counts.size


def lane(signal: Signal, span: Span) -> Lane:
    """Return a signal's part in a window."""
    counts, values = signal.changes.between(span.from_counts, span.to_counts)
    shown = slice(0, counts.size if counts.size <= POINTS_MAX else 0)
    return Lane(
        signal.axis,
        signal.quantity,
        np.concatenate([[span.from_counts], counts[shown]]),
        np.concatenate([[signal.changes.at(span.from_counts)], values[shown]]),
        int(counts.size),
    )


@dataclass(frozen=True, slots=True)
class Edge:
    """A change of a pin."""

    counts: int
    axis: str
    pin: str
    level: int


@dataclass(frozen=True, slots=True)
class JointRow:
    """A joint at an instant.

    Attributes:
        name: name of the joint.
        unit: `mm` or `deg`.
        planned: planned position.
        counted: position at the drivers' counts.
        steps: count of the joint's own driver.
        error_steps: that count minus the planned position of the axis, in steps.
    """

    name: str
    unit: str
    planned: float
    counted: float
    steps: int
    error_steps: float


@dataclass(frozen=True, slots=True)
class Instant:
    """A run at an instant.

    Attributes:
        counts: the instant.
        joints: every joint.
        task: task of the tool, which defines the coordinates of its poses.
        planned_pose: planned coordinates of the tool.
        counted_pose: coordinates of the tool at the drivers' counts.
        tool_error_mm: distance of the two.
        before: last edge of any pin before the instant; None before the first.
        after: first edge after it; None after the last.
        has_plan: False if only counts are known; the planned values then equal the counted ones.
    """

    counts: int
    joints: tuple[JointRow, ...]
    task: Task
    planned_pose: tuple[float, ...]
    counted_pose: tuple[float, ...]
    tool_error_mm: float
    before: Edge | None
    after: Edge | None
    has_plan: bool = True


class Replay:
    """A stored run at any instant."""

    def __init__(self, run: StoredRun, marks: Iterable[RunMark]) -> None:
        self.run = run
        self.machine: RecordedMachine = RecordedMachine.of(run)
        self.marks: tuple[RunMark, ...] = tuple(sorted(marks, key=lambda mark: mark.counts))
        """All marks in order of time."""
        evidence = run.comparison.evidence
        self.start_counts: int = evidence.start_counts
        record, motion_counts = whole_record(evidence), round(run.duration_s * COUNTS_PER_SECOND)
        self.record: Span = Span(0, max(record.to_counts, self.start_counts + motion_counts))
        """The whole record, from power-up to the last edge or the motion's end."""
        lead_counts = int(LEAD_S * COUNTS_PER_SECOND)
        self.shown: Span = Span(max(0, self.start_counts - lead_counts), self.record.to_counts)
        """The slider's range: the motion and a short time before it."""
        self._pins = pins(evidence)
        self._currents = {
            axis.name: tuple(signal for signal in phases(axis) if signal.quantity in _CURRENTS)
            for axis in evidence.axes
        }

    @classmethod
    def of_folder(cls, folder: Path, plan_folder: Path | None = None) -> Self:
        """Read a run's folder; raise InputError as `read_run`, or if the bus log is missing or invalid."""
        run = read_run(folder, plan_folder, counts_suffice=True)
        evidence, recording = run.comparison.evidence, run.report.recording
        marks = [mark for axis in evidence.axes for mark in violation_marks(axis)]
        marks += output_marks(output_edges(run.robot, evidence.axes))
        frames = recording.mark.frames if recording else None
        marks += bus_marks(existing_file(folder, BUS_LOG), run.robot.axis_names, frames)
        return cls(run, marks)

    def time_s(self, counts: int) -> float:
        """Return the motion's time of an instant."""
        return (counts - self.start_counts) / COUNTS_PER_SECOND

    def counts_at(self, t_s: float) -> int:
        """Return the nearest instant in the record to a time of the motion."""
        counts = self.start_counts + round(t_s * COUNTS_PER_SECOND)
        return min(max(counts, self.record.from_counts), self.record.to_counts)

    def at(self, counts: int) -> Instant:
        """Return the run at an instant, with the edges at that instant applied."""
        t_s = np.array([self.time_s(counts)])
        planned, counted = self.machine.planned_joints(t_s), self.machine.counted_joints(t_s)
        kinematics = self.machine.kinematics
        task = kinematics.task
        planned_pose, counted_pose = (task.figures(kinematics.forward(joints))[0] for joints in (planned, counted))
        return Instant(
            counts=counts,
            joints=self._joints(t_s, planned[0], counted[0]),
            task=task,
            planned_pose=tuple(planned_pose.tolist()),
            counted_pose=tuple(counted_pose.tolist()),
            tool_error_mm=float(np.linalg.norm(counted_pose[:3] - planned_pose[:3])),
            has_plan=self.run.no_plan is None,
            before=self.edge_before(counts),
            after=self.edge_after(counts),
        )

    def edge_before(self, counts: int, axis: str | None = None) -> Edge | None:
        """Return the last edge before an instant, of one axis or of all; None if there is none."""
        return max(
            self._nearest(axis, lambda changes: changes.before(counts)), key=lambda edge: edge.counts, default=None
        )

    def edge_after(self, counts: int, axis: str | None = None) -> Edge | None:
        """Return the first edge after an instant, of one axis or of all; None if there is none."""
        return min(
            self._nearest(axis, lambda changes: changes.after(counts)), key=lambda edge: edge.counts, default=None
        )

    def lanes(self, span: Span, axes: Iterable[str] | None = None) -> list[Lane]:
        """Return STEP and DIR of each axis, or of some, and every other pin with changes in a window."""
        lanes = [lane(signal, span) for signal in self._pins if axes is None or signal.axis in set(axes)]
        return [each for each in lanes if each.quantity in _ALWAYS or each.changes]

    def currents(self, span: Span, axis: str) -> tuple[Lane, Lane]:
        """Return the currents of an axis' phases A and B in a window."""
        first, second = self._currents[axis]
        return lane(first, span), lane(second, span)

    @property
    def busiest_axis(self) -> str:
        """The axis with the most steps."""
        return max(self.run.comparison.evidence.axes, key=lambda axis: axis.step_counts.size).name

    @cached_property
    def path(self) -> PathError:
        """The tool's planned path and its errors just before and after PATH_INSTANTS instants of the motion."""
        return path_error(self.run.comparison, np.linspace(0.0, self.run.duration_s, PATH_INSTANTS))

    @cached_property
    def extent_mm(self) -> FloatArray:
        """The points that a view of the run must contain, shape (n, 3), all of them finite.

        Poses without a solution are left out. So are guides longer than all moving parts, such as a rail, and boxes
        that do not move.
        """
        times_s = np.linspace(0.0, self.run.duration_s, _EXTENT_INSTANTS)
        parts, shifts_mm = self.machine.links(times_s), self.machine.box_shifts_mm(times_s)
        moving = [part.points_mm.reshape(-1, 3) for part in parts if part.role is not Role.GUIDE]
        shown = _finite(np.concatenate([*moving, self.path.planned_mm, self.path.counted_mm(self.path.gain)]))
        size_mm = np.linalg.norm(np.ptp(shown, axis=0))
        guides = [part.points_mm for part in parts if part.role is Role.GUIDE]
        short = [points.reshape(-1, 3) for points in guides if _length_mm(points) <= size_mm]
        corners = [
            (self.run.robot.boxes[name].edges_mm + shift).reshape(-1, 3)
            for name, shifts in shifts_mm.items()
            for shift in (shifts.min(axis=0), shifts.max(axis=0))
        ]
        moved = any(shifts.any() for shifts in shifts_mm.values())
        return _finite(np.concatenate([shown, *short, *(corners if moved else ())]))

    def _joints(self, t_s: FloatArray, planned: FloatArray, counted: FloatArray) -> tuple[JointRow, ...]:
        expected = self.run.comparison.expected
        counts = self.machine.counts(t_s)[0]
        errors = counts - expected.axis_steps(planned)
        of_axes = (column[: len(planned)].tolist() for column in (counts, errors))
        columns = zip(planned.tolist(), counted.tolist(), *of_axes, strict=True)
        return tuple(
            JointRow(name, unit, at, at_counts, round(steps), error)
            for name, unit, (at, at_counts, steps, error) in zip(
                self.run.comparison.joint_names, expected.joint_units, columns, strict=True
            )
        )

    def _nearest(self, axis: str | None, instant: Callable[[Changes], int | None]) -> list[Edge]:
        """Return each pin's edge at `instant` of its changes, of one axis or of all, if it is not None."""
        found = [(signal, instant(signal.changes)) for signal in self._pins if axis is None or signal.axis == axis]
        return [
            Edge(counts, signal.axis, signal.quantity, int(signal.changes.at(counts)))
            for signal, counts in found
            if counts is not None
        ]


@dataclass(frozen=True, slots=True)
class Apart:
    """Difference of the second run minus the first at an instant: counted joints by name, and the tool.

    Attributes:
        joints: difference of each joint, in its unit.
        tool_mm: distance of the tools.
        attitude_deg: angle between the orientations; for a SCARA with sign.
    """

    joints: dict[str, float]
    tool_mm: float
    attitude_deg: float


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """Distance of the two tools over time: arrays of shape (n,)."""

    t_s: FloatArray
    tool_mm: FloatArray


class RunPair:
    """Two runs at the same motion time; raises InputError if their mechanisms differ."""

    def __init__(self, first: Replay, second: Replay) -> None:
        for what in ("joint_names", "kinematics", "geometry"):
            values = [getattr(replay.run.robot, what) for replay in (first, second)]
            if values[0] != values[1]:
                names = [replay.run.report.run.robot for replay in (first, second)]
                raise InputError(f"{names[1]}: is another machine than {names[0]}: two runs of one can be compared")
        self.first: Replay = first
        self.second: Replay = second

    def at(self, t_s: float) -> Apart:
        """Return the difference of the machines at a time of both motions; a machine is still after its motion."""
        instant_s = np.array([t_s])
        joints = [replay.machine.counted_joints(instant_s)[0] for replay in (self.first, self.second)]
        poses = [replay.machine.counted_poses(instant_s) for replay in (self.first, self.second)]
        apart = dict(zip(self.first.run.robot.joint_names, (joints[1] - joints[0]).tolist(), strict=True))
        off_mm = np.linalg.norm((poses[1] - poses[0])[0, :3])
        off_deg = self.first.machine.kinematics.task.off_deg(poses[1], poses[0])
        return Apart(apart, float(off_mm), float(off_deg[0]))

    @cached_property
    def course(self) -> Course:
        """The distance of the tools over the longer of the motions, at _COURSE_INSTANTS instants."""
        t_s = np.linspace(0.0, max(self.first.run.duration_s, self.second.run.duration_s), _COURSE_INSTANTS)
        first, second = (replay.machine.counted_poses(t_s)[:, :3] for replay in (self.first, self.second))
        return Course(t_s, np.linalg.norm(second - first, axis=1))


def _finite(points_mm: FloatArray) -> FloatArray:
    return points_mm[np.isfinite(points_mm).all(axis=1)]


def _length_mm(points_mm: FloatArray) -> float:
    """Return the largest distance between the ends of a part over all instants."""
    return float(np.linalg.norm(points_mm[:, -1] - points_mm[:, 0], axis=1).max())
