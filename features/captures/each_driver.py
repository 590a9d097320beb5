"""Captures of a real controller, judged: what the robot's drivers would have made of its edges, beside a plan.

Every driver that there is may be asked, too: which would have missed pulses of a capture, and from when on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from steptwin.features.captures.capture import Capture
from steptwin.features.captures.channel_map import AxisSignals
from steptwin.features.captures.drivers_seen import Reading, counted_for_certain, drivers_of
from steptwin.features.captures.judging import CapturedRun, CaptureJudge, judge_alone, judge_capture, slack_counts
from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import AxisEvidence
from steptwin.host.verify.clock_fit import ClockFit
from steptwin.host.verify.counted import powerless_steps
from steptwin.protocol.drivers import driver_names
from steptwin.protocol.timer import COUNTS_PER_SECOND

__all__ = ["CaptureJudge", "CapturedRun", "DriverAnswer", "by_each_driver", "judge_alone", "judge_capture"]


@dataclass(frozen=True, slots=True)
class DriverAnswer:
    """What one kind of driver would have made of a capture.

    Attributes:
        name: of the drivers.
        missed: pulses that they miss for certain, steps that they make the wrong way, and steps without current.
        first_s: when the first of these limits is broken, in the plan's time; None: none is.
        refused: why the robot cannot have these drivers; None: it can.
    """

    name: str
    missed: int = 0
    first_s: float | None = None
    refused: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the answer for JSON."""
        return {"name": self.name, "missed": self.missed, "first_s": self.first_s, "refused": self.refused}


def by_each_driver(
    capture: Capture, robot: Robot, signals: Sequence[AxisSignals], clock: ClockFit
) -> list[DriverAnswer]:
    """Return the answer of every kind of driver, in the order of their list."""
    reading = Reading(slack_counts(capture), currents=any(each.enable for each in signals))
    found = []
    for name in driver_names():
        try:
            drivers = drivers_of(robot, name)
        except InputError as error:
            found.append(DriverAnswer(name, refused=str(error)))
            continue
        evidence = counted_for_certain(drivers, signals, clock, reading)
        missed = sum(_missed(axis) + powerless_steps(axis, evidence.start_counts) for axis in evidence.axes)
        broken = [int(axis.violations.counts[0]) for axis in evidence.axes if axis.violations.counts.size]
        first_s = (min(broken) - evidence.start_counts) / COUNTS_PER_SECOND if broken else None
        found.append(DriverAnswer(name, missed, first_s))
    return found


def _missed(axis: AxisEvidence) -> int:
    """Return how many pulses are no step, or one the wrong way."""
    passed = np.searchsorted(axis.dir_edge_counts, axis.step_counts, side="right")
    levels = np.concatenate((np.zeros(1, np.int8), axis.dir_levels))[passed]
    wrong = int(np.count_nonzero(axis.step_signs != 2 * levels - 1))
    return int(axis.clk_rise_counts.size - axis.step_counts.size) + wrong
