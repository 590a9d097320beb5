"""The steps of a program: each is a table of its file, says itself in words and adds itself to the moves."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, TypeGuard

from pydantic import BeforeValidator, Discriminator, Tag

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_errors import wrong
from steptwin.host.common.file_models import FileReading, FileTable
from steptwin.host.common.file_values import ReadBy, Within
from steptwin.host.common.tables import Table
from steptwin.host.planning.motions.composer import WAIT_MAX_S
from steptwin.host.planning.paths import Smoothing
from steptwin.host.planning.programs.moves import Moves
from steptwin.host.planning.programs.paces import JointPace, ToolPace
from steptwin.host.planning.programs.positions import (
    AnyTarget,
    Beside,
    JointPosition,
    Target,
    ToolPosition,
    position_schema,
    read_position,
)
from steptwin.host.robots.poses import ORIENTATIONS, STEP_NAMES

if TYPE_CHECKING:
    from steptwin.host.planning.programs.names import Names

SWEEP_MAX_DEG: Final = 36_000.0
"""Largest sweep of a circle: a hundred turns."""


class StepTable(FileTable):
    """Base of the models of steps."""

    __slots__ = ()
    suffixes: ClassVar[tuple[str, ...]] = ()
    """Usual endings of the files that the verb names; empty if it names none."""


@dataclass(frozen=True, slots=True)
class Step(StepTable, ABC):
    """A step that moves, switches or waits."""

    moves: ClassVar[bool] = False
    """True if the robot is elsewhere after it."""

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys by which it becomes slower; empty for a step at standstill."""
        return ()

    @abstractmethod
    def __str__(self) -> str:
        """Return the step in a few words, such as `line to tray`."""

    @property
    def targets(self) -> tuple[Target, ...]:
        """The positions through which it leads, in their order."""
        return ()

    def check(self, names: "Names") -> None:
        """Raise InputError for the names in the step, beside those of its targets, that are unknown."""

    @abstractmethod
    def add_to(self, moves: Moves) -> None:
        """Add the step to the moves; raise InputError if the robot cannot make it."""

    def end(self, moves: Moves) -> FloatArray | None:
        """Return the joints after the step, of shape (joints,), if known without making it.

        Raises InputError if the robot cannot be there.
        """
        return moves.joints_of(moves.pose_at(self.targets[-1])) if self.targets else moves.composer.joints


@dataclass(frozen=True, slots=True)
class GoStep(JointPace, Step):
    """Move all joints to a position, together.

    Attributes:
        go: the position; with `branch` the tool's position is reached on that branch.
    """

    go: AnyTarget

    def __str__(self) -> str:
        return f"go to {_words(self.go)}"

    @property
    def targets(self) -> tuple[Target, ...]:
        return (self.go,)

    def add_to(self, moves: Moves) -> None:
        moves.go(moves.joints_at(self.go), self)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.joints_at(self.go)


@dataclass(frozen=True, slots=True)
class LineStep(ToolPace, Step):
    """Move the tool straight to a position, on the branch on which the arm is.

    Attributes:
        line: the position.
    """

    line: AnyTarget

    def __str__(self) -> str:
        return f"line to {_words(self.line)}"

    @property
    def targets(self) -> tuple[Target, ...]:
        return (self.line,)

    def add_to(self, moves: Moves) -> None:
        moves.line(moves.pose_at(self.line), self)


@dataclass(frozen=True, slots=True)
class ArcTargets(FileTable):
    """The positions of an arc from where the tool is.

    Attributes:
        via: position on its way.
        to: position at its end.
    """

    via: AnyTarget
    to: AnyTarget


@dataclass(frozen=True, slots=True)
class ArcStep(ToolPace, Step):
    """Move the tool along an arc.

    Attributes:
        arc: the positions through which it leads.
    """

    arc: ArcTargets

    def __str__(self) -> str:
        return f"arc by {_words(self.arc.via)} to {_words(self.arc.to)}"

    @property
    def targets(self) -> tuple[Target, ...]:
        return self.arc.via, self.arc.to

    def add_to(self, moves: Moves) -> None:
        moves.arc(moves.pose_at(self.arc.via), moves.pose_at(self.arc.to), self)


@dataclass(frozen=True, slots=True)
class Centre(FileTable):
    """The vertical axis of a circle.

    Attributes:
        x: its x in mm.
        y: its y in mm.
    """

    x: float
    y: float


@dataclass(frozen=True, slots=True)
class CircleStep(ToolPace, Step):
    """Move the tool around a vertical axis.

    Attributes:
        circle: the axis.
        sweep_deg: angle, counter-clockwise, up to a hundred turns.
        turned: true if the tool turns along.
    """

    circle: Centre
    sweep_deg: float = 360.0
    turned: bool = False

    def __post_init__(self) -> None:
        ToolPace.__post_init__(self)
        if not 0 < abs(self.sweep_deg) <= SWEEP_MAX_DEG:
            raise InputError(
                f"sweep_deg: {self.sweep_deg:g} deg is not a sweep of up to {SWEEP_MAX_DEG:g} deg, with a sign"
            )

    def __str__(self) -> str:
        return f"circle of {self.sweep_deg:g} deg around x {self.circle.x:g}, y {self.circle.y:g}"

    def add_to(self, moves: Moves) -> None:
        moves.circle(self.circle.x, self.circle.y, self.sweep_deg, self, turned=self.turned)

    def end(self, moves: Moves) -> FloatArray | None:
        closed = self.sweep_deg % 360.0 == 0 and not self.turned
        return moves.composer.joints if closed else None


@dataclass(frozen=True, slots=True)
class ThroughStep(ToolPace, Step):
    """Move the tool on a smooth curve from where it is through positions, without stopping.

    Attributes:
        through: the positions.
        smoothing: kind of curve.
    """

    through: tuple[AnyTarget, ...]
    smoothing: Smoothing = Smoothing.C2_SPLINE

    def __str__(self) -> str:
        return f"through {', '.join(map(_words, self.through))}"

    @property
    def targets(self) -> tuple[Target, ...]:
        return self.through

    def add_to(self, moves: Moves) -> None:
        moves.through([moves.pose_at(target) for target in self.through], self.smoothing, self)


_Distances = ReadBy(lambda value, _: read_position(Table(value, "table")), position_schema)


@dataclass(frozen=True, slots=True)
class JointsBy(JointPace, Step):
    """Move some joints by distances.

    Attributes:
        by: the distances in mm and degrees.
    """

    by: Annotated[JointPosition, _Distances]

    def __str__(self) -> str:
        return f"by {_numbers(self.by.joints)}"

    def check(self, names: "Names") -> None:
        names.joints(self.by.joints)

    def add_to(self, moves: Moves) -> None:
        moves.go(moves.joints_by(self.by.joints), self)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.joints_by(self.by.joints)


@dataclass(frozen=True, slots=True)
class ToolBy(ToolPace, Step):
    """Move the tool straight, and turn it by phi, or by rx, ry and rz.

    Attributes:
        by: the distances along the world's axes in mm, and the angles in degrees.
    """

    by: Annotated[ToolPosition, _Distances]

    def __post_init__(self) -> None:
        ToolPace.__post_init__(self)
        if self.by.branch is not None:
            raise InputError("by.branch: a relative move keeps the branch")
        if self.by.orientation is not None:
            raise InputError(f"by.{self.by.orientation.key}: a relative move turns by rx, ry, rz, in degrees")

    def __str__(self) -> str:
        return f"by {_numbers(self.by.coordinates)}"

    def check(self, names: "Names") -> None:
        names.steps(self.by.coordinates)

    def add_to(self, moves: Moves) -> None:
        moves.line(moves.pose_by(self.by.coordinates), self)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.joints_of(moves.pose_by(self.by.coordinates))


def _kind_of_by(table: Mapping[str, Any]) -> str:
    by = table["by"]
    return "tool" if isinstance(by, dict) and by.keys() & {*STEP_NAMES, *ORIENTATIONS} else "joints"


_By = Annotated[Annotated[JointsBy, Tag("joints")] | Annotated[ToolBy, Tag("tool")], Discriminator(_kind_of_by)]


@dataclass(frozen=True, slots=True)
class OutputStep(Step):
    """Stand still while a digital output changes.

    Attributes:
        output: name of the output.
        on: its new level.
    """

    output: str
    on: bool

    def __str__(self) -> str:
        return f"output {self.output} {'on' if self.on else 'off'}"

    def check(self, names: "Names") -> None:
        names.output(self.output)

    def add_to(self, moves: Moves) -> None:
        moves.composer.switch(self.output, on=self.on)


def _is_time(name: object) -> TypeGuard[float]:
    return isinstance(name, int | float) and not isinstance(name, bool)


def _no_time(name: object) -> object:
    if _is_time(name):
        raise wrong(f"{name:g} names no input; a time to stand is `pause = {name:g}`, in seconds")
    return name


@dataclass(frozen=True, slots=True)
class WaitStep(Step):
    """Stand still until a digital input has a level; a wait beyond the time-out ends the motion.

    Attributes:
        wait: name of the input.
        on: the level.
        timeout_s: longest wait.
    """

    wait: Annotated[str, BeforeValidator(_no_time)]
    on: bool
    timeout_s: Annotated[float, Within(0.0, WAIT_MAX_S, "s", open=True)]

    @classmethod
    def missing(cls, key: str, reading: FileReading) -> str:
        """Return what to say of a missing key; nothing where a pause is meant."""
        return "" if _is_time(reading.table["wait"]) else super(WaitStep, cls).missing(key, reading)

    def __str__(self) -> str:
        return f"wait for {self.wait} {'on' if self.on else 'off'}"

    def check(self, names: "Names") -> None:
        names.input(self.wait)

    def add_to(self, moves: Moves) -> None:
        moves.composer.wait(self.wait, on=self.on, timeout_s=self.timeout_s, place=moves.place)


@dataclass(frozen=True, slots=True)
class PauseStep(Step):
    """Stand still for a time.

    Attributes:
        pause: the time in seconds, in whole milliseconds.
    """

    pause: float

    def __post_init__(self) -> None:
        if whole_ms("pause", self.pause) < 1:
            raise InputError(f"pause: {self.pause:g} s is not at least 0.001 s")

    def __str__(self) -> str:
        return f"pause of {self.pause:g} s"

    def add_to(self, moves: Moves) -> None:
        moves.composer.pause(self.pause)


VERBS: Final[Mapping[str, Any]] = {
    "go": GoStep,
    "line": LineStep,
    "arc": ArcStep,
    "circle": CircleStep,
    "through": ThroughStep,
    "by": _By,
    "output": OutputStep,
    "wait": WaitStep,
    "pause": PauseStep,
}
"""The models of the steps by their verbs."""


def _words(target: Target) -> str:
    match target:
        case JointPosition(joints):
            return _numbers(joints)
        case ToolPosition(branch=branch):
            return target.words + (f" ({branch})" if branch else "")
        case Beside(at, cell, offset):
            return (f"cell of {cell}" if cell else at) + (f" and {_numbers(offset)}" if offset else "")
        case name:
            return name


def _numbers(values: Mapping[Any, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in values.items())
