"""Model the chip: count CLK pulses, note violations of its operating range, follow its outputs.

The chip counts rising CLK edges; the level of CW/CCW at the edge gives the direction (page 10). RESET low forces the
initial state and ignores CLK; ENABLE low switches only the outputs off while the counter follows CLK (page 11).
Operating range: CLK up to 15 kHz (page 7), high for at least t_W(CLK) (page 8). M1 and M2 change only in reset (page
15). VDD comes first, then VM, then the inputs, RESET and ENABLE last; off in reverse (page 28). CLK and CW/CCW are
inputs as well; CLK, which comes as pulses, is judged by its rises. CW/CCW has no setup or hold time in the datasheet.

Outside the operating range the datasheet guarantees nothing. The model takes the worst case: a pulse that breaks a
limit does not count.

A counted step turns the field by the step of the mode at that instant. A change of mode outside reset leads the field
to the new mode's own angle that is equal or next below, and the rotor with it. In reset the field goes to the initial
angle, but this rotor stays. A real one turns by up to two full steps to the nearest place with that electrical angle,
uncounted: so the firmware does not know the position after a change of mode.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import NO_COUNTS, NO_LEVELS, Int8Array, Int64Array, joined, levels_at
from steptwin.emulator.drivers.driver_chip import Cooling, LevelChange, Rail, Terminal, TerminalEdges
from steptwin.emulator.drivers.driver_module import SENSE_OHM
from steptwin.emulator.drivers.limits import Limit, LimitUnit, Rule, ViolationLog, Violations
from steptwin.emulator.drivers.tb6560.excitation import CYCLE_SIXTEENTHS, FULL_STEP_SIXTEENTHS, Excitation
from steptwin.emulator.drivers.tb6560.oscillator import clk_width_min_counts
from steptwin.emulator.drivers.tb6560.output_follower import Tb6560Follower
from steptwin.emulator.drivers.tb6560.outputs import SENSE_VOLT, Origin, Tb6560Outputs, initial_field
from steptwin.emulator.drivers.tb6560.pins import EXCITATIONS, TERMINALS, TORQUE_PERCENT
from steptwin.emulator.drivers.tb6560.thermal import ON_RESISTANCE_OHM, SHUTDOWN_CELSIUS, Junction
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND


class ModeChange(NamedTuple):
    """From an instant on, the pins select this mode; `live` is False while the chip is in reset or without VDD."""

    counts: int
    excitation: Excitation
    live: int


class Rotor:
    """The position of one motor's rotor since power-up, which grows with steps at which DIR is high."""

    def __init__(self) -> None:
        self.position_sixteenths = 0
        """Position in sixteenths of a full step."""
        self.excitation = Excitation.TWO_PHASE
        self._zero_sixteenths = self.excitation.initial_sixteenths
        """Angle of the field at the position 0; the angle grows with steps at which DIR is low."""

    def follow(
        self, counts: Int64Array, signs: Int8Array, changes: Sequence[ModeChange]
    ) -> tuple[Int64Array, Int8Array]:
        """Follow counted steps and changes of mode, both in order of time.

        Returns:
            Instant of each move, and the move in sixteenths of a full step, 1 to 16 with its sign.
        """
        if not changes:
            return counts, self._step(signs)
        instants, moves, first = [], [], 0
        for change in changes:
            last = int(np.searchsorted(counts, change.counts))
            instants += [counts[first:last], np.array([change.counts], dtype=np.int64)]
            moves += [self._step(signs[first:last]), np.array([self._change(change)], dtype=np.int8)]
            first = last
        instant, move = np.concatenate([*instants, counts[first:]]), np.concatenate([*moves, self._step(signs[first:])])
        return instant[move != 0], move[move != 0]

    def _step(self, signs: Int8Array) -> Int8Array:
        moves = signs * np.int8(self.excitation.step_sixteenths)
        self.position_sixteenths += int(moves.sum(dtype=np.int64))
        return moves

    def _change(self, change: ModeChange) -> int:
        """Take the mode; return the move that it causes."""
        self.excitation = change.excitation
        if not change.live:
            self._zero_sixteenths = change.excitation.initial_sixteenths + self.position_sixteenths
            return 0
        angle = (self._zero_sixteenths - self.position_sixteenths) % CYCLE_SIXTEENTHS
        move = (angle - change.excitation.nearest_state(angle)) % CYCLE_SIXTEENTHS
        self.position_sixteenths += move
        return move


CLK_RATE_MAX_HZ: Final = 15_000
PERIOD_MIN_COUNTS: Final = COUNTS_PER_SECOND // CLK_RATE_MAX_HZ

CURRENT_MAX_A: Final = 3.0
"""Operating range of the AHQ's outputs (pages 6 to 8); 3.5 A is the absolute maximum, for moments."""

OSC_PART: Final = "osc_pf"
"""Name of the capacitor at OSC as a part that may change."""

_DATASHEET: Final = "TB6560AHQ datasheet, page"
_CLK_WIDTH, _CLK_PERIOD, _MODE, _VM_RISES, _INPUT_RISES, _VM_FALLS, _VDD_FALLS, _HOT = range(8)
_LATE_COUNTS: Final = COUNTS_PER_MS
"""Greatest time by which a change of an input may come after later pulses: the firmware computes a tick ahead."""

_LIVE: Final = (Rail.VDD, Pin.RESET)
"""Inputs that must be high for CLK to count."""
_OF_MODE: Final = (*_LIVE, Pin.M1, Pin.M2)
"""Inputs that decide by which angle a step turns the field, or put it to its initial angle."""
_INPUTS: Final = tuple(each for each in TERMINALS if isinstance(each, Pin))


class _PowerStep(NamedTuple):
    """A step of the power sequence: when one of `terminals` takes `level`, all of `others` must be at `needed`."""

    terminals: tuple[Terminal, ...]
    level: int
    others: tuple[Terminal, ...]
    needed: int
    said: str


_POWER_STEPS: Final = {
    _VM_RISES: _PowerStep((Rail.VM,), 1, (Rail.VDD,), 1, "level of VDD as VM rises"),
    _INPUT_RISES: _PowerStep(_INPUTS, 1, (Rail.VM,), 1, "level of VM as an input rises"),
    _VM_FALLS: _PowerStep((Rail.VM,), 0, _INPUTS, 0, "level of an input as VM falls"),
    _VDD_FALLS: _PowerStep((Rail.VDD,), 0, (Rail.VM,), 0, "level of VM as VDD falls"),
}
"""Page 28, on and off. `_check_edges` checks CLK and CW/CCW, which are not members of `Terminal`."""


def _limits(clk_width_counts: int) -> tuple[Limit, ...]:
    """Return the limits in the order of the indices above.

    OVER_TEMPERATURE is broken when the junction's temperature crosses the limit: the value noted is the limit.
    """
    return (
        Limit(Rule.CLK_HIGH, clk_width_counts, LimitUnit.COUNTS, f"{_DATASHEET} 8"),
        Limit(Rule.CLK_PERIOD, PERIOD_MIN_COUNTS, LimitUnit.COUNTS, f"{_DATASHEET} 7"),
        Limit(Rule.MODE_CHANGE, 0, LimitUnit.LEVEL, f"{_DATASHEET} 15, level of RESET"),
        *(
            Limit(Rule.POWER_ORDER, step.needed, LimitUnit.LEVEL, f"{_DATASHEET} 28, {step.said}")
            for step in _POWER_STEPS.values()
        ),
        Limit(Rule.OVER_TEMPERATURE, SHUTDOWN_CELSIUS, LimitUnit.CELSIUS, "TB6560AHQ datasheet, pages 6 to 8"),
    )


class Tb6560:
    """One chip, at first without supply and with all inputs low: in reset, disabled, direction CW.

    Raises:
        ValueError: the capacitor or the resistor is not positive, or outside the operating range: the oscillator would
            be too fast, or the peak current too high.
    """

    def __init__(self, osc_pf: float, sense_ohm: float = SENSE_OHM, cooling: Cooling | None = None) -> None:
        if not sense_ohm > 0:
            raise ValueError(f"the sense resistor is {sense_ohm} ohm; it must be positive, for example {SENSE_OHM}")
        if sense_ohm < SENSE_VOLT / CURRENT_MAX_A:
            raise ValueError(
                f"the sense resistor is {sense_ohm:g} ohm, which makes {SENSE_VOLT / sense_ohm:.2f} A: at most"
                f" {CURRENT_MAX_A:g} A are allowed, {ceil(1000 * SENSE_VOLT / CURRENT_MAX_A) / 1000:g} ohm or more"
            )
        self.pulse_min_counts = clk_width_min_counts(osc_pf)
        self.position_steps = 0
        """Steps counted since power-up, also through resets; steps with DIR high count up."""
        self.lost_steps = 0
        """Signed pulses less signed steps counted."""
        self._rotor = Rotor()
        self._sense_ohm = sense_ohm
        self._junction = Junction(cooling or Cooling())
        self._levels = dict.fromkeys(TERMINALS, 0)
        self._origin = Origin(dict(self._levels), initial_field(self._levels), shut_down=0, from_counts=0)
        self._before = (NO_COUNTS, NO_LEVELS)
        """Forgotten steps that the outputs still need."""
        self._hot_from_counts = 0
        self._changes: list[LevelChange] = []
        self._dir_level = 0
        self._last_rise_counts = -PERIOD_MIN_COUNTS
        self._until_counts = 0
        self._steps: list[Int64Array] = []
        self._signs: list[Int8Array] = []
        self._limits = _limits(self.pulse_min_counts)
        self._clk_width = _CLK_WIDTH
        """Index of the limit of CLK's width."""
        self._log = ViolationLog(self._limits)
        self._follower: Tb6560Follower | None = None

    def follow_outputs(self) -> Tb6560Follower:
        """Return what follows the outputs from power-up on, for a motor that turns with them; before the first edge."""
        self._follower = Tb6560Follower(self._origin, self._sense_ohm, self._junction)
        return self._follower

    def change_part(self, name: str, value: float) -> None:
        """Put another capacitor to OSC: pulses that are fed from now on must be as long as it asks for.

        Raises:
            ValueError: it is another part, or a capacitor with which no chip is made.
        """
        if name != OSC_PART:
            raise ValueError(f"a TB6560 has no part {name}, only {OSC_PART}")
        self.pulse_min_counts = clk_width_min_counts(value)
        limit = _limits(self.pulse_min_counts)[_CLK_WIDTH]
        if limit not in self._limits:
            self._limits = (*self._limits, limit)
            self._log.know(self._limits)
        self._clk_width = self._limits.index(limit)

    # --- inputs

    def feed(self, edges: TerminalEdges) -> tuple[Int64Array, Int8Array]:
        """Process the next stretch of edges at the chip's pins; every rise comes with its fall.

        Returns:
            Instant of each counted step, and the rotor's move by it, in sixteenths of a full step with its sign.
        """
        was_live, was_supplied = self._live, self._levels[Rail.VM]
        live_edges: list[tuple[int, int]] = []
        vm_edges: list[tuple[int, int]] = []
        mode_changes: list[ModeChange] = []
        taken: list[LevelChange] = []
        for change in filter(self._take, edges.changes):
            taken.append(change)
            if change.terminal in _OF_MODE:
                mode_changes.append(ModeChange(change.counts, self._selected, self._live))
            if change.terminal in _LIVE:
                live_edges.append((change.counts, self._live))
            elif change.terminal is Rail.VM:
                vm_edges.append((change.counts, change.level))
        steps = self._count(edges, was_live, live_edges) if edges.clk_rise_counts.size else (NO_COUNTS, NO_LEVELS)
        if self._follower:
            self._follower.take(taken, *steps)
        if vm_edges or not was_supplied:
            self._check_edges(edges, vm_edges, was_supplied)
        if edges.dir_levels.size:
            self._dir_level = int(edges.dir_levels[-1])
        self._until_counts = max(self._until_counts, edges.until_counts)
        return self._rotor.follow(*steps, mode_changes)

    @property
    def _selected(self) -> Excitation:
        return EXCITATIONS[self._levels[Pin.M2], self._levels[Pin.M1]]

    @property
    def _live(self) -> int:
        return int(all(self._levels[pin] for pin in _LIVE))

    def _count(
        self, edges: TerminalEdges, was_live: int, live_edges: list[tuple[int, int]]
    ) -> tuple[Int64Array, Int8Array]:
        """Find the rises that are steps. Usually all are, which two minima show without a mask for each limit."""
        rises = edges.clk_rise_counts
        high_counts = edges.clk_fall_counts - rises
        period_counts = np.empty_like(rises)
        period_counts[0] = rises[0] - self._last_rise_counts
        np.subtract(rises[1:], rises[:-1], out=period_counts[1:])
        self._last_rise_counts = int(rises[-1])
        signs = 2 * levels_at(rises, edges.dir_counts, edges.dir_levels, self._dir_level) - 1
        short = high_counts.min() < self.pulse_min_counts or period_counts.min() < PERIOD_MIN_COUNTS
        if short or live_edges or not was_live:
            live = _levels_of(rises, live_edges, was_live)
            too_short = live & (high_counts < self.pulse_min_counts)
            too_soon = live & (period_counts < PERIOD_MIN_COUNTS)
            self._log.note(self._clk_width, rises[too_short], high_counts[too_short])
            self._log.note(_CLK_PERIOD, rises[too_soon], period_counts[too_soon])
            accepted = live & ~too_short & ~too_soon
            self.lost_steps += int(signs[~accepted].sum(dtype=np.int64))
            rises, signs = rises[accepted], signs[accepted]
        self._steps.append(rises)
        self._signs.append(signs)
        self.position_steps += int(signs.sum(dtype=np.int64))
        return rises, signs

    def _take(self, change: LevelChange) -> bool:
        """Take one input's level; return True if it differs from the level before."""
        counts, terminal, level = change
        if self._levels[terminal] == level:
            return False
        self._check(change)
        self._levels[terminal] = level
        self._changes.append(change)
        self._junction.heat(counts, self._power_w())
        if terminal in _LIVE:
            self._junction.reset(counts, low=not self._live)
        return True

    def _check(self, change: LevelChange) -> None:
        counts, terminal, level = change
        if terminal in (Pin.M1, Pin.M2) and self._live:
            self._log.note_one(_MODE, counts, self._levels[Pin.RESET])
        for limit, step in _POWER_STEPS.items():
            if level != step.level or terminal not in step.terminals:
                continue
            if any(self._levels[other] != step.needed for other in step.others):
                self._log.note_one(limit, counts, 1 - step.needed)

    def _check_edges(self, edges: TerminalEdges, vm_edges: list[tuple[int, int]], was_supplied: int) -> None:
        """Check CLK and CW/CCW in the power sequence: no rise without VM, and CW/CCW low when VM falls."""
        for rises in (edges.clk_rise_counts, edges.dir_counts[edges.dir_levels == 1]):
            unsupplied = rises[~_levels_of(rises, vm_edges, was_supplied)]
            self._log.note(_INPUT_RISES, unsupplied, np.zeros_like(unsupplied))
        falls = np.array([counts for counts, level in vm_edges if not level], dtype=np.int64)
        high = falls[levels_at(falls, edges.dir_counts, edges.dir_levels, self._dir_level) == 1]
        self._log.note(_VM_FALLS, high, np.ones_like(high))

    def _power_w(self) -> float:
        """Return the power that the outputs dissipate unless they are shut down."""
        level = self._levels
        if not (level[Rail.VDD] and level[Rail.VM] and level[Pin.ENABLE]):
            return 0.0
        phases = 2 if self._selected is Excitation.TWO_PHASE else 1
        return self._dissipated_w(phases, TORQUE_PERCENT[level[Pin.TQ2], level[Pin.TQ1]])

    def _dissipated_w(self, phases: int, torque_percent: int) -> float:
        """Return the power with the full current in one phase, or in both."""
        current_a = SENSE_VOLT / self._sense_ohm * torque_percent / 100
        return phases * current_a**2 * ON_RESISTANCE_OHM

    # --- results

    @property
    def microsteps(self) -> int:
        """Steps in a full step, in the present mode."""
        return self._rotor.excitation

    @property
    def position_substeps(self) -> int:
        """Position of the rotor since power-up, in sixteenths of a full step."""
        return self._rotor.position_sixteenths

    @property
    def steps(self) -> tuple[Int64Array, Int8Array]:
        """Instant of each counted step, and its sign, +1 or -1."""
        return joined(self._steps, np.int64), joined(self._signs, np.int8)

    def forget(self) -> None:
        """Drop the recorded steps, violations and changes of the outputs, but keep how many there were."""
        self._log.forget()
        if not (self._steps or self._changes or self._before[0].size or self._junction.shutdowns(self._until_counts)):
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
        self._junction.forget(kept_counts)

    @property
    def violation_count(self) -> int:
        """Number of violations of limits so far."""
        return self._log.count + len(self._hot_counts())

    @property
    def violations(self) -> Violations:
        """All violations so far, in order of time."""
        hot_counts = np.array(self._hot_counts(), dtype=np.int64)
        return self._log.with_more(_HOT, hot_counts, np.full_like(hot_counts, SHUTDOWN_CELSIUS))

    def _hot_counts(self) -> list[int]:
        """Return the instants of thermal shutdowns that are not forgotten."""
        changes = self._junction.shutdowns(self._until_counts)
        return [counts for counts, shut_down in changes if shut_down and counts >= self._hot_from_counts]

    @property
    def outputs(self) -> Tb6560Outputs:
        """Bridges and MO, for any instant so far."""
        (counts, signs), (counts_before, signs_before) = self.steps, self._before
        steps = np.concatenate((counts_before, counts)), np.concatenate((signs_before, signs))
        shutdowns = self._junction.shutdowns(self._until_counts)
        return Tb6560Outputs(self._origin, self._changes, steps, shutdowns, self._sense_ohm)

    def junction_celsius(self, counts: int) -> float:
        """Return the junction's temperature at an instant; for later than `feed` has reached, if no input changes."""
        return self._junction.celsius(counts)

    def fault_level(self, counts: int) -> int:
        """Return the level of the Protect pin with a pull-up, as `junction_celsius` at an instant: low if shut down."""
        return 1 - int(self._junction.shut_down(counts))

    def fault_stays_until(self, counts: int) -> int | None:
        """Return the instant up to which Protect keeps its level, unless RESET or VDD changes; None: always.

        The instant of a shutdown is a lower bound, which is closer the nearer the shutdown is; its end is exact.
        """
        return self._junction.shutdown_not_before(counts, self._dissipated_w(phases=2, torque_percent=100))


@dataclass(frozen=True, slots=True)
class Tb6560Kind:
    """TB6560s with this capacitor at OSC, in pF."""

    osc_pf: float
    substeps: ClassVar[int] = FULL_STEP_SIXTEENTHS
    mode_levels: ClassVar[Mapping[int, Mapping[Pin, int]]] = {
        mode: {Pin.M2: m2, Pin.M1: m1} for (m2, m1), mode in EXCITATIONS.items()
    }
    period_min_counts: ClassVar[int] = PERIOD_MIN_COUNTS
    current_max_a: ClassVar[float] = CURRENT_MAX_A
    on_resistance_ohm: ClassVar[float] = ON_RESISTANCE_OHM

    @property
    def parts(self) -> dict[str, float]:
        """The capacitor."""
        return {OSC_PART: self.osc_pf}

    def sense_ohm(self, current_a: float) -> float:
        """Return the resistors at NFA and NFB for a full current."""
        return SENSE_VOLT / current_a

    def make(self, sense_ohm: float, cooling: Cooling) -> Tb6560:
        """Return a chip with these sense resistors; raise ValueError if that is outside its operating range."""
        return Tb6560(self.osc_pf, sense_ohm, cooling)


def _levels_of(rises: Int64Array, edges: list[tuple[int, int]], before: int) -> NDArray[np.bool_]:
    counts = np.array([edge[0] for edge in edges], dtype=np.int64)
    levels = np.array([edge[1] for edge in edges], dtype=np.int8)
    return levels_at(rises, counts, levels, before).astype(np.bool_)
