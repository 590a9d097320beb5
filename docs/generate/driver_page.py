"""Render docs/driver.md: the driver's tables and profiles, and a run with other drivers than it was planned for."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from docs.generate.commands import DOCS, GeneratedPage, session
from docs.generate.pictures import write_picture
from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import Int8Array, Int64Array
from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_chip import LevelChange, Rail, TerminalEdges
from steptwin.emulator.drivers.driver_module import Module
from steptwin.emulator.drivers.driver_profiles import PROFILES, THREE_AMP_MODULE, DriverProfile, bare_chip
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.drivers.tb6560.chip import Tb6560
from steptwin.emulator.drivers.tb6560.dip_switches import CURRENT_SETTINGS, switches_for
from steptwin.emulator.drivers.tb6560.excitation import CYCLE_SIXTEENTHS, PHASE_PERCENT, VECTOR_PERCENT, Excitation
from steptwin.emulator.drivers.tb6560.oscillator import chopping_hz, clk_width_min_counts, oscillator_hz
from steptwin.emulator.drivers.tb6560.outputs import SENSE_VOLT
from steptwin.emulator.drivers.tb6560.pins import EXCITATIONS, FAST_DECAY_PERCENT, PINS, TORQUE_PERCENT
from steptwin.host.record.plots.canvas import COUNTED, LIMIT
from steptwin.host.studies.papers.paper_page import table
from steptwin.protocol.timer import COUNTS_PER_US

LATE_DIR: Final = DOCS / "pictures" / "driver-late-dir.png"

_WIRES: Final = bare_chip(330).module
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
    stretch = TerminalEdges(
        _RISES,
        _RISES + _WIDTH,
        np.array([10 * _US, _TURN]),
        np.array([1, 0], dtype=np.int8),
        tuple(LevelChange(0, pin, 1) for pin in (*Rail, Pin.RESET, Pin.ENABLE)),
        100 * _END,
    )
    figure = Figure(figsize=(10, 4.6), layout="constrained")
    figure.suptitle(
        "3a-module: DIR put 15 us before STEP falls 9 us after it at the chip (SIMULATED)",
        x=0.01, ha="left", weight="bold",
    )  # fmt: skip
    terminals, chip, counter = figure.subplots(3, 1, sharex=True, height_ratios=(1, 1, 1.2))
    _draw_pins(terminals, stretch, _WIRES, "STEP", "DIR", "terminals")
    _draw_pins(chip, stretch, module, "CLK", "CW/CCW", "chip")
    _draw_counters(counter, stretch, module)
    counter.set_xlabel("us")
    counter.set_xlim(0, _END / _US)
    return figure


def _draw_pins(axes: Axes, stretch: TerminalEdges, module: Module, clk: str, direction: str, where: str) -> None:
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


def _draw_counters(axes: Axes, stretch: TerminalEdges, module: Module) -> None:
    for which, colour, dashes, label in ((_WIRES, "0.6", "--", "meant"), (module, COUNTED, "-", "counted")):
        driver = Driver(which)
        driver.feed(stretch)
        counts, signs = driver.steps
        times_us = np.concatenate(([0], counts, [_END])) / _US
        steps = np.concatenate(([0], np.cumsum(signs), [driver.position_steps]))
        axes.step(times_us, steps, where="post", label=label, color=colour, linestyle=dashes)
    axes.set_title("steps", loc="left")
    axes.set_yticks(range(5))
    axes.legend(loc="upper left")


_CAPACITORS_PF: Final = (100, 330, 1000)


def _pins() -> str:
    rows = [[str(pin.number), pin.name, pin.kind.value, pin.function, str(pin.page)] for pin in PINS]
    return table(["pin", "name", "kind", "function", "page"], rows, text_columns=4)


def _modes() -> str:
    rows = []
    for (m2, m1), mode in EXCITATIONS.items():
        a, b = PHASE_PERCENT[mode][mode.initial_sixteenths].tolist()
        angle = mode.initial_sixteenths * 360 / CYCLE_SIXTEENTHS
        rows.append([str(m2), str(m1), f"1/{mode}", f"{angle:g} deg", f"A {a} %, B {b} %", f"{4 * mode} steps"])
    return table(["M2", "M1", "steps", "initial angle", "initial currents", "MO low every"], rows, text_columns=6)


def _vector() -> str:
    def used(sixteenths: int) -> str:
        modes = [mode for mode in Excitation if mode > 1 and sixteenths % mode.step_sixteenths == 0]
        return " ".join(f"1/{mode}" for mode in reversed(modes))

    rows = [
        [f"{i * 90 / 16:g}", str(percent), str(VECTOR_PERCENT[16 - i]), used(i)]
        for i, percent in enumerate(VECTOR_PERCENT)
    ]
    return table(["angle, deg", "A, %", "B, %", "in modes"], rows, text_columns=0)


def _torque_and_decay() -> str:
    rows = [
        [str(high), str(low), f"{TORQUE_PERCENT[high, low]} %", f"{FAST_DECAY_PERCENT[high, low]} %"]
        for high, low in TORQUE_PERCENT
    ]
    return table(["TQ2, DCY2", "TQ1, DCY1", "current", "fast decay"], rows, text_columns=4)


def _oscillator() -> str:
    rows = [
        [
            f"{pf} pF",
            f"{oscillator_hz(pf) / 1e3:.0f} kHz",
            f"{chopping_hz(pf) / 1e3:.0f} kHz",
            f"{clk_width_min_counts(pf) / COUNTS_PER_US:g} us",
        ]
        for pf in _CAPACITORS_PF
    ]
    return table(["at OSC", "oscillator", "chopping", "CLK high at least"], rows)


def _power() -> str:
    limits = [limit for limit in Tb6560(330).violations.limits if limit.rule is Rule.POWER_ORDER]
    rows = [[limit.source.split(", ")[2], str(limit.value)] for limit in limits]
    return table(["", "required level"], rows)


def _currents() -> str:
    rows = []
    for setting in CURRENT_SETTINGS:
        switches = switches_for(setting.printed_a, 1)
        full_a = SENSE_VOLT / switches.sense_ohm * (0.75 if setting.s1 else 1)
        on = ("ON" if switch else "-" for switch in (setting.sw1, setting.sw2, setting.sw3, setting.s1))
        rows.append([f"{setting.printed_a:.1f} A", f"{full_a:.2f} A", *on])
    return table(["printed", "computed", "SW1", "SW2", "SW3", "S1"], rows, text_columns=6)


def _profiles() -> str:
    rows = [[f"`{profile.name}`", profile.title, _delays(profile), _asked(profile)] for profile in PROFILES.values()]
    return table(["profile", "driver", "delay", "requires"], rows, text_columns=4)


def _delays(profile: DriverProfile) -> str:
    couplers = {"STEP": profile.module.clk, "DIR": profile.module.direction, "EN": profile.module.enable}
    texts = [
        f"{name} {coupler.to_high_ns / 1e3:g} us to high, {coupler.to_low_ns / 1e3:g} us to low"
        for name, coupler in couplers.items()
        if coupler.to_high_ns or coupler.to_low_ns
    ]
    return "; ".join(texts) or "-"


def _asked(profile: DriverProfile) -> str:
    asked = profile.module.requirements
    width_us = profile.module.make_chip().pulse_min_counts / COUNTS_PER_US
    named = {
        "steplen": asked.steplen_ns,
        "stepspace": asked.stepspace_ns,
        "dirsetup": asked.dirsetup_ns,
        "dirhold": asked.dirhold_ns,
    }
    texts = [f"{name} {ns / 1e3:g} us" for name, ns in named.items() if ns]
    edge = f"; active edge {profile.module.active_edge}" if texts else ""
    return (", ".join(texts) or f"CLK high {width_us:g} us") + edge


def _rules() -> str:
    rows = [[f"`{rule.name.lower()}`", *rule.value.split(": ")] for rule in Rule]
    return table(["rule", "violated where", "effect in the model"], rows, text_columns=3)


DRIVER_PAGE: Final = GeneratedPage(
    "driver",
    "the emulator's tables",
    {
        "pins": lambda _: _pins(),
        "modes": lambda _: _modes(),
        "vector": lambda _: _vector(),
        "torque-and-decay": lambda _: _torque_and_decay(),
        "oscillator": lambda _: _oscillator(),
        "power": lambda _: _power(),
        "currents": lambda _: _currents(),
        "profiles": lambda _: _profiles(),
        "rules": lambda _: _rules(),
        "failing": lambda arguments: session(arguments, expected_exit_code=1),
    },
)
