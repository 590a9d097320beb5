"""A robot on the bus: its machine, its units, and the rules for taking charge of a board that may be at work."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

import numpy as np

from steptwin.host.client import Link, Machine
from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import FAULT_STATES, at_rest
from steptwin.host.client.stopping import quick_stop
from steptwin.host.client.waiting import wait_until
from steptwin.host.client.words import error_text, state_text
from steptwin.host.common.errors import DeviceFaultError, InputError, StepTwinError
from steptwin.host.operate.axis_settings import axis_settings
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import LINEAR_RAMP, State, Status

POSE_KEYS: Final = ("x_mm", "y_mm", "z_mm", "attitude_deg")
_LISTEN_S: Final = 0.3
"""Three times the event timer with which an OPERATIONAL node says how its drive is."""
_HOLD_AFTER_QUICK_STOP: Final = 6
"""0x605A: by the quick stop's ramp into QUICK STOP ACTIVE, in which the motor holds: a vertical axis stays up."""


class Session:
    """One robot behind one link."""

    def __init__(self, link: Link, robot: Robot) -> None:
        self.link = link
        self.robot = robot
        self.machine = Machine(link, robot.joint_names)

    # --- what the nodes say without being asked

    def listen(self) -> None:
        """Wait until every node has said how its drive is, or for so long that it would have been heard."""
        wait_until(self.link, lambda: all(axis.drive_status is not None for axis in self.machine.axes), _LISTEN_S)

    @property
    def streaming(self) -> bool:
        """Whether some axis executes a trajectory, as last heard: its host must not be disturbed by SDO."""
        return any(axis.interpolating for axis in self.machine.axes)

    def require_present(self) -> None:
        """Raise BusError if nodes have said nothing and do not answer either."""
        self.listen()
        for axis in self.machine.axes:
            if axis.drive_status is None:
                axis.read(od.DEVICE_TYPE)

    def require_idle(self, what: str) -> None:
        """Raise InputError if somebody moves the machine, as far as it says so."""
        self.listen()
        if self.streaming:
            raise InputError(f"{what}: a trajectory is running; wait for its end, or stop it by `steptwin stop`")

    # --- units

    def units(self, joints: list[float]) -> list[int]:
        """Wire units of joint positions, rounded as the planner does."""
        return [joint.to_units(position) for position, joint in zip(joints, self.robot.joints, strict=True)]

    def positions(self, units: list[int]) -> list[float]:
        """Joint positions in mm and degrees."""
        return [joint.to_position(position) for position, joint in zip(units, self.robot.joints, strict=True)]

    def demanded_units(self) -> list[int]:
        """Where the axes are to stand (0x6062): where the next motion begins."""
        return [axis.read(od.POSITION_DEMAND) for axis in self.machine.axes]

    def pose(self, joints: list[float]) -> dict[str, float] | None:
        """The tool's pose; None where the mechanism cannot be assembled."""
        pose = make_kinematics(self.robot).forward(np.array([joints]))[0]
        if not np.isfinite(pose).all():
            return None
        return {key: float(value) for key, value in zip(POSE_KEYS, pose, strict=True)}

    # --- taking charge

    def require_ready(self, what: str, *, known: bool = True) -> None:
        """See that the machine may be taken charge of; raises as `in_charge`."""
        self.require_idle(what)
        for axis in self.machine.axes:
            self._check(axis, known=known)

    @contextmanager
    def in_charge(self, what: str, *, known: bool = True) -> Iterator[Machine]:
        """The machine set up, watched and enabled; leaving by an error, or by Ctrl-C, stops all axes first.

        The drives stay enabled afterwards and hold their positions.

        Args:
            what: is to be done, for messages.
            known: whether the axes must know where they are.

        Raises:
            InputError: somebody else moves the machine.
            DeviceFaultError: a drive is in fault, does not know where it is, or refuses what it is told.
            BusError: no answer.
        """
        self.require_ready(what, known=known)
        try:
            self.machine.adopt(tuple(self._objects(joint) for joint in self.robot.joints))
            self.machine.enable()
            yield self.machine
        except BaseException:
            with suppress(StepTwinError):  # what went wrong first is what counts
                quick_stop(self.link, self.machine.axes)
            raise
        finally:
            with suppress(StepTwinError):
                self.machine.disconnect()

    def _check(self, axis: AxisClient, *, known: bool) -> None:
        statusword = axis.read(od.STATUSWORD)
        state = State.of(statusword)
        if state in FAULT_STATES:
            code = axis.read(od.ERROR_CODE)
            raise DeviceFaultError(
                f"{axis.name}: the drive is in {state_text(state)}: {error_text(code)} (0x{code:04X}); "
                "when its cause is gone: `steptwin reset`"
            )
        if not at_rest(statusword, axis.read(od.MODE_OF_OPERATION_DISPLAY)):
            raise InputError(f"{axis.name}: is moving; wait for its end, or stop it by `steptwin stop`")
        if known and not statusword & Status.POSITION_KNOWN:
            raise DeviceFaultError(f"{axis.name}: does not know where it is: it must be homed first, `steptwin home`")

    def _objects(self, joint: Joint) -> list[tuple[int, int]]:
        objects = axis_settings(joint, self.robot.board).objects()
        return [*objects, (od.QUICK_STOP_OPTION, _HOLD_AFTER_QUICK_STOP), (od.MOTION_PROFILE_TYPE, LINEAR_RAMP)]
