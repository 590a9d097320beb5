"""The result of one run of a campaign: a row of its results, in plain values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from steptwin.host.studies.campaign.sources import source_version


class Ended(StrEnum):
    """How a run ended."""

    DONE = "done"
    """The host came to the end of the motion, and no drive failed."""
    STOPPED = "stopped"
    """A drive failed, or the host gave up, and said so."""
    REFUSED = "refused"
    """The run was not made: the robot, as drawn, cannot make the motion, or has not what the scenario harms."""
    CRASHED = "crashed"
    """A program of StepTwin itself failed."""


@dataclass(frozen=True, slots=True)
class Breach:
    """An invariant that did not hold.

    Attributes:
        invariant: its name in `invariants.INVARIANTS`.
        what: what was found, without numbers and names of joints, so that like runs have like words.
        detail: the joint and the numbers; may be empty.
    """

    invariant: str
    what: str
    detail: str = ""

    def __str__(self) -> str:
        return f"{self.invariant}: {self.what}{f' ({self.detail})' if self.detail else ''}"


@dataclass(frozen=True, slots=True)
class Row:
    """One run; the same seed gives the same row, except for the time that it took.

    Attributes:
        seed: the run's seed.
        robot: the robot's name in the campaign.
        motion: the motion's name.
        scenario: the scenario's name.
        ended: how it ended.
        message: why it ended before the motion's end; empty otherwise.
        codes: all error codes that the nodes sent (EMCY), each once, sorted.
        faults: the scenario's faults by name.
        struck: how often each has struck, 0 for one that did not.
        met: what the faults were that struck, in the words of docs/faults.md, each once, sorted.
        asked: names of the invariants (`invariants.INVARIANTS`) that the run was asked for.
        breaches: those that did not hold, the gravest first.
        parameters: every number that was drawn, by name.
        choices: every other value that was drawn, by name.
        margins: what was left to each limit, 1 all of it and 0 nothing, by the names in `margins.MARGINS`.
        duration_s: duration of the planned motion.
        simulated_s: simulated time of the whole run.
        wall_s: time that it took.
        version: the version of StepTwin that made the run, with a digest of its sources.
    """

    seed: int
    robot: str
    motion: str
    scenario: str
    ended: Ended
    message: str = ""
    codes: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    struck: tuple[int, ...] = ()
    met: tuple[str, ...] = ()
    asked: tuple[str, ...] = ()
    breaches: tuple[Breach, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    choices: Mapping[str, str] = field(default_factory=dict)
    margins: Mapping[str, float] = field(default_factory=dict)
    duration_s: float = 0.0
    simulated_s: float = 0.0
    wall_s: float = field(default=0.0, compare=False)
    version: str = field(default_factory=source_version, compare=False)

    @property
    def passed(self) -> bool:
        """True if every invariant held."""
        return not self.breaches

    @property
    def cause(self) -> str:
        """What failed, for grouping: the gravest breach, and the faults that had struck; empty if none."""
        if not self.breaches:
            return ""
        first = self.breaches[0]
        return f"{first.invariant}: {first.what}, after {' and '.join(self.met) or 'no fault'}"


def split_parameters(drawn: Mapping[str, object]) -> tuple[dict[str, float], dict[str, str]]:
    """Return drawn values as numbers and as texts."""
    numbers = {
        name: float(value)
        for name, value in drawn.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
    return numbers, {name: str(value) for name, value in drawn.items() if name not in numbers}
