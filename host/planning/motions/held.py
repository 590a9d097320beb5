"""A part of a motion, and a motion with standstills put in: what a machine has done that waited for inputs."""

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motion import JointLaw, Motion


@dataclass(frozen=True, slots=True, eq=False)
class _Later(JointLaw):
    """A law from a time on."""

    law: JointLaw
    from_s: float

    def positions(self, t_s: FloatArray) -> FloatArray:
        return self.law.positions(self.from_s + t_s)

    def velocities(self, t_s: FloatArray) -> FloatArray:
        return self.law.velocities(self.from_s + t_s)

    def states(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.law.states(self.from_s + t_s)


def time_span(motion: Motion, from_s: float, until_s: float) -> Motion:
    """Return a part of a motion that need not begin or end at rest, between two times in whole milliseconds.

    It has the changes of outputs that are wholly in the part, and no waits.
    """
    from_ms, until_ms = round(1000 * from_s), round(1000 * until_s)
    all_s = motion.breakpoints_s
    own_s = all_s[bisect(all_s, (from_ms + 0.5) / 1000) : bisect(all_s, (until_ms - 0.5) / 1000)]
    return Motion(
        motion.joint_names,
        (until_ms - from_ms) / 1000,
        _Later(motion.law, from_s),
        tuple((round(1000 * t_s) - from_ms) / 1000 for t_s in own_s),
        output_changes=tuple(
            replace(change, from_s=change.from_s - from_s, until_s=change.until_s - from_s)
            for change in motion.output_changes
            if from_s <= change.from_s and change.until_s <= until_s
        ),
        expects=motion.expects,
    )


class Hold(NamedTuple):
    """An inserted standstill: time in the original motion, and duration, in milliseconds."""

    at_ms: int
    duration_ms: int


@dataclass(frozen=True, slots=True, eq=False)
class _Held(JointLaw):
    """A law whose time does not advance in spans, each from a begin to an end in seconds."""

    law: JointLaw
    duration_s: float
    spans_s: tuple[tuple[float, float], ...]

    def positions(self, t_s: FloatArray) -> FloatArray:
        return self.law.positions(self._own_s(t_s))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        return self.law.velocities(self._own_s(t_s))

    def states(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.law.states(self._own_s(t_s))

    def _own_s(self, t_s: FloatArray) -> FloatArray:
        stood_s = np.zeros_like(t_s)
        for begin_s, end_s in self.spans_s:
            stood_s += np.clip(t_s - begin_s, 0.0, end_s - begin_s)
        return np.asarray(np.clip(t_s - stood_s, 0.0, self.duration_s))


def held(motion: Motion, holds: Sequence[Hold]) -> Motion:
    """Return a motion with standstills, in order of time, where it is at rest anyway; it has no waits."""
    ends_ms = accumulate(hold.duration_ms for hold in holds)
    spans_s = tuple(
        ((hold.at_ms + end_ms - hold.duration_ms) / 1000, (hold.at_ms + end_ms) / 1000)
        for hold, end_ms in zip(holds, ends_ms, strict=True)
    )

    def later_s(t_s: float) -> float:
        """Convert a time of the original motion; at a standstill, to its end."""
        ms = 1000 * t_s
        return (ms + sum(hold.duration_ms for hold in holds if hold.at_ms <= ms)) / 1000

    duration_s = (round(1000 * motion.duration_s) + sum(hold.duration_ms for hold in holds)) / 1000
    ends_s = {t_s for span_s in spans_s for t_s in span_s if 0 < t_s < duration_s}
    return Motion(
        motion.joint_names,
        duration_s,
        _Held(motion.law, motion.duration_s, spans_s),
        tuple(sorted(ends_s | {later_s(t_s) for t_s in motion.breakpoints_s})),
        output_changes=tuple(
            replace(change, from_s=later_s(change.from_s), until_s=later_s(change.until_s))
            for change in motion.output_changes
        ),
        expects=motion.expects,
    )
