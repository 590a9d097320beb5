"""Check whether a machine is ready to move."""

from collections.abc import Iterator
from typing import Final, NamedTuple

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.drive_status import FAULT_STATES
from steptwin.host.client.words import state_text
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.operate.joint_positions import fault_and_remedy
from steptwin.host.operate.session import Session
from steptwin.host.operate.setting_up import WIRE_UNITS, axis_settings, read_units
from steptwin.host.operate.status import active_inputs, error_history
from steptwin.host.robots.board_settings import Microsteps
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, State, Status
from steptwin.protocol.drivers import GENERIC
from steptwin.protocol.od import IDENTITY_DEVICE_TYPE
from steptwin.protocol.storage import stored_name

_POWERED: Final = (State.SWITCHED_ON, State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)


class Check(NamedTuple):
    """The result of one check."""

    name: str
    """Axis and checked property."""
    passed: bool
    found: str
    """Measured value, or the fault and its remedy."""
    exit_code: int = DeviceFaultError.exit_code
    """Exit code of the command line if this is the most severe failed check."""


def examine(session: Session) -> Iterator[Check]:
    """Make all checks without changing the machine.

    Raises:
        InputError: a trajectory is running; SDO requests would disturb the program that streams it.
    """
    session.require_idle("doctor")
    answering = []
    for axis in session.machine.axes:
        check = _answers(session, axis)
        yield check
        if check.passed:
            answering.append(axis)
            yield _robot(session, axis)
    if not answering:
        said = "none answers: is the machine on, is this its bus, and is the bus' bit rate the machine's?"
        yield Check("nodes", False, said, BusError.exit_code)
    for axis in answering:
        yield from _examine_axis(session, axis)


def _answers(session: Session, axis: AxisClient) -> Check:
    """Check that an axis answers, and report its device type and driver."""
    name = f"{axis.name} node 0x{axis.node_id:02X}"
    try:
        device_type = axis.read(od.DEVICE_TYPE)
        versions = ", ".join(map(axis.read_text, (od.DEVICE_NAME, od.HARDWARE_VERSION, od.SOFTWARE_VERSION)))
    except BusError as error:
        found = str(error).removeprefix(f"{axis.name}: node 0x{axis.node_id:02X} ")  # as the name says
        return Check(name, False, found, BusError.exit_code)
    except DeviceFaultError as error:
        return Check(name, False, str(error))
    if device_type != IDENTITY_DEVICE_TYPE:
        return Check(name, False, f"is not a stepper axis: type 0x{device_type:08X}", BusError.exit_code)
    drivers = session.robot.board.driver_profile
    filed = f"; its drivers are {drivers} by the robot's file" if drivers else ""
    return Check(name, True, f"type 0x{device_type:08X}, {versions}{filed}")


def _robot(session: Session, axis: AxisClient) -> Check:
    """Check the robot name that the axis stores; an axis without a name passes."""
    expected, found = stored_name(session.robot.name), axis.read_text(od.ROBOT_NAME)
    says = found or "the axis carries no robot's name (docs/protocol.md)"
    if found and found != expected:
        return Check(f"{axis.name} robot", False, f"{found}, not {expected}", InputError.exit_code)
    return Check(f"{axis.name} robot", True, says)


def _examine_axis(session: Session, axis: AxisClient) -> Iterator[Check]:
    yield _drive(axis)
    yield _settings(session, axis)
    yield _units(axis)
    yield _inputs(axis)
    yield _supply(session, axis)
    yield _temperature(axis)
    known = bool(axis.read(od.STATUSWORD) & Status.POSITION_KNOWN)
    yield Check(f"{axis.name} position", known, "known" if known else "unknown: home the machine, `steptwin home`")


def _drive(axis: AxisClient) -> Check:
    state = axis.state()
    if state in FAULT_STATES:
        return Check(f"{axis.name} drive", False, fault_and_remedy(axis, state))
    history = error_history(axis)
    return Check(
        f"{axis.name} drive", True, state_text(state) + (f"; earlier: {', '.join(history)}" if history else "")
    )


def _settings(session: Session, axis: AxisClient) -> Check:
    """Check the microsteps of driver, board and robot file.

    The next motion writes the file's microsteps to the board, but only if the power of the drive is off. The switches
    of a module cannot be changed by program.
    """
    driven = session.robot.axes[session.robot.axis_index(axis.name)]
    name, filed = f"{axis.name} settings", axis_settings(driven, session.robot.board).microsteps
    found = axis.read(od.MICROSTEPS_WORD)
    made = _driver_microsteps(axis) or found
    microsteps = Microsteps(axis.name, made, found, filed)
    says = str(microsteps).removeprefix(f"{axis.name}: ")
    if not microsteps.right or (made != filed and session.robot.board.profile.switched):
        return Check(name, False, f"{says}; set the driver's switches to {filed}")
    if found != filed and axis.state() in _POWERED:
        return Check(name, False, f"{says}, and the power is on: `steptwin estop`")
    if found != filed:
        return Check(name, True, f"{says}: the next motion sets {filed}")
    return Check(name, True, f"{says}, highest speed {axis.read(od.MAX_PROFILE_VELOCITY)} units/s")


def _units(axis: AxisClient) -> Check:
    """Check that the axis uses wire units, as this program does."""
    units = read_units(axis)
    if units.are_wire_units:
        return Check(f"{axis.name} units", True, str(units))
    remedy = "another master has chosen them; set 0x6091 and 0x6092 back while the drive is off"
    return Check(f"{axis.name} units", False, f"{units}; not {WIRE_UNITS}: {remedy}", InputError.exit_code)


def _driver_microsteps(axis: AxisClient) -> int | None:
    """Read the driver's microsteps; None from a real board, which does not know them."""
    try:
        return axis.read(od.DRIVER_MICROSTEPS)
    except DeviceFaultError:
        return None


def _inputs(axis: AxisClient) -> Check:
    words = active_inputs(axis)
    bad = axis.read(od.DIGITAL_INPUTS) & ~(DigitalInput.HOME | DigitalInput.IN1 | DigitalInput.IN2)
    return Check(f"{axis.name} inputs", not bad, f"active: {', '.join(words)}" if words else "none active")


def _supply(session: Session, axis: AxisClient) -> Check:
    """Check the supply against the limits of the board and of the drivers in the robot file."""
    supply_v, least_v, most_v = (
        axis.read(address) / 100 for address in (od.SUPPLY_VOLTAGE, od.SUPPLY_VOLTAGE_MIN, od.SUPPLY_VOLTAGE_MAX)
    )
    says, board = f"{supply_v:.2f} V, {least_v:g} to {most_v:g} V allowed", session.robot.board
    passed = least_v <= supply_v <= most_v
    if board.driver_profile not in (None, GENERIC):  # a generic driver has no supply range in the file
        lowest_v, highest_v = board.profile.chip.supply_v.value
        says += f"; {board.driver_profile} takes {lowest_v:g} to {highest_v:g} V"
        passed &= lowest_v <= supply_v <= highest_v
    return Check(f"{axis.name} supply", passed, says)


def _temperature(axis: AxisClient) -> Check:
    degc, most_degc = axis.read(od.BOARD_TEMPERATURE) / 10, axis.read(od.BOARD_TEMPERATURE_MAX) / 10
    return Check(f"{axis.name} temperature", degc <= most_degc, f"{degc:.1f} degC, up to {most_degc:g} degC allowed")
