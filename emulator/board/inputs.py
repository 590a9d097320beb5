"""A board's inputs: the levels that the machine gives them, and the ticks when the firmware must read them.

The firmware sees the levels at the start of each servo tick. Pulses are computed many ticks at a time, and this module
says how many. A switch that is d steps away keeps its level until the drivers have been given d pulses more. No driver
counts pulses faster than its kind allows, and the firmware makes none before its running segment can cross
the next thresholds. How far a step turns the motor depends on the driver's mode, which changes only while the axis
stands: it is learned at each start.

The firmware reads its inputs at the start of each servo tick, so it sees a bounce only if one of these falls into it.
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
    """The bouncing contact of one switch; it is asked at the start of ticks."""

    def __init__(self, bounces: int, within_us: int, seed: int, *, closed: bool) -> None:
        self._bounces = bounces
        self._within_counts = within_us * COUNTS_PER_US
        self._random = Random(seed)
        self._closed = closed
        self._turns: list[int] = []
        """Instants when the contact turns over after its last change, in order."""

    def inverted(self, tick: int, *, closed: bool) -> bool:
        """Return whether the input shows the opposite at a tick when the position has the switch closed or not."""
        now_counts = tick * TICK_COUNTS
        if closed != self._closed:
            self._closed = closed
            turns = self._random.sample(range(1, self._within_counts), 2 * self._bounces)
            self._turns = sorted(now_counts + turn for turn in turns)
        return bisect_right(self._turns, now_counts) % 2 == 1

    def next_tick(self, tick: int) -> int | None:
        """Return the next tick, after one, when the input may show something else; None if it has come to rest."""
        if not self._turns or self._turns[-1] <= tick * TICK_COUNTS:
            return None
        turn = self._turns[bisect_right(self._turns, tick * TICK_COUNTS)]
        return -(-turn // TICK_COUNTS)


class BoardInputs:
    """The inputs of all axes, whose switches follow the rotors. Positions are in the drivers' substeps."""

    def __init__(
        self,
        switches: Sequence[Switch],
        start_substeps: Sequence[int],
        travels: Sequence[Travel],
        period_min_counts: int,
    ) -> None:
        """Let the switches of each axis follow its travel; without travels each follows its own rotor."""
        self._period_min_counts = period_min_counts
        """Shortest time between two pulses that a driver counts."""
        self.emergency_stop = False
        self.of_drivers: list[DigitalInput] = [DigitalInput(0)] * len(start_substeps)
        """What each axis' driver tells: that its Protect pin is low, or that its fault output is active."""
        self._general = [DigitalInput(0)] * len(start_substeps)
        """Active general inputs of each axis."""
        self._travels = list(travels) or [Travel.of_rotor(axis) for axis in range(len(start_substeps))]
        self._rotors_substeps = list(start_substeps)
        """Position of each rotor that the switches have followed."""
        self._axes = [
            AxisSwitches(
                [switch for switch in switches if switch.axis == axis], travel.position_substeps(start_substeps)
            )
            for axis, travel in enumerate(self._travels)
        ]
        self._switched = [axis for axis, switches in enumerate(self._axes) if switches]
        self._followed = self._rotors_of(self._switched)
        """Axes whose rotors move along a way with switches."""
        self._coupled = {axis: self._coupled_with(axis) for axis in self._switched}
        """The axes whose switches must be read together, because their ways share rotors, by axis."""
        self._ahead: list[list[Moves]] = [[] for _ in self._axes]
        """Moves of the rotors that the switches have not followed yet, by axis: instants and substeps."""
        self._held_pulses = [0] * len(start_substeps)
        """Number of pulses that a driver holds and may still count, by axis."""
        self._step_substeps = [1] * len(start_substeps)
        """The driver's present step, by axis."""
        self._just_started: set[int] = set()
        """Axes that have been started since `look`: their drivers' steps may have another size now."""
        self._due_ticks: dict[int, int] = {}
        """Tick at whose start the switches of an axis must be read next; an axis at rest is not in it."""
        self._first_due_tick: int | None = None
        """The first of these; None if there is none. It is asked for at every event, and changes seldom."""
        self._placed = False
        """True if `place` tells where the rotors are, not the drivers' steps."""
        self._restless: set[int] = set()
        """Axes whose switches may change though the firmware makes no steps."""
        self._looked_tick = -1
        """Tick at whose start the switches have been read last."""
        self._bouncers: dict[tuple[int, DigitalInput], Bouncer] = {}
        """The switches that bounce, by axis and input."""
        self._bounce_tick: int | None = None
        """Tick at whose start a bouncing switch may show something else; None if none does."""
        self._starts_seen = 0
        """The motion's count of starts when moving axes were last collected: no other axis moves until it changes."""

    def _coupled_with(self, axis: int) -> set[int]:
        """Return the axes with switches whose ways share a rotor with this one's, or with one of theirs, and itself."""
        coupled = {axis}
        while more := {each for each in self._switched if self._rotors_of([each]) & self._rotors_of(coupled)} - coupled:
            coupled |= more
        return coupled

    def leave_drivers(self) -> None:
        """Follow the drivers' steps no more: from now on `place` tells where the rotors are."""
        self._placed = True
        self._followed = set()

    def place(self, rotors_substeps: Sequence[int]) -> bool:
        """Let the switches follow the rotors to where they are; return True if one has changed."""
        self._rotors_substeps = list(rotors_substeps)
        changed = False
        for axis in self._switched:
            position = self._travels[axis].position_substeps(rotors_substeps)
            changed |= self._axes[axis].move(position - self._axes[axis].position_substeps)
        return changed

    def ways_to_change(self) -> list[tuple[Travel, int]]:
        """Return, for each axis with switches, its way and the least distance on it, in substeps, to a change."""
        return [(self._travels[axis], self._axes[axis].substeps_to_change) for axis in self._switched]

    @property
    def levels(self) -> list[DigitalInput]:
        """Levels of each axis' inputs, as last read."""
        common = DigitalInput.ESTOP if self.emergency_stop else DigitalInput(0)
        return [
            axis.levels | common | general | driver
            for axis, general, driver in zip(self._axes, self._general, self.of_drivers, strict=True)
        ]

    def set_general(self, axis: int, which: DigitalInput, *, on: bool) -> None:
        """Set the level of a general input."""
        levels = self._general[axis]
        self._general[axis] = levels | which if on else levels & ~which

    def stick(self, axis: int, which: DigitalInput, *, closed: bool | None) -> None:
        """Hold a switch of an axis closed or open, or let it follow the axis again (None)."""
        self._axes[axis].stick(which, closed=closed)

    def cut(self, axis: int, which: DigitalInput, *, closed: bool | None) -> None:
        """Break the wire of a switch, which then looks closed or open, or mend it (None)."""
        self._axes[axis].cut(which, closed=closed)

    def let_bounce(self, axis: int, which: DigitalInput, bounces: int, within_us: int, seed: int) -> None:
        """Let a switch bounce with each change from now on; no more with 0 bounces."""
        switches = self._axes[axis]
        switches.inverted &= ~which
        self._bouncers.pop((axis, which), None)
        if bounces:
            closed = bool(switches.contacts & which)
            self._bouncers[axis, which] = Bouncer(bounces, within_us, seed, closed=closed)
        elif not self._bouncers:
            self._bounce_tick = None

    def _bounce(self, tick: int) -> None:
        """Let the bouncing switches show what they show at the start of a tick."""
        for (axis, which), bouncer in self._bouncers.items():
            switches = self._axes[axis]
            inverted = bouncer.inverted(tick, closed=bool(switches.contacts & which))
            switches.inverted = switches.inverted | which if inverted else switches.inverted & ~which
        ticks = (bouncer.next_tick(tick) for bouncer in self._bouncers.values())
        self._bounce_tick = min((each for each in ticks if each is not None), default=None)

    @property
    def stuck(self) -> list[DigitalInput]:
        """The switches of each axis that are held at a level."""
        return [axis.stuck for axis in self._axes]

    def restart_count(self) -> None:
        """Expect the motion's count of starts to begin at 0 again, because the firmware has restarted."""
        self._starts_seen = 0

    @property
    def unsettled(self) -> bool:
        """True while a switch may still change by motion that is computed already."""
        return bool(self._due_ticks or self._restless or self._bounce_tick is not None)

    def moved(
        self, axis: int, counts: Int64Array, substeps: SubstepArray, *, held_pulses: int, step_substeps: int
    ) -> None:
        """Take the moves of a rotor, the number of pulses that its driver may still count, and the driver's step."""
        self._held_pulses[axis] = held_pulses
        self._step_substeps[axis] = step_substeps
        if axis in self._followed and counts.size:
            self._ahead[axis].append((counts, substeps))

    def shift(self, rotor: int, substeps: int, motion: BoardPulses) -> None:
        """Turn a rotor by more than its driver has made, at the start of the next tick."""
        self._rotors_substeps[rotor] += substeps
        self.unsettle(rotor, motion)

    def unsettle(self, rotor: int, motion: BoardPulses) -> None:
        """Read the switches that a rotor may reach with the next tick: it has moved, or its steps have changed."""
        self._read_at(self._reached_by(rotor), motion.tick)

    def expect(self, rotors: set[int]) -> None:
        """Expect these rotors to move at any time, though the firmware makes no steps, and no others."""
        self._restless = {axis for rotor in rotors for axis in self._reached_by(rotor)}

    @property
    def restless(self) -> bool:
        """True if switches may change though the firmware makes no steps."""
        return bool(self._restless)

    def _reached_by(self, rotor: int) -> set[int]:
        """Return the axes whose switches a rotor may change by its driver's steps."""
        if self._placed:
            return set()
        return {axis for axis in self._switched if rotor in self._travels[axis].rotors}

    def _read_at(self, axes: set[int], tick: int) -> None:
        self._just_started |= axes
        self._due_ticks |= dict.fromkeys(axes, tick)
        self._first_due_tick = min(self._due_ticks.values(), default=None)

    def due_tick(self, motion: BoardPulses) -> int | None:
        """Return the tick up to whose start no switch can change; None while no axis with switches moves."""
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
        """Return whether a rotor moves along the way of an axis' switches."""
        for rotor in self._travels[axis].rotors:  # noqa: SIM110  (any() costs time, at every look)
            if motion.axes[rotor].running:
                return True
        return False

    def _pulses_ahead(self, axis: int, motion: BoardPulses) -> int:
        """Return the number of pulses that a rotor has made, or may have made, which the switches have not followed."""
        most = 0
        for rotor in self._travels[axis].rotors:
            pulses = motion.axes[rotor].undrained_pulses + self._held_pulses[rotor]
            for counts, _ in self._ahead[rotor]:
                pulses += counts.size
            most = max(most, pulses)
        return most

    def may_have_changed(self, motion: BoardPulses) -> bool:
        """Return False if certainly no switch that is due has changed; `due_tick` is then later. True: call `look`."""
        due = self._due(motion)
        bounces = self._bounce_tick is not None and self._bounce_tick <= motion.tick
        put_off = all(self._put_off(axis, motion) for axis in due)
        self._first_due_tick = min(self._due_ticks.values()) if self._due_ticks else None
        return not put_off or bounces

    def due_rotors(self, motion: BoardPulses) -> set[int]:
        """Return the rotors that switches follow which must be read at the start of the next tick."""
        return self._rotors_of(self._to_read(motion))

    def _rotors_of(self, axes: Iterable[int]) -> set[int]:
        return {rotor for axis in axes for rotor in self._travels[axis].rotors}

    def _due(self, motion: BoardPulses) -> list[int]:
        return [axis for axis, tick in self._due_ticks.items() if tick <= motion.tick]

    def _to_read(self, motion: BoardPulses) -> list[int]:
        """Return the axes that are due, and those on whose ways their rotors turn too: all follow these at once."""
        due = {other for axis in self._due(motion) for other in self._coupled[axis]}
        return [axis for axis in self._due_ticks if axis in due]

    def _put_off(self, axis: int, motion: BoardPulses) -> bool:
        """Put an axis' due tick off if it has made fewer steps than there are to its next switch; return True if so."""
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
        """Let the switches that are due follow up to the start of the next tick; `due_rotors` are drained up to it."""
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
        """Return the least number of steps until one of the axis' switches changes."""
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
        """Return a number of ticks, 1 or more, before whose end none of an axis' rotors makes so many steps more."""
        if steps <= 0:
            return 1
        by_drivers = max(1, (steps - 1) * self._period_min_counts // TICK_COUNTS)
        by_segments = -1
        for rotor in self._travels[axis].rotors:
            if motion.axes[rotor].running:
                quiet_ticks = motion.axes[rotor].quiet_ticks(steps)
                by_segments = quiet_ticks if by_segments < 0 else min(by_segments, quiet_ticks)
        return max(by_segments, by_drivers)
