"""What the items of every paper share; each value is computed when an item first asks for it, by name."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import job_extras, make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.kinematics.base import link_frames, tool_frames
from steptwin.host.robots.kinematics.dh import Convention
from steptwin.host.robots.robot import Robot
from steptwin.host.studies.papers.paper import Curve, Panel, Rows
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.machine.kernels import Kernel, fastest_kernel
from steptwin.protocol.timer import COUNTS_PER_SECOND

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Runs:
    """The outcome of each robot and job; a job runs when its outcome is first asked for."""

    def __init__(self, kernel: Kernel | None = None) -> None:
        self._kernel = kernel
        self._outcomes: dict[tuple[str, str, frozenset[tuple[str, str]]], Outcome] = {}

    def outcome(self, robot_name: str, job: str, options: Mapping[str, str] = MappingProxyType({})) -> Outcome:
        """Return the outcome of one job; raise what `make_job`, `plan` and `execute` raise."""
        key = robot_name, job, frozenset(options.items())
        if key not in self._outcomes:
            robot = load_robot(robot_name)
            extras = job_extras(robot, job, options)
            self._kernel = self._kernel or fastest_kernel()
            self._outcomes[key] = execute(plan(robot, make_job(robot, job, options)), job, self._kernel, extras=extras)
        return self._outcomes[key]

    def made(self) -> Iterator[Outcome]:
        """Yield the outcomes that have been asked for, of jobs with default options."""
        yield from (outcome for (_, _, options), outcome in self._outcomes.items() if not options)


@dataclass(frozen=True, slots=True)
class JobRun:
    """A job's run, as pages show it."""

    outcome: Outcome

    @property
    def duration_s(self) -> float:
        """How long the motion lasted."""
        return self.outcome.report.run.duration_s

    @property
    def tool_off_mm(self) -> float:
        """The tool's largest error by the drivers' counts."""
        return self.outcome.report.tool.position_error_mm_max

    @property
    def failed(self) -> int:
        """Number of checks that failed."""
        return len(self.outcome.report.reasons)

    @property
    def rows(self) -> Rows:
        """A row for each axis: steps, pulses, peak rate, largest error."""
        return [
            [
                axis.name,
                str(axis.steps_start),
                str(axis.steps_end),
                str(axis.pulses),
                f"{axis.peak_rate_hz:.1f}" if axis.pulses else "-",
                f"{axis.position_error_steps_max:.4f}" if axis.pulses else "-",
            ]
            for axis in self.outcome.report.axes
        ]

    @property
    def shelf_rows(self) -> Rows:
        """What happened at the shelf or at spots for boxes: event, where, when; none without such."""
        evidence = self.outcome.comparison.evidence
        shelf = evidence.features.get("shelf")
        return [
            [event.what, event.where, f"{(event.counts - evidence.start_counts) / COUNTS_PER_SECOND:.3f}"]
            for event in (shelf.events if shelf else ())
        ]

    def counted(self, t_s: FloatArray) -> FloatArray:
        """Return the joints by the drivers' counts at instants of shape (n,), shape (n, joints)."""
        comparison = self.outcome.comparison
        steps = np.array([axis.around(t_s)[1] for axis in comparison.counted]).T
        return np.asarray(comparison.expected.joints(steps))


class _JobRuns(dict[str, JobRun]):
    """The runs of one robot's jobs, each made when it is first asked for."""

    def __init__(self, robot_name: str, runs: Runs) -> None:
        super().__init__()
        self._robot_name, self._runs = robot_name, runs

    def __missing__(self, job: str) -> JobRun:
        self[job] = JobRun(self._runs.outcome(self._robot_name, job))
        return self[job]


_DH_COLUMNS: Final = {
    Convention.MODIFIED: ("i", "alpha_i-1 deg", "a_i-1 mm", "d_i mm", "theta_i deg"),
    Convention.STANDARD: ("i", "theta_i deg", "d_i mm", "a_i mm", "alpha_i deg"),
}
"""The columns of a DH table, in the usual order of each convention."""


def dh_columns(robot_name: str) -> tuple[str, tuple[str, ...]]:
    """Return the convention of a robot's DH table, in a word, and the columns of its rows."""
    convention = make_kinematics(load_robot(robot_name)).dh.convention
    return convention.value, _DH_COLUMNS[convention]


def dh_rows(kinematics: Kinematics) -> Rows:
    """Return the rows of a DH table as the kinematics has it, in the columns of its convention."""
    dh, rows = kinematics.dh, []
    for i, row in enumerate(dh.rows, start=1):
        cells = [f"{row.alpha_deg:g}", f"{row.a_mm:g}", str(row.d_mm), str(row.theta_deg)]
        rows.append([str(i), *(cells if dh.convention is Convention.MODIFIED else reversed(cells))])
    return rows


def matrix_rows(matrices: Mapping[str, FloatArray]) -> Rows:
    """Return a row of texts for each row of each 4 by 4 matrix but the last one, which is always 0 0 0 1."""
    return [
        [f"{name}, {axis}", *(f"{element:z.6f}" for element in row[:3]), f"{row[3]:z.3f}"]
        for name, matrix in matrices.items()
        for axis, row in zip("xyz", matrix[:3].tolist(), strict=True)
    ]


def texts(values: Iterable[float], decimals: int = 6) -> list[str]:
    """Return numbers with so many digits behind the point, without signs of zeros."""
    return [f"{value:z.{decimals}f}" for value in values]


def panels_over(
    x: FloatArray, x_label: str, columns: Sequence[tuple[str, Sequence[tuple[str, FloatArray, str]]]]
) -> tuple[Panel, ...]:
    """Return a panel for each label, with its curves, each a name, values of shape (n,) and a style."""
    return tuple(
        Panel("", x_label, label, tuple(Curve(name, x, y, style) for name, y, style in curves))
        for label, curves in columns
    )


@dataclass(frozen=True)
class Study:
    """A robot and the runs of its jobs; each paper adds what it computes with them.

    Attributes:
        robot_name: name of the robot.
        at: joint position where formulas are computed.
        shown: joint position at which frames can be told apart in a picture.
        branch: the branch of the inverse that leads back to `at`.
        products: numbers of the links up to which the product of transforms is shown.
    """

    robot_name: ClassVar[str]
    at: ClassVar[tuple[float, ...]]
    shown: ClassVar[tuple[float, ...]]
    branch: ClassVar[str] = "right"
    products: ClassVar[tuple[int, ...]] = (4,)
    runs: Runs

    @cached_property
    def robot(self) -> Robot:
        """The robot."""
        return load_robot(self.robot_name)

    @cached_property
    def kinematics(self) -> Kinematics:
        """Its kinematics."""
        return make_kinematics(self.robot)

    @property
    def joint(self) -> dict[str, Joint]:
        """Its joints by name."""
        return {joint.name: joint for joint in self.robot.joints}

    @cached_property
    def run(self) -> dict[str, JobRun]:
        """The runs of its jobs with default options, by the job's name."""
        return _JobRuns(self.robot_name, self.runs)

    @cached_property
    def joints(self) -> FloatArray:
        """The joints at the paper's samples, of shape (n, joints)."""
        raise NotImplementedError

    @cached_property
    def pose(self) -> FloatArray:
        """The tool's pose at `at`, of shape (4,)."""
        return np.asarray(self.kinematics.forward(np.array([self.at]))[0])

    @property
    def solved(self) -> FloatArray:
        """The joints that the inverse finds for that pose, of shape (joints,)."""
        return np.asarray(self.kinematics.solve(self.pose[np.newaxis], self.branch).joints[0])

    def transforms(self, joints: FloatArray) -> FloatArray:
        """Return the tool's transforms, of shape (n, 4, 4), as the product of the DH table's links."""
        return tool_frames(self.kinematics, joints)

    @cached_property
    def product(self) -> FloatArray:
        """The tool's transform at `at`."""
        return np.asarray(self.transforms(np.array([self.at]))[0])

    @property
    def dh_rows(self) -> Rows:
        """The rows of the DH table."""
        return dh_rows(self.kinematics)

    @property
    def link_rows(self) -> Rows:
        """Rows of every link's transform at `at`, T1, T2 ..., and of their products."""
        named, product = dict[str, FloatArray](), np.eye(4)
        for i, link in enumerate(link_frames(self.kinematics, np.array([self.at])), start=1):
            named[f"T{i}"], product = link[0], product @ link[0]
            named |= {f"0T{i}": product} if i in self.products else {}
        return matrix_rows(named)

    @property
    def whole_steps(self) -> FloatArray:
        """The nearest whole steps, half a step rounded up, of the joints at the samples."""
        return np.asarray(np.floor(self.robot.to_steps(self.joints) + 0.5))

    @cached_property
    def stepped(self) -> FloatArray:
        """The joints at the samples, each at its nearest whole step."""
        return self.robot.from_steps(self.whole_steps)

    @property
    def pulses(self) -> dict[str, int]:
        """Each axis' pulses if every sample of the joints is rounded to whole steps."""
        moved: FloatArray = np.abs(np.diff(self.whole_steps, axis=0)).sum(axis=0)
        return dict(zip(self.robot.joint_names, map(int, moved), strict=True))

    def apart_mm(self, joints: FloatArray, others: FloatArray) -> FloatArray:
        """Return the distances, of shape (n,), between the tool's positions for two sets of joints."""
        offsets_mm = self.kinematics.forward(joints)[:, :3] - self.kinematics.forward(others)[:, :3]
        return np.asarray(np.linalg.norm(offsets_mm, axis=1))

    @property
    def stepped_off_mm(self) -> float:
        """The tool's largest distance from the samples with the joints in whole steps."""
        return float(self.apart_mm(self.stepped, self.joints).max())

    @property
    def arm_picture(self) -> "Figure":
        """The arm at home in space."""
        from steptwin.host.record.plots.in_space import draw_arm_in_space

        return draw_arm_in_space(self.robot)

    @property
    def frames_picture(self) -> "Figure":
        """The frames of the DH table at `shown`."""
        from steptwin.host.record.plots.in_space import draw_link_frames

        return draw_link_frames(self.robot, self.shown)
