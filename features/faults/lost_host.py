"""Drive a machine with a host that hangs, dies, is late or sends points out of order, and continue without it."""

from collections.abc import Callable
from typing import Final

import numpy as np

from steptwin.emulator.simulation import Simulation
from steptwin.features.faults.engine import Engine
from steptwin.features.faults.kinds.host import HostCondition
from steptwin.host.client import Machine
from steptwin.host.client.drive_status import FAULT_STATES
from steptwin.host.client.lease import TIMEOUT_MS
from steptwin.host.client.stopping import await_standstill
from steptwin.host.client.waiting import REST_TIMEOUT_S
from steptwin.host.client.words import error_text
from steptwin.host.common.errors import BusError, StepTwinError
from steptwin.host.operate.setting_up import objects_of
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.embedded_network import EmbeddedNetwork
from steptwin.host.twin.embedded.execution import driver_units
from steptwin.host.twin.embedded.outcome import RunFault
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, ErrorCode
from steptwin.protocol.frame import COB_RPDO, FIRST_NODE_ID, NODE_ID_MAX
from steptwin.protocol.timer import COUNTS_PER_SECOND

_HANGING_S: Final = 0.01
"""Period of looks whether a hanging program continues."""
_RECORDS: Final = range(COB_RPDO[3] + FIRST_NODE_ID, COB_RPDO[3] + NODE_ID_MAX + 1)
"""Identifiers of the points of all nodes."""


class HostLostError(BusError):
    """The host's program ends here, as a scenario requires."""


class FaultyNetwork(EmbeddedNetwork):
    """An embedded network whose client hangs, dies, is late or sends points out of order, by its condition.

    The client notices nothing: a wait or a frame takes longer, or never returns. While the program hangs, the bus
    interface goes on with the periodic heartbeat, as the kernel's broadcast manager does; a dead program sends none.
    """

    def __init__(self, simulation: Simulation, condition: HostCondition, moving: Callable[[], bool]) -> None:
        """Connect a client.

        Args:
            simulation: the simulated boards.
            condition: condition of the client; it may change at any instant.
            moving: returns True while the machine moves. A hanging client is given up at standstill, unless it is known
                to continue.
        """
        super().__init__(simulation)
        self._condition = condition
        self._moving = moving
        self._held: dict[int, bytes] = {}
        """Point of each identifier that waits for the next one."""

    def wait(self, dt_s: float) -> None:
        """Let simulated time pass, more if the client is late; raise HostLostError if it never continues."""
        self._go_on()
        super().wait(dt_s + self._condition.late_s)
        self._go_on()

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame, or hold a point back until the next one has been sent; raise HostLostError as `wait`."""
        self._go_on()
        if can_id in _RECORDS and (self._condition.disordered or can_id in self._held):
            held = self._held.pop(can_id, None)
            if held is None:
                self._held[can_id] = bytes(data)
                return
            super().send_message(can_id, data, remote)
            data = held
        super().send_message(can_id, data, remote)
        self._go_on()

    def _send_due(self) -> None:
        if self._condition.dead:
            self._repeated.take_due()  # held points are lost if the program dies in this wait
        else:
            super()._send_due()

    def _go_on(self) -> None:
        """Return when the client continues."""
        condition = self._condition
        while condition.hangs and not condition.dead:
            moves = self._moving()
            super().wait(_HANGING_S)
            if not (moves or condition.goes_on):
                raise HostLostError("the host hung")
        if condition.dead:
            raise HostLostError("the host died")


def replace_host(board: EmbeddedBoard, host: HostCondition) -> None:
    """Connect another host to a board; it starts without the state of the old one."""
    host.dead, host.restart_counts = False, None
    board.connect_host()


def without_host(error: BusError, board: EmbeddedBoard, engine: Engine, host: HostCondition) -> RunFault:
    """Run the machine on after its host has ended, as after a bus error."""
    message = outlive(board, engine, host, str(error))
    robot, counted = board.robot, board.counted_units()
    return RunFault(
        message,
        {
            name: [each.code for each in engine.emergencies if each.axis == axis and each.code]
            for axis, name in enumerate(robot.axis_names)
        },
        dict(zip(robot.joint_names, robot.to_positions(np.array(counted)).tolist(), strict=True)),
        positions_agree=counted == driver_units(board, robot),
    )


_LOOK_S: Final = 0.01
_MISSED_S: Final = TIMEOUT_MS / 1000 + 0.1
"""Time until all axes have missed the host's heartbeat, and reported it."""


def outlive(board: EmbeddedBoard, engine: Engine, host: HostCondition, why: str) -> str:
    """Run a machine to standstill without its host, and let another host take over if planned; return a message.

    board: the board.
    engine: engine of its scenario.
    host: condition of the host.
    why: what has happened to the host.
    """
    restart_counts = host.restart_counts
    taken_over = ""
    if restart_counts is not None:
        board.pass_time((restart_counts - board.now_counts) / COUNTS_PER_SECOND)
        taken_over = _restart(board, host)
    elif not host.hangs:
        passed_s = 0.0
        while passed_s < _MISSED_S or (board.moving and passed_s < REST_TIMEOUT_S):
            board.pass_time(_LOOK_S)
            passed_s += _LOOK_S
    said = [each for each in engine.emergencies if each.code and each.code != ErrorCode.GROUP_STOPPED]
    if said:
        last = said[-1]
        why = f"{why}; {board.robot.axis_names[last.axis]}: {error_text(last.code)} (EMCY 0x{last.code:04X})"
    return why + taken_over


def _restart(board: EmbeddedBoard, host: HostCondition) -> str:
    """Let another host take over, as an operator does: wait for standstill, reset, enable; return a message."""
    replace_host(board, host)
    machine = Machine(board, board.robot.axis_names)
    try:
        await_standstill(board, machine.axes)
        for axis in machine.axes:
            if axis.state() in FAULT_STATES:
                axis.write(od.CONSUMER_HEARTBEATS[0], 0)  # messages of the lost host
                axis.write(od.CONTROLWORD, 0)
                axis.write(od.CONTROLWORD, Control.FAULT_RESET)
        machine.adopt([objects_of(joint, board.robot.board, moves=True) for joint in board.robot.axes])
        machine.start_nodes()
        machine.enable()
        machine.disconnect()
    except StepTwinError as error:
        return f"; the next host could not take over: {error}"
    return "; the next host has taken over"
