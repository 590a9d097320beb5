"""Run jobs that are paused on the way, and convert their evidence to trajectory time, to compare it with the plan."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pytest

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.group_time import GroupTime
from steptwin.host.client import Machine, Progress, StreamedMotion
from steptwin.host.client.pausing import pause_trajectory, resume_trajectory
from steptwin.host.common.arrays import Int64Array
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import DEFAULT_POINT_MS
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.verify import AS_PLANNED, AxisEvidence, Evidence, Report, verify

_POLL_S = 0.01


class Break(NamedTuple):
    """A pause: the trajectory time from which on it is asked for, and its duration from standstill on."""

    at_s: float
    lasts_s: float


class Ramp(NamedTuple):
    """A ramp of the group's rate, in parts of the full rate: first tick, rates at both ends, number of ticks."""

    tick: int
    from_rate: float
    to_rate: float
    ticks: int


@dataclass(frozen=True)
class HaltedRun:
    """The outcome of a run, whether each of its breaks found it moving, and the ramps of the group's rate.

    The product's verdict knows the ramps from the board's record; this judges by those seen in the firmware, in its own
    way.
    """

    outcome: Outcome
    halted: tuple[bool, ...]
    ramps: tuple[Ramp, ...]

    @property
    def evidence(self) -> Evidence:
        """The evidence with the board's own instants."""
        return self.outcome.comparison.evidence

    def verify(self) -> Report:
        """Verify the evidence in trajectory time."""
        return verify(self.outcome.comparison.expected, self.in_trajectory_time(), self.outcome.report.run)

    def in_trajectory_time(self) -> Evidence:
        """Return the evidence with all instants in trajectory time, which passes at the group's rate."""
        outputs = tuple(
            replace(change, counts=int(self._warped(np.array([change.counts]))[0])) for change in self.evidence.outputs
        )
        return replace(self.evidence, axes=tuple(map(self._warped_axis, self.evidence.axes)), outputs=outputs)

    def _warped_axis(self, axis: AxisEvidence) -> AxisEvidence:
        return replace(
            axis,
            clk_rise_counts=self._warped(axis.clk_rise_counts),
            clk_fall_counts=self._warped(axis.clk_fall_counts),
            dir_edge_counts=self._warped(axis.dir_edge_counts),
            step_counts=self._warped(axis.step_counts),
            rates=AS_PLANNED,
        )

    def _warped(self, counts: Int64Array) -> Int64Array:
        """Integrate the rate up to each instant: it is constant within a tick, and changes linearly over a ramp."""
        if not counts.size:
            return counts
        rate = np.ones(int(counts.max()) // k.TICK_COUNTS + 1)
        for ramp in self.ramps:
            over = np.arange(ramp.ticks)
            slope = (ramp.to_rate - ramp.from_rate) / max(1, ramp.ticks)
            ramped = rate[ramp.tick : ramp.tick + ramp.ticks]
            ramped[:] = (ramp.from_rate + slope * (over + 0.5))[: len(ramped)]
            rate[ramp.tick + ramp.ticks :] = ramp.to_rate
        ticks = np.concatenate(([0.0], np.cumsum(rate)))
        warped: Int64Array = np.rint(
            np.interp(counts, np.arange(len(ticks)) * k.TICK_COUNTS, ticks * k.TICK_COUNTS)
        ).astype(np.int64)
        return warped


def run_with(
    kernel: Kernel,
    job: str,
    breaks: Sequence[Break],
    options: dict[str, str] | None = None,
    point_ms: int = DEFAULT_POINT_MS,
) -> HaltedRun:
    """Run a job of the warehouse robot; the client that streams it makes the breaks."""
    halted: list[bool] = []
    ramps: list[Ramp] = []
    begin = GroupTime.ramp

    class BreakingMachine(Machine):
        def run(self, motion: StreamedMotion, progress: Progress, begun: Callable[[], None] = lambda: None) -> None:
            run = self.start(motion)
            begun()
            for at_s, lasts_s in breaks:
                while run.trajectory_s < at_s:
                    self.wait(_POLL_S)
                halted.append(pause_trajectory(self))
                assert run.halted is halted[-1]
                self.wait(lasts_s)
                if halted[-1]:
                    resume_trajectory(self)
            while not run.ended:
                self.wait(_POLL_S)
            progress(run.fraction)

    def ramp(group: GroupTime, tick: int, full_ramp_ticks: int) -> None:
        begin(group, tick, full_ramp_ticks)
        from_q16, to_q16 = group.cells[k.RATE_FROM_Q16], group.cells[k.RATE_TO_Q16]
        ramps.append(Ramp(tick, from_q16 / k.FULL_RATE_Q16, to_q16 / k.FULL_RATE_Q16, int(group.cells[k.RAMP_TICKS])))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("steptwin.host.twin.embedded.execution.Machine", BreakingMachine)
        patch.setattr(GroupTime, "ramp", ramp)
        robot = load_robot("warehouse-scara")
        outcome = execute(plan(robot, make_job(robot, job, options or {}), point_ms), job, kernel)
    return HaltedRun(outcome, tuple(halted), tuple(ramps))
