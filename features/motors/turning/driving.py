"""The driving of motors by a run: the drivers' currents, the arm, and the times with the payload.

It is made once from a run's evidence. Trials with another current or a faster motion derive from it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi
from typing import Final, Self

import numpy as np

from steptwin.controller.node.pins import DECAY_LEVELS
from steptwin.features.motors.rotors.arm import Arm
from steptwin.features.motors.rotors.motor import FULL_STEPS_PER_TOOTH
from steptwin.features.motors.rotors.rotors import Drive, DriverEvents
from steptwin.features.motors.turning.drives import check_described, drive_of
from steptwin.features.motors.turning.mechanism import arm_of
from steptwin.host.common.arrays import BoolArray, FloatArray, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.robots.motor import Dynamics
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.drivers import DriverSetup, driver_settings
from steptwin.host.verify import AxisEvidence, Evidence, LevelEdges
from steptwin.protocol.drivers import ChipSheet, DriverProfile
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

_DECAY_PINS: Final = ("dcy1", "dcy2")


@dataclass(frozen=True, slots=True, eq=False)
class DriverRecord:
    """Outputs of one driver, valid from each instant on; arrays of shape (n,).

    The rotor's angle grows with the position. The field's angle in a run's evidence grows with DIR low, so here the
    field's angle and phase B change sign.

    Attributes:
        counts: the instants, sorted.
        field_rad: electrical angle of the field, counted through.
        a_amp: current to which phase A is regulated.
        b_amp: likewise of phase B.
        on: True while the outputs are on.
        fast: fraction of fast decay, 0 to 1.
    """

    counts: Int64Array
    field_rad: FloatArray
    a_amp: FloatArray
    b_amp: FloatArray
    on: BoolArray
    fast: FloatArray

    @classmethod
    def of(cls, axis: AxisEvidence, setup: DriverSetup) -> Self:
        """Return a driver's record from a run's evidence and from the driver's settings."""
        phases = axis.phases
        counts = np.unique(np.concatenate([phases.counts, *(axis.pins[pin].counts for pin in _DECAY_PINS)]))
        at = np.searchsorted(phases.counts, counts, side="right") - 1
        counts, at = counts[at >= 0], at[at >= 0]
        return cls(
            counts=counts,
            field_rad=-(2.0 * pi / phases.cycle) * _counted_through(phases.substeps[at].astype(np.int64), phases.cycle),
            a_amp=1e-3 * phases.a_ma[at].astype(np.float64),
            b_amp=-1e-3 * phases.b_ma[at].astype(np.float64),
            on=(phases.a_ma[at] != 0) | (phases.b_ma[at] != 0),
            fast=_fast_decay(axis, counts) if setup.by_pins else np.full(counts.size, setup.fast_decay_part),
        )

    def scaled(self, factor: float) -> Self:
        """Return the record with all currents multiplied by `factor`."""
        return replace(self, a_amp=factor * self.a_amp, b_amp=factor * self.b_amp)

    def stretched(self, factor: float, from_counts: int) -> Self:
        """Return the record with all times after an instant multiplied by `factor`."""
        return replace(self, counts=stretched_counts(self.counts, factor, from_counts))

    def events(self, rotor_rad: float) -> DriverEvents:
        """Return all changes; `rotor_rad` is the rotor's electrical angle when the outputs first come on."""
        field_rad = self.field_rad + (rotor_rad - self.first_on_rad)
        return DriverEvents(self.counts, field_rad, self.a_amp, self.b_amp, self.fast, self.on.astype(np.float64))

    @property
    def first_on_rad(self) -> float:
        """Electrical angle of the field, and of the rotor, when the outputs first come on; 0 if they never do."""
        return float(self.field_rad[np.argmax(self.on)]) if self.on.any() else 0.0

    @property
    def last_off_counts(self) -> int | None:
        """Instant when the outputs go off for good; None if they stay on or never come on."""
        if not self.on.any() or self.on[-1]:
            return None
        return int(self.counts[np.flatnonzero(self.on)[-1] + 1])

    @property
    def phase_current_a(self) -> float:
        """Largest amplitude of the currents that was set: that of motion."""
        return float(np.hypot(self.a_amp, self.b_amp).max(initial=0.0))

    @property
    def fast_decay(self) -> float:
        """Fraction of fast decay at most steps."""
        values, numbers = np.unique(self.fast, return_counts=True)
        return float(values[np.argmax(numbers)]) if values.size else 0.0


def stretched_counts(counts: Int64Array, factor: float, from_counts: int) -> Int64Array:
    """Return instants with their times after `from_counts` multiplied by `factor`."""
    later = np.maximum(counts - from_counts, 0)
    return np.asarray(np.minimum(counts, from_counts) + np.rint(later * factor).astype(np.int64), dtype=np.int64)


def _counted_through(substeps: Int64Array, cycle: int) -> FloatArray:
    """Return continuous angles, without jumps at the end of a cycle."""
    moves = np.diff(substeps, prepend=substeps[:1])
    through = substeps[:1] + np.cumsum((moves + cycle // 2) % cycle - cycle // 2)
    return np.asarray(through, dtype=np.float64)


def _fast_decay(axis: AxisEvidence, counts: Int64Array) -> FloatArray:
    """Return the fraction of fast decay at instants, from the levels of DCY2 and DCY1."""
    first, second = (_level_at(axis.pins[pin], counts) for pin in _DECAY_PINS)
    percent = np.empty((2, 2))
    for value, levels in DECAY_LEVELS.items():
        percent[levels] = value
    return np.asarray(percent[second, first] / 100.0, dtype=np.float64)


def _level_at(pin: LevelEdges, counts: Int64Array) -> Int64Array:
    levels = np.concatenate([np.zeros(1, dtype=np.int64), pin.levels.astype(np.int64)])
    return np.asarray(levels[np.searchsorted(pin.counts, counts, side="right")])


_SETTLING_MS: Final = 100
"""Time after the last edge for which the rotors turn on; an overshoot may slip then."""


def check_current(current_a: float, chip: ChipSheet) -> None:
    """Raise InputError if a chip cannot deliver this phase current."""
    most_a = chip.current_max_a.value
    if not 0.0 < current_a <= most_a:
        raise InputError(f"current_a={current_a:g} A is not above 0 and up to {most_a:g} A")


@dataclass(frozen=True, slots=True, eq=False)
class PayloadTimes:
    """Times with the payload at the tool.

    Attributes:
        counts: shape (n,), sorted instants when it is taken or left.
        held: shape (n + 1,), True if it hangs at the tool before the first instant and after each.
    """

    counts: Int64Array
    held: BoolArray

    @classmethod
    def of(cls, robot: Robot, evidence: Evidence, name: str) -> Self:
        """Return the times when an output holds the payload; without a name the tool always carries it."""
        if not name:
            return cls(np.empty(0, dtype=np.int64), np.array([True]))
        output = robot.outputs[name]
        pin = evidence.axes[robot.axis_index(output.joint)].pins[f"out{output.out}"]
        return cls(pin.counts, np.concatenate([[False], pin.levels.astype(np.bool_)]))

    def at(self, counts: Int64Array) -> BoolArray:
        """Return whether the payload hangs at the tool at instants, shape (n,)."""
        return np.asarray(self.held[np.searchsorted(self.counts, counts, side="right")])


@dataclass(frozen=True, slots=True, eq=False)
class Driving:
    """Driving of a run's motors.

    Attributes:
        robot: with motors, masses, payload and supply.
        chip: the drivers' chip.
        drivers: record of each axis' driver.
        starts_rad: each rotor's angle at power-up.
        payload: times with the payload at the tool.
        start_counts: the motion's t = 0.
        last_counts: instant of the last edge.
        arms: the arm without and with the payload.
    """

    robot: Robot
    chip: ChipSheet
    drivers: tuple[DriverRecord, ...]
    starts_rad: tuple[float, ...]
    payload: PayloadTimes
    start_counts: int
    last_counts: int
    arms: tuple[Arm, Arm]

    @classmethod
    def of(cls, robot: Robot, evidence: Evidence, profile: DriverProfile | None = None) -> Self:
        """Return a run's driving with the drivers of `profile`, by default those of the robot's file.

        Raises:
            InputError: the robot's file does not describe its motors and masses.
        """
        dynamics = check_described(robot)
        setup = driver_settings(robot.board, profile or robot.board.profile)
        return cls(
            robot=robot,
            chip=setup.chip,
            drivers=tuple(DriverRecord.of(axis, setup) for axis in evidence.axes),
            starts_rad=tuple(
                2.0 * pi * axis.start_steps / (joint.transmission.full_steps_per_rev * joint.transmission.microsteps)
                for axis, joint in zip(evidence.axes, robot.axes, strict=True)
            ),
            payload=PayloadTimes.of(robot, evidence, dynamics.payload_held_by),
            start_counts=evidence.start_counts,
            last_counts=last_edge_counts(evidence),
            arms=(arm_of(robot, 0.0), arm_of(robot, dynamics.payload_kg)),
        )

    @property
    def dynamics(self) -> Dynamics:
        """Supply and payload."""
        return check_described(self.robot)

    @property
    def phase_current_a(self) -> float:
        """The largest amplitude of the phase currents of all drivers."""
        return max(driver.phase_current_a for driver in self.drivers)

    @property
    def total_ms(self) -> int:
        """Time from power-up for which the rotors turn."""
        return followed_ms(self.last_counts)

    @property
    def carries(self) -> bool:
        """True if the payload hangs at the tool at any time."""
        return bool(self.payload.held.any())

    @property
    def off_counts(self) -> int:
        """Instant when the first driver goes off for good; the end if none does."""
        ends = [driver.last_off_counts for driver in self.drivers]
        return min((end for end in ends if end is not None), default=self.total_ms * COUNTS_PER_MS)

    def seconds(self, counts: int) -> float:
        """Return the motion's time of an instant."""
        return (counts - self.start_counts) / COUNTS_PER_SECOND

    def at_current(self, current_a: float) -> Self:
        """Return the driving at another phase current at full torque; reduced currents keep their ratio.

        Raises:
            InputError: a driver cannot deliver that current.
        """
        check_current(current_a, self.chip)
        if self.phase_current_a == 0.0:
            return self
        factor = current_a / self.phase_current_a
        return replace(self, drivers=tuple(driver.scaled(factor) for driver in self.drivers))

    def with_payload(self, payload_kg: float) -> Self:
        """Return the driving with another mass at the tool."""
        robot = replace(self.robot, dynamics=replace(self.dynamics, payload_kg=payload_kg))
        return replace(self, robot=robot, arms=(self.arms[0], arm_of(robot, payload_kg)))

    def stretched(self, factor: float) -> Self:
        """Return the driving of a motion that takes `factor` times as long.

        All times of edges since t = 0 are multiplied. A stretched plan gives the same edges but for two effects: the
        board rounds segments to a quarter of a ms, and drivers reduce their current after a fixed standstill.
        """
        return replace(
            self,
            drivers=tuple(driver.stretched(factor, self.start_counts) for driver in self.drivers),
            payload=replace(self.payload, counts=stretched_counts(self.payload.counts, factor, self.start_counts)),
            last_counts=int(stretched_counts(np.array([self.last_counts]), factor, self.start_counts)[0]),
        )

    def drives(self) -> list[Drive]:
        """Return each axis' drive, mounted so that its rotor is aligned with the field when it first comes on."""
        return [
            drive_of(
                joint,
                self.chip,
                driver.first_on_rad - joint.transmission.full_steps_per_rev // FULL_STEPS_PER_TOOTH * start_rad,
            )
            for joint, driver, start_rad in zip(self.robot.axes, self.drivers, self.starts_rad, strict=True)
        ]


def last_edge_counts(evidence: Evidence) -> int:
    """Return the instant of the last edge at any driver."""
    return max(axis.last_counts for axis in evidence.axes)


def followed_ms(last_counts: int) -> int:
    """Return the time from power-up for which rotors turn after a last edge at an instant."""
    return last_counts // COUNTS_PER_MS + _SETTLING_MS


Progress = Callable[[float], None]
"""Takes the fraction done."""
