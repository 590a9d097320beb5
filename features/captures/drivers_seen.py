"""Let a robot's drivers see the edges of a capture, and return what they made of them.

What was not recorded is assumed: the supplies at first, then the pins or switches for the robot's microsteps, then
RESET, and ENABLE unless a channel shows it. All of them come a second before the capture, for drivers that take long to
wake up.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from steptwin.controller.motion.axis_motion import PinEdges
from steptwin.controller.node.pins import Pin, PinChange
from steptwin.emulator.board.inputs import BoardInputs
from steptwin.emulator.drivers.driver_bank import SUPPLIES, DriverBank
from steptwin.emulator.drivers.driver_module import Module
from steptwin.features.captures.channel_map import AxisSignals
from steptwin.features.captures.limits_read import LimitAnswer, answers, grades_of, read_within
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.drivers import driver_profile, fitted_module, switched_microsteps
from steptwin.host.twin.machine.evidence import axis_evidence, level_edges, with_instants
from steptwin.host.verify import AxisEvidence, Evidence
from steptwin.host.verify.clock_fit import ClockFit
from steptwin.protocol.drivers import ActiveEdge, Grade
from steptwin.protocol.timer import COUNTS_PER_SECOND

LEAD_COUNTS: Final = COUNTS_PER_SECOND
_MODE_COUNTS: Final = 1000
_RESET_COUNTS: Final = 3000
_ENABLE_COUNTS: Final = 4000
_TAIL_COUNTS: Final = COUNTS_PER_SECOND
_WINDOW_COUNTS: Final = 10 * COUNTS_PER_SECOND
"""Time whose edges the drivers see at once, which bounds the memory."""


@dataclass(frozen=True, slots=True, eq=False)
class SeenEdges:
    """The edges of one axis in counts: those of STEP, of DIR, and of ENABLE if it was recorded.

    `goes_on` says that STEP's last fall is the record's end: its pulse lasts longer, nobody knows how long.
    """

    name: str
    pins: PinEdges
    enable: list[PinChange] | None
    goes_on: bool = False

    def at_best(self, slack_counts: int) -> "SeenEdges":
        """Return the edges as they are in the pulses' favour: ENABLE early on and late off, the last pulse long."""
        clk = np.asarray(self.pins.clk_counts, np.int64)
        if self.goes_on:
            clk = np.append(clk[:-1], clk[-1] + _TAIL_COUNTS)
        return replace(self, pins=PinEdges(clk, self.pins.direction), enable=_shifted(self.enable, slack_counts))

    def at_worst(self, slack_counts: int) -> "SeenEdges":
        """Return the edges as they are against the pulses: ENABLE late on and early off."""
        return replace(self, enable=_shifted(self.enable, -slack_counts))


def _shifted(enable: list[PinChange] | None, slack_counts: int) -> list[PinChange] | None:
    """Return changes of ENABLE that switch it on so much earlier, and off so much later."""
    if enable is None:
        return None
    moved = [
        change._replace(counts=max(change.counts + (-slack_counts if change.level else slack_counts), _ENABLE_COUNTS))
        for change in enable
    ]
    return [
        now._replace(counts=max(now.counts, before.counts))
        for before, now in zip([moved[0], *moved] if moved else [], moved, strict=False)
    ]


@dataclass(frozen=True, slots=True)
class Reading:
    """How the edges of a capture are read: by how much a time between two may be wrong, and for what.

    Without `currents` nothing is known of the phases, which take most of the memory.
    """

    slack_counts: int
    currents: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What the drivers made of a capture.

    Attributes:
        evidence: for the verifier; where the capture leaves open whether a limit was kept, it was.
        limits: what can be said of each limit.
        lasts_s: time that was looked at, from the drivers' power-up on.
    """

    evidence: Evidence
    limits: tuple[LimitAnswer, ...]
    lasts_s: float


@dataclass(frozen=True, slots=True)
class FittedDriver:
    """The driver of one axis, the microsteps that its pins select, and how its limits are known, by their rules."""

    module: Module
    microsteps: int
    grades: Mapping[str, Grade]

    def read_within(self, slack_counts: int) -> "FittedDriver":
        """Return the driver with limits that are so much wider."""
        return replace(self, module=read_within(self.module, slack_counts))

    def at_rises(self) -> "FittedDriver":
        """Return the driver behind an inverter at STEP: it steps where its edges, as they are given to it, rise."""
        return replace(self, module=replace(self.module, active_edge=ActiveEdge.RISING))


def drivers_of(robot: Robot, profile_name: str | None = None) -> list[FittedDriver]:
    """Return the driver of each axis; raises InputError as `fitted_module`, or for drivers that do not exist."""
    profile = driver_profile(robot.board, profile_name)
    chosen = switched_microsteps(robot, profile, {})
    grades = grades_of(profile)
    return [
        FittedDriver(fitted_module(robot.board_at(joint), profile, microsteps), microsteps, grades)
        for joint, microsteps in zip(robot.axes, chosen, strict=True)
    ]


ONE_CLOCK: Final = ClockFit(0.0, 1.0, 0.0, 0.0, 0)
"""The clock of a capture that has no plan beside it."""


def _in_counts(signals: Sequence[AxisSignals], clock: ClockFit) -> tuple[list[SeenEdges], int]:
    """Return the edges of all axes in counts as the analyser's clock has them, and the count at the plan's t = 0."""
    start_counts = LEAD_COUNTS + round(max(clock.offset_s, 0.0) * COUNTS_PER_SECOND)

    def counts(times_s: FloatArray) -> Int64Array:
        return start_counts + np.rint((times_s - clock.offset_s) * COUNTS_PER_SECOND).astype(np.int64)

    return [_seen(number, each, counts) for number, each in enumerate(signals)], start_counts


def _in_plans_time(axis: AxisEvidence, clock: ClockFit, start_counts: int) -> AxisEvidence:
    """Return evidence by the plan's clock; the pulses stay as long as they were measured."""

    def instants(counts: Int64Array) -> Int64Array:
        return start_counts + np.rint((counts - start_counts) / clock.ratio).astype(np.int64)

    moved = with_instants(axis, instants)
    widths = axis.clk_fall_counts - axis.clk_rise_counts
    return replace(moved, clk_fall_counts=moved.clk_rise_counts + widths)


def _seen(number: int, signals: AxisSignals, counts: Callable[[FloatArray], Int64Array]) -> SeenEdges:
    rises = counts(signals.rises_s)
    falls = np.maximum(counts(signals.falls_s), rises + 1)  # a pulse within a sample is no shorter than a count
    clk = np.column_stack([rises, falls]).ravel()
    edges = counts(signals.direction.times_s)
    levels = (signals.direction.level + 1 + np.arange(edges.size)) & 1
    direction = edges << 1 | levels
    if signals.direction.level:
        direction = np.concatenate(([_MODE_COUNTS << 1 | 1], direction))
    enable = None
    if signals.enable is not None:
        changed = zip(counts(signals.enable.times_s).tolist(), range(1, signals.enable.times_s.size + 1), strict=True)
        first = [PinChange(_ENABLE_COUNTS, number, Pin.ENABLE, 1)] if signals.enable.level else []
        level = signals.enable.level
        enable = first + [PinChange(at, number, Pin.ENABLE, (level + n) & 1) for at, n in changed]
    return SeenEdges(signals.name, PinEdges(clk, direction), enable, signals.rests_high)


def see(
    drivers: Sequence[FittedDriver],
    signals: Sequence[AxisSignals],
    clock: ClockFit,
    starts: Sequence[int],
    reading: Reading,
) -> Seen:
    """Let the drivers see the edges, in the time of the analyser that has measured them.

    Args:
        drivers: the driver of each axis.
        signals: the signals of each axis, as they are recorded.
        clock: the plan's time in them, by which the evidence tells instants.
        starts: each axis' count before the first edge.
        reading: how the edges are read.
    """
    slack_counts = reading.slack_counts
    drivers, edges, start_counts = _wired_up(drivers, signals, clock)
    narrow = _fed(_read(drivers, -slack_counts), [each.at_worst(slack_counts) for each in edges], starts)
    own = [axis.violations.limits for axis in _fed(drivers, [_no_edges(each) for each in edges], starts)]
    wide = _seen_at_best(drivers, edges, starts, reading)
    limits = [
        answer
        for driver, axis, figures, perhaps in zip(drivers, wide, own, narrow, strict=True)
        for answer in answers(axis.name, figures, axis.violations, perhaps.violations, driver.grades)
    ]
    axes = [
        _in_plans_time(replace(axis, violations=replace(axis.violations, limits=figures)), clock, start_counts)
        for axis, figures in zip(wide, own, strict=True)
    ]
    lasts_s = max(axis.last_counts for axis in axes) / COUNTS_PER_SECOND
    return Seen(Evidence(start_counts, tuple(axes)), tuple(limits), lasts_s)


def counted_for_certain(
    drivers: Sequence[FittedDriver], signals: Sequence[AxisSignals], clock: ClockFit, reading: Reading
) -> Evidence:
    """Return what the drivers make of the edges in the pulses' favour, without a word on limits that were kept."""
    drivers, edges, start_counts = _wired_up(drivers, signals, clock)
    axes = _seen_at_best(drivers, edges, [0] * len(edges), reading)
    return Evidence(start_counts, tuple(_in_plans_time(axis, clock, start_counts) for axis in axes))


def _wired_up(
    drivers: Sequence[FittedDriver], signals: Sequence[AxisSignals], clock: ClockFit
) -> tuple[list[FittedDriver], list[SeenEdges], int]:
    """Return the drivers, inverted where that is needed, the edges for them, and the count at the plan's t = 0."""
    edges, start_counts = _in_counts(at_active_edges(signals, drivers), clock)
    pairs = zip(signals, drivers, strict=True)
    return [driver.at_rises() if _at_falls(axis, driver) else driver for axis, driver in pairs], edges, start_counts


def _seen_at_best(
    drivers: Sequence[FittedDriver], edges: Sequence[SeenEdges], starts: Sequence[int], reading: Reading
) -> list[AxisEvidence]:
    best = [each.at_best(reading.slack_counts) for each in edges]
    return _fed(_read(drivers, reading.slack_counts), best, starts, currents=reading.currents)


def _no_edges(edges: SeenEdges) -> SeenEdges:
    return SeenEdges(edges.name, PinEdges([], []), [])


def at_active_edges(signals: Sequence[AxisSignals], drivers: Sequence[FittedDriver]) -> list[AxisSignals]:
    """Return signals in which a pulse begins with an active edge, or shortly before one.

    Where STEP rests high and the driver steps at falls, a fall begins a pulse: STEP is inverted then.
    """
    pairs = zip(signals, drivers, strict=True)
    return [axis.inverted() if _at_falls(axis, driver) else axis for axis, driver in pairs]


def _at_falls(signals: AxisSignals, driver: FittedDriver) -> bool:
    return driver.module.active_edge is ActiveEdge.FALLING and signals.step.level == 1


def _read(drivers: Sequence[FittedDriver], slack_counts: int) -> list[FittedDriver]:
    return [driver.read_within(slack_counts) for driver in drivers]


def _fed(
    drivers: Sequence[FittedDriver], edges: Sequence[SeenEdges], starts: Sequence[int], *, currents: bool = False
) -> list[AxisEvidence]:
    modules = [driver.module for driver in drivers]
    inputs = BoardInputs((), [0] * len(modules), (), min(module.chip.period_min_counts for module in modules))
    bank = DriverBank(modules, inputs)
    bank.supply(SUPPLIES, 0, 1)
    changes = _pins(drivers, edges)
    last_counts = max((int(each.pins.clk_counts[-1]) for each in edges if len(each.pins.clk_counts)), default=0)
    until_counts = last_counts + _TAIL_COUNTS
    begin_counts = 0
    for end_counts in _window_ends(changes, edges, until_counts):
        while changes and changes[0].counts < end_counts:
            bank.set_pin(changes.pop(0))
        bank.show([_within(each.pins, begin_counts, end_counts) for each in edges], end_counts)
        begin_counts = end_counts
    told = bank.pin_changes
    return [
        axis_evidence(each.name, start, bank.trace(axis, until_counts), level_edges(axis, told), currents=currents)
        for axis, (each, start) in enumerate(zip(edges, starts, strict=True))
    ]


def _window_ends(changes: Sequence[PinChange], edges: Sequence[SeenEdges], until_counts: int) -> list[int]:
    """Return the ends of the windows in which something happens; the last one ends at `until_counts`."""
    instants = [np.array([change.counts for change in changes], np.int64)]
    for each in edges:
        instants += [np.asarray(each.pins.clk_counts, np.int64), np.asarray(each.pins.direction, np.int64) >> 1]
    numbers = np.unique(np.concatenate(instants) // _WINDOW_COUNTS)
    ends: list[int] = ((numbers[numbers * _WINDOW_COUNTS < until_counts] + 1) * _WINDOW_COUNTS).tolist()
    return [*(end for end in ends if end < until_counts), until_counts]


def _within(pins: PinEdges, begin_counts: int, end_counts: int) -> PinEdges:
    """Return the pulses and DIR edges that begin in a window."""
    clk, direction = np.asarray(pins.clk_counts, np.int64), np.asarray(pins.direction, np.int64)
    first, last = (2 * np.searchsorted(clk[0::2], (begin_counts, end_counts))).tolist()
    turned, turns = np.searchsorted(direction >> 1, (begin_counts, end_counts)).tolist()
    return PinEdges(clk[first:last], direction[turned:turns])


def _pins(drivers: Sequence[FittedDriver], edges: Sequence[SeenEdges]) -> list[PinChange]:
    """Return the changes of all pins that are held at a level, in order of time."""
    changes: list[PinChange] = []
    for axis, (driver, each) in enumerate(zip(drivers, edges, strict=True)):
        if driver.module.switches is None:
            levels = driver.module.chip.modes.value.levels(driver.microsteps)
            changes += (PinChange(_MODE_COUNTS, axis, Pin(name), level) for name, level in levels.items() if level)
            changes.append(PinChange(_RESET_COUNTS, axis, Pin.RESET, 1))
        changes += [PinChange(_ENABLE_COUNTS, axis, Pin.ENABLE, 1)] if each.enable is None else each.enable
    return sorted(changes, key=lambda change: change.counts)
