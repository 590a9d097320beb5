"""Stop, power off and fault reset, from whatever state the machine is in."""

from dataclasses import dataclass

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import FAULT_STATES
from steptwin.host.client.stopping import power_off, quick_stop
from steptwin.host.client.waiting import REPLY_TIMEOUT_S, wait_until
from steptwin.host.client.words import error_text, state_text
from steptwin.host.common.errors import DeviceFaultError
from steptwin.host.operate.session import Session
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, State, Status


@dataclass(frozen=True, slots=True)
class AxisState:
    """How an axis is afterwards: the drive's state, its position in mm or degrees and whether that is known."""

    name: str
    state: str
    position: float
    position_known: bool


def stop(session: Session) -> list[AxisState]:
    """Stop all axes at once, by their quick stop; raises as `steptwin.host.client.stopping.quick_stop`."""
    quick_stop(session.link, session.machine.axes)
    return axis_states(session)


def emergency_stop(session: Session) -> list[AxisState]:
    """Stop all axes at once, then take their power away; raises as `steptwin.host.client.stopping.power_off`."""
    power_off(session.link, session.machine.axes)
    return axis_states(session)


def reset(session: Session) -> list[AxisState]:
    """Reset the fault of every drive that is in fault; the drives are off afterwards.

    Raises:
        DeviceFaultError: a drive stays in fault because the cause lasts.
        BusError: no answer.
    """
    session.require_idle("reset")
    for axis in session.machine.axes:
        if axis.state() is State.FAULT:
            axis.write(
                od.CONSUMER_HEARTBEATS[0], 0
            )  # the host that it watched is gone, or will say again that it is there
            axis.write(od.CONTROLWORD, 0)
            axis.write(od.CONTROLWORD, Control.FAULT_RESET)
    for axis in session.machine.axes:
        _await_reset(session, axis)
    return axis_states(session)


def _await_reset(session: Session, axis: AxisClient) -> None:
    if not wait_until(session.link, lambda: axis.state() not in FAULT_STATES, REPLY_TIMEOUT_S):
        state, code = axis.state(), axis.read(od.ERROR_CODE)
        cause = f"{error_text(code)} (0x{code:04X})"
        raise DeviceFaultError(f"{axis.name}: stays in {state_text(state)}, for the cause lasts: {cause}")


def axis_states(session: Session) -> list[AxisState]:
    """Every axis' state and position, by SDO."""
    states = []
    for axis, joint in zip(session.machine.axes, session.robot.joints, strict=True):
        statusword = axis.read(od.STATUSWORD)
        position = joint.to_position(axis.read(od.POSITION_ACTUAL))
        known = bool(statusword & Status.POSITION_KNOWN)
        states.append(AxisState(axis.name, state_text(State.of(statusword)), position, known))
    return states
