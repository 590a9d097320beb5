"""Count the work that a call does; bounds on it hold on a busy machine too, unlike bounds on seconds."""

import sys
from collections.abc import Callable
from dataclasses import replace
from types import FrameType

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motion import JointLaw, Motion


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


class CountingLaw(JointLaw):
    """Count the instants at which a law is evaluated.

    Attributes:
        instants: number of instants at which positions or velocities were evaluated.
    """

    def __init__(self, inner: JointLaw) -> None:
        self._inner = inner
        self.instants = 0

    def positions(self, t_s: FloatArray) -> FloatArray:
        self.instants += len(t_s)
        return self._inner.positions(t_s)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        self.instants += len(t_s)
        return self._inner.velocities(t_s)


def counting(motion: Motion) -> tuple[Motion, CountingLaw]:
    """Return a motion, and its law, which counts."""
    law = CountingLaw(motion.law)
    return replace(motion, law=law), law
