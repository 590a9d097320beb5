"""Report a played scenario: when each fault was due and struck, what answered, and whether that is documented."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, inf
from typing import Any

import numpy as np

from steptwin.emulator.bus_faults import BusFault
from steptwin.host.client.words import state_text
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.control.operations import request_of
from steptwin.host.twin.scenarios.engine import Emergency, Engine, Played
from steptwin.host.twin.scenarios.harms import Harm
from steptwin.host.twin.scenarios.moment import AxisMoment, Moment
from steptwin.host.twin.scenarios.reactions import HOST_NOTICES_MS, TICK_MS, Motion, Reaction, concerned, documented
from steptwin.host.twin.scenarios.triggers import AtTime
from steptwin.host.verify import Evidence
from steptwin.protocol.cia402 import ErrorCode, State
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

_SIXTEENTHS = 16
"""Sixteenths of a full step in a full step."""


@dataclass(frozen=True, slots=True)
class Told:
    """An EMCY that answered a fault: joint, error code, and how long after the fault's beginning it was on the bus."""

    joint: str
    code: int
    after_ms: float

    def to_dict(self) -> dict[str, Any]:
        """Return it under the keys of report.json."""
        return {"joint": self.joint, "code": f"0x{self.code:04X}", "after_ms": round(self.after_ms, 3)}


@dataclass(frozen=True, slots=True)
class JointAnswer:
    """A joint at the end of the run.

    Attributes:
        state: state of its drive.
        position_known: whether the firmware says that it knows the position.
        lost_steps: steps that the firmware has counted since the fault's beginning and the driver has not; None if the
            board has started anew since, which nobody has counted over.
    """

    state: State
    position_known: bool
    lost_steps: float | None


@dataclass(frozen=True, slots=True)
class FaultReport:
    """One fault.

    Attributes:
        name: its name in the scenario.
        request: what it does, as a request of the control port.
        due: its trigger in words.
        struck_s: instant of its first strike, in seconds from the motion's start, or from power-up without one; None:
            it never struck.
        strikes: number of its strikes.
        ended_s: instant of its end; None if it lasted.
        emcys: the EMCYs from its beginning to that of the next fault.
        standstill_ms: time from its beginning to the last step before the machine stood; None if it went on.
        joints: the joints at the end of the run, by name.
        what: the fault in the words of the table of documented reactions; empty if it never struck.
        reaction: the reaction that is right; None if it never struck.
        limit_ms: longest time to standstill; None if the motion goes on.
        differences: what was not as it should be, in words.
    """

    name: str
    request: Mapping[str, Any]
    due: str
    struck_s: float | None
    strikes: int
    ended_s: float | None
    emcys: tuple[Told, ...]
    standstill_ms: float | None
    joints: Mapping[str, JointAnswer]
    what: str
    reaction: Reaction | None
    limit_ms: float | None
    differences: tuple[str, ...]

    @property
    def struck(self) -> bool:
        """True if it did something."""
        return self.struck_s is not None

    @property
    def as_documented(self) -> bool:
        """True if it struck and the machine answered as it should."""
        return self.struck and not self.differences

    def to_dict(self) -> dict[str, Any]:
        """Return the fault under the keys of report.json."""
        reaction = self.reaction
        return {
            "name": self.name,
            "do": dict(self.request),
            "due": self.due,
            "struck_s": _rounded(self.struck_s),
            "strikes": self.strikes,
            "ended_s": _rounded(self.ended_s),
            "emcys": [told.to_dict() for told in self.emcys],
            "standstill_ms": _rounded(self.standstill_ms),
            "joints": {
                name: {
                    "state": state_text(joint.state),
                    "position_known": joint.position_known,
                    "lost_steps": joint.lost_steps,
                }
                for name, joint in self.joints.items()
            },
            "documented": None
            if reaction is None
            else {
                "what": self.what,
                "motion": reaction.motion.value,
                "codes": [f"0x{code:04X}" for code in reaction.codes],
                "state": None if reaction.state is None else state_text(reaction.state),
                "standstill_ms": None if self.limit_ms in (None, inf) else self.limit_ms,
                "certain": reaction.certain,
            },
            "as_documented": self.as_documented,
            "differences": list(self.differences),
        }


@dataclass(frozen=True, slots=True)
class ScenarioReport:
    """A played scenario: its faults in the order of the scenario, and why it failed; no reasons if it passed."""

    name: str
    seed: int
    faults: tuple[FaultReport, ...]
    reasons: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """True if every fault struck, was answered as documented, and nothing was lost in silence."""
        return not self.reasons

    def to_dict(self) -> dict[str, Any]:
        """Return the scenario under the keys of report.json."""
        return {
            "scenario": {
                "name": self.name,
                "seed": self.seed,
                "passed": self.passed,
                "reasons": list(self.reasons),
            },
            "faults": [fault.to_dict() for fault in self.faults],
        }


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
    begins = sorted(each.began.counts for each in engine.played if each.began is not None)
    faults = tuple(_fault_report(engine, each, end, _window_end(each, begins)) for each in engine.played)
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


def played_document(engine: Engine) -> dict[str, Any]:
    """Return what has become of each fault so far, under the keys of report.json, without a judgement.

    A live board has no end and no plan of its own: how hosts answer is their own affair.
    """
    scenario = engine.scenario
    begins = sorted(each.began.counts for each in engine.played if each.began is not None)
    return {
        "scenario": {"name": scenario.name, "seed": scenario.seed},
        "faults": [_played_document(engine, each, _window_end(each, begins)) for each in engine.played],
    }


def _played_document(engine: Engine, played: Played, until_counts: float) -> dict[str, Any]:
    robot, began = engine.target.robot, played.began
    emcys = [] if began is None else _answers(engine, began, until_counts)
    return {
        **_named(robot, played),
        "struck_s": None if played.first_counts is None else round(_seconds(engine, played.first_counts), 6),
        "strikes": played.strikes,
        "ended_s": None if played.ended_counts is None else round(_seconds(engine, played.ended_counts), 6),
        "emcys": [] if began is None else [_told(robot, each, began.counts).to_dict() for each in emcys],
    }


def _named(robot: Robot, played: Played) -> dict[str, Any]:
    fault = played.fault
    return {"name": fault.name, "do": request_of(robot, fault.harm), "due": str(fault.trigger)}


def _answers(engine: Engine, began: Moment, until_counts: float) -> list[Emergency]:
    """Return the errors that were told from the beginning of a fault to that of the next one."""
    return [each for each in engine.emergencies if began.counts <= each.counts < until_counts and each.code]


def _window_end(played: Played, begins: Sequence[int]) -> float:
    """Return the instant at which the next fault begins, whose answers are its own."""
    began = played.began
    return min((counts for counts in begins if began is not None and counts > began.counts), default=inf)


def _fault_report(engine: Engine, played: Played, end: RunEnd, until_counts: float) -> FaultReport:
    robot, fault, began = engine.target.robot, played.fault, played.began
    named = fault.name, request_of(robot, fault.harm), str(fault.trigger)
    if began is None or played.first_counts is None:
        why = _why_never(engine, played, end)
        return FaultReport(*named, None, 0, None, (), None, {}, "", None, None, (f"never struck: {why}",))
    row = documented(played.harm, began)
    reaction = fault.expected or row.reaction
    emcys = _answers(engine, began, until_counts)
    late = [
        each for each in _answers(engine, began, inf) if each.counts >= until_counts and each.code in reaction.codes
    ]
    stopped = end.stopped and (_stops_within([*emcys, *late]) or (reaction.stops and not reaction.codes))
    standstill_ms = _standstill_ms(end.evidence, began.counts) if stopped else None
    limit_ms = standstill_limit_ms(robot, played.harm, reaction, began) if reaction.stops else None
    if limit_ms is not None:
        limit_ms *= 1 + _slow_ppm(engine) / 1e6  # a board keeps its limits by its own crystal
    joints = _joints(robot, engine.counted_from(began), end.moment)
    unknowable = not reaction.verified or any(map(_unknowable, engine.played))
    told = unknowable and (bool(end.reasons) or end.stopped)  # a stopped run says whether the drivers agree
    others = {code for each in engine.played if each is not played for code in _codes(each)}
    judge = _Judge(robot, played, reaction, emcys, joints, late=late, others=others, stopped=stopped, told=told)
    differences = judge.differences(standstill_ms, limit_ms)
    if reaction.motion is Motion.NOT_BEGUN and reaction.certain and engine.start_counts is not None:
        differences.append("the motion began")
    return FaultReport(
        *named,
        _seconds(engine, played.first_counts),
        played.strikes,
        None if played.ended_counts is None else _seconds(engine, played.ended_counts),
        tuple(_told(robot, each, began.counts) for each in emcys),
        standstill_ms,
        joints,
        row.what,
        reaction,
        limit_ms,
        tuple(differences),
    )


def _codes(played: Played) -> set[ErrorCode]:
    """Return the codes with which a fault that has struck may be answered, even after the next one has begun."""
    if played.began is None:
        return set()
    reaction = played.fault.expected or documented(played.harm, played.began).reaction
    # Reports that change again before they are sent are replaced, which the board tells.
    return {*reaction.codes, *([ErrorCode.GROUP_STOPPED] if reaction.stops else []), ErrorCode.CAN_OVERRUN}


def _unknowable(played: Played) -> bool:
    """Return whether a fault has struck that makes steps go missing of which no board can know."""
    if played.began is None:
        return False
    return not (played.fault.expected or documented(played.harm, played.began).reaction).verified


def _stops_within(emcys: Sequence[Emergency]) -> bool:
    """Return whether any of these errors stops a motion: errors of the bus alone do not."""
    return any(not _of_bus(each.code) for each in emcys)


def _of_bus(code: int) -> bool:
    known = code in set(ErrorCode) and ErrorCode(code)
    return bool(known) and ErrorCode(code).communication and code != ErrorCode.HEARTBEAT_LOST


class _Judge:
    """Compares an answer with the reaction that is right."""

    def __init__(
        self,
        robot: Robot,
        played: Played,
        reaction: Reaction,
        emcys: Sequence[Emergency],
        joints: Mapping[str, JointAnswer],
        *,
        late: Sequence[Emergency],
        others: Collection[ErrorCode],
        stopped: bool,
        told: bool,
    ) -> None:
        """Compare.

        Args:
            robot: the machine.
            played: the fault.
            reaction: the reaction that is right.
            emcys: the EMCYs that answered.
            joints: the joints at the end.
            late: answers to it that came after the next fault had begun.
            others: codes that answer other faults of the scenario.
            stopped: whether the motion ended before its time because of the fault.
            told: True if steps may go missing by this fault or another one, and the run's verdict tells it.
        """
        self._told = told
        self._of_bus = isinstance(played.harm, BusFault)
        self._names = robot.joint_names
        self._reaction = reaction
        self._began = played.began
        self._ended_counts = played.ended_counts
        self._emcys = emcys
        self._late = late
        self._others = others
        self._stopped = stopped
        self._joints = list(joints.values())
        on = [axis for axis, each in enumerate(self._axes) if each.energised]
        self._concerned = [axis for axis in concerned(played.harm, self._boards) if axis in on]
        """The axes that must answer: a drive that is off does not."""

    @property
    def _boards(self) -> tuple[int, ...]:
        return () if self._began is None else self._began.boards

    @property
    def _axes(self) -> tuple[AxisMoment, ...]:
        return () if self._began is None else self._began.axes

    def differences(self, standstill_ms: float | None, limit_ms: float | None) -> list[str]:
        """Return what is not as it should be."""
        reaction = self._reaction
        allowed = {*reaction.codes, *([ErrorCode.GROUP_STOPPED] if reaction.stops else []), *self._of_reports}
        allowed |= {*self._others, *reaction.others}
        strange = sorted({each.code for each in self._emcys} - allowed)
        found = [f"EMCY 0x{code:04X} is not documented" for code in strange]
        if reaction.stops and self._concerned and (self._stopped or reaction.certain):
            found += self._wrong_stop(standstill_ms, limit_ms)
        elif reaction.certain:
            found += [line for axis in self._concerned for line in self._untold(axis)]
        return found + self._losses()

    @property
    def _must_tell(self) -> bool:
        """True if each axis concerned must say so: on a bus with faults its EMCY may be lost as well."""
        return bool(self._reaction.codes) and not self._of_bus

    @property
    def _of_reports(self) -> tuple[ErrorCode, ...]:
        """The error of reports that newer ones have replaced: a fault that ends soon changes them twice in a row."""
        return () if self._ended_counts is None else (ErrorCode.CAN_OVERRUN,)

    def _wrong_stop(self, standstill_ms: float | None, limit_ms: float | None) -> list[str]:
        reaction = self._reaction
        if standstill_ms is None:
            return ["the motion did not stop"]
        found = []
        for axis in self._concerned:
            found += self._untold(axis)
            joint = self._joints[axis]
            if reaction.state is not None and joint.state is not reaction.state and not self._switched_off(joint):
                found.append(f"{self._names[axis]}: in {state_text(joint.state)}, not in {state_text(reaction.state)}")
            if reaction.motion is Motion.CUT and _fast(self._axes[axis]) and joint.position_known:
                found.append(f"{self._names[axis]}: was cut off in motion and claims to know its position")
        if limit_ms is not None and standstill_ms > limit_ms:
            found.append(f"stood after {standstill_ms:.2f} ms, later than {limit_ms:.2f} ms")
        return found

    def _untold(self, axis: int) -> list[str]:
        """Return that an axis has not reported the fault with a code of the reaction, if it has not and must."""
        codes = self._reaction.codes
        heard = {each.code for each in (*self._emcys, *self._late) if each.axis == axis}
        if not self._must_tell or heard & {*codes}:
            return []
        return [f"{self._names[axis]}: no EMCY {' or '.join(f'0x{code:04X}' for code in codes)}"]

    def _switched_off(self, joint: JointAnswer) -> bool:
        """Return whether the host has switched a drive off: at the motion's end, or to stop it with others."""
        return not self._reaction.certain and joint.state is State.SWITCH_ON_DISABLED and joint.position_known

    def _losses(self) -> list[str]:
        """Return what was lost in silence: an axis that claims to know its position has another one."""
        if self._told:
            return []
        return [
            f"{name}: {joint.lost_steps:g} steps lost in silence"
            for name, joint in zip(self._names, self._joints, strict=True)
            if joint.lost_steps and joint.position_known
        ]


def _fast(axis: AxisMoment) -> bool:
    """Return whether an axis moved so fast that it cannot have stopped within a millisecond."""
    return abs(axis.velocity) * 1_000_000 > axis.deceleration * 64


def _why_never(engine: Engine, played: Played, end: RunEnd) -> str:
    trigger = played.fault.trigger
    if played.began is not None:
        return f"it began at {_seconds(engine, played.began.counts):g} s, but has struck none of the frames sent since"
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
    """Return the steps that were lost between two instants; None if nobody knows."""
    if before.boot is not after.boot or before.lag_sixteenths is None or after.lag_sixteenths is None:
        return None
    return (after.lag_sixteenths - before.lag_sixteenths) * joint.transmission.microsteps / _SIXTEENTHS


def _standstill_ms(evidence: Evidence, began_counts: int) -> float:
    """Return the time from an instant to the last step of any axis; 0 if there was none after it."""
    lasts = [int(axis.step_counts[-1]) for axis in evidence.axes if axis.step_counts.size]
    return max(max(lasts, default=began_counts) - began_counts, 0) / COUNTS_PER_MS


def standstill_limit_ms(robot: Robot, harm: Harm, reaction: Reaction, began: Moment) -> float:
    """Return the longest time from a harm's beginning to the last step.

    Axes that stop with one whose pulses end at once do so by a ramp as well. A ramp that begins at once is that from
    the present speeds, which may rise for a tick. Axes on other boards are stopped by the host.
    """
    axes = concerned(harm, began.boards)
    if reaction.motion is Motion.CUT and len(axes) == len(began.axes):
        return reaction.begins_ms
    if reaction.begins_ms <= TICK_MS and began.several_boards and len(axes) < len(began.axes):
        return HOST_NOTICES_MS + longest_ramp_ms(robot)
    if reaction.begins_ms <= TICK_MS:
        return reaction.begins_ms + min(_ramp_ms(began) + TICK_MS, longest_ramp_ms(robot))
    return reaction.begins_ms + longest_ramp_ms(robot)


def _slow_ppm(engine: Engine) -> int:
    """Return by how many parts per million the slowest crystal of the boards is slow."""
    return max(0, *(-board.config.crystal_ppm for board in engine.target.simulation.boards))


def _ramp_ms(moment: Moment) -> float:
    """Return how long the axes take to stop from their present speeds; the firmware rounds up to 1 ms."""
    velocities = (abs(axis.velocity) * 1_000_000 / (64 * axis.deceleration) for axis in moment.axes)
    return float(max(ceil(max(velocities)), 1))


def longest_ramp_ms(robot: Robot) -> float:
    """Return how long the axes of a robot take to stop from their highest speeds; the firmware rounds up to 1 ms."""
    return float(ceil(1000 * float(np.max(robot.axis_speeds_max / robot.axis_accelerations_max))))


def _told(robot: Robot, emergency: Emergency, began_counts: int) -> Told:
    after_ms = (emergency.counts - began_counts) / COUNTS_PER_MS
    return Told(robot.joint_names[emergency.axis], emergency.code, after_ms)


def _seconds(engine: Engine, counts: int) -> float:
    """Return an instant in seconds from the motion's start; from power-up if there was no motion."""
    return (counts - (engine.start_counts or 0)) / COUNTS_PER_SECOND


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 6)
