"""Evidence of rotors, of a served board, a run or a stored run, and its judgement."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from steptwin.features.motors import NAME
from steptwin.features.motors.turning.after_run import RotorSlip, RotorTrace
from steptwin.features.motors.turning.drives import check_described
from steptwin.features.motors.turning.verdict import AMBIENT_CELSIUS, MotorVerdict
from steptwin.host.common.tables import Table
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Evidence
from steptwin.host.verify.comparison import Comparison
from steptwin.protocol.timer import COUNTS_PER_SECOND


class RotorEvidence(Protocol):
    """What rotors have done; `start_counts` is the motion's t = 0, from which times count."""

    def slips(self, start_counts: int) -> Sequence[RotorSlip]:
        """Return the axes whose rotors have slipped."""
        ...

    def document(self, start_counts: int) -> dict[str, Any]:
        """Return plain values for JSON, under the keys of `MotorVerdict`."""
        ...


@dataclass(frozen=True, slots=True)
class RotorFacts:
    """What one rotor has done since power-up.

    Attributes:
        name: axis.
        load_angle_deg: greatest load angle in electrical degrees.
        load_angle_counts: instant of the greatest load angle.
        first_slip_counts: instant of the first slip; None without one.
        lost_full_steps: full steps lost, with sign.
        winding_celsius: temperature of the windings; 25 degC at power-up.
    """

    name: str
    load_angle_deg: float
    load_angle_counts: int
    first_slip_counts: int | None
    lost_full_steps: float
    winding_celsius: float


@dataclass(frozen=True, slots=True)
class RotorsSoFar:
    """Extremes of all rotors of a robot since power-up."""

    robot: Robot
    rotors: tuple[RotorFacts, ...]

    def slips(self, start_counts: int) -> Sequence[RotorSlip]:
        """Return the axes whose rotors have slipped."""
        return [
            RotorSlip(each.name, (each.first_slip_counts - start_counts) / COUNTS_PER_SECOND, each.lost_full_steps)
            for each in self.rotors
            if each.first_slip_counts is not None
        ]

    def document(self, start_counts: int) -> dict[str, Any]:
        """Return plain values for JSON, under the keys of `MotorVerdict`."""
        dynamics, slips_s = check_described(self.robot), {each.name: each.at_s for each in self.slips(start_counts)}
        return {
            "payload_kg": dynamics.payload_kg,
            "supply_v": dynamics.supply_v,
            "kept_step": not slips_s,
            "assumed": ["masses"],
            "joints": [
                {
                    "name": each.name,
                    "load_angle_deg": each.load_angle_deg,
                    "load_angle_at_s": (each.load_angle_counts - start_counts) / COUNTS_PER_SECOND,
                    "first_slip_s": slips_s.get(each.name),
                    "lost_full_steps": each.lost_full_steps,
                    "winding_celsius": each.winding_celsius,
                }
                for each in self.rotors
            ],
        }


@dataclass(frozen=True, slots=True, eq=False)
class RotorsOfRun:
    """Rotors of a run, turned with the boards or after them; `verdict` judges them by the plan."""

    robot: Robot
    trace: RotorTrace
    verdict: MotorVerdict | None = None

    def slips(self, start_counts: int) -> Sequence[RotorSlip]:
        """Return the axes whose rotors have slipped."""
        return self.trace.slips(self.robot.axis_names, start_counts)

    def document(self, start_counts: int) -> dict[str, Any]:
        """Return the verdict as plain values for JSON; without a plan, only the rotors' figures."""
        return self._figures.document(start_counts) if self.verdict is None else self.verdict.to_dict()

    @property
    def _figures(self) -> RotorsSoFar:
        trace = self.trace
        worst = np.abs(trace.load_deg).argmax(axis=0).tolist()
        return RotorsSoFar(
            self.robot,
            tuple(
                RotorFacts(
                    name=name,
                    load_angle_deg=float(trace.load_deg[worst[axis], axis]),
                    load_angle_counts=int(trace.counts[worst[axis]]),
                    first_slip_counts=trace.first_slip_counts[axis],
                    lost_full_steps=float(trace.lost_full_steps[-1, axis]),
                    winding_celsius=AMBIENT_CELSIUS + float(trace.warmer_k[-1, axis]),
                )
                for axis, name in enumerate(self.robot.axis_names)
            ),
        )


@dataclass(frozen=True, slots=True)
class StoredRotors:
    """Rotors of a stored run, in its motion's time.

    Attributes:
        told: the stored document.
        joints: names of the joints.
        slipped: the slips.
    """

    told: Mapping[str, Any]
    joints: tuple[str, ...]
    slipped: tuple[RotorSlip, ...]

    def slips(self, _start_counts: int) -> Sequence[RotorSlip]:
        """Return the axes whose rotors have slipped."""
        return self.slipped

    def document(self, _start_counts: int) -> dict[str, Any]:
        """Return the document."""
        return dict(self.told)


def trace_of(evidence: Evidence) -> RotorTrace | None:
    """Return the trace of a run's rotors; None if no rotors turned or the run was stored."""
    seen = evidence.features.get(NAME)
    return seen.trace if isinstance(seen, RotorsOfRun) else None


def slips_of(evidence: Evidence) -> Sequence[RotorSlip]:
    """Return the axes whose rotors have slipped in a run; none if no rotors turned."""
    seen: RotorEvidence | None = evidence.features.get(NAME)
    return () if seen is None else seen.slips(evidence.start_counts)


# --- judgement: this module is the feature's `FeatureJudge`; no rotor may slip


def reasons(rotors: RotorEvidence, _planned: None, start_counts: int) -> list[str]:
    """Return one line for each rotor that has slipped; `start_counts` is the motion's t = 0."""
    return list(map(str, rotors.slips(start_counts)))


def document(rotors: RotorEvidence, start_counts: int) -> dict[str, Any]:
    """Return the motors' part of report.json."""
    return rotors.document(start_counts)


def contradictions(rotors: RotorEvidence, comparison: Comparison) -> Iterator[str]:
    """Yield a line if stored rotors are not those of the axes: what they did shows in no count of a driver."""
    if isinstance(rotors, StoredRotors) and rotors.joints != comparison.axis_names:
        yield f"motors: those of {', '.join(rotors.joints)}, but the axes are {', '.join(comparison.axis_names)}"


def stored(rotors: RotorEvidence, _planned: None, start_counts: int) -> dict[str, Any]:
    """Return what motors.json holds: the document."""
    return rotors.document(start_counts)


def read(table: Table) -> tuple[StoredRotors, None]:
    """Return the evidence from motors.json; raise InputError for a key that is missing or of another kind."""
    table.truth("kept_step")
    joints = table.each("joints", _joint)
    slipped = tuple(slip for _, slip in joints if slip is not None)
    return StoredRotors(table.values, tuple(name for name, _ in joints), slipped), None


def _joint(table: Table) -> tuple[str, RotorSlip | None]:
    name, lost_full_steps = table.text("name"), table.number("lost_full_steps")
    if table.is_null("first_slip_s"):
        return name, None
    return name, RotorSlip(name, table.number("first_slip_s"), lost_full_steps)
