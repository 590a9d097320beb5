"""Draw the picture of docs/driver.md: DIR comes late through its optocoupler."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from docs.generate.pictures import write_picture
from docs.generate.pieces import DOCS
from steptwin.emulator.driver import Driver
from steptwin.emulator.driver_module import Module
from steptwin.emulator.driver_profiles import THREE_AMP_MODULE
from steptwin.emulator.edges import Int8Array, Int64Array
from steptwin.emulator.tb6560 import Input, LevelChange, Pins
from steptwin.host.record.plots.canvas import COUNTED, LIMIT
from steptwin.protocol.timer import COUNTS_PER_US

LATE_DIR: Final = DOCS / "pictures" / "driver-late-dir.png"

_US: Final = COUNTS_PER_US
_TURN: Final = 400 * _US
_RISES: Final = np.array([50, 150, 250, 415, 515, 615], dtype=np.int64) * _US
_WIDTH: Final = 33 * _US
_END: Final = 700 * _US


def write_driver_pictures() -> None:
    """Draw the picture again."""
    write_picture(LATE_DIR, _late_dir)


def _late_dir() -> Figure:
    """Draw three steps up and three down, 15 us from DIR to STEP: at the terminals, at the chip, and as counted."""
    module = THREE_AMP_MODULE.fitted(16)
    stretch = Pins(
        _RISES,
        _RISES + _WIDTH,
        np.array([10 * _US, _TURN]),
        np.array([1, 0], dtype=np.int8),
        tuple(LevelChange(0, pin, 1) for pin in (Input.VDD, Input.VM, Input.RESET, Input.ENABLE)),
        100 * _END,
    )
    figure = Figure(figsize=(10, 4.6), layout="constrained")
    figure.suptitle(
        "3a-module: DIR put 15 us before STEP falls 9 us after it at the chip (SIMULATED)",
        x=0.01, ha="left", weight="bold",
    )  # fmt: skip
    terminals, chip, counter = figure.subplots(3, 1, sharex=True, height_ratios=(1, 1, 1.2))
    _draw_pins(terminals, stretch, Module(), "STEP", "DIR", "terminals")
    _draw_pins(chip, stretch, module, "CLK", "CW/CCW", "chip")
    _draw_counters(counter, stretch, module)
    counter.set_xlabel("us")
    counter.set_xlim(0, _END / _US)
    return figure


def _draw_pins(axes: Axes, stretch: Pins, module: Module, clk: str, direction: str, where: str) -> None:
    clk_counts = np.ravel(np.column_stack((stretch.clk_rise_counts, stretch.clk_fall_counts)))
    clk_levels = np.tile(np.array([1, 0], dtype=np.int8), stretch.clk_rise_counts.size)
    _draw_pin(axes, 1.4, *module.clk.delay.passed(clk_counts, clk_levels))
    _draw_pin(axes, 0.0, *module.direction.delay.passed(stretch.dir_counts, stretch.dir_levels))
    axes.set_yticks([0.4, 1.8], [direction, clk])
    axes.set_ylim(-0.2, 2.6)
    axes.set_title(where, loc="left")
    axes.axvline(float(_RISES[3]) / _US, color=LIMIT, linewidth=0.8, linestyle=":")


def _draw_pin(axes: Axes, base: float, edges: Int64Array, levels: Int8Array) -> None:
    times_us = np.concatenate(([0], edges, [_END])) / _US
    heights = base + 0.8 * np.concatenate(([0], levels, levels[-1:]))
    axes.step(times_us, heights, where="post", color=COUNTED)


def _draw_counters(axes: Axes, stretch: Pins, module: Module) -> None:
    for which, colour, dashes, label in ((Module(), "0.6", "--", "meant"), (module, COUNTED, "-", "counted")):
        driver = Driver(THREE_AMP_MODULE.osc_pf, which)
        driver.feed(stretch)
        counts, signs = driver.steps
        times_us = np.concatenate(([0], counts, [_END])) / _US
        steps = np.concatenate(([0], np.cumsum(signs), [driver.position_steps]))
        axes.step(times_us, steps, where="post", label=label, color=colour, linestyle=dashes)
    axes.set_title("steps", loc="left")
    axes.set_yticks(range(5))
    axes.legend(loc="upper left")
