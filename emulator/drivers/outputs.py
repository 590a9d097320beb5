"""Compute a chip's outputs at any instant, from its counted steps and the history of its inputs."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from steptwin.emulator.board.edges import NO_COUNTS, NO_LEVELS, Delay, FloatArray, Int8Array, Int64Array, merged
from steptwin.emulator.drivers.excitation import CYCLE_FULL_STEPS, Excitation, excitations
from steptwin.emulator.drivers.terminals import LevelChange
from steptwin.protocol.drivers import ChipSheet
from steptwin.protocol.timer import counts_of_ns

Levels = Mapping[str, int]

_NEVER: Final = int(np.iinfo(np.int64).min)


class Wiring:
    """The meaning of a chip's input levels, by its sheet, and its full current in ampere."""

    def __init__(self, sheet: ChipSheet, full_a: float) -> None:
        self.sheet: ChipSheet = sheet
        self.full_a: float = full_a
        self.cycle_substeps: int = CYCLE_FULL_STEPS * sheet.substeps
        self.enable_delay: Delay = Delay(
            *(0 if delay is None else counts_of_ns(delay.value) for delay in (sheet.on_delay_ns, sheet.off_delay_ns))
        )
        self._excitations = excitations(sheet)
        self.of_mode: set[str] = {*sheet.modes.value.pins, sheet.logic_rail, "RESET"}
        """Inputs that determine the field angle of a step, or set the home angle."""

    def live(self, levels: Levels) -> int:
        """Return 1 if CLK counts, 0 if the field is in its home state."""
        return levels[self.sheet.logic_rail] & levels["RESET"]

    def supplied(self, levels: Levels) -> int:
        """Return 1 if all supplies are up."""
        return int(all(levels[rail] for rail in self.sheet.rails))

    def excitation(self, levels: Levels, before: Excitation | None = None) -> Excitation:
        """Return the mode that levels select; `before` if the datasheet defines none."""
        microsteps = self.sheet.modes.value.selected(levels)
        if microsteps is None:
            return before or self._excitations[self.sheet.microsteps[0]]
        return self._excitations[microsteps]

    def torque_percent(self, levels: Levels) -> int:
        """Return the percentage of the full current."""
        return self.sheet.torque_percent.value.selected(levels) or 0

    def fast_percent(self, levels: Levels) -> int:
        """Return the percentage of a chopping period with fast decay."""
        return self.sheet.fast_decay_percent.value.selected(levels) or 0

    def home_field(self, levels: Levels, before: Excitation | None = None) -> "Field":
        """Return the field in reset."""
        excitation = self.excitation(levels, before)
        return Field(excitation.initial_substeps, excitation, home=True)


class Field(NamedTuple):
    """Field angle in substeps, and mode; `home` is True while the chip is in reset."""

    substeps: int
    excitation: Excitation
    home: bool


class Origin(NamedTuple):
    """State at the beginning of an output history.

    Attributes:
        levels: levels of the inputs.
        field: field angle and mode.
        shut_down: 1 if the outputs are shut down, else 0.
        from_counts: first instant of `ChipOutputs.instants`.
    """

    levels: Levels
    field: Field
    shut_down: int
    from_counts: int


class _Stretch(NamedTuple):
    """Time stretch in which each step turns the field by the same angle."""

    from_counts: int
    steps_before: int
    field: Field


class _Settings(NamedTuple):
    """Settings from an instant on, selected by the other inputs."""

    from_counts: int
    torque_percent: int
    fast_percent: int
    supplied: int


class ChipOutputs:
    """Bridges and home output of one chip, computed from steps and inputs since an origin.

    Every query takes instants in counts, shape (n,), in any order. Chopping is not modelled: currents are the values to
    which the chopper regulates. In a TB6560 a new value starts with the next edge of the oscillator (page 20), within
    7.7 us at 330 pF.
    """

    def __init__(
        self,
        wiring: Wiring,
        origin: Origin,
        changes: Sequence[LevelChange],
        steps: tuple[Int64Array, Int8Array],
        shutdowns: Sequence[tuple[int, int]],
    ) -> None:
        self._wiring = wiring
        self._origin = origin
        self._changes = tuple(changes)
        self.steps = steps
        """Instants of the field's steps, and their signs, +1 or -1."""
        self._step_counts = steps[0]
        self._turned = np.concatenate(([0], np.cumsum(steps[1], dtype=np.int64)))
        self._shutdowns = shutdowns
        self._stretches = list(self._follow())
        self._from_counts = np.array([stretch.from_counts for stretch in self._stretches], dtype=np.int64)
        self._settings = [self._settings_at(_NEVER, origin.levels)]
        self._settings += [self._settings_at(change.counts, levels) for change, levels in self._levels()]

    def _levels(self) -> Iterator[tuple[LevelChange, Levels]]:
        """Yield each input change, and all levels after it."""
        levels = dict(self._origin.levels)
        for change in self._changes:
            levels[change.terminal] = change.level
            yield change, levels

    def _follow(self) -> Iterator[_Stretch]:
        """Yield the stretches between changes of RESET, logic supply and mode."""
        stretch = _Stretch(_NEVER, 0, self._origin.field)
        yield stretch
        for change, levels in self._levels():
            if change.terminal not in self._wiring.of_mode:
                continue
            steps = int(self._turned[np.searchsorted(self._step_counts, change.counts, side="left")])
            before = stretch.field.excitation
            if self._wiring.live(levels):
                excitation = self._wiring.excitation(levels, before)
                field = Field(excitation.nearest_state(self._angle(stretch, steps)), excitation, home=False)
            else:
                field = self._wiring.home_field(levels, before)
            stretch = _Stretch(change.counts, steps, field)
            yield stretch

    def _settings_at(self, counts: int, levels: Levels) -> _Settings:
        wiring = self._wiring
        return _Settings(counts, wiring.torque_percent(levels), wiring.fast_percent(levels), wiring.supplied(levels))

    def _angle(self, stretch: _Stretch, steps: int) -> int:
        turned = (steps - stretch.steps_before) * stretch.field.excitation.step_substeps
        return (stretch.field.substeps - turned) % self._wiring.cycle_substeps

    def at(self, counts: int, from_counts: int) -> Origin:
        """Return the state at an instant as an origin of a history whose `instants` begin at `from_counts`."""
        levels = dict(self._origin.levels)
        levels |= {change.terminal: change.level for change in self._changes if change.counts < counts}
        stretch = self._stretches[int(np.searchsorted(self._from_counts, counts)) - 1]
        turned = int(self._turned[np.searchsorted(self._step_counts, counts)])
        field = stretch.field._replace(substeps=self._angle(stretch, turned))
        shut_down = [level for at_counts, level in self._shutdowns if at_counts < counts]
        return Origin(levels, field, (shut_down or [self._origin.shut_down])[-1], from_counts)

    def instants(self) -> Int64Array:
        """Return the sorted instants when an output may change; between them none changes.

        An instant before the origin's `from_counts`, reported late, is moved to `from_counts`.
        """
        changes = np.array([change.counts for change in self._changes], dtype=np.int64)
        enabled, _ = self._enabled()
        shut_down, _ = _arrays(self._shutdowns)
        instants = np.concatenate((self._step_counts, changes, enabled, shut_down))
        return merged(np.maximum(instants, self.from_counts))

    @property
    def from_counts(self) -> int:
        """First instant of `instants`: 0, or the end of the history of an earlier origin."""
        return self._origin.from_counts

    def field_substeps(self, counts: Int64Array) -> Int64Array:
        """Return the field angle within its cycle of four full steps; it increases while DIR is low."""
        at = self._stretch_at(counts)
        turned = self._turned[np.searchsorted(self._step_counts, counts, side="right")]
        begun = np.array([stretch.steps_before for stretch in self._stretches], dtype=np.int64)[at]
        fields = [stretch.field for stretch in self._stretches]
        angle = np.array([field.substeps for field in fields], dtype=np.int64)[at]
        step = np.array([field.excitation.step_substeps for field in fields], dtype=np.int64)[at]
        substeps: Int64Array = (angle - (turned - begun) * step) % self._wiring.cycle_substeps
        return substeps

    def _stretch_at(self, counts: Int64Array) -> Int64Array:
        return np.asarray(np.searchsorted(self._from_counts, counts, side="right") - 1, dtype=np.int64)

    def angle_deg(self, counts: Int64Array) -> FloatArray:
        """Return the electrical angle of the field, 0 to below 360 degrees; a cycle is four full steps."""
        return np.asarray(self.field_substeps(counts) * (360 / self._wiring.cycle_substeps), dtype=np.float64)

    def home_levels(self, counts: Int64Array) -> Int8Array:
        """Return the level of the home output with a pull-up; it is active in reset and once per cycle.

        Raises:
            ValueError: the chip has no such output.
        """
        output = self._wiring.sheet.home_output
        if output is None:
            raise ValueError(f"{self._wiring.sheet.name} has no home output")
        at, fields = self._stretch_at(counts), [stretch.field for stretch in self._stretches]
        home = np.array([field.home for field in fields])[at]
        angles = np.array([field.excitation.initial_substeps for field in fields])[at]
        level = output.value.level
        return np.where(home | (self.field_substeps(counts) == angles), level, 1 - level).astype(np.int8)

    def currents_a(self, counts: Int64Array) -> FloatArray:
        """Return the currents of phases A and B in ampere, shape (n, 2), positive from OUT_P to OUT_M."""
        at, angles = self._stretch_at(counts), self.field_substeps(counts)
        modes = np.array([stretch.field.excitation.microsteps for stretch in self._stretches])[at]
        parts = np.zeros((counts.size, 2))
        for excitation in {
            each.field.excitation.microsteps: each.field.excitation for each in self._stretches
        }.values():
            chosen = modes == excitation.microsteps
            parts[chosen] = excitation.parts[excitation.states(angles[chosen])]
        currents: FloatArray = parts * self._amplitudes_a(counts)[:, np.newaxis]
        return currents

    def _amplitudes_a(self, counts: Int64Array) -> FloatArray:
        """Return the current of 100 percent; 0 while no current flows."""
        percent = self._sampled("torque_percent", counts)
        return np.asarray(self._wiring.full_a * percent / 100 * self._on(counts), dtype=np.float64)

    def setting(self, counts: int) -> tuple[Excitation, float]:
        """Return the mode and the current of 100 percent at an instant."""
        at = np.array([counts], dtype=np.int64)
        return self._stretches[int(self._stretch_at(at)[0])].field.excitation, float(self._amplitudes_a(at)[0])

    def fast_decay(self, counts: Int64Array) -> FloatArray:
        """Return the fraction of a chopping period with fast decay."""
        return np.asarray(self._sampled("fast_percent", counts) / 100.0, dtype=np.float64)

    def _on(self, counts: Int64Array) -> Int8Array:
        """Return 1 where current flows (the chip is supplied, enabled and not shut down), else 0."""
        enabled = _level_at(counts, *self._enabled(), self._origin.levels["ENABLE"])
        shut_down = _level_at(counts, *_arrays(self._shutdowns), self._origin.shut_down)
        on: Int8Array = self._sampled("supplied", counts).astype(np.int8) & enabled & (1 - shut_down)
        return on

    def _enabled(self) -> tuple[Int64Array, Int8Array]:
        """Return the edges of ENABLE with the delay until the outputs."""
        edges = [(change.counts, change.level) for change in self._changes if change.terminal == "ENABLE"]
        return self._wiring.enable_delay.passed(*_arrays(edges))

    def _sampled(self, name: str, counts: Int64Array) -> Int64Array:
        """Return a setting at instants in any order."""
        from_counts = np.array([each.from_counts for each in self._settings], dtype=np.int64)
        values = np.array([getattr(each, name) for each in self._settings], dtype=np.int64)
        sampled: Int64Array = values[np.searchsorted(from_counts, counts, side="right") - 1]
        return sampled


def _arrays(edges: Sequence[tuple[int, int]]) -> tuple[Int64Array, Int8Array]:
    if not edges:
        return NO_COUNTS, NO_LEVELS
    counts, levels = zip(*edges, strict=True)
    return np.array(counts, dtype=np.int64), np.array(levels, dtype=np.int8)


def _level_at(counts: Int64Array, edges: Int64Array, levels: Int8Array, before: int) -> Int8Array:
    """Return a level at instants in any order; `before` is the level before the first edge."""
    history = np.concatenate((np.array([before], dtype=np.int8), levels))
    return history[np.searchsorted(edges, counts, side="right")]
