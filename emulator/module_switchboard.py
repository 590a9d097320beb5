"""Set the chip's inputs by a module's switches: fixed levels while it runs, and less torque at standstill."""

from collections.abc import Mapping, Sequence

import numpy as np

from steptwin.emulator.dip_switches import DipSwitches
from steptwin.emulator.edges import Int64Array
from steptwin.emulator.tb6560 import Input, LevelChange
from steptwin.protocol.timer import COUNTS_PER_MS


class Switchboard:
    """The switches and the idle circuit of one module; RESET goes high with the supply."""

    def __init__(self, switches: DipSwitches, idle_ms: int) -> None:
        self._running, self._standing = switches.running, switches.standing
        self._idle_counts = idle_ms * COUNTS_PER_MS
        self._supplied = False
        self._idle = False
        self._last_rise_counts = 0
        self._turned: list[LevelChange] = []
        """Changes by switches that somebody has turned, to be passed on."""

    def turn(self, levels: Mapping[Input, int], counts: int) -> None:
        """Let somebody set switches, which hold these levels from an instant on."""
        self._running = {**self._running, **levels}
        if self._supplied:
            self._turned += [LevelChange(counts, pin, level) for pin, level in levels.items()]

    @property
    def waiting(self) -> bool:
        """True while the idle current has yet to begin."""
        return (self._supplied and not self._idle) or bool(self._turned)

    def changes(self, outside: Sequence[LevelChange], rises: Int64Array, until_counts: int) -> tuple[LevelChange, ...]:
        """Return the changes at the chip's inputs up to an instant, from changes outside and from the rises of CLK.

        From outside only the supplies and ENABLE reach the chip.
        """
        found, self._turned = self._turned, []
        for change in outside:
            if change.pin is Input.VM:
                earlier = int(np.searchsorted(rises, change.counts))
                found += self._rest(rises[:earlier], change.counts)
                found += self._supply(change)
                rises = rises[earlier:]
            elif change.pin in (Input.VDD, Input.ENABLE):
                found.append(change)
        found += self._rest(rises, until_counts)
        return tuple(sorted(found, key=lambda change: change.counts))

    def _supply(self, change: LevelChange) -> list[LevelChange]:
        counts, _, level = change
        self._supplied, self._idle, self._last_rise_counts = bool(level), False, counts
        held = [LevelChange(counts, pin, level and high) for pin, high in (*self._running.items(), (Input.RESET, 1))]
        return [change, *held] if level else [*reversed(held), change]

    def _rest(self, rises: Int64Array, until_counts: int) -> list[LevelChange]:
        """Return the changes of torque: less when CLK has rested for the idle time, full with its next rise."""
        if not self._supplied:
            return []
        times = np.concatenate(([self._last_rise_counts], rises))
        changes: list[LevelChange] = []
        for rest in np.flatnonzero(np.diff(times) > self._idle_counts).tolist():
            changes += self._begin(int(times[rest])) + self._end(int(times[rest + 1]))
        self._last_rise_counts = int(times[-1])
        if self._last_rise_counts + self._idle_counts < until_counts:
            changes += self._begin(self._last_rise_counts)
        return changes

    def _begin(self, last_rise_counts: int) -> list[LevelChange]:
        if self._idle:
            return []
        self._idle = True
        counts = last_rise_counts + self._idle_counts
        return [LevelChange(counts, pin, level) for pin, level in self._standing.items()]

    def _end(self, rise_counts: int) -> list[LevelChange]:
        self._idle = False
        return [LevelChange(rise_counts, pin, self._running[pin]) for pin in self._standing]
