"""Follow the motions of a live board and give the records of the last one as a plan in the machine's positions.

The firmware's positions begin wherever a host has preset them; those of the machine are what its drivers have counted.
"""

from collections.abc import Sequence
from functools import partial
from typing import Final

from steptwin.emulator.board import Board
from steptwin.host.record.folder import PlanRows
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.received_plan import HALTED, ReceivedPlan
from steptwin.protocol.objects import UNITS_PER_FULL_STEP

_UNITS_PER_SIXTEENTH: Final = UNITS_PER_FULL_STEP // 16


class LivePlan:
    """Turns the records that a robot's axes accept into a plan; the live board tells of SYNCs, starts and ends."""

    def __init__(self, robot: Robot, axes: Sequence[tuple[Board, int]], start_steps: Sequence[int]) -> None:
        """Follow the axes from now on.

        Args:
            robot: the machine.
            axes: board of each joint, and the number of the joint's axis on it.
            start_steps: positions of the joints at power-up, in steps of the robot's file from their zeros.
        """
        self._received = ReceivedPlan(robot)
        self._robot = robot
        self._axes = axes
        self._start_sixteenths = [
            steps * joint.transmission.step_sixteenths for joint, steps in zip(robot.joints, start_steps, strict=True)
        ]
        self._rest_units = self._demands_units()
        """Position of each axis at the last SYNC, as the firmware counts."""
        self._queued = [0] * len(axes)
        """Number of records in each axis' queue at that SYNC."""
        self._offset_units = [0] * len(axes)
        """Difference from the firmware's positions to those of the machine at that SYNC."""
        for joint, (board, axis) in enumerate(axes):
            board.on_record(axis, partial(self._received.accept, joint))

    @property
    def lacking(self) -> str | None:
        """Reason why there is no plan at present; None if there is one."""
        return self._received.lacking

    @property
    def lacking_so_far(self) -> str | None:
        """Reason why there is no plan of the motion, which may be under way; None if its rows so far describe it."""
        return self._received.lacking_so_far

    @property
    def in_motion(self) -> bool:
        """True while the motion that the plan describes is under way."""
        return self._received.going

    def sync(self) -> None:
        """Note the positions at rest: a SYNC is about to reach the axes.

        The drivers know the position to a step; for an axis with records the firmware adds the part of a step.
        """
        self._rest_units = self._demands_units()
        self._queued = [board.firmware.motion.queued(axis) for board, axis in self._axes]
        for joint, (board, axis) in enumerate(self._axes):
            motor_units = (self._start_sixteenths[joint] + board.position_sixteenths(axis)) * _UNITS_PER_SIXTEENTH
            counted = board.firmware.motion.counter_units(axis) if self._queued[joint] else self._rest_units[joint]
            self._offset_units[joint] = motor_units - counted

    def begin(self) -> None:
        """Begin a plan: the last SYNC has started a motion."""
        self._received.begin(self._on_machine(self._rest_units), self._queued)
        for joint, (board, axis) in enumerate(self._axes):
            config, name = board.firmware.motion.config(axis), self._robot.joint_names[joint]
            as_filed = config.microsteps == self._robot.joints[joint].transmission.microsteps
            if self._queued[joint] and (config.dir_inverted or not as_filed):
                self._received.fail(f"{name} is set up otherwise than in the robot's file")

    def follow(self, *, in_motion: bool) -> None:
        """Note a halt or the end of the motion under way; must be called before the next frame reaches the axes."""
        if not self._received.going:
            return
        if any(board.firmware.motion.group.halted for board, _ in self._axes):
            self._received.fail(HALTED)
        if not in_motion:
            self._received.end(self._on_machine(self._demands_units()))

    def take(self) -> PlanRows:
        """Return the rows of the plan that are new, and forget them."""
        return self._received.take()

    def _demands_units(self) -> list[int]:
        return [board.firmware.motion.demand_units(axis) for board, axis in self._axes]

    def _on_machine(self, units: list[int]) -> list[int]:
        return [each + offset for each, offset in zip(units, self._offset_units, strict=True)]
