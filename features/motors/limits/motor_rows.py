"""Torques of a robot's motors along a path, as rows of the path's acceleration u and its squared speed x.

Let r0 be the rotors' angles on the path, and r1 and r2 their derivatives by its parameter. Then each rotor needs the
torque A u + B x + G. G is the torque of the weights, A that of the masses for r1, B that of the masses for r2 and of
the speeds r1, all by Newton-Euler (`rotors/mechanics.py`). A and B include the rotor's own inertia. Friction and the
gear's losses oppose the motion. Available is the pull-out torque at the rotor's speed, less the reserve.

Then the rotors turn by the planned motion, and by a faster one, before it is run: do they keep step? The emulated
board runs the motion, and the edges of its own drivers turn the rotors, as `run --motors` does. So the plan and the run
use the same drivers' currents, decay and reduced currents.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import pi
from typing import Final, Self

import numpy as np
from scipy.linalg import eigh

from steptwin.features.fastest.drives import DriveTrial, PathLoad
from steptwin.features.fastest.rows import PathRates, Rows
from steptwin.features.fastest.shaper import Oscillation, Shaper, ShaperKind, shaper_of
from steptwin.features.motors.rotors.arm import Arm
from steptwin.features.motors.rotors.motor import RAD_S_PER_RPM
from steptwin.features.motors.rotors.rotors import Drive
from steptwin.features.motors.rotors.torques import carried_torque_nm, needed_torque_nm
from steptwin.features.motors.turning import check_described
from steptwin.features.motors.turning.after_run import first_of, first_slip, rotors_after_run
from steptwin.features.motors.turning.drives import drive_of
from steptwin.features.motors.turning.driving import Driving, PayloadTimes
from steptwin.features.motors.turning.mechanism import arm_of
from steptwin.features.motors.turning.poses import carried_inertias, rad_per_unit, rotors_of
from steptwin.features.motors.turning.torques import Curves, PullOutCurve, torques_of_plan
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.drives import DriveAnswer
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.sampled import Spline
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.machine.drivers import driver_profile, driver_settings, phase_currents_a
from steptwin.host.twin.machine.kernels import fastest_kernel
from steptwin.protocol.timer import COUNTS_PER_SECOND

AVERAGE_S: Final = 0.02
"""Time over which a motion is averaged: two PVT points."""
SOFTER: Final = 0.85
"""Frequency for which motions are shaped over that of the arm's slowest swing: a loaded motor is a softer spring."""
_SWING_PLACES: Final = 9
"""Number of places on a path where the arm's oscillation is computed."""
_TAKES_PART: Final = 0.1
"""Least fraction of an oscillation's energy in the motor of a joint that takes part in it."""
_STANDS: Final = 1e-9
"""Fraction of the fastest rotor's speed on a path below which a rotor is at standstill."""
LOAD_MAX_DEG: Final = 85.0
"""Greatest load angle. At 90 degrees the torque is greatest; beyond it a rotor slips."""
FASTER: Final = 0.87
"""Fraction of its duration in which the rotors must still follow a motion."""


@dataclass(frozen=True, eq=False)
class MotorLimits:
    """Motors of a robot and their torque reserve; implements DriveLimits.

    Attributes:
        robot: the robot.
        left_percent: reserve at each speed, in percent of the pull-out torque.
        drives: drive of each axis.
        curves: pull-out torque of each axis' motor.
        arms: the arm without and with the payload.
    """

    robot: Robot
    left_percent: float
    drives: tuple[Drive, ...]
    curves: tuple[PullOutCurve, ...]
    arms: tuple[Arm, Arm]

    @classmethod
    def of(cls, robot: Robot, left_percent: float) -> Self:
        """Return the limits of a robot; raise InputError if its file does not describe its motors and masses."""
        payload_kg = check_described(robot).payload_kg
        profile = driver_profile(robot.board)
        setup = driver_settings(robot.board, profile)
        fastest = robot.axis_speeds_max * rad_per_unit(robot)
        curves = Curves(robot, float(fastest.max()) / RAD_S_PER_RPM, setup)
        drives = tuple(drive_of(joint, setup.chip) for joint in robot.axes)
        currents_a = phase_currents_a(robot, profile)
        own = tuple(curves.of(drive.motor, each) for drive, each in zip(drives, currents_a, strict=True))
        return cls(robot, left_percent, drives, own, (arm_of(robot, 0.0), arm_of(robot, payload_kg)))

    def left_more(self, percent: float) -> Self:
        """Return the limits with a larger reserve."""
        return replace(self, left_percent=min(self.left_percent + percent, 95.0))

    def available_nm(self, rad_s: FloatArray) -> FloatArray:
        """Return the usable part of the pull-out torques at the rotors' speeds, both of shape (n, axes)."""
        part = 1.0 - self.left_percent / 100.0
        return part * np.column_stack([curve.at(rad_s[:, i] / RAD_S_PER_RPM) for i, curve in enumerate(self.curves)])

    def swing_hz(self, joints: FloatArray, arm: Arm) -> float:
        """Return the arm's lowest natural frequency on its motors, at joints of shape (n, joints).

        A motor is a spring, its pull-out torque at rest for each rad of the electrical angle, in series with its belt.
        The coupled inertias are those of rotors and `carried_inertias`.
        """
        springs = np.diag(self._springs_nm_rad)
        inertias = carried_inertias(self.robot, arm, joints) + self._rotor_inertias
        lowest = min(float(eigh(springs, (each + each.T) / 2.0, eigvals_only=True)[0]) for each in inertias)
        return float(np.sqrt(lowest)) / (2.0 * pi)

    def joint_oscillations(self, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the slowest oscillation in which each joint takes part: frequencies in Hz and damping ratios.

        Both have the shape (joints,). The payload hangs at the tool. `joints`, of shape (n, joints), are the poses of a
        motion; the frequency is the middle of the lowest and the highest one. The motors are springs as for `swing_hz`.
        """
        turns = rotors_of(self.robot, np.eye(len(self.robot.joints)))
        springs = (turns * self._springs_nm_rad) @ turns.T
        drags = (turns * np.array([drive.motor.drag_nm_s for drive in self.drives])) @ turns.T
        inertias = turns @ (carried_inertias(self.robot, self.arms[1], joints) + self._rotor_inertias) @ turns.T
        squares, modes = zip(*(eigh(springs, (each + each.T) / 2.0) for each in inertias), strict=True)
        rad_s, at = np.sqrt(np.array(squares)), np.array(modes)
        shares = (at * (springs @ at) / np.square(rad_s)[:, np.newaxis]).mean(axis=0)
        slowest = np.argmax(shares >= _TAKES_PART, axis=1)
        dampings = (np.einsum("npm,pq,nqm->nm", at, drags, at) / (2.0 * rad_s)).mean(axis=0)
        return ((rad_s.min(axis=0) + rad_s.max(axis=0)) / (4.0 * pi))[slowest], dampings[slowest]

    @cached_property
    def _rotor_inertias(self) -> FloatArray:
        return np.diag([drive.motor.rotor_inertia_kgm2 for drive in self.drives])

    @cached_property
    def _springs_nm_rad(self) -> FloatArray:
        """Torque at each rotor for a rad of the rotor: pull-out torque at rest, in series with the belt."""
        fields = np.array(
            [drive.motor.teeth * curve.torque_nm[0] for drive, curve in zip(self.drives, self.curves, strict=True)]
        )
        return 1.0 / (1.0 / fields + 1.0 / np.array([drive.stiffness_nm_rad for drive in self.drives]))

    def along(self, rates: PathRates, load: PathLoad) -> "MotorsOnPath":
        """Return the motors on a path; raise InputError, with the number, if the weights alone need too much torque."""
        at = load.at(rates.s)
        loaded = tuple(
            _LoadedArm.of(self, arm, rates, where) for arm, where in zip(self.arms, at, strict=True) if where.any()
        )
        on_path = MotorsOnPath(self, rates, load, loaded)
        on_path.check_weights()
        return on_path


@dataclass(frozen=True, slots=True, eq=False)
class _LoadedArm:
    """Torque A u + B x + G that an arm needs at each rotor, shape (n, axes), on the part of a path where it applies.

    Attributes:
        arm: the arm, without the payload or with it.
        where: places of the path where it applies, shape (n,).
        carried: A, B and G of the load on the gears.
        driving: A, B and G with the rotors' own inertia.
    """

    arm: Arm
    where: BoolArray
    carried: tuple[FloatArray, FloatArray, FloatArray]
    driving: tuple[FloatArray, FloatArray, FloatArray]

    @classmethod
    def of(cls, limits: MotorLimits, arm: Arm, rates: PathRates, where: BoolArray) -> Self:
        r0, r1, r2 = (rotors_of(limits.robot, values) for values in (rates.joints, rates.first, rates.second))
        zeros = np.zeros_like(r0)
        weight = carried_torque_nm(arm, r0, zeros, zeros)
        a = carried_torque_nm(arm, r0, zeros, r1, gravity_m_s2=0.0)
        b = carried_torque_nm(arm, r0, r1, r2, gravity_m_s2=0.0)
        own = np.array([drive.motor.rotor_inertia_kgm2 for drive in limits.drives])
        return cls(arm, where, (a, b, weight), (a + own * r1, b + own * r2, weight))


@dataclass(frozen=True, eq=False)
class MotorsOnPath:
    """Motors of a robot along a path; implements DrivesOnPath."""

    limits: MotorLimits
    rates: PathRates
    load: PathLoad
    arms: tuple[_LoadedArm, ...]
    longer: float = 1.0

    @property
    def axes(self) -> int:
        """Number of the motors."""
        return len(self.limits.drives)

    @property
    def average_s(self) -> float:
        """Time over which a motion is averaged."""
        return AVERAGE_S * self.longer

    @property
    def shaper(self) -> Shaper:
        """Shaper against the slowest swing on the path, of a loaded arm."""
        return shaper_of(ShaperKind.MZV, Oscillation(SOFTER * self._swing_hz / self.longer))

    def smoother(self, factor: float) -> Self:
        """Return the same motors with motions that are averaged and shaped over so much more time."""
        return replace(self, longer=factor)

    @cached_property
    def _swing_hz(self) -> float:
        rows = np.unique(np.linspace(0, len(self.rates.s) - 1, _SWING_PLACES).astype(np.int64))
        return min(self.limits.swing_hz(self.rates.joints[rows], each.arm) for each in self.arms)

    @cached_property
    def _rubbing(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Sign of each rotor's motion, shape (n, axes), 0 at standstill; friction and loss fraction of each gear."""
        turning = rotors_of(self.limits.robot, self.rates.first)
        signs = np.where(np.abs(turning) > _STANDS * np.abs(turning).max(), np.sign(turning), 0.0)
        drives = self.limits.drives
        frictions = np.array([drive.friction_nm for drive in drives])
        return signs, frictions, np.array([1.0 / drive.efficiency - 1.0 for drive in drives])

    def _sides(self, arm: _LoadedArm) -> list[tuple[tuple[FloatArray, FloatArray, FloatArray], FloatArray]]:
        """Return the terms of u, x and 1 that the torque limits, and the friction added to them.

        An accelerating motor carries the gear's losses, whatever the load's direction. In braking the losses help, so
        only friction counts. At standstill a motor needs torque in both directions.
        """
        signs, frictions, shares = self._rubbing
        up, down = np.where(signs == 0.0, 1.0, signs), np.where(signs == 0.0, -1.0, -signs)
        moves = signs != 0.0
        rubs = np.where(moves, frictions, 0.0)

        def of(sign: FloatArray, share: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            first, second, third = (
                sign * driven + share * carried for driven, carried in zip(arm.driving, arm.carried, strict=True)
            )
            return first, second, third

        own = np.where(moves, shares, 0.0)
        return [(of(up, own), rubs), (of(up, -own), rubs), (of(down, np.zeros_like(own)), -rubs)]

    def check_weights(self) -> None:
        """Raise InputError if weights and friction alone need more than the usable torque at rest."""
        full = np.array([curve.torque_nm[0] for curve in self.limits.curves])
        part = 1.0 - self.limits.left_percent / 100.0
        for arm in self.arms:
            for (_, _, weight), rubs in self._sides(arm):
                needed = np.where(arm.where[:, np.newaxis], weight + rubs, 0.0).max(axis=0)
                axis = int(np.argmax(needed / full))
                if needed[axis] > part * full[axis]:
                    can = 100.0 * (1.0 - needed[axis] / full[axis])
                    raise InputError(
                        f"{self.limits.robot.axis_names[axis]}: weight and friction alone need {needed[axis]:.3f} of"
                        f" {full[axis]:.3f} Nm at the motor: of its torque {max(can, 0.0):.0f} % can be left, not"
                        f" {self.limits.left_percent:g} %"
                    )

    def rows(self, squares: FloatArray, parts: FloatArray) -> Rows:
        """Return the torques as rows about squared speeds, relative to the motor's torque at rest.

        Torque over x is taken as the chord from rest to the last solution's speed; it is exact at both ends.
        """
        rad = np.abs(rotors_of(self.limits.robot, self.rates.first))
        at_rest = self.limits.available_nm(np.zeros_like(rad))
        there = np.minimum(self.limits.available_nm(rad * np.sqrt(squares)[:, np.newaxis]), at_rest)
        x = np.maximum(squares, 1e-9 * max(float(squares.max()), 1e-12))[:, np.newaxis]
        falls = (at_rest - there) / x
        a, b, c = [], [], []
        for arm in self.arms:
            counts = arm.where[:, np.newaxis]
            for (of_u, of_x, weight), rubs in self._sides(arm):
                room = at_rest - rubs - weight
                a.append(np.where(counts, of_u / at_rest, 0.0))
                b.append(np.where(counts, (of_x + falls) / at_rest, 0.0))
                c.append(np.where(counts, parts * room / at_rest, 1.0))
        return Rows(
            np.concatenate(a, axis=1),
            np.concatenate(b, axis=1),
            np.concatenate(c, axis=1),
            np.full(len(squares), np.inf),
        )

    def used(self, cubics: Spline, s: FloatArray) -> FloatArray:
        """Return the used fraction of each motor's usable torque at the ends of cubics, shape (records, axes)."""
        times_s = cubics.knots_s
        positions, velocities = cubics.positions(times_s), cubics.velocities(times_s)
        dt_s = np.diff(times_s)[:, np.newaxis]
        chord = np.diff(positions, axis=0) / dt_s
        first = (6 * chord - 4 * velocities[:-1] - 2 * velocities[1:]) / dt_s
        last = (4 * velocities[1:] + 2 * velocities[:-1] - 6 * chord) / dt_s
        most = np.zeros((len(dt_s), self.axes))
        without, with_it = self.load.at(s)
        arms = dict(zip((False, True), zip(self.limits.arms, (without, with_it), strict=True), strict=True))
        for rows, accelerations in ((slice(None, -1), first), (slice(1, None), last)):
            rad, rad_s, rad_s2 = (
                rotors_of(self.limits.robot, values) for values in (positions[rows], velocities[rows], accelerations)
            )
            available = self.limits.available_nm(rad_s)
            for arm, where in arms.values():
                if where[rows].any():
                    needed = np.abs(needed_torque_nm(self.limits.drives, arm, rad, rad_s, rad_s2))
                    np.maximum(most, np.where(where[rows][:, np.newaxis], needed / available, 0.0), out=most)
        return most

    def tried(self, motion: Motion, s: FloatArray) -> DriveTrial:
        """Turn the rotors by the motion, and by a faster one."""
        return rotor_trial(self.limits.robot, motion, s, self.load, self.average_s + self.shaper.delays_s[-1])


def rotor_trial(robot: Robot, motion: Motion, s: FloatArray, load: PathLoad, average_s: float) -> DriveTrial:
    """Turn the rotors by a motion whose cubics end at places `s` of the path, with the load at each place."""
    planned = plan(robot, motion)
    comparison = execute(planned, "", fastest_kernel(), progress=lambda _: check_planning_time()).comparison
    driving = Driving.of(robot, comparison.evidence)
    if robot.dynamics and robot.dynamics.payload_held_by:
        driving = replace(driving, payload=_payload(driving, planned, motion, s, load))
    trace = rotors_after_run(driving)
    torques = torques_of_plan(driving, comparison, trace.supply_span_v[0])
    least, axis = np.unravel_index(int(np.argmin(torques.margins)), torques.margins.shape)
    moving = trace.counts >= driving.start_counts
    loads = np.abs(trace.load_deg[moving])
    answer = DriveAnswer(
        left_percent=100.0 * float(torques.margins[least, axis]),
        joint=robot.axis_names[int(axis)],
        at_s=float(torques.t_s[least]),
        load_deg=float(loads.max()),
        average_s=average_s,
    )
    if slip := first_of(driving, trace.first_slip_counts):
        return DriveTrial(f"{slip.joint}'s rotor slips at {slip.at_s:.3f} s", answer)
    if answer.load_deg > LOAD_MAX_DEG:
        name = robot.axis_names[int(loads.max(axis=0).argmax())]
        return DriveTrial(
            f"{name}'s rotor comes {answer.load_deg:.0f} degrees behind its field, more than {LOAD_MAX_DEG:g}", answer
        )
    if slip := first_slip(driving.stretched(FASTER)):
        return DriveTrial(f"{slip.joint}'s rotor would slip at {slip.at_s:.3f} s in {FASTER:g} of the time", answer)
    return DriveTrial("", replace(answer, slips_at=_slips_at(driving)))


_SLOWEST, _BISECTIONS = 0.5, 6
"""Least fraction of its duration in which a motion is tried, and number of bisections between it and FASTER."""


def _slips_at(driving: Driving) -> float | None:
    """Return the fraction of its duration at which a rotor begins to slip, to 0.006; None if none slips at half."""
    slips, keeps = _SLOWEST, FASTER
    if first_slip(driving.stretched(slips)) is None:
        return None
    for _ in range(_BISECTIONS):
        middle = (slips + keeps) / 2.0
        slips, keeps = (slips, middle) if first_slip(driving.stretched(middle)) is None else (middle, keeps)
    return slips


def _payload(driving: Driving, planned: Plan, motion: Motion, s: FloatArray, load: PathLoad) -> PayloadTimes:
    """Return when the payload hangs at the tool. A change counts from the earliest place where it may occur."""
    at = np.minimum(np.searchsorted(s, [change.from_s for change in load.changes]), len(s) - 1)
    times_s = motion.knots_s[at]
    if planned.changed is not None:
        times_s = np.array([planned.changed.later_s(t_s) for t_s in times_s.tolist()])
    counts = driving.start_counts + np.rint(times_s * COUNTS_PER_SECOND).astype(np.int64)
    return PayloadTimes(counts, np.array([load.at_start, *(change.held for change in load.changes)]))
