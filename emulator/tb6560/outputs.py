"""What the chip's outputs do at any instant, worked out from the steps it has counted and its inputs' history."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from emulator.edges import COUNTS_PER_US, NO_COUNTS, NO_LEVELS, Delay, FloatArray, Int8Array, Int64Array
from emulator.tb6560.excitation import CYCLE_SIXTEENTHS, PHASE_PERCENT, Excitation
from emulator.tb6560.pins import EXCITATIONS, TORQUE_PERCENT, Input, LevelChange

SENSE_VOLT: Final = 0.5
"""Charging stops where the sense resistor has this (V_NF, typical, pages 6 to 8)."""

ENABLE_DELAY: Final = Delay(to_high=3 * COUNTS_PER_US, to_low=2 * COUNTS_PER_US)
"""From ENABLE to the outputs (typical, pages 6 to 8)."""

Levels = dict[Input, int]


class _Stretch(NamedTuple):
    """From an instant on the field turns by the same angle each step."""

    from_counts: int
    steps_before: int
    sixteenths: int
    excitation: Excitation
    initial: bool


class Outputs:
    """The bridges and MO of one chip, from what has happened to it so far.

    Every query takes instants in counts, shape (n,), in any order. The chopper is not resolved: currents are those that
    it regulates to. It takes a new target on with the next edge of the oscillator (page 20), within 7.7 us at 330 pF.
    """

    def __init__(
        self,
        changes: Sequence[LevelChange],
        steps: tuple[Int64Array, Int8Array],
        shutdowns: Sequence[tuple[int, int]],
        sense_ohm: float,
    ) -> None:
        self._changes = changes
        self._step_counts = steps[0]
        self._turned = np.concatenate(([0], np.cumsum(steps[1], dtype=np.int64)))
        self._shutdowns = shutdowns
        self._peak_a = SENSE_VOLT / sense_ohm
        self._stretches = list(self._follow())
        self._from_counts = np.array([stretch.from_counts for stretch in self._stretches], dtype=np.int64)

    def _follow(self) -> Iterator[_Stretch]:
        """The stretches between changes of RESET and mode; before the first change the chip has no supply."""
        levels: Levels = dict.fromkeys(Input, 0)
        stretch = _Stretch(np.iinfo(np.int64).min, 0, *_initial(levels))
        yield stretch
        for change in self._changes:
            levels[change.pin] = change.level
            if change.pin not in (Input.RESET, Input.VDD, Input.M1, Input.M2):
                continue
            steps = int(self._turned[np.searchsorted(self._step_counts, change.counts, side="left")])
            if levels[Input.RESET] and levels[Input.VDD]:
                excitation = EXCITATIONS[levels[Input.M2], levels[Input.M1]]
                state = excitation.nearest_state(_angle(stretch, steps))
                stretch = _Stretch(change.counts, steps, state, excitation, initial=False)
            else:
                stretch = _Stretch(change.counts, steps, *_initial(levels))
            yield stretch

    def instants(self) -> Int64Array:
        """Sorted instants at which anything may change; between them nothing does."""
        changes = np.array([change.counts for change in self._changes], dtype=np.int64)
        enabled, _ = ENABLE_DELAY.passed(*self._edges(Input.ENABLE))
        shut_down, _ = _arrays(self._shutdowns)
        return np.unique(np.concatenate((self._step_counts, changes, enabled, shut_down)))

    def sixteenths(self, counts: Int64Array) -> Int64Array:
        """The field's angle in sixteenths of a full step, 0 to 63; it grows clockwise, DIR low."""
        at = np.searchsorted(self._from_counts, counts, side="right") - 1
        turned = self._turned[np.searchsorted(self._step_counts, counts, side="right")]
        begun = np.array([stretch.steps_before for stretch in self._stretches], dtype=np.int64)[at]
        angle = np.array([stretch.sixteenths for stretch in self._stretches], dtype=np.int64)[at]
        step = np.array([stretch.excitation.step_sixteenths for stretch in self._stretches], dtype=np.int64)[at]
        sixteenths: Int64Array = (angle - (turned - begun) * step) % CYCLE_SIXTEENTHS
        return sixteenths

    def angle_deg(self, counts: Int64Array) -> FloatArray:
        """The field's electrical angle, 0 to below 360 degrees: a cycle is four full steps."""
        return np.asarray(self.sixteenths(counts) * (360 / CYCLE_SIXTEENTHS), dtype=np.float64)

    def mo_levels(self, counts: Int64Array) -> Int8Array:
        """The MO pin with a pull-up: low in the initial state, which comes round once a cycle, and in reset."""
        at = np.searchsorted(self._from_counts, counts, side="right") - 1
        initial = np.array([stretch.initial for stretch in self._stretches])[at]
        angles = np.array([stretch.excitation.initial_sixteenths for stretch in self._stretches])[at]
        return np.where(initial | (self.sixteenths(counts) == angles), 0, 1).astype(np.int8)

    def currents_a(self, counts: Int64Array) -> FloatArray:
        """Shape (n, 2): the currents in phases A and B in ampere, positive from OUT_P to OUT_M."""
        at = np.searchsorted(self._from_counts, counts, side="right") - 1
        excitations = np.array([stretch.excitation for stretch in self._stretches])[at]
        angles = self.sixteenths(counts)
        percent = np.zeros((counts.size, 2))
        for excitation, table in PHASE_PERCENT.items():
            chosen = excitations == excitation
            percent[chosen] = table[angles[chosen]]
        scale = self._peak_a * self._torque_percent(counts) / 100 * self._on(counts)
        currents: FloatArray = percent / 100 * scale[:, np.newaxis]
        return currents

    def _torque_percent(self, counts: Int64Array) -> Int64Array:
        high, low = self._levels(Input.TQ2, counts), self._levels(Input.TQ1, counts)
        table = np.array([[TORQUE_PERCENT[tq2, tq1] for tq1 in (0, 1)] for tq2 in (0, 1)], dtype=np.int64)
        chosen: Int64Array = table[high, low]
        return chosen

    def _on(self, counts: Int64Array) -> Int8Array:
        """Whether current flows at all: supplied, enabled and not shut down."""
        enabled = _sampled(counts, *ENABLE_DELAY.passed(*self._edges(Input.ENABLE)))
        shut_down = _sampled(counts, *_arrays(self._shutdowns))
        supplied = self._levels(Input.VDD, counts) & self._levels(Input.VM, counts)
        on: Int8Array = supplied & enabled & (1 - shut_down)
        return on

    def _levels(self, pin: Input, counts: Int64Array) -> Int8Array:
        return _sampled(counts, *self._edges(pin))

    def _edges(self, pin: Input) -> tuple[Int64Array, Int8Array]:
        return _arrays([(change.counts, change.level) for change in self._changes if change.pin is pin])


def _initial(levels: Levels) -> tuple[int, Excitation, bool]:
    excitation = EXCITATIONS[levels[Input.M2], levels[Input.M1]]
    return excitation.initial_sixteenths, excitation, True


def _angle(stretch: _Stretch, steps: int) -> int:
    turned = (steps - stretch.steps_before) * stretch.excitation.step_sixteenths
    return (stretch.sixteenths - turned) % CYCLE_SIXTEENTHS


def _arrays(edges: Sequence[tuple[int, int]]) -> tuple[Int64Array, Int8Array]:
    if not edges:
        return NO_COUNTS, NO_LEVELS
    counts, levels = zip(*edges, strict=True)
    return np.array(counts, dtype=np.int64), np.array(levels, dtype=np.int8)


def _sampled(counts: Int64Array, edges: Int64Array, levels: Int8Array) -> Int8Array:
    """A pin's level at instants in any order, low before its first edge."""
    history = np.concatenate((np.zeros(1, dtype=np.int8), levels))
    return history[np.searchsorted(edges, counts, side="right")]
