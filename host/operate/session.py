"""A robot on the bus: its machine, its units, and the rules for taking charge of a board that may be in use."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import numpy as np

from steptwin.host.client import Link, Machine
from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import FAULT_STATES, at_rest
from steptwin.host.client.faults import await_reports
from steptwin.host.client.lease import Lease
from steptwin.host.client.stopping import quick_stop, unsure
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError, StepTwinError
from steptwin.host.operate.joint_positions import faulty_drive
from steptwin.host.operate.setting_up import clear_targets, take_over
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import POSE_KEYS
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import State, Status
from steptwin.protocol.robot_name import NO_NAME, checksum, stored_name


@dataclass(frozen=True, slots=True)
class Foreign:
    """An axis that belongs to another robot.

    Attributes:
        axis: its name.
        node_id: its node.
        found: the robot to which the board says it belongs.
        expected: the robot that was looked for.
    """

    axis: str
    node_id: int
    found: str
    expected: str

    def __str__(self) -> str:
        return f"{self.axis}: node 0x{self.node_id:02X} belongs to the robot {self.found}, not to {self.expected}"


class Session:
    """One robot on one link."""

    def __init__(self, link: Link, robot: Robot, token: int | None = None) -> None:
        """Connect to the robot's machine; `token` is for programs that must send the same frames each time."""
        self.link = link
        self.robot = robot
        self.machine = Machine(link, robot.joint_names)
        self._lease = Lease(self.machine.axes, token)
        self._stops_known: int | None = None
        """Stops that the axes had reported when the present action began; None without an action."""

    # --- what the nodes report by themselves

    @property
    def streaming(self) -> bool:
        """True while an axis reports that it executes a trajectory; SDO requests could disturb its program."""
        return any(axis.interpolating for axis in self.machine.axes)

    def require_present(self) -> None:
        """Raise BusError if a node neither reports its status nor answers."""
        await_reports(self.link, self.machine.axes)
        for axis in self.machine.axes:
            if axis.drive_status is None:
                axis.read(od.DEVICE_TYPE)

    def foreign_board(self) -> Foreign | None:
        """Read whose the axes are; return which of them belongs to another robot, None if none says so.

        An axis without a name may be any robot's.
        """
        expected = stored_name(self.robot.name)
        for axis in self.machine.axes:
            if axis.read(od.ROBOT_NAME_CRC) not in (NO_NAME, checksum(expected)):
                found = axis.read_text(od.ROBOT_NAME)
                return Foreign(axis.name, axis.node_id, found, expected)
        return None

    def require_idle(self, what: str) -> None:
        """Raise InputError if an axis reports that it executes a trajectory; the message begins with `what`."""
        await_reports(self.link, self.machine.axes)
        if self.streaming:
            raise _still_moving(f"{what}: a trajectory is running")

    # --- units

    def units(self, joints: list[float]) -> list[int]:
        """Convert joint positions in mm and degrees to wire units, rounded as in a plan."""
        return [int(units) for units in self.robot.to_units(np.array(joints))]

    def positions(self, units: list[int]) -> list[float]:
        """Convert wire units to joint positions in mm and degrees."""
        return [float(position) for position in self.robot.to_positions(np.array(units))]

    def demanded_units(self) -> list[int]:
        """Read the position demand value (6062h) of each axis, from which the next motion begins."""
        return [axis.read(od.POSITION_DEMAND) for axis in self.machine.axes]

    def pose(self, joints: list[float]) -> dict[str, float] | None:
        """Return the tool's pose at a joint position; None where the mechanism cannot be assembled."""
        pose = make_kinematics(self.robot).forward(np.array([joints]))[0]
        if not np.isfinite(pose).all():
            return None
        return {key: float(value) for key, value in zip(POSE_KEYS, pose, strict=True)}

    # --- stops by others

    @contextmanager
    def one_action(self) -> Iterator[None]:
        """Let all that the block does be one action: a stop that comes meanwhile makes the rest of it void.

        The axes then refuse by themselves what has begun; `in_charge` refuses to begin, also after a reset.
        """
        if self._stops_known is not None:  # a part of an action
            yield
            return
        self._stops_known = self._stops()
        try:
            yield
        finally:
            self._stops_known = None

    def _stops(self) -> int:
        return sum(axis.stops for axis in self.machine.axes)

    def _require_no_stop(self, what: str) -> None:
        if self._stops_known != self._stops():
            raise DeviceFaultError(f"{what}: void, since the machine was stopped after this was asked for")

    # --- taking charge

    def require_ready(self, what: str, *, known: bool = True) -> None:
        """Check that this program may take charge of the machine; raises as `in_charge`."""
        self._lease.require_free()
        self.require_idle(what)
        for axis in self.machine.axes:
            self._check(axis, known=known)

    def require_known(self, names: Iterable[str]) -> None:
        """Raise DeviceFaultError unless these axes know their positions."""
        wanted = set(names)
        for axis in self.machine.axes:
            if axis.name in wanted:
                _check_known(axis, axis.read(od.STATUSWORD))

    def known_pose(self, joints: list[float]) -> dict[str, float] | None:
        """Return the tool's pose as `pose` does; None, too, while an axis does not know its position."""
        known = all(axis.read(od.STATUSWORD) & Status.POSITION_KNOWN for axis in self.machine.axes)
        return self.pose(joints) if known else None

    @contextmanager
    def in_charge(self, what: str, *, known: bool = True) -> Iterator[Machine]:
        """Take charge of the machine: set it up, let its axes watch this host, enable the drives.

        Leaving the context by an error or by Ctrl-C stops all axes first and takes back their targets. Afterwards the
        drives stay enabled and hold their positions. `what` names the action in messages; with `known` every axis must
        know its position.

        Raises:
            InputError: a program that claims no lease moves the machine.
            DeviceFaultError: a drive is in fault, has no known position, or refuses a value; or the machine was stopped
                after the action began.
            BusError: another program is in charge, or a node does not answer.
        """
        with self.one_action(), self.alone():
            self.require_ready(what, known=known)
            try:
                take_over(self.machine, self.robot)
                self._lease.claim()  # once more: a computer that was too slow may have lost it before the heartbeat
                self._require_no_stop(what)
                self.machine.enable()
                self._require_no_stop(what)
                yield self.machine
            except BaseException as error:
                self._stop_after(error)
                raise
            finally:
                with suppress(StepTwinError):
                    self._leave()

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other programs from taking charge: for a second, unless the block takes charge itself, which ends it.

        Raises:
            BusError: another program is in charge, or a node does not answer.
        """
        self._lease.claim()
        try:
            yield
        finally:
            self._lease.release()

    def _leave(self) -> None:
        """Let the axes stop watching this host, unless they have lost it and another program is in charge now."""
        try:
            self._lease.claim()
            self.machine.disconnect()
        finally:
            self.machine.fall_silent()

    def _stop_after(self, error: BaseException) -> None:
        """Stop all axes and take back their targets; if they cannot be told, raise an error that says so as well."""
        try:
            quick_stop(self.link, self.machine.axes)
        except BusError as silent:
            raise unsure(error if isinstance(error, StepTwinError) else silent) from error
        except DeviceFaultError:
            return  # the first error is the one to report
        with suppress(StepTwinError):
            self._lease.claim()  # another program that has the machine now keeps its own targets
            clear_targets(self.machine.axes)

    def _check(self, axis: AxisClient, *, known: bool) -> None:
        statusword = axis.read(od.STATUSWORD)
        state = State.of(statusword)
        if state in FAULT_STATES:
            raise faulty_drive(axis, state)
        if not at_rest(statusword, axis.read(od.MODE_OF_OPERATION_DISPLAY)):
            raise _still_moving(f"{axis.name}: is moving")
        if known:
            _check_known(axis, statusword)


def _check_known(axis: AxisClient, statusword: int) -> None:
    if not statusword & Status.POSITION_KNOWN:
        raise DeviceFaultError(
            f"{axis.name}: the position is unknown: home the machine first, `steptwin home`"
        ).plainly(f"{axis.name}: the position is unknown: home the machine first")


def _still_moving(text: str) -> InputError:
    waits = f"{text}; wait for its end, or stop it"
    return InputError(f"{waits} by `steptwin stop`").plainly(waits)
