"""Judge a capture by the path of a plan alone: are all steps there, in their order, whenever they come?

Any speed law walks the same path. What no path can tell: pulses that cancel before an axis turns around, such as one
lost and one extra on the same straight line.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from steptwin.features.captures.capture import Capture
from steptwin.features.captures.channel_map import AxisSignals
from steptwin.features.captures.drivers_seen import at_active_edges, drivers_of
from steptwin.features.captures.judging import AloneRun, CaptureJudge, judge_alone
from steptwin.features.captures.motor_path import MotorPath, motor_path
from steptwin.features.captures.path_faults import WHOLE, FaultKind, PathFault, Walk, faults, gross_faults
from steptwin.features.captures.path_sentences import HIDDEN, Named, sentence, window_s
from steptwin.features.captures.path_walk import Events, events_of
from steptwin.features.captures.step_rules import ESTIMATES, Rest, StepRule
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motion import Motion
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Expectation

_SAME_SAMPLES: Final = 1.5
"""Samples between two steps up to which nobody can tell which came first."""
_PAUSE_S: Final = 0.05
"""Shortest standstill before a motion, if other steps come before it."""
_PAUSES_MAX: Final = 20
_LONGER_EVENTS: Final = 200
_MANY_LOST: Final = 0.15
"""Part of an axis' steps up to which its pulses may be lost at one place, instead of all along."""
_SYMMETRIC: Final = (0.4, 0.6)
"""Part of a period for which STEP is high, if each of its edges is a step."""


@dataclass(frozen=True, slots=True, eq=False)
class PathVerdict:
    """The verdict on the steps of a capture, by path.

    Attributes:
        rule: the step rule that they were held to.
        estimated: whether the rule was estimated from them.
        half_steps: largest distance of a count from the path by it.
        faults: what is wrong, in order; empty if it passed.
        path: the path.
        events: the steps.
        names: of the axes.
        before: steps before the motion, such as homing, which are left out.
        both_edges: whether each edge of STEP was a step.
    """

    rule: StepRule
    estimated: bool
    half_steps: float
    faults: tuple[PathFault, ...]
    path: MotorPath
    events: Events
    names: tuple[str, ...]
    before: int = 0
    both_edges: bool = False

    @property
    def hint(self) -> str:
        """Text about arcs that the controller does not follow; empty for a passed capture or a path without arcs."""
        if self.passed or not self.rule.long_chords or not self.path.curve_steps_per_mm:
            return ""
        return f"the path has arcs, which {self.rule.name} goes in chords of about 1 mm: let the file have lines"

    @property
    def passed(self) -> bool:
        """True if the path was walked, wholly, once, and in its order."""
        return not self.faults

    @property
    def reasons(self) -> tuple[str, ...]:
        """One line for each fault."""
        named = Named(self.names, self.path, self.events, self.rule, self.both_edges)
        return tuple(sentence(fault, named) for fault in self.faults)

    @property
    def not_shown(self) -> str:
        """What a verdict that passed does not exclude."""
        between = "; and by this rule one step lost or extra, if its axis ends between two steps"
        return HIDDEN + (between if self.rule.rest is Rest.WHOLE else "")

    def window_s(self, fault: PathFault) -> tuple[float, float]:
        """Return the instants of the last event surely before a fault, and of the first one surely after it."""
        return window_s(self.events, fault)

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict for JSON."""
        start = self.rule.start(self.path.points[:, 0])
        ends = start + self.events.changes.sum(axis=0, dtype=np.int64)
        pulses = np.abs(self.events.changes).sum(axis=0, dtype=np.int64)
        planned = self.path.points[:, -1]
        facts = zip(self.names, start.tolist(), ends.tolist(), planned.tolist(), pulses.tolist(), strict=True)
        return {
            "passed": self.passed,
            "rule": self.rule.name,
            "estimated": self.estimated,
            "says": self.rule.says,
            "source": self.rule.source,
            "half_steps": self.half_steps,
            "both_edges": self.both_edges,
            "events": len(self.events.changes),
            "before": self.before,
            "distance_mm": self.path.mm_at(len(self.path.joints) - 1.0),
            "axes": [
                {"name": name, "start": int(begin), "end": int(end), "planned_end_steps": goal, "steps": int(steps)}
                for name, begin, end, goal, steps in facts
            ],
            "not_shown": self.not_shown,
            "faults": [self._fault(fault, reason) for fault, reason in zip(self.faults, self.reasons, strict=True)],
        }

    def _fault(self, fault: PathFault, reason: str) -> dict[str, Any]:
        placed = fault.kind not in WHOLE
        begin_s, end_s = window_s(self.events, fault) if placed else (None, None)
        return {
            "kind": fault.kind.value,
            "axis": self.names[fault.axis] if fault.axis >= 0 else None,
            "steps": fault.steps,
            "from_s": begin_s,
            "until_s": end_s,
            "pulse_s": fault.pulse_s,
            **(self.path.to_dict(fault.places) if placed else {}),
            "said": reason,
        }


@dataclass(frozen=True, slots=True, eq=False)
class PathRun:
    """A capture beside the path of a plan: the verdict on its steps, and on its drivers' limits.

    With steps at both edges of STEP the limits are not judged: no driver of the list makes such steps.
    """

    alone: AloneRun
    verdict: PathVerdict

    @property
    def reasons(self) -> tuple[str, ...]:
        """One line for each fault of the steps, then for each limit that was broken."""
        if self.verdict.both_edges:
            return self.verdict.reasons
        if exchanged := self.alone.exchanged:
            return exchanged
        return (*self.verdict.reasons, *self.alone.reasons)

    @property
    def passed(self) -> bool:
        """True if all steps are there, in their order, and the drivers made them."""
        return not self.reasons

    @property
    def hints(self) -> tuple[str, ...]:
        """What may be looked at, though it fails nothing."""
        return (*self.alone.hints, *filter(None, [self.verdict.hint]))

    def to_dict(self) -> dict[str, Any]:
        """Return the report as `steptwin verify --capture --path --json` prints it."""
        document = self.alone.to_dict() | {"passed": self.passed, "reasons": list(self.reasons)}
        if self.verdict.both_edges:
            document["capture"]["limits"] = []
        return document | {"path": self.verdict.to_dict()}


def judge_by_path(
    capture: Capture,
    robot: Robot,
    motion: Motion,
    judge: CaptureJudge,
    rule: StepRule | None,
    *,
    both_edges: bool = False,
) -> PathRun:
    """Judge a capture beside the path of a motion, at any speed; raises InputError as `judge_capture` does."""
    resolution_s = capture.resolution_s
    alone = judge_alone(capture, robot, judge)
    signals = at_active_edges(alone.signals, drivers_of(robot, judge.driver_profile))
    expected = Expectation.of(robot, motion)
    return PathRun(alone, judge_path(signals, expected, rule, resolution_s, both_edges=both_edges))


def judge_path(
    signals: Sequence[AxisSignals],
    expected: Expectation,
    rule: StepRule | None,
    resolution_s: float,
    *,
    both_edges: bool = False,
) -> PathVerdict:
    """Judge the steps of a capture by the path of a plan.

    Args:
        signals: of each axis; a pulse begins with the edge at which its driver steps.
        expected: the plan.
        rule: the controller's step rule; None: it is estimated.
        resolution_s: a sample.
        both_edges: each edge of STEP is a step.
    """
    times_s = [each.step.times_s if both_edges else each.rises_s for each in signals]
    signs = [each.signs_at(own_s) for each, own_s in zip(signals, times_s, strict=True)]
    steps = events_of(times_s, signs, _SAME_SAMPLES * resolution_s)
    rate_hz = max((_rate_hz(own_s) for own_s in times_s), default=0.0)
    path = motor_path(expected)
    walks = [
        Walk(path.points, steps, each, each.half_at(rate_hz, path.curve_steps_per_mm))
        for each in ([rule] if rule else ESTIMATES)
    ]
    begins = [0, *_pauses(steps)]
    tried = ((_from(walk, begin), begin) for begin in begins for walk in walks)
    passing = next((each for each in tried if each[0].passes()), None)
    if passing is None:
        begin = _likely_begin(walks[-1], begins)
        walk, found = _explained([_from(each, begin) for each in walks], signals, both_edges=both_edges)
    else:
        (walk, begin), found = passing, []
    return PathVerdict(
        walk.rule,
        rule is None,
        walk.half_steps,
        tuple(found),
        path,
        walk.events,
        tuple(each.name for each in signals),
        int(np.abs(steps.changes[:begin]).sum(dtype=np.int64)),
        both_edges,
    )


def _rate_hz(times_s: FloatArray) -> float:
    """Return an axis' highest step rate, without the shortest intervals, which extra pulses make."""
    return 1.0 / max(float(np.quantile(np.diff(times_s), 0.01)), 1e-9) if times_s.size > 1 else 0.0


def _pauses(steps: Events) -> list[int]:
    """Return the numbers of events before the standstills after which the motion may begin."""
    begins: list[int] = (np.flatnonzero(np.diff(steps.time_s) > _PAUSE_S)[:_PAUSES_MAX] + 1).tolist()
    return begins


def _from(walk: Walk, begin: int) -> Walk:
    time_s, changes = walk.events
    return replace(walk, events=Events(time_s[begin:], changes[begin:]))


def _likely_begin(walk: Walk, begins: Sequence[int]) -> int:
    """Return from where on the path is walked longest; the first one unless another is far longer."""
    off = np.zeros(len(walk.points))
    lasts = [_from(walk, begin).reach(0, off, (0.0, 0.0)).events() for begin in begins]
    best = int(np.argmax(lasts))
    return begins[best] if lasts[best] > 2 * lasts[0] + _LONGER_EVENTS else 0


def _explained(
    walks: Sequence[Walk], signals: Sequence[AxisSignals], *, both_edges: bool
) -> tuple[Walk, Sequence[PathFault]]:
    """Return the faults by the rule with the fewest, those of whole axes first."""
    gross = gross_faults(walks[0])
    halved = [fault for fault in gross if fault.kind is FaultKind.SCALED and abs(fault.scale - 0.5) < 0.02]
    may_halve = walks[0].rule.both_edges and not both_edges
    if halved and len(halved) == len(gross) and may_halve and all(_is_symmetric(each) for each in signals):
        return walks[0], [PathFault(FaultKind.BOTH_EDGES)]
    if any(fault.kind is not FaultKind.SCALED or abs(fault.scale - 1.0) > _MANY_LOST for fault in gross):
        return walks[0], gross
    walk, fewest = _fewest(walks)
    return (walks[0], gross) if gross and not _is_one_pulse(fewest) else (walk, fewest)


def _fewest(walks: Sequence[Walk]) -> tuple[Walk, Sequence[PathFault]]:
    """Return the fewest faults and their rule, the strictest of equal ones: one fault of pulses is taken at once."""
    found = []
    for walk in sorted(walks, key=lambda each: each.half_steps):
        found.append((walk, faults(walk)))
        if _is_one_pulse(found[-1][1]):
            return found[-1]
    return min(found, key=lambda each: _unlikely(each[1]))


def _is_one_pulse(found: Sequence[PathFault]) -> bool:
    return len(found) == 1 and found[0].kind in _PULSES


def _unlikely(found: Sequence[PathFault]) -> tuple[int, int]:
    """Return how unlikely faults are: pulses are more likely than others, and one fault than more."""
    return sum(fault.kind not in _PULSES for fault in found), len(found)


_PULSES: Final = (FaultKind.LOST, FaultKind.EXTRA, FaultKind.LOST_OR_EXTRA)


def _is_symmetric(signals: AxisSignals) -> bool:
    """Return whether STEP is high for about half of its period, as where each of its edges is a step."""
    rises_s = signals.rises_s
    if rises_s.size < 2:
        return True
    part = (signals.falls_s[: rises_s.size - 1] - rises_s[:-1]) / np.diff(rises_s)
    return _SYMMETRIC[0] < float(np.median(part)) < _SYMMETRIC[1]
