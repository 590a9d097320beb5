"""What a run asks of its motors: load angles, torques against what there is, slips, heat."""

from dataclasses import asdict, dataclass
from math import pi
from typing import Any, Final

import numpy as np

from steptwin.emulator.motor import RAD_S_PER_RPM
from steptwin.emulator.needed_torque import needed_torque_nm
from steptwin.emulator.pull_out import pull_out_nm
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motors.after_run import RotorTrace, check_described, drive_of, supply_of
from steptwin.host.twin.motors.driver_events import DriverRecord
from steptwin.host.twin.motors.mechanism import arm_of
from steptwin.host.verify import Comparison
from steptwin.protocol.timer import COUNTS_PER_SECOND

MARGIN_MIN: Final = 0.30
"""Torque that should be left: what builders keep in hand for what a model does not know."""

AMBIENT_CELSIUS: Final = 25.0
_GRID: Final = 32
"""Speeds at which a pull-out curve is computed."""
_EVERY_S: Final = 1e-3


@dataclass(frozen=True, slots=True)
class JointLoad:
    """What one joint's motor had to do.

    Attributes:
        name: the joint.
        motor: the motor's name.
        load_angle_deg: greatest load angle, electrical degrees; beyond 90 a motor holds no more.
        load_angle_at_s: when, from the start of the motion; before it the machine is enabled.
        torque_needed_nm: where the margin is least.
        torque_available_nm: pull-out torque at that speed.
        margin: 1 - needed / available, the least over the motion.
        margin_at_s: when.
        margin_rpm: the motor's speed then.
        first_slip_s: None without a slip.
        lost_full_steps: at the end, with sign.
        winding_celsius: at the end, from 25 degC at the beginning.
    """

    name: str
    motor: str
    load_angle_deg: float
    load_angle_at_s: float
    torque_needed_nm: float
    torque_available_nm: float
    margin: float
    margin_at_s: float
    margin_rpm: float
    first_slip_s: float | None
    lost_full_steps: float
    winding_celsius: float


@dataclass(frozen=True, slots=True)
class MotorVerdict:
    """Whether the motors keep step, and with how much torque to spare."""

    payload_kg: float
    supply_v: float
    joints: tuple[JointLoad, ...]

    @property
    def kept_step(self) -> bool:
        """True if no rotor has slipped."""
        return all(joint.first_slip_s is None for joint in self.joints)

    @property
    def reasons(self) -> tuple[str, ...]:
        """One line for each joint that lost steps."""
        return tuple(
            f"{joint.name}: its rotor slips at {joint.first_slip_s:.3f} s and ends"
            f" {abs(joint.lost_full_steps):g} full steps away"
            for joint in self.joints
            if joint.first_slip_s is not None
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line for each joint with less torque to spare than MARGIN_MIN."""
        return tuple(
            _shortage(joint) for joint in self.joints if joint.first_slip_s is None and joint.margin < MARGIN_MIN
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "payload_kg": self.payload_kg,
            "supply_v": self.supply_v,
            "kept_step": self.kept_step,
            "assumed": ["masses"],
            "joints": [asdict(joint) for joint in self.joints],
        }


def _shortage(joint: JointLoad) -> str:
    place = f"at {joint.margin_at_s:.3f} s, {joint.margin_rpm:.0f} turns a minute"
    torques = f"{joint.name}: needs {joint.torque_needed_nm:.3f} of {joint.torque_available_nm:.3f} Nm {place}"
    if joint.margin < 0.0:
        return f"{torques}: it keeps step only because that is short"
    return f"{torques}: {100 * joint.margin:.0f} % is left, less than {100 * MARGIN_MIN:.0f} %"


def motor_verdict(
    robot: Robot, comparison: Comparison, trace: RotorTrace, current_a: float | None = None
) -> MotorVerdict:
    """Judge a run by what its rotors did, and by the torques that its plan needs."""
    dynamics = check_described(robot)
    rad, rad_s, rad_s2, t_s = _planned(robot, comparison)
    drives = [drive_of(joint, 0.0) for joint in robot.joints]
    needed = needed_torque_nm(drives, arm_of(robot, dynamics.payload_kg), rad, rad_s, rad_s2)
    start = comparison.evidence.start_counts
    loads = []
    for axis, joint in enumerate(robot.joints):
        record = DriverRecord(comparison.evidence.axes[axis], current_a)
        available = _available_nm(robot, axis, record, np.abs(rad_s[:, axis]))
        margins = 1.0 - np.abs(needed[:, axis]) / np.maximum(available, 1e-12)
        least, worst = int(np.argmin(margins)), int(np.argmax(np.abs(trace.load_deg[:, axis])))
        slip = trace.first_slip_counts[axis]
        loads.append(
            JointLoad(
                name=joint.name,
                motor=drives[axis].motor.name,
                load_angle_deg=float(trace.load_deg[worst, axis]),
                load_angle_at_s=float((trace.counts[worst] - start) / COUNTS_PER_SECOND),
                torque_needed_nm=float(abs(needed[least, axis])),
                torque_available_nm=float(available[least]),
                margin=float(margins[least]),
                margin_at_s=float(t_s[least]),
                margin_rpm=float(abs(rad_s[least, axis]) / RAD_S_PER_RPM),
                first_slip_s=None if slip is None else (slip - start) / COUNTS_PER_SECOND,
                lost_full_steps=float(trace.lost_full_steps[-1, axis]),
                winding_celsius=AMBIENT_CELSIUS + float(trace.warmer_k[-1, axis]),
            )
        )
    return MotorVerdict(dynamics.payload_kg, dynamics.supply_v, tuple(loads))


def _planned(robot: Robot, comparison: Comparison) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the rotors' planned angles, speeds and accelerations, each (n, axes), and the instants."""
    trajectory = comparison.expected.trajectory
    t_s = np.arange(0.0, trajectory.duration_s + _EVERY_S / 2, _EVERY_S).clip(max=trajectory.duration_s)
    rad_per_unit = 2.0 * pi / np.array([joint.transmission.travel_per_rev for joint in robot.joints])
    rad = robot.coupling.to_axes(trajectory.positions(t_s)) * rad_per_unit
    rad_s = robot.coupling.to_axes(trajectory.velocities(t_s)) * rad_per_unit
    return rad, rad_s, np.asarray(np.gradient(rad_s, _EVERY_S, axis=0)), t_s


def _available_nm(robot: Robot, axis: int, record: DriverRecord, rad_s: FloatArray) -> FloatArray:
    """Return the pull-out torque at each speed, from a curve at a few speeds."""
    motor = drive_of(robot.joints[axis], 0.0).motor
    supply = supply_of(robot, axis, record.phase_current_a, record.fast_decay)
    rpm = np.linspace(0.0, max(float(rad_s.max()), 1.0), _GRID) / RAD_S_PER_RPM
    return np.interp(rad_s / RAD_S_PER_RPM, rpm, pull_out_nm(motor, supply, rpm))
