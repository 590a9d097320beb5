"""Count the work that a call does; bounds on it hold on a busy machine too, unlike bounds on seconds."""

import sys
from collections.abc import Callable
from types import FrameType

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.trajectory import OutputChange, Trajectory


def function_calls(call: Callable[[], object]) -> int:
    """Return the number of calls of Python and C functions inside a call; a loop over samples would raise it."""
    calls = 0

    def count(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        call()
    finally:
        sys.setprofile(before)
    return calls


class CountingTrajectory:
    """Count the instants at which a trajectory is evaluated; fulfils Trajectory.

    Attributes:
        instants: number of instants at which positions or velocities were evaluated.
    """

    def __init__(self, inner: Trajectory) -> None:
        self._inner = inner
        self.instants = 0

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self._inner.joint_names

    @property
    def duration_s(self) -> float:
        return self._inner.duration_s

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        return self._inner.breakpoints_s

    @property
    def output_changes(self) -> tuple[OutputChange, ...]:
        return self._inner.output_changes

    def positions(self, t_s: FloatArray) -> FloatArray:
        self.instants += len(t_s)
        return self._inner.positions(t_s)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        self.instants += len(t_s)
        return self._inner.velocities(t_s)
