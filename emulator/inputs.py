"""A board's inputs: the levels that the machine gives them, and when the firmware must look at them.

The firmware sees, at the start of each servo tick, the levels that are then. Pulses are computed many ticks at a time,
so what is asked here is how many: no driver counts pulses faster than one each PERIOD_MIN_COUNTS, so a switch that is d
steps away stays as it is for (d - 1) of these at least. Next to a switch it goes tick by tick.
"""

from collections.abc import Callable, Sequence

import numpy as np

from controller.kernel import TICK_COUNTS
from emulator.switches import AxisSwitches, Switch
from emulator.tb6560 import PERIOD_MIN_COUNTS, Int8Array, Int64Array
from protocol.cia402 import DigitalInput


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
        self._look_ticks: dict[int, int] = {}
        """The tick at whose start the switches of an axis want to be looked at next; none while it stands."""

    def counted(self, axis: int, step_counts: Int64Array, step_signs: Int8Array) -> None:
        """A driver has counted these steps."""
        if axis in self._switched and step_counts.size:
            self._ahead[axis].append((step_counts, step_signs))

    @property
    def levels(self) -> list[DigitalInput]:
        """Of each axis, as last looked at."""
        common = DigitalInput.ESTOP if self.emergency_stop else DigitalInput(0)
        return [
            axis.levels | common | (DigitalInput.DRIVER_PROTECT if protect else DigitalInput(0))
            for axis, protect in zip(self._axes, self.protects, strict=True)
        ]

    def look_tick(self, tick: int, running: Callable[[int], bool]) -> int | None:
        """The tick at whose start to look next, if that is known: not before `tick`, the first not yet computed."""
        for axis in self._switched:
            if axis not in self._look_ticks and running(axis):
                self._look_ticks[axis] = tick + self._quiet_ticks(axis)
        return min(self._look_ticks.values(), default=None)

    def look(self, tick: int, running: Callable[[int], bool]) -> None:
        """See where the axes are at the start of a tick; all steps before it have been counted."""
        for axis in list(self._look_ticks):
            self._settle(axis, tick * TICK_COUNTS)
            if running(axis) or self._ahead[axis]:
                self._look_ticks[axis] = tick + max(1, self._quiet_ticks(axis))
            else:
                del self._look_ticks[axis]

    def _settle(self, axis: int, until_counts: int) -> None:
        moved, ahead = 0, []
        for counts, signs in self._ahead[axis]:
            seen = int(np.searchsorted(counts, until_counts))
            moved += int(signs[:seen].sum(dtype=np.int64))
            if seen < counts.size:
                ahead.append((counts[seen:], signs[seen:]))
        self._ahead[axis] = ahead
        self._axes[axis].move(moved)

    def _quiet_ticks(self, axis: int) -> int:
        """For how many ticks no switch of an axis can change, however fast it moves."""
        return (self._axes[axis].steps_to_change - 1) * PERIOD_MIN_COUNTS // TICK_COUNTS
