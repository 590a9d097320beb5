"""Harms to switches, drivers and the wires to them."""

from collections.abc import Mapping
from typing import Any, Final

from steptwin.emulator.faults.operations import (
    WITHIN_US,
    BouncingSwitch,
    Contact,
    DriverMode,
    DriverProtect,
    OscCapacitor,
    SetWire,
    StuckSwitch,
    SwitchWire,
)
from steptwin.emulator.faults.wires import NOISE_RATE_MAX_HZ, Noise, Wire, WireState
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.control import SWITCHES, Do, Stuck, SwitchWiring, Wiring
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table, integer_from, number_from
from steptwin.host.faults.harms import HarmKind, Writer
from steptwin.host.robots.board_settings import OSC_PF_MIN
from steptwin.host.robots.joint import MICROSTEPS
from steptwin.host.robots.robot import Robot
from steptwin.protocol.cia402 import DigitalInput

_LEVELS: Final = {Stuck.CLOSED: True, Stuck.OPEN: False, Stuck.FREE: None}
_STUCK: Final = {closed: stuck for stuck, closed in _LEVELS.items()}
_CONTACTS: Final = {
    SwitchWiring.WHOLE: None,
    SwitchWiring.NORMALLY_OPEN: Contact.NORMALLY_OPEN,
    SwitchWiring.NORMALLY_CLOSED: Contact.NORMALLY_CLOSED,
}
_SWITCH_NAMES: Final = {bit: name for name, bit in SWITCHES.items()}


def switches_of(robot: Robot, axis: int) -> dict[str, DigitalInput]:
    """Return the switches that a joint has, by the names that requests give them."""
    fitted = robot.joints[axis].switches.inputs
    return {name: bit for name, bit in SWITCHES.items() if bit in fitted}


# --- making harms


def _switch_at(robot: Robot, joint: str, switch: str) -> tuple[int, DigitalInput]:
    """Return the axis and the input of a joint's switch; raise InputError if it has no such switch."""
    axis = robot.index_of(joint)
    fitted = switches_of(robot, axis)
    if switch not in fitted:
        raise unknown(f"switch of {joint}", switch, fitted)
    return axis, fitted[switch]


def _bouncing(
    robot: Robot, joint: str, switch: str, bounces: int, within_us: int | None, seed: int | None
) -> BouncingSwitch:
    axis, which = _switch_at(robot, joint, switch)
    try:
        return BouncingSwitch(axis, which, bounces, within_us or WITHIN_US, seed or 0)
    except ValueError as error:
        raise InputError(str(error)) from error


def _set_wire(robot: Robot, joint: str, wire: Wire, condition: Wiring, **noise: Any) -> SetWire:
    axis = robot.index_of(joint)
    if condition is Wiring.NOISY:
        return SetWire(axis, wire, _noise(**noise))
    if given := [key for key, value in noise.items() if value is not None]:
        raise InputError(f"{given[0]}: is for a noisy wire, not for one that is {condition}")
    return SetWire(axis, wire, WireState(condition))


def _noise(rate_hz: float | None, width_us: float | None, count: int | None, seed: int | None) -> Noise:
    if rate_hz is None or width_us is None:
        missing = "rate_hz" if rate_hz is None else "width_us"
        raise InputError(f"{missing}: is missing: a noisy wire has rate_hz and width_us")
    try:
        return Noise(rate_hz, round(1000 * width_us), count, seed or 0)
    except ValueError as error:
        raise InputError(str(error)) from error


def _microsteps(table: Table, key: str) -> int:
    value = table.integer(key)
    if value not in MICROSTEPS:
        raise InputError(f"{key}: {value} is not one of {', '.join(map(str, MICROSTEPS))}")
    return value


_FROM_0: Final = integer_from(0)

KINDS: Final[Mapping[Do, HarmKind]] = {
    Do.PROTECT: HarmKind(lambda robot, joint, held: DriverProtect(robot.index_of(joint), held)),
    Do.SWITCH: HarmKind(
        lambda robot, joint, switch, stuck: StuckSwitch(*_switch_at(robot, joint, switch), _LEVELS[stuck])
    ),
    Do.SWITCH_WIRE: HarmKind(
        lambda robot, joint, switch, broken: SwitchWire(*_switch_at(robot, joint, switch), _CONTACTS[broken])
    ),
    Do.BOUNCE: HarmKind(_bouncing, {"bounces": _FROM_0, "within_us": integer_from(1), "seed": _FROM_0}),
    Do.MODE: HarmKind(
        lambda robot, joint, microsteps: DriverMode(robot.index_of(joint), microsteps), {"microsteps": _microsteps}
    ),
    Do.OSC: HarmKind(
        lambda robot, joint, osc_pf: OscCapacitor(robot.index_of(joint), osc_pf),
        {"osc_pf": number_from(OSC_PF_MIN, 1e6, "pF")},
    ),
    Do.WIRE: HarmKind(
        _set_wire,
        {
            "wire": lambda table, key: table.choice(key, Wire),
            "rate_hz": number_from(0, NOISE_RATE_MAX_HZ, "Hz"),
            "width_us": number_from(0.1, 1e6, "us"),
            "count": _FROM_0,
            "seed": _FROM_0,
        },
    ),
}

# --- writing requests


def _of_switch(robot: Robot, harm: StuckSwitch | SwitchWire | BouncingSwitch) -> dict[str, str]:
    return {"joint": robot.joint_names[harm.axis], "switch": _SWITCH_NAMES[harm.switch]}


def _wire_request(robot: Robot, harm: SetWire) -> dict[str, Any]:
    request = {"do": Do.WIRE, "joint": robot.joint_names[harm.axis], "wire": harm.wire}
    noise = harm.condition
    if not isinstance(noise, Noise):
        return {**request, "condition": noise.value}
    return {
        **request,
        "condition": Wiring.NOISY,
        "rate_hz": noise.rate_hz,
        "width_us": noise.width_ns / 1000,
        "count": noise.count,
        "seed": noise.seed or None,
    }


WRITERS: Final[Mapping[type, Writer]] = {
    DriverProtect: lambda robot, harm: {
        "do": Do.PROTECT,
        "joint": robot.joint_names[harm.axis],
        "held": harm.active,
    },
    StuckSwitch: lambda robot, harm: {"do": Do.SWITCH, **_of_switch(robot, harm), "stuck": _STUCK[harm.closed]},
    SwitchWire: lambda robot, harm: {
        "do": Do.SWITCH_WIRE,
        **_of_switch(robot, harm),
        "broken": SwitchWiring.WHOLE if harm.broken is None else harm.broken.value,
    },
    BouncingSwitch: lambda robot, harm: {
        "do": Do.BOUNCE,
        **_of_switch(robot, harm),
        "bounces": harm.bounces,
        "within_us": harm.within_us,
        "seed": harm.seed or None,
    },
    DriverMode: lambda robot, harm: {
        "do": Do.MODE,
        "joint": robot.joint_names[harm.axis],
        "microsteps": harm.microsteps,
    },
    OscCapacitor: lambda robot, harm: {
        "do": Do.OSC,
        "joint": robot.joint_names[harm.axis],
        "osc_pf": harm.osc_pf,
    },
    SetWire: _wire_request,
}
