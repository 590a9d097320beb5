"""Check the names in a program's steps: positions, joints, branches, outputs, inputs and sequences.

Every step is checked once, even in unused sequences, without being made. So steps after an invalid one, or of a program
with an invalid robot, are checked, too.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.common.findings import Findings, UnreadError
from steptwin.host.planning.motions.composer import require_input, require_output
from steptwin.host.planning.programs.moves import check_steps
from steptwin.host.planning.programs.paces import ToolPace
from steptwin.host.planning.programs.positions import Beside, JointPosition, Position, Target, ToolPosition
from steptwin.host.planning.programs.program import AnyStep, Call, Each, Program, Repeat, WrongStep, visited
from steptwin.host.planning.programs.steps import Step
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

CALLS_DEEP_MAX: Final = 50
"""Deepest nesting of sequence calls."""


@dataclass(frozen=True, slots=True)
class Names:
    """Names that the steps of a program may use; without a robot, names of the robot are not checked.

    Every method raises InputError for an unknown name, UnreadError for one with an invalid definition.
    """

    program: Program
    robot: Robot | None

    def target(self, target: Target) -> None:
        """Check a position, an offset from one, or the name of one."""
        if isinstance(target, Beside):
            if target.cell:
                self.pallet(target.cell)
            else:
                self.target(target.at)
        elif not isinstance(target, str):
            self.position(target)
        elif self.program.positions.get(target) is None:
            if target not in self.program.positions and self.program.has_all_names:
                raise unknown("position", target, self.program.positions)
            raise UnreadError

    def pallet(self, name: str) -> None:
        """Check the name of a pallet."""
        if self.program.pallets.get(name) is None:
            if name not in self.program.pallets and self.program.has_all_names:
                raise unknown("pallet", name, self.program.pallets)
            raise UnreadError

    def position(self, position: Position) -> None:
        """Check the joints or the branch of a position."""
        match position:
            case JointPosition(joints):
                self.joints(joints)
            case ToolPosition(coordinates, branch, orientation):
                self.branch(branch)
                if self.robot is not None:
                    make_kinematics(self.robot).task.check(coordinates, orientation)

    def joints(self, names: Iterable[str]) -> None:
        """Check names of joints."""
        for name in names:
            if self.robot is not None:
                self.robot.index_of(name)

    def branch(self, name: str | None) -> None:
        """Check the name of a branch of the inverse kinematics, or None."""
        if self.robot is not None and name is not None:
            branches = make_kinematics(self.robot).branches
            if name not in branches:
                raise unknown("branch", name, branches)

    def steps(self, distances: Mapping[str, float]) -> None:
        """Check that the tool can be moved by these distances and angles."""
        if self.robot is not None:
            check_steps(self.robot, distances)

    def output(self, name: str) -> None:
        """Check the name of a digital output."""
        if self.robot is not None:
            require_output(self.robot, name)

    def input(self, name: str) -> None:
        """Check the name of a digital input."""
        if self.robot is not None:
            require_input(self.robot, name)


def check_names(program: Program, robot: Robot | None, findings: Findings) -> Program:
    """Return the program with a WrongStep for each step with an unknown name; these are the findings."""
    return _Checking(program, robot, findings).checked()


class _Checking:
    def __init__(self, program: Program, robot: Robot | None, findings: Findings) -> None:
        self._findings = findings
        self._robot = robot
        self._names = Names(program, robot)
        self._program = self._with_checked_positions(program)
        self._names = Names(self._program, robot)
        self._sequences: dict[str, tuple[AnyStep, ...]] = {}
        self._depths: dict[str, int] = {}
        """Depth of calls below each sequence."""

    def checked(self) -> Program:
        program = self._program
        starts = program.starts and (program.start is None or self._is_right(program.start))
        steps = self._steps(program.steps, "step ", ())
        self._check_expected(program.expects)
        for name in program.sequences:
            self._visit(name, ())
        return replace(program, starts=starts, steps=steps, sequences=self._sequences)

    def _check_expected(self, expects: Mapping[str, Any]) -> None:
        """Let features judge the values of their keys; without a robot nothing is known of them."""
        for feature, keys in giving("program_keys"):
            for key in keys():
                if key in expects and self._robot is not None and feature.check_program is not None:
                    with self._findings.collecting():
                        feature.check_program(self._robot, key, expects[key])

    def _with_checked_positions(self, program: Program) -> Program:
        positions: dict[str, Position | None] = {}
        for name, position in program.positions.items():
            positions[name] = None
            with self._findings.collecting(f"position {name!r}: "):
                if position is not None:
                    self._names.position(position)
                    positions[name] = position
        return replace(program, positions=positions)

    def _is_right(self, start: Target) -> bool:
        with self._findings.collecting("start: "):
            self._names.target(start)
            return True
        return False

    def _visit(self, name: str, callers: tuple[str, ...]) -> None:
        """Check the steps of a sequence once."""
        if name not in self._sequences:
            self._depths[name] = 1
            steps = self._program.sequences[name] or ()
            self._sequences[name] = self._steps(steps, f"sequences.{name} step ", (*callers, name))

    def _steps(self, steps: tuple[AnyStep, ...], place: str, callers: tuple[str, ...]) -> tuple[AnyStep, ...]:
        return tuple(self._step(step, f"{place}{number}", callers) for number, step in enumerate(steps, 1))

    def _step(self, step: AnyStep, place: str, callers: tuple[str, ...]) -> AnyStep:
        match step:
            case Repeat(times, inner):
                return Repeat(times, self._steps(inner, f"{place}.", callers))
            case Each():
                return self._each(step, place, callers)
            case Call(name):
                with self._findings.collecting(f"{place}: "):
                    return step if self._can_call(name, callers) else WrongStep(moves=True)
            case WrongStep():
                return step
        return self._single(step, place) if not isinstance(step, Call) else WrongStep(moves=True)

    def _single(self, step: Step, place: str) -> AnyStep:
        with self._findings.collecting(f"{place} ({step}): "):
            for target in step.targets:
                self._names.target(target)
            step.check(self._names)
            if isinstance(step, ToolPace):
                for change in step.outputs:
                    self._names.output(change.output)
            return step
        return WrongStep(step.moves)

    def _each(self, each: Each, place: str, callers: tuple[str, ...]) -> AnyStep:
        checked = replace(each, steps=self._steps(each.steps, f"{place}.", callers))
        with self._findings.collecting(f"{place}: "):
            for name in each.each:
                self._names.pallet(name)
            visited(self._program, checked)
            return checked
        return WrongStep(moves=True)

    def _can_call(self, name: str, callers: tuple[str, ...]) -> bool:
        """Check a sequence and return whether it has steps; raise InputError if it cannot be called here."""
        sequences = self._program.sequences
        if name not in sequences:
            if self._program.has_all_names:
                raise unknown("sequence", name, sequences)
            return False
        if name in callers:
            raise InputError(f"call: the sequence {name!r} calls itself")
        if len(callers) < CALLS_DEEP_MAX:
            self._visit(name, callers)
        if len(callers) + self._depths.get(name, 1) > CALLS_DEEP_MAX:
            raise InputError(f"call: more than {CALLS_DEEP_MAX} sequences call one another in a row")
        if callers:
            self._depths[callers[-1]] = max(self._depths[callers[-1]], self._depths[name] + 1)
        return bool(sequences[name])
