"""The motion of all axes of a board: common advance in time, and halt of the group."""

from collections.abc import Sequence

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.axis_motion import (
    EDGE_CAPACITY,
    STOP_MAX_MS,
    TICKS_PER_SECOND,
    AxisEvent,
    AxisMotion,
    BoardState,
    PinEdges,
)
from steptwin.controller.motion.backend import Kernel


class BoardMotion(BoardState):
    """All axes of one board, which advance in time together."""

    def __init__(self, kernel: Kernel, axis_count: int) -> None:
        super().__init__(kernel, axis_count)
        self.axes: tuple[AxisMotion, ...] = tuple(AxisMotion(self, axis) for axis in range(axis_count))
        self._advance = kernel.advance  # called every few ticks
        self._cells_before = kernel.cells(axis_count * k.AXIS_FIELDS)
        self._free_edges = EDGE_CAPACITY
        self.bound_edges()

    @property
    def room_ticks(self) -> int:
        """Number of ticks whose edges certainly fit before `take_edges` must be called."""
        return self._free_edges // self.edges_per_tick

    def advance(self, until_tick: int) -> int:
        """Compute the motion up to the start of `until_tick`; return the tick reached.

        The tick reached is earlier if an axis needs attention there (see `take_events`) or if the edges must be drained
        (`room_ticks` is 0).
        """
        if not self.running_axes:
            self.tick: int = until_tick
            return until_tick
        until = min(until_tick, self.tick + self.room_ticks)
        halt_tick = self.group.halt_tick
        if halt_tick is not None and self.tick < halt_tick < until:
            until = halt_tick
        reached, asking = self._advance(
            self.cells,
            self._cells_before,
            self.queue,
            self.group.cells,
            self.clk,
            self.direction,
            self.axis_count,
            self.tick,
            until,
        )
        self._free_edges -= (reached - self.tick) * self.edges_per_tick
        halts = self.tick < reached == halt_tick
        self.tick = reached
        if asking:
            self._note_events()
        if halts:
            for axis in sorted(self.group.members):
                self.events.setdefault(axis, AxisEvent.HALTED)
        return reached

    def _note_events(self) -> None:
        for axis in sorted(self.running_axes):
            event = self.axes[axis].take_event()
            if event is not AxisEvent.NONE:
                self.events[axis] = event

    def take_events(self) -> list[tuple[int, AxisEvent]]:
        """Return each event once, with its axis. An axis with an event is at standstill or must be stopped."""
        events = list(self.events.items())
        self.events.clear()
        ended = {axis for axis, event in events if event in (AxisEvent.FINISHED, AxisEvent.UNDERRUN)}
        self.running_axes.difference_update(ended)
        self.group.members -= ended
        return events

    def take_edges(self) -> tuple[PinEdges, ...]:
        """Return all placed edges since the last call, and free their storage."""
        edges = tuple(axis.take_edges() for axis in self.axes)
        self._free_edges = EDGE_CAPACITY
        return edges

    @property
    def highest_rate_q16(self) -> int:
        """Highest rate of the group's time at which every member keeps its step rate limit."""
        return min((self.axes[axis].highest_rate_q16 for axis in self.group.members), default=k.FULL_RATE_Q16)

    def ramp_group(self, decelerations_units_per_s2: Sequence[int]) -> None:
        """Start a ramp of the group's rate to the target rate, within each axis' deceleration limit.

        See `group_time` for the formula. The speeds are those of the queued segments that the ramp will cover.
        """
        group = self.group
        # If every axis is at standstill by plan, v dr/dt is 0 for any slope: the rate may change at once.
        moves = any(self.axes[axis].planned_velocity for axis in group.members)
        group.ramp(self.tick, self._full_ramp_ticks(decelerations_units_per_s2) if moves else 0)

    def _full_ramp_ticks(self, decelerations_units_per_s2: Sequence[int]) -> int:
        """Return the shortest ramp between full rate and 0 that keeps |v dr/dt| within every axis' deceleration D.

        It takes T = |v| / D, where v is the highest speed in the trajectory time that the ramp covers. This time is at
        most T r^2 / 2, where r >= 1 is the highest rate during the ramp. A longer ramp covers more segments, which may
        be faster, so T is increased until it is sufficient. The maximum is STOP_MAX_MS, as for a stop.
        """
        group = self.group
        highest_q16 = max(k.FULL_RATE_Q16, group.rate_q16(self.tick), group.target_q16)
        needed, ticks = 1, 0
        while needed > ticks:
            ticks = needed
            covered_ticks = ticks * highest_q16 * highest_q16 // (2 * k.FULL_RATE_Q16 * k.FULL_RATE_Q16) + 1
            for axis in group.members:
                velocity = self.axes[axis].fastest_units_per_s(covered_ticks)
                needed = max(needed, -(-velocity * TICKS_PER_SECOND // decelerations_units_per_s2[axis]))
            needed = min(needed, STOP_MAX_MS * k.TICKS_PER_MS)
        return ticks
