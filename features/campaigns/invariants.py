"""Invariants of every run, whatever goes wrong: nothing may fail in silence."""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.features.campaigns.margins import Performance
from steptwin.features.campaigns.row import Breach, Ended
from steptwin.features.faults.reaction import MotionEffect
from steptwin.host.client.words import RAN_DRY
from steptwin.host.common.arrays import Int8Array, Int64Array
from steptwin.host.verify import AxisEvidence
from steptwin.protocol.cia402 import ErrorCode

_STEPS_OFF_MAX: Final = 0.5
"""Largest distance in steps of a motor from the position that its drive reports; reports are whole units."""


@dataclass(frozen=True, slots=True)
class Invariant:
    """A condition that every run must meet.

    Attributes:
        what: the condition as text.
        asked: returns whether it applies to a run.
        broken: yields each violation in such a run, with a detail.
    """

    what: str
    asked: Callable[[Performance], bool]
    broken: Callable[[Performance], Iterator[tuple[str, str]]]


def _came_to_end(run: Performance) -> bool:
    return run.ended is Ended.DONE and run.outcome is not None


def _knowable(run: Performance) -> bool:
    return not run.unknowable


def _kept_current(run: Performance) -> bool:
    """Return whether nothing has happened that may move a motor off its steps."""
    return not any(fault.reaction is not None and fault.reaction.motion is MotionEffect.CUT for fault in run.faults)


def _silent_loss(run: Performance) -> Iterator[tuple[str, str]]:
    """Yield lost steps of a run that the host has ended without an error; it believes that every step is there."""
    for reason in run.reasons[:1]:
        yield "the motion was not as planned, and nothing said so", reason


def _unseen_loss(run: Performance) -> Iterator[tuple[str, str]]:
    """Yield losses that no board can notice and that the verifier missed; it judges steps, not rotors that slip."""
    for claim in run.claims if not run.reasons else ():
        lost_steps = claim.off_steps - claim.slipped_steps
        if abs(lost_steps) > _STEPS_OFF_MAX:
            yield (
                "steps were lost, and the verifier has not seen it",
                f"{claim.joint}: its motor is {lost_steps:+.4g} steps away, and the verifier counted every step;"
                f" {_STEPS_OFF_MAX:g} is rounding",
            )


def _edges_while_off(run: Performance) -> Iterator[tuple[str, str]]:
    for axis in run.axes:
        off = int(np.count_nonzero(_level_at(axis, "enable", axis.clk_rise_counts) == 0))
        if off:
            yield "pulses came while the drive was off", f"{axis.name}: {off} of {axis.clk_rise_counts.size} pulses"


def _level_at(axis: AxisEvidence, pin: str, counts: Int64Array) -> Int8Array:
    """Return the level of a pin at instants; it is low at power-up."""
    edges = axis.pins[pin]
    levels = np.concatenate([np.zeros(1, np.int8), edges.levels])
    return np.asarray(levels[np.searchsorted(edges.counts, counts, side="right")])


def _wrong_claims(run: Performance) -> Iterator[tuple[str, str]]:
    for claim in run.claims:
        if claim.known and abs(claim.off_steps) > _STEPS_OFF_MAX:
            yield (
                "the drive claims a position at which it is not",
                f"{claim.joint}: its motor stands {claim.off_steps:+.4g} steps from the position that its drive"
                f" reports; {_STEPS_OFF_MAX:g} is rounding",
            )


def _late_standstill(run: Performance) -> Iterator[tuple[str, str]]:
    for fault in run.faults:
        if fault.standstill_ms is not None and fault.limit_ms is not None and fault.standstill_ms > fault.limit_ms:
            yield (
                "the machine stood too late",
                f"{fault.name}: it stood after {fault.standstill_ms:.2f} ms; the documented limit is"
                f" {fault.limit_ms:.2f} ms",
            )


def _strange_answers(run: Performance) -> Iterator[tuple[str, str]]:
    joints = run.trial.setup.robot.joint_names
    for fault in run.faults:
        if fault.struck:
            for difference in fault.differences:
                yield _without_particulars(difference, joints), f"{fault.name}: {difference}"


def _without_particulars(text: str, joints: tuple[str, ...]) -> str:
    """Return a text without numbers and names of joints, which makes like violations alike; codes stay."""
    for name in joints:
        text = re.sub(rf"\b{re.escape(name)}\b", "JOINT", text)
    return re.sub(r"(?<![\w.])[-+]?\d+(\.\d+)?(?!\w)", "N", text)


def _ran_dry(run: Performance) -> Iterator[tuple[str, str]]:
    """Return whether a queue ran dry without an error code, as at standstill; only delayed points do it."""
    starved = any(fault.reaction and ErrorCode.PVT_UNDERRUN in fault.reaction.codes for fault in run.faults)
    if RAN_DRY in run.message and not starved:
        yield "the stream ran dry, and no fault explains it", run.message


def _not_recovered(run: Performance) -> Iterator[tuple[str, str]]:
    assert run.recovery is not None
    if run.recovery.failed:
        yield run.recovery.failed, run.recovery.detail


def _slipped(run: Performance) -> Iterator[tuple[str, str]]:
    assert run.motors is not None
    if not run.motors.kept_step:
        yield "a motor fell out of step", run.motors.reasons[0]


INVARIANTS: Final[Mapping[str, Invariant]] = {
    "program": Invariant("firmware, emulator and host raise nothing unexpected", lambda _: True, lambda _: iter(())),
    "steps": Invariant(
        "no step is lost without a signal", lambda run: _came_to_end(run) and _knowable(run), _silent_loss
    ),
    "verifier": Invariant("the verifier sees every loss", _came_to_end, _unseen_loss),
    "power": Invariant("no pulse comes while a drive is off", _knowable, _edges_while_off),
    "position": Invariant(
        "the position reported is the motor's, or is marked unknown",
        lambda run: _knowable(run) and bool(run.claims),
        _wrong_claims,
    ),
    "standstill": Invariant(
        "after a fault the machine stands within the documented time",
        lambda run: any(fault.standstill_ms is not None and fault.limit_ms is not None for fault in run.faults),
        _late_standstill,
    ),
    "stream": Invariant(
        "a stream runs dry only after a fault that may keep points away",
        lambda run: run.ended is Ended.STOPPED,
        _ran_dry,
    ),
    "answer": Invariant(
        "each fault is answered as documented",
        lambda run: any(fault.struck for fault in run.faults),
        _strange_answers,
    ),
    "recovery": Invariant(
        "after repair, reset and homing the machine works again",
        lambda run: run.recovery is not None,
        _not_recovered,
    ),
    "motors": Invariant(
        "no motor falls out of step, where motors are turned and keep their current",
        lambda run: run.motors is not None and _knowable(run) and _kept_current(run),
        _slipped,
    ),
}
"""Invariants by name, the gravest first; `program` is checked where a run is made."""


def asked_of(run: Performance) -> tuple[str, ...]:
    """Return the names of the invariants that apply to a run."""
    return tuple(name for name, invariant in INVARIANTS.items() if invariant.asked(run))


def breaches_of(run: Performance) -> tuple[Breach, ...]:
    """Return all violations in a run, the gravest first."""
    return tuple(Breach(name, what, detail) for name in asked_of(run) for what, detail in INVARIANTS[name].broken(run))
