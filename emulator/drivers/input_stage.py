"""Pass edges from a module's terminals to its chip's pins, and record violations of the module's limits.

Whether a pulse reaches the chip depends on later edges, within the module's required times. So the stage holds each
pulse until this is certain. The result does not depend on how the input is divided.

The module's couplers have the supply of the chip: when VM falls, ENABLE and CW/CCW at the chip are already low, for any
level at the terminals. ENABLE rises again only when VM is up.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import NO_COUNTS, NO_LEVELS, Int8Array, Int64Array, joined, levels_at
from steptwin.emulator.drivers.driver_module import Module, Switches, delay_of
from steptwin.emulator.drivers.limits import Limit, LimitUnit, Rule, ViolationLog, Violations
from steptwin.emulator.drivers.terminals import LevelChange, Rail, TerminalEdges
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.timer import COUNTS_PER_MS


class Switchboard:
    """The switches and the standstill current circuit of one module."""

    def __init__(self, switches: Switches) -> None:
        self._running, self._idle_levels = switches.running, switches.idle
        self._idle_counts = switches.idle_ms * COUNTS_PER_MS
        self._supplied = False
        self._idle = False
        self._last_rise_counts = 0
        self._turned: list[LevelChange] = []
        """Changes by a user at the switches that are not passed yet."""

    def turn(self, levels: Mapping[str, int], counts: int) -> None:
        """Set switches to levels from an instant on."""
        self._running = {**self._running, **levels}
        if self._supplied:
            self._turned += [LevelChange(counts, pin, levels[pin]) for pin in self._running if pin in levels]

    @property
    def waiting(self) -> bool:
        """True while the standstill current is not set yet."""
        return (self._supplied and not self._idle) or bool(self._turned)

    def changes(self, outside: Sequence[LevelChange], rises: Int64Array, until_counts: int) -> tuple[LevelChange, ...]:
        """Return the changes at the chip's inputs up to an instant, from changes of the board and rises of CLK.

        Of the board's changes, only the supplies and ENABLE reach the chip.
        """
        found, self._turned = self._turned, []
        for change in outside:
            if change.terminal == Rail.VM:
                earlier = int(np.searchsorted(rises, change.counts))
                found += self._idle_changes(rises[:earlier], change.counts)
                found += self._supply(change)
                rises = rises[earlier:]
            elif change.terminal in (Rail.VDD, Pin.ENABLE):
                found.append(change)
        found += self._idle_changes(rises, until_counts)
        return tuple(sorted(found, key=lambda change: change.counts))

    def _supply(self, change: LevelChange) -> list[LevelChange]:
        counts, _, level = change
        self._supplied, self._idle, self._last_rise_counts = bool(level), False, counts
        held = [LevelChange(counts, pin, level and high) for pin, high in self._running.items()]
        return [change, *held] if level else [*reversed(held), change]

    def _idle_changes(self, rises: Int64Array, until_counts: int) -> list[LevelChange]:
        """Return the changes of torque: reduced after the idle time without CLK, full with its next rise."""
        if not self._supplied:
            return []
        changes: list[LevelChange] = []
        if rises.size:
            times = np.concatenate(([self._last_rise_counts], rises))
            for pause in np.flatnonzero(np.diff(times) > self._idle_counts).tolist():
                changes += self._begin(int(times[pause]))
                changes += [LevelChange(int(times[pause + 1]), pin, self._running[pin]) for pin in self._idle_levels]
                self._idle = False
            self._last_rise_counts = int(times[-1])
        if self._last_rise_counts + self._idle_counts < until_counts:
            changes += self._begin(self._last_rise_counts)
        return changes

    def _begin(self, last_rise_counts: int) -> list[LevelChange]:
        if self._idle:
            return []
        self._idle = True
        counts = last_rise_counts + self._idle_counts
        return [LevelChange(counts, pin, level) for pin, level in self._idle_levels.items()]


_LONG_AGO: Final = -(1 << 60)

_CLK_HIGH, _CLK_LOW, _SETUP, _HOLD = 0, 1, 2, 4
"""Indices of the limits. Setup and hold have two limits each, for DIR 0 and 1, because the delays differ."""


class _Pulses(NamedTuple):
    """Pulses: times at the terminals in counts, all arrays of equal length."""

    origins: Int64Array
    """Instants of their steps at the STEP terminal."""
    edges: Int64Array
    low_counts: Int64Array
    """Low time of CLK before each pulse, if the couplers had no delay."""
    high_counts: Int64Array

    def where(self, kept: NDArray[np.bool_] | slice) -> "_Pulses":
        return _Pulses(*(values[kept] for values in self))


class InputStage:
    """The signal path from one module's terminals to its chip's pins."""

    def __init__(self, module: Module, pulse_min_counts: int, *, at_edges: bool) -> None:
        """Create the stage.

        Args:
            module: couplers, required times and switches.
            pulse_min_counts: shortest CLK pulse that the chip counts.
            at_edges: True if a step's instant is its active edge, False if the rise of its pulse.
        """
        self._module, self._at_edges = module, at_edges
        self._clk, self._dir, self._enable = map(delay_of, (module.clk, module.direction, module.enable))
        self._setup_counts, self._hold_counts = self._needed("dirsetup_ns"), max(self._needed("dirhold_ns"), 1)
        self._limits = self._make_limits()
        self._log = ViolationLog(self._limits)
        self._foresight_counts = self._make_foresight(pulse_min_counts)
        self._memory_counts = 3 * sum(
            (
                *(max(limit.value, 0) for limit in self._limits),
                *(delay.longest for delay in (self._clk, self._dir, self._enable)),
                self._foresight_counts,
            )
        )
        """Time after which an edge has no influence."""
        self.meant_steps: int = 0
        """Sum of the decided pulses, each with the sign of DIR at its rise."""
        self._rises, self._falls = NO_COUNTS, NO_COUNTS
        """Edges of the undecided pulses; the last pulse may not have ended."""
        self._unended = self._unended_at_chip = False
        """Two flags: the last decided pulse has not ended; and its rise has been passed to the chip."""
        self._last_fall_counts = _LONG_AGO
        self._dir_counts, self._dir_levels = NO_COUNTS, NO_LEVELS
        self._dir_before = 0
        """Level of DIR before the first stored edge."""
        self._chip_dir_level = 0
        self._changes: list[LevelChange] = []
        self._enable_changes: list[LevelChange] = []
        self._enable_level = self._supplied = 0
        """Levels of EN at the terminal, and of VM."""
        self._switchboard = Switchboard(module.switches) if module.switches else None
        self._passed: list[Int64Array] = []
        self._origins: list[Int64Array] = []

    def _needed(self, name: str) -> int:
        """Return the required time of chip and module in counts, by its name."""
        return max(self._module.times.counts(name), self._module.chip.times.counts(name))

    def _source(self, name: str) -> str:
        """Return the source of a required time: of the module, or of the chip if the module has none."""
        chip, module = getattr(self._module.chip.times, name), getattr(self._module.times, name)
        return self._module.source if chip is None or module is not None else str(chip.source)

    def _make_limits(self) -> tuple[Limit, ...]:
        """Return the module's limits; stricter ones if the couplers would otherwise lose a pulse or a DIR edge."""
        required, clk = self._module.times, self._clk
        width_counts = max(required.counts("steplen_ns"), clk.to_high - clk.to_low + 1)
        space_counts = max(required.counts("stepspace_ns"), clk.to_low - clk.to_high + 1)
        behind_clk = [self._dir.of(level) - clk.to_high for level in (0, 1)]
        setup, hold = self._source("dirsetup_ns"), self._source("dirhold_ns")
        figures = (
            (Rule.CLK_HIGH, width_counts, self._module.source),
            (Rule.CLK_LOW, space_counts, self._module.source),
            *((Rule.DIR_SETUP, self._setup_counts + behind, setup) for behind in behind_clk),
            *((Rule.DIR_HOLD, self._hold_counts - behind, hold) for behind in behind_clk),
        )
        return tuple(Limit(rule, counts, LimitUnit.COUNTS, source) for rule, counts, source in figures)

    def _make_foresight(self, pulse_min_counts: int) -> int:
        """Return the time from a rise of the chip's CLK until its pulse is decided.

        By then the hold time of DIR is over. If a pulse ends when the next one begins, it is also long enough for
        module and chip.
        """
        after_edge = max(limit.value for limit in self._limits[_HOLD:])
        for_chip = pulse_min_counts + self._clk.to_high - self._clk.to_low
        self._width_counts = max(self._limits[_CLK_HIGH].value, for_chip)
        """Shortest high time of a pulse that counts."""
        if self._module.active_edge is ActiveEdge.FALLING:
            after_edge = max(after_edge, self._width_counts)
        return max(after_edge - self._clk.to_high, 0)

    def set_pulse_min(self, pulse_min_counts: int) -> None:
        """Change the shortest CLK pulse that the chip counts."""
        self._foresight_counts = self._make_foresight(pulse_min_counts)

    def begin_high(self, counts: int) -> None:
        """Set STEP high from an instant on, without a pulse."""
        if self._module.active_edge is ActiveEdge.RISING:
            self._unended, self._unended_at_chip = True, False
        else:
            self._rises = np.append(self._rises, counts)

    def turn_switches(self, levels: Mapping[str, int], counts: int) -> None:
        """Set the module's switches for these inputs of the chip from an instant on."""
        if self._switchboard is not None:
            self._switchboard.turn(levels, counts)

    @property
    def held_pulses(self) -> int:
        """Number of undecided pulses."""
        return self._edges.size

    @property
    def held_steps(self) -> int:
        """Sum of the undecided pulses, each with the sign of DIR at its rise."""
        meant = levels_at(self._begun, self._dir_counts, self._dir_levels, self._dir_before)
        return 2 * int(meant.sum(dtype=np.int64)) - meant.size

    @property
    def _edges(self) -> Int64Array:
        """Active edges of the undecided pulses."""
        return self._rises if self._module.active_edge is ActiveEdge.RISING else self._falls

    @property
    def _begun(self) -> Int64Array:
        """Instants of the undecided pulses."""
        return self._edges if self._at_edges else self._rises[: self._edges.size]

    @property
    def waiting(self) -> bool:
        """True while edges have not reached the chip yet."""
        idle_to_come = self._switchboard is not None and self._switchboard.waiting
        return bool(self.held_pulses or self._changes or self._enable_changes or idle_to_come)

    @property
    def violation_count(self) -> int:
        """Number of violations of the module's limits so far."""
        return self._log.count

    @property
    def violations(self) -> Violations:
        """Violations of the module's limits since `forget`."""
        return self._log.all()

    def forget(self) -> None:
        """Drop the recorded pulses and violations, but keep their numbers."""
        self._passed.clear()
        self._origins.clear()
        self._log.forget()

    def origins(self, rises: Int64Array) -> Int64Array:
        """Return the instants at the terminals that belong to rises of the chip's CLK."""
        at = np.searchsorted(joined(self._passed, np.int64), rises)
        found: Int64Array = joined(self._origins, np.int64)[at]
        return found

    def take(self, edges: TerminalEdges) -> TerminalEdges:
        """Return the next stretch of edges at the chip's pins, from that at the terminals."""
        ended = self._remember(edges)
        arrived_counts = edges.until_counts - self._foresight_counts
        settled = self._settled(edges.until_counts, arrived_counts)
        pulses, levels = settled, NO_LEVELS
        if settled.edges.size:  # false for most stretches with motors in the loop, which are one tick long
            meant = levels_at(settled.origins, self._dir_counts, self._dir_levels, self._dir_before)
            self.meant_steps += 2 * int(meant.sum(dtype=np.int64)) - meant.size
            pulses = self._not_lost(settled)
            levels = self._levels(pulses.edges)
        rises = pulses.edges + self._clk.to_high
        changes = self._arrived_changes(rises, arrived_counts)
        dir_counts, dir_levels = self._chip_direction(rises, levels, changes)
        falls = rises + pulses.high_counts + (self._clk.to_low - self._clk.to_high)
        if rises.size:
            self._passed.append(rises)
            self._origins.append(pulses.origins)
        if settled.edges.size > self._falls.size:  # decided before its end
            self._unended = True
            self._unended_at_chip = bool(pulses.edges.size) and pulses.edges[-1] == settled.edges[-1]
            falls = falls[: falls.size - self._unended_at_chip]
        self._forget(settled.edges.size, arrived_counts)
        return TerminalEdges(
            clk_rise_counts=rises,
            clk_fall_counts=np.concatenate((ended, falls)) if ended.size else falls,
            dir_counts=dir_counts,
            dir_levels=dir_levels,
            changes=changes,
            until_counts=arrived_counts,
        )

    # --- memory

    def _remember(self, edges: TerminalEdges) -> Int64Array:
        """Store the edges; return the chip's CLK fall if they end a pulse whose rise has been passed to it."""
        falls, ended = edges.clk_fall_counts, NO_COUNTS
        if self._unended and falls.size:
            self._last_fall_counts = int(falls[0])
            if self._unended_at_chip:
                ended = falls[:1] + self._clk.to_low
            falls, self._unended = falls[1:], False
        if edges.clk_rise_counts.size:
            self._rises = np.concatenate((self._rises, edges.clk_rise_counts))
        if falls.size:
            self._falls = np.concatenate((self._falls, falls))
        if edges.dir_counts.size:
            last = self._dir_levels[-1] if self._dir_levels.size else np.int8(self._dir_before)
            turned = np.diff(edges.dir_levels, prepend=last) != 0
            self._dir_counts = np.concatenate((self._dir_counts, edges.dir_counts[turned]))
            self._dir_levels = np.concatenate((self._dir_levels, edges.dir_levels[turned]))
        for change in edges.changes:
            self._remember_change(change)
        return ended

    def _remember_change(self, change: LevelChange) -> None:
        if change.terminal == Pin.ENABLE:
            self._enable_level = change.level
            if self._supplied:
                self._remember_enable(change)
            return
        if change.terminal == Rail.VM and change.level != self._supplied:
            self._supplied = change.level
            if not change.level:
                self._drop_enable(change.counts)
                self._changes.append(LevelChange(change.counts, Pin.ENABLE, 0))
            elif self._enable_level:
                self._remember_enable(LevelChange(change.counts, Pin.ENABLE, 1))
        self._changes.append(change)

    def _remember_enable(self, change: LevelChange) -> None:
        late = change._replace(counts=change.counts + self._enable.of(change.level))
        self._drop_enable(late.counts)
        self._enable_changes.append(late)

    def _drop_enable(self, counts: int) -> None:
        """Drop changes of ENABLE that have not reached the chip at an instant."""
        while self._enable_changes and self._enable_changes[-1].counts >= counts:
            self._enable_changes.pop()

    def _forget(self, pulses: int, arrived_counts: int) -> None:
        """Drop the decided pulses, and DIR edges that are too old to influence a later pulse."""
        if pulses and not self._unended:
            self._last_fall_counts = int(self._falls[pulses - 1])
        self._rises, self._falls = self._rises[pulses:], self._falls[pulses:]
        old = int(np.searchsorted(self._dir_counts, arrived_counts - self._memory_counts))
        if old:
            self._dir_before = int(self._dir_levels[old - 1])
        self._dir_counts, self._dir_levels = self._dir_counts[old:], self._dir_levels[old:]

    # --- pulses

    def _settled(self, until_counts: int, arrived_counts: int) -> _Pulses:
        """Return the newly decided pulses.

        If the falling edge is active, the chip's CLK is high until the next pulse begins. The last pulse may not have
        ended; it has been high at least until now.
        """
        rises, falls = self._rises, self._falls
        edges, begun = self._edges, self._begun
        if not edges.size:
            return _Pulses(edges, edges, edges, edges)
        settled = int(np.searchsorted(edges + self._clk.to_high, arrived_counts))
        if self._module.active_edge is ActiveEdge.RISING:
            falls_before = np.concatenate(([self._last_fall_counts], falls))[: rises.size]
            falls_after = np.append(falls, until_counts)[: rises.size]
            pulses = _Pulses(begun, edges, rises - falls_before, falls_after - rises)
            if settled > falls.size and pulses.high_counts[-1] < self._width_counts:
                settled -= 1
        else:
            rises_after = np.append(rises, until_counts)[1 : falls.size + 1]
            pulses = _Pulses(begun, edges, falls - rises[: falls.size], rises_after - falls)
        return pulses.where(slice(settled))

    def _not_lost(self, pulses: _Pulses) -> _Pulses:
        too_short = pulses.high_counts < self._limits[_CLK_HIGH].value
        too_soon = pulses.low_counts < self._limits[_CLK_LOW].value
        self._note(_CLK_HIGH, pulses.edges[too_short], pulses.high_counts[too_short])
        self._note(_CLK_LOW, pulses.edges[too_soon], pulses.low_counts[too_soon])
        return pulses.where(~(too_short | too_soon))

    # --- direction

    def _levels(self, edges: Int64Array) -> Int8Array:
        """Return the level of DIR that the chip reads at each CLK rise, one for each active edge.

        Usually it is the level after the coupler. If an active edge violates the module's required times, DIR is read
        at the earliest or latest instant that they leave open.
        """
        if not self._dir_counts.size:
            return np.full(edges.size, self._dir_before, dtype=np.int8)
        rises = edges + self._clk.to_high
        counts, levels = self._dir.passed(self._dir_counts, self._dir_levels)
        read, late, early = (
            levels_at(instants, counts, levels, self._dir_before)
            for instants in (rises, rises - self._setup_counts, rises + (self._hold_counts - 1))
        )
        before = np.searchsorted(self._dir_counts, edges, side="right") - 1
        unset = self._broken(_SETUP, edges, before)
        unheld = self._broken(_HOLD, edges, before + 1)
        return np.where(unset, late, np.where(unheld, early, read))

    def _chip_direction(
        self, rises: Int64Array, levels: Int8Array, changes: tuple[LevelChange, ...]
    ) -> tuple[Int64Array, Int8Array]:
        """Return the edges of CW/CCW at the chip: the level read at each CLK rise, and low when VM falls."""
        off = [change.counts for change in changes if change.terminal == Rail.VM and not change.level]
        if not off and not rises.size:
            return rises, levels
        if off:
            at = np.searchsorted(rises, off)
            rises, levels = np.insert(rises, at, off), np.insert(levels, at, np.zeros(len(off), np.int8))
        turned = np.diff(levels, prepend=np.int8(self._chip_dir_level)) != 0
        self._chip_dir_level = int(levels[-1]) if levels.size else self._chip_dir_level
        return rises[turned], levels[turned]

    def _broken(self, limit: int, edges: Int64Array, turns: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Record and return the active edges too close to a DIR edge; `turns` are its indices, perhaps out of range."""
        broken = np.zeros(edges.size, dtype=np.bool_)
        near = (turns >= 0) & (turns < self._dir_counts.size)
        distances = np.abs(self._dir_counts[turns[near]] - edges[near])
        levels = self._dir_levels[turns[near]]
        for level in (0, 1):
            too_near = (levels == level) & (distances < self._limits[limit + level].value)
            self._note(limit + level, edges[near][too_near], distances[too_near])
            broken[np.flatnonzero(near)[too_near]] = True
        return broken

    def _note(self, limit: int, edges: Int64Array, values: Int64Array) -> None:
        """Record violations at the instants when the chip's CLK rises, or would rise, in order with the chip's own."""
        self._log.note(limit, edges + self._clk.to_high, values)

    # --- inputs that are held at a level

    def _arrived_changes(self, rises: Int64Array, arrived_counts: int) -> tuple[LevelChange, ...]:
        waiting = sorted((*self._changes, *self._enable_changes), key=lambda change: change.counts)
        self._changes = [change for change in self._changes if change.counts >= arrived_counts]
        self._enable_changes = [change for change in self._enable_changes if change.counts >= arrived_counts]
        arrived = tuple(change for change in waiting if change.counts < arrived_counts)
        return self._switchboard.changes(arrived, rises, arrived_counts) if self._switchboard else arrived
