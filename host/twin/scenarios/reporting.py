"""Report a played scenario: when each fault was due and struck, what answered, and whether that is documented."""

from collections.abc import Sequence
from dataclasses import dataclass

from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.control.operations import request_of
from steptwin.host.twin.scenarios.answers import answers, later_errors, seconds, told
from steptwin.host.twin.scenarios.engine import Emergency, Engine, Played
from steptwin.host.twin.scenarios.judge import Answer, Judge
from steptwin.host.twin.scenarios.moment import AxisMoment, Moment
from steptwin.host.twin.scenarios.reaction import Motion, Reaction
from steptwin.host.twin.scenarios.reactions import documented
from steptwin.host.twin.scenarios.report import FaultReport, JointAnswer, ScenarioReport
from steptwin.host.twin.scenarios.standstill import standstill_limit_ms, standstill_ms
from steptwin.host.twin.scenarios.triggers import AtTime
from steptwin.host.verify import Evidence
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.timer import COUNTS_PER_SECOND

_SIXTEENTHS = 16
"""Sixteenths of a full step in a full step."""


@dataclass(frozen=True, slots=True)
class RunEnd:
    """How a run ended.

    Attributes:
        moment: what the axes did then.
        evidence: the steps that the drivers counted.
        stopped: whether the motion ended before its time.
        ended_s: time of the motion at its end.
        reasons: why the drivers' counts are not as planned; empty if they are, or if the motion stopped.
    """

    moment: Moment
    evidence: Evidence
    stopped: bool
    ended_s: float
    reasons: tuple[str, ...] = ()


def scenario_report(engine: Engine, end: RunEnd) -> ScenarioReport:
    """Report the scenario that an engine has played to the end of a run."""
    faults = tuple(_fault_report(engine, each, end) for each in engine.played)
    reasons = [f"{fault.name}: {difference}" for fault in faults for difference in fault.differences]
    if not any(fault.reaction is not None and not fault.reaction.verified for fault in faults):
        reasons += end.reasons
    if end.stopped and not any(map(_may_stop, faults)):
        reasons.append("the motion stopped, and no fault of the scenario may stop it")
    scenario = engine.scenario
    return ScenarioReport(scenario.name, scenario.seed, faults, tuple(reasons))


def _may_stop(fault: FaultReport) -> bool:
    """Return whether the motion may end because of a fault."""
    return fault.reaction is not None and (fault.reaction.stops or not fault.reaction.certain)


def _fault_report(engine: Engine, played: Played, end: RunEnd) -> FaultReport:
    robot, fault, began = engine.target.robot, played.fault, played.began
    named = fault.name, request_of(robot, fault.harm), str(fault.trigger)
    if began is None or played.first_counts is None:
        return FaultReport(*named, differences=(f"never struck: {_why_never(engine, played, end)}",))
    row = documented(played.harm, began)
    reaction = fault.expected or row.reaction
    limit_ms = _limit_ms(engine, played, reaction, began) if reaction.stops else None
    answer = _answer(engine, reaction, began, end)
    judge = Judge(
        played,
        began,
        reaction,
        limit_ms,
        answer,
        others={code for each in engine.played if each is not played for code in _codes(each)},
        # A stopped run says whether the drivers agree.
        losses_told=any(map(_unknowable, engine.played)) and (bool(end.reasons) or end.stopped),
    )
    differences = judge.differences()
    if reaction.motion is Motion.NOT_BEGUN and reaction.certain and engine.start_counts is not None:
        differences.append("the motion began")
    return FaultReport(
        *named,
        struck_s=seconds(engine, played.first_counts),
        strikes=played.strikes,
        ended_s=None if played.ended_counts is None else seconds(engine, played.ended_counts),
        emcys=told(engine, answer.emcys, began),
        standstill_ms=answer.standstill_ms,
        joints=answer.joints,
        what=row.what,
        reaction=reaction,
        limit_ms=limit_ms,
        differences=tuple(differences),
    )


def _limit_ms(engine: Engine, played: Played, reaction: Reaction, began: Moment) -> float:
    """Return the longest time to standstill: a board keeps its limits by its own crystal, which may be slow."""
    slow_ppm = max(0, *(-board.config.crystal_ppm for board in engine.target.simulation.boards))
    return standstill_limit_ms(engine.target.robot, played.harm, reaction, began) * (1 + slow_ppm / 1e6)


def _answer(engine: Engine, reaction: Reaction, began: Moment, end: RunEnd) -> Answer:
    """Return what the machine did after a fault had begun."""
    emcys = answers(engine, began)
    late = [each for each in later_errors(engine, began) if each.code in reaction.codes]
    stopped = end.stopped and (_stops_within([*emcys, *late]) or (reaction.stops and not reaction.codes))
    return Answer(
        emcys,
        late,
        standstill_ms(end.evidence, began.counts) if stopped else None,
        _joints(engine.target.robot, engine.counted_from(began), end.moment),
    )


def _reaction(played: Played) -> Reaction | None:
    """Return the reaction to a fault that is right; None before it begins."""
    if played.began is None:
        return None
    return played.fault.expected or documented(played.harm, played.began).reaction


def _codes(played: Played) -> set[ErrorCode]:
    """Return the codes with which a fault that has begun may be answered, even after the next one has begun."""
    reaction = _reaction(played)
    if reaction is None:
        return set()
    # Reports that change again before they are sent are replaced, which the board tells.
    return {*reaction.codes, *([ErrorCode.GROUP_STOPPED] if reaction.stops else []), ErrorCode.CAN_OVERRUN}


def _unknowable(played: Played) -> bool:
    """Return whether a fault has begun that makes steps go missing of which no board can know."""
    reaction = _reaction(played)
    return reaction is not None and not reaction.verified


def _stops_within(emcys: Sequence[Emergency]) -> bool:
    """Return whether any of these errors stops a motion: errors of the bus alone do not."""
    return any(not _of_bus(each.code) for each in emcys)


def _of_bus(code: int) -> bool:
    known = code in set(ErrorCode) and ErrorCode(code)
    return bool(known) and ErrorCode(code).communication and not ErrorCode(code).lost_connection


def _why_never(engine: Engine, played: Played, end: RunEnd) -> str:
    trigger = played.fault.trigger
    if played.began is not None:
        return f"it began at {seconds(engine, played.began.counts):g} s, but has struck none of the frames sent since"
    why = "" if played.watch is None else played.watch.missing()
    if not why and isinstance(trigger, AtTime):
        why = f"the motion ended at {end.ended_s:g} s, before at_s {trigger.at_s:g}"
        if trigger.from_power_up:
            why = f"the run ended {end.moment.counts / COUNTS_PER_SECOND:g} s after power-up"
    return f"{trigger}: {why}"


def _joints(robot: Robot, began: Moment | None, end: Moment) -> dict[str, JointAnswer]:
    return {
        joint.name: JointAnswer(after.state, after.position_known, _lost_steps(joint, before, after))
        for joint, before, after in zip(robot.joints, (began or end).axes, end.axes, strict=True)
    }


def _lost_steps(joint: Joint, before: AxisMoment, after: AxisMoment) -> float | None:
    """Return the steps that were lost between two instants; None after a restart, or if a lag was not read."""
    if before.boot is not after.boot or before.lag_sixteenths is None or after.lag_sixteenths is None:
        return None
    return (after.lag_sixteenths - before.lag_sixteenths) * joint.transmission.microsteps / _SIXTEENTHS
