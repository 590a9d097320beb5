"""Model a chip by its sheet: count CLK pulses, record violations of its operating range, compute its outputs.

The chip counts rising CLK edges; the level of DIR at the edge is the direction. RESET low forces the home state and
ignores CLK. ENABLE low switches the outputs off; the sheet tells whether the counter still follows CLK. The sheet may
require an order of supplies and inputs. CLK and DIR are such inputs; CLK is checked at its rises.

Outside of the operating range a datasheet guarantees nothing. The model assumes the worst case: a pulse that violates a
limit does not count. The input stage checks setup and hold times of DIR, and the times of a module.

A counted step turns the field by the step of the present mode. A change of mode outside of reset turns the field, and
the rotor with it, to the nearest angle of the new mode that is equal or lower. In reset the field goes to the home
angle, but the modelled rotor stays. A real rotor turns by up to two full steps to the nearest position with that
electrical angle, without being counted. So the firmware does not know the position after a change of mode in reset.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steptwin.emulator.board.edges import NO_COUNTS, NO_LEVELS, Int8Array, Int64Array, joined, levels_at
from steptwin.emulator.drivers.excitation import Excitation
from steptwin.emulator.drivers.limits import Limit, LimitUnit, Rule, ViolationLog, Violations
from steptwin.emulator.drivers.output_follower import OutputFollower
from steptwin.emulator.drivers.outputs import ChipOutputs, Origin, Wiring
from steptwin.emulator.drivers.protection import Junction, Protection
from steptwin.emulator.drivers.terminals import LevelChange, Moves, Rail, TerminalEdges
from steptwin.protocol.drivers import ChipSheet, Cooling, Oscillator, Release, Shutdown
from steptwin.protocol.timer import COUNTS_PER_MS

_LATE_COUNTS: Final = COUNTS_PER_MS
"""Longest time by which an input change may be reported late, after later pulses: the firmware computes ahead."""
_LONG_AGO: Final = -(1 << 60)
_NOT_YET: Final = 1 << 60


class ModeChange(NamedTuple):
    """A change of mode at an instant; `live` is 0 while the chip is in reset or without supply, else 1."""

    counts: int
    excitation: Excitation
    live: int


class Rotor:
    """Position of one motor's rotor since power-up; it increases with steps while DIR is high."""

    def __init__(self, excitation: Excitation) -> None:
        self.position_substeps: int = 0
        self.excitation: Excitation = excitation
        self._zero_substeps = excitation.initial_substeps
        """Angle of the field at position 0; the angle increases with steps while DIR is low."""

    def follow(self, counts: Int64Array, signs: Int8Array, changes: Sequence[ModeChange]) -> Moves:
        """Apply counted steps and changes of mode, both in order of time; return the moves."""
        if not changes:
            return counts, self._step(signs)
        instants, moves, first = [], [], 0
        for change in changes:
            last = int(np.searchsorted(counts, change.counts))
            instants += [counts[first:last], np.array([change.counts], dtype=np.int64)]
            moves += [self._step(signs[first:last]), np.array([self._change(change)], dtype=np.int32)]
            first = last
        instant, move = np.concatenate([*instants, counts[first:]]), np.concatenate([*moves, self._step(signs[first:])])
        return instant[move != 0], move[move != 0]

    def _step(self, signs: Int8Array) -> NDArray[np.int32]:
        moves = signs * np.int32(self.excitation.step_substeps)
        self.position_substeps += int(moves.sum(dtype=np.int64))
        return moves

    def _change(self, change: ModeChange) -> int:
        """Apply a change of mode; return the move that it causes."""
        self.excitation = mode = change.excitation
        if not change.live:
            self._zero_substeps = mode.initial_substeps + self.position_substeps
            return 0
        angle = (self._zero_substeps - self.position_substeps) % mode.cycle_substeps
        move = (angle - mode.nearest_state(angle)) % mode.cycle_substeps
        self.position_substeps += move
        return move


class _Gate:
    """A condition under which CLK counts: its level, and the time since it became 1."""

    def __init__(self) -> None:
        self.level, self._since_counts = 0, _LONG_AGO
        """Level before the present stretch, and instant of its last rise."""
        self._edges: list[tuple[int, int]] = []

    def take(self, counts: int, level: int) -> None:
        """Set the level at an instant within the present stretch."""
        self._edges.append((counts, level))

    def open_since(self, counts: int) -> int | None:
        """Return the time since its rise if the level is 1 in the whole stretch; else None."""
        return counts - self._since_counts if self.level and not self._edges else None

    def at(self, rises: Int64Array) -> tuple[Int8Array, Int64Array]:
        """Return the level at each CLK rise of the present stretch, and the time since the level's last rise."""
        counts = np.array([edge[0] for edge in self._edges], dtype=np.int64)
        levels = np.array([edge[1] for edge in self._edges], dtype=np.int8)
        begun = np.concatenate(([self._since_counts], counts[levels == 1]))
        since = rises - begun[np.searchsorted(begun[1:], rises, side="right")]
        return levels_at(rises, counts, levels, self.level), since

    def end_stretch(self) -> None:
        """Begin the next stretch."""
        for counts, level in self._edges:
            self.level = level
            if level:
                self._since_counts = counts
        self._edges.clear()


class _PowerStep(NamedTuple):
    """A step of the power sequence: when one of `terminals` changes to `level`, `others` must be at `needed`."""

    terminals: tuple[str, ...]
    level: int
    others: tuple[str, ...]
    needed: int
    said: str


def _power_steps(sheet: ChipSheet) -> tuple[_PowerStep, ...]:
    """Return the steps of power-up and power-down (TB6560AHQ, page 28); `_check_edges` checks CLK and DIR."""
    inputs = tuple(terminal for terminal in sheet.terminals if terminal not in sheet.rails)
    return (
        _PowerStep((Rail.VM,), 1, (Rail.VDD,), 1, "level of VDD as VM rises"),
        _PowerStep(inputs, 1, (Rail.VM,), 1, "level of VM as an input rises"),
        _PowerStep((Rail.VM,), 0, inputs, 0, "level of an input as VM falls"),
        _PowerStep((Rail.VDD,), 0, (Rail.VM,), 0, "level of VM as VDD falls"),
    )


_INPUT_RISES, _VM_FALLS = 1, 2
"""Indices of the steps that also apply to CLK and DIR."""


class DriverChip:
    """One chip; initially without supply and with all inputs low: in reset, disabled, DIR low.

    Raises:
        ValueError: the full current is not positive, or above the operating range.
    """

    def __init__(self, sheet: ChipSheet, full_a: float, cooling: Cooling) -> None:
        if not 0 < full_a <= sheet.current_max_a.value:
            most = f"{sheet.current_max_a.value:g} A, the most that a {sheet.name} carries"
            raise ValueError(f"{full_a:.2f} A is not above 0 and up to {most}")
        self.sheet: Final = sheet
        self.position_steps: int = 0
        """Steps counted since power-up, resets included; steps with DIR high count up."""
        self.lost_steps: int = 0
        """Signed pulses minus signed counted steps."""
        self.pulse_min_counts: int = sheet.pulse_min_counts
        """Shortest pulse that is counted."""
        self._wiring = Wiring(sheet, full_a)
        self._levels: dict[str, int] = dict.fromkeys(sheet.terminals, 0)
        home = self._wiring.home_field(self._levels)
        self._rotor = Rotor(home.excitation)
        self._origin = Origin(dict(self._levels), home, shut_down=0, from_counts=0)
        self._junction = Junction(cooling, sheet.shutdown.value if sheet.shutdown else None)
        latches = {Rule.OVER_CURRENT: sheet.overcurrent.value}
        if sheet.overvoltage:
            latches[Rule.OVER_VOLTAGE] = sheet.overvoltage.value.release
        self._protection = Protection(self._junction, latches)
        if self._cool_enough:
            self._junction.release(0, on=True)
        self._before = (NO_COUNTS, NO_LEVELS)
        """Dropped steps that the outputs still need."""
        self._hot_from_counts = 0
        self._changes: list[LevelChange] = []
        self._dir_level = 0
        self._last_rise_counts, self._last_fall_counts = _LONG_AGO, _LONG_AGO
        self._live, self._enable = _Gate(), _Gate()
        self._until_counts = 0
        self._steps: list[Int64Array] = []
        self._signs: list[Int8Array] = []
        self._power_steps = _power_steps(sheet) if sheet.ordered_power else ()
        self._limits = _limits(sheet, self._power_steps)
        self._limit_indices = {limit.rule: index for index, limit in reversed(list(enumerate(self._limits)))}
        """Index of each rule's first limit."""
        self._log = ViolationLog(self._limits)
        self._causes: dict[Rule, int] = {}
        """Present causes of latching protections, with their values."""
        self._follower: OutputFollower | None = None

    def follow_outputs(self) -> OutputFollower:
        """Return a follower that reports each change at the outputs since power-up.

        Call this before the first edge: the follower misses earlier ones.
        """
        self._follower = OutputFollower(self._wiring, self._origin, self._protection)
        return self._follower

    def change_capacitor(self, osc_pf: float) -> None:
        """Change the capacitor at OSC; it sets the shortest pulse from now on.

        Raises:
            ValueError: the chip has no such capacitor, or the capacitor is too small.
        """
        if self.sheet.oscillator is None:
            raise ValueError(f"a {self.sheet.name} has no capacitor at OSC")
        self.pulse_min_counts = Oscillator(osc_pf).clk_width_min_counts
        self._know(replace(self._limits[self._limit_indices[Rule.CLK_HIGH]], value=self.pulse_min_counts))

    # --- inputs

    def feed(self, edges: TerminalEdges) -> Moves:
        """Process the next stretch of edges at the chip's pins.

        Returns:
            Instant of each counted step, and the move of the rotor.
        """
        was_supplied = self._levels[Rail.VM]
        vm_edges: list[tuple[int, int]] = []
        mode_changes: list[ModeChange] = []
        taken: list[LevelChange] = []
        for change in filter(self._take, edges.changes):
            taken.append(change)
            if change.terminal in self._wiring.of_mode:
                mode_changes.append(ModeChange(change.counts, self._selected, self._is_live))
            if change.terminal in (self.sheet.logic_rail, "RESET"):
                self._live.take(change.counts, self._is_live)
            elif change.terminal == "ENABLE":
                self._enable.take(change.counts, change.level)
            if change.terminal == Rail.VM:
                vm_edges.append((change.counts, change.level))
        if edges.ends_earlier:
            self._last_fall_counts = int(edges.clk_fall_counts[0])
        steps = self._count(edges) if edges.clk_rise_counts.size else (NO_COUNTS, NO_LEVELS)
        self._live.end_stretch()
        self._enable.end_stretch()
        if self._follower:
            self._follower.take(taken, *steps)
        if self._power_steps and (vm_edges or not was_supplied):
            self._check_edges(edges, vm_edges, was_supplied)
        if edges.dir_levels.size:
            self._dir_level = int(edges.dir_levels[-1])
        self._until_counts = max(self._until_counts, edges.until_counts)
        return self._rotor.follow(*steps, mode_changes)

    @property
    def _selected(self) -> Excitation:
        return self._wiring.excitation(self._levels, self._rotor.excitation)

    @property
    def _is_live(self) -> int:
        return self._wiring.live(self._levels)

    def _count(self, edges: TerminalEdges) -> tuple[Int64Array, Int8Array]:
        """Return the rises that count as steps. If all do, as usual, a few minima prove it without masks."""
        rises, falls = edges.clk_rise_counts, edges.clk_fall_counts[int(edges.ends_earlier) :]
        if falls.size < rises.size:
            falls = np.append(falls, _NOT_YET)
        high_counts = falls - rises
        period_counts, low_counts = np.empty_like(rises), np.empty_like(rises)
        period_counts[0], low_counts[0] = rises[0] - self._last_rise_counts, rises[0] - self._last_fall_counts
        np.subtract(rises[1:], rises[:-1], out=period_counts[1:])
        np.subtract(rises[1:], falls[:-1], out=low_counts[1:])
        self._last_rise_counts, self._last_fall_counts = int(rises[-1]), int(falls[-1])
        signs = 2 * levels_at(rises, edges.dir_counts, edges.dir_levels, self._dir_level) - 1
        pulses = {Rule.CLK_HIGH: high_counts, Rule.CLK_LOW: low_counts, Rule.CLK_PERIOD: period_counts}
        if not self._all_count(int(rises[0]), pulses):
            accepted = self._accepted(rises, pulses)
            self.lost_steps += int(signs[~accepted].sum(dtype=np.int64))
            rises, signs = rises[accepted], signs[accepted]
        self._steps.append(rises)
        self._signs.append(signs)
        self.position_steps += int(signs.sum(dtype=np.int64))
        return rises, signs

    def _all_count(self, first_rise: int, pulses: dict[Rule, Int64Array]) -> bool:
        """Return whether the minima prove that no pulse of a stretch violates a limit."""
        gates = (
            (self._live, Rule.WAKE_UP, True),
            (self._enable, Rule.ENABLE_SETUP, Rule.DISABLED in self._limit_indices),
        )
        for gate, rule, needed in gates:
            since = gate.open_since(first_rise)
            if since is None and (needed or rule in self._limit_indices):
                return False
            if since is not None and since < self._limit(rule):
                return False
        return all(values.min() >= self._limit(rule) for rule, values in pulses.items() if rule in self._limit_indices)

    def _limit(self, rule: Rule) -> int:
        return self._limits[self._limit_indices[rule]].value if rule in self._limit_indices else 0

    def _accepted(self, rises: Int64Array, pulses: dict[Rule, Int64Array]) -> NDArray[np.bool_]:
        """Record the pulses that violate limits outside of reset; return a mask of the pulses that count."""
        (live, awake_counts), (enabled, enabled_counts) = self._live.at(rises), self._enable.at(rises)
        found = {
            **pulses,
            Rule.WAKE_UP: awake_counts,
            Rule.ENABLE_SETUP: np.where(enabled, enabled_counts, self._limit(Rule.ENABLE_SETUP)),
            Rule.DISABLED: enabled.astype(np.int64),
        }
        heard = live.astype(np.bool_)
        accepted = heard.copy()
        for rule, values in found.items():
            if rule in self._limit_indices:
                broken = heard & (values < self._limit(rule))
                self._log.note(self._limit_indices[rule], rises[broken], values[broken])
                accepted &= ~broken
        return accepted

    def _take(self, change: LevelChange) -> bool:
        """Set one input's level; return whether the chip has this input and its level has changed."""
        counts, terminal, level = change
        if self._levels.get(terminal, level) == level:
            return False
        self._check(change)
        self._levels[terminal] = level
        self._changes.append(change)
        self._protect(counts)
        if terminal in (self.sheet.logic_rail, "RESET"):
            self._junction.release(counts, on=self._cool_enough)
        return True

    @property
    def _cool_enough(self) -> bool:
        """True if only the temperature keeps the outputs shut down."""
        shutdown = self.sheet.shutdown
        return shutdown is None or self._freed[shutdown.value.release]

    @property
    def _freed(self) -> Mapping[Release, bool]:
        """By release of a shutdown, True if its condition is met now."""
        levels = self._levels
        return {
            Release.COOLING: True,
            Release.ENABLE: not levels["ENABLE"],
            Release.RESET: not self._is_live,
            Release.POWER: not levels[self.sheet.logic_rail],
            Release.NEVER: False,
        }

    def _protect(self, counts: int) -> None:
        """Pass the present conditions to the protections; they hold from an instant on."""
        supplied = bool(self._wiring.supplied(self._levels))
        powered = {Rule.OVER_CURRENT: supplied and bool(self._levels["ENABLE"]), Rule.OVER_VOLTAGE: supplied}
        for rule in self._protection.trip(counts, powered, self._freed):
            self._log.note_one(self._limit_indices[rule], counts, self._causes[rule])
        self._junction.heat(counts, self._power_w())

    def short(self, counts: int, *, shorted: bool) -> None:
        """Short-circuit the motor from an instant on, or remove the short circuit."""
        limit = Limit(Rule.OVER_CURRENT, 0, LimitUnit.LEVEL, self.sheet.overcurrent.source)
        self._note_broken(limit, int(shorted), counts)

    def supply_voltage(self, counts: int, volt: int) -> None:
        """Set the motor supply, rounded up to V, from an instant on."""
        highest = self.sheet.overvoltage
        if highest is not None:
            self._note_broken(
                Limit(Rule.OVER_VOLTAGE, highest.value.volt, LimitUnit.VOLT, highest.source), volt, counts
            )

    def _note_broken(self, limit: Limit, value: int, counts: int) -> None:
        self._protection.causes.discard(limit.rule)
        if value > limit.value:
            self._know(limit)
            self._causes[limit.rule] = value
            self._protection.causes.add(limit.rule)
        self._protect(counts)

    def _know(self, limit: Limit) -> None:
        """Add a limit that can be violated; some apply only after a fault."""
        if limit not in self._limits:
            self._limits = (*self._limits, limit)
            self._log.know(self._limits)
        self._limit_indices[limit.rule] = self._limits.index(limit)

    def _check(self, change: LevelChange) -> None:
        counts, terminal, level = change
        if Rule.MODE_CHANGE in self._limit_indices and terminal in self.sheet.modes.value.pins and self._is_live:
            self._log.note_one(self._limit_indices[Rule.MODE_CHANGE], counts, self._levels["RESET"])
        for number, step in enumerate(self._power_steps):
            if level != step.level or terminal not in step.terminals:
                continue
            if any(self._levels[other] != step.needed for other in step.others):
                self._log.note_one(self._limit_indices[Rule.POWER_ORDER] + number, counts, 1 - step.needed)

    def _check_edges(self, edges: TerminalEdges, vm_edges: list[tuple[int, int]], was_supplied: int) -> None:
        """Check CLK and DIR in the power sequence: no CLK rise without VM, and DIR low when VM falls."""
        first = self._limit_indices[Rule.POWER_ORDER]
        counts = np.array([edge[0] for edge in vm_edges], dtype=np.int64)
        levels = np.array([edge[1] for edge in vm_edges], dtype=np.int8)
        for rises in (edges.clk_rise_counts, edges.dir_counts[edges.dir_levels == 1]):
            unsupplied = rises[levels_at(rises, counts, levels, was_supplied) == 0]
            self._log.note(first + _INPUT_RISES, unsupplied, np.zeros_like(unsupplied))
        falls = counts[levels == 0]
        high = falls[levels_at(falls, edges.dir_counts, edges.dir_levels, self._dir_level) == 1]
        self._log.note(first + _VM_FALLS, high, np.ones_like(high))

    def _power_w(self) -> float:
        """Return the power loss of the outputs while they are not shut down."""
        if not (self._wiring.supplied(self._levels) and self._levels["ENABLE"]) or self._protection.latched:
            return 0.0
        return self._dissipated_w(self._selected.power, self._wiring.torque_percent(self._levels))

    def _dissipated_w(self, phases: float, torque_percent: int) -> float:
        """Return the power loss with the full current in `phases` phases."""
        current_a = self._wiring.full_a * torque_percent / 100
        return phases * current_a**2 * self.sheet.on_resistance_ohm.value

    # --- results

    @property
    def microsteps(self) -> int:
        """Microsteps per full step in the present mode."""
        return self._rotor.excitation.microsteps

    @property
    def position_substeps(self) -> int:
        """Position of the rotor since power-up; it increases while DIR is high."""
        return self._rotor.position_substeps

    @property
    def steps(self) -> tuple[Int64Array, Int8Array]:
        """Counted steps since `forget`: instant and sign."""
        return joined(self._steps, np.int64), joined(self._signs, np.int8)

    def forget(self) -> None:
        """Drop the recorded steps, violations and output changes, but keep their numbers."""
        self._log.forget()
        if not (self._steps or self._changes or self._before[0].size or self._protection.shutdowns(self._until_counts)):
            return  # there is nothing else to drop
        outputs, kept_counts = self.outputs, self._until_counts - _LATE_COUNTS
        reported_counts = int(outputs.instants().max(initial=max(self._until_counts, outputs.from_counts) - 1)) + 1
        self._origin = outputs.at(kept_counts, reported_counts)
        counts, signs = outputs.steps
        kept = int(np.searchsorted(counts, kept_counts))
        self._before = counts[kept:].copy(), signs[kept:].copy()
        self._steps.clear()
        self._signs.clear()
        self._changes = [change for change in self._changes if change.counts >= kept_counts]
        self._log.count += len(self._hot_counts())
        self._hot_from_counts = self._until_counts + 1
        self._protection.forget(kept_counts)

    @property
    def violation_count(self) -> int:
        """Number of limit violations so far."""
        return self._log.count + len(self._hot_counts())

    @property
    def violations(self) -> Violations:
        """All violations since `forget`, in order of time."""
        if self.sheet.shutdown is None:
            return self._log.all()
        hot, hot_counts = (
            self._limit_indices[_hot_rule(self.sheet.shutdown.value)],
            np.array(self._hot_counts(), np.int64),
        )
        return self._log.with_more(hot, hot_counts, np.full_like(hot_counts, self._limits[hot].value))

    def _hot_counts(self) -> list[int]:
        """Return the instants of thermal shutdowns since `forget`."""
        changes = self._junction.shutdowns(self._until_counts)
        return [counts for counts, shut_down in changes if shut_down and counts >= self._hot_from_counts]

    @property
    def outputs(self) -> ChipOutputs:
        """Outputs to the motor, for any instant since `forget`."""
        (counts, signs), (counts_before, signs_before) = self.steps, self._before
        steps = np.concatenate((counts_before, counts)), np.concatenate((signs_before, signs))
        return ChipOutputs(
            self._wiring, self._origin, self._changes, steps, self._protection.shutdowns(self._until_counts)
        )

    def junction_celsius(self, counts: int) -> float:
        """Return the junction temperature at an instant; a later one than `feed` assumes that no input changes."""
        return self._junction.celsius(counts)

    def fault_level(self, counts: int) -> int:
        """Return the fault output at an instant (0: shutdown, else 1), with the assumption of `junction_celsius`."""
        return 1 - int(self._protection.reported(counts))

    @property
    def latched(self) -> bool:
        """True if a latched protection keeps the outputs off until its release."""
        return self._protection.latched

    def fault_stays_until(self, counts: int) -> int | None:
        """Return an instant before which the fault output stays unless RESET or a supply changes; None for never.

        The instant of a shutdown is a lower bound, which becomes more exact as the shutdown approaches. Its end is
        exact.
        """
        worst_w = self._dissipated_w(2.0 if self.sheet.both_full else 1.0, torque_percent=100)
        return self._junction.shutdown_not_before(counts, worst_w)


def _limits(sheet: ChipSheet, power_steps: Sequence[_PowerStep]) -> tuple[Limit, ...]:
    """Return the limits of a chip's sheet.

    OVER_TEMPERATURE is violated when the junction temperature crosses its limit; the recorded value is the limit.
    """
    times, limits = sheet.times, list[Limit]()

    def limit(rule: Rule, value: int, source: str, unit: LimitUnit = LimitUnit.COUNTS) -> None:
        limits.append(Limit(rule, value, unit, source))

    if times.steplen_ns:
        limit(Rule.CLK_HIGH, sheet.pulse_min_counts, times.steplen_ns.source)
    if times.stepspace_ns:
        limit(Rule.CLK_LOW, times.counts("stepspace_ns"), times.stepspace_ns.source)
    if times.rate_max_hz:
        limit(Rule.CLK_PERIOD, sheet.period_min_counts, times.rate_max_hz.source)
    if times.wake_ns:
        limit(Rule.WAKE_UP, times.counts("wake_ns"), times.wake_ns.source)
    if times.enable_ns:
        limit(Rule.ENABLE_SETUP, times.counts("enable_ns"), times.enable_ns.source)
    if sheet.blocked.value:
        limit(Rule.DISABLED, 1, f"{sheet.blocked.source}, level of ENABLE", LimitUnit.LEVEL)
    if sheet.mode_in_reset:
        limit(Rule.MODE_CHANGE, 0, f"{sheet.mode_in_reset.source}, level of RESET", LimitUnit.LEVEL)
    if sheet.ordered_power:
        for step in power_steps:
            limit(Rule.POWER_ORDER, step.needed, f"{sheet.ordered_power.source}, {step.said}", LimitUnit.LEVEL)
    if sheet.shutdown:
        shutdown = sheet.shutdown.value
        limit(_hot_rule(shutdown), shutdown.celsius, sheet.shutdown.source, LimitUnit.CELSIUS)
    return tuple(limits)


def _hot_rule(shutdown: Shutdown) -> Rule:
    return Rule.OVER_TEMPERATURE if shutdown.release is Release.RESET else Rule.TOO_HOT
