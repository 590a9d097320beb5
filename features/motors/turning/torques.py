"""Torques that a plan needs of each motor, beside the motor's torque at that speed."""

from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np

from steptwin.features.motors.rotors.motor import RAD_S_PER_RPM, Motor
from steptwin.features.motors.rotors.torques import DriveSupply, needed_torque_nm, pull_out_nm, pull_outs_nm
from steptwin.features.motors.turning.drives import drive_of, supply_of
from steptwin.features.motors.turning.driving import Driving
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.drivers import DriverSetup
from steptwin.host.verify import Comparison
from steptwin.protocol.timer import COUNTS_PER_SECOND

_CURVE_SPEEDS: Final = 32
"""Number of speeds of a pull-out curve."""
_FASTER: Final = 1.5
"""Factor of a curve's highest speed over the motion's."""
_SLOW_RPM: Final = 60.0
"""Least highest speed of a curve."""
_EVERY_S: Final = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class PullOutCurve:
    """Pull-out torque of a motor over its speed; arrays of shape (n,), speeds in turns a minute, from 0."""

    rpm: FloatArray
    torque_nm: FloatArray

    def at(self, rpm: FloatArray) -> FloatArray:
        """Return the torque at speeds of any shape and sign."""
        return np.interp(np.abs(rpm), self.rpm, self.torque_nm)


@dataclass(frozen=True, slots=True, eq=False)
class Torques:
    """Torques that a plan needs, each ms; arrays of shape (n, axes).

    Attributes:
        t_s: shape (n,), from the start of the motion.
        rpm: speeds, with sign.
        needed_nm: torques at the rotors, with sign.
        available_nm: pull-out torques at those speeds.
        curves: pull-out curve of each axis.
    """

    t_s: FloatArray
    rpm: FloatArray
    needed_nm: FloatArray
    available_nm: FloatArray
    curves: tuple[PullOutCurve, ...]

    @property
    def margins(self) -> FloatArray:
        """1 - needed / available."""
        return np.asarray(1.0 - np.abs(self.needed_nm) / np.maximum(self.available_nm, 1e-12))


@dataclass(frozen=True, slots=True, eq=False)
class Needs:
    """Speeds and torques that a plan needs of each motor, each ms; arrays of shape (n, axes), `t_s` of shape (n,)."""

    t_s: FloatArray
    rpm: FloatArray
    torque_nm: FloatArray


def torques_of_plan(driving: Driving, comparison: Comparison, supply_v: float | None = None) -> Torques:
    """Return the torques of a plan.

    Args:
        driving: driving of the run; its currents and decay determine the pull-out torques.
        comparison: the run's plan.
        supply_v: voltage for the pull-out torques, by default the supply's without load.
    """
    needs = needs_of_plan(driving, comparison)
    curves = curves_of(driving, np.abs(needs.rpm).max(axis=0), supply_v)
    available = np.column_stack([curve.at(needs.rpm[:, axis]) for axis, curve in enumerate(curves)])
    return Torques(needs.t_s, needs.rpm, needs.torque_nm, available, curves)


def needs_of_plan(driving: Driving, comparison: Comparison) -> Needs:
    """Return the needs of a plan, with the payload while it hangs at the tool."""
    robot, motion = driving.robot, comparison.expected.motion
    t_s = np.arange(0.0, motion.duration_s + _EVERY_S / 2, _EVERY_S).clip(max=motion.duration_s)
    rad_per_unit = 2.0 * pi / np.array([joint.transmission.travel_per_rev for joint in robot.axes])
    rad = robot.coupling.to_axes(motion.positions(t_s)) * rad_per_unit
    rad_s = robot.coupling.to_axes(motion.velocities(t_s)) * rad_per_unit
    rad_s2 = np.asarray(np.gradient(rad_s, _EVERY_S, axis=0))
    drives = [drive_of(joint, driving.chip) for joint in robot.axes]
    held = driving.payload.at(np.rint(driving.start_counts + t_s * COUNTS_PER_SECOND).astype(np.int64))
    needed = np.empty_like(rad)
    for arm, when in zip(driving.arms, (~held, held), strict=True):
        if when.any():
            needed[when] = needed_torque_nm(drives, arm, rad[when], rad_s[when], rad_s2[when])
    return Needs(t_s, rad_s / RAD_S_PER_RPM, needed)


def curves_of(driving: Driving, rpm_max: FloatArray, supply_v: float | None = None) -> tuple[PullOutCurve, ...]:
    """Return each axis' pull-out curve to beyond its highest speed; like motors on like drivers share one."""
    kinds = []
    for joint, record in zip(driving.robot.axes, driving.drivers, strict=True):
        supply = supply_of(driving.robot, driving.chip, record.phase_current_a, record.fast_decay, supply_v)
        kinds.append((drive_of(joint, driving.chip).motor, supply))
    fastest: dict[tuple[Motor, DriveSupply], float] = {}
    for kind, rpm in zip(kinds, rpm_max.tolist(), strict=True):
        fastest[kind] = max(fastest.get(kind, _SLOW_RPM), rpm)
    speeds = np.stack([np.linspace(0.0, _FASTER * rpm, _CURVE_SPEEDS) for rpm in fastest.values()])
    torques = pull_outs_nm(list(fastest), speeds)
    curves = {kind: PullOutCurve(*each) for kind, *each in zip(fastest, speeds, torques, strict=True)}
    return tuple(curves[kind] for kind in kinds)


_MOTOR_CURVE_SPEEDS: Final = 25


class Curves:
    """The pull-out curves of motors on a robot's drivers, up to a speed in turns a minute."""

    def __init__(self, robot: Robot, rpm_max: float, setup: DriverSetup) -> None:
        self._robot, self._setup = robot, setup
        self._rpm = np.linspace(0.0, rpm_max, _MOTOR_CURVE_SPEEDS)
        self._known: dict[tuple[Motor, float], PullOutCurve] = {}

    def of(self, motor: Motor, current_a: float) -> PullOutCurve:
        """Return the curve of a motor at a current amplitude."""
        if (motor, current_a) not in self._known:
            supply = supply_of(self._robot, self._setup.chip, current_a, self._setup.fast_decay_part)
            self._known[motor, current_a] = PullOutCurve(self._rpm, pull_out_nm(motor, supply, self._rpm))
        return self._known[motor, current_a]
