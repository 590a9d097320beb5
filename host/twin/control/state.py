"""Say how the machine of a live board is now: what operations have made of it, and the board's figures."""

from typing import Any

from steptwin.emulator.surroundings import AxisSurroundings
from steptwin.host.operate.input_waiting import wired_inputs
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.control.operations import switches_of
from steptwin.host.twin.live_board import LiveBoard
from steptwin.protocol.cia402 import DigitalInput


def state_of(board: LiveBoard) -> dict[str, Any]:
    """Return the state under the keys of docs/control-port.md."""
    robot, around = board.robot, board.surroundings
    joints = list(zip(robot.joint_names, around.axes, strict=True))
    return {
        "simulated": True,
        "robot": robot.name,
        "estop": around.emergency_stop,
        "supply_v": around.supply_10mv / 100,
        "temperature_degc": around.temperature_decidegc / 10,
        "protect": {
            name: {"low": bool(axis.levels & DigitalInput.DRIVER_PROTECT), "held": axis.protect_held}
            for name, axis in joints
        },
        "inputs": {name: bool(around.axes[axis].levels & bit) for name, (axis, bit) in wired_inputs(robot).items()},
        "switches": {name: _switches(robot, number, axis) for number, (name, axis) in enumerate(joints)},
        "bus": board.bus_figures(),
        "real_time": board.real_time(),
        "simulated_s": round(board.simulated_s, 6),
        "wall_s": round(board.wall_s, 6),
    }


def _switches(robot: Robot, number: int, axis: AxisSurroundings) -> dict[str, dict[str, bool]]:
    return {
        name: {"closed": bool(axis.levels & bit), "stuck": bool(axis.stuck & bit)}
        for name, bit in switches_of(robot, number).items()
    }
