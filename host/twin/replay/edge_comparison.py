"""Compare the edges of a stored run with those of its replay."""

from collections.abc import Iterator
from itertools import zip_longest
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import Int64Array
from steptwin.host.record.folder.edges_file import angle_column, edge_arrays
from steptwin.host.twin.replay.frame_comparison import NOTHING, Difference, instant
from steptwin.host.verify import AxisEvidence, Evidence
from steptwin.protocol.timer import COUNTS_PER_SECOND


class _EdgeSignal(NamedTuple):
    """Edges of one signal: in words, the key of their instants, and those of their values."""

    words: str
    counts: str
    values: tuple[str, ...] = ()


_SIGNALS: Final = (
    _EdgeSignal("STEP rises", "clk_rise_counts"),
    _EdgeSignal("STEP falls", "clk_fall_counts"),
    _EdgeSignal("DIR", "dir_edge_counts", ("dir_levels",)),
    _EdgeSignal("step of the driver", "step_counts", ("step_signs",)),
    _EdgeSignal("broken limit", "violation_counts", ("violation_which", "violation_values")),
    _EdgeSignal("slip of the motor", "slip_counts", ("slip_full_steps",)),
)

_NONE: Final = np.empty(0)
"""An array that only some axes have, for the others."""


def first_difference_of_edges(recorded: Evidence, replayed: Evidence) -> Difference | None:
    """Return the first edge of any pin, count or current of a driver that differs; None if all are the same."""
    found = [
        difference
        for old, new in zip(recorded.axes, replayed.axes, strict=True)
        for difference in _differences(old, new)
    ]
    return min(found, key=lambda difference: difference.counts or 0, default=None)


def _differences(old: AxisEvidence, new: AxisEvidence) -> Iterator[Difference]:
    """Yield the first difference of each signal of an axis."""
    old_arrays, new_arrays = edge_arrays(old), edge_arrays(new)
    angles = angle_column(old.phases.per_full_step)
    currents = _EdgeSignal("phase currents", "phase_counts", (angles, "phase_a_ma", "phase_b_ma"))
    pins = (_EdgeSignal(pin.upper(), f"{pin}_counts", (f"{pin}_levels",)) for pin in old.pins)
    for signal in (*_SIGNALS, currents, *pins):
        keys = [f"{old.name}_{key}" for key in (signal.counts, *signal.values)]
        was_arrays, now_arrays = ([arrays.get(key, _NONE) for key in keys] for arrays in (old_arrays, new_arrays))
        if all(map(np.array_equal, was_arrays, now_arrays)):
            continue
        rows = (zip(*(each.tolist() for each in arrays), strict=True) for arrays in (was_arrays, now_arrays))
        for was, now in zip_longest(*rows):
            if was != now:
                counts = min(row[0] for row in (was, now) if row is not None)
                yield Difference(counts, f"{old.name} {signal.words}", _words(was), _words(now))
                break


def _words(row: tuple[float, ...] | None) -> str:
    if row is None:
        return NOTHING
    counts, *values = row
    to = f" to {', '.join(f'{value:g}' for value in values)}" if values else ""
    return f"at {instant(int(counts))} ({int(counts)} counts){to}"


def first_difference_of_steps(recorded: Evidence, replayed: Evidence) -> Difference | None:
    """Return the first step of an axis that the drivers did not make in the same direction; None if there is none.

    Instants are not compared: by a computer's clock the hosts' frames are not where they were within a servo tick.
    """
    for old, new in zip(recorded.axes, replayed.axes, strict=True):
        for number, (was, now) in enumerate(zip_longest(_signs(old), _signs(new)), start=1):
            if was != now:
                where = f"{old.name}, step {number} of its driver"
                return Difference(None, where, _step(was, old.step_counts, number), _step(now, new.step_counts, number))
    return None


def _signs(axis: AxisEvidence) -> list[int]:
    signs: list[int] = axis.step_signs.tolist()
    return signs


def _step(sign: int | None, counts: Int64Array, number: int) -> str:
    if sign is None:
        return NOTHING
    return f"{sign:+d} at {instant(int(counts[number - 1]))} since power-up"


def greatest_shift_us(recorded: Evidence, replayed: Evidence) -> float:
    """Return by how much an instant of equal steps differs at most, both counted from the last motion's start."""
    shifts_counts = [
        np.abs((new.step_counts - replayed.start_counts) - (old.step_counts - recorded.start_counts))[
            old.step_counts >= recorded.start_counts
        ].max(initial=0)
        for old, new in zip(recorded.axes, replayed.axes, strict=True)
    ]
    return 1e6 * float(max(shifts_counts)) / COUNTS_PER_SECOND
