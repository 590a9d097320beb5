"""Follow the motions of a live board, and make a plan in the machine's positions from the last motion's records.

The firmware's positions begin at any host's preset; those of the machine are the drivers' counts.

The plan verifies the pulses of any host's motion against its records, to the wire unit. A row is complete when every
moving axis has its record for it. Rows are then taken away for writing, so memory stays bounded. Only then they become
text, which takes most of the time.

A recording shows one motion: the last one with a plan, even if others have moved the machine since. Later events are
recorded, but are not in the plan.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from typing import Final, NamedTuple

import numpy as np

from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.host.client.words import error_words
from steptwin.host.record.folder import MachineStop, PlanRows, trajectory_head, trajectory_row
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.robot_boards import RobotBoards
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, State
from steptwin.protocol.frame import COB_EMCY, COB_SYNC, FIRST_NODE_ID, NODE_ID_MAX, Frame
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from steptwin.protocol.pvt import QUEUE_DEPTH, VELOCITY_PER_UNIT_PER_MS, PvtRecord
from steptwin.protocol.timer import COUNTS_PER_SECOND

NO_MOTION: Final = "no trajectory was run; a jog, a move or a homing has no plan"
OTHER_FIRMWARE: Final = "the board runs another firmware than StepTwin's, whose plan nobody knows"
HALTED: Final = "it was halted on its way, each board by a ramp of its own"
ENDED_ELSEWHERE: Final = "it has not come to the end of its records"
_APART: Final = "the axes' records do not last equally long"
_AHEAD_MAX: Final = 2 * QUEUE_DEPTH
"""Number of one axis' records that may wait for those of the others, twice a queue's depth."""


class _Row(NamedTuple):
    """A point of the plan in wire units: positions, and velocities as in the records."""

    time_ms: int
    units: tuple[int, ...]
    velocities: tuple[int, ...]


class ReceivedPlan:
    """Collects records that the board accepts; at the end it has a plan, or a reason for none."""

    def __init__(self, robot: Robot) -> None:
        """Start without a plan."""
        self._lacking: str | None = NO_MOTION
        self.going: bool = False
        """True during the motion."""
        self.number: int = 0
        """Number of the present plan, counting all that were begun."""
        self._rows: list[tuple[int, _Row | None]] = []
        """Rows that are not taken yet, each with the number of its plan; None is the head of the file."""
        self._robot = robot
        self._recent = [deque[PvtRecord](maxlen=QUEUE_DEPTH) for _ in robot.axes]
        """Last records of each joint; some may wait in its queue when a motion begins."""
        self._pending = [deque[PvtRecord]() for _ in robot.axes]
        """Records of the motion that are not in a row yet."""
        self._moving: list[int] = []
        """Joints with records in this motion."""
        self._time_ms = 0
        self._units = [0] * len(robot.axes)
        """Positions of the last row, in the machine's wire units."""

    @property
    def lacking(self) -> str | None:
        """Why there is no plan at present; None if there is one."""
        return ENDED_ELSEWHERE if self.going and not self._lacking else self._lacking

    @property
    def lacking_so_far(self) -> str | None:
        """Why there is no plan of the present motion; None if its rows so far describe it."""
        return self._lacking

    @property
    def moving(self) -> Sequence[int]:
        """Joints with records in the motion."""
        return self._moving

    def take(self) -> list[PlanRows]:
        """Return the new rows of each plan, in order, and drop them."""
        rows, self._rows = self._rows, []
        return [
            PlanRows(number, [self._text(row) for _, row in own])
            for number, own in groupby(rows, key=lambda row: row[0])
        ]

    def accept(self, joint: int, record: PvtRecord) -> None:
        """Add a record that the board has queued."""
        self._recent[joint].append(record)
        if self.going and self._lacking is None:
            self._pending[joint].append(record)
            self._make_rows()

    def begin(self, start_units: Sequence[int], queued: Sequence[int]) -> None:
        """Begin a plan: a SYNC has started a motion; `queued` is the number of records in each joint's queue."""
        self._moving = [joint for joint, count in enumerate(queued) if count]
        self._lacking = None if self._moving else NO_MOTION
        self.going = True
        if not self._moving:
            return
        self._time_ms = 0
        self._units = list(start_units)
        for pending, recent, count in zip(self._pending, self._recent, queued, strict=True):
            pending.clear()
            pending.extend(list(recent)[len(recent) - count :])
        self.number += 1
        self._rows.append((self.number, None))
        self._make_row([0] * len(self._units))
        self._make_rows()

    def fail(self, reason: str) -> None:
        """Drop the plan: the machine does not move as in the records."""
        if self._lacking is None:
            self._lacking = reason

    def end(self, end_units: Sequence[int]) -> None:
        """End the motion at the machine's present positions."""
        self.going = False
        if any(self._pending):
            self.fail(_APART)
        if list(end_units) != self._units:
            self.fail(ENDED_ELSEWHERE)

    def _make_rows(self) -> None:
        while self._lacking is None and all(self._pending[joint] for joint in self._moving):
            records = {joint: self._pending[joint].popleft() for joint in self._moving}
            durations_ms = {record.duration_ms for record in records.values()}
            if len(durations_ms) > 1:
                self.fail(_APART)
                return
            self._time_ms += durations_ms.pop()
            velocities = [0] * len(self._units)
            for joint, record in records.items():
                self._units[joint] += record.displacement_units
                velocities[joint] = record.end_velocity
            self._make_row(velocities)
        if any(len(pending) > _AHEAD_MAX for pending in self._pending):
            self.fail(_APART)

    def _make_row(self, velocities: Sequence[int]) -> None:
        self._rows.append((self.number, _Row(self._time_ms, tuple(self._units), tuple(velocities))))

    def _text(self, row: _Row | None) -> str:
        if row is None:
            return trajectory_head(self._robot)
        positions = self._robot.to_positions(np.array(row.units))
        speeds = self._robot.to_positions(1000 * np.array(row.velocities) / VELOCITY_PER_UNIT_PER_MS)
        return trajectory_row(row.time_ms / 1000, positions.tolist(), speeds.tolist())


class LivePlan(ReceivedPlan):
    """Plan from the records that a machine's axes accept; the live board reports SYNCs, starts and ends."""

    def __init__(self, machine: RobotBoards) -> None:
        """Follow the axes from now on."""
        super().__init__(machine.robot)
        self._machine = machine
        self._start_units = [
            steps * UNITS_PER_FULL_STEP // joint.transmission.microsteps
            for joint, steps in zip(machine.robot.axes, machine.start_steps, strict=True)
        ]
        self._rest_units = [0] * len(machine.axes)
        """Position of each axis at the last SYNC, by the firmware's count."""
        self._queued = [0] * len(machine.axes)
        """Number of records in each axis' queue at that SYNC."""
        self._offset_units = [0] * len(machine.axes)
        """Offset of each axis from the firmware's position to the machine's at that SYNC."""
        self._follows = all(board.runs_own for board, _ in machine.axes)
        if not self._follows:
            self._lacking = OTHER_FIRMWARE
            return
        self._rest_units = self._demands_units()
        for joint, (board, axis) in enumerate(machine.axes):
            board.own.on_record(board, axis, partial(self.accept, joint))

    def sync(self) -> None:
        """Save the positions at rest before a SYNC reaches the axes.

        The drivers' position is exact to a step; the firmware of an axis with records adds the fraction.
        """
        if not self._follows:
            return
        self._rest_units = self._demands_units()
        self._queued = [board.firmware.motion.axes[axis].queued for board, axis in self._machine.axes]
        for joint, (board, axis) in enumerate(self._machine.axes):
            motor_units = self._start_units[joint] + round(board.position_full_steps(axis) * UNITS_PER_FULL_STEP)
            counted = board.firmware.motion.axes[axis].counter_units if self._queued[joint] else self._rest_units[joint]
            self._offset_units[joint] = motor_units - counted

    def begin_at_sync(self) -> None:
        """Begin a plan: the last SYNC has started a motion."""
        if not self._follows:
            return
        self.begin(self._on_machine(self._rest_units), self._queued)
        for joint, (board, axis) in enumerate(self._machine.axes):
            config, name = board.firmware.motion.axes[axis].config, self._machine.robot.axis_names[joint]
            as_filed = config.microsteps == self._machine.robot.axes[joint].transmission.microsteps
            if self._queued[joint] and (config.dir_inverted or not as_filed):
                self.fail(f"{name} is set up otherwise than in the robot's file")

    def follow(self, *, in_motion: bool) -> None:
        """Register a pause or the end of the motion; must be called before the next frame reaches the axes."""
        if not self.going:
            return
        boards = {id(board): board for board, _ in self._machine.axes}
        if len(boards) > 1 and any(board.firmware.motion.group.halted for board in boards.values()):
            self.fail(HALTED)
        if not in_motion:
            self.end(self._on_machine(self._demands_units()))

    def _demands_units(self) -> list[int]:
        return [board.firmware.motion.axes[axis].demand_units for board, axis in self._machine.axes]

    def _on_machine(self, units: list[int]) -> list[int]:
        return [each + offset for each, offset in zip(units, self._offset_units, strict=True)]


_HARMLESS: Final = (ErrorCode.NONE, ErrorCode.CAN_OVERRUN, ErrorCode.CAN_ERROR_PASSIVE)
_FOLLOWS: Final = ErrorCode.GROUP_STOPPED
"""Error of an axis after another one has stopped."""
_TOGETHER_COUNTS: Final = COUNTS_PER_SECOND // 10
"""Time within which errors have one cause."""
BY_HOST: Final = "a stop of a host"


@dataclass(frozen=True, slots=True)
class RecordedMotion:
    """Motion of a recording.

    Attributes:
        start_counts: its t = 0; None if no SYNC has started a motion.
        no_plan: why it has no plan; None if it has one.
        in_motion: True if it has not ended.
        plan_number: number of its plan, as in LivePlan; 0 without one.
        next_counts: instant when a later motion began; 0 if there was none.
        stop: stop of the machine since it began; None without one.
    """

    start_counts: int | None
    no_plan: str | None
    in_motion: bool = False
    plan_number: int = 0
    next_counts: int = 0
    stop: MachineStop | None = None


class FollowedMotion:
    """Registers starts and ends of motions; the bus reports every frame before its receivers get it.

    Attributes:
        start_counts: t = 0 of the last motion that a SYNC started; None if there was none.
        plan: plan of that motion from its records; None if it is not needed.
    """

    def __init__(self, machine: RobotBoards, plan: LivePlan | None) -> None:
        """Follow a machine's axes from now on."""
        self.start_counts: int | None = None
        self.plan = plan
        self._machine = machine
        self._sync_counts: int | None = None
        """Instant of a SYNC at rest that may start a motion; None once that is decided."""
        self._complete: RecordedMotion | None = None
        """Last motion that was complete."""
        self._rest_counts = 0
        """Last instant with all axes at rest."""
        self._moved_counts = 0
        """Last instant with a moving axis."""
        self._caused = False
        """True if the cause of the stop is known."""
        self._stop: MachineStop | None = None
        """Stop of the machine since its last motion began."""
        self._names = dict(enumerate(machine.robot.axis_names, start=FIRST_NODE_ID))

    def frame(self, frame: Frame, counts: int) -> None:
        """Register a frame before it reaches its receivers."""
        self.follow(counts)
        if frame.cob_id & ~NODE_ID_MAX == COB_EMCY and frame.cob_id & NODE_ID_MAX in self._names:
            self._note_error(frame, counts)
        if frame.cob_id == COB_SYNC and not self.in_motion:
            self._sync_counts = counts
            if self.plan:
                self.plan.sync()

    def follow(self, now_counts: int) -> None:
        """Register events up to now: axes that move before the frame after a SYNC were started by it."""
        self._note_later_motion(now_counts)
        if self._sync_counts is not None and self.in_motion:
            self.start_counts = -(-self._sync_counts // TICK_COUNTS) * TICK_COUNTS
            self._stop = None
            if self.plan:
                self.plan.begin_at_sync()
        self._sync_counts = None
        if self.plan:
            went = self.plan.going
            self.plan.follow(in_motion=self.in_motion)
            if went and not self.plan.going and self.plan.lacking is None:
                self._complete = RecordedMotion(self.start_counts, None, plan_number=self.plan.number)
            elif went and not self.plan.going and self._switched_off(self.plan.moving):
                self._note_stop(MachineStop(now_counts, BY_HOST, in_motion=True))

    def recorded(self, *, ended: bool) -> RecordedMotion:
        """Return the motion of a recording; an active one only if the recording has not `ended`."""
        if self.plan is None:
            return RecordedMotion(self.start_counts, None, stop=self._stop)
        lacking = self.plan.lacking if ended else self.plan.lacking_so_far
        if self._complete and (lacking or self._complete.plan_number == self.plan.number):
            return self._complete
        return RecordedMotion(self.start_counts, lacking, self.plan.going, self.plan.number, stop=self._stop)

    def _note_error(self, frame: Frame, counts: int) -> None:
        """Register an error that stops the machine: an emergency stop, or any error during motion."""
        code = int.from_bytes(frame.data[:2], "little")
        if code in _HARMLESS:
            return
        cut = self.plan is not None and self.plan.lacking == ENDED_ELSEWHERE
        in_motion = self.in_motion or (cut and counts - self._moved_counts < _TOGETHER_COUNTS)
        if code == ErrorCode.ESTOP:
            stop = MachineStop(counts, error_words(code), in_motion)
            self._note_stop(stop)
            if self._complete and not self._complete.stop:
                self._complete = replace(self._complete, stop=stop)
        elif in_motion:
            name = self._names[frame.cob_id & NODE_ID_MAX]
            self._note_stop(MachineStop(counts, f"{name}: {error_words(code)}", in_motion), cause=code != _FOLLOWS)

    def _note_stop(self, stop: MachineStop, *, cause: bool = True) -> None:
        """Register a stop, unless there was one before; a later call may add the cause."""
        before = self._stop
        if before is not None and (self._caused or stop.counts - before.counts > _TOGETHER_COUNTS):
            return
        self._stop, self._caused = stop, cause

    def _switched_off(self, joints: Sequence[int]) -> bool:
        """Return whether the drive of a joint is no longer enabled."""
        axes = (self._machine.axes[joint] for joint in joints)
        nodes = (board.own.firmware.nodes[axis] for board, axis in axes)
        return any(State.of(node.dictionary.get(od.STATUSWORD)) is not State.OPERATION_ENABLED for node in nodes)

    def _note_later_motion(self, now_counts: int) -> None:
        """Register a motion after the end of a plan, whichever program has started it."""
        if not self.in_motion:
            self._rest_counts = now_counts
            return
        self._moved_counts = now_counts
        if self._complete and not self._complete.next_counts and not (self.plan and self.plan.going):
            self._complete = replace(self._complete, next_counts=self._rest_counts)

    @property
    def in_motion(self) -> bool:
        """True while any axis moves."""
        return self._machine.interpolating
