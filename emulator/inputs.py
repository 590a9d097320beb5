"""A board's inputs: the levels that the machine gives them, and when the firmware must look at them.

The firmware sees, at the start of each servo tick, the levels that are then. Pulses are computed many ticks at a time,
so what is asked here is how many: no driver counts pulses faster than one each PERIOD_MIN_COUNTS, so a switch that is d
steps away stays as it is for (d - 1) of these at least. Next to a switch it goes tick by tick.
"""

from collections.abc import Sequence

import numpy as np

from steptwin.controller.kernel import TICK_COUNTS
from steptwin.controller.motion import Motion
from steptwin.emulator.edges import Int8Array, Int64Array
from steptwin.emulator.switches import AxisSwitches, Switch
from steptwin.emulator.tb6560 import PERIOD_MIN_COUNTS
from steptwin.protocol.cia402 import DigitalInput


class BoardInputs:
    """The inputs of all axes. The axes move by the steps that their drivers count."""

    def __init__(self, switches: Sequence[Switch], start_steps: Sequence[int]) -> None:
        self.emergency_stop = False
        self.protects = [False] * len(start_steps)
        """Of each axis' driver."""
        self._axes = [
            AxisSwitches([switch for switch in switches if switch.axis == axis], start)
            for axis, start in enumerate(start_steps)
        ]
        self._switched = [axis for axis, switches in enumerate(self._axes) if switches]
        self._ahead: list[list[tuple[Int64Array, Int8Array]]] = [[] for _ in self._axes]
        """Steps that are counted but not looked at yet, by axis: instants and signs."""
        self._held_pulses = [0] * len(start_steps)
        """Pulses whose fate a driver does not know yet, by axis."""
        self._due_ticks: dict[int, int] = {}
        """The tick at whose start the switches of an axis want to be looked at next; none while it stands."""
        self._starts_seen = 0
        """Only after another start of an axis, by the motion's count, there may be another one to watch."""

    @property
    def levels(self) -> list[DigitalInput]:
        """Of each axis, as last looked at."""
        common = DigitalInput.ESTOP if self.emergency_stop else DigitalInput(0)
        return [
            axis.levels | common | (DigitalInput.DRIVER_PROTECT if protect else DigitalInput(0))
            for axis, protect in zip(self._axes, self.protects, strict=True)
        ]

    def count_anew(self) -> None:
        """The firmware has been started again, and with it the motion's count of starts."""
        self._starts_seen = 0

    @property
    def unsettled(self) -> bool:
        """Whether a switch may still change by what is computed already."""
        return bool(self._due_ticks)

    def counted(self, axis: int, step_counts: Int64Array, step_signs: Int8Array, *, held_pulses: int) -> None:
        """A driver has counted these steps, and may count so many pulses yet."""
        self._held_pulses[axis] = held_pulses
        if axis in self._switched and step_counts.size:
            self._ahead[axis].append((step_counts, step_signs))

    def due_tick(self, motion: Motion) -> int | None:
        """Up to the start of which tick no switch can change; None while nothing moves past switches."""
        if motion.starts != self._starts_seen:
            self._starts_seen = motion.starts
            for axis in self._switched:
                if axis not in self._due_ticks and motion.running(axis):
                    self._due_ticks[axis] = motion.tick + self._quiet_ticks(self._axes[axis].steps_to_change)
        return min(self._due_ticks.values()) if self._due_ticks else None

    def may_have_changed(self, motion: Motion) -> bool:
        """Whether it takes a look to know more; else it is known that no switch has changed, and `due_tick` goes on."""
        due = [axis for axis, tick in self._due_ticks.items() if tick <= motion.tick]
        return not all(self._put_off(axis, motion) for axis in due)

    def _put_off(self, axis: int, motion: Motion) -> bool:
        """While an axis has made less than half the steps to a switch, that need not be looked at."""
        pulses = motion.undrained_pulses(axis) + self._held_pulses[axis]
        pulses += sum(counts.size for counts, _ in self._ahead[axis])
        distance = self._axes[axis].steps_to_change
        if not motion.running(axis) and pulses == 0:
            del self._due_ticks[axis]
            return True
        if 2 * pulses >= distance or not motion.running(axis):
            return False
        self._due_ticks[axis] = motion.tick + max(1, self._quiet_ticks(distance - pulses))
        return True

    def look(self, motion: Motion) -> None:
        """See where the axes are at the start of the tick to come; all pulses before it have been drained."""
        for axis in list(self._due_ticks):
            self._settle(axis, motion.tick * TICK_COUNTS)
            self._due_ticks[axis] = motion.tick + max(1, self._quiet_ticks(self._axes[axis].steps_to_change))

    def _settle(self, axis: int, until_counts: int) -> None:
        moved, ahead = 0, []
        for counts, signs in self._ahead[axis]:
            seen = int(np.searchsorted(counts, until_counts))
            moved += int(signs[:seen].sum(dtype=np.int64))
            if seen < counts.size:
                ahead.append((counts[seen:], signs[seen:]))
        self._ahead[axis] = ahead
        self._axes[axis].move(moved)

    @staticmethod
    def _quiet_ticks(distance_steps: int) -> int:
        """For how many ticks a switch so far away cannot change, however fast the axis moves."""
        return (distance_steps - 1) * PERIOD_MIN_COUNTS // TICK_COUNTS
