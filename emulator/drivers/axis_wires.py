"""Model faults of the wires from a board's pins STEP, DIR and ENABLE to the terminals of one driver.

A wire is whole, broken, held at a level, or noisy. A broken one leaves its terminal open: the pull-down of the chip's
pin, or the optocoupler without current, gives the level. Noise turns the level over for a short time at random
instants, drawn from a seed, so that equal faults give equal edges; they do not depend on how time is divided.

A fault begins and ends at the start of a servo tick, because pulses are computed ahead. A pulse that has begun before
it passes whole.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import NO_COUNTS, Int8Array, Int64Array, levels_at
from steptwin.emulator.drivers.terminals import LevelChange, TerminalEdges
from steptwin.emulator.faults.wiring import Condition, Noise, Wire, WireState
from steptwin.protocol.drivers import ActiveEdge


class _Line:
    """One wire: takes the instants when the board's pin turns over, and returns those of the terminal."""

    def __init__(self, level: int, open_level: int) -> None:
        self.pin_level = self.level = level
        """Levels of the board's pin and of the terminal, after all that has been passed on."""
        self._open_level = open_level
        self.condition: Condition = WireState.WHOLE
        self._ahead = NO_COUNTS
        """Turns of the pin that noise may still precede."""
        self._flips: Iterator[int] = iter(())
        self._next_flip: int | None = None
        self._free_counts = 0
        """First instant that is later than all turns of the terminal."""

    @property
    def noisy(self) -> bool:
        """True while noise may still turn the level over, or pulses wait for it."""
        return self._next_flip is not None or bool(self._ahead.size)

    def change(self, condition: Condition, counts: int) -> Int64Array:
        """Let the wire be like this from an instant on; return the terminal's turn, if that makes one."""
        self.condition = condition
        self._flips = condition.flips(counts) if isinstance(condition, Noise) else iter(())
        self._next_flip = next(self._flips, None)
        return self._turned(np.array([max(counts, self._free_counts)] if self._wanted != self.level else [], np.int64))

    @property
    def _wanted(self) -> int:
        """The terminal's level between disturbances."""
        if self.condition is WireState.BROKEN:
            return self._open_level
        if self.condition in (WireState.LOW, WireState.HIGH):
            return int(self.condition is WireState.HIGH)
        return self.pin_level

    def take(self, turns: Int64Array, until_counts: int) -> Int64Array:
        """Return the terminal's turns that follow from the pin's up to an instant."""
        turns = np.concatenate((self._ahead, turns))
        passed = int(np.searchsorted(turns, until_counts)) if isinstance(self.condition, Noise) else turns.size
        turns, self._ahead = turns[:passed], turns[passed:]
        self.pin_level ^= turns.size & 1
        if isinstance(self.condition, WireState) and self.condition is not WireState.WHOLE:
            return NO_COUNTS
        flips = []
        while self._next_flip is not None and self._next_flip < until_counts:
            flips.append(self._next_flip)
            self._next_flip = next(self._flips, None)
        return self._turned(_odd(np.concatenate((turns, np.array(flips, np.int64)))) if flips else turns)

    def _turned(self, turns: Int64Array) -> Int64Array:
        if turns.size:
            self.level ^= turns.size & 1
            self._free_counts = int(turns[-1]) + 1
        return turns


def _odd(turns: Int64Array) -> Int64Array:
    """Return the sorted instants when an odd number of turns meet: an even number leaves the level as it is."""
    instants, numbers = np.unique(turns, return_counts=True)
    odd: Int64Array = instants[numbers % 2 == 1]
    return odd


class Passed(NamedTuple):
    """A stretch of edges behind the wires: what the driver is told, and what is recorded of its terminals.

    They differ where STEP is held high: the driver takes the rise at once, with a pulse that is long enough for every
    driver, but its end is known only when the wire is repaired.
    """

    told: TerminalEdges
    recorded: TerminalEdges


class AxisWires:
    """The wires to one driver. It is made with the first fault: until then the edges pass by themselves."""

    def __init__(self, active_edge: ActiveEdge, *, enable_open: int, dir_level: int, enable_level: int) -> None:
        """Begin with whole wires.

        Args:
            active_edge: edge of STEP that makes the driver's step.
            enable_open: level that ENABLE has for the driver if nothing is connected.
            dir_level: present level of DIR.
            enable_level: present level of ENABLE.
        """
        self._active_edge = active_edge
        self._step, self._dir, self._enable = _Line(0, 0), _Line(dir_level, 0), _Line(enable_level, enable_open)
        self._lines = {Wire.STEP: self._step, Wire.DIR: self._dir, Wire.ENABLE: self._enable}
        self._rise: int | None = None
        """The beginning of a pulse at the STEP terminal whose end is not known."""
        self._told = self._recorded = False
        """Whether the driver has been told of that pulse, and whether it has been recorded up to an earlier end."""
        self._dir_ahead = NO_COUNTS
        """Turns of the DIR terminal that come after that pulse's beginning."""
        self._dir_pin_level, self._enable_pin_level = dir_level, enable_level
        self._dir_told_level = dir_level
        self._enable_turns: list[int] = []
        """Turns of the board's ENABLE that have not been passed on."""
        self.lost_steps: int = 0
        """Steps at the board's pins less steps at the terminals, each signed by DIR at the same place."""

    @property
    def noisy(self) -> bool:
        """True while edges may come that the board has not made."""
        return any(line.noisy for line in self._lines.values())

    @property
    def waiting(self) -> bool:
        """True while the wires must be fed so that time advances, even without new edges."""
        return self.noisy or bool(self._enable_turns)

    @property
    def held_pulses(self) -> int:
        """Number of pulses that have begun, and that the driver does not know yet."""
        return int(self._rise is not None and not self._told)

    def set_enable(self, counts: int, level: int) -> None:
        """Put the board's ENABLE to a level; the next `take` passes it on."""
        if level != self._enable_pin_level:
            self._enable_pin_level = level
            self._enable_turns.append(counts)

    def change(self, wire: Wire, condition: Condition, counts: int) -> Passed:
        """Let a wire be like this from an instant on, up to which all edges have been taken."""
        turns = self._lines[wire].change(condition, counts)
        made = {each: turns if each is wire else NO_COUNTS for each in Wire}
        return self._pass_on(made[Wire.STEP], made[Wire.DIR], made[Wire.ENABLE], (), counts)

    def take(self, pins: TerminalEdges) -> Passed:
        """Take the next stretch of edges at the board's pins; return the next stretch at the terminals."""
        self.lost_steps += _steps(pins, self._dir_pin_level)
        turned = np.diff(pins.dir_levels, prepend=np.int8(self._dir_pin_level)) != 0
        if pins.dir_levels.size:
            self._dir_pin_level = int(pins.dir_levels[-1])
        edges = np.column_stack((pins.clk_rise_counts, pins.clk_fall_counts)).ravel()
        enable_turns, self._enable_turns = np.array(self._enable_turns, np.int64), []
        until_counts = pins.until_counts
        return self._pass_on(
            self._step.take(edges, until_counts),
            self._dir.take(pins.dir_counts[turned], until_counts),
            self._enable.take(enable_turns, until_counts),
            pins.changes,
            until_counts,
        )

    def forget(self, until_counts: int) -> None:
        """Remember that a pulse without an end is recorded up to here, so that `with_open_pulse` adds it once only."""
        self._recorded = self._rise is not None and self._rise < until_counts

    def with_open_pulse(self, rises: Int64Array, falls: Int64Array, until_counts: int) -> tuple[Int64Array, Int64Array]:
        """Add the pulse whose end is not known to those recorded, as if it ended now, unless that was done before."""
        if self._rise is None or self._recorded or self._rise >= until_counts:
            return rises, falls
        return np.append(rises, self._rise), np.append(falls, until_counts)

    # --- the terminals

    def _pass_on(
        self,
        step: Int64Array,
        direction: Int64Array,
        enable: Int64Array,
        changes: tuple[LevelChange, ...],
        until_counts: int,
    ) -> Passed:
        """Return a stretch with these turns at the terminals, and these changes of other inputs."""
        pulses, known_counts = self._pulses(step, until_counts)
        turns = np.concatenate((self._dir_ahead, direction))
        known = int(np.searchsorted(turns, known_counts)) if known_counts < until_counts else turns.size
        turns, self._dir_ahead = turns[:known], turns[known:]
        switched = _enable_changes(enable, self._enable.level)
        recorded = TerminalEdges(
            clk_rise_counts=pulses[0::2],
            clk_fall_counts=pulses[1::2],
            dir_counts=turns,
            dir_levels=_levels(turns, self._dir_told_level),
            changes=tuple(sorted((*switched, *changes), key=lambda change: change.counts)),
            until_counts=known_counts,
        )
        told = self._tell(recorded)
        self.lost_steps -= _steps(told, self._dir_told_level)
        self._dir_told_level ^= turns.size & 1
        if self._recorded and pulses.size:
            recorded, self._recorded = _without_first_pulse(recorded), False
        return Passed(told, recorded)

    def _pulses(self, turns: Int64Array, until_counts: int) -> tuple[Int64Array, int]:
        """Return the turns of whole pulses, and the instant up to which all is known.

        A pulse that noise has begun waits for its end, and with it all that comes later.
        """
        begun = [] if self._rise is None else [self._rise]
        turns = np.concatenate((np.array(begun, np.int64), turns))
        whole = turns.size // 2 * 2
        self._rise = int(turns[-1]) if turns.size > whole else None
        waits = self._rise is not None and self._step.condition is not WireState.HIGH
        return turns[:whole], min(self._rise, until_counts) if waits and self._rise is not None else until_counts

    def _tell(self, pins: TerminalEdges) -> TerminalEdges:
        """Return what the driver is told of a stretch: not again the pulse that it knows, but one held high."""
        if self._told and pins.clk_rise_counts.size:
            pins, self._told = _without_first_pulse(pins), False
        held = self._rise is not None and self._step.condition is WireState.HIGH
        if held and self._rise is not None and not self._told and self._active_edge is ActiveEdge.RISING:
            pins, self._told = _with_pulse(pins, self._rise), True
        return pins


def _steps(pins: TerminalEdges, dir_level: int) -> int:
    """Return the number of pulses, each signed by DIR at its rise; DIR is at this level before them."""
    levels = levels_at(pins.clk_rise_counts, pins.dir_counts, pins.dir_levels, dir_level)
    return 2 * int(levels.sum(dtype=np.int64)) - levels.size


def _levels(turns: Int64Array, before: int) -> Int8Array:
    """Return the level after each turn."""
    levels: Int8Array = ((before + 1 + np.arange(turns.size)) % 2).astype(np.int8)
    return levels


def _enable_changes(turns: Int64Array, after: int) -> list[LevelChange]:
    """Return the changes of ENABLE, which has this level after them."""
    levels = _levels(turns, after ^ (turns.size & 1)).tolist()
    return [LevelChange(counts, Pin.ENABLE, level) for counts, level in zip(turns.tolist(), levels, strict=True)]


def _without_first_pulse(pins: TerminalEdges) -> TerminalEdges:
    return replace(pins, clk_rise_counts=pins.clk_rise_counts[1:], clk_fall_counts=pins.clk_fall_counts[1:])


def _with_pulse(pins: TerminalEdges, rise: int) -> TerminalEdges:
    """Return the stretch with one more pulse, which lasts almost a tick: longer than any driver needs."""
    return replace(
        pins,
        clk_rise_counts=np.append(pins.clk_rise_counts, rise),
        clk_fall_counts=np.append(pins.clk_fall_counts, rise + TICK_COUNTS - 1),
    )
