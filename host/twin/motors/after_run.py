"""Turn a robot's motors by the record of a run, from power-up to its end: no board is emulated again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, pi
from typing import Final

import numpy as np

from steptwin.emulator.motor import CATALOGUE, FULL_STEPS_PER_TOOTH, Motor
from steptwin.emulator.power_supply import PowerSupply
from steptwin.emulator.pull_out import Supply
from steptwin.emulator.rotors import Drive, RotorRecord, Rotors
from steptwin.emulator.tb6560 import SENSE_OHM
from steptwin.emulator.tb6560.thermal import ON_RESISTANCE_OHM
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.robots.board_settings import PHASE_CURRENT_MAX_A
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.motor import FIGURES, Dynamics, JointMotor
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motors.driver_events import DriverRecord
from steptwin.host.twin.motors.mechanism import arm_of
from steptwin.host.verify import Evidence
from steptwin.protocol.timer import COUNTS_PER_MS

_SETTLING_MS: Final = 100
"""Time after the last edge for which the rotors are followed: what slips by an overshoot slips then."""
_CHUNK_MS: Final = 250
"""Time between two reports of progress."""

Progress = Callable[[float], None]
"""Takes the fraction that is done."""


@dataclass(frozen=True, slots=True, eq=False)
class RotorTrace:
    """What the rotors did, a row for each ms.

    Attributes:
        counts: shape (n,), the instants.
        positions: shape (n, axes), where the rotors really put the axes, in mm and degrees.
        load_deg: shape (n, axes), load angle of the greatest amount in that ms, electrical degrees.
        torque_nm: shape (n, axes), the motors' torques.
        lost_full_steps: shape (n, axes).
        warmer_k: shape (n, axes), the windings above the surroundings.
        first_slip_counts: of each axis, None if it has not slipped.
    """

    counts: Int64Array
    positions: FloatArray
    load_deg: FloatArray
    torque_nm: FloatArray
    lost_full_steps: FloatArray
    warmer_k: FloatArray
    first_slip_counts: tuple[int | None, ...]


def motor_of(chosen: JointMotor, full_steps_per_rev: int) -> Motor:
    """Return the motor that a robot's file names or describes."""
    if chosen.model:
        return CATALOGUE[chosen.model]
    figures = {key: float(getattr(chosen, key)) for key in FIGURES}
    return Motor("own", source="the robot's file", full_steps_per_rev=full_steps_per_rev, **figures)


def check_described(robot: Robot) -> Dynamics:
    """Return supply and payload; raise InputError, with the missing key, unless all motors and masses are known."""
    if robot.dynamics is None:
        raise InputError("dynamics: is missing: the supply of the motors is unknown (docs/motors.md)")
    for joint in robot.joints:
        for key in ("motor", "link"):
            if getattr(joint, key) is None:
                raise InputError(
                    f"joints.{joint.name}.{key}: is missing: the joint's {key} is unknown (docs/motors.md)"
                )
    return robot.dynamics


def power_supply(dynamics: Dynamics) -> PowerSupply:
    """Return the supply of a robot's drivers."""
    return PowerSupply(dynamics.supply_v, dynamics.supply_ohm, 1e-6 * dynamics.supply_uf)


def drive_of(joint: Joint, mounting_rad: float, sense_ohm: float = SENSE_OHM) -> Drive:
    """Return the drive of a joint that has a motor."""
    chosen, transmission = joint.motor, joint.transmission
    assert chosen is not None
    return Drive(
        motor=motor_of(chosen, transmission.full_steps_per_rev),
        bridge_ohm=ON_RESISTANCE_OHM + sense_ohm,
        friction_nm=chosen.friction_nm,
        efficiency=chosen.efficiency,
        brake_nm=chosen.brake_nm,
        stiffness_nm_rad=inf if chosen.belt_nm_rad is None else chosen.belt_nm_rad,
        damping_nm_s=chosen.belt_damping_nm_s,
        mounting_rad=mounting_rad,
    )


def rotors_after_run(
    robot: Robot, evidence: Evidence, *, current_a: float | None = None, progress: Progress = lambda _: None
) -> RotorTrace:
    """Turn the rotors by a run's record, with another phase current if one is given.

    Raises:
        InputError: the robot's file does not describe its motors and masses, or no TB6560 sets that current.
    """
    dynamics = check_described(robot)
    if current_a is not None and not 0.0 < current_a <= PHASE_CURRENT_MAX_A:
        raise InputError(f"current_a={current_a:g} A is not above 0 and up to {PHASE_CURRENT_MAX_A:g} A")
    records = [DriverRecord(axis, current_a) for axis in evidence.axes]
    starts_rad = [
        2.0 * pi * axis.start_steps / (joint.transmission.full_steps_per_rev * joint.transmission.microsteps)
        for axis, joint in zip(evidence.axes, robot.joints, strict=True)
    ]
    drives, events = [], []
    for joint, record, start_rad in zip(robot.joints, records, starts_rad, strict=True):
        teeth = joint.transmission.full_steps_per_rev // FULL_STEPS_PER_TOOTH
        drives.append(drive_of(joint, record.first_on_rad - teeth * start_rad))
        events.append(record.events(record.first_on_rad))
    arms = (arm_of(robot, 0.0), arm_of(robot, dynamics.payload_kg))
    held = _held(robot, dynamics, evidence)
    rotors = Rotors(drives, arms[held(0)], power_supply(dynamics), starts_rad)
    rotors.feed(events)
    total_ms = max(axis.last_counts for axis in evidence.axes) // COUNTS_PER_MS + _SETTLING_MS
    parts: list[RotorRecord] = []
    for first_ms in range(0, total_ms, _CHUNK_MS):
        rotors.carry(arms[held(rotors.counts)])
        parts.append(rotors.advance(min(_CHUNK_MS, total_ms - first_ms)))
        progress(min(1.0, (first_ms + _CHUNK_MS) / total_ms))
    return _trace(robot, parts, rotors)


def _held(robot: Robot, dynamics: Dynamics, evidence: Evidence) -> Callable[[int], bool]:
    """Return a function that says whether the payload hangs at the tool at an instant."""
    name = dynamics.payload_held_by
    if not name:
        return lambda _: True
    output = robot.outputs[name]
    pin = evidence.axes[robot.index_of(output.joint)].pins[f"out{output.out}"]
    levels = np.concatenate([[0], pin.levels])
    return lambda counts: bool(levels[np.searchsorted(pin.counts, counts, side="right")])


def _trace(robot: Robot, parts: Sequence[RotorRecord], rotors: Rotors) -> RotorTrace:
    travel = np.array([joint.transmission.travel_per_rev for joint in robot.joints]) / (2.0 * pi)

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
    )


def supply_of(robot: Robot, axis: int, current_a: float, fast_decay: float) -> Supply:
    """Return what drives an axis' motor, for its pull-out torque."""
    dynamics = check_described(robot)
    return Supply(dynamics.supply_v, current_a, fast_decay, drive_of(robot.joints[axis], 0.0).bridge_ohm)
