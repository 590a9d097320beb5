"""Follow the motions of a robot's axes by the frames on their bus: which SYNC started the last one, and its plan."""

from collections.abc import Sequence

from steptwin.controller.kernel import TICK_COUNTS
from steptwin.emulator.board import Board
from steptwin.host.twin.live_plan import LivePlan
from steptwin.protocol.frame import COB_SYNC, Frame


class FollowedMotion:
    """Notes starts and ends of motions; the bus tells it of every frame before its receivers get it.

    Attributes:
        start_counts: t = 0 of the last motion that a SYNC started; None if there was none.
        plan: the plan of that motion, made of its records; None if nobody wants it.
    """

    def __init__(self, axes: Sequence[tuple[Board, int]], plan: LivePlan | None) -> None:
        """Follow the axes from now on; `axes` has the board of each joint, and the number of its axis there."""
        self.start_counts: int | None = None
        self.plan = plan
        self._axes = axes
        self._sync_counts: int | None = None
        """Instant of a SYNC at rest that may start a motion; None once that is known."""

    def frame(self, frame: Frame, counts: int) -> None:
        """Note a frame that is about to reach its receivers."""
        self.follow()
        if frame.cob_id == COB_SYNC and not self.in_motion:
            self._sync_counts = counts
            if self.plan:
                self.plan.sync()

    def follow(self) -> None:
        """Note what has happened up to now: axes that move before the frame after a SYNC were started by it."""
        if self._sync_counts is not None and self.in_motion:
            self.start_counts = -(-self._sync_counts // TICK_COUNTS) * TICK_COUNTS
            if self.plan:
                self.plan.begin()
        self._sync_counts = None
        if self.plan:
            self.plan.follow(in_motion=self.in_motion)

    @property
    def in_motion(self) -> bool:
        """True while any axis moves."""
        return any(board.firmware.motion.running(axis) for board, axis in self._axes)
