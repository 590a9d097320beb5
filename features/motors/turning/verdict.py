"""Verdict on a run's motors: load angles, torques needed and available, slips, heat, and the pose by the rotors.

The pose by the rotors is compared with the planned one and with the one that the drivers counted.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final, Self

import numpy as np

from steptwin.features.motors.turning.after_run import RotorSlip, RotorTrace, first_of
from steptwin.features.motors.turning.drives import motor_of
from steptwin.features.motors.turning.driving import Driving
from steptwin.features.motors.turning.torques import Torques
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.poses import Task
from steptwin.host.verify import Comparison
from steptwin.protocol.drivers import ChipSheet
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True, eq=False)
class ToolPaths:
    """Poses each ms from the start of the motion until the drivers go off.

    Attributes:
        task: task of the tool, which defines the columns.
        t_s: shape (n,), from the start of the motion.
        planned: shape (n, task.width).
        counted: shape (n, task.width), the tool by the drivers' steps.
        reached: shape (n, task.width), the tool by the rotors.
    """

    task: Task

    t_s: FloatArray
    planned: FloatArray
    counted: FloatArray
    reached: FloatArray

    @classmethod
    def of(cls, driving: Driving, comparison: Comparison, trace: RotorTrace) -> Self:
        """Return the paths of a run; link errors of the robot's file are included."""
        expected = comparison.expected
        first = min(int(np.searchsorted(trace.counts, driving.start_counts)), len(trace.counts) - 1)
        shown = slice(first, max(int(np.searchsorted(trace.counts, driving.off_counts)), first + 1))
        t_s = (trace.counts[shown] - driving.start_counts) / COUNTS_PER_SECOND
        planned = expected.motion.positions(np.minimum(t_s, expected.motion.duration_s))
        steps = np.column_stack([axis.around(t_s)[1] for axis in comparison.counted])
        forward = expected.actual_forward or expected.forward
        return cls(
            task=expected.task,
            t_s=t_s,
            planned=expected.forward(planned),
            counted=forward(expected.joints(steps)),
            reached=forward(expected.coupling.to_joints(trace.positions[shown])),
        )


@dataclass(frozen=True, slots=True)
class ToolReached:
    """Distance of the tool by its rotors from the tool by the drivers' counts.

    Attributes:
        position_mm_max: largest distance.
        position_max_at_s: time of the largest distance, from the start of the motion.
        attitude_deg_max: largest angle.
        position_mm_end: distance just before the drivers go off.
        attitude_deg_end: angle just before the drivers go off, with sign.
    """

    position_mm_max: float
    position_max_at_s: float
    attitude_deg_max: float
    position_mm_end: float
    attitude_deg_end: float

    @classmethod
    def of(cls, paths: ToolPaths) -> Self:
        """Return the distances of a run, up to the first impossible pose of the mechanism by its rotors."""
        apart = paths.reached - paths.counted
        possible = np.isfinite(apart).all(axis=1)
        distances_mm = np.linalg.norm(apart[possible, :3], axis=1)
        angles_deg = paths.task.off_deg(paths.reached[possible], paths.counted[possible])
        worst = int(distances_mm.argmax())
        return cls(
            position_mm_max=float(distances_mm[worst]),
            position_max_at_s=float(paths.t_s[possible][worst]),
            attitude_deg_max=float(np.abs(angles_deg).max()),
            position_mm_end=float(distances_mm[-1]),
            attitude_deg_end=float(angles_deg[-1]),
        )


MARGIN_MIN: Final = 0.30
"""Least torque margin: the usual reserve for effects that a model leaves out."""

AMBIENT_CELSIUS: Final = 25.0
WINDING_MAX_CELSIUS: Final = 130.0
"""Limit of insulation class B, which the catalogue's motors have (IEC 60085)."""


@dataclass(frozen=True, slots=True)
class JointLoad:
    """Load of one joint's motor.

    Attributes:
        name: the joint.
        motor: the motor's name.
        load_angle_deg: greatest load angle, electrical degrees; beyond 90 a motor holds no more.
        load_angle_at_s: its time from the start of the motion; negative while the machine is enabled.
        torque_needed_nm: needed torque where the margin is least.
        torque_available_nm: pull-out torque at that speed.
        margin: 1 - needed / available, the least over the motion.
        margin_at_s: time of the least margin.
        margin_rpm: the motor's speed then.
        first_slip_s: time of the first slip; None without one.
        lost_full_steps: full steps lost at the end, with sign.
        winding_celsius: temperature at the end; 25 degC at the beginning.
        winding_celsius_steady: final temperature if the run is repeated without a break.
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
    winding_celsius_steady: float


_BEFORE_S: Final = 0.05
"""Time before a slip in which its cause is looked for: some periods of a rotor that swings."""


@dataclass(frozen=True, slots=True)
class FirstSlip:
    """The first slip of a run, with the torques just before it.

    Attributes:
        name: the joint.
        at_s: its time from the start of the motion.
        place: planned positions of all joints then, by joint.
        torque_needed_nm: needed torque where the margin was least, at most 50 ms before.
        torque_available_nm: pull-out torque there.
        rpm: the motor's speed there.
    """

    name: str
    at_s: float
    place: Mapping[str, float]
    torque_needed_nm: float
    torque_available_nm: float
    rpm: float

    def __str__(self) -> str:
        if self.at_s < 0.0:
            load = f"against a load of {self.torque_needed_nm:.3f} Nm"
            return f"{self.name} slips first, {-self.at_s:.3f} s before the motion, while the drivers switch on, {load}"
        place = ", ".join(f"{name} {position:.3f}" for name, position in self.place.items())
        needs, has = f"{self.torque_needed_nm:.3f} Nm", f"{self.torque_available_nm:.3f} Nm"
        if self.torque_needed_nm > self.torque_available_nm:
            why = f"the motion needs {needs} at {self.rpm:.0f} turns a minute, and the motor has {has}"
        else:
            why = f"its rotor swings: the motion alone needs only {needs} of {has}"
        return f"{self.name} slips first, at {self.at_s:.3f} s and {place}, because {why}"


@dataclass(frozen=True, slots=True)
class MotorVerdict:
    """Verdict on a run's motors: slips, torque margins and heat.

    Attributes:
        payload_kg: mass at the tool, by the robot's file.
        supply_v: voltage of the drivers without load.
        supply_v_min: lowest voltage under load.
        supply_v_max: highest voltage, while motors brake.
        tool: distance of the tool by its rotors from the tool by the drivers' counts.
        joints: loads in the robot's order.
        chip: chip of the drivers.
        other_payloads_kg: masses of the payload that were set during the run. The rotors felt them, but needed torques
            are computed for `payload_kg`.
        first_slip: the first slip of all joints; None without one.
    """

    payload_kg: float
    supply_v: float
    supply_v_min: float
    supply_v_max: float
    tool: ToolReached
    joints: tuple[JointLoad, ...]
    chip: ChipSheet
    other_payloads_kg: tuple[float, ...] = ()
    first_slip: FirstSlip | None = None

    @property
    def answer(self) -> str:
        """Whether the machine loses steps, in one sentence."""
        if self.first_slip is not None:
            lost = [f"{abs(joint.lost_full_steps):g} full steps of {joint.name}" for joint in self._slipped]
            return f"LOSES STEPS, in the end {', '.join(lost)}: {self.first_slip}"
        least = min(self.joints, key=lambda joint: joint.margin)
        when = f"at {least.margin_at_s:.3f} s and {least.margin_rpm:.0f} turns a minute"
        if least.margin < 0.0:
            needed = f"{100 * (1 - least.margin):.0f} % of its torque"
            return f"keeps step: {least.name} needs {needed} {when}, but not for long"
        return f"keeps step, with {100 * least.margin:.0f} % of {least.name}'s torque left {when}"

    @property
    def _slipped(self) -> list[JointLoad]:
        return [joint for joint in self.joints if joint.first_slip_s is not None]

    @property
    def kept_step(self) -> bool:
        """True if no rotor has slipped."""
        return all(joint.first_slip_s is None for joint in self.joints)

    @property
    def reasons(self) -> tuple[str, ...]:
        """One line for each joint that lost steps."""
        return tuple(
            str(RotorSlip(joint.name, joint.first_slip_s, joint.lost_full_steps))
            for joint in self.joints
            if joint.first_slip_s is not None
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line for each joint with a margin below MARGIN_MIN, for hot windings and for the supply."""
        kept = [joint for joint in self.joints if joint.first_slip_s is None]
        return (
            *(_shortage(joint) for joint in kept if joint.margin < MARGIN_MIN),
            *(_heat(joint) for joint in self.joints if joint.winding_celsius_steady > WINDING_MAX_CELSIUS),
            *self._supply_warnings(),
        )

    def _supply_warnings(self) -> tuple[str, ...]:
        (low_v, high_v), chip, lines = self.chip.supply_v.value, self.chip.name, []
        if self.supply_v_min < low_v:
            lines.append(f"supply: falls to {self.supply_v_min:.1f} V, and a {chip} needs {low_v:g} V")
        if self.supply_v_max > high_v:
            lines.append(
                f"supply: braking motors raise it to {self.supply_v_max:.1f} V, and a {chip} bears {high_v:g} V"
            )
        return tuple(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "payload_kg": self.payload_kg,
            **({"other_payloads_kg": list(self.other_payloads_kg)} if self.other_payloads_kg else {}),
            "supply_v": self.supply_v,
            "supply_v_min": self.supply_v_min,
            "supply_v_max": self.supply_v_max,
            "kept_step": self.kept_step,
            "answer": self.answer,
            **({"first_slip": asdict(self.first_slip)} if self.first_slip is not None else {}),
            "assumed": ["masses"],
            "tool": asdict(self.tool),
            "joints": [asdict(joint) for joint in self.joints],
        }


def _shortage(joint: JointLoad) -> str:
    place = f"at {joint.margin_at_s:.3f} s, {joint.margin_rpm:.0f} turns a minute"
    torques = f"{joint.name}: needs {joint.torque_needed_nm:.3f} of {joint.torque_available_nm:.3f} Nm {place}"
    if joint.margin < 0.0:
        return f"{torques}: it keeps step only because that is short"
    return f"{torques}: {100 * joint.margin:.0f} % is left, less than {100 * MARGIN_MIN:.0f} %"


def _heat(joint: JointLoad) -> str:
    return (
        f"{joint.name}: its windings reach {joint.winding_celsius_steady:.0f} degC if the run is repeated without a"
        f" break, more than {WINDING_MAX_CELSIUS:g} degC"
    )


def motor_verdict(
    driving: Driving, comparison: Comparison, torques: Torques, trace: RotorTrace, tool: ToolReached
) -> MotorVerdict:
    """Judge a run by its rotors, and by the torques that its plan needs."""
    dynamics = driving.dynamics
    loads = tuple(_joint_load(driving, torques, trace, axis) for axis in range(len(driving.robot.axes)))
    return MotorVerdict(
        dynamics.payload_kg,
        dynamics.supply_v,
        *trace.supply_span_v,
        tool,
        loads,
        driving.chip,
        trace.other_payloads_kg,
        _first_slip(driving, comparison, torques, trace),
    )


def _first_slip(driving: Driving, comparison: Comparison, torques: Torques, trace: RotorTrace) -> FirstSlip | None:
    slip = first_of(driving, trace.first_slip_counts)
    if slip is None:
        return None
    axis, at_s = driving.robot.axis_names.index(slip.joint), slip.at_s
    motion = comparison.expected.motion
    in_motion_s = min(max(at_s, 0.0), motion.duration_s)
    first, last = np.searchsorted(torques.t_s, (in_motion_s - _BEFORE_S, in_motion_s), side="left").tolist()
    worst = first + int(np.argmin(torques.margins[first : last + 1, axis]))
    positions = motion.positions(np.array([in_motion_s]))[0].tolist()
    return FirstSlip(
        name=slip.joint,
        at_s=at_s,
        place=dict(zip(motion.joint_names, positions, strict=True)),
        torque_needed_nm=float(abs(torques.needed_nm[worst, axis])),
        torque_available_nm=float(torques.available_nm[worst, axis]),
        rpm=float(abs(torques.rpm[worst, axis])),
    )


def _joint_load(driving: Driving, torques: Torques, trace: RotorTrace, axis: int) -> JointLoad:
    joint = driving.robot.axes[axis]
    assert joint.motor is not None
    motor = motor_of(joint.motor, joint.transmission.full_steps_per_rev)
    margins = torques.margins[:, axis]
    least, worst = int(np.argmin(margins)), int(np.argmax(np.abs(trace.load_deg[:, axis])))
    slip = trace.first_slip_counts[axis]
    return JointLoad(
        name=joint.name,
        motor=motor.name,
        load_angle_deg=float(trace.load_deg[worst, axis]),
        load_angle_at_s=driving.seconds(int(trace.counts[worst])),
        torque_needed_nm=float(abs(torques.needed_nm[least, axis])),
        torque_available_nm=float(torques.available_nm[least, axis]),
        margin=float(margins[least]),
        margin_at_s=float(torques.t_s[least]),
        margin_rpm=float(abs(torques.rpm[least, axis])),
        first_slip_s=None if slip is None else driving.seconds(slip),
        lost_full_steps=float(trace.lost_full_steps[-1, axis]),
        winding_celsius=AMBIENT_CELSIUS + float(trace.warmer_k[-1, axis]),
        winding_celsius_steady=AMBIENT_CELSIUS + _steady_k(driving, trace, axis),
    )


def _steady_k(driving: Driving, trace: RotorTrace, axis: int) -> float:
    """Return the rise of the windings' temperature at the mean of their losses."""
    drive = driving.drives()[axis]
    in_winding = drive.motor.resistance_ohm / (drive.motor.resistance_ohm + drive.bridge_ohm)
    seconds = len(trace.counts) / 1000.0
    return float(drive.motor.thermal_resistance_k_w * in_winding * trace.energies.copper[axis] / seconds)
