"""What an observer sees at the pins of one axis, and what must hold for it, whatever the host does."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.motion.axis_motion import PinEdges
from steptwin.controller.motion.step_config import StepConfig
from steptwin.controller.node.pins import Pin, PinChange
from steptwin.protocol.timer import counts_of_ns

Counts = NDArray[np.int64]
_LONG_AGO_COUNTS = -(1 << 60)


class PinRecord:
    """The pulses of an axis, in the order in which they come, and the position by the observer's own count."""

    def __init__(self) -> None:
        self.steps = 0
        """Steps since power-up, counted up while the position grows."""
        self.faults: list[str] = []
        """Violations of the driver's timing."""
        self._clk: list[Counts] = []
        self._directions: list[Counts] = []
        self._dir_level = 0
        self._last_fall_counts = self._last_rise_counts = self._last_dir_counts = _LONG_AGO_COUNTS

    def see(self, edges: PinEdges, config: StepConfig) -> None:
        """Take the edges since the last call, all of them made with one configuration."""
        clk, words = np.asarray(edges.clk_counts, dtype=np.int64), np.asarray(edges.direction, dtype=np.int64)
        if not (clk.size or words.size):
            return
        rises, changes = clk[0::2], words >> 1
        levels = np.concatenate(([self._dir_level], words & 1))
        signs = 2 * levels[np.searchsorted(changes, rises, side="right")] - 1
        self.steps += int(signs.sum()) * (-1 if config.dir_inverted else 1)
        self.faults += self._timing_faults(rises, clk[1::2], changes, config)
        self._clk.append(clk)
        self._directions.append(words)
        self._dir_level = int(levels[-1])

    def _timing_faults(self, rises: Counts, falls: Counts, changes: Counts, config: StepConfig) -> Iterator[str]:
        """Yield what is too short; edges of the call before count as well."""
        rises_before = np.concatenate(([self._last_rise_counts], rises))
        dirs = np.concatenate(([self._last_dir_counts], changes))
        high = falls - rises
        low = rises - np.concatenate(([self._last_fall_counts], falls))[:-1]
        setup = rises - dirs[np.searchsorted(changes, rises, side="right")]
        hold = changes - rises_before[np.searchsorted(rises, changes, side="left")]
        if (high != counts_of_ns(config.steplen_ns)).any():
            yield f"pulses of {sorted(set(high.tolist()))} counts with a steplen of {config.steplen_ns} ns"
        for name, times, least_ns in (
            ("CLK low", low, config.stepspace_ns),
            ("DIR before CLK", setup, config.dirsetup_ns),
            ("DIR after CLK", hold, config.dirhold_ns),
        ):
            if times.size and times.min() < counts_of_ns(least_ns):
                yield f"{name} for {times.min()} counts, {least_ns} ns are needed"
        if rises.size:
            self._last_rise_counts, self._last_fall_counts = int(rises[-1]), int(falls[-1])
        if changes.size:
            self._last_dir_counts = int(changes[-1])

    def cut_off(self, now_counts: int) -> None:
        """Forget the pulses that the power's end has prevented; DIR falls, and the count begins again."""
        clk = self.clk
        self._clk = [clk[: 2 * int(np.searchsorted(clk[0::2], now_counts))]]
        self._dir_level = self.steps = 0
        self._last_fall_counts = self._last_rise_counts = self._last_dir_counts = _LONG_AGO_COUNTS

    @property
    def clk(self) -> Counts:
        """All edges of CLK: rise, fall, rise, fall ..."""
        return np.concatenate([np.empty(0, dtype=np.int64), *self._clk])

    @property
    def direction(self) -> Counts:
        """All edges of DIR: 2 * counts + level."""
        return np.concatenate([np.empty(0, dtype=np.int64), *self._directions])


def level_faults(clk: Counts, changes: Sequence[PinChange], pin: Pin, power_cycles: Sequence[int]) -> Iterator[str]:
    """Yield each pulse during which a pin changes or is low; a pulse during which the power goes is not judged."""
    rises, falls = clk[0::2], clk[1::2]
    cut = np.searchsorted(power_cycles, falls, side="right") != np.searchsorted(power_cycles, rises, side="left")
    rises, falls = rises[~cut], falls[~cut]
    if not rises.size:
        return
    of_pin = [change for change in changes if change.pin is pin]
    times = np.array([_LONG_AGO_COUNTS] + [change.counts for change in of_pin])
    levels = np.array([0] + [change.level for change in of_pin])
    if (np.diff(times) < 0).any():
        yield f"{pin.name} goes back in time"
    at_rise = np.searchsorted(times, rises, side="left") - 1
    at_end = np.searchsorted(times, falls, side="left") - 1
    for i in np.flatnonzero(at_rise != at_end):
        change = of_pin[int(at_rise[i])]
        yield f"{pin.name} becomes {change.level} at {change.counts}, within the pulse from {rises[i]} to {falls[i]}"
    for i in np.flatnonzero(levels[at_rise] == 0):
        yield f"a pulse at {rises[i]} while {pin.name} is low"
