"""Read drivers' limits with what a capture leaves open: an edge may be a sample earlier or later than it looks.

A limit that is broken though it is read as one sample wider is broken. A limit that is kept though it is read as one
sample narrower is kept. Of any other the capture cannot tell.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Final

from steptwin.emulator.drivers.driver_module import Module
from steptwin.host.verify import DriverLimit, DriverViolations
from steptwin.protocol.drivers import Coupler, DriverProfile, Fact, Grade, StepTimes
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
        grade: how the limit is known.
    """

    axis: str
    limit: DriverLimit
    kept: Kept
    count: int = 0
    grade: Grade = Grade.STATED

    def to_dict(self) -> dict[str, Any]:
        """Return the answer for JSON."""
        return {
            "axis": self.axis,
            "rule": self.limit.rule,
            "limit": self.limit.limit,
            "unit": self.limit.unit,
            "answer": self.kept.value,
            "count": self.count,
            "grade": self.grade.value,
            "certain": not self.unsure,
            "said": self.said,
        }

    def __str__(self) -> str:
        return f"{self.axis}: {self.said}"

    @property
    def said(self) -> str:
        """The answer in words, without the axis."""
        limit = f"{self.limit.limit:.4g} us" if self.limit.unit == _TIME else f"{self.limit.unit} {self.limit.limit:g}"
        said = f"{self.limit.rule} {limit} ({_SAID[self.grade]}): {self.kept.value}"
        if self.kept is Kept.BROKEN:
            said += f", {self.count} times"
        return f"{said}; cannot be told for certain, no source states it" if self.unsure else said

    @property
    def unsure(self) -> bool:
        """Whether a verdict rests on a guess: no source states the limit that is broken."""
        return self.grade is Grade.ASSUMED and self.kept is Kept.BROKEN


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
    axis: str,
    limits: tuple[DriverLimit, ...],
    surely: DriverViolations,
    perhaps: DriverViolations,
    grades: Mapping[str, Grade],
) -> list[LimitAnswer]:
    """Return the answer to each limit that is a time, once a rule, and to any other that is broken.

    Of two limits of a rule the one that is broken is told, or else the stricter one.

    Args:
        axis: name of the axis.
        limits: the driver's own limits.
        surely: violations of the widened ones, in the same order.
        perhaps: violations of the narrowed ones, likewise.
        grades: how the limits are known, by their rules.
    """
    found: dict[str, LimitAnswer] = {}
    for index, limit in enumerate(limits):
        broken, doubtful = (int((each.which == index).sum()) for each in (surely, perhaps))
        if limit.unit != _TIME and not broken and not doubtful:
            continue
        kept = Kept.BROKEN if broken else Kept.UNKNOWN if doubtful else Kept.KEPT
        answer = LimitAnswer(axis, limit, kept, broken or doubtful, grades.get(limit.rule, Grade.STATED))
        before = found.get(limit.rule)
        if before is None or _strictness(answer) > _strictness(before):
            found[limit.rule] = answer
    return list(found.values())


def _strictness(answer: LimitAnswer) -> tuple[int, float]:
    return _SEVERITY[answer.kept], answer.limit.limit


_SEVERITY: Final = {Kept.KEPT: 0, Kept.UNKNOWN: 1, Kept.BROKEN: 2}
_TIME: Final = "us"
_SAID: Final = {Grade.STATED: "datasheet", Grade.QUOTED: "quoted", Grade.ASSUMED: "assumed"}


def grades_of(profile: DriverProfile) -> dict[str, Grade]:
    """Return how each limit of a kind of driver is known, by its rule: as the worst known of the facts in it."""
    chip, clk, direction = profile.chip, profile.clk, profile.direction

    def worst(*facts: Fact[Any] | None) -> Grade:
        return max((fact.grade for fact in facts if fact is not None), key=_WORSE.index, default=Grade.STATED)

    def longer(name: str) -> Fact[int] | None:
        """Return the longer one of the chip's and the module's time."""
        facts = [fact for times in (chip.times, profile.times) if (fact := getattr(times, name)) is not None]
        return max(facts, key=lambda fact: fact.value, default=None)

    return {
        "clk_high": worst(longer("steplen_ns"), clk),
        "clk_low": worst(longer("stepspace_ns"), clk),
        "clk_period": worst(longer("rate_max_hz")),
        "dir_setup": worst(longer("dirsetup_ns"), clk, direction),
        "dir_hold": worst(longer("dirhold_ns"), clk, direction),
        "enable_setup": worst(longer("enable_ns"), profile.enable),
        "wake_up": worst(longer("wake_ns")),
        "disabled": worst(chip.blocked, profile.enable),
        "over_temperature": worst(chip.shutdown, profile.cooling),
        "too_hot": worst(chip.shutdown, profile.cooling),
    }


_WORSE: Final = (Grade.STATED, Grade.QUOTED, Grade.ASSUMED)
