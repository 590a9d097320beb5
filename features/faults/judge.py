"""Judge what a machine did after a fault: compare it with the reaction that is right, and its time to standstill."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from steptwin.features.faults.engine import Emergency, Played
from steptwin.features.faults.kinds.bus import BusFault
from steptwin.features.faults.kinds.harm import Harm
from steptwin.features.faults.moment import AxisMoment, Moment
from steptwin.features.faults.reaction import HOST_NOTICES_MS, TICK_MS, Motion, Reaction
from steptwin.features.faults.reactions import concerned
from steptwin.features.faults.report import JointAnswer
from steptwin.host.client.words import state_text
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Evidence
from steptwin.protocol.cia402 import ErrorCode, State
from steptwin.protocol.timer import COUNTS_PER_MS


def standstill_ms(evidence: Evidence, began_counts: int) -> float:
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


def _ramp_ms(moment: Moment) -> float:
    """Return how long the axes take to stop from their present speeds; the firmware rounds up to 1 ms."""
    velocities = (abs(axis.velocity) * 1_000_000 / (64 * axis.deceleration) for axis in moment.axes)
    return float(max(ceil(max(velocities)), 1))


def longest_ramp_ms(robot: Robot) -> float:
    """Return how long the axes of a robot take to stop from their highest speeds; the firmware rounds up to 1 ms."""
    return float(ceil(1000 * float(np.max(robot.axis_speeds_max / robot.axis_accelerations_max))))


@dataclass(frozen=True, slots=True)
class Answer:
    """What the machine did after a fault had begun.

    Attributes:
        emcys: the errors that it told before the next fault began.
        late: those among the reaction's codes that it told afterwards.
        standstill_ms: time to its last step before it stood because of the fault; None if the motion went on.
        joints: its joints at the end of the run, by name.
    """

    emcys: Sequence[Emergency]
    late: Sequence[Emergency]
    standstill_ms: float | None
    joints: Mapping[str, JointAnswer]


@dataclass(frozen=True)
class Judge:
    """Compares an answer with the reaction that is right.

    Attributes:
        played: the fault.
        began: what the machine did when it began.
        reaction: the reaction that is right.
        limit_ms: longest time to standstill; None if the motion goes on.
        answer: what the machine did.
        others: codes that answer other faults of the scenario.
        losses_told: True if steps may go missing by this fault or another one, and the run's verdict tells it.
    """

    played: Played
    began: Moment
    reaction: Reaction
    limit_ms: float | None
    answer: Answer
    others: Collection[ErrorCode]
    losses_told: bool

    def differences(self) -> list[str]:
        """Return what is not as it should be."""
        reaction, stood = self.reaction, self.answer.standstill_ms is not None
        found = [f"EMCY 0x{code:04X} is not documented" for code in self._strange_codes()]
        if reaction.stops and self._concerned and (stood or reaction.certain):
            found += self._wrong_stop()
        elif reaction.certain:
            found += [line for axis in self._concerned for line in self._untold(axis)]
        return found + self._losses()

    @property
    def _concerned(self) -> list[int]:
        """The axes that must answer: a drive that is off does not."""
        axes = self.began.axes
        return [axis for axis in concerned(self.played.harm, self.began.boards) if axes[axis].energised]

    def _strange_codes(self) -> list[int]:
        """Return the codes that were told and answer neither this fault nor another one."""
        reaction = self.reaction
        allowed = {*reaction.codes, *reaction.others, *self.others}
        if reaction.stops:
            allowed.add(ErrorCode.GROUP_STOPPED)
        if self.played.ended_counts is not None:  # one that ends soon changes reports twice: newer ones replace them
            allowed.add(ErrorCode.CAN_OVERRUN)
        return sorted({each.code for each in self.answer.emcys} - allowed)

    def _wrong_stop(self) -> list[str]:
        standstill_ms, limit_ms = self.answer.standstill_ms, self.limit_ms
        if standstill_ms is None:
            return ["the motion did not stop"]
        found = []
        for axis in self._concerned:
            found += self._untold(axis)
            found += self._wrong_end(axis)
        if limit_ms is not None and standstill_ms > limit_ms:
            found.append(f"stood after {standstill_ms:.2f} ms, later than {limit_ms:.2f} ms")
        return found

    def _untold(self, axis: int) -> list[str]:
        """Return that an axis has not reported the fault with a code of the reaction, if it has not and must.

        On a bus with faults its EMCY may be lost as well.
        """
        codes, answer = self.reaction.codes, self.answer
        if not codes or isinstance(self.played.harm, BusFault):
            return []
        if any(each.axis == axis and each.code in codes for each in (*answer.emcys, *answer.late)):
            return []
        name = list(answer.joints)[axis]
        return [f"{name}: no EMCY {' or '.join(f'0x{code:04X}' for code in codes)}"]

    def _wrong_end(self, axis: int) -> list[str]:
        """Return what is wrong with an axis that has stopped."""
        reaction, (name, joint) = self.reaction, list(self.answer.joints.items())[axis]
        found = []
        if reaction.state is not None and joint.state is not reaction.state and not self._switched_off(joint):
            found.append(f"{name}: in {state_text(joint.state)}, not in {state_text(reaction.state)}")
        if reaction.motion is Motion.CUT and _fast(self.began.axes[axis]) and joint.position_known:
            found.append(f"{name}: was cut off in motion and claims to know its position")
        return found

    def _switched_off(self, joint: JointAnswer) -> bool:
        """Return whether the host has switched a drive off: at the motion's end, or to stop it with others."""
        return not self.reaction.certain and joint.state is State.SWITCH_ON_DISABLED and joint.position_known

    def _losses(self) -> list[str]:
        """Return what was lost in silence: an axis that claims to know its position has another one."""
        if self.losses_told:
            return []
        return [
            f"{name}: {joint.lost_steps:g} steps lost in silence"
            for name, joint in self.answer.joints.items()
            if joint.lost_steps and joint.position_known
        ]


def _fast(axis: AxisMoment) -> bool:
    """Return whether an axis moved so fast that it cannot have stopped within a millisecond."""
    return abs(axis.velocity) * 1_000_000 > axis.deceleration * 64
