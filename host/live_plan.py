"""The plan of a live board's last motion: what its axes were sent, in the machine's positions.

The firmware counts from wherever it was told to; the machine stands where its drivers have brought it.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from emulator.board import Board
from host.received_plan import HALTED, ReceivedPlan
from host.robot import Robot
from protocol.dictionary import ObjectDictionary
from protocol.objects import UNITS_PER_FULL_STEP, key_of
from protocol.pvt import PvtRecord


class LivePlan:
    """Follows the axes of a robot; told of every SYNC at rest and what came of it."""

    def __init__(
        self, folder: Path, robot: Robot, axes: Sequence[tuple[Board, int]], start_steps: Sequence[int]
    ) -> None:
        """Begin to listen.

        Args:
            folder: where trajectory.csv is to be.
            robot: the machine.
            axes: of each joint its board, and its number there.
            start_steps: where the joints stood at power-up.
        """
        self._received = ReceivedPlan(folder, robot)
        self._robot = robot
        self._axes = axes
        self._start_steps = start_steps
        self._rest_units = self._demands_units()
        self._queued = [0] * len(axes)
        """Where the axes stood at the SYNC, as the firmware counts, and how many records waited."""
        self._offset_units = [0] * len(axes)
        """From the firmware's positions to those of the machine."""
        for joint, (board, axis) in enumerate(axes):
            _tap_records(board.firmware.nodes[axis].dictionary, partial(self._received.accept, joint))

    @property
    def lacking(self) -> str | None:
        """Why there is no plan just now; None: there is one."""
        return self._received.lacking

    def sync(self) -> None:
        """A SYNC is about to reach axes that rest."""
        self._rest_units = self._demands_units()
        self._queued = [board.firmware.motion.queued(axis) for board, axis in self._axes]

    def begin(self) -> None:
        """It has set them going.

        Where the machine stands is known to a step; of an axis with records, the firmware says where within it.
        """
        unusual = []
        for joint, (board, axis) in enumerate(self._axes):
            motion, microsteps = board.firmware.motion, self._robot.joints[joint].transmission.microsteps
            steps = self._start_steps[joint] + board.trace(axis).position_steps
            if self._queued[joint]:
                offset_units = (steps - motion.counter_steps(axis)) * UNITS_PER_FULL_STEP // microsteps
                config = motion.config(axis)
                if config.microsteps != microsteps or config.dir_inverted:
                    unusual.append(self._robot.joint_names[joint])
            else:
                offset_units = steps * UNITS_PER_FULL_STEP // microsteps - self._rest_units[joint]
            self._offset_units[joint] = offset_units
        self._received.begin(self._on_machine(self._rest_units), self._queued)
        for name in unusual:
            self._received.fail(f"{name} is set up otherwise than in the robot's file")

    def follow(self, *, in_motion: bool) -> None:
        """See how the motion goes, if one has begun; before anything new reaches the axes."""
        if not self._received.going:
            return
        if any(board.firmware.motion.group.halted for board, _ in self._axes):
            self._received.fail(HALTED)
        if not in_motion:
            self._received.end(self._on_machine(self._demands_units()))

    def finish(self) -> None:
        """The session is over: leave the plan, if there is one."""
        self._received.finish()

    def _demands_units(self) -> list[int]:
        return [board.firmware.motion.demand_units(axis) for board, axis in self._axes]

    def _on_machine(self, units: list[int]) -> list[int]:
        return [each + offset for each, offset in zip(units, self._offset_units, strict=True)]


def _tap_records(dictionary: ObjectDictionary, accept: Callable[[PvtRecord], None]) -> None:
    """Show each record that an axis' firmware takes into its queue."""
    queue_it = dictionary.write_hooks[key_of(0x60C1, 4)]

    def tapped(sequence: int) -> None:
        before = dictionary.get(0x2012, 1)
        queue_it(sequence)
        if dictionary.get(0x2012, 1) != before:
            displacement_units, end_velocity, duration_ms = (dictionary.get(0x60C1, field) for field in (1, 2, 3))
            accept(PvtRecord(displacement_units, end_velocity, duration_ms, sequence))

    dictionary.write_hooks[key_of(0x60C1, 4)] = tapped
