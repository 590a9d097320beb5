"""Results of a campaign: pass rates, worst cases, and the failed runs by cause."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from heapq import nsmallest
from math import sqrt
from typing import Any, Final, NamedTuple

from steptwin.features.campaigns.invariants import INVARIANTS
from steptwin.features.campaigns.margins import all_margins
from steptwin.features.campaigns.row import Ended, Row

_Z: Final = 1.959963984540054
"""The normal distribution's 97.5 % quantile: intervals of 95 %."""


class PassRate(NamedTuple):
    """Number of passed runs among some runs."""

    passed: int
    runs: int

    @property
    def rate(self) -> float:
        """Fraction of the runs that passed; NaN without runs."""
        return self.passed / self.runs if self.runs else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's score interval of 95 % for the true rate (E. B. Wilson, JASA 22, 1927); 0 to 1 without runs.

        It stays within 0 and 1 and is accurate for few runs and for rates near 1, as campaigns have them. If all of n
        runs passed, its lower end is n / (n + 3.84).
        """
        if not self.runs:
            return 0.0, 1.0
        n, p, z2 = self.runs, self.passed / self.runs, _Z * _Z
        middle = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = _Z / (1 + z2 / n) * sqrt(p * (1 - p) / n + z2 / (4 * n * n))
        # The exact ends of these two cases are 0 and 1; rounding would miss them.
        lower = 0.0 if self.passed == 0 else middle - half
        upper = 1.0 if self.passed == self.runs else middle + half
        return lower, upper


_SEEDS_SHOWN: Final = 10
"""Number of seeds that are named for each cause."""


@dataclass(frozen=True, slots=True)
class Cause:
    """Runs that failed in the same way.

    Attributes:
        text: the failure, and the faults before it.
        runs: number of runs.
        seeds: the first of their seeds.
        example: violation in the run of the first seed.
        robots: number of these runs by robot.
    """

    text: str
    runs: int
    seeds: tuple[int, ...]
    example: str
    robots: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class Worst:
    """Run with the least margin to a limit."""

    margin: str
    left: float
    row: Row


@dataclass(frozen=True, slots=True)
class Summary:
    """Results of a campaign.

    Attributes:
        planned: number of runs of the campaign.
        ended: number of runs by their end.
        all: passed runs among all runs.
        groups: passed runs for each robot, motion and scenario, by these words and by name.
        invariants: runs that met each invariant among those that it applies to, by name.
        struck: runs with strikes of all their faults, among the runs of each scenario.
        worst: run nearest to each limit, by the name of the margin.
        causes: causes of failed runs, the most frequent first.
        refused: number of runs that were not made, by reason.
        codes: number of runs with each error code.
        simulated_s: simulated time of all runs.
        work_s: computing time of all workers.
        versions: number of runs by version of StepTwin.
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
        """Number of runs with rows."""
        return sum(self.ended.values())

    @property
    def never_struck(self) -> tuple[str, ...]:
        """Scenarios that proved nothing: none of their runs had strikes of all faults."""
        return tuple(name for name, rate in self.struck.items() if rate.runs and not rate.passed)

    @property
    def passed(self) -> bool:
        """True if no run failed in silence, and every scenario struck at least once."""
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


@dataclass(slots=True)
class _Tally:
    """Totals of the rows so far."""

    rates: dict[str, dict[str, PassRate]] = field(default_factory=lambda: defaultdict(dict))
    """Pass rates by name for each kind: robots, motions, scenarios, invariants ..."""
    robots: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    """Failed runs by cause and robot."""
    first: dict[str, list[Row]] = field(default_factory=lambda: defaultdict(list))
    """Rows of the lowest seeds of each cause."""
    worst: dict[str, Worst] = field(default_factory=dict)
    ended: Counter[Ended] = field(default_factory=Counter)
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
        for kind, name in (("", ""), ("robots", row.robot), ("motions", row.motion), ("scenarios", row.scenario)):
            self._count(kind, name, row.passed)
        broken = {breach.invariant for breach in row.breaches}
        for name in row.asked:
            self._count("invariants", name, name not in broken)
        if row.faults:
            self._count("struck", row.scenario, all(row.struck))
        self.codes.update(row.codes)
        for name, left in row.margins.items():
            if name not in self.worst or (left, row.seed) < (self.worst[name].left, self.worst[name].row.seed):
                self.worst[name] = Worst(name, left, row)
        if row.breaches:
            self.robots[row.cause][row.robot] += 1
            self.first[row.cause] = nsmallest(_SEEDS_SHOWN, (*self.first[row.cause], row), key=lambda each: each.seed)
        self.simulated_s += row.simulated_s

    def _count(self, kind: str, name: str, passed: bool) -> None:
        before = self.rates[kind].get(name, PassRate(0, 0))
        self.rates[kind][name] = PassRate(before.passed + passed, before.runs + 1)

    def summary(self, planned: int) -> Summary:
        causes = [
            Cause(
                text,
                robots.total(),
                tuple(row.seed for row in self.first[text]),
                str(self.first[text][0].breaches[0]),
                dict(sorted(robots.items())),
            )
            for text, robots in self.robots.items()
        ]
        asked = self.rates["invariants"]
        return Summary(
            planned=planned,
            ended={kind: self.ended[kind] for kind in Ended if self.ended[kind]},
            all=self.rates[""].get("", PassRate(0, 0)),
            groups={kind: dict(sorted(self.rates[kind].items())) for kind in ("robots", "motions", "scenarios")},
            invariants={name: asked[name] for name in INVARIANTS if name in asked},
            struck=dict(sorted(self.rates["struck"].items())),
            worst=tuple(self.worst[name] for name in all_margins() if name in self.worst),
            causes=tuple(sorted(causes, key=lambda cause: (-cause.runs, cause.text))),
            refused=dict(self.refused.most_common()),
            codes=dict(sorted(self.codes.items())),
            simulated_s=self.simulated_s,
            work_s=self.work_s,
            versions=dict(sorted(self.versions.items())),
        )


def summarised(rows: Iterable[Row], planned: int) -> Summary:
    """Return the summary of rows, one a run, of a campaign with a planned number of runs."""
    tally = _Tally()
    for row in rows:
        tally.add(row)
    return tally.summary(planned)
