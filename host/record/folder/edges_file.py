"""Write and read edges.npz: every edge of every pin and every accepted step, in counts of the timer since power-up."""

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import Int64Array
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.folder.layout import (
    EDGES,
    FOLDER_VERSION,
    VERSION_KEY,
    ContradictionError,
    check_version,
    existing_file,
)
from steptwin.host.record.folder.npz_file import Arrays, opened_npz
from steptwin.host.robots.robot import AXES_MAX
from steptwin.host.verify import (
    AS_PLANNED,
    NO_SLIPS,
    SIXTEENTHS,
    AxisEvidence,
    DriverLimit,
    DriverViolations,
    Evidence,
    LevelEdges,
    Phases,
    RateRamps,
    Slips,
)
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.od import RATE_MAX_Q16
from steptwin.protocol.timer import COUNTS_PER_SECOND

Array = NDArray[Any]


def evidence_until(evidence: Evidence, until_counts: int) -> Evidence:
    """Return the evidence before an instant; a pulse that began before it is kept whole."""
    return replace(
        evidence,
        axes=tuple(_axis_until(axis, until_counts) for axis in evidence.axes),
        outputs=tuple(change for change in evidence.outputs if change.counts < until_counts),
    )


def _axis_until(axis: AxisEvidence, until_counts: int) -> AxisEvidence:
    def before(counts: Int64Array) -> slice:
        return slice(int(np.searchsorted(counts, until_counts)))

    def cut(part: _Series) -> _Series:
        kept = before(part.counts)
        changes: dict[str, Any] = {name: values[kept] for name, values in _columns(part).items()}
        return replace(part, **changes)

    pulses, turns, steps = before(axis.clk_rise_counts), before(axis.dir_edge_counts), before(axis.step_counts)
    return replace(
        axis,
        clk_rise_counts=axis.clk_rise_counts[pulses],
        clk_fall_counts=axis.clk_fall_counts[pulses],
        dir_edge_counts=axis.dir_edge_counts[turns],
        dir_levels=axis.dir_levels[turns],
        step_counts=axis.step_counts[steps],
        step_signs=axis.step_signs[steps],
        violations=cut(axis.violations),
        phases=cut(axis.phases),
        pins={pin: cut(edges) for pin, edges in axis.pins.items()},
        slips=cut(axis.slips),
        rates=cut(axis.rates),
    )


_AnySeries = LevelEdges | Phases | DriverViolations | Slips | RateRamps
"""Evidence in arrays of equal length, with one array of instants."""
_Series = TypeVar("_Series", LevelEdges, Phases, DriverViolations, Slips, RateRamps)


def _columns(part: _AnySeries) -> dict[str, Array]:
    """Return the arrays of a part of the evidence by name."""
    values = {field.name: getattr(part, field.name) for field in fields(part)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


PINS: Final = ("reset", "enable", "m1", "m2", "tq1", "tq2", "dcy1", "dcy2", "out1", "out2")
"""Pins of an axis that are held at a level."""

EDGE_TYPES: Final = (
    {"clk_rise_counts": "<i8", "clk_fall_counts": "<i8", "dir_edge_counts": "<i8", "dir_levels": "|i1"}
    | {"step_counts": "<i8", "step_signs": "|i1"}
    | {"violation_counts": "<i8", "violation_which": "|i1", "violation_values": "<f8"}
    | {"phase_counts": "<i8", "phase_a_ma": "<i2", "phase_b_ma": "<i2"}
    | {f"{pin}_{column}": code for pin in PINS for column, code in (("counts", "<i8"), ("levels", "|i1"))}
)
"""Numpy's type codes of the arrays of `edge_arrays`, by key without the axis' name; field angles are separate."""

ANGLE_TYPES: Final = {"phase_sixteenths": "|i1", "phase_substeps": "<i4"}
"""Type codes of the field's angles; an axis has one of the two."""
SLIP_TYPES: Final = {"slip_counts": "<i8", "slip_full_steps": "<i4"}
"""Type codes of arrays that only axes with slipped motors have."""
RATE_TYPES: Final = {"rate_counts": "<i8", "rate_from_q16": "<i8", "rate_to_q16": "<i8", "rate_lasts_counts": "<i8"}
"""Type codes of arrays that only axes with pauses or changes of speed have."""
RARE_TYPES: Final = SLIP_TYPES | RATE_TYPES
ARRAY_TYPES: Final = EDGE_TYPES | ANGLE_TYPES | RARE_TYPES
RAMP_COUNTS_MAX: Final = 60 * COUNTS_PER_SECOND
"""Longest ramp of the rate; a board's last up to 25 s."""
PER_FULL_STEP_MAX: Final = 32_000
"""The least common multiple of all microsteps."""


def angle_column(per_full_step: int) -> str:
    """Return the name of the array of field angles by the substeps in a full step; old files have sixteenths."""
    return "phase_sixteenths" if per_full_step == SIXTEENTHS else "phase_substeps"


_INT16: Final = (-(1 << 15), (1 << 15) - 1)
_INT32: Final = (-(1 << 31), (1 << 31) - 1)
_INT64: Final = (-(1 << 63), (1 << 63) - 1)


class AxisTotals(NamedTuple):
    """Facts of an axis with a size that does not depend on its edges."""

    name: str
    start_steps: int
    active_edge: ActiveEdge
    limits: tuple[DriverLimit, ...]
    per_full_step: int = SIXTEENTHS

    @classmethod
    def of(cls, axis: AxisEvidence) -> "AxisTotals":
        """Return the facts of an axis."""
        return cls(axis.name, axis.start_steps, axis.active_edge, axis.violations.limits, axis.phases.per_full_step)


def write_edges(path: Path, evidence: Evidence) -> None:
    """Write the evidence without the outputs' names, which robot.toml has."""
    totals = [AxisTotals.of(axis) for axis in evidence.axes]
    arrays: dict[str, Any] = {**header_arrays(evidence.start_counts, totals)}
    for axis in evidence.axes:
        arrays |= edge_arrays(axis)
    with whole_file(path) as file:
        np.savez_compressed(file, **arrays)


def header_arrays(start_counts: int, axes: Sequence[AxisTotals]) -> dict[str, Array | np.int64]:
    """Return all arrays, by key, except those of `edge_arrays`."""
    values: dict[str, Array | np.int64] = {
        VERSION_KEY: np.int64(FOLDER_VERSION),
        "counts_per_second": np.int64(COUNTS_PER_SECOND),
        "start_counts": np.int64(start_counts),
        "axes": np.array([axis.name for axis in axes], dtype=np.str_),
    }
    for axis in axes:
        values[f"{axis.name}_start_steps"] = np.int64(axis.start_steps)
        values[f"{axis.name}_active_edge"] = np.array(axis.active_edge.value, np.str_)
        if axis.per_full_step != SIXTEENTHS:
            values[f"{axis.name}_substeps_per_full_step"] = np.int64(axis.per_full_step)
        values |= _limit_arrays(axis.name, axis.limits)
    return values


def edge_arrays(axis: AxisEvidence) -> dict[str, Array]:
    """Return the arrays, by key, that grow with an axis' edges."""
    name = axis.name
    arrays: dict[str, Array] = {
        f"{name}_clk_rise_counts": axis.clk_rise_counts,
        f"{name}_clk_fall_counts": axis.clk_fall_counts,
        f"{name}_dir_edge_counts": axis.dir_edge_counts,
        f"{name}_dir_levels": axis.dir_levels,
        f"{name}_step_counts": axis.step_counts,
        f"{name}_step_signs": axis.step_signs,
    }
    pins = {pin: axis.pins[pin] for pin in PINS}
    parts: dict[str, _AnySeries] = {"violation": axis.violations, "phase": axis.phases, **pins}
    for prefix, part in parts.items():
        arrays |= {f"{name}_{prefix}_{column}": values for column, values in _columns(part).items()}
    if axis.phases.per_full_step == SIXTEENTHS:
        arrays[f"{name}_phase_sixteenths"] = arrays.pop(f"{name}_phase_substeps").astype(np.int8)
    if axis.slips.counts.size:
        arrays[f"{name}_slip_counts"] = axis.slips.counts
        arrays[f"{name}_slip_full_steps"] = axis.slips.full_steps.astype(SLIP_TYPES["slip_full_steps"])
    if axis.rates.counts.size:
        arrays |= {f"{name}_rate_{column}": values for column, values in _columns(axis.rates).items()}
    return arrays


def _limit_arrays(name: str, limits: tuple[DriverLimit, ...]) -> dict[str, Array]:
    """Return an array for each column of the table of limits; a violation refers to a row of it."""
    return {
        f"{name}_limit_rules": np.array([limit.rule for limit in limits], np.str_),
        f"{name}_limit_broken": np.array([limit.broken for limit in limits], np.str_),
        f"{name}_limit_values": np.array([limit.limit for limit in limits], np.float64),
        f"{name}_limit_units": np.array([limit.unit for limit in limits], np.str_),
        f"{name}_limit_sources": np.array([limit.source for limit in limits], np.str_),
    }


def read_edges(folder: Path) -> Evidence:
    """Return the evidence in edges.npz without the outputs' names.

    Raises:
        InputError: the file or a key is missing, a value has another kind, or the file has another version.
        ContradictionError: arrays do not fit each other.
    """
    path = existing_file(folder, EDGES)
    with prefixed(f"{path}: "), opened_npz(path) as stored:
        return evidence_of(Arrays(stored))


def evidence_of(arrays: Arrays) -> Evidence:
    """Return the evidence from arrays with the keys of edges.npz; raises as `read_edges`, without the path."""
    check_version(arrays.integer(VERSION_KEY, _INT64))
    counts_per_second = arrays.integer("counts_per_second", _INT64)
    if counts_per_second != COUNTS_PER_SECOND:
        raise InputError(f"counts_per_second: {counts_per_second} is not {COUNTS_PER_SECOND}")
    names = arrays.names("axes")
    if not 1 <= len(names) <= AXES_MAX or len(set(names)) < len(names):
        raise ContradictionError(f"axes: has {len(names)} names, not 1 to {AXES_MAX} different ones")
    return Evidence(arrays.instant("start_counts"), tuple(_axis(arrays, name) for name in names))


def _axis(arrays: Arrays, name: str) -> AxisEvidence:
    rises, falls = _pulses(arrays, name)
    turns = arrays.instants(f"{name}_dir_edge_counts")
    steps = arrays.instants(f"{name}_step_counts")
    return AxisEvidence(
        name=name,
        start_steps=arrays.integer(f"{name}_start_steps", _INT32),
        clk_rise_counts=rises,
        clk_fall_counts=falls,
        active_edge=arrays.choice(f"{name}_active_edge", ActiveEdge),
        dir_edge_counts=turns,
        dir_levels=arrays.one_of_two(f"{name}_dir_levels", (0, 1), f"{name}_dir_edge_counts", turns.size),
        step_counts=steps,
        step_signs=arrays.one_of_two(f"{name}_step_signs", (-1, 1), f"{name}_step_counts", steps.size),
        violations=_violations(arrays, name),
        phases=_phases(arrays, name),
        pins={pin: _pin(arrays, f"{name}_{pin}") for pin in PINS},
        slips=_slips(arrays, name),
        rates=_rates(arrays, name),
    )


def _rates(arrays: Arrays, name: str) -> RateRamps:
    key = f"{name}_rate_counts"
    if key not in arrays:
        return AS_PLANNED
    counts = arrays.instants(key)
    bounds = ((0, RATE_MAX_Q16), (0, RATE_MAX_Q16), (0, RAMP_COUNTS_MAX))
    columns = ("from_q16", "to_q16", "lasts_counts")
    values = (
        arrays.bounded(f"{name}_rate_{column}", bound, key, counts.size).astype(np.int64)
        for column, bound in zip(columns, bounds, strict=True)
    )
    return RateRamps(counts, *values)


def _slips(arrays: Arrays, name: str) -> Slips:
    key = f"{name}_slip_counts"
    if key not in arrays:
        return NO_SLIPS
    counts = arrays.instants(key)
    return Slips(counts, arrays.integers(f"{name}_slip_full_steps", key, counts.size))


def _pulses(arrays: Arrays, name: str) -> tuple[Int64Array, Int64Array]:
    """Return rises and falls, which must alternate."""
    rise_key, fall_key = f"{name}_clk_rise_counts", f"{name}_clk_fall_counts"
    rises, falls = arrays.instants(rise_key), arrays.instants(fall_key)
    if rises.size != falls.size:
        raise ContradictionError(f"{rise_key}: {rises.size} values, but {fall_key} has {falls.size}")
    if (falls <= rises).any() or (rises[1:] <= falls[:-1]).any():
        raise ContradictionError(f"{rise_key}: the instants do not alternate with {fall_key}")
    return rises, falls


def _pin(arrays: Arrays, key: str) -> LevelEdges:
    counts = arrays.instants(f"{key}_counts")
    return LevelEdges(counts, arrays.one_of_two(f"{key}_levels", (0, 1), f"{key}_counts", counts.size))


def _violations(arrays: Arrays, name: str) -> DriverViolations:
    limits = _limits(arrays, name)
    key = f"{name}_violation_counts"
    counts = arrays.instants(key)
    which = arrays.bounded(f"{name}_violation_which", (0, len(limits) - 1), key, counts.size).astype(np.int8)
    return DriverViolations(limits, counts, which, arrays.numbers(f"{name}_violation_values", key, counts.size))


def _limits(arrays: Arrays, name: str) -> tuple[DriverLimit, ...]:
    rules, broken, units, sources = (
        arrays.names(f"{name}_limit_{column}") for column in ("rules", "broken", "units", "sources")
    )
    values = arrays.numbers(f"{name}_limit_values", f"{name}_limit_rules", len(rules)).tolist()
    if not len(rules) == len(broken) == len(units) == len(sources):
        raise ContradictionError(f"{name}_limit_rules: {len(rules)} values, but the texts or units have another number")
    return tuple(map(DriverLimit, rules, broken, values, units, sources))


def _phases(arrays: Arrays, name: str) -> Phases:
    key, unit = f"{name}_phase_counts", f"{name}_substeps_per_full_step"
    counts = arrays.instants(key)
    per_full_step = arrays.integer(unit, (1, PER_FULL_STEP_MAX)) if unit in arrays else SIXTEENTHS
    angles = f"{name}_{angle_column(per_full_step)}"
    return Phases(
        counts,
        arrays.bounded(angles, (0, 4 * per_full_step - 1), key, counts.size).astype(np.int32),
        arrays.bounded(f"{name}_phase_a_ma", _INT16, key, counts.size).astype(np.int16),
        arrays.bounded(f"{name}_phase_b_ma", _INT16, key, counts.size).astype(np.int16),
        per_full_step,
    )
