"""The steps of a program: each is data, says itself in words and adds itself to the moves."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from steptwin.host.planning.paths import Smoothing
from steptwin.host.planning.programs.moves import Moves
from steptwin.host.planning.programs.paces import JointPace, ToolPace
from steptwin.host.planning.programs.positions import JointPosition, Target, ToolPosition


class Step(Protocol):
    """A step that moves, switches or waits."""

    def __str__(self) -> str:
        """Return the step in a few words, such as `line to tray`."""
        ...

    def add_to(self, moves: Moves) -> None:
        """Add the step to the moves; raise InputError if the robot cannot make it."""
        ...


@dataclass(frozen=True, slots=True)
class Go:
    """Move all joints to a position, together; with `branch` the tool's position is reached on that branch."""

    to: Target
    pace: JointPace

    def __str__(self) -> str:
        return f"go to {_words(self.to)}"

    def add_to(self, moves: Moves) -> None:
        moves.go(moves.joints_at(self.to), self.pace)


@dataclass(frozen=True, slots=True)
class Line:
    """Move the tool straight to a position, on the branch on which the arm is."""

    to: Target
    pace: ToolPace

    def __str__(self) -> str:
        return f"line to {_words(self.to)}"

    def add_to(self, moves: Moves) -> None:
        moves.line(moves.pose_at(self.to), self.pace)


@dataclass(frozen=True, slots=True)
class Arc:
    """Move the tool along the arc from where it is, through a position, to a position."""

    via: Target
    to: Target
    pace: ToolPace

    def __str__(self) -> str:
        return f"arc by {_words(self.via)} to {_words(self.to)}"

    def add_to(self, moves: Moves) -> None:
        moves.arc(moves.pose_at(self.via), moves.pose_at(self.to), self.pace)


@dataclass(frozen=True, slots=True)
class Circle:
    """Move the tool around a vertical axis, in degrees counter-clockwise; `turned` turns the tool along."""

    x_mm: float
    y_mm: float
    sweep_deg: float
    turned: bool
    pace: ToolPace

    def __str__(self) -> str:
        return f"circle of {self.sweep_deg:g} deg around x {self.x_mm:g}, y {self.y_mm:g}"

    def add_to(self, moves: Moves) -> None:
        moves.circle(self.x_mm, self.y_mm, self.sweep_deg, self.pace, turned=self.turned)


@dataclass(frozen=True, slots=True)
class Through:
    """Move the tool on a smooth curve from where it is through positions, without stopping."""

    targets: tuple[Target, ...]
    smoothing: Smoothing
    pace: ToolPace

    def __str__(self) -> str:
        return f"through {', '.join(map(_words, self.targets))}"

    def add_to(self, moves: Moves) -> None:
        moves.through([moves.pose_at(target) for target in self.targets], self.smoothing, self.pace)


@dataclass(frozen=True, slots=True)
class JointsBy:
    """Move some joints by distances, in mm and degrees."""

    joints: Mapping[str, float]
    pace: JointPace

    def __str__(self) -> str:
        return f"by {_numbers(self.joints)}"

    def add_to(self, moves: Moves) -> None:
        moves.go(moves.joints_by(self.joints), self.pace)


@dataclass(frozen=True, slots=True)
class ToolBy:
    """Move the tool straight by distances along the world's axes in mm, and turn it by phi degrees."""

    coordinates: Mapping[str, float]
    pace: ToolPace

    def __str__(self) -> str:
        return f"by {_numbers(self.coordinates)}"

    def add_to(self, moves: Moves) -> None:
        moves.line(moves.pose_by(self.coordinates), self.pace)


@dataclass(frozen=True, slots=True)
class Output:
    """Stand still while a digital output changes."""

    name: str
    on: bool

    def __str__(self) -> str:
        return f"output {self.name} {'on' if self.on else 'off'}"

    def add_to(self, moves: Moves) -> None:
        moves.composer.switch(self.name, on=self.on)


@dataclass(frozen=True, slots=True)
class Wait:
    """Stand still until a digital input has a level; a wait beyond the time-out ends the motion."""

    name: str
    on: bool
    timeout_s: float

    def __str__(self) -> str:
        return f"wait for {self.name} {'on' if self.on else 'off'}"

    def add_to(self, moves: Moves) -> None:
        moves.composer.wait(self.name, on=self.on, timeout_s=self.timeout_s, place=moves.place)


@dataclass(frozen=True, slots=True)
class Pause:
    """Stand still for a time."""

    duration_s: float

    def __str__(self) -> str:
        return f"pause of {self.duration_s:g} s"

    def add_to(self, moves: Moves) -> None:
        moves.composer.pause(self.duration_s)


def _words(target: Target) -> str:
    match target:
        case JointPosition(joints):
            return _numbers(joints)
        case ToolPosition(coordinates, branch):
            return _numbers(coordinates) + (f" ({branch})" if branch else "")
        case name:
            return name


def _numbers(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in values.items())
