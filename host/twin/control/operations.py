"""Read the requests of the control port as operations on a robot's machine, and write operations as requests."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, Final, NamedTuple

from steptwin.emulator.operations import (
    SUPPLIES_10MV,
    TEMPERATURES_DECIDEGC,
    BoardTemperature,
    DriverProtect,
    EmergencyStop,
    Operation,
    SetInput,
    StuckSwitch,
    Supply,
)
from steptwin.host.common.bad_input import nearest_within, outside, unknown
from steptwin.host.common.control import SWITCHES, Do, Stuck
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Reading, Table
from steptwin.host.operate.input_waiting import wired_inputs
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.input_changes import set_input
from steptwin.protocol.cia402 import DigitalInput

PER_V: Final = 100
PER_DEGC: Final = 10
"""Parts of a volt and of a degree in which the board measures."""
_LEVELS: Final = {Stuck.CLOSED: True, Stuck.OPEN: False, Stuck.FREE: None}
_STUCK: Final = {closed: stuck for stuck, closed in _LEVELS.items()}
_SWITCH_NAMES: Final = {bit: name for name, bit in SWITCHES.items()}


def _whole(parts: range, per_unit: int, unit: str) -> Reading:
    """Return the reading of a number as a whole number of parts of its unit, within a range of these."""
    lower, upper = parts.start / per_unit, (parts.stop - 1) / per_unit

    def read(table: Table, key: str) -> int:
        value = table.number(key)
        if not lower <= value <= upper:
            nearest = nearest_within(value, lower, upper, unit)
            raise InputError(f"{key}: {outside(value, lower, upper, unit)}{nearest}")
        return round(value * per_unit)

    return read


class _Kind(NamedTuple):
    """A kind of request: its keys beside `do`, all of them required, and what it asks for, made of their values."""

    keys: Mapping[str, Reading]
    make: Callable[[Robot, dict[str, Any]], Operation | None]


_KINDS: Final[Mapping[Do, _Kind]] = {
    Do.ESTOP: _Kind({"pressed": Table.truth}, lambda _, values: EmergencyStop(values["pressed"])),
    Do.SUPPLY: _Kind(
        {"supply_v": _whole(SUPPLIES_10MV, PER_V, "V")},
        lambda _, values: Supply(values["supply_v"]),
    ),
    Do.TEMPERATURE: _Kind(
        {"temperature_degc": _whole(TEMPERATURES_DECIDEGC, PER_DEGC, "degC")},
        lambda _, values: BoardTemperature(values["temperature_degc"]),
    ),
    Do.PROTECT: _Kind(
        {"joint": Table.text, "held": Table.truth},
        lambda robot, values: DriverProtect(robot.index_of(values["joint"]), values["held"]),
    ),
    Do.INPUT: _Kind(
        {"input": Table.text, "on": Table.truth},
        lambda robot, values: set_input(robot, values["input"], on=values["on"]),
    ),
    Do.SWITCH: _Kind(
        {"joint": Table.text, "switch": Table.text, "stuck": lambda table, key: table.choice(key, Stuck)},
        lambda robot, values: _stuck_switch(robot, **values),
    ),
    Do.STATE: _Kind({}, lambda _, __: None),
}


def read_request(robot: Robot, request: Mapping[str, Any]) -> Operation | None:
    """Return the operation that a request asks for; None if it only asks how the machine is.

    Raises:
        InputError: the request does not exist, has other keys or a value out of its range, or names something that the
            robot does not have.
    """
    table = Table(request, "JSON object")
    name = table.text("do")
    if name not in list(Do):
        raise unknown("do", name, Do)
    kind = _KINDS[Do(name)]
    values = table.read({"do": Table.text, **kind.keys})
    del values["do"]
    return kind.make(robot, values)


def switches_of(robot: Robot, axis: int) -> dict[str, DigitalInput]:
    """Return the switches that a joint has, by the names that requests give them."""
    fitted = robot.joints[axis].switches.inputs
    return {name: bit for name, bit in SWITCHES.items() if bit in fitted}


def _stuck_switch(robot: Robot, joint: str, switch: str, stuck: Stuck) -> StuckSwitch:
    axis = robot.index_of(joint)
    fitted = switches_of(robot, axis)
    if switch not in fitted:
        raise unknown(f"switch of {joint}", switch, fitted)
    return StuckSwitch(axis, fitted[switch], _LEVELS[stuck])


def request_of(robot: Robot, operation: Operation) -> dict[str, Any]:
    """Return the request that asks for an operation; `read_request` returns the operation for it."""
    joints = robot.joint_names
    request: dict[str, Any]
    match operation:
        case EmergencyStop(pressed):
            request = {"do": Do.ESTOP, "pressed": pressed}
        case Supply(supply_10mv):
            request = {"do": Do.SUPPLY, "supply_v": supply_10mv / PER_V}
        case BoardTemperature(temperature_decidegc):
            request = {"do": Do.TEMPERATURE, "temperature_degc": temperature_decidegc / PER_DEGC}
        case DriverProtect(axis, active):
            request = {"do": Do.PROTECT, "joint": joints[axis], "held": active}
        case SetInput(axis, which, on):
            name = next(name for name, place in wired_inputs(robot).items() if place == (axis, which))
            request = {"do": Do.INPUT, "input": name, "on": on}
        case StuckSwitch(axis, which, closed):
            request = {"do": Do.SWITCH, "joint": joints[axis], "switch": _SWITCH_NAMES[which], "stuck": _STUCK[closed]}
        case _:  # no request asks for it
            request = {"do": type(operation).__name__, **asdict(operation)}
    return request
