"""Margins of a run to each limit: 1 is the full margin, 0 none, below 0 a violation."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from math import isfinite
from typing import Final

from steptwin.features.campaigns.recovery import Recovery
from steptwin.features.campaigns.row import Ended
from steptwin.features.campaigns.trial import Trial
from steptwin.features.faults.report import FaultReport, report_in
from steptwin.features.motors.turning import MotorVerdict
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.verify import AxisEvidence, Report
from steptwin.host.verify.figures import FigureLimit, declared_figures, figure_values


@dataclass(frozen=True, slots=True)
class Claim:
    """Position that a drive reports after the motion, compared with that of its motor.

    Attributes:
        joint: name of the joint.
        known: True if the drive reports that it knows its position.
        off_steps: steps of the motor beyond the reported position.
        slipped_steps: part of them from slips of a rotor that turns with the board; the driver's counts cannot show it.
            0 without motors in the loop.
    """

    joint: str
    known: bool
    off_steps: float
    slipped_steps: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """A completed run.

    Attributes:
        trial: the drawn run.
        ended: how it ended.
        message: why it ended before the motion's end; empty otherwise.
        outcome: its result; None if the machine could not be set up.
        own_time: verdict by the boards' own crystals; None if all are exact.
        claims: reported positions after the motion; empty if the nodes did not answer.
        axes: drivers' records from power-up to the end, with the recovery.
        recovery: result of the recovery; None without one.
        motors: verdict on the motors; None if they were not turned.
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
        """Reports of the scenario's faults; empty without a scenario."""
        report = None if self.outcome is None else report_in(self.outcome.verdicts)
        return () if report is None else report.faults

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the drivers' counts differ from the plan; empty if they do not. Rotors are not judged here."""
        late = () if self.outcome is None else self.outcome.late_reasons
        return () if self.report is None else tuple(each for each in self.report.reasons if each not in late)

    @property
    def report(self) -> Report | None:
        """Verdict, by the boards' own time if a crystal is off; None if the machine could not be set up."""
        if self.own_time is not None or self.outcome is None:
            return self.own_time
        return self.outcome.report

    @property
    def unknowable(self) -> bool:
        """True if a fault has struck that no board without encoders can notice, such as a broken STEP wire.

        Its documented reaction says that only `verify` can tell it.
        """
        return any(fault.reaction is not None and not fault.reaction.verified for fault in self.faults)


@dataclass(frozen=True, slots=True)
class Margin:
    """A margin: its name as text, and a function of a run, which returns None if the run does not have it."""

    what: str
    of: Callable[[Performance], float | None]


def _least(values: Iterable[float | None]) -> float | None:
    return min((value for value in values if value is not None and isfinite(value)), default=None)


def _of_figure(limit: FigureLimit, performance: Performance) -> float | None:
    """Return the least margin of all axes, in a run that executed its plan; the plan says nothing about other runs."""
    report, robot = performance.report, performance.trial.setup.robot
    if performance.ended is not Ended.DONE or report is None or performance.unknowable:
        return None
    return _least(
        1 - value / limit.of(robot, axis)
        for figure, values in figure_values([asdict(axis) for axis in report.axes], report.features)
        if figure.limit is not None and figure.limit.name == limit.name
        for axis, value in enumerate(values.values())
    )


def _bus(performance: Performance) -> float | None:
    if performance.outcome is None:
        return None
    return 1 - performance.outcome.report.run.bus.load_percent / 100


def _standstill(performance: Performance) -> float | None:
    return _least(
        1 - fault.standstill_ms / fault.limit_ms
        for fault in performance.faults
        if fault.standstill_ms is not None and fault.limit_ms
    )


def _torque(performance: Performance) -> float | None:
    return _least(joint.margin for joint in performance.motors.joints) if performance.motors else None


def _load_angle(performance: Performance) -> float | None:
    if performance.motors is None:
        return None
    return _least(1 - abs(joint.load_angle_deg) / _SLIPS_DEG for joint in performance.motors.joints)


_SLIPS_DEG: Final = 180.0
"""Electrical angle where a rotor slips (docs/motors.md)."""

_OTHERS: Final[Mapping[str, Margin]] = {
    "bus": Margin("load of the bus", _bus),
    "standstill": Margin("time to standstill after a fault, of the documented time", _standstill),
    "torque": Margin("torque needed, of the motor's pull-out torque", _torque),
    "load angle": Margin("greatest load angle, of the 180 degrees at which a rotor slips", _load_angle),
}


def all_margins() -> dict[str, Margin]:
    """Return the margins by name, in the order of reports, those of the axes' figures first."""
    limits = [figure.limit for figure in reversed(declared_figures()) if figure.limit]
    return {limit.name: Margin(limit.says, partial(_of_figure, limit)) for limit in limits} | dict(_OTHERS)
