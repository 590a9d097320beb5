"""What a run's record does to the motors: the drivers' currents, the arm, and when the payload hangs at it.

It is made once of a run's evidence; every question to the motors, also with another current or a faster motion, begins
with it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi
from typing import Final, Self

import numpy as np

from steptwin.emulator.arm import Arm
from steptwin.emulator.motor import FULL_STEPS_PER_TOOTH
from steptwin.emulator.rotors import Drive
from steptwin.host.common.arrays import BoolArray, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.robots.board_settings import PHASE_CURRENT_MAX_A
from steptwin.host.robots.motor import Dynamics
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motors.driver_record import DriverRecord, stretched_counts
from steptwin.host.twin.motors.drives import check_described, drive_of
from steptwin.host.twin.motors.mechanism import arm_of
from steptwin.host.verify import Evidence
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

_SETTLING_MS: Final = 100
"""Time after the last edge for which the rotors are followed: what slips by an overshoot slips then."""


def check_current(current_a: float) -> None:
    """Raise InputError unless a TB6560 sets this phase current."""
    if not 0.0 < current_a <= PHASE_CURRENT_MAX_A:
        raise InputError(f"current_a={current_a:g} A is not above 0 and up to {PHASE_CURRENT_MAX_A:g} A")


@dataclass(frozen=True, slots=True, eq=False)
class PayloadTimes:
    """When the payload hangs at the tool.

    Attributes:
        counts: shape (n,), sorted instants of taking and leaving it.
        held: shape (n + 1,), whether it hangs before the first and after each.
    """

    counts: Int64Array
    held: BoolArray

    @classmethod
    def of(cls, robot: Robot, evidence: Evidence, name: str) -> Self:
        """Return the times at which an output holds the payload; without a name it always hangs."""
        if not name:
            return cls(np.empty(0, dtype=np.int64), np.array([True]))
        output = robot.outputs[name]
        pin = evidence.axes[robot.index_of(output.joint)].pins[f"out{output.out}"]
        return cls(pin.counts, np.concatenate([[False], pin.levels.astype(np.bool_)]))

    def at(self, counts: Int64Array) -> BoolArray:
        """Return whether it hangs at instants, shape (n,)."""
        return np.asarray(self.held[np.searchsorted(self.counts, counts, side="right")])


@dataclass(frozen=True, slots=True, eq=False)
class Driving:
    """A run as its motors feel it.

    Attributes:
        robot: with motors, masses, payload and supply.
        drivers: what each axis' driver did.
        starts_rad: each rotor's angle at power-up.
        payload: when it hangs at the tool.
        start_counts: the motion's t = 0.
        last_counts: instant of the last edge.
        arms: without and with the payload.
    """

    robot: Robot
    drivers: tuple[DriverRecord, ...]
    starts_rad: tuple[float, ...]
    payload: PayloadTimes
    start_counts: int
    last_counts: int
    arms: tuple[Arm, Arm]

    @classmethod
    def of(cls, robot: Robot, evidence: Evidence) -> Self:
        """Return a run's driving; raise InputError unless the robot's file describes its motors and masses."""
        dynamics = check_described(robot)
        return cls(
            robot=robot,
            drivers=tuple(DriverRecord.of(axis) for axis in evidence.axes),
            starts_rad=tuple(
                2.0 * pi * axis.start_steps / (joint.transmission.full_steps_per_rev * joint.transmission.microsteps)
                for axis, joint in zip(evidence.axes, robot.joints, strict=True)
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
        """Time from power-up for which the rotors are followed."""
        return followed_ms(self.last_counts)

    @property
    def carries(self) -> bool:
        """True if the payload hangs at the tool at some time."""
        return bool(self.payload.held.any())

    @property
    def off_counts(self) -> int:
        """When the first driver switches its outputs off for good; the end if none does."""
        ends = [driver.last_off_counts for driver in self.drivers]
        return min((end for end in ends if end is not None), default=self.total_ms * COUNTS_PER_MS)

    def seconds(self, counts: int) -> float:
        """Return an instant in the motion's time."""
        return (counts - self.start_counts) / COUNTS_PER_SECOND

    def at_current(self, current_a: float) -> Self:
        """Return the same with another phase current at full torque.

        Raises:
            InputError: no TB6560 sets that current.
        """
        check_current(current_a)
        return replace(self, drivers=tuple(driver.at_current(current_a) for driver in self.drivers))

    def with_payload(self, payload_kg: float) -> Self:
        """Return the same with another mass at the tool."""
        robot = replace(self.robot, dynamics=replace(self.dynamics, payload_kg=payload_kg))
        return replace(self, robot=robot, arms=(self.arms[0], arm_of(robot, payload_kg)))

    def stretched(self, factor: float) -> Self:
        """Return the same in which the motion takes `factor` times as long.

        Every edge since t = 0 moves in proportion. That is what a stretched plan makes of the drivers, apart from the
        quarter of a ms to which the board rounds segments and the standstill after which a driver reduces its current.
        """
        return replace(
            self,
            drivers=tuple(driver.stretched(factor, self.start_counts) for driver in self.drivers),
            payload=replace(self.payload, counts=stretched_counts(self.payload.counts, factor, self.start_counts)),
            last_counts=int(stretched_counts(np.array([self.last_counts]), factor, self.start_counts)[0]),
        )

    def drives(self) -> list[Drive]:
        """Return each axis' drive, mounted so that its rotor stands right where the field first comes on."""
        return [
            drive_of(
                joint,
                driver.first_on_rad - joint.transmission.full_steps_per_rev // FULL_STEPS_PER_TOOTH * start_rad,
            )
            for joint, driver, start_rad in zip(self.robot.joints, self.drivers, self.starts_rad, strict=True)
        ]


def last_edge_counts(evidence: Evidence) -> int:
    """Return the instant of the last edge at any driver."""
    return max(axis.last_counts for axis in evidence.axes)


def followed_ms(last_counts: int) -> int:
    """Return the time from power-up for which rotors are followed whose drivers have their last edge at an instant."""
    return last_counts // COUNTS_PER_MS + _SETTLING_MS


Progress = Callable[[float], None]
"""Takes the fraction that is done."""
