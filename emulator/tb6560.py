"""The TB6560AHQ's inputs: which CLK pulses move the motor, and which limits they break.

Source: Toshiba "TB6560AHQ/AFG", datasheet of 2014-10-01. The chip counts rising CLK edges; the level of CW/CCW at
the edge gives the direction (page 10). RESET low forces the initial state and ignores CLK; ENABLE low switches only
the outputs off while the counter follows CLK (page 11). Operating range: CLK up to 15 kHz, high for at least
t_W(CLK), which is four periods of the oscillator set by the capacitor at OSC (pages 7 and 25).

Outside the operating range nothing is guaranteed. The model takes the worst case: a pulse that breaks a limit does
not count.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

COUNTS_PER_US = 72
CLK_RATE_MAX_HZ = 15_000
PERIOD_MIN_COUNTS = 72_000_000 // CLK_RATE_MAX_HZ

_CLK_WIDTH_MIN_US = {100.0: 10.0, 330.0: 30.0, 1000.0: 90.0}
"""Datasheet page 8: t_W(CLK) at the capacitors for which it is stated."""

Int64Array = NDArray[np.int64]
Int8Array = NDArray[np.int8]
Scalar = TypeVar("Scalar", bound=np.generic)


class Rule(IntEnum):
    """A limit of the operating range."""

    CLK_HIGH = 0
    """The pulse is shorter than t_W(CLK)."""
    CLK_RATE = 1
    """The rise follows the previous one sooner than 1 / 15 kHz."""


def oscillator_hz(osc_pf: float) -> float:
    """Oscillator frequency at a capacitor, by the datasheet's approximation (page 25): 400 kHz at 100 pF."""
    return 1e6 / (osc_pf * 1.5 * (10 / osc_pf + 1) / 66)


def clk_width_min_counts(osc_pf: float) -> int:
    """Minimum CLK high time in timer counts: the datasheet's figure where it has one, else four oscillator periods."""
    if osc_pf <= 0:
        raise ValueError(f"the OSC capacitor is {osc_pf} pF; it must be positive, for example 330")
    width_us = _CLK_WIDTH_MIN_US.get(osc_pf, 4e6 / oscillator_hz(osc_pf))
    return int(np.ceil(width_us * COUNTS_PER_US))


@dataclass(frozen=True, slots=True)
class Violations:
    """Every broken limit, as arrays of equal length: when, which rule, how long it was and had to be, in counts.

    The margin is value - limit, negative by definition.
    """

    counts: Int64Array
    rules: Int8Array
    values: Int64Array
    limits: Int64Array


@dataclass(frozen=True, slots=True)
class Pins:
    """What happened at the chip's inputs since the last look: times in counts, sorted, and levels after each edge."""

    clk_rise_counts: Int64Array
    clk_fall_counts: Int64Array
    dir_counts: Int64Array
    dir_levels: Int8Array
    reset_counts: Int64Array
    reset_levels: Int8Array


class Tb6560:
    """One driver chip, powered up with all inputs low: in reset, disabled, direction CW."""

    def __init__(self, osc_pf: float) -> None:
        self.clk_width_min_counts = clk_width_min_counts(osc_pf)
        self.position_steps = 0
        """Steps counted since power-up; DIR high counts up."""
        self.lost_steps = 0
        """Pulses seen less steps counted, both signed."""
        self.violation_count = 0
        """How many limits were broken so far."""
        self._dir_level = 0
        self._reset_level = 0
        self._last_rise_counts = -PERIOD_MIN_COUNTS
        self._steps: list[Int64Array] = []
        self._signs: list[Int8Array] = []
        self._violations: list[Violations] = []

    def feed(self, pins: Pins) -> tuple[Int64Array, Int8Array]:
        """Let the chip see the next stretch of its pins; every rise comes with its fall.

        Returns:
            When each step was counted and which way, +1 or -1, as in `steps`.
        """
        rises = pins.clk_rise_counts
        high_counts = pins.clk_fall_counts - rises
        period_counts = np.diff(rises, prepend=self._last_rise_counts)
        too_short = high_counts < self.clk_width_min_counts
        too_soon = period_counts < PERIOD_MIN_COUNTS
        out_of_reset = _levels_at(rises, pins.reset_counts, pins.reset_levels, self._reset_level) == 1
        accepted = out_of_reset & ~too_short & ~too_soon
        levels = _levels_at(rises, pins.dir_counts, pins.dir_levels, self._dir_level)
        directions = (2 * levels - 1).astype(np.int8)
        steps, signs = rises[accepted], directions[accepted]
        self._steps.append(steps)
        self._signs.append(signs)
        self.position_steps += int(signs.sum(dtype=np.int64))
        self.lost_steps += int(directions[~accepted].sum(dtype=np.int64))
        self._note(rises, out_of_reset & too_short, Rule.CLK_HIGH, high_counts, self.clk_width_min_counts)
        self._note(rises, out_of_reset & too_soon, Rule.CLK_RATE, period_counts, PERIOD_MIN_COUNTS)
        self._last_rise_counts = int(rises[-1]) if rises.size else self._last_rise_counts
        self._dir_level = int(pins.dir_levels[-1]) if pins.dir_levels.size else self._dir_level
        self._reset_level = int(pins.reset_levels[-1]) if pins.reset_levels.size else self._reset_level
        return steps, signs

    def _note(self, rises: Int64Array, broken: NDArray[np.bool_], rule: Rule, values: Int64Array, limit: int) -> None:
        count = int(broken.sum())
        self.violation_count += count
        if count:
            self._violations.append(
                Violations(
                    rises[broken],
                    np.full(count, rule, dtype=np.int8),
                    values[broken],
                    np.full(count, limit, dtype=np.int64),
                )
            )

    def forget(self) -> None:
        """Keep the count and forget its history: `steps` and `violations` begin anew."""
        self._steps.clear()
        self._signs.clear()
        self._violations.clear()

    @property
    def steps(self) -> tuple[Int64Array, Int8Array]:
        """When each counted step was made and which way, +1 or -1."""
        return _joined(self._steps, np.int64), _joined(self._signs, np.int8)

    @property
    def violations(self) -> Violations:
        """All broken limits so far, in order of time."""
        found = self._violations
        counts = _joined([v.counts for v in found], np.int64)
        order = np.argsort(counts, kind="stable")
        return Violations(
            counts[order],
            _joined([v.rules for v in found], np.int8)[order],
            _joined([v.values for v in found], np.int64)[order],
            _joined([v.limits for v in found], np.int64)[order],
        )


def _levels_at(times: Int64Array, edges: Int64Array, levels: Int8Array, before: int) -> Int8Array:
    """A pin's level at each time; an edge at the very time of a CLK rise is already seen."""
    history = np.concatenate((np.array([before], dtype=np.int8), levels))
    return history[np.searchsorted(edges, times, side="right")]


def _joined(parts: list[NDArray[Scalar]], dtype: type[Scalar]) -> NDArray[Scalar]:
    return np.concatenate(parts) if parts else np.empty(0, dtype=dtype)
