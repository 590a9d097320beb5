"""Highest acceleration of each joint that all motors can follow.

A ramp begins at once, so each rotor overshoots by the ramp's own deflection. The torque before the ramp plus twice the
torque of the ramp must be within the pull-out torque. In a homing that accelerates harder a motor slips, and the board
does not know it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, nextafter
from typing import Any, Final, Self

import numpy as np
from scipy.optimize import brentq

from steptwin.features.motors.rotors.motor import RAD_S_PER_RPM
from steptwin.features.motors.rotors.rotors import Drive
from steptwin.features.motors.rotors.torques import carried_torque_nm, rotor_torque_nm
from steptwin.features.motors.turning.drives import drive_of
from steptwin.features.motors.turning.poses import ArmAtPoses, rad_per_unit
from steptwin.features.motors.turning.torques import Curves, PullOutCurve
from steptwin.features.motors.turning.verdict import MARGIN_MIN
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.drivers import DriverSetup, driver_profile, driver_settings, phase_currents_a
from steptwin.protocol.drivers import DriverProfile

ALMOST_NONE: Final = 1e-6
"""Fraction of the highest speed with full friction, but without any other effect of speed."""
_CLOSE: Final = 1e-3
"""Relative precision of an acceleration limit, and the least acceleration in the joint's unit."""


@dataclass(frozen=True, slots=True)
class JointRamp:
    """Acceleration of a joint's axis in the robot's file, and its limits by motors; mm/s^2 or deg/s^2.

    Attributes:
        asked: acceleration in the file.
        by_motor: highest acceleration, by joint name, that the joint's motor can follow at every pose while the other
            axes are still. The axis' own motor accelerates, the others hold. 0 if no acceleration is possible, infinite
            for a motor without any load by it.
    """

    asked: float
    by_motor: Mapping[str, float]

    @property
    def managed(self) -> float:
        """The highest acceleration that all motors can follow."""
        return min(self.by_motor.values())

    @property
    def weakest(self) -> str:
        """The joint with the lowest limit."""
        return min(self.by_motor, key=lambda name: self.by_motor[name])

    @property
    def too_steep(self) -> bool:
        """True if the file's acceleration exceeds the limit."""
        return self.asked > self.managed

    def lowered_to(self, part: float) -> float:
        """Return the file's acceleration, at most a fraction of the limit."""
        return min(self.asked, part * self.managed)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {"asked": self.asked, "managed": self.managed, "weakest": self.weakest}


@dataclass(frozen=True, slots=True)
class JointRamps:
    """The accelerations of a joint's axis.

    Attributes:
        moving: acceleration_max of the motion, up to the highest speed.
        homing: acceleration of the homing, up to its search speed; None without a homing that moves.
    """

    moving: JointRamp
    homing: JointRamp | None


@dataclass(frozen=True, slots=True, eq=False)
class Ramps:
    """Calculates the acceleration limits of a robot by its motors.

    Attributes:
        robot: the robot.
        at: the arm at many poses.
        drives: drive of each axis.
        curves: pull-out torque of each axis' motor while it turns.
        holding_nm: torque of each axis' motor at standstill.
    """

    robot: Robot
    at: ArmAtPoses
    drives: tuple[Drive, ...]
    curves: tuple[PullOutCurve, ...]
    holding_nm: tuple[float, ...]

    @classmethod
    def of(
        cls, robot: Robot, at: ArmAtPoses, curves: Curves, settings: DriverSetup, currents_a: Sequence[float]
    ) -> Self:
        """Return the ramps of a robot from its drivers' settings and the phase current of each axis."""
        drives = tuple(drive_of(joint, settings.chip) for joint in robot.axes)
        driven = [(drive.motor, current_a) for drive, current_a in zip(drives, currents_a, strict=True)]
        part = settings.standing_part
        return cls(
            robot,
            at,
            drives,
            tuple(curves.of(motor, current_a) for motor, current_a in driven),
            tuple(float(curves.of(motor, part * current_a).torque_nm[0]) for motor, current_a in driven),
        )

    def of_axis(self, axis: int) -> JointRamps:
        """Return the ramps of an axis."""
        joint = self.robot.axes[axis]
        homing, element = joint.homing, abs(self.robot.coupling.own_element(axis))
        speed, acceleration = self.robot.axis_speeds_max[axis], self.robot.axis_accelerations_max[axis]
        return JointRamps(
            moving=JointRamp(float(acceleration), self._managed(axis, float(speed))),
            homing=None if homing is None else self._homing(axis, element, homing.search_speed, homing.acceleration),
        )

    def _homing(self, axis: int, element: float, search_speed: float, acceleration: float) -> JointRamp:
        """Return the ramp of a joint's homing; a coupled axis is faster by the coupling's element."""
        of_axis = self._managed(axis, element * search_speed)
        return JointRamp(acceleration, {name: managed / element for name, managed in of_axis.items()})

    def _managed(self, axis: int, speed: float) -> dict[str, float]:
        """Return each motor's highest acceleration of an axis at speeds up to `speed`."""
        drive, scale = self.drives[axis], float(rad_per_unit(self.robot)[axis])
        most, loads = 2.0 * drive.most_nm / drive.motor.rotor_inertia_kgm2, self._loads(axis, speed)
        return {
            name: inf if load.within(most) else _highest(load.within, most, _CLOSE * scale) / scale
            for name, load in zip(self.robot.axis_names, loads, strict=True)
        }

    def _loads(self, axis: int, speed: float) -> list["_Load"]:
        """Return the load of each motor by a ramp of an axis; both motors of a joint turn together."""
        coupling = self.robot.coupling
        turning = list(coupling.motors_of(coupling.joint_of(axis)))
        speeds = float(rad_per_unit(self.robot)[axis]) * speed * np.array([ALMOST_NONE, -ALMOST_NONE, 1.0, -1.0])
        rad = np.repeat(self.at.rad, speeds.size, axis=0)
        rates = np.zeros_like(rad)
        rates[:, turning] = np.tile(speeds, len(self.at.rad))[:, np.newaxis]
        steady_nm = carried_torque_nm(self.at.arm, rad, rates, np.zeros_like(rates))
        inertias = np.repeat(self.at.inertias_kgm2[:, :, turning].sum(axis=2), speeds.size, axis=0)
        turning_nm = self.curves[axis].at(rates[:, axis] / RAD_S_PER_RPM)
        return [
            _Load(
                drive=drive,
                steady_nm=steady_nm[:, motor],
                inertia_kgm2=inertias[:, motor],
                rad_s=rates[:, motor],
                own=float(motor in turning),
                available_nm=turning_nm if motor in turning else self.holding_nm[motor],
            )
            for motor, drive in enumerate(self.drives)
        ]


@dataclass(frozen=True, slots=True, eq=False)
class _Load:
    """Load of a motor by a ramp of an axis, at poses and speeds; arrays of shape (n,).

    Attributes:
        drive: the motor with its gear.
        steady_nm: torque of the gear's load without the ramp.
        inertia_kgm2: torque added for each rad/s^2.
        rad_s: speed of the motor; 0 for a holding motor.
        own: 1 for the accelerating motor, 0 for a holding one.
        available_nm: pull-out torque of the motor.
    """

    drive: Drive
    steady_nm: FloatArray
    inertia_kgm2: FloatArray
    rad_s: FloatArray
    own: float
    available_nm: FloatArray | float

    def within(self, rad_s2: float) -> bool:
        """Return whether the motor can follow a ramp in both directions."""
        return all(self._within(each) for each in (rad_s2, -rad_s2))

    def _within(self, rad_s2: float) -> bool:
        before = rotor_torque_nm(self.drive, self.steady_nm, self.rad_s, np.zeros_like(self.rad_s))
        ramp = np.full_like(self.rad_s, self.own * rad_s2)
        needed = rotor_torque_nm(self.drive, self.steady_nm + self.inertia_kgm2 * rad_s2, self.rad_s, ramp)
        return bool((np.abs(2.0 * needed - before) <= self.available_nm).all())


def _highest(manages: Callable[[float], bool], high: float, least: float) -> float:
    """Return the highest value below `high` for which `manages` is True, by bisection; 0 if it is below `least`."""
    low = 0.0
    while high - low > _CLOSE * high and high > least:
        middle = (low + high) / 2.0
        low, high = (middle, high) if manages(middle) else (low, middle)
    return low


def ramps_of(robot: Robot, drivers: DriverProfile | None = None) -> tuple[JointRamps, ...]:
    """Return the acceleration limits of all joints, with the robot's own drivers or others at their usual settings.

    Raises:
        InputError: the robot's file does not describe its motors and masses.
    """
    at, fastest = ArmAtPoses.of(robot), robot.axis_speeds_max * rad_per_unit(robot)
    profile = drivers or driver_profile(robot.board)
    settings = driver_settings(robot.board, profile)
    curves = Curves(robot, float(fastest.max()) / RAD_S_PER_RPM, settings)
    ramps = Ramps.of(robot, at, curves, settings, phase_currents_a(robot, profile))
    return tuple(ramps.of_axis(joint) for joint in range(len(robot.joints)))


@lru_cache(maxsize=256)
def with_managed_ramps(robot: Robot, drivers: DriverProfile | None = None) -> Robot:
    """Return a robot with accelerations, in moves, stops and homings, that its motors can follow; none becomes higher.

    Its motors are at its own drivers, or at others at their usual settings.

    The limit of a joint holds while the others are still. In a stop, or in homings side by side, all joints ramp at
    once. So all joints that load a motor get the same fraction of their limits: the largest that leaves the motor
    MARGIN_MIN of its torque.

    Raises:
        InputError: the file does not describe motors and masses, or a motor is too weak without any acceleration.
    """
    ramps = dict(zip(robot.joint_names, ramps_of(robot, drivers), strict=True))
    moving = _at_once({name: each.moving for name, each in ramps.items()})
    searching = {name: each.homing for name, each in ramps.items() if each.homing}
    homing = _at_once(searching) if searching else {}
    joints = (
        _gentler(joint, robot.coupling.own_element(axis), moving[joint.name], homing.get(joint.name))
        for axis, joint in enumerate(robot.joints)
    )
    return replace(robot, joints=tuple(joints))


def _at_once(ramps: Mapping[str, JointRamp]) -> dict[str, float]:
    """Return the accelerations, by joint, with which all joints may ramp at once."""
    for name, ramp in ramps.items():
        if ramp.managed == 0.0:
            weak = f"{ramp.weakest}'s motor is too weak for {name}'s highest speed"
            raise InputError(f"{name}: without any acceleration {weak}")

    parts = {motor: _part_for(motor, ramps) for motor in next(iter(ramps.values())).by_motor}
    return {
        name: ramp.lowered_to(min(parts[motor] for motor, most in ramp.by_motor.items() if most < inf))
        for name, ramp in ramps.items()
    }


def _part_for(motor: str, ramps: Mapping[str, JointRamp]) -> float:
    """Return the fraction of the limits at which this motor can follow the ramps of all joints at once."""

    def beyond(part: float) -> float:
        """Return the motor's total load, relative to its capacity, minus the allowed load."""
        return sum(ramp.lowered_to(part) / ramp.by_motor[motor] for ramp in ramps.values()) - (1.0 - MARGIN_MIN)

    return 1.0 if beyond(1.0) <= 0.0 else float(brentq(beyond, 0.0, 1.0))


def _gentler(joint: Joint, element: float, acceleration: float, homing_acceleration: float | None) -> Joint:
    """Return a joint with another acceleration of its axis, and of its homing.

    A joint alone moves its axis by `element`.
    """
    part = acceleration / (joint.axis_acceleration_max or joint.acceleration_max)
    acceleration_max, homing = part * joint.acceleration_max, joint.homing
    axis_acceleration_max = joint.axis_acceleration_max and part * joint.axis_acceleration_max
    if homing is not None and homing_acceleration is not None:
        by_axis = nextafter((axis_acceleration_max or acceleration_max) / element, 0.0) if element > 1.0 else inf
        homing = replace(homing, acceleration=min(homing_acceleration, acceleration_max, by_axis))
    return replace(joint, acceleration_max=acceleration_max, axis_acceleration_max=axis_acceleration_max, homing=homing)


def steep_homings(robot: Robot, profile: DriverProfile) -> list[str]:
    """Return a line for each homing of a robot that is too steep, with its own drivers or others at usual settings.

    Raises:
        InputError: the robot's file does not describe its motors and masses.
    """
    return [
        steep_homing(joint.name, joint.unit, ramps.homing)
        for joint, ramps in zip(robot.joints, ramps_of(robot, profile), strict=True)
        if ramps.homing is not None and ramps.homing.too_steep
    ]


def steep_homing(joint: str, unit: str, ramp: JointRamp) -> str:
    """Return a line about a homing that is too steep, with the motors' limit; `unit` is mm or deg."""
    what = "homing stalls" if ramp.weakest == joint else f"homing turns {ramp.weakest} out of step"
    return (
        f"{joint}: {what} at {ramp.asked:g} {unit}/s2 where the arm is hardest to turn: its motors manage"
        f" {ramp.managed:.0f} (joints.{joint}.homing.acceleration in the robot's file)"
    )
