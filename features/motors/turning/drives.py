"""Convert motors, gears and supply of a robot's file to those of the rotors' model."""

from collections.abc import Sequence
from functools import partial
from math import inf, pi

from steptwin.emulator.drivers.power_supply import PowerSupply
from steptwin.features.motors.rotors.motor import CATALOGUE, Motor
from steptwin.features.motors.rotors.rotor_watch import MotorWiring
from steptwin.features.motors.rotors.rotors import Drive
from steptwin.features.motors.rotors.torques import DriveSupply
from steptwin.features.motors.turning.mechanism import arm_of
from steptwin.host.common.errors import InputError
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.motor import FIGURES, Dynamics, JointMotor
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.boards import steps_at_joints
from steptwin.host.twin.machine.input_changes import Wires
from steptwin.protocol.drivers import ChipSheet


def check_described(robot: Robot) -> Dynamics:
    """Return supply and payload; raise InputError, with the missing key, if motors or masses are missing."""
    if robot.dynamics is None:
        raise InputError("dynamics: is missing: the supply of the motors is unknown (docs/motors.md)")
    for joint in robot.joints:
        for key in ("motor", "link"):
            if getattr(joint, key) is None:
                raise InputError(
                    f"joints.{joint.name}.{key}: is missing: the joint's {key} is unknown (docs/motors.md)"
                )
    return robot.dynamics


def motor_of(chosen: JointMotor, full_steps_per_rev: int) -> Motor:
    """Return the motor that a robot's file names or describes."""
    if chosen.model:
        return CATALOGUE[chosen.model]
    figures = {key: float(getattr(chosen, key)) for key in FIGURES}
    return Motor("own", source="the robot's file", full_steps_per_rev=full_steps_per_rev, **figures)


def drive_of(joint: Joint, chip: ChipSheet, mounting_rad: float = 0.0) -> Drive:
    """Return the drive of a joint with a motor, at a driver with this chip."""
    chosen, link, transmission = joint.motor, joint.link, joint.transmission
    assert chosen is not None
    lower, upper = (link.stop_lower, link.stop_upper) if link else (None, None)
    rad_per_unit = 2.0 * pi / transmission.travel_per_rev
    return Drive(
        motor=motor_of(chosen, transmission.full_steps_per_rev),
        bridge_ohm=bridge_ohm(chip),
        current_max_a=chip.current_max_a.value,
        friction_nm=chosen.friction_nm,
        efficiency=chosen.efficiency,
        brake_nm=chosen.brake_nm,
        stiffness_nm_rad=inf if chosen.belt_nm_rad is None else chosen.belt_nm_rad,
        damping_nm_s=chosen.belt_damping_nm_s,
        lower_rad=-inf if lower is None else rad_per_unit * lower,
        upper_rad=inf if upper is None else rad_per_unit * upper,
        mounting_rad=mounting_rad,
    )


def power_supply(dynamics: Dynamics) -> PowerSupply:
    """Return the supply of a robot's drivers."""
    return PowerSupply(dynamics.supply_v, dynamics.supply_ohm, 1e-6 * dynamics.supply_uf)


def supply_of(
    robot: Robot, chip: ChipSheet, current_a: float, fast_decay: float, volt: float | None = None
) -> DriveSupply:
    """Return the supply of a motor for its pull-out torque; by default at the full voltage."""
    volt = check_described(robot).supply_v if volt is None else volt
    return DriveSupply(volt, current_a, fast_decay, bridge_ohm(chip))


def bridge_ohm(chip: ChipSheet) -> float:
    """Return a chip's resistance in series with a phase: both switches of its bridge and the sense resistor."""
    return chip.on_resistance_ohm.value + chip.sense_ohm.value


def motor_wiring(
    robot: Robot,
    chip: ChipSheet,
    start_joints: Sequence[float],
    axes_per_board: Sequence[int],
) -> MotorWiring:
    """Return a robot's motors and arm for the rotors' model.

    Args:
        robot: the machine.
        chip: chip of its drivers.
        start_joints: joint positions at power-up, mm and degrees.
        axes_per_board: number of axes on each board.

    Raises:
        InputError: the robot's file does not describe its motors and masses.
    """
    dynamics = check_described(robot)
    steps = steps_at_joints(robot, start_joints)
    held_by = dynamics.payload_held_by
    return MotorWiring(
        drives=[drive_of(joint, chip) for joint in robot.axes],
        start_rad=[
            2.0 * pi * each / (joint.transmission.full_steps_per_rev * joint.transmission.microsteps)
            for each, joint in zip(steps, robot.axes, strict=True)
        ],
        arm_with=partial(arm_of, robot),
        payload_kg=dynamics.payload_kg,
        supply=power_supply(dynamics),
        held_by=Wires(robot, axes_per_board).output(held_by) if held_by else None,
    )
