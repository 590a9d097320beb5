"""Say how the machine of a live board is now: what operations have made of it, and the board's figures."""

from typing import Any

from steptwin.host.operate.input_waiting import wired_inputs
from steptwin.host.twin.control.machine_harms import PER_DEGC, PER_V
from steptwin.host.twin.control.wire_harms import switches_of
from steptwin.host.twin.live_board import LiveBoard
from steptwin.protocol.cia402 import DigitalInput

_PROTECT = int(DigitalInput.DRIVER_PROTECT)


class MachineState:
    """Reads the state of a board. It is read between two stretches of simulation, so it must be read quickly."""

    def __init__(self, board: LiveBoard) -> None:
        robot = board.robot
        self._board = board
        self._joints = robot.joint_names
        self._inputs = [(name, axis, int(bit)) for name, (axis, bit) in wired_inputs(robot).items()]
        """Name, axis and bit of each input."""
        self._switches = [
            [(name, int(bit)) for name, bit in switches_of(robot, axis).items()] for axis in range(len(self._joints))
        ]
        """Name and bit of each switch of each joint."""

    def read(self) -> dict[str, Any]:
        """Return the state under the keys of docs/control-port.md."""
        board, around = self._board, self._board.surroundings
        levels = [int(axis.levels) for axis in around.axes]
        stuck = [int(axis.stuck) for axis in around.axes]
        return {
            "simulated": True,
            "robot": board.robot.name,
            "estop": around.emergency_stop,
            "supply_v": around.supply_10mv / PER_V,
            "temperature_degc": around.temperature_decidegc / PER_DEGC,
            "protect": {
                joint: {"low": bool(levels[i] & _PROTECT), "held": around.axes[i].protect_held}
                for i, joint in enumerate(self._joints)
            },
            "inputs": {name: bool(levels[axis] & bit) for name, axis, bit in self._inputs},
            "switches": {
                joint: {
                    name: {"closed": bool(levels[i] & bit), "stuck": bool(stuck[i] & bit)}
                    for name, bit in self._switches[i]
                }
                for i, joint in enumerate(self._joints)
            },
            "bus": board.bus_figures()
            | {
                "recent_load_percent": round(board.recent_bus_load_percent, 3),
                "faults": len(board.bus.faults.faults),
            },
            "real_time": board.real_time(),
            **({} if (shelf := board.shelf()) is None else {"shelf": shelf}),
            "simulated_s": round(board.simulated_s, 6),
            "wall_s": round(board.wall_s, 6),
        }
