"""Compute the chip's outputs at any instant from its counted steps and the history of its inputs."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import NO_COUNTS, NO_LEVELS, Delay, FloatArray, Int8Array, Int64Array, merged
from steptwin.emulator.drivers.driver_chip import LevelChange, Rail, Terminal
from steptwin.emulator.drivers.tb6560.excitation import CYCLE_SIXTEENTHS, PHASE_PERCENT, Excitation
from steptwin.emulator.drivers.tb6560.pins import EXCITATIONS, FAST_DECAY_PERCENT, TORQUE_PERCENT
from steptwin.protocol.timer import COUNTS_PER_US

SENSE_VOLT: Final = 0.5
"""Voltage at the sense resistor at which charging stops (V_NF, typical, pages 6 to 8)."""

ENABLE_DELAY: Final = Delay(to_high=3 * COUNTS_PER_US, to_low=2 * COUNTS_PER_US)
"""Delay from ENABLE to the outputs (typical, pages 6 to 8)."""

Levels = Mapping[Terminal, int]

_NEVER: Final = int(np.iinfo(np.int64).min)


class Field(NamedTuple):
    """Angle of the field in sixteenths of a full step, and the mode; `initial` is True while the chip is in reset."""

    sixteenths: int
    excitation: Excitation
    initial: bool


class Origin(NamedTuple):
    """State with which the outputs' history begins.

    Attributes:
        levels: levels of the inputs.
        field: angle and mode of the field.
        shut_down: 1 if the outputs are shut down, else 0.
        from_counts: instant from which `Tb6560Outputs.instants` begins.
    """

    levels: Levels
    field: Field
    shut_down: int
    from_counts: int


class OutputSetting(NamedTuple):
    """Mode, and the current of 100 percent in ampere, 0 while the bridges are off."""

    excitation: Excitation
    amplitude_a: float

    def currents_a(self) -> FloatArray:
        """Return the currents of A and B by the field's angle in sixteenths of a full step, shape (64, 2)."""
        return np.asarray(PHASE_PERCENT[self.excitation] / 100 * self.amplitude_a, dtype=np.float64)


class _Stretch(NamedTuple):
    """Time from an instant on in which each step turns the field by the same angle."""

    from_counts: int
    steps_before: int
    field: Field


class Tb6560Outputs:
    """Bridges and MO of one chip, by its steps and inputs since an origin.

    Every query takes instants in counts, shape (n,), in any order. Chopping is not resolved: currents are the values to
    which the chopper regulates. A new value begins with the next edge of the oscillator (page 20), within 7.7 us
    at 330 pF.
    """

    def __init__(
        self,
        origin: Origin,
        changes: Sequence[LevelChange],
        steps: tuple[Int64Array, Int8Array],
        shutdowns: Sequence[tuple[int, int]],
        sense_ohm: float,
    ) -> None:
        self._origin = origin
        self._changes = tuple(changes)
        self.steps = steps
        """Instants when the field was turned, and the signs, +1 or -1."""
        self._step_counts = steps[0]
        self._turned = np.concatenate(([0], np.cumsum(steps[1], dtype=np.int64)))
        self._shutdowns = shutdowns
        self._peak_a = SENSE_VOLT / sense_ohm
        self._stretches = list(self._follow())
        self._from_counts = np.array([stretch.from_counts for stretch in self._stretches], dtype=np.int64)

    def _follow(self) -> Iterator[_Stretch]:
        """Yield the stretches between changes of RESET, VDD and mode."""
        levels = dict(self._origin.levels)
        stretch = _Stretch(_NEVER, 0, self._origin.field)
        yield stretch
        for change in self._changes:
            levels[change.terminal] = change.level
            if change.terminal not in (Pin.RESET, Rail.VDD, Pin.M1, Pin.M2):
                continue
            steps = int(self._turned[np.searchsorted(self._step_counts, change.counts, side="left")])
            if levels[Pin.RESET] and levels[Rail.VDD]:
                excitation = EXCITATIONS[levels[Pin.M2], levels[Pin.M1]]
                state = excitation.nearest_state(_angle(stretch, steps))
                field = Field(state, excitation, initial=False)
            else:
                field = initial_field(levels)
            stretch = _Stretch(change.counts, steps, field)
            yield stretch

    def at(self, counts: int, from_counts: int) -> Origin:
        """Return the state at an instant as an origin, whose `instants` begin at `from_counts`."""
        levels = dict(self._origin.levels)
        levels |= {change.terminal: change.level for change in self._changes if change.counts < counts}
        stretch = self._stretches[int(np.searchsorted(self._from_counts, counts)) - 1]
        turned = int(self._turned[np.searchsorted(self._step_counts, counts)])
        field = stretch.field._replace(sixteenths=_angle(stretch, turned))
        shut_down = [level for at_counts, level in self._shutdowns if at_counts < counts]
        return Origin(levels, field, (shut_down or [self._origin.shut_down])[-1], from_counts)

    def instants(self) -> Int64Array:
        """Return the sorted instants when an output may change; between them none does.

        An instant before the origin's `from_counts`, which has become known only now, is moved to that.
        """
        changes = np.array([change.counts for change in self._changes], dtype=np.int64)
        enabled, _ = ENABLE_DELAY.passed(*self._edges(Pin.ENABLE))
        shut_down, _ = _arrays(self._shutdowns)
        instants = np.concatenate((self._step_counts, changes, enabled, shut_down))
        return merged(np.maximum(instants, self.from_counts))

    @property
    def from_counts(self) -> int:
        """Instant from which `instants` begins: 0, or the end of those of an earlier origin."""
        return self._origin.from_counts

    def field_substeps(self, counts: Int64Array) -> Int64Array:
        """Return the field's angle in sixteenths of a full step, 0 to 63; it grows clockwise, with DIR low."""
        at = np.searchsorted(self._from_counts, counts, side="right") - 1
        turned = self._turned[np.searchsorted(self._step_counts, counts, side="right")]
        begun = np.array([stretch.steps_before for stretch in self._stretches], dtype=np.int64)[at]
        fields = [stretch.field for stretch in self._stretches]
        angle = np.array([field.sixteenths for field in fields], dtype=np.int64)[at]
        step = np.array([field.excitation.step_sixteenths for field in fields], dtype=np.int64)[at]
        sixteenths: Int64Array = (angle - (turned - begun) * step) % CYCLE_SIXTEENTHS
        return sixteenths

    def angle_deg(self, counts: Int64Array) -> FloatArray:
        """Return the field's electrical angle, 0 to below 360 degrees; a cycle is four full steps."""
        return np.asarray(self.field_substeps(counts) * (360 / CYCLE_SIXTEENTHS), dtype=np.float64)

    def mo_levels(self, counts: Int64Array) -> Int8Array:
        """Return the MO pin with a pull-up: low in reset, and in the initial state, which comes once a cycle."""
        at = np.searchsorted(self._from_counts, counts, side="right") - 1
        initial = np.array([stretch.field.initial for stretch in self._stretches])[at]
        angles = np.array([stretch.field.excitation.initial_sixteenths for stretch in self._stretches])[at]
        return np.where(initial | (self.field_substeps(counts) == angles), 0, 1).astype(np.int8)

    def currents_a(self, counts: Int64Array) -> FloatArray:
        """Return the currents in phases A and B in ampere, shape (n, 2), positive from OUT_P to OUT_M."""
        at = np.searchsorted(self._from_counts, counts, side="right") - 1
        excitations = np.array([stretch.field.excitation for stretch in self._stretches])[at]
        angles = self.field_substeps(counts)
        percent = np.zeros((counts.size, 2))
        for excitation, table in PHASE_PERCENT.items():
            chosen = excitations == excitation
            percent[chosen] = table[angles[chosen]]
        currents: FloatArray = percent / 100 * self._amplitudes_a(counts)[:, np.newaxis]
        return currents

    def _amplitudes_a(self, counts: Int64Array) -> FloatArray:
        """Return the current of 100 percent, 0 while no current flows."""
        return np.asarray(self._peak_a * self._torque_percent(counts) / 100 * self._on(counts), dtype=np.float64)

    def setting(self, counts: int) -> "OutputSetting":
        """Return what holds at an instant beside the field's angle."""
        at = int(np.searchsorted(self._from_counts, counts, side="right")) - 1
        amplitude_a = self._amplitudes_a(np.array([counts], dtype=np.int64))
        return OutputSetting(self._stretches[at].field.excitation, float(amplitude_a[0]))

    def _torque_percent(self, counts: Int64Array) -> Int64Array:
        high, low = self._levels(Pin.TQ2, counts), self._levels(Pin.TQ1, counts)
        table = np.array([[TORQUE_PERCENT[tq2, tq1] for tq1 in (0, 1)] for tq2 in (0, 1)], dtype=np.int64)
        chosen: Int64Array = table[high, low]
        return chosen

    def fast_decay(self, counts: Int64Array) -> FloatArray:
        """Return the fraction of a chopping period in which the current decays fast."""
        high, low = self._levels(Pin.DCY2, counts), self._levels(Pin.DCY1, counts)
        table = np.array([[FAST_DECAY_PERCENT[dcy2, dcy1] for dcy1 in (0, 1)] for dcy2 in (0, 1)])
        return np.asarray(table[high, low] / 100.0, dtype=np.float64)

    def _on(self, counts: Int64Array) -> Int8Array:
        """Return 1 where current flows: the chip is supplied, enabled and not shut down; else 0."""
        before = self._origin.levels[Pin.ENABLE]
        enabled = _sampled(counts, *ENABLE_DELAY.passed(*self._edges(Pin.ENABLE)), before)
        shut_down = _sampled(counts, *_arrays(self._shutdowns), self._origin.shut_down)
        supplied = self._levels(Rail.VDD, counts) & self._levels(Rail.VM, counts)
        on: Int8Array = supplied & enabled & (1 - shut_down)
        return on

    def _levels(self, pin: Terminal, counts: Int64Array) -> Int8Array:
        return _sampled(counts, *self._edges(pin), self._origin.levels[pin])

    def _edges(self, pin: Terminal) -> tuple[Int64Array, Int8Array]:
        return _arrays([(change.counts, change.level) for change in self._changes if change.terminal is pin])


def initial_field(levels: Levels) -> Field:
    """Return the field in reset."""
    excitation = EXCITATIONS[levels[Pin.M2], levels[Pin.M1]]
    return Field(excitation.initial_sixteenths, excitation, initial=True)


def _angle(stretch: _Stretch, steps: int) -> int:
    turned = (steps - stretch.steps_before) * stretch.field.excitation.step_sixteenths
    return (stretch.field.sixteenths - turned) % CYCLE_SIXTEENTHS


def _arrays(edges: Sequence[tuple[int, int]]) -> tuple[Int64Array, Int8Array]:
    if not edges:
        return NO_COUNTS, NO_LEVELS
    counts, levels = zip(*edges, strict=True)
    return np.array(counts, dtype=np.int64), np.array(levels, dtype=np.int8)


def _sampled(counts: Int64Array, edges: Int64Array, levels: Int8Array, before: int) -> Int8Array:
    """Return a pin's level at instants in any order; `before` is its level before the first edge."""
    history = np.concatenate((np.array([before], dtype=np.int8), levels))
    return history[np.searchsorted(edges, counts, side="right")]
