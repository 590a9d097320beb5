"""What a run leaves behind for the verifier: the pins as the drivers saw them and the steps that they accepted."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.board_settings import ActiveEdge

"""The board's timer: every instant in the evidence is an int64 number of its counts since boot."""

Int64Array = NDArray[np.int64]
Int16Array = NDArray[np.int16]
Int8Array = NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class LevelEdges:
    """A pin that is held at a level, low at power-up.

    Attributes:
        counts: shape (n,), each change, sorted; two at one instant are a pulse too short for the clock.
        levels: shape (n,), the level after it, 0 or 1.
    """

    counts: Int64Array
    levels: Int8Array


@dataclass(frozen=True, slots=True)
class DriverLimit:
    """What a driver asks for.

    Attributes:
        rule: a short name, for machines.
        broken: what is wrong where it is broken and what comes of that, for people.
        limit: its figure.
        unit: of the figure.
        source: who says so.
    """

    rule: str
    broken: str
    limit: float
    unit: str
    source: str


@dataclass(frozen=True, slots=True)
class DriverViolations:
    """Each time that a limit of one driver was broken, in order of time.

    Attributes:
        limits: those that there are.
        counts: shape (n,), when, in counts since boot.
        which: shape (n,), the index of the limit.
        values: shape (n,), what there was instead, in the limit's unit.
    """

    limits: tuple[DriverLimit, ...]
    counts: Int64Array
    which: Int8Array
    values: FloatArray


@dataclass(frozen=True, slots=True)
class Phases:
    """What one driver does with its motor: the values from each instant on, all of shape (n,).

    Attributes:
        counts: when they change, sorted.
        sixteenths: the field's electrical angle, in sixteenths of a full step from 0 to 63; it grows with DIR low.
        a_ma: the current that is regulated in phase A, in mA.
        b_ma: that in phase B.
    """

    counts: Int64Array
    sixteenths: Int8Array
    a_ma: Int16Array
    b_ma: Int16Array


@dataclass(frozen=True, slots=True)
class AxisEvidence:
    """One axis: its STEP and DIR pins and its driver's accepted steps, all times in counts since boot, sorted.

    The board's STEP is the chip's CLK, or its inverse where the falling edge is active.

    Attributes:
        name: the joint.
        start_steps: where the motor stands at power-up, in steps from the joint's zero.
        clk_rise_counts: shape (pulses,), every rise of STEP, accepted or not.
        clk_fall_counts: shape (pulses,), the fall that ends each of those pulses.
        active_edge: the edge of STEP with which the chip's CLK rises.
        dir_edge_counts: shape (d,), every change of the DIR pin.
        dir_levels: shape (d,), the level after each of those changes, 0 or 1.
        step_counts: shape (steps,), the rises of those pulses that the driver accepted.
        step_signs: shape (steps,), +1 or -1, the way in which each of them moved the motor.
        violations: where limits of the driver were broken.
        phases: electrical angle and currents.
        pins: the axis' other pins by their names in small letters: `reset`, `enable`, `m1`, ..., `out1`, `out2`.
    """

    name: str
    start_steps: int
    clk_rise_counts: Int64Array
    clk_fall_counts: Int64Array
    active_edge: ActiveEdge
    dir_edge_counts: Int64Array
    dir_levels: Int8Array
    step_counts: Int64Array
    step_signs: Int8Array
    violations: DriverViolations
    phases: Phases
    pins: Mapping[str, LevelEdges]


@dataclass(frozen=True, slots=True)
class OutputChange:
    """A digital output takes a level, at an instant in counts since boot."""

    name: str
    counts: int
    level: int


@dataclass(frozen=True, slots=True)
class Evidence:
    """One run: all axes, and every change of the outputs in order of time.

    The planned trajectory's t = 0 is the board's instant `start_counts`.
    """

    start_counts: int
    axes: tuple[AxisEvidence, ...]
    outputs: tuple[OutputChange, ...] = ()
