"""Draw the pictures of docs/evidence.md: `python -m steptwin.bench.benchmark_pictures [DIR]` measures again."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.bench import kernel_speed
from steptwin.bench.step_methods.evaluation import ideal_of, step_errors
from steptwin.bench.step_methods.motions import PlannedMotion, all_motions, stress
from steptwin.bench.step_methods.table import methods
from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.host.record.plots.canvas import COUNTED, STYLE, WIDTH_INCHES
from steptwin.protocol.timer import COUNTS_PER_SECOND

DOTS_PER_INCH: Final = 90
GREY: Final = "0.55"
DOCS: Final = Path(__file__).resolve().parents[2] / "docs" / "pictures"
_HEADROOM: Final = 1.08
"""Axis limit over the largest value, so that the highest marker is not cut off."""
_TIMED: Final = ("warehouse-scara pull-line", "seven axes, 14 kHz")
"""Motions whose timing errors are drawn."""
_LEAST_US: Final = 0.005
"""Left end of the axis of errors, less than one count of the board's timer."""
_CLOSE_UP_AXIS: Final = 6
_CLOSE_UP_S: Final = (1.0, 1.0015)
"""Window of the stress test while its last axis runs at 9.8 kHz."""


def timing_errors(motions: list[PlannedMotion], kernel: Kernel) -> Figure:
    """Draw for each motion the share of each method's steps whose timing error is at most a given time."""
    figure = Figure(figsize=(WIDTH_INCHES, 4.6), layout="constrained")
    figure.suptitle("Timing error of each method's steps (SIMULATED)", x=0.01, ha="left", weight="bold")
    panels = figure.subplots(1, len(motions), sharex=True, sharey=True)
    for panel, motion in zip(panels, motions, strict=True):
        ideal = ideal_of(motion)
        for method in methods(kernel):
            axes = method.place(motion).axes
            errors = [step_errors(motion, axis, ideal[axis], pulses).timing_us for axis, pulses in enumerate(axes)]
            late_us = np.sort(np.abs(np.concatenate(errors)))
            width = 2.4 if method.key == "kernel" else 1.3
            percent = 100 * np.arange(1, late_us.size + 1) / late_us.size
            panel.plot(late_us, percent, label=method.title, linewidth=width)
        panel.set_title(motion.name, loc="left")
        panel.set_xscale("log")
        panel.set_xlim(_LEAST_US, None)
        panel.set_xlabel("|edge minus ideal crossing| [us], logarithmic")
    panels[0].set_ylabel("steps within it [%]")
    panels[-1].legend(loc="lower right", fontsize=8)
    return figure


def close_up(motion: PlannedMotion, kernel: Kernel) -> Figure:
    """Draw CLK of one fast axis as each method makes it, over the ideal crossings."""
    begin_s, end_s = _CLOSE_UP_S
    ideal_s = ideal_of(motion)[_CLOSE_UP_AXIS].time_s
    ideal_us = (ideal_s[(ideal_s >= begin_s) & (ideal_s < end_s)] - begin_s) * 1e6
    made = methods(kernel)
    figure = Figure(figsize=(WIDTH_INCHES, 4.4), layout="constrained")
    figure.suptitle(
        f"{motion.name}: CLK of {motion.exact.joint_names[_CLOSE_UP_AXIS]} from t = {begin_s:g} s (SIMULATED)",
        x=0.01, ha="left", weight="bold",
    )  # fmt: skip
    panel = figure.subplots()
    panel.vlines(ideal_us, -0.5, len(made) - 0.5, color="0.6", linewidth=0.9, linestyle=(0, (4, 3)))
    for row, method in enumerate(made):
        pulses = method.place(motion).axes[_CLOSE_UP_AXIS]
        rises, falls = (
            (edges / COUNTS_PER_SECOND - begin_s) * 1e6 for edges in (pulses.rise_counts, pulses.fall_counts)
        )
        seen = (falls > 0) & (rises < (end_s - begin_s) * 1e6)
        edges_us = np.column_stack([rises[seen], rises[seen], falls[seen], falls[seen]]).ravel()
        levels = np.tile([0.0, 0.55, 0.55, 0.0], int(seen.sum()))
        begin_us, end_us = min(0.0, edges_us[0]), max((end_s - begin_s) * 1e6, edges_us[-1])
        panel.plot([begin_us, *edges_us, end_us], row + 0.25 - np.array([0.0, *levels, 0.0]), color=COUNTED)
    panel.set_yticks(range(len(made)), [method.title for method in made])
    panel.set_ylim(len(made) - 0.5, -0.5)
    panel.set_xlim(0, (end_s - begin_s) * 1e6)
    panel.set_xlabel("time [us]; dashed: the ideal crossings, where CLK should rise")
    panel.grid(visible=False)
    return figure


def growth(kernel: Kernel) -> Figure:
    """Draw the kernel's cost against axes, step rate, density of points and length."""
    figure = Figure(figsize=(WIDTH_INCHES, 7.6), layout="constrained")
    figure.suptitle("What the kernel's cost grows with (one core)", x=0.01, ha="left", weight="bold")
    (by_axes, by_rate), (by_points, by_length) = figure.subplots(2, 2)
    _costs(by_axes, "axes, all at 14 kHz", kernel_speed.by_axes(kernel))
    _costs(by_rate, "step rate of seven axes [Hz]", kernel_speed.by_rate(kernel))
    _costs(by_points, "PVT points per second and axis", kernel_speed.by_points(kernel))
    for panel in (by_rate, by_points):
        panel.set_xscale("log")
    _lengths(by_length, kernel_speed.by_length())
    return figure


def _costs(panel: Axes, label: str, costs: list[kernel_speed.Cost]) -> None:
    x = [cost.x for cost in costs]
    tick_ns = [cost.ns_per_axis_tick for cost in costs]
    panel.plot(x, tick_ns, "o-", color=COUNTED)
    panel.set_xlabel(label)
    panel.set_ylabel("ns per axis and tick (dots)")
    panel.set_ylim(0, _HEADROOM * max(tick_ns))
    beside = panel.twinx()
    msteps_per_s = [cost.steps_per_s / 1e6 for cost in costs]
    beside.plot(x, msteps_per_s, "s--", color=GREY)
    beside.set_ylabel("million steps/s (squares)")
    beside.set_ylim(0, _HEADROOM * max(msteps_per_s))
    beside.grid(visible=False)


def _lengths(panel: Axes, lengths: list[kernel_speed.Length]) -> None:
    steps = [length.steps for length in lengths]
    panel.plot(steps, [length.wall_s for length in lengths], "o-", color=COUNTED)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel("steps of the motion")
    panel.set_ylabel("s for all of it (dots)")
    beside = panel.twinx()
    beside.plot(steps, [length.peak_mb for length in lengths], "s--", color=GREY)
    beside.axhline(kernel_speed.MEMORY_MAX_MB, color=GREY, linestyle=":")
    beside.text(steps[0], kernel_speed.MEMORY_MAX_MB, f"bound: {kernel_speed.MEMORY_MAX_MB} MB", va="bottom", size=8)
    beside.set_ylabel("peak memory, MB (squares)")
    beside.set_ylim(0, kernel_speed.MEMORY_MAX_MB * 1.15)
    beside.grid(visible=False)


def main(folder: Path) -> None:
    """Draw all pictures into a folder, which is created if it does not exist."""
    folder.mkdir(parents=True, exist_ok=True)
    kernel = fastest_kernel()
    pictures: dict[str, Callable[[], Figure]] = {
        "bench-timing": lambda: timing_errors([motion for motion in all_motions() if motion.name in _TIMED], kernel),
        "bench-edges": lambda: close_up(stress(), kernel),
        "bench-growth": lambda: growth(kernel),
    }
    with mpl.rc_context(STYLE):
        for name, draw in pictures.items():
            draw().savefig(folder / f"{name}.png", dpi=DOTS_PER_INCH)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS)
