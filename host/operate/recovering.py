"""Stop a machine, hold it in an emergency stop, and reset its faults, in any state of its drives and nodes."""

from dataclasses import dataclass

from steptwin.host.client import stopping
from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import FAULT_STATES
from steptwin.host.client.waiting import REPLY_TIMEOUT_S, wait_until
from steptwin.host.client.words import error_text, error_words, state_text
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.host.operate.joint_positions import axis_readings
from steptwin.host.operate.session import Session
from steptwin.protocol import od
from steptwin.protocol.cia402 import State, Status


@dataclass(frozen=True, slots=True)
class AxisState:
    """State of an axis' drive; position of its joint in mm or degrees, and whether it has a position reference."""

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


def reset(session: Session, *, age_s: float = 0.0) -> list[AxisState]:
    """Reset every drive that is in fault; afterwards the power of these drives is off.

    A reset is valid for the faults and emergency stops that its user has seen. Each axis receives the number of the
    fault to reset (2018h), so a later one stays, even if the network delays the reset. Nodes that another master has
    stopped, or that have restarted, are started by NMT (see `wake`).

    Args:
        session: the machine.
        age_s: time since the user requested the reset, or last saw the machine. A fault since then is not reset.

    Raises:
        InputError: a program that has not claimed the machine runs a trajectory.
        DeviceFaultError: a drive stays in fault because the cause lasts, or because a later fault has occurred.
        BusError: another program is in charge, or a node does not answer.
    """
    asked_s = session.link.now_s() - age_s
    wake(session)
    with session.alone("reset"):
        for axis in session.machine.axes:
            if not axis.read(od.STATUSWORD) & Status.REMOTE:
                axis.start_node()
        answered = [(axis, _fault_before(session, axis, asked_s)) for axis in session.machine.axes]
        for axis, number in answered:
            if axis.state() is State.FAULT:
                # The host that the axis monitors may be gone; a present host will enable the monitoring again.
                axis.write(od.CONSUMER_HEARTBEATS[0], 0)
                _reset_fault(axis, number)
        _await_reset(session)
    return axis_states(session)


def _fault_before(session: Session, axis: AxisClient, asked_s: float) -> int:
    """Return the number of the axis' last fault; raise DeviceFaultError if it is younger than the reset."""
    number = axis.read(od.FAULT_NUMBER)  # before its age: a fault between both requests is then too young
    least_ms = int(1000 * (session.link.now_s() - asked_s))
    if axis.read(od.FAULT_AGE_MS) < least_ms:
        raise _later_fault(axis)
    return number


def _reset_fault(axis: AxisClient, number: int) -> None:
    """Reset the fault of this number; raise DeviceFaultError if another one has occurred since."""
    try:
        axis.write(od.FAULT_RESET, number)
    except DeviceFaultError as error:
        if axis.read(od.FAULT_NUMBER) != number:
            raise _later_fault(axis) from error
        raise


def _later_fault(axis: AxisClient) -> DeviceFaultError:
    stays = "an emergency stop or a fault has come since the reset was asked for: it stays; look at the machine"
    return DeviceFaultError(f"{axis.name}: {stays}, then `steptwin reset` again").plainly(
        f"{axis.name}: {stays}, then reset again"
    )


def wake(session: Session) -> None:
    """Start the nodes that do not answer: a node in NMT state STOPPED answers no request.

    The state of a node that answers is not changed: the program in charge may need it.
    """
    for axis in session.machine.axes:
        try:
            axis.read(od.STATUSWORD)
        except BusError:
            axis.start_node()


def _await_reset(session: Session) -> None:
    """Wait until no drive is in fault; raise DeviceFaultError, with the first cause, if one stays in fault."""
    lasting: list[AxisClient] = []

    def over() -> bool:
        lasting[:] = [axis for axis in session.machine.axes if axis.state() in FAULT_STATES]
        return not lasting

    if not wait_until(session.link, over, REPLY_TIMEOUT_S):
        state, code = lasting[0].state(), lasting[0].read(od.ERROR_CODE)
        names = ", ".join(axis.name for axis in lasting if axis.read(od.ERROR_CODE) == code)
        cause = f"{error_text(code)} (0x{code:04X})"
        raise DeviceFaultError(f"{names}: stays in {state_text(state)} because the cause lasts: {cause}").plainly(
            f"{names}: the cause lasts: {error_words(code)}; end it, then reset again"
        )


def axis_states(session: Session) -> list[AxisState]:
    """Read the state and the position of every axis by SDO."""
    axes = session.machine.axes
    read = [(axis.read(od.STATUSWORD), axis.read(od.POSITION_ACTUAL)) for axis in axes]
    known = [bool(statusword & Status.POSITION_KNOWN) for statusword, _ in read]
    positions = axis_readings(session.robot, [units for _, units in read], known)
    return [
        AxisState(axis.name, state_text(State.of(statusword)), *position)
        for axis, (statusword, _), position in zip(axes, read, positions, strict=True)
    ]
