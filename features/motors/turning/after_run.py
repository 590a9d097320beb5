"""Turn a robot's motors by the record of a run, from power-up to its end, without emulating a board."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np

from steptwin.features.motors.rotors.rotors import Energies, RotorRecord, Rotors
from steptwin.features.motors.turning.drives import power_supply
from steptwin.features.motors.turning.driving import Driving, Progress
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.robots.robot import Robot
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

_CHUNK_MS: Final = 250
"""Time between two reports of progress."""


@dataclass(frozen=True, slots=True)
class RotorSlip:
    """A rotor that has slipped in a run; its driver's count does not know it.

    Attributes:
        name: axis.
        at_s: its first slip, in the motion's time.
        full_steps: full steps lost at the end.
    """

    name: str
    at_s: float
    full_steps: float

    def __str__(self) -> str:
        return f"{self.name}: its rotor slips at {self.at_s:.3f} s and ends {abs(self.full_steps):g} full steps away"


@dataclass(frozen=True, slots=True, eq=False)
class RotorTrace:
    """Motion of the rotors, a row for each ms.

    Attributes:
        counts: shape (n,), the instants.
        positions: shape (n, axes), positions of the axes by their rotors, in mm and degrees.
        load_deg: shape (n, axes), load angle with the largest magnitude in that ms, electrical degrees.
        torque_nm: shape (n, axes), the motors' torques.
        lost_full_steps: shape (n, axes).
        warmer_k: shape (n, axes), temperature of the windings above ambient.
        first_slip_counts: of each axis; None if it has not slipped.
        energies: energies of each axis.
        supply_span_v: lowest and highest voltage at the drivers.
        other_payloads_kg: masses of the payload that were set during the run, in order.
    """

    counts: Int64Array
    positions: FloatArray
    load_deg: FloatArray
    torque_nm: FloatArray
    lost_full_steps: FloatArray
    warmer_k: FloatArray
    first_slip_counts: tuple[int | None, ...]
    energies: Energies
    supply_span_v: tuple[float, float]
    other_payloads_kg: tuple[float, ...] = ()

    def slips(self, names: Sequence[str], start_counts: int) -> tuple[RotorSlip, ...]:
        """Return the axes with slips, with the time of the first slip since a motion's start."""
        slipped = zip(names, self.first_slip_counts, self.lost_full_steps[-1].tolist(), strict=True)
        return tuple(
            RotorSlip(name, (counts - start_counts) / COUNTS_PER_SECOND, steps)
            for name, counts, steps in slipped
            if counts is not None
        )


@dataclass(frozen=True, slots=True)
class MotionSlip:
    """The first slip of a motion.

    Attributes:
        joint: the joint.
        at_s: its instant, from the start of the motion.
    """

    joint: str
    at_s: float


def rotors_after_run(driving: Driving, progress: Progress = lambda _: None) -> RotorTrace:
    """Turn the rotors by a run's record, from power-up to some ms after its last edge."""
    rotors = _at_power_up(driving)
    parts = list(_turned(driving, rotors, progress))
    return rotor_trace(driving.robot, parts, rotors)


def first_slip(driving: Driving, progress: Progress = lambda _: None) -> MotionSlip | None:
    """Turn the rotors until one slips; return that slip, None if all keep step."""
    rotors = _at_power_up(driving)
    for _ in _turned(driving, rotors, progress):
        if slip := first_of(driving, rotors.first_slips()):
            return slip
    return None


def first_of(driving: Driving, slips_counts: Sequence[int | None]) -> MotionSlip | None:
    """Return the first of the axes' first slips."""
    slips = [(counts, axis) for axis, counts in enumerate(slips_counts) if counts is not None]
    if not slips:
        return None
    counts, axis = min(slips)
    return MotionSlip(driving.robot.axis_names[axis], driving.seconds(counts))


def _at_power_up(driving: Driving) -> Rotors:
    arm = driving.arms[int(driving.payload.held[0])]
    rotors = Rotors(driving.drives(), arm, power_supply(driving.dynamics), driving.starts_rad)
    rotors.feed([driver.events(driver.first_on_rad) for driver in driving.drivers])
    return rotors


def _turned(driving: Driving, rotors: Rotors, progress: Progress) -> Iterator[RotorRecord]:
    """Turn the rotors in parts; a part ends, to the ms, where the payload is taken or left."""
    total_ms = driving.total_ms
    borders_ms = np.union1d(np.arange(0, total_ms, _CHUNK_MS), -(-driving.payload.counts // COUNTS_PER_MS))
    borders_ms = np.append(borders_ms[borders_ms < total_ms], total_ms)
    for first_ms, next_ms in zip(borders_ms[:-1].tolist(), borders_ms[1:].tolist(), strict=True):
        held = driving.payload.at(np.array([first_ms * COUNTS_PER_MS]))[0]
        rotors.carry(driving.arms[int(held)])
        yield rotors.advance(next_ms - first_ms)
        progress(next_ms / total_ms)


def rotor_trace(robot: Robot, parts: Sequence[RotorRecord], rotors: Rotors) -> RotorTrace:
    """Return the trace of a robot's rotors from the parts of their record and the rotors at its end."""
    travel = np.array([joint.transmission.travel_per_rev for joint in robot.axes]) / (2.0 * pi)

    def column(name: str) -> FloatArray:
        return np.concatenate([getattr(part, name) for part in parts])

    return RotorTrace(
        counts=np.concatenate([part.counts for part in parts]),
        positions=column("coordinate_rad") * travel,
        load_deg=np.rad2deg(column("worst_rad")),
        torque_nm=column("torque_nm"),
        lost_full_steps=column("lost_full_steps"),
        warmer_k=column("warmer_k"),
        first_slip_counts=tuple(rotors.first_slips()),
        energies=rotors.energies(),
        supply_span_v=rotors.supply_span_v,
    )
