"""Suitability of motors for a robot without any run, and the duration of a program by torque reserve.

Each joint in turn moves at its highest speed, or at almost 0, and accelerates or brakes at its limit, with the payload,
at the poses with the greatest load. The needed torque is compared with the motor's pull-out torque at that speed.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from math import inf, pi, sqrt
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from steptwin.features.motors.limits import motor_limits
from steptwin.features.motors.rotors.motor import CATALOGUE, RAD_S_PER_RPM, Motor
from steptwin.features.motors.rotors.rotors import Drive
from steptwin.features.motors.rotors.torques import carried_torque_nm, rotor_torque_nm
from steptwin.features.motors.turning.poses import ArmAtPoses, rad_per_unit, rotors_of
from steptwin.features.motors.turning.ramps import ALMOST_NONE, JointRamp, Ramps
from steptwin.features.motors.turning.torques import Curves, PullOutCurve
from steptwin.features.motors.turning.verdict import MARGIN_MIN
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.planning.drives import AskedLimits
from steptwin.host.planning.programs import Program, compile_program
from steptwin.host.robots.motor import JointMotor
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.drivers import driver_profile, driver_settings, phase_currents_a

if TYPE_CHECKING:
    from matplotlib.figure import Figure


TABLE_RPM: Final = (0.0, 60.0, 120.0, 240.0, 360.0, 480.0, 600.0, 900.0, 1200.0)
"""Speeds of the printed pull-out curves."""
LEFT_PERCENT: Final = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0)
"""Torque reserves that are tried, in percent."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Suitability of a motor for a joint, where its margin is least.

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
        """True if the torque margin is large enough."""
        return self.margin >= MARGIN_MIN

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self) | {"would_do": self.would_do}


@dataclass(frozen=True, slots=True)
class JointFit:
    """A joint's own motor, and those of the catalogue in its place.

    Attributes:
        name: the joint.
        unit: of its positions.
        own: its motor at the drivers' current.
        moving: acceleration_max of the motion, up to the joint's highest speed.
        homing: acceleration of the homing, up to its search speed; None without a homing that moves.
        rpm_max: the motor's speed at the joint's highest speed.
        inertia_kgm2: greatest inertia of the rotor with its load, at the motor's shaft.
        natural_hz: lowest frequency of small oscillations about the field, at that inertia.
        pose: joints at that inertia, in mm and degrees.
        pull_out_nm: pull-out torque of its own motor at the speeds of TABLE_RPM.
        others: motors in its place, each at its rated current or at the highest current of a TB6560.
    """

    name: str
    unit: str
    own: Fit
    moving: JointRamp
    homing: JointRamp | None
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
            "moving": self.moving.to_dict(),
            "homing": None if self.homing is None else self.homing.to_dict(),
            "rpm_max": self.rpm_max,
            "inertia_kgm2": self.inertia_kgm2,
            "natural_hz": self.natural_hz,
            "pose": dict(self.pose),
            "pull_out": curve,
            "others": [fit.to_dict() for fit in self.others],
        }


@dataclass(frozen=True, slots=True, eq=False)
class _Demands:
    """Torques that the arm needs at its limits; arrays of shape (n, axes)."""

    carried_nm: FloatArray
    rad_s: FloatArray
    rad_s2: FloatArray


def fits_of(
    robot: Robot, current_a: float | None = None, others: Collection[Motor] = tuple(CATALOGUE.values())
) -> tuple[JointFit, ...]:
    """Return the suitability of a robot's motors, and of others in their place, for its joints.

    Args:
        robot: the robot, with motors and masses.
        current_a: phase current at full torque of its own motors; by default that of its drivers.
        others: by default all motors of the catalogue.

    Raises:
        InputError: the robot's file does not describe its motors and masses.
    """
    at, profile = ArmAtPoses.of(robot), driver_profile(robot.board)
    settings, currents_a = driver_settings(robot.board, profile), phase_currents_a(robot, profile)
    if current_a is not None:
        currents_a = (current_a,) * len(robot.axes)
    demands = _demands(robot, at)
    fastest = max(float(np.abs(demands.rad_s).max()), float((robot.axis_speeds_max * rad_per_unit(robot)).max()))
    curves = Curves(robot, max(fastest / RAD_S_PER_RPM, TABLE_RPM[-1]), settings)
    ramps = Ramps.of(robot, at, curves, settings, currents_a)
    fits = []
    for axis, joint in enumerate(robot.joints):
        drive, own_ramps, own_a = ramps.drives[axis], ramps.of_axis(axis), currents_a[axis]
        carried = at.inertias_kgm2[:, axis, list(robot.coupling.motors_of(axis))].sum(axis=1)
        widest = int(np.argmax(carried))
        inertia = float(carried[widest])
        curve = ramps.curves[axis]
        fits.append(
            JointFit(
                name=joint.name,
                unit=joint.unit,
                own=_fit(drive, own_a, curve, demands, axis),
                moving=own_ramps.moving,
                homing=own_ramps.homing,
                rpm_max=60.0 * (joint.axis_speed_max or joint.speed_max) / joint.transmission.travel_per_rev,
                inertia_kgm2=inertia + drive.motor.rotor_inertia_kgm2,
                natural_hz=natural_hz(drive, own_a, inertia),
                pose=dict(zip(robot.joint_names, at.joints[widest].tolist(), strict=True)),
                pull_out_nm=tuple(curve.at(np.array(TABLE_RPM)).tolist()),
                others=tuple(_in_place(drive, motor, curves, demands, axis) for motor in others),
            )
        )
    return tuple(fits)


def natural_hz(drive: Drive, current_a: float, inertia_kgm2: float) -> float:
    """Return the lowest frequency of small oscillations of a rotor with the inertia that it carries.

    The field is a spring of stiffness Nr (Km I + 4 Td). A belt adds a second spring and a second mass.
    """
    motor, rotor = drive.motor, drive.motor.rotor_inertia_kgm2
    field = motor.teeth * (motor.torque_constant_nm_a * current_a + 4.0 * motor.detent_torque_nm)
    belt = drive.stiffness_nm_rad
    if belt == inf or inertia_kgm2 == 0.0:
        return sqrt(field / (rotor + inertia_kgm2)) / (2.0 * pi)
    own, coupled, load = (field + belt) / rotor, belt * belt / (rotor * inertia_kgm2), belt / inertia_kgm2
    lowest = (own + load) / 2.0 - sqrt((own - load) ** 2 / 4.0 + coupled)
    return sqrt(lowest) / (2.0 * pi)


def _in_place(drive: Drive, motor: Motor, curves: Curves, demands: _Demands, axis: int) -> Fit:
    current_a = min(motor.rated_current_a, drive.current_max_a)
    return _fit(replace(drive, motor=motor), current_a, curves.of(motor, current_a), demands, axis)


def _fit(drive: Drive, current_a: float, curve: PullOutCurve, demands: _Demands, axis: int) -> Fit:
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


def _demands(robot: Robot, at: ArmAtPoses) -> _Demands:
    """Return the demands of each joint in turn at its limits, at each pose."""
    count = len(robot.joints)
    cases = list(product(range(count), (ALMOST_NONE, -ALMOST_NONE, 1.0, -1.0), (1.0, -1.0)))
    rates, accelerations = np.zeros((2, len(cases), count))
    for case, (joint, speed, acceleration) in enumerate(cases):
        rates[case, joint] = speed * robot.joints[joint].speed_max
        accelerations[case, joint] = acceleration * robot.joints[joint].acceleration_max
    rad = np.repeat(at.rad, len(cases), axis=0)
    rad_s, rad_s2 = (np.tile(rotors_of(robot, values), (len(at.rad), 1)) for values in (rates, accelerations))
    return _Demands(carried_torque_nm(at.arm, rad, rad_s, rad_s2), rad_s, rad_s2)


@dataclass(frozen=True, slots=True)
class CycleTime:
    """Duration of a program at a torque reserve.

    Attributes:
        left_percent: the torque reserve.
        duration_s: the duration; None if the motors cannot follow.
        joint: the joint with the least torque left; empty if the motors cannot follow.
        tries: number of motions of the step that the rotors refused most often.
        refused: the reason why the motors cannot follow; empty if they can.
    """

    left_percent: float
    duration_s: float | None
    joint: str = ""
    tries: int = 0
    refused: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def with_motors_of(robot: Robot, models: Mapping[str, str]) -> Robot:
    """Return a robot with other motors of the catalogue at some joints; raise InputError for an unknown one."""
    for name in models:
        if name not in robot.joint_names:
            raise unknown("joint", name, robot.joint_names)
    joints = tuple(
        replace(joint, motor=JointMotor(model=models[joint.name])) if joint.name in models else joint
        for joint in robot.joints
    )
    return replace(robot, joints=joints)


def cycle_times(program: Program, robot: Robot) -> tuple[CycleTime, ...]:
    """Return the duration of a program for each torque reserve; raise InputError for other errors of the program."""
    compile_program(replace(program, limits=None), robot)
    return tuple(_cycle_time(program, robot, left) for left in LEFT_PERCENT)


def _cycle_time(program: Program, robot: Robot, left_percent: float) -> CycleTime:
    asking = replace(program, limits=AskedLimits("motors", left_percent))
    try:
        made = compile_program(asking, robot, drives=motor_limits)
    except InputError as error:
        return CycleTime(left_percent, None, refused=str(error))
    answers = [row.drives for row in made.steps if row.drives]
    weakest = min(answers, key=lambda answer: answer.left_percent)
    return CycleTime(left_percent, made.executed.duration_s, weakest.joint, max(each.tries for each in answers))


def draw_cycles(robot: Robot, cycles: Mapping[str, Sequence[CycleTime]], by_joints_s: float) -> "Figure":
    """Draw the durations by torque reserve, a line for each choice of motors."""
    from matplotlib.figure import Figure

    from steptwin.host.record.plots.canvas import COUNTED, LIMIT

    figure = Figure(figsize=(10, 4.4), layout="constrained")
    figure.suptitle(f"{robot.name}: duration by the torque that its motors are to have left", x=0.01, ha="left")
    axes = figure.subplots()
    for (label, times), color, style in zip(cycles.items(), (COUNTED, "#d08a1d"), ("o-", "s--"), strict=False):
        managed = [each for each in times if each.duration_s is not None]
        axes.plot(
            [each.left_percent for each in managed],
            [each.duration_s or 0.0 for each in managed],
            style,
            color=color,
            markersize=4,
            label=label,
        )
    axes.axhline(by_joints_s, color=LIMIT, linewidth=1.0, label="limits of the joints alone")
    axes.set(xlabel="left_percent [%]", ylabel="duration [s]", xlim=(0.0, LEFT_PERCENT[-1] + 5.0), ylim=(0.0, None))
    axes.legend(loc="lower right")
    return figure
