"""Judge a capture of a real controller: beside a plan, or its edges alone.

The plan's time is found in the capture, the drivers see the edges, and the verifier compares what they counted with the
plan. The controller's step rule is its own, so it is held to `any_step_rule` instead of our firmware's. What a user may
have wired wrongly is named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, trunc
from typing import Any, Final

import numpy as np

from steptwin.features.captures.capture import Capture
from steptwin.features.captures.channel_map import AxisSignals, ChannelMap, wired
from steptwin.features.captures.drivers_seen import ONE_CLOCK, Reading, Seen, at_active_edges, drivers_of, see
from steptwin.features.captures.limits_read import Kept, LimitAnswer
from steptwin.host.common.arrays import Int8Array, Int64Array
from steptwin.host.planning.motion import Motion
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import (
    BusReport,
    Comparison,
    Evidence,
    Expectation,
    Report,
    RunInfo,
    any_step_rule,
    compare,
    powerless_reasons,
    verify_comparison,
)
from steptwin.host.verify.clock_fit import ClockFit, fit_clock
from steptwin.host.verify.clock_line import CapturedSteps
from steptwin.host.verify.figures import clk_high_us_min, clk_low_us_min, peak_rate_hz, reversals
from steptwin.host.verify.gates import TOLERANCE_STEPS
from steptwin.host.verify.net_counts import WHOLE_STEPS
from steptwin.host.verify.oracle import ideal_steps
from steptwin.protocol.timer import COUNTS_PER_SECOND

CLOCK_PPM: Final = 200.0
"""Ratio of the clocks up to which two crystals explain it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureJudge:
    """How a capture is read and what it is held to.

    Attributes:
        maps: the channels of each axis; empty: the channels' names tell it.
        glitch_s: two edges of a channel that are closer are dropped.
        tolerance_steps: largest distance of a count from the plan.
        clock_ppm: largest difference of the two clocks.
        driver_profile: drivers other than the robot file's.
        currents: compute the motors' currents too, which pictures show; they take most of the memory.
    """

    maps: Sequence[str] = ()
    glitch_s: float = 0.0
    tolerance_steps: float = TOLERANCE_STEPS
    clock_ppm: float = CLOCK_PPM
    driver_profile: str | None = None
    currents: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class CapturedRun:
    """A capture beside its plan.

    Attributes:
        capture: the capture without its channels.
        wiring: which channels each axis has.
        signals: their signals.
        clock: the plan's time in it.
        seen: what the drivers made of it.
        comparison: their counts beside the plan.
        report: the verifier's report.
        judge: what it was held to.
    """

    capture: Capture
    wiring: tuple[ChannelMap, ...]
    signals: tuple[AxisSignals, ...]
    clock: ClockFit
    seen: Seen
    comparison: Comparison
    report: Report
    judge: CaptureJudge

    @property
    def reasons(self) -> tuple[str, ...]:
        """One line for each reason why it fails: what is wired wrongly first, then the clock, then the verifier's."""
        told = [str(answer) for answer in self.seen.limits if answer.kept is Kept.BROKEN]
        if self.other_law:
            return (_OTHER_LAW, *self.report.reasons, *told)
        return (*self._wired_wrongly(), *self._clock_reasons(), *self.report.reasons, *told)

    @property
    def other_law(self) -> bool:
        """Whether each axis goes where the plan goes, turn by turn, but not when: by another speed law."""
        pairs = zip(self.comparison.ideal, self.comparison.evidence.axes, strict=True)
        off = [_runs_off(ideal.signs, axis.step_signs) for ideal, axis in pairs]
        if None in off:
            return False
        apart = sum(filter(None, off))
        axes, limit = self.report.axes, self.comparison.gates.position_error_steps
        unmatched = sum(axis.unmatched_steps for axis in axes)
        furthest = max(axis.position_error_steps_max for axis in axes)
        return unmatched > 2 * (apart + 1) or not furthest <= limit + apart + 2

    @property
    def passed(self) -> bool:
        """True if the controller did what was planned."""
        return not self.reasons

    @property
    def hints(self) -> tuple[str, ...]:
        """What may be looked at, though it fails nothing."""
        return _hints(self.capture, self.signals, self.seen)

    def _wired_wrongly(self) -> list[str]:
        if exchanged := _exchanged(self.signals, self.wiring):
            return exchanged
        names = [each.name for each in self.signals]
        if not self.clock.found:
            return ["the plan is not in the capture: no offset shows even a third of its steps"]
        lines = [
            f"{names[i]} looks like the plan's {names[j]}, and {names[j]} like its {names[i]}: swap their channels"
            for i, j in self.clock.swapped
        ]
        swapped = {i for pair in self.clock.swapped for i in pair}
        for i in self.clock.inverted:
            if i not in swapped:
                direction = self.wiring[i].direction
                other = direction.removeprefix("!") if direction.startswith("!") else f"!{direction}"
                lines.append(f"{names[i]} turns the other way: map its DIR as {other}")
        return lines

    def _clock_reasons(self) -> list[str]:
        if not self.clock.found or abs(self.clock.ppm) <= self.judge.clock_ppm:
            return []
        return [f"the clocks differ by {self.clock.ppm:+.1f} ppm (limit {self.judge.clock_ppm:g})"]

    @property
    def assumed(self) -> tuple[str, ...]:
        """The pins that were not recorded."""
        without = [each.name for each in self.signals if each.enable is None]
        return ("supplies", "microsteps", "RESET", *(f"{name}.ENABLE" for name in without))

    def to_dict(self) -> dict[str, Any]:
        """Return the report as `steptwin verify --capture --json` prints it."""
        document = self.report.to_dict()
        document |= {"passed": self.passed, "reasons": list(self.reasons), "simulated": False}
        document["capture"] = {
            **_facts(self.capture, self.wiring, self.signals, self.seen),
            "tolerance_steps": self.judge.tolerance_steps,
            "reasons": [_OTHER_LAW] if self.other_law else [*self._wired_wrongly(), *self._clock_reasons()],
            "other_law": self.other_law,
            "clock": {
                "found": self.clock.found,
                "offset_s": self.clock.offset_s,
                "offset_uncertainty_s": _finite(self.clock.offset_uncertainty_s),
                "ppm": self.clock.ppm,
                "ppm_uncertainty": _finite(1e6 * self.clock.ratio_uncertainty),
                "pairs": self.clock.pairs,
            },
            "assumed": list(self.assumed),
            "hints": list(self.hints),
        }
        return document


_OTHER_LAW: Final = (
    "another speed law than planned: each axis counts as planned between its turning points, but at other times."
    " So what follows tells neither of steps lost nor of the clocks; --path in place of --plan judges the steps"
    " at any speed"
)


def _runs_off(planned: Int8Array, made: Int8Array) -> int | None:
    """Return by how many steps an axis' last runs between turning points are off; None if they are others than planned.

    What comes before them may be homing. Where the plan begins is not asked: by another law nobody can tell exactly.
    """
    runs = _run_lengths(planned)
    own = _run_lengths(made)[max(_run_lengths(made).size - runs.size, 0) :]
    if runs.size != own.size or (np.abs(runs - own) > 1).any():
        return None
    return int(np.abs(runs - own).sum())


def _run_lengths(signs: Int8Array) -> Int64Array:
    """Return the sum of steps in each run of one direction."""
    if not signs.size:
        return np.empty(0, np.int64)
    return np.add.reduceat(signs.astype(np.int64), np.flatnonzero(np.diff(signs, prepend=np.int8(0))))


def _exchanged(signals: Sequence[AxisSignals], wiring: Sequence[ChannelMap]) -> list[str]:
    """Return one line for each axis whose STEP and DIR look exchanged."""
    return [
        f"{wire.axis}: STEP and DIR look exchanged: map={replace(wire, step=wire.direction, direction=wire.step)}"
        for each, wire in zip(signals, wiring, strict=True)
        if each.exchanged
    ]


def _hints(capture: Capture, signals: Sequence[AxisSignals], seen: Seen) -> tuple[str, ...]:
    found = [
        f"{each.name}: {each.suspicious} pulses of STEP are far shorter than most: glitches of the probe? "
        "--glitch 1us drops them"
        for each in signals
        if each.suspicious
    ]
    unknown = {answer.limit.rule for answer in seen.limits if answer.kept is Kept.UNKNOWN}
    if unknown:
        rate = f"{capture.rate_hz or 0.0:g} Hz"
        found.append(f"at {rate} it cannot be told whether {', '.join(sorted(unknown))} was kept: sample faster")
    return (*found, *capture.told)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _facts(
    capture: Capture, wiring: Sequence[ChannelMap], signals: Sequence[AxisSignals], seen: Seen
) -> dict[str, Any]:
    return {
        "kind": capture.kind,
        "duration_s": capture.duration_s,
        "rate_hz": capture.rate_hz,
        "map": [str(each) for each in wiring],
        "glitches": {each.name: each.glitches for each in signals},
        "limits": [answer.to_dict() for answer in seen.limits],
    }


def judge_capture(
    capture: Capture, robot: Robot, job: str, motion: Motion, judge: CaptureJudge, wall_s: float = 0.0
) -> CapturedRun:
    """Judge a capture beside the motion that the controller should have made.

    Raises:
        InputError: channels are missing, the drivers do not exist, or the sampling rate is not told.
    """
    drivers = drivers_of(robot, judge.driver_profile)
    signals, wiring = wired(capture, robot.axis_names, judge.maps, judge.glitch_s)
    capture = replace(capture, channels=())  # the signals have what is needed, and captures are long
    motion = replace(motion, output_changes=(), waits=())  # nobody has recorded them
    expected = Expectation.of(robot, motion)
    planned = [expected.axis_position(axis, np.zeros(1))[0] for axis in range(len(robot.axis_names))]
    at_zero = tuple(round(float(position)) for position in planned)
    ideal = ideal_steps(expected.axis_motion, expected.steps_per_unit, at_zero)
    moved = [CapturedSteps(each.rises_s, each.signs_at(each.rises_s)) for each in at_active_edges(signals, drivers)]
    clock = fit_clock(ideal, moved)
    before = [int(steps.signs[steps.time_s < clock.offset_s].sum()) for steps in moved]
    begun = [_begun_at(expected, axis, zero, moved[axis], clock) for axis, zero in enumerate(at_zero)]
    starts = [zero - made for zero, made in zip(begun, before, strict=True)]
    reading = Reading(slack_counts(capture), currents=judge.currents or any(each.enable for each in signals))
    seen = see(drivers, signals, clock, starts, reading)
    comparison = compare(expected, seen.evidence, any_step_rule(judge.tolerance_steps))
    run = RunInfo(robot.name, job, motion.duration_s, BusReport(0, 0, 0.0), seen.lasts_s, wall_s)
    return CapturedRun(capture, wiring, signals, clock, seen, comparison, verify_comparison(comparison, run), judge)


def _begun_at(expected: Expectation, axis: int, nearest: int, steps: CapturedSteps, clock: ClockFit) -> int:
    """Return the count at the plan's t = 0: the nearest one, or the one cut towards zero if it was cut.

    No pin tells it. A controller that cuts shows it where the motion passes through zero: only with the count cut at
    the start, too, it stays within a step of the plan.
    """
    made = steps.time_s >= clock.offset_s
    planned = expected.axis_position(axis, np.concatenate(([0.0], clock.plan_s(steps.time_s[made]))))
    if planned.min() > -1.0 or planned.max() < 1.0:
        return nearest
    moved = np.concatenate(([0], np.cumsum(steps.signs[made], dtype=np.int64)))
    off = np.concatenate((moved - planned, moved[:-1] - planned[1:]))
    cut = trunc(planned[0])
    return cut if np.abs(off + cut).max() <= WHOLE_STEPS < np.abs(off + nearest).max() else nearest


def slack_counts(capture: Capture) -> int:
    """Return by how much a time between two edges may be read wrong: a sample, and a count for rounding."""
    return ceil(capture.resolution_s * COUNTS_PER_SECOND) + 1


@dataclass(frozen=True, slots=True, eq=False)
class AloneRun:
    """A capture without a plan: what each axis did, and what can be said of its driver's limits."""

    capture: Capture
    wiring: tuple[ChannelMap, ...]
    signals: tuple[AxisSignals, ...]
    seen: Seen
    clock: ClockFit = ONE_CLOCK

    @property
    def reasons(self) -> tuple[str, ...]:
        """One line for each reason why a driver, or its motor, has not made the steps that STEP asks for."""
        broken = [str(answer) for answer in self.seen.limits if answer.kept is Kept.BROKEN]
        return (*self.exchanged, *broken, *powerless_reasons(self.evidence))

    @property
    def exchanged(self) -> tuple[str, ...]:
        """One line for each axis whose STEP and DIR look exchanged."""
        return tuple(_exchanged(self.signals, self.wiring))

    @property
    def passed(self) -> bool:
        """True if no limit was broken, and each step was made with current."""
        return not self.reasons

    @property
    def hints(self) -> tuple[str, ...]:
        """What may be looked at, though it fails nothing."""
        return _hints(self.capture, self.signals, self.seen)

    @property
    def evidence(self) -> Evidence:
        """The drivers' counts."""
        return self.seen.evidence

    @property
    def limits(self) -> tuple[LimitAnswer, ...]:
        """What can be said of each limit."""
        return self.seen.limits

    def to_dict(self) -> dict[str, Any]:
        """Return the answer for JSON."""
        axes = [
            {
                "name": axis.name,
                "pulses": axis.clk_rise_counts.size,
                "steps": int(axis.step_signs.sum()),
                "reversals": reversals(axis),
                "peak_rate_hz": peak_rate_hz(axis),
                "clk_high_us_min": clk_high_us_min(axis),
                "clk_low_us_min": clk_low_us_min(axis),
            }
            for axis in self.evidence.axes
        ]
        captured = _facts(self.capture, self.wiring, self.signals, self.seen)
        captured["hints"] = list(self.hints)
        verdict = {"passed": self.passed, "reasons": list(self.reasons)}
        return verdict | {"simulated": False, "axes": axes, "capture": captured}


def judge_alone(capture: Capture, robot: Robot, judge: CaptureJudge) -> AloneRun:
    """Tell what a capture shows of a robot's axes without a plan; raises InputError as `judge_capture` does."""
    drivers = drivers_of(robot, judge.driver_profile)
    signals, wiring = wired(capture, robot.axis_names, judge.maps, judge.glitch_s)
    reading = Reading(slack_counts(capture), currents=any(each.enable for each in signals))
    seen = see(drivers, signals, ONE_CLOCK, [0] * len(signals), reading)
    return AloneRun(replace(capture, channels=()), wiring, signals, seen)
