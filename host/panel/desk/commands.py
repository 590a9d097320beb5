"""What a page may ask the desk to do: commands, which run to their end, and jogs, which run while a button is held.

Positions and distances are in mm and degrees, speeds in mm/s and deg/s, parts of the highest speeds in percent.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from steptwin.host.operate.stepping import STEP_SPEED_PERCENT
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.programs.positions import ToolPosition


@dataclass(frozen=True, slots=True)
class Command:
    """A command of the operator."""


class Order(NamedTuple):
    """A command, and the number of the newest state that its page had shown."""

    command: Command
    shown: int


@dataclass(frozen=True, slots=True)
class Enable(Command):
    """Switch every drive on; they hold their positions."""


@dataclass(frozen=True, slots=True)
class Disable(Command):
    """Switch every drive off."""


@dataclass(frozen=True, slots=True)
class HomeAll(Command):
    """Find every joint's position by its switches, then move to the home position."""

    together: bool = False
    """True homes all joints at once, False one after the other."""


@dataclass(frozen=True, slots=True)
class HomeJoint(Command):
    """Find one joint's position by its switches, then move it to its home position."""

    joint: str


@dataclass(frozen=True, slots=True)
class DeclareHere(Command):
    """Say where the standing machine is; nothing moves."""

    joints: tuple[float, ...]
    """Position of every joint, in the robot's order."""


@dataclass(frozen=True, slots=True)
class StepJoint(Command):
    """Move one joint by a distance with a sign."""

    joint: str
    distance: float
    speed_percent: float = STEP_SPEED_PERCENT


@dataclass(frozen=True, slots=True)
class StepTool(Command):
    """Move the tool by distances along x, y, z of the world, or turn it by phi, by name."""

    distances: Mapping[str, float]
    speed_percent: float = STEP_SPEED_PERCENT


@dataclass(frozen=True, slots=True)
class MoveJoints(Command):
    """Move joints to positions, by name; the others stay. All arrive together."""

    joints: Mapping[str, float]
    speed_percent: float = 100.0


@dataclass(frozen=True, slots=True)
class MoveTool(Command):
    """Move the tool to a pose, of which coordinates may be left out, on the branch that the position names."""

    position: ToolPosition
    speed_percent: float = 100.0


@dataclass(frozen=True, slots=True)
class RunMotion(Command):
    """Run a plan, made for `Desk.robot`."""

    plan: Plan
    name: str
    repeat: int = 1
    approach: bool = False
    """True moves to the plan's start first."""


@dataclass(frozen=True, slots=True)
class SwitchOutput(Command):
    """Switch a digital output by its name in the robot's file."""

    output: str
    on: bool


@dataclass(frozen=True, slots=True)
class ResetFaults(Command):
    """Reset the drives' faults, and end an emergency stop; the drives are off afterwards."""


@dataclass(frozen=True, slots=True)
class WriteSettings(Command):
    """Write settings: values by `Setting.key`."""

    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class JointJog:
    """Move one joint at a speed with a sign, for as long as the button is held."""

    joint: str
    speed: float

    @property
    def name(self) -> str:
        """What is jogged."""
        return self.joint


@dataclass(frozen=True, slots=True)
class ToolJog:
    """Move the tool along x, y or z of the world, or turn it by phi, for as long as the button is held."""

    coordinate: str
    speed: float
    """In mm/s or deg/s, with a sign."""

    @property
    def name(self) -> str:
        """What is jogged."""
        return self.coordinate


Jog = JointJog | ToolJog
