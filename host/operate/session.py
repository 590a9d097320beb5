"""A robot on the bus: its machine, its units, and the checks before a program moves the machine."""

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from steptwin.host.client import Link, Machine
from steptwin.host.client.axis import AxisClient, Objects
from steptwin.host.client.drive_status import FAULT_STATES, at_rest
from steptwin.host.client.lease import Lease
from steptwin.host.client.reports import await_reports
from steptwin.host.client.stopping import quick_stop, unsure
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError, StepTwinError
from steptwin.host.operate.joint_positions import check_skews, faulty_drive
from steptwin.host.operate.setting_up import WIRE_UNITS, clear_targets, objects_of, read_units
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.poses import PoseDocument
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode, State, Status
from steptwin.protocol.storage import NO_NAME, checksum, stored_name


@dataclass(frozen=True, slots=True)
class Foreign:
    """An axis that belongs to another robot, or uses other units.

    Attributes:
        axis: name of the axis.
        node_id: its node id.
        why: difference between board and robot, as text.
    """

    axis: str
    node_id: int
    why: str

    def __str__(self) -> str:
        return f"{self.axis}: node 0x{self.node_id:02X} {self.why}"


class Session:
    """One robot on one link."""

    def __init__(self, link: Link, robot: Robot, token: int | None = None) -> None:
        """Connect to the robot's machine; a fixed `token` gives identical frames in each run."""
        self.link = link
        self.robot = robot
        self.machine: Machine = Machine(link, robot.axis_names)
        self.lease: Lease = Lease(self.machine.axes, token)
        self._stops_known: int | None = None
        """Number of reported stops when the present action began; None if there is no action."""

    # --- the nodes' own reports

    @property
    def streaming(self) -> bool:
        """True while an axis reports that it executes a trajectory; SDO requests could then disturb its program."""
        return any(axis.interpolating for axis in self.machine.axes)

    def require_present(self) -> None:
        """Raise BusError if a node neither reports its status nor answers."""
        await_reports(self.link, self.machine.axes)
        for axis in self.machine.axes:
            if axis.drive_status is None:
                axis.read(od.DEVICE_TYPE)

    def foreign_board(self) -> Foreign | None:
        """Read the axes' robot names and units; return the first axis of another robot, or None.

        An axis without a robot name may belong to any robot.
        """
        expected = stored_name(self.robot.name)
        for axis in self.machine.axes:
            if axis.read(od.ROBOT_NAME_CRC) not in (NO_NAME, checksum(expected)):
                found = axis.read_text(od.ROBOT_NAME)
                return Foreign(axis.name, axis.node_id, f"belongs to the robot {found}, not to {expected}")
            units = read_units(axis)
            if not units.are_wire_units:
                return Foreign(axis.name, axis.node_id, f"has other units: {units}; not {WIRE_UNITS}")
        return None

    def require_idle(self, what: str) -> None:
        """Raise InputError, which begins with `what`, if an axis reports that it executes a trajectory."""
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
        """Read the position demand value (6062h) of each axis, at which the next motion begins."""
        return [axis.read(od.POSITION_DEMAND) for axis in self.machine.axes]

    def pose(self, joints: list[float]) -> PoseDocument | None:
        """Return the tool's pose at a joint position; None if the mechanism cannot be assembled or has no tool."""
        kinematics = make_kinematics(self.robot)
        pose = kinematics.forward(np.array([joints]))[0]
        return kinematics.task.document(pose) if pose.size and np.isfinite(pose).all() else None

    # --- stops by others

    @contextmanager
    def one_action(self) -> Iterator[None]:
        """Treat the block as one action: a stop meanwhile cancels the rest of it.

        After a stop the axes refuse further commands by themselves. `MachineCharge.enable` refuses to begin a motion,
        even after a reset.
        """
        if self._stops_known is not None:  # the block is part of an action
            yield
            return
        self._stops_known = self._stops()
        try:
            yield
        finally:
            self._stops_known = None

    def _stops(self) -> int:
        return sum(axis.stops for axis in self.machine.axes)

    def require_no_stop(self, what: str) -> None:
        """Raise DeviceFaultError if the machine was stopped, or a node has restarted, since the action began."""
        for axis in self.machine.axes:
            if axis.restarted:
                raise axis.restart()
        if self._stops_known != self._stops():
            raise DeviceFaultError(f"{what}: void, since the machine was stopped after this was asked for")

    # --- taking charge

    def look(self, what: str) -> "MachineAtRest":
        """Make the checks of `charge` without taking charge; the machine is not changed."""
        self.lease.require_free()
        return self.ask(what, None)

    @contextmanager
    def charge(self, what: str, *, needs: Collection[str] | None = None) -> Iterator["MachineCharge"]:
        """Take charge of the machine for the block; `MachineCharge.enable` then prepares it to move.

        If the block ends by an error or Ctrl-C after `enable`, all axes are stopped and their targets reset. Otherwise
        the drives stay enabled and hold their positions.

        The checks of each axis are:
            - no other program is in charge: the axis accepts this program's token;
            - no trajectory runs, which a program may stream without taking charge;
            - its drive is not in fault and is at standstill;
            - it has a position reference, if it is among `needs`.

        `MachineCharge.enable` also checks that it is a stepper axis with the settings of the robot file, monitors this
        host, is still in this program's charge, and was not stopped since the action began. `foreign_board` checks the
        robot when a program connects.

        Args:
            what: name of the action in messages.
            needs: names of the axes that need a position reference; None for all.

        Raises:
            InputError: a program that has not claimed the machine moves it.
            DeviceFaultError: a drive is in fault, has no position reference, or refuses a value; or the machine was
                stopped after the action began.
            BusError: another program is in charge, or a node does not answer.
        """
        with self.one_action(), self._claimed():
            charge = MachineCharge(self, what, needs)
            try:
                yield charge
            except BaseException as error:
                if charge.begun:
                    charge.stop_after(error)
                raise
            finally:
                if charge.begun:
                    with suppress(StepTwinError):
                        charge.leave()

    @contextmanager
    def alone(self, what: str) -> Iterator[None]:
        """Prevent other programs from taking charge for up to a second, without motion; raises as `charge`."""
        with self._claimed():
            self.require_idle(what)
            yield

    @contextmanager
    def _claimed(self) -> Iterator[None]:
        self.lease.claim()
        try:
            yield
        finally:
            self.lease.release()

    def ask(self, what: str, needs: Collection[str] | None) -> "MachineAtRest":
        """Read the axes' states; raise as `charge` if they may not move."""
        self.require_idle(what)
        drives = tuple(self._ask_axis(axis, needs) for axis in self.machine.axes)
        units = self.demanded_units()
        if needs is None or not set(self.robot.axis_names[len(self.robot.joints) :]).isdisjoint(needs):
            check_skews(self.robot, units)
        return MachineAtRest(drives, units, self.positions(units))

    def _ask_axis(self, axis: AxisClient, needs: Collection[str] | None) -> "RestingDrive":
        axis.watch_for_restarts()
        statusword = axis.read(od.STATUSWORD)
        state, mode = State.of(statusword), axis.mode(statusword)
        known = bool(statusword & Status.POSITION_KNOWN)
        if state in FAULT_STATES:
            raise faulty_drive(axis, state)
        if not at_rest(statusword, mode):
            raise _still_moving(f"{axis.name}: is moving")
        if not known and (needs is None or axis.name in needs):
            raise DeviceFaultError(
                f"{axis.name}: the position is unknown: home the machine first, `steptwin home`"
            ).plainly(f"{axis.name}: the position is unknown: home the machine first")
        return RestingDrive(state, mode, known=known, operational=bool(statusword & Status.REMOTE))


class RestingDrive(NamedTuple):
    """A drive at standstill: state and mode, whether it has a position reference, and whether its node reports."""

    state: State
    mode: int
    known: bool
    operational: bool


class MachineAtRest(NamedTuple):
    """A machine at standstill, as read by the checks of `Session.charge`.

    Attributes:
        drives: drive of each axis.
        units: position demand value (6062h) of each axis, at which the next motion begins.
        joints: the same in mm and degrees.
    """

    drives: tuple[RestingDrive, ...]
    units: list[int]
    joints: list[float]

    def knows(self, axes: Iterable[int] | None = None) -> bool:
        """Return whether these axes (None for all) have a position reference."""
        return all(self.drives[axis].known for axis in (range(len(self.drives)) if axes is None else axes))


class MachineCharge:
    """This program's charge of a machine, from `Session.charge`; `start` is the machine at that time."""

    def __init__(self, session: Session, what: str, needs: Collection[str] | None) -> None:
        self.session = session
        self.start: MachineAtRest = session.ask(what, needs)
        self._what = what
        self._needs = needs
        self.begun: bool = False
        """True since the axes are being set up: from then on an error stops them."""

    def enable(self, moving: Collection[int] | None = None) -> Machine:
        """Configure the machine, make its axes monitor this host, enable the drives; raises as `Session.charge`.

        `moving` are the axes that will move; None for all. The other axes keep limits and targets of an earlier
        program, which have no effect.
        """
        session, machine = self.session, self.session.machine
        self.begun = True
        changed = machine.adopt(self._objects(moving))
        if not all(drive.operational for drive in self.start.drives):
            machine.start_nodes()
        session.lease.keep()  # a slow computer may have lost it before its heartbeat started
        session.require_no_stop(self._what)
        if changed:  # a change of the microstep mode loses the position reference
            self.start = session.ask(self._what, self._needs)
        machine.enable([axis for axis, drive in enumerate(self.start.drives) if not _is_enabled(drive)])
        session.require_no_stop(self._what)
        return machine

    def _objects(self, moving: Collection[int] | None) -> list[Objects]:
        """Return the entries of each axis. They reset the target velocity, which an axis follows when enabled."""
        robot = self.session.robot
        return [
            objects_of(joint, robot.board, moves=moving is None or i in moving or drive.mode == Mode.PROFILE_VELOCITY)
            for i, (joint, drive) in enumerate(zip(robot.axes, self.start.drives, strict=True))
        ]

    def stop_after(self, error: BaseException) -> None:
        """Stop all axes after an error and reset their targets; if the bus is silent, raise the error as unsure."""
        session = self.session
        try:
            quick_stop(session.link, session.machine.axes)
        except BusError as silent:
            raise unsure(error if isinstance(error, StepTwinError) else silent) from error
        except DeviceFaultError:
            return  # the first error is the one to report
        with suppress(StepTwinError):
            session.lease.keep()  # if another program has the machine now, its targets must stay
            clear_targets(session.machine.axes)

    def leave(self) -> None:
        """Stop the axes' monitoring of this host, unless they have lost it and another program is in charge now."""
        try:
            self.session.lease.keep()
            self.session.machine.disconnect()
        finally:
            self.session.machine.fall_silent()


def _is_enabled(drive: RestingDrive) -> bool:
    """Return whether a drive is already enabled; its node would have reported a stop."""
    return drive.state is State.OPERATION_ENABLED and drive.operational


def _still_moving(text: str) -> InputError:
    waits = f"{text}; wait for its end, or stop it"
    return InputError(f"{waits} by `steptwin stop`").plainly(waits)
