"""What a run of a campaign did, for the invariants and margins to judge."""

from dataclasses import dataclass

from steptwin.host.campaign.recovery import Recovery
from steptwin.host.campaign.row import Ended
from steptwin.host.campaign.trial import Trial
from steptwin.host.twin.motors import MotorVerdict
from steptwin.host.twin.outcome import Outcome
from steptwin.host.twin.scenarios.report import FaultReport
from steptwin.host.verify import AxisEvidence, Report


@dataclass(frozen=True, slots=True)
class Claim:
    """What a drive says of its position after the motion, and where its motor stands.

    Attributes:
        joint: name of the joint.
        known: whether the drive says that it knows its position.
        off_steps: steps by which the motor stands beyond the position that the drive reports.
        slipped_steps: part of them by which a rotor that turns with the board has slipped by itself: the driver has
            made other steps, and no count of them can tell it. 0 if no motors turn with the board.
    """

    joint: str
    known: bool
    off_steps: float
    slipped_steps: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """A run that was made.

    Attributes:
        trial: what was drawn.
        ended: how it ended.
        message: why it ended before the motion's end; empty otherwise.
        outcome: its result; None if the machine could not even be set up.
        own_time: the verdict by the time of the boards' own crystals; None if all are exact.
        claims: what each drive says after the motion; empty if the nodes did not answer.
        axes: everything at the drivers from power-up to the end, the recovery included.
        recovery: what became of the machine; None if it was not recovered.
        motors: what the motors did; None if they were not turned.
        simulated_s: simulated time.
    """

    trial: Trial
    ended: Ended
    message: str
    outcome: Outcome | None
    claims: tuple[Claim, ...]
    axes: tuple[AxisEvidence, ...]
    recovery: Recovery | None
    own_time: Report | None
    motors: MotorVerdict | None
    simulated_s: float

    @property
    def faults(self) -> tuple[FaultReport, ...]:
        """The scenario's faults, and what answered; empty without a scenario."""
        if self.outcome is None or self.outcome.scenario is None:
            return ()
        return self.outcome.scenario.faults

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the drivers' counts are not as planned; empty if they are."""
        return () if self.report is None else self.report.reasons

    @property
    def report(self) -> Report | None:
        """The verdict, by the boards' own time where a crystal is off; None if the machine could not be set up."""
        if self.own_time is not None or self.outcome is None:
            return self.own_time
        return self.outcome.report

    @property
    def unknowable(self) -> bool:
        """True if a fault has struck of which no board without encoders can know, such as a broken STEP wire.

        The documented reaction says so: only `verify` tells it.
        """
        return any(fault.reaction is not None and not fault.reaction.verified for fault in self.faults)
