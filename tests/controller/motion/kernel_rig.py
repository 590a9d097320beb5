"""A kernel without firmware: its storage, its configuration and its edges as plain lists."""

from bisect import bisect_left
from dataclasses import dataclass

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.group_time import GroupTime


@dataclass(frozen=True)
class Timing:
    """Driver timing in counts."""

    steplen: int = 2376
    stepspace: int = 2424
    dirsetup: int = 1080
    dirhold: int = 1080


class KernelRig:
    """Drives the kernel's functions directly, one or more axes with the same configuration."""

    def __init__(
        self,
        kernel: Kernel,
        axes: int = 1,
        microsteps: int = 16,
        timing: Timing | None = None,
        rate_limit_q16_per_ms: int = 15 * k.STEP_Q16,
        edges: int = 1 << 15,
    ) -> None:
        timing = timing or Timing()
        self.kernel = kernel
        self.count = axes
        self.tick = 0
        self.asking = 0
        """Number of axes that needed attention where the last advance ended."""
        self.axes = kernel.cells(axes * k.AXIS_FIELDS)
        self.axes_before = kernel.cells(axes * k.AXIS_FIELDS)
        self.queue = kernel.cells(axes * k.QUEUE_DEPTH * k.SEGMENT_FIELDS)
        self.group = kernel.cells(k.GROUP_FIELDS)
        self.time = GroupTime(self.group)
        self.clk = kernel.rows(axes, edges)
        self.direction = kernel.rows(axes, edges)
        for axis in range(axes):
            self.set(k.MICROSTEPS, microsteps, axis)
            self.set(k.STEPLEN_COUNTS, timing.steplen, axis)
            self.set(k.STEPSPACE_COUNTS, timing.stepspace, axis)
            self.set(k.DIRSETUP_COUNTS, timing.dirsetup, axis)
            self.set(k.DIRHOLD_COUNTS, timing.dirhold, axis)
            self.set(k.RATE_LIMIT_Q16_PER_MS, rate_limit_q16_per_ms, axis)
            self.set(k.LAST_RISE_COUNTS, k.NEVER_COUNTS, axis)
            self.set(k.DURATION_TICKS, 1, axis)

    def get(self, field: int, axis: int = 0) -> int:
        return int(self.axes[axis * k.AXIS_FIELDS + field])

    def set(self, field: int, value: int, axis: int = 0) -> None:
        self.axes[axis * k.AXIS_FIELDS + field] = value

    def push(self, displacement_units: int, end_velocity: int, duration_ms: int, axis: int = 0) -> int:
        return self.push_ticks(displacement_units, end_velocity, duration_ms * k.TICKS_PER_MS, axis)

    def push_ticks(self, displacement_units: int, end_velocity: int, duration_ticks: int, axis: int = 0) -> int:
        return self.kernel.push(self.axes, self.queue, axis, displacement_units, end_velocity, duration_ticks)

    def start(self, axis: int = 0) -> bool:
        return self.kernel.next_segment(self.axes, self.queue, axis)

    def ramp(self, rate_q16: int, ticks: int) -> None:
        """Ramp the group's rate to another one within a number of ticks."""
        self.group[k.RATE_FROM_Q16] = self.time.rate_q16(self.tick)
        self.group[k.RATE_TO_Q16] = rate_q16
        self.group[k.RAMP_TICK] = self.tick
        self.group[k.RAMP_TICKS] = ticks

    def advance(self, ticks: int) -> int:
        """Run all axes for a number of ticks at most; return the tick reached."""
        self.tick, self.asking = self.kernel.advance(
            self.axes,
            self.axes_before,
            self.queue,
            self.group,
            self.clk,
            self.direction,
            self.count,
            self.tick,
            self.tick + ticks,
        )
        return self.tick

    def rises(self, axis: int = 0) -> list[int]:
        return [int(t) for t in self.clk[axis][: self.get(k.CLK_EDGES, axis) : 2]]

    def falls(self, axis: int = 0) -> list[int]:
        return [int(t) for t in self.clk[axis][1 : self.get(k.CLK_EDGES, axis) : 2]]

    def dir_edges(self, axis: int = 0) -> list[tuple[int, int]]:
        words = [int(word) for word in self.direction[axis][: self.get(k.DIR_EDGES, axis)]]
        return [(word >> 1, word & 1) for word in words]

    def signs(self, axis: int = 0) -> list[int]:
        """Return the direction in which each rise moves the motor, from the pins alone."""
        edges = self.dir_edges(axis)
        signs, level, i = [], 0, 0
        for rise in self.rises(axis):
            while i < len(edges) and edges[i][0] <= rise:
                level = edges[i][1]
                i += 1
            signs.append(2 * level - 1)
        return signs

    def snapshot(self) -> tuple[list[int], list[list[int]], list[list[tuple[int, int]]]]:
        """Return all results on which two kernels must agree, bit for bit."""
        rows = range(self.count)
        return (
            [int(value) for value in self.axes],
            [[*self.rises(axis), *self.falls(axis)] for axis in rows],
            [self.dir_edges(axis) for axis in rows],
        )


def timing_faults(rig: KernelRig, timing: Timing, axis: int = 0) -> list[str]:
    """Return the timing violations in the edges that a kernel has placed for an axis."""
    return pin_timing_faults(rig.rises(axis), rig.falls(axis), rig.dir_edges(axis), timing)


def pin_timing_faults(
    rises: list[int], falls: list[int], directions: list[tuple[int, int]], timing: Timing
) -> list[str]:
    """Return the edges that violate one of the driver's four times, without knowing how they were made."""
    faults = [
        f"pulse {i} is {fall - rise} counts high"
        for i, (rise, fall) in enumerate(zip(rises, falls, strict=True))
        if fall - rise != timing.steplen
    ]
    faults += [
        f"CLK is low for {rise - fall} counts before pulse {i + 1}"
        for i, (fall, rise) in enumerate(zip(falls, rises[1:], strict=False))
        if rise - fall < timing.stepspace
    ]
    for counts, _ in directions:
        after = bisect_left(rises, counts)  # the first rise at or after the DIR edge
        if after < len(rises) and rises[after] - counts < timing.dirsetup:
            faults.append(f"a rise {rises[after] - counts} counts after DIR")
        if after > 0 and counts - rises[after - 1] < timing.dirhold:
            faults.append(f"DIR {counts - rises[after - 1]} counts after a rise")
    return faults
