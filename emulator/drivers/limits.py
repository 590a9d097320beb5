"""Limits of a driver's input signals, and the record of their violations."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from steptwin.emulator.board.edges import NO_COUNTS, NO_LEVELS, Int8Array, Int64Array


class Rule(Enum):
    """A rule that can be violated, and the consequence in the model."""

    CLK_HIGH = "CLK high too short: step missed"
    CLK_LOW = "CLK low too short before its rise: step missed"
    CLK_PERIOD = "CLK rises too soon after the last time: step missed"
    WAKE_UP = "STEP too soon after power-up or reset: step missed"
    ENABLE_SETUP = "ENABLE came too late before STEP: step missed"
    DISABLED = "STEP while ENABLE was off: step missed"
    DIR_SETUP = "DIR changed too late before CLK: step the wrong way"
    DIR_HOLD = "DIR changed too early after CLK: step the wrong way"
    MODE_CHANGE = "M1 or M2 changed while RESET was high: currents jump"
    POWER_ORDER = "VDD, VM and inputs in the wrong order: the chip may be damaged"
    OVER_TEMPERATURE = "junction too hot: outputs off until RESET"
    TOO_HOT = "junction too hot: outputs off until it is cool"
    OVER_CURRENT = "short circuit in the motor: outputs off, and they stay so"
    OVER_VOLTAGE = "motor supply too high: outputs off, and they stay so"


class LimitUnit(Enum):
    """Unit of a limit and of the values that violate it."""

    COUNTS = "counts"
    LEVEL = "level"
    CELSIUS = "degC"
    VOLT = "V"


@dataclass(frozen=True, slots=True)
class Limit:
    """A rule with its figure and the figure's source."""

    rule: Rule
    value: int
    unit: LimitUnit
    source: str


@dataclass(frozen=True, slots=True)
class Violations:
    """Violations of limits in order of time, as arrays of equal length.

    Attributes:
        limits: all limits that can be violated.
        counts: shape (n,), instants.
        which: shape (n,), indices of the limits.
        values: shape (n,), measured values, in the limits' units.
    """

    limits: tuple[Limit, ...]
    counts: Int64Array
    which: Int8Array
    values: Int64Array

    def rules(self) -> list[Rule]:
        """Return the rule of each violation."""
        return [self.limits[index].rule for index in self.which.tolist()]

    def margins(self) -> Int64Array:
        """Return value minus limit of each violation, shape (n,)."""
        return self.values - np.array([limit.value for limit in self.limits], dtype=np.int64)[self.which]


def merged(parts: list[Violations]) -> Violations:
    """Return the violations of all parts in order of time; at equal instants the earlier part comes first."""
    limits = tuple(limit for part in parts for limit in part.limits)
    offsets = np.cumsum([0, *(len(part.limits) for part in parts)])
    counts = np.concatenate([NO_COUNTS, *(part.counts for part in parts)])
    which = np.concatenate(
        [NO_LEVELS, *(part.which + np.int8(offset) for part, offset in zip(parts, offsets, strict=False))]
    )
    values = np.concatenate([NO_COUNTS, *(part.values for part in parts)])
    order = np.argsort(counts, kind="stable")
    return Violations(limits, counts[order], which[order], values[order])


class ViolationLog:
    """Record of limit violations in one part of the driver."""

    def __init__(self, limits: tuple[Limit, ...]) -> None:
        self._limits = limits
        self._parts: list[Violations] = []
        self.count: int = 0

    def know(self, limits: tuple[Limit, ...]) -> None:
        """Append further limits."""
        self._limits = limits

    def note(self, limit: int, counts: Int64Array, values: Int64Array) -> None:
        """Record violations of a limit, given by its index, at some instants."""
        if counts.size:
            self.count += counts.size
            self._parts.append(_of_one_limit(limit, counts, values))

    def note_one(self, limit: int, counts: int, value: int) -> None:
        """Record one violation."""
        self.note(limit, np.array([counts], dtype=np.int64), np.array([value], dtype=np.int64))

    def forget(self) -> None:
        """Drop the recorded violations, but keep their number."""
        self._parts.clear()

    def all(self) -> Violations:
        """Return the violations since `forget`."""
        found = merged(self._parts)
        return Violations(self._limits, found.counts, found.which, found.values)

    def with_more(self, limit: int, counts: Int64Array, values: Int64Array) -> Violations:
        """Return the recorded and further violations of one limit, without recording the further ones."""
        found = merged([*self._parts, _of_one_limit(limit, counts, values)])
        return Violations(self._limits, found.counts, found.which, found.values)


def _of_one_limit(limit: int, counts: Int64Array, values: Int64Array) -> Violations:
    return Violations((), counts, np.full(counts.size, limit, dtype=np.int8), values)
