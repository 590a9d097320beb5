"""Compile a program to the robot's motion, and to a table of its steps with peaks and limits."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from math import nan
from typing import Any, Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import ChangedMotion, changed_motion
from steptwin.host.common.findings import Findings, check_all
from steptwin.host.common.planning_time import check_planning_time, in_planning_time, planning_step
from steptwin.host.planning import checks
from steptwin.host.planning.drives import DriveAnswer, MakeDrives
from steptwin.host.planning.motion import Motion, OutputChange
from steptwin.host.planning.motions.tool_move import ToolMove
from steptwin.host.planning.motions.whole import CornerError
from steptwin.host.planning.no_way import NO_WAY
from steptwin.host.planning.peaks import Peak
from steptwin.host.planning.programs.fast_steps import MadeStep, fast_steps
from steptwin.host.planning.programs.flow import BranchesOnWay, switching_words
from steptwin.host.planning.programs.moves import Moves
from steptwin.host.planning.programs.names import check_names
from steptwin.host.planning.programs.pallets import Pallet
from steptwin.host.planning.programs.program import (
    STEPS_MAX,
    Place,
    Program,
    Written,
    WrongStep,
    check_own_robot,
    written_out,
)
from steptwin.host.planning.programs.program_file import Complaints
from steptwin.host.planning.programs.steps import GoStep, JointsBy, Step, ToolBy
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

_SINGULARITIES: Final = ("shoulder", "elbow", "wrist")
"""Names of the singularities between branches, by the part of their names that differs."""


@dataclass(frozen=True, slots=True)
class StepRow:
    """A step of a compiled program.

    Attributes:
        made: the step as it was made.
        from_s: time when it begins in the executed motion.
        duration_s: its duration there.
        branch: branch of the arm at its beginning; empty for a step without a path of the tool.
        changes: times of changes of the branch, and the new names, where two branches meet on a path.
        remarks: changes of outputs on its path, and the treatment of the corner at its end as text.
        drives: margins of the drives in the motion that ends with it; None if they do not limit it.
        late_s: how much later it begins, because a feature has changed the motion, than without the change.
    """

    made: MadeStep
    from_s: float
    duration_s: float
    branch: str = ""
    changes: tuple[tuple[float, str], ...] = ()
    remarks: tuple[str | OutputChange, ...] = ()
    drives: DriveAnswer | None = None
    late_s: float = 0.0

    @property
    def place(self) -> Place:
        """Its number in the program, with those of its sequences and repetitions, and its pass."""
        return self.made.place

    @property
    def text(self) -> str:
        """The step as text."""
        return str(self.made.step)

    @property
    def notes(self) -> tuple[str, ...]:
        """Its remarks as text."""
        return tuple(each if isinstance(each, str) else switching_words(each) for each in self.remarks)

    def changed(self, later_s: Callable[[float], float]) -> "StepRow":
        """Return the row of a motion that a feature has changed; `later_s` converts times."""
        remarks = (
            each if isinstance(each, str) else replace(each, from_s=later_s(each.from_s)) for each in self.remarks
        )
        from_s = later_s(self.from_s)
        return replace(
            self,
            from_s=from_s,
            duration_s=round(later_s(self.from_s + self.duration_s) - from_s, 3),
            changes=tuple((later_s(t_s), name) for t_s, name in self.changes),
            remarks=tuple(remarks),
            late_s=from_s - self.from_s,
        )

    @property
    def peaks(self) -> tuple[Peak, ...]:
        """Highest speed, acceleration and step rate of each joint in it; computing them examines each millisecond."""
        return self.made.peaks

    def passed(self) -> Iterator[str]:
        """Yield a sentence for each change of the branch: singularity, position, and names of the branches."""
        before = self.branch
        for t_s, name in self.changes:
            parts = zip(_SINGULARITIES, before.split("-"), name.split("-"), strict=True)
            what = " and ".join(each for each, old, new in parts if old != new)
            percent = 100.0 * (t_s - self.from_s) / self.duration_s
            yield f"passes the {what} singularity at {percent:.0f} %, {t_s:.3f} s: {before} -> {name}"
            before = name


@dataclass(frozen=True, slots=True)
class CompiledProgram:
    """A program's motion and its steps.

    Attributes:
        motion: the motion, for the planner.
        steps: the steps.
        is_whole: False if anything but the speed of steps is wrong; the rest is then incomplete.
        changed: the motion as a feature changes it before it is checked; None if it stays as it is.
    """

    motion: Motion
    steps: tuple[StepRow, ...]
    is_whole: bool
    changed: ChangedMotion | None = None

    @property
    def executed(self) -> Motion:
        """The motion as it is executed."""
        return self.motion if self.changed is None else self.changed.motion

    def fast_steps(self) -> tuple[str, ...]:
        """Return a message for each step that is too fast, with passing values of its own keys."""
        return tuple(fast_steps(row.made for row in self.steps))

    @contextmanager
    def explained(self, stretch: float = 1.0) -> Iterator[None]:
        """Extend the planner's refusal of a motion that is too fast by the step and by passing values.

        `stretch` is the factor by which the motion was stretched; the steps' own values are given for the factor 1.
        """
        try:
            yield
        except checks.TooFastError as error:
            steps = self.fast_steps() if stretch == 1.0 else ()
            if steps:
                more = _more_words(len(steps) - 1)
                raise InputError(f"{steps[0]}{more}; or the whole program: {error.advice}") from error
            if not error.peaks:
                raise
            t_s = error.peaks[0].t_s
            begun = (row for row in self.steps if stretch * (row.from_s - row.late_s) + row.late_s <= t_s)
            row = max(begun, key=lambda row: row.from_s)
            where = f"{row.place} ({row.text})"
            raise InputError(f"{where}: {error}").plainly(f"{where}: {error.plain}") from error


@in_planning_time()
def compile_program(
    program: Program, robot: Robot, findings: Findings | None = None, *, drives: MakeDrives | None = None
) -> CompiledProgram:
    """Return a program's motion for a robot; `drives` makes the limits of its motors, for a program that needs them.

    Without `findings` it raises InputError for errors; speeds are left to the planner, which can stretch the motion.
    With them it continues and collects all errors, including steps that are too fast. An error in a repetition is
    reported once, without its consequences: where the robot's position is unknown, nothing is judged until the next
    `go` with a complete position.
    """
    found = Findings() if findings is None else findings
    own_robot = None
    with found.collecting():
        check_own_robot(program, robot)
        own_robot = robot
    checked = check_names(program, own_robot, found)
    positions = {name: at for name, at in checked.positions.items() if at is not None}
    pallets = {name: pallet for name, pallet in checked.pallets.items() if pallet is not None}
    limits = None
    with found.collecting():
        limits = None if program.limits is None else program.limits.drives(robot, drives)
    walk = _Walk(robot, Moves(robot, positions, pallets=pallets, drives=limits))
    for name, pallet in pallets.items():
        check_planning_time()
        with found.collecting(f"pallets.{name}: "):
            if own_robot is not None:
                check_cells(robot, pallet)
    with found.collecting():
        if own_robot is not None:
            walk.make(checked)
    found.messages.extend(walk.complaints.messages())
    with found.collecting():
        if not found.messages and not walk.has_moved:
            raise InputError("the program does not move, switch or wait")
        if not found.messages and limits and not any(row.drives for row in walk.rows):
            raise InputError("limits: from = 'motors' is for steps with law = 'fastest', and this program has none")
    compiled = walk.compiled(program.expects, is_whole=not found.messages)
    if findings is None:
        found.raise_first()
    else:
        found.messages.extend(compiled.fast_steps())
    return compiled


_NAMED_CELLS: Final = 4
"""Number of cells that a message names; the others are counted."""


def check_cells(robot: Robot, pallet: Pallet) -> None:
    """Raise InputError, with the cells, if a cell of a pallet is out of reach on all branches.

    Cells with missing coordinates depend on the position before; only their steps are checked.
    """
    kinematics = make_kinematics(robot)
    task = kinematics.task
    unknown_pose = (nan,) * task.width
    poses = np.array([task.changed(unknown_pose, cell.coordinates, cell.orientation) for cell in pallet.cells])
    known = poses[:, :3] if kinematics.attitude_follows else poses
    if np.isnan(known).any():
        return
    branches = kinematics.inverse(poses)
    far = np.flatnonzero(~np.logical_or.reduce([branch.reachable for branch in branches])).tolist()
    if far:
        names = ", ".join(pallet.labels[i] for i in far[:_NAMED_CELLS])
        more = f" and {len(far) - _NAMED_CELLS} more" if len(far) > _NAMED_CELLS else ""
        reason = branches[0].reason(far[0])
        raise InputError(f"{len(far)} of {len(poses)} cells are out of reach, {names}{more}: {reason}")


def _more_words(count: int) -> str:
    return f"; {count} more {'steps are' if count > 1 else 'step is'} too fast" if count else ""


class _Gathered(NamedTuple):
    """A step without a row yet; `has_leg` is False for a blended step without motion."""

    place: Place
    step: Step
    before: Moves
    has_leg: bool = True


class _Walk:
    """Makes the steps of a program in order."""

    def __init__(self, robot: Robot, moves: Moves) -> None:
        self.complaints = Complaints()
        self._robot = robot
        self._moves = moves
        self._known = True
        """True if the robot's position is known."""
        self._on_branch = True
        """True if the robot is at least on the branch of its last known position."""
        self.rows: list[StepRow] = []
        self._gathered: list[_Gathered] = []
        """Blended steps that have no times yet."""

    def compiled(self, expects: Mapping[str, Any], *, is_whole: bool) -> CompiledProgram:
        """Return the result so far."""
        motion, rows = self._moves.composer.sequence(expects), tuple(self.rows)
        if not is_whole or not self.has_moved or not (changed := changed_motion(self._robot, motion)):
            return CompiledProgram(motion, rows, is_whole)
        return CompiledProgram(motion, tuple(row.changed(changed.later_s) for row in rows), is_whole, changed)

    @property
    def has_moved(self) -> bool:
        """True if there is any motion, switching or wait."""
        return self._moves.composer.now_s > 0

    def make(self, program: Program) -> None:
        """Make a program's steps; raise InputError if its start is invalid or there are too many steps."""
        self._begin(program)
        for count, written in enumerate(written_out(program)):
            if count >= STEPS_MAX:
                raise InputError(f"{written.place}: a program has at most {STEPS_MAX} steps, repetitions written out")
            with planning_step(f"{written.place} ({written.step})"):
                check_planning_time()
                self._take(written)
        self._end_flow()

    def _begin(self, program: Program) -> None:
        self._known = self._on_branch = program.starts
        if program.starts and program.start is not None:
            self._known = self._on_branch = False
            with prefixed("start: "):
                joints = self._moves.joints_at(program.start)
                self._stand_at(joints)
                self._check_within(joints)

    def _stand_at(self, joints: FloatArray) -> None:
        self._moves.composer.joints = joints
        self._known = self._on_branch = True

    def _check_within(self, joints: FloatArray) -> None:
        check_all(*(partial(checks.check_within, *each) for each in zip(self._robot.joints, joints, strict=True)))

    def _take(self, written: Written) -> None:
        place, step, self._moves.cells = written
        if isinstance(step, WrongStep):
            self._end_flow()
            if step.moves:
                self._known = self._on_branch = False
        elif self._known:
            self._add(place, step)
        elif isinstance(step, GoStep) and self._moves.says_everything(step.go):
            self._resume(place, step)
        else:
            self._on_branch = self._on_branch and self._keeps_branch(step)

    def _keeps_branch(self, step: Step) -> bool:
        """Return whether the arm is on the same branch after a step."""
        match step:
            case GoStep(go):
                return not self._moves.says_branch(go)
            case JointsBy():
                return False
        return True

    def _resume(self, place: Place, step: GoStep) -> None:
        """Continue after a step with an unknown start, if its end is known."""
        try:
            if self._on_branch or self._moves.says_branch(step.go):
                self._stand_after(step)
                self._check_within(self._moves.composer.joints)
            else:
                self._moves.check_some_branch(step.go)
        except InputError as error:
            self.complaints.add(place, step, error)
            self._on_branch = self._known or (self._on_branch and self._keeps_branch(step))

    def _add(self, place: Place, step: Step) -> None:
        moves = self._moves
        if not step.moves:
            self._end_flow()
        before, from_s, legs = moves.from_here(), moves.composer.now_s, len(moves.legs or ())
        moves.place = str(place)
        self.complaints.judge(place)
        try:
            step.add_to(moves)
        except CornerError as error:
            self._gathered.append(_Gathered(place, step, before))
            self._complain_of(error)
        except InputError as error:
            self._fail(place, step, error)
        else:
            if moves.legs:
                self._gathered.append(_Gathered(place, step, before, has_leg=len(moves.legs) > legs))
            elif moves.leg_times:
                own = sum(step.has_leg for step in self._gathered)
                self._gathered.append(_Gathered(place, step, before, has_leg=len(moves.leg_times) > own))
                self._add_gathered()
            else:
                part = moves.composer.motion_since(from_s) if step.moves else None
                notes: tuple[str | OutputChange, ...] = (*moves.notes, *moves.switched)
                moves.notes, moves.switched = (), ()
                way: BranchesOnWay = ("", ())
                if part is not None and isinstance(part.law, ToolMove):
                    way = part.law.branch, tuple((from_s + t_s, name) for t_s, name in part.law.changes)
                made = self._made(_Gathered(place, step, before), part, from_s)
                self.rows.append(StepRow(made, from_s, moves.composer.now_s - from_s, *way, notes))

    def _fail(self, place: Place, step: Step, error: InputError) -> None:
        """Continue after an impossible step; steps blended with it have no motion."""
        self._gathered.clear()
        self.complaints.add(place, step, error)
        self._known = False
        self._on_branch = self._keeps_branch(step)
        with Findings().collecting():
            self._stand_after(step)
        self._moves.forget_flow()

    def _end_flow(self) -> None:
        """Bring blended steps to rest before a step that begins at rest."""
        try:
            with planning_step(self._flow_words):
                self._moves.end_flow()
        except CornerError as error:
            self._complain_of(error)
        self._add_gathered()

    @property
    def _flow_words(self) -> str:
        """The first and the last blended step, as text for errors."""
        places = [each.place.number for each in self._gathered]
        return f"steps {places[0]} to {places[-1]}, which flow into each other" if places else "the program"

    def _complain_of(self, error: CornerError) -> None:
        """Report a corner that cannot be rounded at the step that ends there."""
        steps = [step for step in self._gathered if step.has_leg]
        self.complaints.add(steps[error.corner].place, steps[error.corner].step, error)
        self._gathered.clear()

    def _add_gathered(self) -> None:
        """Add rows for the steps that were blended, at their final times."""
        times, now_s = iter(self._moves.leg_times), self._moves.composer.now_s
        for each in self._gathered:
            time = next(times) if each.has_leg else None
            if time is None:
                self.rows.append(StepRow(self._made(each, None, now_s), now_s, 0.0))
            else:
                made, duration_s = self._made(each, time.motion, time.from_s), round(time.until_s - time.from_s, 3)
                self.rows.append(StepRow(made, time.from_s, duration_s, *time.branches, time.notes, time.drives))
        self._gathered.clear()
        self._moves.leg_times = []

    def _made(self, gathered: _Gathered, part: Motion | None, from_s: float) -> MadeStep:
        """Return a step as it was made; report joints beyond their limits on its part of the motion."""
        made = MadeStep(self._robot, gathered.place, gathered.step, gathered.before, round(1000 * from_s), part)
        if part is not None and not (isinstance(part.law, ToolMove) and part.law.keeps_limits):
            self._check_positions(made, part)
        return made

    def _stand_after(self, step: Step) -> None:
        """Continue from the end of a step without making it; raise InputError if that is impossible."""
        end = step.end(self._moves)
        if end is not None:
            self._stand_at(end)

    def _check_positions(self, made: MadeStep, part: Motion) -> None:
        """Report each joint beyond its limits, except those that an earlier step has left outside."""
        start, step = made.before.composer.joints, made.step
        ends = part.positions(np.array([part.duration_s]))[0].tolist()
        for i, joint in enumerate(self._robot.joints):
            if checks.is_outside(joint, start[i]):
                end = ends[i]
                if (
                    isinstance(step, JointsBy | ToolBy)
                    or abs(end - start[i]) <= NO_WAY
                    or not checks.is_outside(joint, end)
                ):
                    continue
            try:
                made.positions.check_joint(i)
            except InputError as error:
                self.complaints.add(made.place, step, error)
