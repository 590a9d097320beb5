"""Report a played scenario: when each fault was due and struck, what answered, and whether that is documented."""

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import Any

from steptwin.features.faults.engine import Emergency, Engine, Played
from steptwin.features.faults.judge import Answer, Judge, standstill_limit_ms, standstill_ms
from steptwin.features.faults.moment import AxisMoment, Moment, moment_of
from steptwin.features.faults.reaction import Motion, Reaction
from steptwin.features.faults.reactions import documented
from steptwin.features.faults.report import FaultReport, JointAnswer, ScenarioReport, Told
from steptwin.features.faults.requests import request_of
from steptwin.features.faults.triggers import AtTime
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.outcome import RunEnd
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND


def scenario_report(engine: Engine, end: RunEnd) -> ScenarioReport:
    """Report the scenario that an engine has played to the end of a run, which is now."""
    moment = moment_of(engine.target)
    faults = tuple(_fault_report(engine, each, end, moment) for each in engine.played)
    reasons = [f"{fault.name}: {difference}" for fault in faults for difference in fault.differences]
    if not any(fault.reaction is not None and not fault.reaction.verified for fault in faults):
        reasons += end.reasons
    if end.stopped and not any(map(_may_stop, faults)):
        reasons.append("the motion stopped, and no fault of the scenario may stop it")
    if end.not_begun:
        reasons.append(end.not_begun)
    scenario = engine.scenario
    return ScenarioReport(scenario.name, scenario.seed, faults, tuple(reasons))


def _may_stop(fault: FaultReport) -> bool:
    """Return whether the motion may end because of a fault."""
    return fault.reaction is not None and (fault.reaction.stops or not fault.reaction.certain)


def _fault_report(engine: Engine, played: Played, end: RunEnd, moment: Moment) -> FaultReport:
    facts, began = _facts(engine, played), played.began
    if began is None or not facts.struck:
        return replace(
            facts, ended_s=None, emcys=(), differences=(f"never struck: {_why_never(engine, played, end, moment)}",)
        )
    row = documented(played.harm, began)
    reaction = played.fault.expected or row.reaction
    limit_ms = _limit_ms(engine, played, reaction, began) if reaction.stops else None
    answer = _answer(engine, reaction, began, end, moment)
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
    return replace(
        facts,
        standstill_ms=answer.standstill_ms,
        joints=answer.joints,
        what=row.what,
        reaction=reaction,
        limit_ms=limit_ms,
        differences=tuple(differences),
    )


def _facts(engine: Engine, played: Played) -> FaultReport:
    """Return what has become of a fault so far, without a judgement."""
    fault, began = played.fault, played.began
    return FaultReport(
        fault.name,
        request_of(engine.target.robot, fault.harm),
        str(fault.trigger),
        struck_s=None if played.first_counts is None else seconds(engine, played.first_counts),
        strikes=played.strikes,
        ended_s=None if played.ended_counts is None else seconds(engine, played.ended_counts),
        emcys=() if began is None else told(engine, answers(engine, began), began),
    )


def _limit_ms(engine: Engine, played: Played, reaction: Reaction, began: Moment) -> float:
    """Return the longest time to standstill: a board keeps its limits by its own crystal, which may be slow."""
    slow_ppm = max(0, *(-board.config.crystal_ppm for board in engine.target.simulation.boards))
    return standstill_limit_ms(engine.target.robot, played.harm, reaction, began) * (1 + slow_ppm / 1e6)


def _answer(engine: Engine, reaction: Reaction, began: Moment, end: RunEnd, moment: Moment) -> Answer:
    """Return what the machine did after a fault had begun."""
    emcys = answers(engine, began)
    late = [each for each in later_errors(engine, began) if each.code in reaction.codes]
    stopped = end.stopped and (_stops_within([*emcys, *late]) or (reaction.stops and not reaction.codes))
    return Answer(
        emcys,
        late,
        standstill_ms(end.evidence, began.counts) if stopped else None,
        _joints(engine.target.robot, engine.counted_from(began), moment),
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
    stopped_too = [ErrorCode.GROUP_STOPPED] if reaction.stops else []
    return {*reaction.codes, *reaction.others, *stopped_too, ErrorCode.CAN_OVERRUN}


def _unknowable(played: Played) -> bool:
    """Return whether a fault has begun that makes steps go missing without any board's knowledge."""
    reaction = _reaction(played)
    return reaction is not None and not reaction.verified


def _stops_within(emcys: Sequence[Emergency]) -> bool:
    """Return whether any of these errors stops a motion: errors of the bus alone do not."""
    return any(not _of_bus(each.code) for each in emcys)


def _of_bus(code: int) -> bool:
    known = code in set(ErrorCode) and ErrorCode(code)
    return bool(known) and ErrorCode(code).communication and not ErrorCode(code).lost_connection


def _why_never(engine: Engine, played: Played, end: RunEnd, moment: Moment) -> str:
    trigger = played.fault.trigger
    if played.began is not None:
        return f"it began at {seconds(engine, played.began.counts):g} s, but has struck none of the frames sent since"
    why = "" if played.watch is None else played.watch.missing()
    if not why and isinstance(trigger, AtTime):
        why = f"the motion ended at {end.ended_s:g} s, before at_s {trigger.at_s:g}"
        if trigger.from_power_up:
            why = f"the run ended {moment.counts / COUNTS_PER_SECOND:g} s after power-up"
    return f"{trigger}: {why}"


def _joints(robot: Robot, began: Moment | None, end: Moment) -> dict[str, JointAnswer]:
    return {
        joint.name: JointAnswer(after.state, after.position_known, _lost_steps(joint, before, after))
        for joint, before, after in zip(robot.axes, (began or end).axes, end.axes, strict=True)
    }


def _lost_steps(joint: Joint, before: AxisMoment, after: AxisMoment) -> float | None:
    """Return the steps that were lost between two instants; None after a restart, or if a lag was not read."""
    if before.boot is not after.boot or before.lag_full_steps is None or after.lag_full_steps is None:
        return None
    return (after.lag_full_steps - before.lag_full_steps) * joint.transmission.microsteps


def answers(engine: Engine, began: Moment) -> list[Emergency]:
    """Return the errors that were told from the beginning of a fault to that of the next one, whose answers follow."""
    until_counts = _next_counts(engine, began)
    return [each for each in _told_since(engine, began) if each.counts < until_counts]


def later_errors(engine: Engine, began: Moment) -> list[Emergency]:
    """Return the errors that were told after the fault next to this one had begun."""
    from_counts = _next_counts(engine, began)
    return [each for each in _told_since(engine, began) if each.counts >= from_counts]


def told(engine: Engine, emergencies: Sequence[Emergency], began: Moment) -> tuple[Told, ...]:
    """Return errors with the names of their joints, and how long after a fault's beginning they were on the bus."""
    names = engine.target.robot.axis_names
    return tuple(
        Told(names[each.axis], each.code, (each.counts - began.counts) / COUNTS_PER_MS) for each in emergencies
    )


def seconds(engine: Engine, counts: int) -> float:
    """Return an instant in seconds from the motion's start; from power-up if there was no motion."""
    return (counts - (engine.start_counts or 0)) / COUNTS_PER_SECOND


def _told_since(engine: Engine, began: Moment) -> list[Emergency]:
    return [each for each in engine.emergencies if each.counts >= began.counts and each.code]


def _next_counts(engine: Engine, began: Moment) -> float:
    """Return the instant when the next fault begins; infinity if none does."""
    begins = [each.began.counts for each in engine.played if each.began is not None]
    return min((counts for counts in begins if counts > began.counts), default=inf)


def played_document(engine: Engine) -> dict[str, Any]:
    """Return what has become of each fault so far, under the keys of report.json, without a judgement.

    A live board has no end and no plan of its own: how hosts answer is their own affair.
    """
    scenario = engine.scenario
    return {
        "scenario": {"name": scenario.name, "seed": scenario.seed},
        "faults": [_facts(engine, each).so_far() for each in engine.played],
    }
