"""Model a chip by its sheet: count CLK pulses, note violations of its operating range, follow its outputs.

The chip counts rising CLK edges; the level of DIR at the edge gives the direction. RESET low forces the home state and
ignores CLK. ENABLE low switches the outputs off; its sheet says whether the counter follows CLK meanwhile. Supplies may
have to come in order; CLK and DIR are inputs as well, and CLK, which comes as pulses, is judged by its rises.

Outside the operating range a datasheet guarantees nothing. The model takes the worst case: a pulse that breaks a limit
does not count. DIR's setup and hold times, and those of a module around the chip, are the input stage's.

A counted step turns the field by the step of the mode at that instant. A change of mode outside reset leads the field
to the new mode's own angle that is equal or next below, and the rotor with it. In reset the field goes to the home
angle, but this rotor stays. A real one turns by up to two full steps to the nearest place with that electrical angle,
uncounted: so the firmware does not know the position after a change of mode in reset.
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
"""Greatest time by which a change of an input may come after later pulses: the firmware computes a tick ahead."""
_LONG_AGO: Final = -(1 << 60)
_NOT_YET: Final = 1 << 60


class ModeChange(NamedTuple):
    """From an instant on, the inputs select this mode; `live` is False while the chip is in reset or without supply."""

    counts: int
    excitation: Excitation
    live: int


class Rotor:
    """The position of one motor's rotor since power-up, which grows with steps at which DIR is high."""

    def __init__(self, excitation: Excitation) -> None:
        self.position_substeps: int = 0
        self.excitation: Excitation = excitation
        self._zero_substeps = excitation.initial_substeps
        """Angle of the field at the position 0; the angle grows with steps at which DIR is low."""

    def follow(self, counts: Int64Array, signs: Int8Array, changes: Sequence[ModeChange]) -> Moves:
        """Follow counted steps and changes of mode, both in order of time; return the moves."""
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
        """Take the mode; return the move that it causes."""
        self.excitation = mode = change.excitation
        if not change.live:
            self._zero_substeps = mode.initial_substeps + self.position_substeps
            return 0
        angle = (self._zero_substeps - self.position_substeps) % mode.cycle_substeps
        move = (angle - mode.nearest_state(angle)) % mode.cycle_substeps
        self.position_substeps += move
        return move


class _Gate:
    """A condition for CLK to count: whether it holds, and since when."""

    def __init__(self) -> None:
        self.level, self._since_counts = 0, _LONG_AGO
        """Level before the present stretch, and when it rose last."""
        self._edges: list[tuple[int, int]] = []

    def take(self, counts: int, level: int) -> None:
        """Take a level within the present stretch."""
        self._edges.append((counts, level))

    def open_since(self, counts: int) -> int | None:
        """Return how long it has held at an instant if it does so for the whole stretch; else None."""
        return counts - self._since_counts if self.level and not self._edges else None

    def at(self, rises: Int64Array) -> tuple[Int8Array, Int64Array]:
        """Return whether it holds at each rise of the present stretch, and the time since it began to hold last."""
        counts = np.array([edge[0] for edge in self._edges], dtype=np.int64)
        levels = np.array([edge[1] for edge in self._edges], dtype=np.int8)
        begun = np.concatenate(([self._since_counts], counts[levels == 1]))
        since = rises - begun[np.searchsorted(begun[1:], rises, side="right")]
        return levels_at(rises, counts, levels, self.level), since

    def end_stretch(self) -> None:
        """Let the next stretch begin."""
        for counts, level in self._edges:
            self.level = level
            if level:
                self._since_counts = counts
        self._edges.clear()


class _PowerStep(NamedTuple):
    """A step of the power sequence: when one of `terminals` takes `level`, all of `others` must be at `needed`."""

    terminals: tuple[str, ...]
    level: int
    others: tuple[str, ...]
    needed: int
    said: str


def _power_steps(sheet: ChipSheet) -> tuple[_PowerStep, ...]:
    """Return the steps on and off (TB6560AHQ, page 28); `_check_edges` checks CLK and DIR, which are no terminals."""
    inputs = tuple(terminal for terminal in sheet.terminals if terminal not in sheet.rails)
    return (
        _PowerStep((Rail.VM,), 1, (Rail.VDD,), 1, "level of VDD as VM rises"),
        _PowerStep(inputs, 1, (Rail.VM,), 1, "level of VM as an input rises"),
        _PowerStep((Rail.VM,), 0, inputs, 0, "level of an input as VM falls"),
        _PowerStep((Rail.VDD,), 0, (Rail.VM,), 0, "level of VM as VDD falls"),
    )


_INPUT_RISES, _VM_FALLS = 1, 2
"""Indices of the steps that concern CLK and DIR, too."""


class DriverChip:
    """One chip, at first without supply and with all inputs low: in reset, disabled, DIR low.

    Raises:
        ValueError: the full current is not positive, or above the operating range.
    """

    def __init__(self, sheet: ChipSheet, full_a: float, cooling: Cooling) -> None:
        if not 0 < full_a <= sheet.current_max_a.value:
            most = f"{sheet.current_max_a.value:g} A, the most that a {sheet.name} carries"
            raise ValueError(f"{full_a:.2f} A is not above 0 and up to {most}")
        self.sheet: Final = sheet
        self.position_steps: int = 0
        """Steps counted since power-up, also through resets; steps with DIR high count up."""
        self.lost_steps: int = 0
        """Signed pulses less signed steps counted."""
        self.pulse_min_counts: int = sheet.pulse_min_counts
        """Shortest pulse that it counts."""
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
        """Forgotten steps that the outputs still need."""
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
        self._known = {limit.rule: index for index, limit in reversed(list(enumerate(self._limits)))}
        """Index of each rule's first limit."""
        self._log = ViolationLog(self._limits)
        self._causes: dict[Rule, int] = {}
        """Values of the causes of protections that latch."""
        self._follower: OutputFollower | None = None

    def follow_outputs(self) -> OutputFollower:
        """Return a follower that tells a motor each change at the outputs since power-up.

        It has to be asked for before the first edge, since it sees none of those before.
        """
        self._follower = OutputFollower(self._wiring, self._origin, self._protection)
        return self._follower

    def change_capacitor(self, osc_pf: float) -> None:
        """Put another capacitor to OSC: pulses that are fed from now on must be as long as it asks for.

        Raises:
            ValueError: the chip has no such capacitor, or none works with it.
        """
        if self.sheet.oscillator is None:
            raise ValueError(f"a {self.sheet.name} has no capacitor at OSC")
        self.pulse_min_counts = Oscillator(osc_pf).clk_width_min_counts
        self._know(replace(self._limits[self._known[Rule.CLK_HIGH]], value=self.pulse_min_counts))

    # --- inputs

    def feed(self, edges: TerminalEdges) -> Moves:
        """Process the next stretch of edges at the chip's pins.

        Returns:
            Instant of each counted step, and the rotor's move by it.
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
        """Find the rises that are steps. Usually all are, which a few minima show without a mask for each limit."""
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
        """Return True if no pulse of a stretch can break a limit, by the minima alone."""
        gates = ((self._live, Rule.WAKE_UP, True), (self._enable, Rule.ENABLE_SETUP, Rule.DISABLED in self._known))
        for gate, rule, needed in gates:
            since = gate.open_since(first_rise)
            if since is None and (needed or rule in self._known):
                return False
            if since is not None and since < self._limit(rule):
                return False
        return all(values.min() >= self._limit(rule) for rule, values in pulses.items() if rule in self._known)

    def _limit(self, rule: Rule) -> int:
        return self._limits[self._known[rule]].value if rule in self._known else 0

    def _accepted(self, rises: Int64Array, pulses: dict[Rule, Int64Array]) -> NDArray[np.bool_]:
        """Note the pulses that break limits, outside of reset; return which pulses count."""
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
            if rule in self._known:
                broken = heard & (values < self._limit(rule))
                self._log.note(self._known[rule], rises[broken], values[broken])
                accepted &= ~broken
        return accepted

    def _take(self, change: LevelChange) -> bool:
        """Take one input's level; return True if the chip has the input and its level was another one."""
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
        """Whether nothing but its heat keeps the outputs shut down."""
        shutdown = self.sheet.shutdown
        return shutdown is None or self._freed[shutdown.value.release]

    @property
    def _freed(self) -> Mapping[Release, bool]:
        """Whether each release of a shutdown is at hand now."""
        levels = self._levels
        return {
            Release.COOLING: True,
            Release.ENABLE: not levels["ENABLE"],
            Release.RESET: not self._is_live,
            Release.POWER: not levels[self.sheet.logic_rail],
            Release.NEVER: False,
        }

    def _protect(self, counts: int) -> None:
        """Let the protections act by what holds from an instant on."""
        supplied = bool(self._wiring.supplied(self._levels))
        powered = {Rule.OVER_CURRENT: supplied and bool(self._levels["ENABLE"]), Rule.OVER_VOLTAGE: supplied}
        for rule in self._protection.trip(counts, powered, self._freed):
            self._log.note_one(self._known[rule], counts, self._causes[rule])
        self._junction.heat(counts, self._power_w())

    def short(self, counts: int, *, shorted: bool) -> None:
        """Let the motor be short-circuited from an instant on, or not."""
        limit = Limit(Rule.OVER_CURRENT, 0, LimitUnit.LEVEL, self.sheet.overcurrent.source)
        self._harm(limit, int(shorted), counts)

    def supply_voltage(self, counts: int, volt: int) -> None:
        """Let the motor supply have this voltage, rounded up, from an instant on."""
        highest = self.sheet.overvoltage
        if highest is not None:
            self._harm(Limit(Rule.OVER_VOLTAGE, highest.value.volt, LimitUnit.VOLT, highest.source), volt, counts)

    def _harm(self, limit: Limit, value: int, counts: int) -> None:
        self._protection.causes.discard(limit.rule)
        if value > limit.value:
            self._know(limit)
            self._causes[limit.rule] = value
            self._protection.causes.add(limit.rule)
        self._protect(counts)

    def _know(self, limit: Limit) -> None:
        """Have a limit among those that can be broken: some come up with a fault only."""
        if limit not in self._limits:
            self._limits = (*self._limits, limit)
            self._log.know(self._limits)
        self._known[limit.rule] = self._limits.index(limit)

    def _check(self, change: LevelChange) -> None:
        counts, terminal, level = change
        if Rule.MODE_CHANGE in self._known and terminal in self.sheet.modes.value.pins and self._is_live:
            self._log.note_one(self._known[Rule.MODE_CHANGE], counts, self._levels["RESET"])
        for number, step in enumerate(self._power_steps):
            if level != step.level or terminal not in step.terminals:
                continue
            if any(self._levels[other] != step.needed for other in step.others):
                self._log.note_one(self._known[Rule.POWER_ORDER] + number, counts, 1 - step.needed)

    def _check_edges(self, edges: TerminalEdges, vm_edges: list[tuple[int, int]], was_supplied: int) -> None:
        """Check CLK and DIR in the power sequence: no rise without VM, and DIR low when VM falls."""
        first = self._known[Rule.POWER_ORDER]
        counts = np.array([edge[0] for edge in vm_edges], dtype=np.int64)
        levels = np.array([edge[1] for edge in vm_edges], dtype=np.int8)
        for rises in (edges.clk_rise_counts, edges.dir_counts[edges.dir_levels == 1]):
            unsupplied = rises[levels_at(rises, counts, levels, was_supplied) == 0]
            self._log.note(first + _INPUT_RISES, unsupplied, np.zeros_like(unsupplied))
        falls = counts[levels == 0]
        high = falls[levels_at(falls, edges.dir_counts, edges.dir_levels, self._dir_level) == 1]
        self._log.note(first + _VM_FALLS, high, np.ones_like(high))

    def _power_w(self) -> float:
        """Return the power that the outputs dissipate unless they are shut down."""
        if not (self._wiring.supplied(self._levels) and self._levels["ENABLE"]) or self._protection.latched:
            return 0.0
        return self._dissipated_w(self._selected.power, self._wiring.torque_percent(self._levels))

    def _dissipated_w(self, phases: float, torque_percent: int) -> float:
        """Return the power with the full current in one phase, or in both."""
        current_a = self._wiring.full_a * torque_percent / 100
        return phases * current_a**2 * self.sheet.on_resistance_ohm.value

    # --- results

    @property
    def microsteps(self) -> int:
        """Steps in a full step, in the present mode."""
        return self._rotor.excitation.microsteps

    @property
    def position_substeps(self) -> int:
        """Position of the rotor since power-up; it grows while DIR is high."""
        return self._rotor.position_substeps

    @property
    def steps(self) -> tuple[Int64Array, Int8Array]:
        """Counted steps that are not forgotten: instant, and sign."""
        return joined(self._steps, np.int64), joined(self._signs, np.int8)

    def forget(self) -> None:
        """Drop the recorded steps, violations and changes of the outputs, but keep how many there were."""
        self._log.forget()
        if not (self._steps or self._changes or self._before[0].size or self._protection.shutdowns(self._until_counts)):
            return  # there is nothing else to drop
        outputs, kept_counts = self.outputs, self._until_counts - _LATE_COUNTS
        told_counts = int(outputs.instants().max(initial=max(self._until_counts, outputs.from_counts) - 1)) + 1
        self._origin = outputs.at(kept_counts, told_counts)
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
        """Number of violations of limits so far."""
        return self._log.count + len(self._hot_counts())

    @property
    def violations(self) -> Violations:
        """All violations that are not forgotten, in order of time."""
        if self.sheet.shutdown is None:
            return self._log.all()
        hot, hot_counts = self._known[_hot_rule(self.sheet.shutdown.value)], np.array(self._hot_counts(), np.int64)
        return self._log.with_more(hot, hot_counts, np.full_like(hot_counts, self._limits[hot].value))

    def _hot_counts(self) -> list[int]:
        """Return the instants of thermal shutdowns that are not forgotten."""
        changes = self._junction.shutdowns(self._until_counts)
        return [counts for counts, shut_down in changes if shut_down and counts >= self._hot_from_counts]

    @property
    def outputs(self) -> ChipOutputs:
        """What it does to its motor, for any instant that is not forgotten."""
        (counts, signs), (counts_before, signs_before) = self.steps, self._before
        steps = np.concatenate((counts_before, counts)), np.concatenate((signs_before, signs))
        return ChipOutputs(
            self._wiring, self._origin, self._changes, steps, self._protection.shutdowns(self._until_counts)
        )

    def junction_celsius(self, counts: int) -> float:
        """Return the junction's temperature at an instant; for later than `feed` has reached, if no input changes."""
        return self._junction.celsius(counts)

    def fault_level(self, counts: int) -> int:
        """Return 0 at an instant, as `junction_celsius` does, if its fault output tells of a shutdown; else 1."""
        return 1 - int(self._protection.told(counts))

    @property
    def latched(self) -> bool:
        """Whether a protection holds the outputs off that only its release ends."""
        return self._protection.latched

    def fault_stays_until(self, counts: int) -> int | None:
        """Return an instant before which that level stays unless RESET or the supply changes; None: always.

        The instant of a shutdown is a lower bound, which is closer the nearer the shutdown is; its end is exact.
        """
        worst_w = self._dissipated_w(2.0 if self.sheet.both_full else 1.0, torque_percent=100)
        return self._junction.shutdown_not_before(counts, worst_w)


def _limits(sheet: ChipSheet, power_steps: Sequence[_PowerStep]) -> tuple[Limit, ...]:
    """Return the limits that a chip's sheet sets.

    OVER_TEMPERATURE is broken when the junction's temperature crosses the limit: the value noted is the limit.
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
