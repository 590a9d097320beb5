"""Judge a machine's reaction to each fault by the expected reaction and its time to standstill."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import ceil, inf
from typing import Any

import numpy as np

from steptwin.features.faults.engine import Emergency, Engine, Played
from steptwin.features.faults.fault import Fault
from steptwin.features.faults.kinds.bus import BusFault
from steptwin.features.faults.moment import AxisMoment, Moment, moment_of
from steptwin.features.faults.reaction import HOST_NOTICES_MS, TICK_MS, MotionEffect, Reaction
from steptwin.features.faults.report import FaultReport, JointAnswer, ReportedError, ScenarioReport
from steptwin.features.faults.requests import request_of
from steptwin.features.faults.triggers import AtTime
from steptwin.host.client.words import state_text
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.outcome import RunEnd
from steptwin.host.verify import Evidence
from steptwin.protocol.cia402 import ErrorCode, State
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

# --- time to standstill


def standstill_ms(evidence: Evidence, began_counts: int) -> float:
    """Return the time in ms from an instant to the last step of any axis; 0 if there was none after it."""
    lasts = [int(axis.step_counts[-1]) for axis in evidence.axes if axis.step_counts.size]
    return max(max(lasts, default=began_counts) - began_counts, 0) / COUNTS_PER_MS


def standstill_limit_ms(robot: Robot, fault: Fault, reaction: Reaction, began: Moment) -> float:
    """Return the longest allowed time in ms from a fault's beginning to the last step.

    If the pulses of one axis end at once, the others stop by a ramp. A ramp that begins at once starts at the present
    speeds, which may rise for a tick. Axes on other boards are stopped by the host.
    """
    axes = fault.concerned(began.boards)
    if reaction.motion is MotionEffect.CUT and len(axes) == len(began.axes):
        return reaction.begins_ms
    if reaction.begins_ms <= TICK_MS and began.several_boards and len(axes) < len(began.axes):
        return HOST_NOTICES_MS + longest_ramp_ms(robot)
    if reaction.begins_ms <= TICK_MS:
        velocities = (abs(axis.velocity) * 1_000_000 / (64 * axis.deceleration) for axis in began.axes)
        ramp_ms = float(max(ceil(max(velocities)), 1))  # the firmware rounds up to 1 ms
        return reaction.begins_ms + min(ramp_ms + TICK_MS, longest_ramp_ms(robot))
    return reaction.begins_ms + longest_ramp_ms(robot)


def longest_ramp_ms(robot: Robot) -> float:
    """Return the longest stop in ms of any axis from its highest speed; the firmware rounds up to 1 ms."""
    return float(ceil(1000 * float(np.max(robot.axis_speeds_max / robot.axis_accelerations_max))))


# --- scenario


def scenario_report(engine: Engine, end: RunEnd) -> ScenarioReport:
    """Report a scenario that has been played to the end of a run."""
    moment = moment_of(engine.target)
    faults = tuple(_fault_report(engine, each, end, moment) for each in engine.played)
    reasons = [f"{fault.name}: {difference}" for fault in faults for difference in fault.differences]
    if not any(fault.reaction is not None and not fault.reaction.verified for fault in faults):
        reasons += end.reasons
    if end.stopped and not any(fault.reaction is not None and fault.reaction.may_stop for fault in faults):
        reasons.append("the motion stopped, and no fault of the scenario may stop it")
    if end.not_begun:
        reasons.append(end.not_begun)
    return ScenarioReport(engine.scenario.name, engine.scenario.seed, faults, tuple(reasons))


def played_document(engine: Engine) -> dict[str, Any]:
    """Return the state of each fault so far, under the keys of report.json, without a judgement.

    A live board has no end and no plan of its own; the reactions of its hosts are their own matter.
    """
    scenario = engine.scenario
    return {
        "scenario": {"name": scenario.name, "seed": scenario.seed},
        "faults": [_facts(engine, each).so_far() for each in engine.played],
    }


def _facts(engine: Engine, played: Played) -> FaultReport:
    """Return the state of a fault so far, without a judgement."""
    triggered, began, names = played.triggered, played.began, engine.target.robot.axis_names
    emcys = [] if began is None else _emergencies(engine, began)[0]
    return FaultReport(
        triggered.name,
        request_of(engine.target.robot, triggered.fault),
        str(triggered.trigger),
        struck_s=None if played.first_counts is None else _seconds(engine, played.first_counts),
        strikes=played.strikes,
        ended_s=None if played.ended_counts is None else _seconds(engine, played.ended_counts),
        emcys=tuple(
            ReportedError(names[each.axis], each.code, (each.counts - began.counts) / COUNTS_PER_MS)
            for each in emcys
            if began is not None
        ),
    )


def _fault_report(engine: Engine, played: Played, end: RunEnd, moment: Moment) -> FaultReport:
    facts, began = _facts(engine, played), played.began
    if began is None or not facts.struck:
        never = f"never struck: {_why_never(engine, played, end, moment)}"
        return replace(facts, ended_s=None, emcys=(), differences=(never,))
    judgement = _Judgement(engine, played, began, end, moment)
    return replace(
        facts,
        standstill_ms=judgement.standstill_ms,
        joints=judgement.joints,
        what=played.fault.documented(began).what,
        reaction=judgement.reaction,
        limit_ms=judgement.limit_ms,
        differences=tuple(judgement.differences()),
    )


def _seconds(engine: Engine, counts: int) -> float:
    """Return an instant in seconds from the motion's start; from power-up without a motion."""
    return (counts - (engine.start_counts or 0)) / COUNTS_PER_SECOND


def _emergencies(engine: Engine, began: Moment) -> tuple[list[Emergency], list[Emergency]]:
    """Return the errors reported between the beginnings of a fault and of the next one, and the later errors."""
    begins = [each.began.counts for each in engine.played if each.began is not None]
    next_counts = min((counts for counts in begins if counts > began.counts), default=inf)
    since = [each for each in engine.emergencies if each.counts >= began.counts and each.code]
    return [each for each in since if each.counts < next_counts], [each for each in since if each.counts >= next_counts]


def _why_never(engine: Engine, played: Played, end: RunEnd, moment: Moment) -> str:
    trigger = played.triggered.trigger
    if played.began is not None:
        return f"it began at {_seconds(engine, played.began.counts):g} s, but has struck none of the frames sent since"
    why = "" if played.watch is None else played.watch.missing()
    if not why and isinstance(trigger, AtTime):
        why = f"the motion ended at {end.ended_s:g} s, before at_s {trigger.at_s:g}"
        if trigger.from_power_up:
            why = f"the run ended {moment.counts / COUNTS_PER_SECOND:g} s after power-up"
    return f"{trigger}: {why}"


# --- fault


def _right_reaction(played: Played) -> Reaction | None:
    """Return the expected reaction to the fault; None before it begins."""
    if played.began is None:
        return None
    return played.triggered.expected or played.fault.documented(played.began).reaction


def _codes(played: Played) -> set[ErrorCode]:
    """Return the codes that may report a fault, even after the next one has begun."""
    reaction = _right_reaction(played)
    if reaction is None:
        return set()
    # A report that changes again before it is sent is replaced, which the board reports.
    stopped_too = [ErrorCode.GROUP_STOPPED] if reaction.stops else []
    return {*reaction.codes, *reaction.others, *stopped_too, ErrorCode.CAN_OVERRUN}


def _stops_motion(emcys: Sequence[Emergency]) -> bool:
    """Return whether any of these errors stops a motion; errors of the bus alone do not."""
    known = [ErrorCode(each.code) if each.code in set(ErrorCode) else None for each in emcys]
    return any(code is None or not code.communication or code.lost_connection for code in known)


def _joints(robot: Robot, began: Moment | None, end: Moment) -> dict[str, JointAnswer]:
    return {
        joint.name: JointAnswer(after.state, after.position_known, _lost_steps(joint, before, after))
        for joint, before, after in zip(robot.axes, (began or end).axes, end.axes, strict=True)
    }


def _lost_steps(joint: Joint, before: AxisMoment, after: AxisMoment) -> float | None:
    """Return the steps lost between two instants; None after a restart, or if a lag was not read."""
    if before.boot is not after.boot or before.lag_full_steps is None or after.lag_full_steps is None:
        return None
    return (after.lag_full_steps - before.lag_full_steps) * joint.transmission.microsteps


class _Judgement:
    """A machine's reaction to a fault, compared with the expected one.

    Attributes:
        reaction: expected reaction.
        limit_ms: longest time to standstill, by the board's own crystal; None if the motion goes on.
        standstill_ms: time to the last step before the fault's standstill; None if the motion went on.
        joints: joints at the end of the run, by name.
    """

    def __init__(self, engine: Engine, played: Played, began: Moment, end: RunEnd, moment: Moment) -> None:
        self._engine, self._played, self._began = engine, played, began
        robot = engine.target.robot
        self.reaction = reaction = played.triggered.expected or played.fault.documented(began).reaction
        self._emcys, later = _emergencies(engine, began)
        self._late = [each for each in later if each.code in reaction.codes]
        stopped = _stops_motion([*self._emcys, *self._late]) or (reaction.stops and not reaction.codes)
        self.standstill_ms = standstill_ms(end.evidence, began.counts) if end.stopped and stopped else None
        self.joints: Mapping[str, JointAnswer] = _joints(robot, engine.counted_from(began), moment)
        slow_ppm = max(0, *(-board.config.crystal_ppm for board in engine.target.simulation.boards))
        limit_ms = standstill_limit_ms(robot, played.fault, reaction, began) * (1 + slow_ppm / 1e6)
        self.limit_ms = limit_ms if reaction.stops else None
        self._concerned = [axis for axis in played.fault.concerned(began.boards) if began.axes[axis].energised]
        """Axes that must react: all but drives that are off."""
        reactions = [_right_reaction(each) for each in engine.played]
        unknowable = any(each is not None and not each.verified for each in reactions)
        self._losses_reported = unknowable and (bool(end.reasons) or end.stopped)
        """True if lost steps are allowed by a fault, and the verdict of the run or of a stopped run reports them."""

    def differences(self) -> list[str]:
        """Return all deviations from the expected reaction."""
        reaction, stood = self.reaction, self.standstill_ms is not None
        found = [f"EMCY 0x{code:04X} is not documented" for code in self._undocumented_codes()]
        if reaction.stops and self._concerned and (stood or reaction.certain):
            found += self._wrong_stop()
        elif reaction.certain:
            found += [line for axis in self._concerned for line in self._unreported(axis)]
        if not self._losses_reported:
            found += [
                f"{name}: {joint.lost_steps:g} steps lost in silence"
                for name, joint in self.joints.items()
                if joint.lost_steps and joint.position_known
            ]
        if reaction.motion is MotionEffect.NOT_BEGUN and reaction.certain and self._engine.start_counts is not None:
            found.append("the motion began")
        return found

    def _undocumented_codes(self) -> list[int]:
        """Return reported codes that belong neither to this fault nor to another one."""
        others = {code for each in self._engine.played if each is not self._played for code in _codes(each)}
        allowed = {*self.reaction.codes, *self.reaction.others, *others}
        if self.reaction.stops:
            allowed.add(ErrorCode.GROUP_STOPPED)
        if self._played.ended_counts is not None:  # a short fault changes reports twice: newer ones replace them
            allowed.add(ErrorCode.CAN_OVERRUN)
        return sorted({each.code for each in self._emcys} - allowed)

    def _wrong_stop(self) -> list[str]:
        if self.standstill_ms is None:
            return ["the motion did not stop"]
        found = [line for axis in self._concerned for line in (*self._unreported(axis), *self._wrong_end(axis))]
        if self.limit_ms is not None and self.standstill_ms > self.limit_ms:
            found.append(f"stood after {self.standstill_ms:.2f} ms, later than {self.limit_ms:.2f} ms")
        return found

    def _unreported(self, axis: int) -> list[str]:
        """Return a text if an axis has not reported the fault as the reaction requires.

        On a bus with faults, its EMCY may be lost.
        """
        codes = self.reaction.codes
        if not codes or isinstance(self._played.fault, BusFault):
            return []
        if any(each.axis == axis and each.code in codes for each in (*self._emcys, *self._late)):
            return []
        return [f"{list(self.joints)[axis]}: no EMCY {' or '.join(f'0x{code:04X}' for code in codes)}"]

    def _wrong_end(self, axis: int) -> list[str]:
        """Return the errors in the end state of a stopped axis."""
        reaction, (name, joint), before = self.reaction, list(self.joints.items())[axis], self._began.axes[axis]
        found = []
        # The host may have switched the drive off, at the motion's end or to stop it with others.
        switched_off = not reaction.certain and joint.state is State.SWITCH_ON_DISABLED and joint.position_known
        if reaction.state is not None and joint.state is not reaction.state and not switched_off:
            found.append(f"{name}: in {state_text(joint.state)}, not in {state_text(reaction.state)}")
        fast = abs(before.velocity) * 1_000_000 > before.deceleration * 64  # it cannot have stopped within 1 ms
        if reaction.motion is MotionEffect.CUT and fast and joint.position_known:
            found.append(f"{name}: was cut off in motion and claims to know its position")
        return found
