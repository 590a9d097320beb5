"""Place steps by the firmware's own motion kernel: a planned motion, or a load of sines and constant speeds."""

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice, repeat
from math import ceil
from typing import NamedTuple

import numpy as np

from steptwin.bench.step_methods import REPEATS, AxisPulses, PlacedPulses
from steptwin.bench.step_methods.motions import AXES, MICROSTEPS, POINT_MS, UNITS_PER_STEP, PlannedMotion
from steptwin.controller.motion.axis_motion import PinEdges, Refusal
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.board_motion import BoardMotion
from steptwin.controller.motion.kernel import TICKS_PER_MS
from steptwin.controller.motion.step_config import StepConfig
from steptwin.host.common.arrays import FloatArray
from steptwin.protocol.od import UNITS_PER_FULL_STEP

POINTS_AHEAD = 60

Record = tuple[int, int, int]
"""A PVT record: displacement in units, end velocity in 1/64 unit per ms, duration in ms."""


class Advance(NamedTuple):
    """One call of `Motion.advance`: the time that it took, and the edges of each axis."""

    dt_s: float
    edges: tuple[PinEdges, ...]


@dataclass(frozen=True)
class Load:
    """A motion of one axis from rest to rest: positions and velocities at evenly spaced points."""

    name: str
    positions_steps: FloatArray
    velocities_hz: FloatArray
    point_ms: int = POINT_MS

    @property
    def duration_s(self) -> float:
        """Duration of the motion."""
        return (len(self.positions_steps) - 1) * self.point_ms / 1000

    def records(self) -> list[Record]:
        """Round the motion to PVT records."""
        units = np.floor(self.positions_steps * UNITS_PER_STEP + 0.5).astype(np.int64)
        velocities = np.round(self.velocities_hz * UNITS_PER_STEP * 64 / 1000).astype(np.int64)
        return [(int(d), int(v), self.point_ms) for d, v in zip(np.diff(units), velocities[1:], strict=True)]


def sine(peak_hz: float, sine_hz: float, periods: int, point_ms: int = POINT_MS) -> Load:
    """Make A (1 - cos wt), whose step rate reaches `peak_hz`."""
    t_s = np.arange(round(periods * 1000 / point_ms / sine_hz) + 1) * point_ms / 1000
    omega = 2 * np.pi * sine_hz
    amplitude = peak_hz / omega
    return Load(
        f"sine, {peak_hz / 1000:g} kHz peak",
        amplitude * (1 - np.cos(omega * t_s)),
        peak_hz * np.sin(omega * t_s),
        point_ms,
    )


def constant(rate_hz: float, duration_s: float, point_ms: int = POINT_MS) -> Load:
    """Make a constant step rate between two ramps of 100 ms."""
    t_s = np.arange(round(duration_s * 1000 / point_ms) + 1) * point_ms / 1000
    ramp_s = 0.1
    velocities = rate_hz * np.clip(np.minimum(t_s, t_s[-1] - t_s) / ramp_s, 0, 1)
    positions = np.concatenate(([0.0], np.cumsum((velocities[1:] + velocities[:-1]) / 2 * point_ms / 1000)))
    return Load(f"constant {rate_hz / 1000:g} kHz", positions, velocities, point_ms)


def ready(kernel: Kernel, timing: StepConfig, axes: int = AXES) -> BoardMotion:
    """Return a motion whose axes have this pulse timing and stand at 0."""
    motion = BoardMotion(kernel, axes)
    for axis in range(axes):
        motion.axes[axis].configure(timing)
    return motion


def run(motion: BoardMotion, load: Load, repeats: int = 1) -> Iterator[Advance]:
    """Run a load on all axes, `repeats` times in a row."""
    records = load.records()
    return run_records(motion, [chain.from_iterable(repeat(records, repeats)) for _ in range(motion.axis_count)])


def run_records(motion: BoardMotion, records: Sequence[Iterable[Record]]) -> Iterator[Advance]:
    """Queue the records of each axis POINTS_AHEAD at a time and advance the motion to their end.

    All axes have records of the same durations. The motion stops one tick before the queues are empty and waits for
    the next records: an empty queue in motion is an underrun.
    """
    sources = [iter(own) for own in records]
    batches = [list(islice(source, POINTS_AHEAD)) for source in sources]
    end_tick = 0
    while batches[0]:
        for axis, batch in enumerate(batches):
            for record in batch:
                assert motion.axes[axis].push(*record) is Refusal.ACCEPTED
            if not end_tick:
                motion.axes[axis].start()
        end_tick += TICKS_PER_MS * sum(duration_ms for _, _, duration_ms in batches[0])
        batches = [list(islice(source, POINTS_AHEAD)) for source in sources]
        until_tick = end_tick - 1 if batches[0] else end_tick
        while motion.tick < until_tick:
            started = time.perf_counter()
            motion.advance(until_tick)
            dt_s = time.perf_counter() - started
            motion.take_events()
            yield Advance(dt_s, motion.take_edges())


UNLIMITED = StepConfig(MICROSTEPS, 3_000, 1_000, 0, 0, velocity_max_units_per_s=250_000 * UNITS_PER_STEP)
"""Pulse timing that allows 250 kHz, so that the kernel is measured and not the driver's limits."""


def kernel_method(kernel: Kernel, motion: PlannedMotion) -> PlacedPulses:
    """Place a motion, fed 60 points ahead; only `Motion.advance` is timed, not feeding and draining."""
    once = [place_once(kernel, motion) for _ in range(REPEATS + 1)]
    return PlacedPulses(once[0].axes, min(placed.wall_s for placed in once))


def place_once(kernel: Kernel, planned: PlannedMotion) -> PlacedPulses:
    """Place a motion and time it once."""
    return place_on(board_motion_of(kernel, planned), planned)


def board_motion_of(kernel: Kernel, planned: PlannedMotion) -> BoardMotion:
    """Return a motion whose axes have the pulse timing of the board's settings and stand at their starts."""
    motion, board = BoardMotion(kernel, planned.axes), planned.board
    times_ns = (board.steplen_ns, board.stepspace_ns, board.dirsetup_ns, board.dirhold_ns)
    for axis, microsteps in enumerate(planned.microsteps.tolist()):
        rate_units_per_s = ceil(board.step_rate_max_hz * UNITS_PER_FULL_STEP / microsteps)
        motion.axes[axis].configure(StepConfig(microsteps, *times_ns, velocity_max_units_per_s=rate_units_per_s))
        motion.axes[axis].preset(int(planned.points_units[axis, 0]))
    return motion


def place_on(motion: BoardMotion, planned: PlannedMotion) -> PlacedPulses:
    """Place a motion on a board's and time it."""
    advances = list(run_records(motion, _records(planned)))
    axes = [pulses_of([advance.edges[axis] for advance in advances]) for axis in range(planned.axes)]
    return PlacedPulses(axes, sum(advance.dt_s for advance in advances))


def _records(planned: PlannedMotion) -> list[list[Record]]:
    durations_ms = np.diff(planned.times_ms).tolist()
    return [
        list(zip(np.diff(units).tolist(), velocities[1:].tolist(), durations_ms, strict=True))
        for units, velocities in zip(planned.points_units, planned.velocities, strict=True)
    ]


def pulses_of(parts: list[PinEdges]) -> AxisPulses:
    """Return the pulses in what was handed out of one axis, in order."""
    clk, words = (
        np.concatenate([np.asarray(part, dtype=np.int64) for part in each])
        for each in ([part.clk_counts for part in parts], [part.direction for part in parts])
    )
    return AxisPulses(clk[0::2], clk[1::2], words >> 1, (words & 1).astype(np.int8))
