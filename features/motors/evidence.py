"""What the rotors of a machine have done, as evidence: of a board that runs on, of a run, of a stored run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from steptwin.features.motors import NAME
from steptwin.features.motors.turning.after_run import RotorSlip, RotorTrace
from steptwin.features.motors.turning.drives import check_described
from steptwin.features.motors.turning.verdict import AMBIENT_CELSIUS, MotorVerdict
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Evidence
from steptwin.protocol.timer import COUNTS_PER_SECOND


class RotorEvidence(Protocol):
    """What rotors have done; times are those of the motion whose t = 0 is given."""

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
        load_angle_deg: greatest load angle, electrical degrees.
        load_angle_counts: its instant.
        first_slip_counts: None without a slip.
        lost_full_steps: with sign.
        winding_celsius: from 25 degC at power-up.
    """

    name: str
    load_angle_deg: float
    load_angle_counts: int
    first_slip_counts: int | None
    lost_full_steps: float
    winding_celsius: float


@dataclass(frozen=True, slots=True)
class RotorsSoFar:
    """What all rotors of a robot have done since power-up, in figures."""

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
    """What the rotors of a robot did in a run, with the boards or after it; `verdict` judges them by the plan."""

    robot: Robot
    trace: RotorTrace
    verdict: MotorVerdict | None = None

    def slips(self, start_counts: int) -> Sequence[RotorSlip]:
        """Return the axes whose rotors have slipped."""
        return self.trace.slips(self.robot.axis_names, start_counts)

    def document(self, start_counts: int) -> dict[str, Any]:
        """Return the verdict as plain values for JSON; without one what is known without a plan."""
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
    """What a stored run says of its rotors, in its motion's time.

    Attributes:
        told: the document.
        joints: the joints' names.
        slipped: those that have slipped.
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
    """Return what the rotors did in a run; None if none turned, or the run was stored."""
    seen = evidence.features.get(NAME)
    return seen.trace if isinstance(seen, RotorsOfRun) else None


def slips_of(evidence: Evidence) -> Sequence[RotorSlip]:
    """Return the axes whose rotors have slipped in a run; none if no rotors turned."""
    seen: RotorEvidence | None = evidence.features.get(NAME)
    return () if seen is None else seen.slips(evidence.start_counts)
