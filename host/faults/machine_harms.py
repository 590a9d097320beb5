"""Harms to the machine itself: emergency stop, supply, temperature, sensors, motors, payload, the boards' logic."""

from collections.abc import Mapping
from typing import Any, Final

from steptwin.emulator.faults.operations import (
    CYCLE_FULL_STEPS,
    PAYLOAD_MAX_KG,
    RESET_MS,
    SUPPLIES_10MV,
    TEMPERATURES_DECIDEGC,
    BoardTemperature,
    BrownOut,
    EmergencyStop,
    Payload,
    PowerUp,
    SetInput,
    Slip,
    Supply,
    WatchdogReset,
)
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.control import Do
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Reading, Table, integer_from, number_from
from steptwin.host.faults.harms import HarmKind, Writer, by_fields, joint_at, place
from steptwin.host.operate.inputs_outputs import wired_inputs
from steptwin.host.robots.robot import Robot

PER_V: Final = 100
PER_DEGC: Final = 10
"""Parts of a volt and of a degree in which the board measures."""
FULL_STEPS_MAX: Final = 100_000
"""Greatest number of full steps by which a motor slips."""


def _parts(parts: range, per_unit: int, unit: str) -> Reading:
    """Return the reading of a number as a whole number of parts of its unit, within a range of these."""
    read = number_from(parts.start / per_unit, (parts.stop - 1) / per_unit, unit)
    return lambda table, key: round(read(table, key) * per_unit)


def _cycles(table: Table, key: str) -> int:
    """Read full steps that make whole electrical cycles."""
    full_steps = table.integer(key, FULL_STEPS_MAX)
    if not full_steps or full_steps % CYCLE_FULL_STEPS:
        near = CYCLE_FULL_STEPS * max(1, round(abs(full_steps) / CYCLE_FULL_STEPS))
        raise InputError(
            f"{key}: {full_steps} is not a multiple of {CYCLE_FULL_STEPS}: a motor slips by whole electrical cycles;"
            f" the nearest is {near if full_steps >= 0 else -near}"
        )
    return full_steps


def set_input(robot: Robot, name: str, *, on: bool) -> SetInput:
    """Return the operation that sets a robot's input on its one board; raise InputError for an unknown name."""
    wired = wired_inputs(robot)
    if name not in wired:
        raise unknown(f"input of {robot.name}", name, wired)
    axis, which = wired[name]
    return SetInput(axis, which, on)


KINDS: Final[Mapping[Do, HarmKind]] = {
    Do.ESTOP: HarmKind(lambda _, pressed: EmergencyStop(pressed)),
    Do.SUPPLY: HarmKind(lambda _, supply_v: Supply(supply_v), {"supply_v": _parts(SUPPLIES_10MV, PER_V, "V")}),
    Do.TEMPERATURE: HarmKind(
        lambda _, temperature_degc: BoardTemperature(temperature_degc),
        {"temperature_degc": _parts(TEMPERATURES_DECIDEGC, PER_DEGC, "degC")},
    ),
    Do.INPUT: HarmKind(lambda robot, **values: set_input(robot, values["input"], on=values["on"])),
    Do.SLIP: HarmKind(
        lambda robot, joint, full_steps: Slip(robot.index_of(joint), full_steps), {"full_steps": _cycles}
    ),
    Do.PAYLOAD: HarmKind(
        lambda _, payload_kg: Payload(payload_kg), {"payload_kg": number_from(0, PAYLOAD_MAX_KG, "kg")}
    ),
    Do.BROWN_OUT: HarmKind(
        lambda robot, for_ms, joint: BrownOut(for_ms, place(robot, joint)), {"for_ms": integer_from(1)}
    ),
    Do.WATCHDOG: HarmKind(
        lambda robot, for_ms, joint: WatchdogReset(for_ms or RESET_MS, place(robot, joint)),
        {"for_ms": integer_from(1)},
    ),
    Do.POWER_UP: HarmKind(lambda robot, joint: PowerUp(place(robot, joint))),
}


def _input_request(robot: Robot, harm: SetInput) -> dict[str, Any]:
    wired = harm.axis, harm.input
    name = next((name for name, each in wired_inputs(robot).items() if each == wired), None)
    if name is None:  # the robot's file does not know of the sensor
        return by_fields(harm)
    return {"do": Do.INPUT, "input": name, "on": harm.on}


WRITERS: Final[Mapping[type, Writer]] = {
    EmergencyStop: lambda _, harm: {"do": Do.ESTOP, "pressed": harm.pressed},
    Supply: lambda _, harm: {"do": Do.SUPPLY, "supply_v": harm.supply_10mv / PER_V},
    BoardTemperature: lambda _, harm: {
        "do": Do.TEMPERATURE,
        "temperature_degc": harm.temperature_decidegc / PER_DEGC,
    },
    SetInput: _input_request,
    Slip: lambda robot, harm: {
        "do": Do.SLIP,
        "joint": robot.joint_names[harm.axis],
        "full_steps": harm.full_steps,
    },
    Payload: lambda _, harm: {"do": Do.PAYLOAD, "payload_kg": harm.payload_kg},
    BrownOut: lambda robot, harm: {"do": Do.BROWN_OUT, "for_ms": harm.for_ms, "joint": joint_at(robot, harm.axis)},
    WatchdogReset: lambda robot, harm: {"do": Do.WATCHDOG, "for_ms": harm.for_ms, "joint": joint_at(robot, harm.axis)},
    PowerUp: lambda robot, harm: {"do": Do.POWER_UP, "joint": joint_at(robot, harm.axis)},
}
