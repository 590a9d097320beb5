"""What a driver asks of those who drive it, and the record of where it did not get it."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from steptwin.emulator.edges import NO_COUNTS, NO_LEVELS, Int8Array, Int64Array


class Rule(Enum):
    """What was broken, and what the model lets follow from it."""

    CLK_HIGH = "CLK high too short: step missed"
    CLK_LOW = "CLK low too short before its rise: step missed"
    CLK_PERIOD = "CLK rises too soon after the last time: step missed"
    DIR_SETUP = "DIR changed too late before CLK: step the wrong way"
    DIR_HOLD = "DIR changed too early after CLK: step the wrong way"
    MODE_CHANGE = "M1 or M2 changed while RESET was high: currents jump"
    POWER_ORDER = "VDD, VM and inputs in the wrong order: the chip may be damaged"
    OVER_TEMPERATURE = "junction too hot: outputs off until RESET"


class LimitUnit(Enum):
    """What a limit and its values are measured in."""

    COUNTS = "counts"
    LEVEL = "level"
    CELSIUS = "degC"


@dataclass(frozen=True, slots=True)
class Limit:
    """A rule with its figure, and who says so."""

    rule: Rule
    value: int
    unit: LimitUnit
    source: str


@dataclass(frozen=True, slots=True)
class Violations:
    """Every broken limit in order of time, as arrays of equal length.

    Attributes:
        limits: those that there are.
        counts: shape (n,), when.
        which: shape (n,), the index of the limit.
        values: shape (n,), what was there, in the limit's unit.
    """

    limits: tuple[Limit, ...]
    counts: Int64Array
    which: Int8Array
    values: Int64Array

    def rules(self) -> list[Rule]:
        """The rule that each of them broke."""
        return [self.limits[index].rule for index in self.which.tolist()]

    def margins(self) -> Int64Array:
        """Shape (n,): value - limit."""
        return self.values - np.array([limit.value for limit in self.limits], dtype=np.int64)[self.which]


def merged(parts: list[Violations]) -> Violations:
    """All of them in order of time; of those at one instant, the earlier part's first."""
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
    """Where a part of the driver notes what it did not get."""

    def __init__(self, limits: tuple[Limit, ...]) -> None:
        self._limits = limits
        self._parts: list[Violations] = []
        self.count = 0

    def note(self, limit: int, counts: Int64Array, values: Int64Array) -> None:
        """Note that a limit, by its index, was broken at some instants."""
        if counts.size:
            self.count += counts.size
            self._parts.append(_of_one_limit(limit, counts, values))

    def note_one(self, limit: int, counts: int, value: int) -> None:
        """Note a single one."""
        self.note(limit, np.array([counts], dtype=np.int64), np.array([value], dtype=np.int64))

    def forget(self) -> None:
        """Keep the count alone."""
        self._parts.clear()

    def all(self) -> Violations:
        """Everything so far."""
        found = merged(self._parts)
        return Violations(self._limits, found.counts, found.which, found.values)

    def with_more(self, limit: int, counts: Int64Array, values: Int64Array) -> Violations:
        """Everything so far and some of one limit, which are not noted for good."""
        found = merged([*self._parts, _of_one_limit(limit, counts, values)])
        return Violations(self._limits, found.counts, found.which, found.values)


def _of_one_limit(limit: int, counts: Int64Array, values: Int64Array) -> Violations:
    return Violations((), counts, np.full(counts.size, limit, dtype=np.int8), values)
