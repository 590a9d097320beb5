"""Compare the pulse timing of the kernel with that of other step methods, on the same motions.

`motions` makes the planned motions that every method is given, `table` lists the methods, our `kernel` and the
`usual_methods` of others, and `evaluation` measures their pulses against the ideal crossings. This door describes what
every method makes: CLK and DIR edges of each axis, in counts of the board's 72 MHz timer.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from steptwin.bench.step_methods.motions import PlannedMotion
from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.protocol.timer import counts_of_ns

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Return the function compiled by numba, or unchanged without the extra `fast`: same results, 100 times slower."""
    if not find_spec("numba"):
        return function
    import numba

    return cast("Function", numba.njit(cache=True, error_model="numpy")(function))


THRESHOLD_Q16 = 9 << 12
"""H = 9/16 step."""


@compiled
def counter_at(counter: int, position_q16: int) -> int:
    """Return the counter after a monotone motion from `counter` to a position."""
    away_q16 = position_q16 - (counter << 16)
    if away_q16 >= THRESHOLD_Q16:
        return counter + ((away_q16 - THRESHOLD_Q16) >> 16) + 1
    if away_q16 <= -THRESHOLD_Q16:
        return counter - ((-away_q16 - THRESHOLD_Q16) >> 16) - 1
    return counter


@dataclass(frozen=True, slots=True, eq=False)
class AxisPulses:
    """Edges of one axis; t = 0 is count 0, and DIR is low before its first edge.

    Attributes:
        rise_counts: CLK rises, sorted, shape (steps,).
        fall_counts: the fall that ends each pulse, shape (steps,).
        dir_counts: changes of DIR, sorted, shape (d,).
        dir_levels: level after each change, shape (d,); high counts up.
    """

    rise_counts: Int64Array
    fall_counts: Int64Array
    dir_counts: Int64Array
    dir_levels: Int8Array

    @classmethod
    def of(cls, rises: Int64Array, direction: Int64Array, steplen_counts: int) -> "AxisPulses":
        """Make pulses of one length, shortened only by the next rise; `direction` holds 2 * counts + level."""
        falls = rises + steplen_counts
        falls[:-1] = np.minimum(falls[:-1], rises[1:])
        return cls(rises, falls, direction >> 1, (direction & 1).astype(np.int8))

    @property
    def signs(self) -> Int8Array:
        """+1 or -1 for each step, by the level of DIR at its rise, shape (steps,)."""
        levels = np.concatenate((np.zeros(1, np.int8), self.dir_levels))
        at_rise = levels[np.searchsorted(self.dir_counts, self.rise_counts, side="right")]
        return (2 * at_rise - 1).astype(np.int8)


class PlacedPulses(NamedTuple):
    """Pulses of each axis that a method made of a motion, and the time that placing them took on this machine."""

    axes: list[AxisPulses]
    wall_s: float


@dataclass(frozen=True, slots=True)
class Method:
    """One way of making step pulses."""

    key: str
    """A short name without spaces."""
    title: str
    place: Callable[[PlannedMotion], PlacedPulses]


REPEATS = 3
"""Number of timed runs; the fastest counts. One run before them compiles and touches the pages."""


class PinTimes(NamedTuple):
    """Pulse timing in timer counts: CLK high, CLK high and low together, DIR stable before and after a rise."""

    steplen: int
    pulse: int
    dirsetup: int
    dirhold: int

    @classmethod
    def of(cls, board: BoardSettings) -> "PinTimes":
        """Convert a board's settings; DIR is held for at least one count, since the driver reads it at the rise."""
        steplen, stepspace = counts_of_ns(board.steplen_ns), counts_of_ns(board.stepspace_ns)
        return cls(
            steplen, steplen + stepspace, counts_of_ns(board.dirsetup_ns), max(counts_of_ns(board.dirhold_ns), 1)
        )


Place = Callable[[Int64Array, Int64Array, Int64Array], None]
"""Fills three arrays, a row for each axis: CLK rises, DIR edges as 2 * counts + level, and the numbers of both."""


def place_with(place: Place, motion: PlannedMotion) -> PlacedPulses:
    """Let a method fill the rows REPEATS + 1 times; return its pulses and the shortest time."""
    rises, direction = (np.zeros((motion.axes, motion.steps_max), np.int64) for _ in range(2))
    made = np.zeros((motion.axes, 2), np.int64)
    wall_s = float("inf")
    for _ in range(REPEATS + 1):
        started = time.perf_counter()
        place(rises, direction, made)
        wall_s = min(wall_s, time.perf_counter() - started)
    steplen = PinTimes.of(motion.board).steplen
    rows = zip(rises, direction, made.tolist(), strict=True)
    return PlacedPulses(
        [AxisPulses.of(own[:steps], edges[:turns], steplen) for own, edges, (steps, turns) in rows], wall_s
    )


class PlannedAxis(NamedTuple):
    """One axis of a motion: instants in ms, positions in Q16 steps and velocities in steps/s there, and its counter."""

    times_ms: Int64Array
    points_q16: Int64Array
    velocities_hz: FloatArray
    start_steps: int


def place_axes(
    place: Callable[[PlannedAxis, Int64Array, Int64Array], tuple[int, int]], motion: PlannedMotion
) -> PlacedPulses:
    """Let a method that places one axis after the other do so, into the axis' rows."""
    rows = zip(motion.points_q16, motion.velocities_hz, motion.start_steps, strict=True)
    planned = [PlannedAxis(motion.times_ms, *row) for row in rows]

    def place_all(rises: Int64Array, direction: Int64Array, made: Int64Array) -> None:
        for axis, own in enumerate(planned):
            made[axis] = place(own, rises[axis], direction[axis])

    return place_with(place_all, motion)
