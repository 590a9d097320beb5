"""Which motors would do for a robot, without any run: each joint at its limits, at the pose where that is hardest.

Each joint in turn goes at its highest speed, or at almost none, and accelerates or brakes as hard as it may, with the
payload, at many poses. What this needs of each motor is held against the motor's pull-out torque at that speed.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from math import inf, pi, sqrt
from typing import Any, Final

import numpy as np
from scipy.stats import qmc

from steptwin.emulator.arm import Arm
from steptwin.emulator.motor import CATALOGUE, RAD_S_PER_RPM, Motor
from steptwin.emulator.needed_torque import carried_torque_nm, rotor_torque_nm
from steptwin.emulator.pull_out import pull_out_nm
from steptwin.emulator.rotors import Drive
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.board_settings import PHASE_CURRENT_MAX_A
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.drivers import driver_profile
from steptwin.host.twin.motors.drives import check_described, drive_of, supply_of
from steptwin.host.twin.motors.mechanism import arm_of
from steptwin.host.twin.motors.torques import Curve
from steptwin.host.twin.motors.verdict import MARGIN_MIN

_POSES: Final = 64
"""Poses at which the arm is looked at, besides home."""
_CURVE_SPEEDS: Final = 25
_ALMOST_NONE: Final = 1e-6
"""Part of the highest speed at which friction already opposes, but nothing else depends on speed."""
_CLOSE: Final = 1e-3
"""Precision of an acceleration that a motor manages, relative to it, and the least one in the joint's unit."""
TABLE_RPM: Final = (0.0, 60.0, 120.0, 240.0, 360.0, 480.0, 600.0, 900.0, 1200.0)
"""Speeds at which a pull-out curve is told."""


@dataclass(frozen=True, slots=True)
class Fit:
    """How a motor would do for a joint, where its margin is least.

    Attributes:
        motor: its name.
        current_a: amplitude of the phase current.
        torque_needed_nm: at the motor's shaft.
        torque_available_nm: its pull-out torque at that speed.
        rpm: the speed.
        margin: 1 - needed / available.
    """

    motor: str
    current_a: float
    torque_needed_nm: float
    torque_available_nm: float
    rpm: float
    margin: float

    @property
    def would_do(self) -> bool:
        """True if enough torque is left."""
        return self.margin >= MARGIN_MIN

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self) | {"would_do": self.would_do}


@dataclass(frozen=True, slots=True)
class Ramp:
    """How hard a joint's axis accelerates by the robot's file, and how hard its motor lets it; mm/s^2 or deg/s^2.

    Attributes:
        asked: by the file.
        managed: the highest that the motor manages at every pose, while the other axes stand; 0 if there is none. A
            ramp begins at once, so that the rotor swings twice as far as the ramp's torque takes it.
    """

    asked: float
    managed: float

    @property
    def too_steep(self) -> bool:
        """True if the file asks for more than the motor manages."""
        return self.asked > self.managed


@dataclass(frozen=True, slots=True)
class JointFit:
    """A joint's own motor, and all of the catalogue in its place.

    Attributes:
        name: the joint.
        unit: of its positions.
        own: its motor at the drivers' current.
        moving: its acceleration_max, at up to the joint's highest speed.
        homing: the acceleration of its homing, at up to its search speed; None without a homing that moves.
        rpm_max: the motor's speed at the joint's highest one.
        inertia_kgm2: of the rotor with all that it moves, at the motor's shaft, where that is greatest.
        natural_hz: of small oscillations about the field with that inertia, the lowest there is.
        pose: the joints there, in mm and degrees.
        pull_out_nm: of its own motor by the speeds of TABLE_RPM.
        others: motors in its place, each at its rated current as far as a TB6560 gives it.
    """

    name: str
    unit: str
    own: Fit
    moving: Ramp
    homing: Ramp | None
    rpm_max: float
    inertia_kgm2: float
    natural_hz: float
    pose: Mapping[str, float]
    pull_out_nm: tuple[float, ...]
    others: tuple[Fit, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        curve = [
            {"rpm": rpm, "torque_nm": torque_nm} for rpm, torque_nm in zip(TABLE_RPM, self.pull_out_nm, strict=True)
        ]
        return {
            "name": self.name,
            "unit": self.unit,
            "own": self.own.to_dict(),
            "moving": asdict(self.moving),
            "homing": None if self.homing is None else asdict(self.homing),
            "rpm_max": self.rpm_max,
            "inertia_kgm2": self.inertia_kgm2,
            "natural_hz": self.natural_hz,
            "pose": dict(self.pose),
            "pull_out": curve,
            "others": [fit.to_dict() for fit in self.others],
        }


@dataclass(frozen=True, slots=True, eq=False)
class _Demands:
    """What the arm asks of each rotor at its limits; arrays of shape (n, axes)."""

    carried_nm: FloatArray
    rad_s: FloatArray
    rad_s2: FloatArray


def fits_of(
    robot: Robot, current_a: float | None = None, others: Collection[Motor] = tuple(CATALOGUE.values())
) -> tuple[JointFit, ...]:
    """Return how the motors of a robot, and others in their place, would do for its joints.

    Args:
        robot: the robot, with motors and masses.
        current_a: phase current at full torque of its own motors; by default that of its drivers.
        others: by default all of the catalogue.

    Raises:
        InputError: the robot's file does not describe its motors and masses.
    """
    dynamics, profile = check_described(robot), driver_profile(robot.board)
    own_a = current_a or robot.board.current_a or profile.current_a
    fast_decay = (robot.board.fast_decay_percent or profile.fast_decay_percent) / 100.0
    arm, joints = arm_of(robot, dynamics.payload_kg), _poses(robot)
    demands = _demands(robot, arm, joints)
    inertias = carried_inertia(robot, arm, joints)
    curves = _Curves(robot, fast_decay, max(float(np.abs(demands.rad_s).max()) / RAD_S_PER_RPM, TABLE_RPM[-1]))
    fits = []
    for axis, joint in enumerate(robot.joints):
        drive = drive_of(joint)
        widest = int(np.argmax(inertias[:, axis]))
        inertia = float(inertias[widest, axis])
        curve = curves.of(drive.motor, own_a)
        ramps = _Ramps(robot, arm, joints, axis, drive, curve, inertias[:, axis])
        homing = joint.homing
        fits.append(
            JointFit(
                name=joint.name,
                unit=joint.unit,
                own=_fit(drive, own_a, curve, demands, axis),
                moving=ramps.up_to(joint.axis_speed_max or joint.speed_max, joint.acceleration_max),
                homing=None if homing is None else ramps.up_to(homing.search_speed, homing.acceleration),
                rpm_max=60.0 * (joint.axis_speed_max or joint.speed_max) / joint.transmission.travel_per_rev,
                inertia_kgm2=inertia + drive.motor.rotor_inertia_kgm2,
                natural_hz=natural_hz(drive, own_a, inertia),
                pose=dict(zip(robot.joint_names, joints[widest].tolist(), strict=True)),
                pull_out_nm=tuple(curve.at(np.array(TABLE_RPM)).tolist()),
                others=tuple(_in_place(drive, motor, curves, demands, axis) for motor in others),
            )
        )
    return tuple(fits)


def natural_hz(drive: Drive, current_a: float, inertia_kgm2: float) -> float:
    """Return the lowest frequency of small oscillations of a rotor, with the inertia that it carries.

    The field holds the rotor by the stiffness Nr (Km I + 4 Td); a belt makes two masses on two springs.
    """
    motor, rotor = drive.motor, drive.motor.rotor_inertia_kgm2
    field = motor.teeth * (motor.torque_constant_nm_a * current_a + 4.0 * motor.detent_torque_nm)
    belt = drive.stiffness_nm_rad
    if belt == inf or inertia_kgm2 == 0.0:
        return sqrt(field / (rotor + inertia_kgm2)) / (2.0 * pi)
    own, coupled, load = (field + belt) / rotor, belt * belt / (rotor * inertia_kgm2), belt / inertia_kgm2
    lowest = (own + load) / 2.0 - sqrt((own - load) ** 2 / 4.0 + coupled)
    return sqrt(lowest) / (2.0 * pi)


class _Curves:
    """Pull-out curves, each computed once."""

    def __init__(self, robot: Robot, fast_decay: float, rpm_max: float) -> None:
        self._robot, self._fast_decay = robot, fast_decay
        self._rpm = np.linspace(0.0, rpm_max, _CURVE_SPEEDS)
        self._known: dict[tuple[Motor, float], Curve] = {}

    def of(self, motor: Motor, current_a: float) -> Curve:
        if (motor, current_a) not in self._known:
            supply = supply_of(self._robot, 0, current_a, self._fast_decay)
            self._known[motor, current_a] = Curve(self._rpm, pull_out_nm(motor, supply, self._rpm))
        return self._known[motor, current_a]


def _in_place(drive: Drive, motor: Motor, curves: _Curves, demands: _Demands, axis: int) -> Fit:
    current_a = min(motor.rated_current_a, PHASE_CURRENT_MAX_A)
    return _fit(replace(drive, motor=motor), current_a, curves.of(motor, current_a), demands, axis)


def _fit(drive: Drive, current_a: float, curve: Curve, demands: _Demands, axis: int) -> Fit:
    rad_s = demands.rad_s[:, axis]
    needed = np.abs(rotor_torque_nm(drive, demands.carried_nm[:, axis], rad_s, demands.rad_s2[:, axis]))
    available = curve.at(rad_s / RAD_S_PER_RPM)
    margins = 1.0 - needed / np.maximum(available, 1e-12)
    least = int(np.argmin(margins))
    return Fit(
        motor=drive.motor.name,
        current_a=current_a,
        torque_needed_nm=float(needed[least]),
        torque_available_nm=float(available[least]),
        rpm=float(abs(rad_s[least]) / RAD_S_PER_RPM),
        margin=float(margins[least]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Ramps:
    """What finds the accelerations that one axis' motor manages; `inertia_kgm2`, shape (poses,), is what it turns."""

    robot: Robot
    arm: Arm
    joints: FloatArray
    axis: int
    drive: Drive
    curve: Curve
    inertia_kgm2: FloatArray

    def up_to(self, speed: float, asked: float) -> Ramp:
        """Return what is asked and managed at speeds up to `speed`, either way, in the joint's unit per s or s^2."""
        rad_per_unit = 2.0 * pi / self.robot.joints[self.axis].transmission.travel_per_rev
        speeds = rad_per_unit * speed * np.array([_ALMOST_NONE, -_ALMOST_NONE, 1.0, -1.0])
        rad_s = np.tile(speeds, len(self.joints))
        rates = np.zeros((rad_s.size, len(self.robot.joints)))
        rates[:, self.axis] = rad_s
        rad = np.repeat(_rotors(self.robot, self.joints), speeds.size, axis=0)
        steady_nm = carried_torque_nm(self.arm, rad, rates, np.zeros_like(rates))[:, self.axis]
        inertia_kgm2 = np.repeat(self.inertia_kgm2, speeds.size)
        available = self.curve.at(rad_s / RAD_S_PER_RPM)
        before = rotor_torque_nm(self.drive, steady_nm, rad_s, np.zeros_like(rad_s))

        def enough(rad_s2: float) -> bool:
            for each in (rad_s2, -rad_s2):
                ramp = np.full_like(rad_s, each)
                needed = rotor_torque_nm(self.drive, steady_nm + inertia_kgm2 * ramp, rad_s, ramp)
                if (np.abs(2.0 * needed - before) > available).any():
                    return False
            return True

        low, high = 0.0, 2.0 * self.drive.most_nm / self.drive.motor.rotor_inertia_kgm2
        while high - low > _CLOSE * high:
            middle = (low + high) / 2.0
            low, high = (middle, high) if enough(middle) else (low, middle)
            if high < _CLOSE * rad_per_unit:
                break
        return Ramp(asked, low / rad_per_unit)


def _poses(robot: Robot) -> FloatArray:
    """Return home and other poses that the mechanism can take, shape (n, joints): Halton's sequence over the ranges."""
    lower, upper = ([getattr(joint, side) for joint in robot.joints] for side in ("lower", "upper"))
    spread = qmc.scale(qmc.Halton(len(lower), scramble=False).random(_POSES + 1)[1:], lower, upper)
    joints = np.vstack([[robot.home], spread])
    possible = np.isfinite(make_kinematics(robot).forward(joints)).all(axis=1)
    return np.asarray(joints[possible])


def _demands(robot: Robot, arm: Arm, joints: FloatArray) -> _Demands:
    """Return each joint in turn at its limits, at each pose."""
    count = len(robot.joints)
    cases = list(product(range(count), (_ALMOST_NONE, -_ALMOST_NONE, 1.0, -1.0), (1.0, -1.0)))
    rates, accelerations = np.zeros((2, len(cases), count))
    for case, (joint, speed, acceleration) in enumerate(cases):
        rates[case, joint] = speed * robot.joints[joint].speed_max
        accelerations[case, joint] = acceleration * robot.joints[joint].acceleration_max
    rad = np.repeat(_rotors(robot, joints), len(cases), axis=0)
    rad_s, rad_s2 = (np.tile(_rotors(robot, values), (len(joints), 1)) for values in (rates, accelerations))
    return _Demands(carried_torque_nm(arm, rad, rad_s, rad_s2), rad_s, rad_s2)


def carried_inertia(robot: Robot, arm: Arm, joints: FloatArray) -> FloatArray:
    """Return the inertia at each rotor, without its own, shape (poses, axes), while the other rotors stand."""
    rad, count = _rotors(robot, joints), len(robot.joints)
    still = np.zeros_like(rad)
    columns = [
        carried_torque_nm(arm, rad, still, still + np.eye(count)[axis], gravity_m_s2=0.0)[:, axis]
        for axis in range(count)
    ]
    return np.column_stack(columns)


def _rotors(robot: Robot, joints: FloatArray | Sequence[float]) -> FloatArray:
    """Return the rotors' angles in rad, or their rates, of the joints' in mm and degrees, shape (..., joints)."""
    rad_per_unit = 2.0 * pi / np.array([joint.transmission.travel_per_rev for joint in robot.joints])
    return np.asarray(robot.coupling.to_axes(np.asarray(joints)) * rad_per_unit)
