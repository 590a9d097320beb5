"""Interface of the feature that times whole motions as fast as limits allow."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.robots.robot import Robot

if TYPE_CHECKING:
    from steptwin.host.planning.motion import Motion
    from steptwin.host.planning.motions.composer import Composer
    from steptwin.host.planning.paths import ToolPath
    from steptwin.host.planning.programs.flow import LegTime
    from steptwin.host.planning.programs.paces import StepPace, ToolPace

FASTEST: Final = "fastest"
"""Value of `law` for such a timing."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Limits of a piece of a path.

    Attributes:
        percent: percentage of the limits of joints and axes, above 0 and up to 100.
        tool_mm_s: highest speed of the tool; infinite for no limit.
        tool_deg_s: highest rotation speed of the tool; infinite for no limit.
    """

    percent: float = 100.0
    tool_mm_s: float = np.inf
    tool_deg_s: float = np.inf


class CornerError(InputError):
    """A corner cannot be rounded as requested; `corner` is its number in the motion, from 0 on."""

    def __init__(self, corner: int, message: str) -> None:
        super().__init__(message)
        self.corner = corner


class FlowingSteps(Protocol):
    """Legs of a blended motion under construction."""

    @property
    def start(self) -> FloatArray:
        """Joints of shape (joints,) at the start of the first leg."""
        ...

    @property
    def is_open(self) -> bool:
        """True if the last leg is blended with a next one."""
        ...

    def __len__(self) -> int:
        """Return the number of legs."""
        ...

    def add_joints(self, here: FloatArray, goal: FloatArray, pace: "StepPace") -> FloatArray:
        """Add a move of all joints from `here` to a position; return the joints at its end."""
        ...

    def add_path(self, here: FloatArray, path: "ToolPath", branch: str, pace: "ToolPace") -> FloatArray:
        """Add a path of the tool from `here` on a branch; return the joints at its end."""
        ...

    def make(self, composer: "Composer") -> "list[LegTime]":
        """Add the motion of all legs to a composer, which is at their start; return the time of each leg.

        Raises:
            CornerError: a corner cannot be rounded.
        """
        ...


class MotionTimer(Protocol):
    """Times whole motions as fast as the limits of joints, axes and drives allow."""

    def again(self, robot: Robot, motion: "Motion", drives: DriveLimits | None = None) -> "Motion":
        """Return the fastest motion along the path of another motion; raise InputError if there is none."""
        ...

    def flow(self, robot: Robot, start: FloatArray, drives: DriveLimits | None) -> FlowingSteps:
        """Return an empty blended motion that begins at joints of shape (joints,)."""
        ...


def has_timer() -> bool:
    """Return whether a feature times whole motions."""
    return bool(giving("timer"))


def motion_timer() -> MotionTimer:
    """Return the timer of whole motions; raise InputError if no feature has one."""
    for _, make in giving("timer"):
        timer: MotionTimer = make()
        return timer
    raise InputError(f"law={FASTEST} and blend_mm are not installed: no feature times motions as a whole")
