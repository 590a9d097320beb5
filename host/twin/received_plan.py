"""Turn the PVT records of the last motion that a SYNC has started into the rows of trajectory.csv.

With it the pulses of any host's motion can be verified against its records, to the wire unit. A row is made as soon as
every axis that moves has its record for it, and rows are taken away to be written, so memory stays bounded. A row
becomes text only then, which takes longer than all the rest.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.record.folder import PlanRows, trajectory_head, trajectory_row
from steptwin.host.robots.robot import Robot
from steptwin.protocol.pvt import QUEUE_DEPTH, VELOCITY_PER_UNIT_PER_MS, PvtRecord

NO_MOTION: Final = "no SYNC has started a motion"
NO_RECORDS: Final = "it was moved by other means than records"
HALTED: Final = "it was halted on its way"
ENDED_ELSEWHERE: Final = "it has not come to the end of its records"
_APART: Final = "the axes' records do not last equally long"
_AHEAD_MAX: Final = 2 * QUEUE_DEPTH
"""Number of one axis' records that may wait for those of the others; a queue holds half as many."""


class _Row(NamedTuple):
    """A point of the plan as the wire has it: positions in units, velocities in those of the records."""

    time_ms: int
    units: tuple[int, ...]
    velocities: tuple[int, ...]


class ReceivedPlan:
    """Collects records as the board accepts them; at the end there is a plan, or a reason why there is none."""

    def __init__(self, robot: Robot) -> None:
        """Begin without a plan."""
        self._lacking: str | None = NO_MOTION
        self.going = False
        """True while the motion is under way."""
        self._begin = False
        self._rows: list[_Row] = []
        """Rows that are not taken yet; with `_begin` the head of a plan comes before them."""
        self._robot = robot
        self._recent = [deque[PvtRecord](maxlen=QUEUE_DEPTH) for _ in robot.joints]
        """The last records of each joint; some of them may wait in its queue when a motion begins."""
        self._pending = [deque[PvtRecord]() for _ in robot.joints]
        """Records of the motion that are not in a row yet."""
        self._moving: list[int] = []
        """Joints that have records in this motion."""
        self._time_ms = 0
        self._units = [0] * len(robot.joints)
        """Positions of the last row, in the machine's wire units."""

    @property
    def lacking(self) -> str | None:
        """Reason why there is no plan at present; None if there is one."""
        return ENDED_ELSEWHERE if self.going and not self._lacking else self._lacking

    @property
    def lacking_so_far(self) -> str | None:
        """Reason why there is no plan of the motion, which may be under way; None if its rows so far describe it."""
        return self._lacking

    def take(self) -> PlanRows:
        """Return the new rows, and forget them."""
        head = [trajectory_head(self._robot)] if self._begin else []
        taken = PlanRows(self._begin, head + list(map(self._text, self._rows)))
        self._begin, self._rows = False, []
        return taken

    def accept(self, joint: int, record: PvtRecord) -> None:
        """Take in a record that the board has queued."""
        self._recent[joint].append(record)
        if self.going and self._lacking is None:
            self._pending[joint].append(record)
            self._make_rows()

    def begin(self, start_units: Sequence[int], queued: Sequence[int]) -> None:
        """Begin a plan: a SYNC has started a motion, with this number of records in each joint's queue."""
        self._moving = [joint for joint, count in enumerate(queued) if count]
        self._lacking = None if self._moving else NO_RECORDS
        self.going = True
        if not self._moving:
            return
        self._time_ms = 0
        self._units = list(start_units)
        for pending, recent, count in zip(self._pending, self._recent, queued, strict=True):
            pending.clear()
            pending.extend(list(recent)[len(recent) - count :])
        self._begin, self._rows = True, []
        self._make_row([0] * len(self._units))
        self._make_rows()

    def fail(self, reason: str) -> None:
        """Give up the plan: the machine does not move as the records say."""
        if self._lacking is None:
            self._lacking = reason

    def end(self, end_units: Sequence[int]) -> None:
        """End the motion, at the positions at which the machine now stands."""
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
        self._rows.append(_Row(self._time_ms, tuple(self._units), tuple(velocities)))

    def _text(self, row: _Row) -> str:
        positions = self._robot.to_positions(np.array(row.units))
        speeds = self._robot.to_positions(1000 * np.array(row.velocities) / VELOCITY_PER_UNIT_PER_MS)
        return trajectory_row(row.time_ms / 1000, positions.tolist(), speeds.tolist())
