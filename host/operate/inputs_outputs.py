"""Digital inputs and outputs by their names in the robot file: at once, or while a trajectory runs."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Any

from steptwin.host.client import StreamedMotion
from steptwin.host.client.waits import HOLD_MS, MachineWiring
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.choices import SWITCHES
from steptwin.host.common.errors import InputError
from steptwin.host.operate.session import Session
from steptwin.host.planning.motion import Wait
from steptwin.host.planning.motions.held import Hold
from steptwin.host.planning.plan import Plan
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import GENERAL_INPUTS, DigitalInput, DigitalOutput


def waits_made(plan: Plan, holds_ms: Sequence[int], *, timed_out: bool = False) -> tuple[Wait, ...]:
    """Return those waits of a plan that a machine came to, and how long it stood there.

    `timed_out` is True if the last of them has ended the motion.
    """
    before_ms = accumulate(holds_ms, initial=0)
    made = [
        replace(wait, at_s=(round(1000 * wait.at_s) + later_ms) / 1000, stood_s=hold_ms / 1000)
        for wait, hold_ms, later_ms in zip(plan.motion.waits, holds_ms, before_ms, strict=False)
        if hold_ms
    ]
    return (*made[:-1], replace(made[-1], timed_out=True)) if timed_out else tuple(made)


def waits_document(waits: Sequence[Wait]) -> dict[str, Any]:
    """Return the waits under their key in the JSON document of a run, which has it only if there were waits."""
    return {"waits": [wait.to_dict() for wait in waits]} if waits else {}


def wired_inputs(robot: Robot) -> dict[str, tuple[int, DigitalInput]]:
    """Return the axis and the bit of every input in the robot file."""
    return {
        name: (robot.axis_index(sensor.joint), GENERAL_INPUTS[sensor.input - 1])
        for name, sensor in robot.inputs.items()
    }


def wired_input(robot: Robot, name: str) -> tuple[int, DigitalInput]:
    """Return the axis and the bit of a robot's input; raise InputError for an unknown name."""
    wired = wired_inputs(robot)
    if name not in wired:
        raise unknown(f"input of {robot.name}", name, wired)
    return wired[name]


def switches_of(robot: Robot, axis: int) -> dict[str, DigitalInput]:
    """Return the switches of a joint, by their names in requests."""
    fitted = robot.axes[axis].switches.inputs
    return {name: bit for name, bit in SWITCHES.items() if bit in fitted}


def read_inputs(session: Session) -> dict[str, bool]:
    """Read whether each input is on, by SDO; raise BusError if a node does not answer."""
    return {
        name: bool(session.machine.axes[axis].read(od.DIGITAL_INPUTS) & bit)
        for name, (axis, bit) in wired_inputs(session.robot).items()
    }


def wired_outputs(robot: Robot) -> dict[str, tuple[int, DigitalOutput]]:
    """Return the axis and the bit of every output in the robot file."""
    bits = tuple(DigitalOutput)
    return {name: (robot.axis_index(output.joint), bits[output.out - 1]) for name, output in robot.outputs.items()}


def streamed_motion(plan: Plan) -> StreamedMotion:
    """Return what is streamed of a plan; raise InputError if the machine does not stand still at one of its waits."""
    waits, standing_ms = plan.motion.waits, plan.times_ms[~plan.velocities.any(axis=1)]
    for wait in waits:
        if round(1000 * wait.at_s) not in standing_ms:
            raise InputError(f"{wait.where}the machine does not stand at t = {wait.at_s:.3f} s to wait for {wait}")
    wiring = MachineWiring(wired_inputs(plan.robot), wired_outputs(plan.robot))
    return StreamedMotion(plan.records(), plan.start_units, plan.motion.output_changes, waits, wiring)


def read_outputs(session: Session) -> dict[str, bool]:
    """Read whether each output is on; raise InputError while a trajectory runs, BusError if a node does not answer."""
    session.require_idle("outputs")
    levels = {}
    for name, (axis, bit) in wired_outputs(session.robot).items():
        node = session.machine.axes[axis]
        levels[name] = bool(node.read(od.DIGITAL_OUTPUTS) & node.read(od.DIGITAL_OUTPUTS_MASK) & bit)
    return levels


def switch_output(session: Session, name: str, *, on: bool) -> dict[str, bool]:
    """Switch one output, then read all; raises as `read_outputs`, and InputError for an unknown name."""
    wired = wired_outputs(session.robot)
    if name not in wired:
        raise no_such_output(session.robot.name, name, list(wired))
    session.require_idle("outputs")
    axis, bit = wired[name]
    session.machine.axes[axis].switch_output(bit, on=on)
    return read_outputs(session)


def no_such_output(robot: str, name: str, names: list[str]) -> InputError:
    """Return the error for an output name that does not exist."""
    return unknown(f"output of {robot}", name, names)


def plan_made(plan: Plan, holds_ms: Sequence[int], *, timed_out: bool = False) -> Plan:
    """Return the executed plan: the plan with the durations of its waits so far.

    `timed_out` is True if the last of them has ended the motion.
    """
    if not holds_ms:
        return plan
    waits = plan.motion.waits
    holds = [Hold(round(1000 * wait.at_s), ms) for wait, ms in zip(waits, holds_ms, strict=False)]
    held = plan.held(holds, HOLD_MS)
    return held.until(holds[-1].at_ms + sum(holds_ms)) if timed_out else held
