"""Model the wires from a board's pins STEP, DIR and ENABLE to the terminals of one driver.

A wire is whole, broken, shorted to a level, or noisy. A broken wire leaves its terminal open: the pull-down of the
chip's pin, or the optocoupler without current, determines the level. Noise inverts the level for a short time at random
instants, drawn from a seed. So equal conditions give equal edges, however time is divided.

A condition begins and ends at the start of a servo tick, because pulses are computed ahead. A pulse that has begun
before passes completely.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from random import Random
from typing import Final

import numpy as np

from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import NO_COUNTS, NO_LEVELS, Int8Array, Int64Array, levels_at
from steptwin.emulator.drivers.terminals import LevelChange, TerminalEdges
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.timer import COUNTS_PER_SECOND, counts_of_ns

NOISE_RATE_MAX_HZ: Final = 1_000_000


class Wire(StrEnum):
    """A wire from the board to a driver."""

    STEP = "step"
    DIR = "dir"
    ENABLE = "enable"


class WireState(StrEnum):
    """State of a wire: passes the board's level or not."""

    WHOLE = "whole"
    BROKEN = "broken"
    LOW = "low"
    """Shorted to ground."""
    HIGH = "high"
    """Shorted to the logic supply."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Disturbances of a wire at random instants; each inverts its level for a time.

    Attributes:
        rate_hz: mean number per second.
        width_ns: duration of each disturbance.
        count: number of disturbances; None for no end.
        seed: seed of the instants; the pauses are uniformly distributed from 0 to twice their mean.

    Raises:
        ValueError: the rate or the width is not positive, the disturbances do not fit into their rate, or the count is
            0.
    """

    rate_hz: float
    width_ns: int
    count: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.rate_hz <= NOISE_RATE_MAX_HZ:
            raise ValueError(f"rate_hz {self.rate_hz:g} is not above 0 and up to {NOISE_RATE_MAX_HZ}")
        if self.width_ns <= 0:
            raise ValueError(f"width_ns {self.width_ns} is not positive")
        if self.pause_counts < 1:
            longest_ns = round(1e9 / self.rate_hz)
            raise ValueError(f"width_ns {self.width_ns} leaves no pause at {self.rate_hz:g} Hz: below {longest_ns}")
        if self.count is not None and self.count < 1:
            raise ValueError(f"count {self.count} is not 1 or more")

    @property
    def width_counts(self) -> int:
        """Duration of each disturbance in counts."""
        return counts_of_ns(self.width_ns)

    @property
    def pause_counts(self) -> int:
        """Mean pause between two disturbances in counts."""
        return round(COUNTS_PER_SECOND / self.rate_hz) - self.width_counts

    def flips(self, from_counts: int) -> Iterator[int]:
        """Yield the instants after `from_counts` at which the level toggles: begin and end of each disturbance."""
        random, at, left = Random(self.seed), from_counts, self.count
        while left is None or left > 0:
            at += random.randint(1, 2 * self.pause_counts - 1)
            yield at
            at += self.width_counts
            yield at
            left = None if left is None else left - 1


Condition = WireState | Noise
"""Condition of a wire."""


class _Line:
    """One wire: converts the instants when the board's pin toggles to those of the terminal."""

    def __init__(self, level: int, open_level: int) -> None:
        self.pin_level = self.level = level
        """Levels of the board's pin and of the terminal, after all processed edges."""
        self._open_level = open_level
        self.condition: Condition = WireState.WHOLE
        self._ahead = NO_COUNTS
        """Toggles of the pin that noise may still precede."""
        self._flips: Iterator[int] = iter(())
        self._next_flip: int | None = None
        self._free_counts = 0
        """First instant after all toggles of the terminal."""

    @property
    def noisy(self) -> bool:
        """True while noise may still toggle the level, or pulses wait for it."""
        return self._next_flip is not None or bool(self._ahead.size)

    def change(self, condition: Condition, counts: int) -> Int64Array:
        """Set the condition from an instant on; return the toggle of the terminal that this causes, if any."""
        self.condition = condition
        self._flips = condition.flips(counts) if isinstance(condition, Noise) else iter(())
        self._next_flip = next(self._flips, None)
        return self._turned(np.array([max(counts, self._free_counts)] if self._wanted != self.level else [], np.int64))

    @property
    def _wanted(self) -> int:
        """Level of the terminal between disturbances."""
        if self.condition is WireState.BROKEN:
            return self._open_level
        if self.condition in (WireState.LOW, WireState.HIGH):
            return int(self.condition is WireState.HIGH)
        return self.pin_level

    def take(self, turns: Int64Array, until_counts: int) -> Int64Array:
        """Return the terminal's toggles up to an instant, from those of the pin."""
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
    """Return the sorted instants with an odd number of toggles; an even number does not change the level."""
    instants, numbers = np.unique(turns, return_counts=True)
    odd: Int64Array = instants[numbers % 2 == 1]
    return odd


class _PulseCounter:
    """Counts pulses after their active edges, each with the sign of DIR at its instant."""

    def __init__(self, active_edge: ActiveEdge, dir_level: int, *, at_edges: bool) -> None:
        self._by_falls = active_edge is ActiveEdge.FALLING
        self._at_falls = self._by_falls and at_edges
        self._dir_level = dir_level
        self._begun = NO_LEVELS
        """Signs of the pulses whose active edge has not occurred yet."""

    def take(self, pins: TerminalEdges) -> int:
        """Return the signed sum of the pulses in the next stretch of edges."""
        instants = pins.clk_fall_counts if self._at_falls else pins.clk_rise_counts
        levels = levels_at(instants, pins.dir_counts, pins.dir_levels, self._dir_level)
        if pins.dir_levels.size:
            self._dir_level = int(pins.dir_levels[-1])
        signs = np.concatenate((self._begun, 2 * levels - 1))
        come = pins.clk_fall_counts.size if self._by_falls else signs.size
        self._begun = signs[come:]
        return int(signs[:come].sum(dtype=np.int64))


class AxisWires:
    """The wires to one driver. It is created with the first faulty wire; before, all edges pass directly."""

    def __init__(
        self,
        active_edge: ActiveEdge,
        *,
        enable_open: int,
        step_level: int,
        dir_level: int,
        enable_level: int,
        at_edges: bool = False,
    ) -> None:
        """Begin with whole wires.

        Args:
            active_edge: edge of STEP that triggers a step.
            enable_open: level of ENABLE at the driver if nothing is connected.
            step_level: present level of STEP.
            dir_level: present level of DIR.
            enable_level: present level of ENABLE.
            at_edges: True if a pulse's instant is its active edge, False if its rise.
        """
        self._step, self._dir, self._enable = (
            _Line(step_level, 0),
            _Line(dir_level, 0),
            _Line(enable_level, enable_open),
        )
        self._lines = {Wire.STEP: self._step, Wire.DIR: self._dir, Wire.ENABLE: self._enable}
        self._rise = NO_COUNTS
        """Rise of a pulse at the STEP terminal that noise may end early; it is held until the pulse ends."""
        self._step_passed_level = step_level
        self._dir_ahead = NO_COUNTS
        """Toggles of the DIR terminal after that rise."""
        self._dir_pin_level, self._enable_pin_level = dir_level, enable_level
        self._dir_passed_level = dir_level
        self._enable_turns: list[int] = []
        """Toggles of the board's ENABLE that have not been passed yet."""
        self._at_pins, self._at_terminals = (_PulseCounter(active_edge, dir_level, at_edges=at_edges) for _ in range(2))
        self.lost_steps: int = 0
        """Steps at the board's pins minus steps at the terminals, each with the sign of DIR at the same place."""

    @property
    def noisy(self) -> bool:
        """True while edges may occur that the board has not made."""
        return any(line.noisy for line in self._lines.values())

    @property
    def waiting(self) -> bool:
        """True while the wires must be fed as time advances, even without new edges."""
        return self.noisy or bool(self._enable_turns)

    @property
    def held_pulses(self) -> int:
        """Number of begun pulses that have not reached the driver."""
        return self._rise.size

    def set_enable(self, counts: int, level: int) -> None:
        """Set the board's ENABLE; the next `take` passes the change."""
        if level != self._enable_pin_level:
            self._enable_pin_level = level
            self._enable_turns.append(counts)

    def change(self, wire: Wire, condition: Condition, counts: int) -> TerminalEdges:
        """Set the condition of a wire from an instant on; all edges before it must have been taken."""
        turns = self._lines[wire].change(condition, counts)
        made = {each: turns if each is wire else NO_COUNTS for each in Wire}
        return self._pass_on(made[Wire.STEP], made[Wire.DIR], made[Wire.ENABLE], (), counts)

    def take(self, pins: TerminalEdges) -> TerminalEdges:
        """Return the next stretch of edges at the terminals, from that at the board's pins."""
        self.lost_steps += self._at_pins.take(pins)
        turned = np.diff(pins.dir_levels, prepend=np.int8(self._dir_pin_level)) != 0
        if pins.dir_levels.size:
            self._dir_pin_level = int(pins.dir_levels[-1])
        edges = np.sort(np.concatenate((pins.clk_rise_counts, pins.clk_fall_counts)))
        enable_turns, self._enable_turns = np.array(self._enable_turns, np.int64), []
        until_counts = pins.until_counts
        return self._pass_on(
            self._step.take(edges, until_counts),
            self._dir.take(pins.dir_counts[turned], until_counts),
            self._enable.take(enable_turns, until_counts),
            pins.changes,
            until_counts,
        )

    # --- the terminals

    def _pass_on(
        self,
        step: Int64Array,
        direction: Int64Array,
        enable: Int64Array,
        changes: tuple[LevelChange, ...],
        until_counts: int,
    ) -> TerminalEdges:
        """Return a stretch of edges from toggles at the terminals and changes of other inputs."""
        step, certain_counts = self._certain(step, until_counts)
        turns = np.concatenate((self._dir_ahead, direction))
        certain = int(np.searchsorted(turns, certain_counts)) if certain_counts < until_counts else turns.size
        turns, self._dir_ahead = turns[:certain], turns[certain:]
        switched = _enable_changes(enable, self._enable.level)
        level = self._step_passed_level
        passed = TerminalEdges(
            clk_rise_counts=step[level::2],
            clk_fall_counts=step[1 - level :: 2],
            dir_counts=turns,
            dir_levels=_levels(turns, self._dir_passed_level),
            changes=tuple(sorted((*switched, *changes), key=lambda change: change.counts)),
            until_counts=certain_counts,
        )
        self._step_passed_level ^= step.size & 1
        self.lost_steps -= self._at_terminals.take(passed)
        self._dir_passed_level ^= turns.size & 1
        return passed

    def _certain(self, turns: Int64Array, until_counts: int) -> tuple[Int64Array, int]:
        """Return the toggles of the STEP terminal that are certain, and the instant up to which they are complete.

        A pulse that begins close to noise is held until it ends, and so is everything after it.
        """
        turns = np.concatenate((self._rise, turns))
        passed = turns.size - (self._step.level if turns.size and isinstance(self._step.condition, Noise) else 0)
        turns, self._rise = turns[:passed], turns[passed:]
        return turns, min(int(self._rise[0]), until_counts) if self._rise.size else until_counts


def _levels(turns: Int64Array, before: int) -> Int8Array:
    """Return the level after each toggle."""
    levels: Int8Array = ((before + 1 + np.arange(turns.size)) % 2).astype(np.int8)
    return levels


def _enable_changes(turns: Int64Array, after: int) -> list[LevelChange]:
    """Return the changes of ENABLE whose last one ends at the level `after`."""
    levels = _levels(turns, after ^ (turns.size & 1)).tolist()
    return [LevelChange(counts, Pin.ENABLE, level) for counts, level in zip(turns.tolist(), levels, strict=True)]
