"""Place steps by the firmware's own motion kernel, with the pulse timing of the board's settings."""

from math import ceil

import numpy as np

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.board_motion import BoardMotion, PinEdges
from steptwin.controller.motion.step_config import StepConfig
from steptwin.host.common.arrays import Int64Array
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.host.studies.step_methods.loads import Record, run_records
from steptwin.host.studies.step_methods.motions import PlannedMotion
from steptwin.host.studies.step_methods.pulses import AxisPulses, PlacedPulses
from steptwin.protocol.od import UNITS_PER_FULL_STEP

REPEATS = 3
"""Number of timed runs; the fastest counts. One run before them compiles."""


def kernel_method(kernel: Kernel, motion: PlannedMotion) -> PlacedPulses:
    """Place a motion, fed 60 points ahead; only `Motion.advance` is timed, not feeding and draining."""
    once = [place_once(kernel, motion) for _ in range(REPEATS + 1)]
    return PlacedPulses(once[0].axes, min(placed.wall_s for placed in once))


def place_once(kernel: Kernel, planned: PlannedMotion) -> PlacedPulses:
    """Place a motion and time it once."""
    motion = BoardMotion(kernel, planned.axes)
    for axis, start_units in enumerate(planned.points_units[:, 0].tolist()):
        motion.configure(axis, _timing(planned.board, int(planned.microsteps[axis])))
        motion.preset(axis, start_units)
    advances = list(run_records(motion, _records(planned)))
    axes = [_joined([advance.edges[axis] for advance in advances]) for axis in range(planned.axes)]
    return PlacedPulses(axes, sum(advance.dt_s for advance in advances))


def _timing(board: BoardSettings, microsteps: int) -> StepConfig:
    return StepConfig(
        microsteps,
        board.steplen_ns,
        board.stepspace_ns,
        board.dirsetup_ns,
        board.dirhold_ns,
        velocity_max_units_per_s=ceil(board.step_rate_max_hz * UNITS_PER_FULL_STEP / microsteps),
    )


def _records(planned: PlannedMotion) -> list[list[Record]]:
    durations_ms = np.diff(planned.times_ms).tolist()
    return [
        list(zip(np.diff(units).tolist(), velocities[1:].tolist(), durations_ms, strict=True))
        for units, velocities in zip(planned.points_units, planned.velocities, strict=True)
    ]


def _joined(parts: list[PinEdges]) -> AxisPulses:
    clk = _concatenated([part.clk_counts for part in parts])
    words = _concatenated([part.direction for part in parts])
    return AxisPulses(clk[0::2], clk[1::2], words >> 1, (words & 1).astype(np.int8))


def _concatenated(parts: list[Int64Array]) -> Int64Array:
    return np.concatenate([np.asarray(part, dtype=np.int64) for part in parts])
