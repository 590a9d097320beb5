"""What a run leaves behind for the verifier: the pins as the drivers saw them and the steps that they accepted."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

COUNTS_PER_SECOND = 72_000_000
"""The board's timer: every instant in the evidence is an int64 number of its counts since boot."""

Int64Array = NDArray[np.int64]
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
class AxisEvidence:
    """One axis: its CLK and DIR pins and its driver's accepted steps, all times in counts since boot, sorted.

    Attributes:
        name: the joint.
        start_steps: where the motor stands at power-up, in steps from the joint's zero.
        clk_rise_counts: shape (pulses,), every CLK rise, accepted or not.
        clk_fall_counts: shape (pulses,), the fall that ends each of those pulses.
        dir_edge_counts: shape (d,), every change of the DIR pin.
        dir_levels: shape (d,), the level after each of those changes, 0 or 1.
        step_counts: shape (steps,), the CLK rises that the driver accepted.
        step_signs: shape (steps,), +1 or -1, the way in which each of them moved the motor.
        violations: how many pulses broke a limit of the driver.
        pins: the axis' other pins by their names in small letters: `reset`, `enable`, `m1`, ..., `out1`, `out2`.
    """

    name: str
    start_steps: int
    clk_rise_counts: Int64Array
    clk_fall_counts: Int64Array
    dir_edge_counts: Int64Array
    dir_levels: Int8Array
    step_counts: Int64Array
    step_signs: Int8Array
    violations: int
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
