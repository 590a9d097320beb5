"""What is left to each limit in a run: 1 all of it, 0 nothing, below 0 beyond it."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Final

from steptwin.host.campaign.performance import Performance
from steptwin.host.campaign.row import Ended
from steptwin.host.verify import THRESHOLD_TOLERANCE_STEPS
from steptwin.host.verify.report import AxisReport


@dataclass(frozen=True, slots=True)
class Margin:
    """A margin: what it is, in words, and how a run tells it; None if the run does not."""

    what: str
    of: Callable[[Performance], float | None]


def _least(values: Iterable[float | None]) -> float | None:
    return min((value for value in values if value is not None and isfinite(value)), default=None)


def _axes(performance: Performance, of: Callable[[AxisReport], float | None]) -> float | None:
    """Return the least of all axes in a run that made what was planned: otherwise the plan tells nothing."""
    if performance.ended is not Ended.DONE or performance.report is None or performance.unknowable:
        return None
    return _least(of(axis) for axis in performance.report.axes)


def _step_rate(performance: Performance) -> float | None:
    limit_hz = performance.trial.setup.robot.board.driver_rate_max_hz
    return _axes(performance, lambda axis: 1 - axis.peak_rate_hz / limit_hz)


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
"""Electrical angle at which a rotor slips (docs/motors.md)."""

MARGINS: Final[Mapping[str, Margin]] = {
    "threshold": Margin(
        "largest error of a step's threshold, of 0.0075 steps",
        lambda run: _axes(run, lambda axis: 1 - axis.threshold_error_steps_max / THRESHOLD_TOLERANCE_STEPS),
    ),
    "step rate": Margin("highest step rate, of the board's highest", _step_rate),
    "bus": Margin("load of the bus", _bus),
    "standstill": Margin("time to standstill after a fault, of the documented time", _standstill),
    "torque": Margin("torque needed, of the motor's pull-out torque", _torque),
    "load angle": Margin("greatest load angle, of the 180 degrees at which a rotor slips", _load_angle),
}
"""The margins by name, in the order of reports."""
