"""Let a robot's motors turn with its boards: what the emulator must know of them, and what the rotors did."""

from collections.abc import Sequence
from functools import partial
from math import pi

from steptwin.emulator.motors.rotor_watch import REST_TICKS, MotorWiring
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.boards import standing_steps
from steptwin.host.twin.machine.input_changes import Wires
from steptwin.host.twin.motors.drives import check_described, drive_of, power_supply
from steptwin.host.twin.motors.mechanism import arm_of
from steptwin.protocol.drivers import ChipSheet


def motor_wiring(
    robot: Robot,
    chip: ChipSheet,
    start_joints: Sequence[float],
    axes_per_board: Sequence[int],
    stretch_ticks: int = REST_TICKS,
) -> MotorWiring:
    """Return a robot's motors and arm as the emulator has them.

    Args:
        robot: the machine.
        chip: of its drivers.
        start_joints: joint positions where it stands at power-up, mm and degrees.
        axes_per_board: number of axes on each board.
        stretch_ticks: greatest number of servo ticks that the rotors turn at once while an axis moves.

    Raises:
        InputError: the robot's file does not describe its motors and masses.
    """
    dynamics = check_described(robot)
    steps = standing_steps(robot, start_joints)
    held_by = dynamics.payload_held_by
    return MotorWiring(
        drives=[drive_of(joint, chip) for joint in robot.joints],
        start_rad=[
            2.0 * pi * each / (joint.transmission.full_steps_per_rev * joint.transmission.microsteps)
            for each, joint in zip(steps, robot.joints, strict=True)
        ],
        arm_with=partial(arm_of, robot),
        payload_kg=dynamics.payload_kg,
        supply=power_supply(dynamics),
        held_by=Wires(robot, axes_per_board).output(held_by) if held_by else None,
        stretch_ticks=stretch_ticks,
    )
