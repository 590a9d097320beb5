"""The steps of a program: data with a text form, which add themselves to the moves."""

from collections.abc import Mapping
from dataclasses import Field, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Final, Protocol

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.composer import check_timeout
from steptwin.host.planning.paths import Smoothing
from steptwin.host.planning.programs.moves import Moves
from steptwin.host.planning.programs.paces import JointPace, StepPace, ToolPace
from steptwin.host.planning.programs.positions import Beside, JointPosition, Target, ToolPosition

if TYPE_CHECKING:
    from steptwin.host.planning.programs.names import Names

SWEEP_MAX_DEG: Final = 36_000.0
"""Largest sweep of a circle: a hundred turns."""


class Step(Protocol):
    """A step that moves, switches or waits."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def pace(self) -> StepPace | None:
        """Pace of the robot; None for a step without motion."""
        ...

    def __str__(self) -> str:
        """Return the step as a short text, such as `line to tray`."""
        ...

    def check(self, names: "Names") -> None:
        """Raise InputError for unknown names in the step."""
        ...

    def add_to(self, moves: Moves) -> None:
        """Add the step to the moves; raise InputError if the robot cannot make it."""
        ...

    def end(self, moves: Moves) -> FloatArray | None:
        """Return the joints after the step, of shape (joints,), if known without making it.

        Raises InputError if the robot cannot be there.
        """
        ...


@dataclass(frozen=True, slots=True)
class GoStep:
    """Move all joints to a position, together; with `branch`, on that branch."""

    to: Target
    pace: JointPace

    def __str__(self) -> str:
        return f"go to {_words(self.to)}"

    def check(self, names: "Names") -> None:
        names.target(self.to)

    def add_to(self, moves: Moves) -> None:
        moves.go(moves.joints_at(self.to), self.pace)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.joints_at(self.to)


@dataclass(frozen=True, slots=True)
class LineStep:
    """Move the tool straight to a position, on the present branch."""

    to: Target
    pace: ToolPace

    def __str__(self) -> str:
        return f"line to {_words(self.to)}"

    def check(self, names: "Names") -> None:
        names.target(self.to)
        names.outputs_of(self.pace)

    def add_to(self, moves: Moves) -> None:
        moves.line(moves.pose_at(self.to), self.pace)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.joints_of(moves.pose_at(self.to))


@dataclass(frozen=True, slots=True)
class ArcStep:
    """Move the tool along the arc from its position through a position to another one."""

    via: Target
    to: Target
    pace: ToolPace

    def __str__(self) -> str:
        return f"arc by {_words(self.via)} to {_words(self.to)}"

    def check(self, names: "Names") -> None:
        names.targets(self.via, self.to)
        names.outputs_of(self.pace)

    def add_to(self, moves: Moves) -> None:
        moves.arc(moves.pose_at(self.via), moves.pose_at(self.to), self.pace)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.joints_of(moves.pose_at(self.to))


@dataclass(frozen=True, slots=True)
class CircleStep:
    """Move the tool around a vertical axis, in degrees counter-clockwise; `turned` turns the tool along.

    Raises InputError for a sweep of 0 or beyond SWEEP_MAX_DEG.
    """

    x_mm: float
    y_mm: float
    sweep_deg: float
    turned: bool
    pace: ToolPace

    def __post_init__(self) -> None:
        if not 0 < abs(self.sweep_deg) <= SWEEP_MAX_DEG:
            raise InputError(
                f"sweep_deg: {self.sweep_deg:g} deg is not a sweep of up to {SWEEP_MAX_DEG:g} deg, with a sign"
            )

    def __str__(self) -> str:
        return f"circle of {self.sweep_deg:g} deg around x {self.x_mm:g}, y {self.y_mm:g}"

    def check(self, names: "Names") -> None:
        names.outputs_of(self.pace)

    def add_to(self, moves: Moves) -> None:
        moves.circle(self.x_mm, self.y_mm, self.sweep_deg, self.pace, turned=self.turned)

    def end(self, moves: Moves) -> FloatArray | None:
        closed = self.sweep_deg % 360.0 == 0 and not self.turned
        return moves.composer.joints if closed else None


@dataclass(frozen=True, slots=True)
class ThroughStep:
    """Move the tool on a smooth curve from its position through positions, without stopping."""

    targets: tuple[Target, ...]
    smoothing: Smoothing
    pace: ToolPace

    def __str__(self) -> str:
        return f"through {', '.join(map(_words, self.targets))}"

    def check(self, names: "Names") -> None:
        names.targets(*self.targets)
        names.outputs_of(self.pace)

    def add_to(self, moves: Moves) -> None:
        moves.through([moves.pose_at(target) for target in self.targets], self.smoothing, self.pace)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.joints_of(moves.pose_at(self.targets[-1])) if self.targets else None


@dataclass(frozen=True, slots=True)
class JointsBy:
    """Move some joints by distances, in mm and degrees."""

    joints: Mapping[str, float]
    pace: JointPace

    def __str__(self) -> str:
        return f"by {_numbers(self.joints)}"

    def check(self, names: "Names") -> None:
        names.joints(self.joints)

    def add_to(self, moves: Moves) -> None:
        moves.go(moves.joints_by(self.joints), self.pace)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.joints_by(self.joints)


@dataclass(frozen=True, slots=True)
class ToolBy:
    """Move the tool straight by distances along the world's axes in mm, and turn it by phi, or by rx, ry and rz."""

    coordinates: Mapping[str, float]
    pace: ToolPace

    def __str__(self) -> str:
        return f"by {_numbers(self.coordinates)}"

    def check(self, names: "Names") -> None:
        names.steps(self.coordinates)
        names.outputs_of(self.pace)

    def add_to(self, moves: Moves) -> None:
        moves.line(moves.pose_by(self.coordinates), self.pace)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.joints_of(moves.pose_by(self.coordinates))


@dataclass(frozen=True, slots=True)
class OutputStep:
    """Change a digital output at standstill."""

    name: str
    on: bool

    pace: ClassVar[None] = None

    def __str__(self) -> str:
        return f"output {self.name} {'on' if self.on else 'off'}"

    def check(self, names: "Names") -> None:
        names.output(self.name)

    def add_to(self, moves: Moves) -> None:
        moves.composer.switch(self.name, on=self.on)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.composer.joints


@dataclass(frozen=True, slots=True)
class WaitStep:
    """Wait at standstill until a digital input has a level; a time-out ends the motion.

    Raises InputError for an invalid time-out.
    """

    name: str
    on: bool
    timeout_s: float

    pace: ClassVar[None] = None

    def __post_init__(self) -> None:
        check_timeout(self.timeout_s)

    def __str__(self) -> str:
        return f"wait for {self.name} {'on' if self.on else 'off'}"

    def check(self, names: "Names") -> None:
        names.input(self.name)

    def add_to(self, moves: Moves) -> None:
        moves.composer.wait(self.name, on=self.on, timeout_s=self.timeout_s, place=moves.place)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.composer.joints


@dataclass(frozen=True, slots=True)
class PauseStep:
    """Pause for a time in whole milliseconds; raises InputError for one that is not above 0."""

    duration_s: float

    pace: ClassVar[None] = None

    def __post_init__(self) -> None:
        if whole_ms("pause", self.duration_s) < 1:
            raise InputError(f"pause: {self.duration_s:g} s is not at least 0.001 s")

    def __str__(self) -> str:
        return f"pause of {self.duration_s:g} s"

    def check(self, names: "Names") -> None:
        pass

    def add_to(self, moves: Moves) -> None:
        moves.composer.pause(self.duration_s)

    def end(self, moves: Moves) -> FloatArray | None:
        return moves.composer.joints


def _words(target: Target) -> str:
    match target:
        case JointPosition(joints):
            return _numbers(joints)
        case ToolPosition(branch=branch):
            return target.words + (f" ({branch})" if branch else "")
        case Beside(of, offset, is_cell):
            return f"{'cell of ' if is_cell else ''}{of}" + (f" and {_numbers(offset)}" if offset else "")
        case name:
            return name


def _numbers(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in values.items())
