"""Whatever has happened: a reset and a homing bring the machine to a move that does what it says."""

from collections.abc import Callable
from random import Random

from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, Mode, Status
from steptwin.protocol.frame import (
    COB_HEARTBEAT,
    COB_NMT,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    FIRST_NODE_ID,
    Frame,
)
from steptwin.protocol.homing_methods import HOME_HERE, HOMING_METHODS
from tests.emulator.random_host.host import LOAD, RandomHost, restoring
from tests.emulator.random_host.machine import ACCELERATION, STEP, VELOCITY_MAX, BrokenInvariantError
from tests.emulator.random_host.sdo import download

_SILENCE_MAX_MS = 1500
"""Time after which no frame must wait: what was in the board's queues before the reset has been sent."""
_RAMP_MAX_MS = 16_320
"""The longest ramp, which a reset waits for."""
_SENT_MAX_MS = 30_000
"""Time after which the host's own frames must have been sent: a board in overload lets one pass after 32 of its own."""
_ANSWER_MAX_MS = 30
_MOTION_MAX_MS = 20_000
_LOOK_EACH_MS = 5
_MOVE_STEPS = 150
_TRIED = 1
"""Number of axes that are homed and moved: others in other sessions."""
_SETTINGS = {
    od.MAX_PROFILE_VELOCITY: VELOCITY_MAX,
    od.HOMING_SEARCH_SPEED: VELOCITY_MAX // 2,
    od.HOMING_ZERO_SPEED: VELOCITY_MAX // 4,
    od.HOMING_ACCELERATION: ACCELERATION,
    od.PROFILE_ACCELERATION: ACCELERATION,
    od.PROFILE_DECELERATION: ACCELERATION,
    od.PROFILE_VELOCITY: VELOCITY_MAX,
}
_SEARCHES = tuple(
    number
    for number, method in HOMING_METHODS.items()
    if method and (method.turns or method.switch != DigitalInput.HOME)
)
"""The homing methods for an axis with limit switches and a home switch that is closed over a stretch."""


class WorkingMove:
    """The host's last actions in a session. Unlike the actions before, these insist on every answer."""

    def __init__(self, host: RandomHost, seed: int) -> None:
        self._host = host
        self._draw = Random(f"{seed} working move")
        self._machine = host.machine
        self._axes = range(self._machine.setup.board.axis_count)
        self._answers: dict[int, list[bytes]] = {}
        self._machine.simulation.host.receive = self._hear

    def _hear(self, frame: Frame, _now_counts: int) -> None:
        self._answers.setdefault(frame.cob_id, []).append(frame.data)

    def perform(self) -> None:
        """Reset every axis, home and move some of them."""
        for operation in restoring(len(self._axes)):
            self._host.do(operation)
        self._reset()
        if any(self._machine.board.own.flash):
            for axis in self._axes:
                self._write(axis, od.RESTORE_ALL, LOAD)
            self._reset()
        self._send(COB_NMT, b"\x01\x00")
        tried = self._draw.sample(self._axes, min(_TRIED, len(self._axes)))
        self._home(tried)
        self._move(tried)

    def _send(self, cob_id: int, data: bytes) -> None:
        self._host.do(Frame(cob_id, data))

    def _reset(self) -> None:
        """Reset all nodes and wait for their boot-up messages, and until no frame of before waits."""
        self._answers.clear()
        self._send(COB_NMT, b"\x81\x00")
        host = self._machine.simulation.host
        self._wait(_SENT_MAX_MS, "the host's frames are not on the bus", lambda: not host.mailboxes)
        self._wait(_RAMP_MAX_MS + _SILENCE_MAX_MS, "not every node has booted, or frames still wait", self._is_booted)

    def _is_booted(self) -> bool:
        boot_ups = (self._answers.get(COB_HEARTBEAT + FIRST_NODE_ID + axis, ()) for axis in self._axes)
        return not self._machine.board.firmware.transmit and all(b"\0" in heard for heard in boot_ups)

    def _wait(self, at_most_ms: int, what: str, done: Callable[[], bool]) -> None:
        for _ in range(0, at_most_ms, _LOOK_EACH_MS):
            if done():
                return
            self._host.pause(_LOOK_EACH_MS)
        raise BrokenInvariantError(f"after {at_most_ms} ms {what}")

    def _write(self, axis: int, address: int, value: int) -> None:
        node_id = FIRST_NODE_ID + axis
        answers = self._answers.setdefault(COB_SDO_RESPONSE + node_id, [])
        answers.clear()
        self._send(COB_SDO_REQUEST + node_id, download(address, value))
        place = f"axis {axis}: {od.place_text(address)}"
        for _ in range(_ANSWER_MAX_MS):
            self._host.pause(1)
            if answers:
                break
        if not answers or answers[0][0] != 0x60:
            raise BrokenInvariantError(
                f"{place} = {value} after a reset: answer {answers[0].hex() if answers else 'missing'}"
            )

    def _home(self, axes: list[int]) -> None:
        """Home some axes at the same time."""
        for axis in axes:
            settings = _SETTINGS | {od.HOMING_METHOD: self._method(axis)}
            for address, value in settings.items():
                self._write(axis, address, value)
            for word in (0x06, 0x07, 0x0F):
                self._write(axis, od.CONTROLWORD, word)
            self._write(axis, od.MODE_OF_OPERATION, Mode.HOMING)
            self._write(axis, od.CONTROLWORD, 0x1F)
        for axis in axes:
            self._wait_for(axis, Status.HOMING_ATTAINED | Status.TARGET_REACHED | Status.POSITION_KNOWN, "homed")
            self._write(axis, od.CONTROLWORD, 0x0F)

    def _wait_for(self, axis: int, bits: int, what: str) -> None:
        node = self._machine.board.firmware.nodes[axis]
        self._wait(_MOTION_MAX_MS, f"axis {axis} is not {what}", lambda: node.statusword() & bits == bits)

    def _method(self, axis: int) -> int:
        """Return a homing method for which the axis has the switches."""
        if all(switch.axis != axis for switch in self._machine.setup.board.switches):
            return HOME_HERE
        return self._draw.choice(_SEARCHES)

    def _move(self, axes: list[int]) -> None:
        """Move towards the middle of the travel, and let the chips say how far that was."""
        board, starts = self._machine.board, self._machine.setup.board.start_substeps
        begins_steps = [board.position_steps(axis) for axis in axes]
        steps = [
            _MOVE_STEPS if starts[axis] / 16 + board.position_full_steps(axis) < 0 else -_MOVE_STEPS for axis in axes
        ]
        for axis, displacement in zip(axes, steps, strict=True):
            self._write(axis, od.MODE_OF_OPERATION, Mode.PROFILE_POSITION)
            self._write(axis, od.TARGET_POSITION, self._value(axis, od.POSITION_ACTUAL) + displacement * STEP)
            self._write(axis, od.CONTROLWORD, 0x1F)
            self._write(axis, od.CONTROLWORD, 0x0F)
        for axis, begin, displacement in zip(axes, begins_steps, steps, strict=True):
            self._wait_for(axis, Status.TARGET_REACHED, "at its target")
            moved = board.position_steps(axis) - begin
            if moved != displacement:
                raise BrokenInvariantError(
                    f"axis {axis} was to move {displacement} steps and its driver counted {moved}"
                )

    def _value(self, axis: int, address: int) -> int:
        return self._machine.board.firmware.nodes[axis].dictionary.get(address)
