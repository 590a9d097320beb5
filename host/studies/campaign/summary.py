"""What a campaign has found: pass rates, worst cases, and the failed runs by their causes."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from math import sqrt
from typing import Any, Final, NamedTuple

from steptwin.host.studies.campaign.invariants import INVARIANTS
from steptwin.host.studies.campaign.margins import MARGINS
from steptwin.host.studies.campaign.row import Ended, Row

_Z: Final = 1.959963984540054
"""The normal distribution's 97.5 % quantile: intervals of 95 %."""


class PassRate(NamedTuple):
    """So many of some runs passed."""

    passed: int
    runs: int

    @property
    def rate(self) -> float:
        """Part of the runs that passed; NaN without runs."""
        return self.passed / self.runs if self.runs else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's score interval of 95 % for the true rate (E. B. Wilson, JASA 22, 1927); 0 to 1 without runs.

        It stays within 0 and 1 and is right for few runs and for rates near 1, as campaigns have them: after n runs
        that all passed the lower end is n / (n + 3.84).
        """
        if not self.runs:
            return 0.0, 1.0
        n, p, z2 = self.runs, self.passed / self.runs, _Z * _Z
        middle = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = _Z / (1 + z2 / n) * sqrt(p * (1 - p) / n + z2 / (4 * n * n))
        # The exact ends of these two cases are 0 and 1, which rounding would miss.
        lower = 0.0 if self.passed == 0 else middle - half
        upper = 1.0 if self.passed == self.runs else middle + half
        return lower, upper


_SEEDS_SHOWN: Final = 10
"""Seeds of each cause that are named."""


@dataclass(frozen=True, slots=True)
class Cause:
    """Runs that failed alike.

    Attributes:
        text: what failed, after which faults.
        runs: how many.
        seeds: their seeds, the first of them.
        example: what was found in the run of the first seed.
        robots: how many of them each robot had.
    """

    text: str
    runs: int
    seeds: tuple[int, ...]
    example: str
    robots: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class Worst:
    """The run that came nearest to a limit."""

    margin: str
    left: float
    row: Row


@dataclass(frozen=True, slots=True)
class Summary:
    """What a campaign has found.

    Attributes:
        planned: number of runs of the campaign.
        ended: how many runs ended in which way.
        all: the runs that passed, of all that were made.
        groups: the same for each robot, motion and scenario, by these words and by name.
        invariants: of the runs that were asked for each invariant, those where it held, by its name.
        struck: of the runs with each scenario, those where all its faults struck.
        worst: the run nearest to each limit, by the name of the margin.
        causes: the failed runs, the most frequent cause first.
        refused: why runs were not made, with how many.
        codes: in how many runs each error code was sent.
        simulated_s: simulated time of all runs.
        work_s: time that they took, added over all workers.
        versions: how many runs each version of StepTwin has made.
    """

    planned: int
    ended: Mapping[Ended, int]
    all: PassRate
    groups: Mapping[str, Mapping[str, PassRate]]
    invariants: Mapping[str, PassRate]
    struck: Mapping[str, PassRate]
    worst: tuple[Worst, ...]
    causes: tuple[Cause, ...]
    refused: Mapping[str, int]
    codes: Mapping[str, int]
    simulated_s: float
    work_s: float
    versions: Mapping[str, int]

    @property
    def made(self) -> int:
        """Number of runs whose rows are there."""
        return sum(self.ended.values())

    @property
    def never_struck(self) -> tuple[str, ...]:
        """Scenarios that proved nothing: in none of their runs did all their faults strike."""
        return tuple(name for name, rate in self.struck.items() if rate.runs and not rate.passed)

    @property
    def passed(self) -> bool:
        """True if nothing failed in silence, and every scenario struck at least once."""
        return not self.causes and not self.never_struck and self.all.runs > 0

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "runs": self.made,
            "planned": self.planned,
            "passed": self.passed,
            "ended": {kind.value: count for kind, count in self.ended.items()},
            "rate": _rate(self.all),
            **{what: {name: _rate(rate) for name, rate in rates.items()} for what, rates in self.groups.items()},
            "invariants": {name: _rate(rate) for name, rate in self.invariants.items()},
            "struck": {name: _rate(rate) for name, rate in self.struck.items()},
            "worst": [{"margin": each.margin, "left": each.left, **_place(each.row)} for each in self.worst],
            "causes": [
                {
                    "cause": cause.text,
                    "runs": cause.runs,
                    "seeds": list(cause.seeds),
                    "example": cause.example,
                    "robots": dict(cause.robots),
                }
                for cause in self.causes
            ],
            "refused": dict(self.refused),
            "codes": dict(self.codes),
            "simulated_s": self.simulated_s,
            "work_s": self.work_s,
            "versions": dict(self.versions),
        }


def _rate(rate: PassRate) -> dict[str, Any]:
    lower, upper = rate.interval
    return {"passed": rate.passed, "runs": rate.runs, "interval": [round(lower, 6), round(upper, 6)]}


def _place(row: Row) -> dict[str, Any]:
    return {"seed": row.seed, "robot": row.robot, "motion": row.motion, "scenario": row.scenario}


_BY: Final[Mapping[str, Callable[[Row], str]]] = {
    "robots": lambda row: row.robot,
    "motions": lambda row: row.motion,
    "scenarios": lambda row: row.scenario,
}


@dataclass(slots=True)
class _Count:
    passed: int = 0
    runs: int = 0

    def add(self, passed: bool) -> None:
        self.runs += 1
        self.passed += passed

    @property
    def rate(self) -> PassRate:
        return PassRate(self.passed, self.runs)


@dataclass(slots=True)
class _Failed:
    runs: int = 0
    rows: list[Row] = field(default_factory=list)
    robots: Counter[str] = field(default_factory=Counter)

    def add(self, row: Row) -> None:
        self.runs += 1
        self.robots[row.robot] += 1
        self.rows = sorted((*self.rows, row), key=lambda each: each.seed)[:_SEEDS_SHOWN]


@dataclass(slots=True)
class _Tally:
    ended: Counter[Ended] = field(default_factory=Counter)
    all: _Count = field(default_factory=_Count)
    groups: dict[str, dict[str, _Count]] = field(default_factory=lambda: {what: defaultdict(_Count) for what in _BY})
    asked: Counter[str] = field(default_factory=Counter)
    broken: Counter[str] = field(default_factory=Counter)
    struck: dict[str, _Count] = field(default_factory=lambda: defaultdict(_Count))
    worst: dict[str, Worst] = field(default_factory=dict)
    failed: dict[str, _Failed] = field(default_factory=lambda: defaultdict(_Failed))
    refused: Counter[str] = field(default_factory=Counter)
    codes: Counter[str] = field(default_factory=Counter)
    versions: Counter[str] = field(default_factory=Counter)
    simulated_s: float = 0.0
    work_s: float = 0.0

    def add(self, row: Row) -> None:
        self.ended[row.ended] += 1
        self.work_s += row.wall_s
        self.versions[row.version] += 1
        if row.ended is Ended.REFUSED:
            self.refused[row.message] += 1
            return
        self.all.add(row.passed)
        for what, of in _BY.items():
            self.groups[what][of(row)].add(row.passed)
        self.asked.update(row.asked)
        self.broken.update({breach.invariant for breach in row.breaches})
        self.codes.update(row.codes)
        if row.faults:
            self.struck[row.scenario].add(all(row.struck))
        for name, left in row.margins.items():
            if name not in self.worst or (left, row.seed) < (self.worst[name].left, self.worst[name].row.seed):
                self.worst[name] = Worst(name, left, row)
        if row.breaches:
            self.failed[row.cause].add(row)
        self.simulated_s += row.simulated_s

    def summary(self, planned: int) -> Summary:
        ordered = sorted(self.failed.items(), key=lambda item: (-item[1].runs, item[0]))
        return Summary(
            planned=planned,
            ended={kind: self.ended[kind] for kind in Ended if self.ended[kind]},
            all=self.all.rate,
            groups={what: {name: rates[name].rate for name in sorted(rates)} for what, rates in self.groups.items()},
            invariants={
                name: PassRate(self.asked[name] - self.broken[name], self.asked[name])
                for name in INVARIANTS
                if self.asked[name]
            },
            struck={name: self.struck[name].rate for name in sorted(self.struck)},
            worst=tuple(self.worst[name] for name in MARGINS if name in self.worst),
            causes=tuple(
                Cause(
                    text,
                    failed.runs,
                    tuple(row.seed for row in failed.rows),
                    str(failed.rows[0].breaches[0]),
                    dict(sorted(failed.robots.items())),
                )
                for text, failed in ordered
            ),
            refused=dict(self.refused.most_common()),
            codes=dict(sorted(self.codes.items())),
            simulated_s=self.simulated_s,
            work_s=self.work_s,
            versions=dict(sorted(self.versions.items())),
        )


def summarised(rows: Iterable[Row], planned: int) -> Summary:
    """Return what rows tell, a row a run, of a campaign with a planned number of runs."""
    tally = _Tally()
    for row in rows:
        tally.add(row)
    return tally.summary(planned)
