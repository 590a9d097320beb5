"""What must hold in every run, whatever goes wrong: nothing may fail in silence."""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.campaign.performance import Performance
from steptwin.host.campaign.row import Breach, Ended
from steptwin.host.common.arrays import Int8Array, Int64Array
from steptwin.host.verify import AxisEvidence

_STEPS_OFF_MAX: Final = 0.5
"""Steps by which a motor may stand beside the position that its drive reports: reports are whole units of it."""


@dataclass(frozen=True, slots=True)
class Invariant:
    """Something that must hold: in words, and a function that yields what did not, with a detail."""

    what: str
    broken: Callable[[Performance], Iterator[tuple[str, str]]]


def _silent_loss(run: Performance) -> Iterator[tuple[str, str]]:
    """A host that came to the motion's end without an error takes it for done: then every step must be there."""
    if run.ended is Ended.DONE and run.outcome is not None and not run.unknowable:
        for reason in run.outcome.report.reasons[:1]:
            yield "the motion was not as planned, and nothing said so", reason


def _unseen_loss(run: Performance) -> Iterator[tuple[str, str]]:
    """What no board can know, the verifier must see."""
    if run.ended is Ended.DONE and run.outcome is not None and run.outcome.report.passed:
        for claim in run.claims:
            if abs(claim.off_steps) > _STEPS_OFF_MAX:
                yield "steps were lost, and the verifier has not seen it", f"{claim.joint}: {claim.off_steps:+.4g}"


def _edges_while_off(run: Performance) -> Iterator[tuple[str, str]]:
    if run.unknowable:
        return
    for axis in run.axes:
        off = int(np.count_nonzero(_level_at(axis, "enable", axis.clk_rise_counts) == 0))
        if off:
            yield "pulses came while the drive was off", f"{axis.name}: {off}"


def _level_at(axis: AxisEvidence, pin: str, counts: Int64Array) -> Int8Array:
    """Return the level of a pin at instants; it is low at power-up."""
    edges = axis.pins[pin]
    levels = np.concatenate([np.zeros(1, np.int8), edges.levels])
    return np.asarray(levels[np.searchsorted(edges.counts, counts, side="right")])


def _wrong_claims(run: Performance) -> Iterator[tuple[str, str]]:
    if run.unknowable:
        return
    for claim in run.claims:
        if claim.known and abs(claim.off_steps) > _STEPS_OFF_MAX:
            yield "the drive claims a position at which it is not", f"{claim.joint}: {claim.off_steps:+.4g} steps off"


def _late_standstill(run: Performance) -> Iterator[tuple[str, str]]:
    for fault in run.faults:
        if fault.standstill_ms is not None and fault.limit_ms is not None and fault.standstill_ms > fault.limit_ms:
            yield "the machine stood too late", f"{fault.name}: {fault.standstill_ms:.2f} of {fault.limit_ms:.2f} ms"


def _strange_answers(run: Performance) -> Iterator[tuple[str, str]]:
    joints = run.trial.setup.robot.joint_names
    for fault in run.faults:
        if fault.struck:
            for difference in fault.differences:
                yield _without_particulars(difference, joints), f"{fault.name}: {difference}"


def _without_particulars(text: str, joints: tuple[str, ...]) -> str:
    """Return a text without numbers and names of joints, so that like findings are alike; codes stay."""
    for name in joints:
        text = re.sub(rf"\b{re.escape(name)}\b", "JOINT", text)
    return re.sub(r"(?<![\w.])[-+]?\d+(\.\d+)?(?!\w)", "N", text)


def _not_recovered(run: Performance) -> Iterator[tuple[str, str]]:
    if run.recovery is not None and run.recovery.failed:
        yield run.recovery.failed, run.recovery.detail


def _slipped(run: Performance) -> Iterator[tuple[str, str]]:
    if run.motors is not None and not run.motors.kept_step:
        yield "a motor fell out of step", run.motors.reasons[0]


INVARIANTS: Final[Mapping[str, Invariant]] = {
    "program": Invariant("firmware, emulator and host raise nothing unexpected", lambda _: iter(())),
    "steps": Invariant("no step is lost without a signal", _silent_loss),
    "verifier": Invariant("the verifier sees every loss", _unseen_loss),
    "power": Invariant("no pulse comes while a drive is off", _edges_while_off),
    "position": Invariant("the position reported is the motor's, or is marked unknown", _wrong_claims),
    "standstill": Invariant("after a fault the machine stands within the documented time", _late_standstill),
    "answer": Invariant("each fault is answered as documented", _strange_answers),
    "recovery": Invariant("after repair, reset and homing the machine works again", _not_recovered),
    "motors": Invariant("no motor falls out of step, where motors are turned", _slipped),
}
"""The invariants by name, the gravest first; `program` is found where a run is made."""


def breaches_of(run: Performance) -> tuple[Breach, ...]:
    """Return everything that did not hold in a run, the gravest first."""
    return tuple(
        Breach(name, what, detail) for name, invariant in INVARIANTS.items() for what, detail in invariant.broken(run)
    )
