"""Inputs of a board: their levels, and the ticks when the firmware must read them.

The firmware reads its inputs at the start of each servo tick. Because pulses are computed many ticks at a time, this
module determines the next tick when an input can change. A switch at a distance of d steps keeps its level until
the driver has received d more pulses. Two bounds apply: the driver's highest step rate, and the running segment of the
firmware, which makes no step before it crosses the next threshold. The travel of a step depends on the driver's mode,
which changes only at standstill; it is read at each start.

The firmware sees a bounce only if a start of a tick falls into it.
"""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from random import Random

import numpy as np

from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.board.board_firmware import BoardPulses
from steptwin.emulator.board.edges import Int64Array
from steptwin.emulator.drivers.terminals import Moves, SubstepArray
from steptwin.emulator.world.switches import AxisSwitches, Switch, Travel
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.timer import COUNTS_PER_US


class Bouncer:
    """Bouncing contact of one switch, evaluated at the start of ticks."""

    def __init__(self, bounces: int, within_us: int, seed: int, *, closed: bool) -> None:
        self._bounces = bounces
        self._within_counts = within_us * COUNTS_PER_US
        self._random = Random(seed)
        self._closed = closed
        self._turns: list[int] = []
        """Instants, in order, when the contact toggles after its last change."""

    def inverted(self, tick: int, *, closed: bool) -> bool:
        """Return whether the input is inverted at a tick by a bounce; `closed` is the switch's state by position."""
        now_counts = tick * TICK_COUNTS
        if closed != self._closed:
            self._closed = closed
            turns = self._random.sample(range(1, self._within_counts), 2 * self._bounces)
            self._turns = sorted(now_counts + turn for turn in turns)
        return bisect_right(self._turns, now_counts) % 2 == 1

    def next_tick(self, tick: int) -> int | None:
        """Return the next tick after `tick` when the input may change; None if the bounce is over."""
        if not self._turns or self._turns[-1] <= tick * TICK_COUNTS:
            return None
        turn = self._turns[bisect_right(self._turns, tick * TICK_COUNTS)]
        return -(-turn // TICK_COUNTS)


class BoardInputs:
    """Inputs of all axes; their switches follow the rotors. Positions are in the drivers' substeps."""

    def __init__(
        self,
        switches: Sequence[Switch],
        start_substeps: Sequence[int],
        travels: Sequence[Travel],
        period_min_counts: int,
    ) -> None:
        """Begin at the start positions; without `travels` the switches of each axis follow its own rotor."""
        self._period_min_counts = period_min_counts
        """Shortest time between two pulses that a driver counts."""
        self.emergency_stop = False
        self.torque_off = False
        self.of_drivers: list[DigitalInput] = [DigitalInput(0)] * len(start_substeps)
        """Input of each axis' driver: its Protect pin is low, or its fault output is active."""
        self._general = [DigitalInput(0)] * len(start_substeps)
        """Active general inputs of each axis."""
        self._travels = list(travels) or [Travel.of_rotor(axis) for axis in range(len(start_substeps))]
        self._rotors_substeps = list(start_substeps)
        """Position of each rotor up to which the switches have followed."""
        self._axes = [
            AxisSwitches(
                [switch for switch in switches if switch.axis == axis], travel.position_substeps(start_substeps)
            )
            for axis, travel in enumerate(self._travels)
        ]
        self._switched = [axis for axis, switches in enumerate(self._axes) if switches]
        self._followed = self._rotors_of(self._switched)
        """Axes whose rotors move along a travel with switches."""
        self._coupled = {axis: self._coupled_with(axis) for axis in self._switched}
        """By axis, the axes whose switches must be read together, because their travels share rotors."""
        self._ahead: list[list[Moves]] = [[] for _ in self._axes]
        """By axis, rotor moves (instants, substeps) that the switches have not followed yet."""
        self._held_pulses = [0] * len(start_substeps)
        """By axis, number of pulses that the driver may still count."""
        self._step_substeps = [1] * len(start_substeps)
        """By axis, size of the driver's present step."""
        self._just_started: set[int] = set()
        """Axes started since `look`; the size of their drivers' steps may have changed."""
        self._due_ticks: dict[int, int] = {}
        """By moving axis, tick at whose start its switches must be read next."""
        self._first_due_tick: int | None = None
        """The first of these ticks; None if there is none. Every event reads it, and it rarely changes."""
        self._placed = False
        """True if `place` sets the rotor positions, False if the drivers' steps do."""
        self._restless: set[int] = set()
        """Axes whose switches may change although the firmware makes no steps."""
        self._looked_tick = -1
        """Tick at whose start the switches were last read."""
        self._bouncers: dict[tuple[int, DigitalInput], Bouncer] = {}
        """Bouncing switches by axis and input."""
        self._bounce_tick: int | None = None
        """Next tick at whose start a bouncing input may change; None if none bounces."""
        self._starts_seen = 0
        """`BoardPulses.starts` when the moving axes were last collected. Until it changes, no other axis moves."""

    def _coupled_with(self, axis: int) -> set[int]:
        """Return the axes with switches whose travels share rotors with this one's, directly or indirectly."""
        coupled = {axis}
        while more := {each for each in self._switched if self._rotors_of([each]) & self._rotors_of(coupled)} - coupled:
            coupled |= more
        return coupled

    def leave_drivers(self) -> None:
        """Stop following the drivers' steps; from now on `place` sets the rotor positions."""
        self._placed = True
        self._followed = set()

    def place(self, rotors_substeps: Sequence[int]) -> bool:
        """Set the rotor positions; return whether a switch has changed."""
        self._rotors_substeps = list(rotors_substeps)
        changed = False
        for axis in self._switched:
            position = self._travels[axis].position_substeps(rotors_substeps)
            changed |= self._axes[axis].move(position - self._axes[axis].position_substeps)
        return changed

    def distances_to_change(self) -> list[tuple[Travel, int]]:
        """Return, for each axis with switches, its travel and the shortest distance in substeps to a switch change."""
        return [(self._travels[axis], self._axes[axis].substeps_to_change) for axis in self._switched]

    @property
    def levels(self) -> list[DigitalInput]:
        """Input levels of each axis, as last read."""
        common = DigitalInput.ESTOP if self.emergency_stop else DigitalInput(0)
        if self.torque_off:
            common |= DigitalInput.TORQUE_OFF
        return [
            axis.levels | common | general | driver
            for axis, general, driver in zip(self._axes, self._general, self.of_drivers, strict=True)
        ]

    def set_general(self, axis: int, which: DigitalInput, *, on: bool) -> None:
        """Set the level of a general input."""
        levels = self._general[axis]
        self._general[axis] = levels | which if on else levels & ~which

    def stick(self, axis: int, which: DigitalInput, *, closed: bool | None) -> None:
        """Hold a switch closed or open; None lets it follow the axis again."""
        self._axes[axis].stick(which, closed=closed)

    def cut(self, axis: int, which: DigitalInput, *, closed: bool | None) -> None:
        """Break the wire of a switch, which then reads as closed or open; None repairs it."""
        self._axes[axis].cut(which, closed=closed)

    def let_bounce(self, axis: int, which: DigitalInput, bounces: int, within_us: int, seed: int) -> None:
        """Make a switch bounce at each change from now on; 0 bounces ends this."""
        switches = self._axes[axis]
        switches.inverted &= ~which
        self._bouncers.pop((axis, which), None)
        if bounces:
            closed = bool(switches.contacts & which)
            self._bouncers[axis, which] = Bouncer(bounces, within_us, seed, closed=closed)
        elif not self._bouncers:
            self._bounce_tick = None

    def _bounce(self, tick: int) -> None:
        """Update the inputs of the bouncing switches at the start of a tick."""
        for (axis, which), bouncer in self._bouncers.items():
            switches = self._axes[axis]
            inverted = bouncer.inverted(tick, closed=bool(switches.contacts & which))
            switches.inverted = switches.inverted | which if inverted else switches.inverted & ~which
        ticks = (bouncer.next_tick(tick) for bouncer in self._bouncers.values())
        self._bounce_tick = min((each for each in ticks if each is not None), default=None)

    @property
    def stuck(self) -> list[DigitalInput]:
        """Switches of each axis that are held at a level."""
        return [axis.stuck for axis in self._axes]

    def restart_count(self) -> None:
        """Reset the seen number of starts, because the firmware has restarted and counts from 0."""
        self._starts_seen = 0

    @property
    def unsettled(self) -> bool:
        """True while a switch may still change by computed motion."""
        return bool(self._due_ticks or self._restless or self._bounce_tick is not None)

    def moved(
        self, axis: int, counts: Int64Array, substeps: SubstepArray, *, held_pulses: int, step_substeps: int
    ) -> None:
        """Add moves of a rotor.

        Args:
            axis: axis of the rotor.
            counts: shape (n,), instants.
            substeps: shape (n,), moves at these instants.
            held_pulses: number of pulses that the driver may still count.
            step_substeps: size of the driver's present step.
        """
        self._held_pulses[axis] = held_pulses
        self._step_substeps[axis] = step_substeps
        if axis in self._followed and counts.size:
            self._ahead[axis].append((counts, substeps))

    def shift(self, rotor: int, substeps: int, motion: BoardPulses) -> None:
        """Turn a rotor in addition to its driver's steps, at the start of the next tick."""
        self._rotors_substeps[rotor] += substeps
        self.unsettle(rotor, motion)

    def unsettle(self, rotor: int, motion: BoardPulses) -> None:
        """Schedule reading the switches of a rotor at the next tick, because it has moved or its step size changed."""
        self._read_at(self._reached_by(rotor), motion.tick)

    def expect(self, rotors: set[int]) -> None:
        """Set the rotors that may move at any time although the firmware makes no steps."""
        self._restless = {axis for rotor in rotors for axis in self._reached_by(rotor)}

    @property
    def restless(self) -> bool:
        """True if switches may change although the firmware makes no steps."""
        return bool(self._restless)

    def _reached_by(self, rotor: int) -> set[int]:
        """Return the axes whose switches depend on a rotor's steps."""
        if self._placed:
            return set()
        return {axis for axis in self._switched if rotor in self._travels[axis].rotors}

    def _read_at(self, axes: set[int], tick: int) -> None:
        self._just_started |= axes
        self._due_ticks |= dict.fromkeys(axes, tick)
        self._first_due_tick = min(self._due_ticks.values(), default=None)

    def due_tick(self, motion: BoardPulses) -> int | None:
        """Return the tick before which no switch can change; None while no axis with switches moves."""
        if motion.starts != self._starts_seen and not self._placed:
            self._starts_seen = motion.starts
            self._just_started.clear()
            self._read_at({axis for axis in self._switched if self._running(axis, motion)}, motion.tick)
        if self._restless:
            self._read_at(self._restless, max(motion.tick, self._looked_tick + 1))
        due_tick = self._first_due_tick
        if self._bounce_tick is not None:
            due_tick = self._bounce_tick if due_tick is None else min(due_tick, self._bounce_tick)
        return due_tick

    def _running(self, axis: int, motion: BoardPulses) -> bool:
        """Return whether a rotor moves along the travel of an axis' switches."""
        for rotor in self._travels[axis].rotors:  # noqa: SIM110  (any() is slower, and this is called often)
            if motion.axes[rotor].running:
                return True
        return False

    def _pulses_ahead(self, axis: int, motion: BoardPulses) -> int:
        """Return the number of (possible) pulses of a rotor that the switches have not followed yet."""
        most = 0
        for rotor in self._travels[axis].rotors:
            pulses = motion.axes[rotor].undrained_pulses + self._held_pulses[rotor]
            for counts, _ in self._ahead[rotor]:
                pulses += counts.size
            most = max(most, pulses)
        return most

    def may_have_changed(self, motion: BoardPulses) -> bool:
        """Return False if no due switch can have changed, and move `due_tick`; if True, the caller calls `look`."""
        due = self._due(motion)
        bounces = self._bounce_tick is not None and self._bounce_tick <= motion.tick
        put_off = all(self._put_off(axis, motion) for axis in due)
        self._first_due_tick = min(self._due_ticks.values()) if self._due_ticks else None
        return not put_off or bounces

    def due_rotors(self, motion: BoardPulses) -> set[int]:
        """Return the rotors of the switches that must be read at the start of the next tick."""
        return self._rotors_of(self._to_read(motion))

    def _rotors_of(self, axes: Iterable[int]) -> set[int]:
        return {rotor for axis in axes for rotor in self._travels[axis].rotors}

    def _due(self, motion: BoardPulses) -> list[int]:
        return [axis for axis, tick in self._due_ticks.items() if tick <= motion.tick]

    def _to_read(self, motion: BoardPulses) -> list[int]:
        """Return the due axes and the axes whose travels share their rotors, which must follow together."""
        due = {other for axis in self._due(motion) for other in self._coupled[axis]}
        return [axis for axis in self._due_ticks if axis in due]

    def _put_off(self, axis: int, motion: BoardPulses) -> bool:
        """Postpone an axis' due tick if its steps cannot have reached a switch; return whether it was postponed."""
        if axis in self._just_started:
            return False
        pulses, running = self._pulses_ahead(axis, motion), self._running(axis, motion)
        distance_steps = self._steps_to_change(axis)
        if not running and pulses == 0:
            del self._due_ticks[axis]
            return True
        if pulses >= distance_steps or not running:
            return False
        self._due_ticks[axis] = motion.tick + self._quiet_ticks(axis, distance_steps - pulses, motion)
        return True

    def look(self, motion: BoardPulses) -> None:
        """Read the due switches at the start of the next tick; `due_rotors` must have been drained up to it."""
        self._looked_tick = motion.tick
        axes = self._to_read(motion)
        for rotor in self._rotors_of(axes):
            self._settle(rotor, motion.tick * TICK_COUNTS)
        for axis in axes:
            self._just_started.discard(axis)
            position = self._travels[axis].position_substeps(self._rotors_substeps)
            self._axes[axis].move(position - self._axes[axis].position_substeps)
            left_steps = self._steps_to_change(axis) - self._pulses_ahead(axis, motion)
            self._due_ticks[axis] = motion.tick + self._quiet_ticks(axis, left_steps, motion)
        self._first_due_tick = min(self._due_ticks.values(), default=None)
        if self._bouncers:
            self._bounce(motion.tick)

    def _steps_to_change(self, axis: int) -> int:
        """Return the smallest number of steps until one of the axis' switches changes."""
        return self._travels[axis].steps(self._axes[axis].substeps_to_change, self._step_substeps)

    def _settle(self, rotor: int, until_counts: int) -> None:
        ahead = []
        for counts, substeps in self._ahead[rotor]:
            seen = int(np.searchsorted(counts, until_counts))
            self._rotors_substeps[rotor] += int(substeps[:seen].sum(dtype=np.int64))
            if seen < counts.size:
                ahead.append((counts[seen:], substeps[seen:]))
        self._ahead[rotor] = ahead

    def _quiet_ticks(self, axis: int, steps: int, motion: BoardPulses) -> int:
        """Return a number of ticks, at least 1, in which each rotor of an axis makes fewer than `steps` steps."""
        if steps <= 0:
            return 1
        by_drivers = max(1, (steps - 1) * self._period_min_counts // TICK_COUNTS)
        by_segments = -1
        for rotor in self._travels[axis].rotors:
            if motion.axes[rotor].running:
                quiet_ticks = motion.axes[rotor].quiet_ticks(steps)
                by_segments = quiet_ticks if by_segments < 0 else min(by_segments, quiet_ticks)
        return max(by_segments, by_drivers)
