"""Convert the emulator's traces into the verifier's evidence."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.motion.group_time import RateRamp
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.controller.node.pins import Pin, PinChange
from steptwin.emulator.board.board import Board
from steptwin.emulator.board.edges import NO_COUNTS, Int64Array
from steptwin.emulator.board.local_clock import LocalClock
from steptwin.emulator.drivers.driver_bank import AxisTrace
from steptwin.emulator.drivers.limits import LimitUnit, Violations
from steptwin.emulator.drivers.outputs import ChipOutputs
from steptwin.host.twin.machine.robot_boards import RobotBoards
from steptwin.host.verify import (
    AS_PLANNED,
    AxisEvidence,
    DriverLimit,
    DriverViolations,
    LevelEdges,
    Phases,
    RateRamps,
    Slips,
)
from steptwin.protocol.timer import COUNTS_PER_US

_SCALES: Final = {
    LimitUnit.COUNTS: ("us", 1 / COUNTS_PER_US),
    LimitUnit.LEVEL: ("level", 1),
    LimitUnit.CELSIUS: ("degC", 1),
    LimitUnit.VOLT: ("V", 1),
}
"""Unit in the evidence of each unit of the emulator, and the conversion factor."""
_NO_CURRENTS: Final = np.empty(0, np.int16)


def axes_evidence(machine: RobotBoards, *, currents: bool = True) -> tuple[AxisEvidence, ...]:
    """Return the evidence of all axes since power-up, without `currents` as `axis_evidence`."""
    return tuple(
        in_bus_time(_since_power_up(name, start, board, axis, currents=currents), board.own_clock)
        for name, start, (board, axis) in _axes(machine)
    )


def axes_by_own_clocks(machine: RobotBoards, sync_counts: int) -> tuple[AxisEvidence, ...]:
    """Return the evidence of all axes by their own boards' crystals instead of the bus' time.

    Each board's instants are shifted to put its first servo tick after the SYNC where that of an exact crystal is. So
    boards without a fault make exactly the planned edges, whatever their crystals.
    """
    made = []
    for name, start, (board, axis) in _axes(machine):
        evidence = _since_power_up(name, start, board, axis)
        if board.own_clock is not None:
            ahead_counts = tick_after(board.own_clock.local_counts(sync_counts)) - tick_after(sync_counts)
            evidence = with_instants(evidence, partial(np.add, -ahead_counts))
        made.append(evidence)
    return tuple(made)


def _axes(machine: RobotBoards) -> Iterable[tuple[str, int, tuple[Board, int]]]:
    return zip(machine.robot.axis_names, machine.start_steps, machine.axes, strict=True)


def _since_power_up(name: str, start_steps: int, board: Board, axis: int, *, currents: bool = True) -> AxisEvidence:
    trace = board.trace(axis)  # first: it processes the edges of the drivers' pins
    pins, rates = level_edges(axis, board.pin_changes), rate_ramps(board.rate_ramps)
    return axis_evidence(name, start_steps, trace, pins, rates, currents=currents)


def tick_after(counts: int) -> int:
    """Return the instant of the first servo tick at or after an instant."""
    return -(-counts // TICK_COUNTS) * TICK_COUNTS


def axis_evidence(
    name: str,
    start_steps: int,
    trace: AxisTrace,
    pins: Mapping[str, LevelEdges],
    rates: RateRamps = AS_PLANNED,
    *,
    currents: bool = True,
) -> AxisEvidence:
    """Return the evidence of one axis from its driver's trace, pins and rates, by its board's clock.

    Without `currents` it has no phases, which take most of the time.
    """
    return AxisEvidence(
        name=name,
        start_steps=start_steps,
        clk_rise_counts=trace.clk_rise_counts,
        clk_fall_counts=trace.clk_fall_counts,
        active_edge=trace.active_edge,
        dir_edge_counts=trace.dir_counts,
        dir_levels=trace.dir_levels,
        step_counts=trace.step_counts,
        step_signs=trace.step_signs,
        violations=driver_violations(trace.violations),
        phases=_phases(trace.outputs, trace.substeps, currents=currents),
        pins=pins,
        slips=Slips(trace.slip_counts, trace.slip_full_steps),
        rates=rates,
    )


def in_bus_time(axis: AxisEvidence, clock: LocalClock | None) -> AxisEvidence:
    """Return a board's evidence in the time of the bus, as a logic analyser records it.

    Values of violations stay in the board's time; None is an exact clock.
    """
    return axis if clock is None else with_instants(axis, clock.instants)


def with_instants(axis: AxisEvidence, instants: Callable[[Int64Array], Int64Array]) -> AxisEvidence:
    """Return evidence with all instants converted by a function."""
    return replace(
        axis,
        clk_rise_counts=instants(axis.clk_rise_counts),
        clk_fall_counts=instants(axis.clk_fall_counts),
        dir_edge_counts=instants(axis.dir_edge_counts),
        step_counts=instants(axis.step_counts),
        violations=replace(axis.violations, counts=instants(axis.violations.counts)),
        phases=replace(axis.phases, counts=instants(axis.phases.counts)),
        pins={name: replace(edges, counts=instants(edges.counts)) for name, edges in axis.pins.items()},
        slips=replace(axis.slips, counts=instants(axis.slips.counts)),
        rates=replace(
            axis.rates,
            counts=instants(axis.rates.counts),
            lasts_counts=instants(axis.rates.counts + axis.rates.lasts_counts) - instants(axis.rates.counts),
        ),
    )


def driver_violations(violations: Violations) -> DriverViolations:
    """Return violations with limits and values in microseconds if they are in counts."""
    scales = np.array([_SCALES[limit.unit][1] for limit in violations.limits])
    limits = tuple(
        DriverLimit(
            limit.rule.name.lower(), limit.rule.value, limit.value * scale, _SCALES[limit.unit][0], limit.source
        )
        for limit, scale in zip(violations.limits, scales.tolist(), strict=True)
    )
    values = violations.values * scales[violations.which]
    return DriverViolations(limits, violations.counts, violations.which, values)


def _phases(outputs: ChipOutputs, per_full_step: int, *, currents: bool) -> Phases:
    """Sample the phases at each possible change; keep real changes, and power-up."""
    counts = outputs.instants() if currents else NO_COUNTS
    if not counts.size:
        return Phases(NO_COUNTS, np.empty(0, np.int32), _NO_CURRENTS, _NO_CURRENTS, per_full_step)
    values, before = _phase_values(outputs, counts), _phase_values(outputs, counts[:1] - 1)
    changed = (values != np.concatenate((before, values[:-1]))).any(axis=1)
    changed[:1] |= outputs.from_counts == 0
    angle, a_ma, b_ma = values[changed].T
    changes = (angle.astype(np.int32), a_ma.astype(np.int16), b_ma.astype(np.int16))
    return Phases(counts[changed], *changes, per_full_step)


def _phase_values(outputs: ChipOutputs, counts: Int64Array) -> NDArray[np.int64]:
    """Return the angle in substeps and both currents in mA, shape (n, 3)."""
    currents_ma = np.rint(1000 * outputs.currents_a(counts)).astype(np.int64)
    return np.column_stack([outputs.field_substeps(counts), currents_ma])


def rate_ramps(ramps: Sequence[RateRamp]) -> RateRamps:
    """Return the ramps of a board's rate of its interpolating axes' time."""
    columns = np.array(ramps, np.int64).reshape(-1, len(RateRamp._fields))
    ticks, from_q16, to_q16, lasts_ticks = columns.T
    return RateRamps(ticks * TICK_COUNTS, from_q16, to_q16, lasts_ticks * TICK_COUNTS)


def level_edges(axis: int, changes: Sequence[PinChange]) -> dict[str, LevelEdges]:
    """Return the edges of one axis' level pins, by name."""
    in_order = sorted(changes, key=lambda change: change.counts)
    edges = {pin: [change for change in in_order if (change.axis, change.pin) == (axis, pin)] for pin in Pin}
    return {
        pin.value.lower(): LevelEdges(
            np.array([change.counts for change in own], np.int64), np.array([change.level for change in own], np.int8)
        )
        for pin, own in edges.items()
    }
