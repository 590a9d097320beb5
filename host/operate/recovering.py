"""Stop a machine, hold it in an emergency stop and reset its faults, in any state of its drives and nodes."""

from dataclasses import dataclass

from steptwin.host.client import stopping
from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import FAULT_STATES
from steptwin.host.client.plain_words import error_words
from steptwin.host.client.waiting import REPLY_TIMEOUT_S, wait_until
from steptwin.host.client.words import error_text, state_text
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.host.operate.joint_positions import joint_positions
from steptwin.host.operate.session import Session
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, State, Status


@dataclass(frozen=True, slots=True)
class AxisState:
    """The state of an axis' drive; its joint's position in mm or degrees, and whether that position is known."""

    name: str
    state: str
    position: float
    position_known: bool


def stop(session: Session) -> list[AxisState]:
    """Quick stop all axes at once; raises as `client.stopping.quick_stop`."""
    stopping.quick_stop(session.link, session.machine.axes)
    return axis_states(session)


def emergency_stop(session: Session) -> list[AxisState]:
    """Stop all axes at once and hold them until `reset`; raises as `client.stopping.emergency_stop`."""
    stopping.emergency_stop(session.link, session.machine.axes)
    return axis_states(session)


def reset(session: Session) -> list[AxisState]:
    """Reset every drive that is in fault; the power of all these drives is off afterwards.

    Nodes that another master has stopped, or that have restarted, are started (NMT): `wake` says how.

    Raises:
        InputError: a program that claims no lease runs a trajectory.
        DeviceFaultError: a drive stays in fault because the cause lasts.
        BusError: another program is in charge, or a node does not answer.
    """
    wake(session)
    with session.alone():
        session.require_idle("reset")
        for axis in session.machine.axes:
            if not axis.read(od.STATUSWORD) & Status.REMOTE:
                axis.start_node()
        for axis in session.machine.axes:
            if axis.state() is State.FAULT:
                # The host that the axis watched may be gone; a host that lives makes it watch again.
                axis.write(od.CONSUMER_HEARTBEATS[0], 0)
                axis.write(od.CONTROLWORD, 0)
                axis.write(od.CONTROLWORD, Control.FAULT_RESET)
        for axis in session.machine.axes:
            _await_reset(session, axis)
    return axis_states(session)


def wake(session: Session) -> None:
    """Start the nodes that do not answer: those that NMT has STOPPED answer no request until they are started.

    A node that answers is left as it is; whoever is in charge of it may need it so.
    """
    for axis in session.machine.axes:
        try:
            axis.read(od.STATUSWORD)
        except BusError:
            axis.start_node()


def _await_reset(session: Session, axis: AxisClient) -> None:
    if not wait_until(session.link, lambda: axis.state() not in FAULT_STATES, REPLY_TIMEOUT_S):
        state, code = axis.state(), axis.read(od.ERROR_CODE)
        cause = f"{error_text(code)} (0x{code:04X})"
        raise DeviceFaultError(f"{axis.name}: stays in {state_text(state)} because the cause lasts: {cause}").plainly(
            f"{axis.name}: the cause lasts: {error_words(code)}; end it, then reset again"
        )


def axis_states(session: Session) -> list[AxisState]:
    """Read the state and the position of every axis by SDO."""
    axes = session.machine.axes
    read = [(axis.read(od.STATUSWORD), axis.read(od.POSITION_ACTUAL)) for axis in axes]
    known = [bool(statusword & Status.POSITION_KNOWN) for statusword, _ in read]
    positions = joint_positions(session.robot, [units for _, units in read], known)
    return [
        AxisState(axis.name, state_text(State.of(statusword)), *position)
        for axis, (statusword, _), position in zip(axes, read, positions, strict=True)
    ]
