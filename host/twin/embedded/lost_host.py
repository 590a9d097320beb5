"""What happens without the host: the machine comes to rest by itself, and another host may take it over."""

from typing import Final

from steptwin.host.client import Machine
from steptwin.host.client.drive_status import FAULT_STATES
from steptwin.host.client.heartbeat import TIMEOUT_MS
from steptwin.host.client.stopping import await_rest
from steptwin.host.client.waiting import REST_TIMEOUT_S
from steptwin.host.client.words import error_text
from steptwin.host.common.errors import StepTwinError
from steptwin.host.faults.engine import Engine
from steptwin.host.operate.setting_up import objects_of
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, ErrorCode
from steptwin.protocol.timer import COUNTS_PER_SECOND

_LOOK_S: Final = 0.01
_MISSED_S: Final = TIMEOUT_MS / 1000 + 0.1
"""Time after which all axes have missed the host's heartbeat, and said so."""


def outlive(board: EmbeddedBoard, engine: Engine, why: str) -> str:
    """Let a machine come to rest without its host, and another host take over if there is one; return what was said.

    Args:
        board: the board.
        engine: the engine that plays its scenario.
        why: what has become of the host.
    """
    restart_counts = board.host.restart_counts
    taken_over = ""
    if restart_counts is not None:
        board.pass_time((restart_counts - board.now_counts) / COUNTS_PER_SECOND)
        taken_over = _restart(board)
    elif not board.host.hangs:
        passed_s = 0.0
        while passed_s < _MISSED_S or (board.moving and passed_s < REST_TIMEOUT_S):
            board.pass_time(_LOOK_S)
            passed_s += _LOOK_S
    said = [each for each in engine.emergencies if each.code and each.code != ErrorCode.GROUP_STOPPED]
    if said:
        last = said[-1]
        why = f"{why}; {board.robot.joint_names[last.axis]}: {error_text(last.code)} (EMCY 0x{last.code:04X})"
    return why + taken_over


def _restart(board: EmbeddedBoard) -> str:
    """Let another host take over, as an operator does: wait for rest, reset the faults, enable; return what it says."""
    board.host_restarts()
    machine = Machine(board, board.robot.joint_names)
    try:
        await_rest(board, machine.axes)
        for axis in machine.axes:
            if axis.state() in FAULT_STATES:
                axis.write(od.CONSUMER_HEARTBEATS[0], 0)  # of the host that is gone
                axis.write(od.CONTROLWORD, 0)
                axis.write(od.CONTROLWORD, Control.FAULT_RESET)
        machine.adopt([objects_of(joint, board.robot.board, moves=True) for joint in board.robot.joints])
        machine.start_nodes()
        machine.enable()
        machine.disconnect()
    except StepTwinError as error:
        return f"; the next host could not take over: {error}"
    return "; the next host has taken over"
