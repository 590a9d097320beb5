"""Read drivers' limits with what a capture leaves open: an edge may be a sample earlier or later than it looks.

A limit that is broken though it is read as one sample wider is broken. A limit that is kept though it is read as one
sample narrower is kept. Of any other the capture cannot tell.
"""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Final

from steptwin.emulator.drivers.driver_module import Module
from steptwin.host.verify import DriverLimit, DriverViolations
from steptwin.protocol.drivers import Coupler, StepTimes
from steptwin.protocol.timer import COUNTS_PER_SECOND, counts_of_ns

_TIMES: Final = ("steplen_ns", "stepspace_ns", "dirsetup_ns", "dirhold_ns", "wake_ns")
"""Times between two edges of STEP and DIR, or from the assumed supply; for ENABLE's its edge is moved."""


class Kept(StrEnum):
    """Whether a limit was kept."""

    KEPT = "kept"
    BROKEN = "broken"
    UNKNOWN = "cannot be told"


@dataclass(frozen=True, slots=True)
class LimitAnswer:
    """What a capture says of one limit of one axis' driver.

    Attributes:
        axis: name of the axis.
        limit: the limit.
        kept: the answer.
        count: number of pulses or edges that break it for certain, or that it cannot be told of.
    """

    axis: str
    limit: DriverLimit
    kept: Kept
    count: int = 0

    def to_dict(self) -> dict[str, Any]:
        """Return the answer for JSON."""
        return {
            "axis": self.axis,
            "rule": self.limit.rule,
            "limit": self.limit.limit,
            "unit": self.limit.unit,
            "answer": self.kept.value,
            "count": self.count,
        }


def read_within(module: Module, slack_counts: int) -> Module:
    """Return a module whose limits are wider by an uncertainty; with a negative one they are narrower."""
    chip = module.chip
    times = replace(_widened(chip.times, slack_counts), steplen_ns=_shortest_pulse(module, slack_counts))
    return replace(
        module,
        chip=replace(chip, oscillator=None, times=times),
        times=_widened(module.times, slack_counts),
        clk=_alike(module.clk, slack_counts),
    )


def _shortest_pulse(module: Module, slack_counts: int) -> Any:
    """Return the shortest pulse of the chip, which an oscillator may set, less the uncertainty."""
    fact = module.chip.times.steplen_ns
    if fact is None:
        return None
    return replace(fact, value=_ns(module.chip.pulse_min_counts - slack_counts))


def _widened(times: StepTimes, slack_counts: int) -> StepTimes:
    facts = {name: fact for name in _TIMES if (fact := getattr(times, name)) is not None and fact.value}
    changed = {name: replace(fact, value=_ns(counts_of_ns(fact.value) - slack_counts)) for name, fact in facts.items()}
    if rate := times.rate_max_hz:
        period_counts = max(COUNTS_PER_SECOND // rate.value - slack_counts, 1)
        changed["rate_max_hz"] = replace(rate, value=max(COUNTS_PER_SECOND // period_counts, 1))
    return replace(times, **changed)


def _ns(counts: int) -> int:
    """Return the largest time in ns that is so many counts, at least one."""
    return max(counts, 1) * 1000 // 72


def _alike(coupler: Coupler, slack_counts: int) -> Coupler:
    """Return a coupler whose two delays, whose difference swallows short pulses, are more alike by the uncertainty."""
    apart_ns = coupler.to_high_ns - coupler.to_low_ns
    if not apart_ns or not slack_counts:
        return coupler
    nearer_ns = min(_ns(slack_counts), abs(apart_ns)) if slack_counts > 0 else -_ns(-slack_counts)
    longer = "to_high_ns" if apart_ns > 0 else "to_low_ns"
    return replace(coupler, **{longer: getattr(coupler, longer) - nearer_ns})


def answers(
    axis: str, limits: tuple[DriverLimit, ...], surely: DriverViolations, perhaps: DriverViolations
) -> list[LimitAnswer]:
    """Return the answer to each limit that is a time, once a rule.

    Args:
        axis: name of the axis.
        limits: the driver's own limits.
        surely: violations of the widened ones, in the same order.
        perhaps: violations of the narrowed ones, likewise.
    """
    found: dict[str, LimitAnswer] = {}
    for index, limit in enumerate(limits):
        if limit.unit != "us":
            continue
        broken, doubtful = (int((each.which == index).sum()) for each in (surely, perhaps))
        kept = Kept.BROKEN if broken else Kept.UNKNOWN if doubtful else Kept.KEPT
        before = found.get(limit.rule)
        if before is None or _SEVERITY[kept] > _SEVERITY[before.kept]:
            found[limit.rule] = LimitAnswer(axis, limit, kept, broken or doubtful)
    return list(found.values())


_SEVERITY: Final = {Kept.KEPT: 0, Kept.UNKNOWN: 1, Kept.BROKEN: 2}
