"""Compute joint positions, and whether they are valid, from the axes' positions."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.words import error_text, error_words, state_text
from steptwin.host.common.errors import DeviceFaultError
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, State

HELD: Final = "held by an emergency stop until `steptwin reset`"
"""Message about a drive after `steptwin estop`."""


def fault_and_remedy(axis: AxisClient, state: State) -> str:
    """Read the reason of a drive's fault state by SDO; return it with its remedy, without the axis' name."""
    if axis.read(od.EMERGENCY_STOP):
        return f"is {HELD}"
    code = axis.read(od.ERROR_CODE)
    reason = f"{error_text(code)} (0x{code:04X})"
    return f"the drive is in {state_text(state)}: {reason}; remove the cause, then `steptwin reset`"


def faulty_drive(axis: AxisClient, state: State) -> DeviceFaultError:
    """Return the error for a drive in a fault state, with the reason and its remedy."""
    held = axis.read(od.EMERGENCY_STOP)
    why = error_words(ErrorCode.ESTOP if held else axis.read(od.ERROR_CODE))
    text = f"{axis.name}: {fault_and_remedy(axis, state)}"
    return DeviceFaultError(text).plainly(f"{axis.name}: {why}; remove the cause, then reset")


class JointReading(NamedTuple):
    """A joint's position in mm or degrees, and whether it has a position reference."""

    position: float
    known: bool


def axis_readings(robot: Robot, units: Sequence[int], known: Sequence[bool]) -> list[JointReading]:
    """Return the positions of the joints, then of the second motors, from the axes' positions in wire units.

    A joint has a position reference if all axes that move it have one. The position of a second motor is that of its
    end of the joint.
    """
    of_axes, coupling = np.array(units), robot.coupling
    positions = robot.to_positions(of_axes).tolist()
    joints = [
        JointReading(position, all(known[axis] for axis in coupling.axes_of(joint)))
        for joint, position in enumerate(positions)
    ]
    ahead = robot.skews(of_axes).tolist()
    return joints + [
        JointReading(positions[joint] + skew / 2, joints[joint].known)
        for joint, skew in zip(coupling.seconds, ahead, strict=True)
    ]


def check_skews(robot: Robot, units: Sequence[int]) -> None:
    """Raise DeviceFaultError if the skew between the two motors of a joint exceeds the limit of the robot file."""
    for joint, skew in zip(robot.coupling.seconds, robot.skews(np.array(units)).tolist(), strict=True):
        first, second = robot.joints[joint], robot.joints[joint].second_motor
        if second and abs(skew) > second.skew_max:
            apart = f"{second.name}: stands {abs(skew):.4g} {first.unit} apart from {first.name}"
            limit = f"more than the {second.skew_max:g} {first.unit} of skew_max: home {first.name} to square it"
            raise DeviceFaultError(f"{apart}, {limit}")
