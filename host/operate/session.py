"""A robot on the bus: its machine, its units, and the gate: what is asked of a machine before a program moves it."""

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
    """An axis that belongs to another robot, or counts in other units.

    Attributes:
        axis: its name.
        node_id: its node.
        why: what the board says of it, and what the robot needs.
    """

    axis: str
    node_id: int
    why: str

    def __str__(self) -> str:
        return f"{self.axis}: node 0x{self.node_id:02X} {self.why}"


class Session:
    """One robot on one link."""

    def __init__(self, link: Link, robot: Robot, token: int | None = None) -> None:
        """Connect to the robot's machine; `token` is for programs that must send the same frames each time."""
        self.link = link
        self.robot = robot
        self.machine: Machine = Machine(link, robot.axis_names)
        self.lease: Lease = Lease(self.machine.axes, token)
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
        """Read whose the axes are, and their units; return the first axis that is not this robot's, None if all are.

        An axis without a name may be any robot's.
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
        """Read the position demand value (6062h) of each axis, where the next motion begins."""
        return [axis.read(od.POSITION_DEMAND) for axis in self.machine.axes]

    def pose(self, joints: list[float]) -> PoseDocument | None:
        """Return the tool's pose at a joint position; None where the mechanism cannot be assembled or has no tool."""
        kinematics = make_kinematics(self.robot)
        pose = kinematics.forward(np.array([joints]))[0]
        return kinematics.task.document(pose) if pose.size and np.isfinite(pose).all() else None

    # --- stops by others

    @contextmanager
    def one_action(self) -> Iterator[None]:
        """Let all that the block does be one action: a stop that comes meanwhile makes the rest of it void.

        The axes then refuse by themselves what has begun; `MachineCharge.enable` refuses to begin, also after a reset.
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

    def require_no_stop(self, what: str) -> None:
        """Raise DeviceFaultError if the machine was stopped, or a node restarted, after the present action began."""
        for axis in self.machine.axes:
            if axis.restarted:
                raise axis.restart()
        if self._stops_known != self._stops():
            raise DeviceFaultError(f"{what}: void, since the machine was stopped after this was asked for")

    # --- taking charge

    def look(self, what: str) -> "MachineAtRest":
        """Ask the axes what `charge` asks them, without taking charge; nothing on the machine changes."""
        self.lease.require_free()
        return self.ask(what, None)

    @contextmanager
    def charge(self, what: str, *, needs: Collection[str] | None = None) -> Iterator["MachineCharge"]:
        """Go through the gate: take charge of the machine, and by `MachineCharge.enable` set it up to move it.

        The block asks nothing again. Leaving by an error or by Ctrl-C stops all axes first, once they are set
        up, and takes back their targets. Afterwards the drives stay enabled and hold their positions.

        The gate asks each axis:
            - that no other program is in charge: the axis takes this program's token;
            - that no trajectory runs, which a program may stream that claims no charge;
            - that its drive is not in fault, that it rests, and where;
            - that it knows its position, if it is among `needs`.
        `MachineCharge.enable` asks, too, that it is a stepper axis, has the settings of the robot's file, watches this
        host, is still in this program's charge, and that nothing has stopped it since the action began. Whose board it
        is, `foreign_board` asks when a program connects.

        Args:
            what: names the action in messages.
            needs: names of the axes that must know their positions; None: all.

        Raises:
            InputError: a program that claims no charge moves the machine.
            DeviceFaultError: a drive is in fault, has no known position, or refuses a value; or the machine was stopped
                after the action began.
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
        """Keep other programs from taking charge for a second, while nothing moves. Raises as `charge`."""
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
        """Ask the axes how they are; raise as `charge` unless they may move."""
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
    """A drive at rest: its state and mode, whether it knows its position, and whether its node reports by itself."""

    state: State
    mode: int
    known: bool
    operational: bool


class MachineAtRest(NamedTuple):
    """A machine at rest, as its axes said at the gate: a function that moves it need not ask them again.

    Attributes:
        drives: the drive of each axis.
        units: position demand value (6062h) of each axis, where the next motion begins.
        joints: the same in mm and degrees.
    """

    drives: tuple[RestingDrive, ...]
    units: list[int]
    joints: list[float]

    def knows(self, axes: Iterable[int] | None = None) -> bool:
        """Return whether these axes know their positions; None: all."""
        return all(self.drives[axis].known for axis in (range(len(self.drives)) if axes is None else axes))


class MachineCharge:
    """This program's charge of a machine, from `Session.charge`; `start` is how the machine stood then."""

    def __init__(self, session: Session, what: str, needs: Collection[str] | None) -> None:
        self.session = session
        self.start: MachineAtRest = session.ask(what, needs)
        self._what = what
        self._needs = needs
        self.begun: bool = False
        """True once the axes are being set up: from then on an error stops them."""

    def enable(self, moving: Collection[int] | None = None) -> Machine:
        """Set the machine up, let its axes watch this host, enable the drives. Raises as `Session.charge`.

        `moving` has the axes that will move; None: all. Of the others, the limits and targets of an earlier program
        stay, which nothing uses.
        """
        session, machine = self.session, self.session.machine
        self.begun = True
        changed = machine.adopt(self._objects(moving))
        if not all(drive.operational for drive in self.start.drives):
            machine.start_nodes()
        session.lease.keep()  # a computer that was too slow may have lost it before the heartbeat
        session.require_no_stop(self._what)
        if changed:  # another microstep mode loses the position
            self.start = session.ask(self._what, self._needs)
        machine.enable([axis for axis, drive in enumerate(self.start.drives) if not _is_enabled(drive)])
        session.require_no_stop(self._what)
        return machine

    def _objects(self, moving: Collection[int] | None) -> list[Objects]:
        """Return what each axis must hold. In profile velocity an axis follows its target by being enabled."""
        robot = self.session.robot
        return [
            objects_of(joint, robot.board, moves=moving is None or i in moving or drive.mode == Mode.PROFILE_VELOCITY)
            for i, (joint, drive) in enumerate(zip(robot.axes, self.start.drives, strict=True))
        ]

    def stop_after(self, error: BaseException) -> None:
        """Stop all axes after an error and take back their targets; raise it, as unsure, if the bus is silent."""
        session = self.session
        try:
            quick_stop(session.link, session.machine.axes)
        except BusError as silent:
            raise unsure(error if isinstance(error, StepTwinError) else silent) from error
        except DeviceFaultError:
            return  # the first error is the one to report
        with suppress(StepTwinError):
            session.lease.keep()  # another program that has the machine now keeps its own targets
            clear_targets(session.machine.axes)

    def leave(self) -> None:
        """Let the axes stop watching this host, unless they have lost it and another program is in charge now."""
        try:
            self.session.lease.keep()
            self.session.machine.disconnect()
        finally:
            self.session.machine.fall_silent()


def _is_enabled(drive: RestingDrive) -> bool:
    """Return whether a drive needs no enabling: its node would have reported a stop since then."""
    return drive.state is State.OPERATION_ENABLED and drive.operational


def _still_moving(text: str) -> InputError:
    waits = f"{text}; wait for its end, or stop it"
    return InputError(f"{waits} by `steptwin stop`").plainly(waits)
