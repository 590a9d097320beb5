"""What a run has come to, and what its pictures show."""

from dataclasses import dataclass

from steptwin.host.operate.running import LiveOutcome
from steptwin.host.panel.desk.history import Samples


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """A run that has ended.

    Attributes:
        number: counts up from 1.
        wall_s: when it ended, in seconds since 1970.
        name: name of the motion.
        passed: True if every axis ended at the planned step; None if the run was stopped or failed.
        why: why it was stopped or failed, in one line; None otherwise.
        outcome: plan, end of each axis and waits; None if the run was stopped or failed.
        started_s: when the last repetition began, on the clock of `time.monotonic`; None if it never did.
        samples: what the board reported during the run.
    """

    number: int
    wall_s: float
    name: str
    passed: bool | None
    why: str | None
    outcome: LiveOutcome | None
    started_s: float | None
    samples: Samples
