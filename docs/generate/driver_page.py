"""Render docs/driver.md: the driver's tables and profiles, and a run with other drivers than it was planned for."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from docs.generate.commands import DOCS, GeneratedPage, session
from docs.generate.drawing import write_picture
from docs.generate.markdown import table
from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import Int8Array, Int64Array
from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_module import Module, delay_of, fitted
from steptwin.emulator.drivers.excitation import excitations
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.drivers.terminals import LevelChange, Rail, TerminalEdges
from steptwin.host.record.plots.canvas import COUNTED, LIMIT
from steptwin.protocol.drivers import (
    GENERIC,
    PROFILES,
    WIRE,
    ChipSheet,
    CurrentSetting,
    DriverProfile,
    Fact,
    Grade,
    Oscillator,
    PinTable,
    Release,
    StepTimes,
    bare_chip,
)
from steptwin.protocol.drivers.tb6560 import PINS, THREE_AMP_MODULE, PinKind
from steptwin.protocol.timer import COUNTS_PER_US

LATE_DIR: Final = DOCS / "pictures" / "driver-late-dir.png"

_CHIP: Final = bare_chip(330).chip
_WIRES: Final = Module(_CHIP)
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
    module = fitted(THREE_AMP_MODULE, 16)
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
    _draw_pin(axes, 1.4, *delay_of(module.clk).passed(clk_counts, clk_levels))
    _draw_pin(axes, 0.0, *delay_of(module.direction).passed(stretch.dir_counts, stretch.dir_levels))
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
        steps = np.concatenate(([0], np.cumsum(signs), [driver.chip.position_steps]))
        axes.step(times_us, steps, where="post", label=label, color=colour, linestyle=dashes)
    axes.set_title("steps", loc="left")
    axes.set_yticks(range(5))
    axes.legend(loc="upper left")


_CAPACITORS_PF: Final = (100, 330, 1000)


def _pins() -> str:
    rows = [
        [str(pin.number), pin.name, pin.kind.value, pin.function, str(pin.page)]
        for pin in PINS
        if pin.kind in (PinKind.INPUT, PinKind.OPEN_DRAIN)
    ]
    return table(["pin", "name", "kind", "function", "page"], rows, text_columns=4)


def _modes() -> str:
    rows = []
    modes = excitations(_CHIP)
    for microsteps, letters in _CHIP.modes.value.rows:
        mode = modes[microsteps]
        a, b = (100 * mode.parts[mode.states(np.array([mode.initial_substeps]))[0]]).tolist()
        angle = mode.initial_substeps * 360 / mode.cycle_substeps
        levels = ["LH".index(letter) for letter in letters]
        currents = f"A {a:.0f} %, B {b:.0f} %"
        rows.append([*map(str, levels), f"1/{microsteps}", f"{angle:g} deg", currents, f"{4 * microsteps} steps"])
    return table(["M2", "M1", "steps", "initial angle", "initial currents", "MO low every"], rows, text_columns=6)


def _vector() -> str:
    def used(sixteenths: int) -> str:
        modes = [mode for mode in _CHIP.microsteps if mode > 1 and sixteenths % (16 // mode) == 0]
        return " ".join(f"1/{mode}" for mode in reversed(modes))

    assert _CHIP.vector_percent is not None
    vector = _CHIP.vector_percent.value
    rows = [[f"{i * 90 / 16:g}", str(percent), str(vector[16 - i]), used(i)] for i, percent in enumerate(vector)]
    return table(["angle, deg", "A, %", "B, %", "in modes"], rows, text_columns=0)


def _torque_and_decay() -> str:
    torque, decay = _CHIP.torque_percent.value, _CHIP.fast_decay_percent.value
    rows = [
        [*("01"["LH".index(letter)] for letter in letters), f"{torque_percent} %", f"{decay_percent} %"]
        for (torque_percent, letters), (decay_percent, _) in zip(torque.rows, decay.rows, strict=True)
    ]
    return table(["TQ2, DCY2", "TQ1, DCY1", "current", "fast decay"], rows, text_columns=4)


def _oscillator() -> str:
    rows = [
        [
            f"{each.osc_pf} pF",
            f"{each.hz / 1e3:.0f} kHz",
            f"{each.chopping_hz / 1e3:.0f} kHz",
            f"{each.clk_width_min_us:g} us",
        ]
        for each in map(Oscillator, _CAPACITORS_PF)
    ]
    return table(["at OSC", "oscillator", "chopping", "CLK high at least"], rows)


def _power() -> str:
    limits = [limit for limit in _WIRES.make_chip().violations.limits if limit.rule is Rule.POWER_ORDER]
    rows = [[limit.source.split(", ")[2], str(limit.value)] for limit in limits]
    return table(["", "required level"], rows)


def _currents() -> str:
    rows = []
    assert THREE_AMP_MODULE.currents is not None
    for setting in THREE_AMP_MODULE.currents.value:
        made_a = setting.full_a * setting.torque_percent / 100
        on = ("ON" if switch in setting.switches else "-" for switch in ("SW1", "SW2", "SW3", "S1"))
        rows.append([f"{setting.printed_a:.1f} A", f"{made_a:.2f} A", *on])
    return table(["printed", "computed", "SW1", "SW2", "SW3", "S1"], rows, text_columns=6)


def _profiles() -> str:
    rows = [[f"`{profile.name}`", profile.title, _delays(profile), _asked(profile)] for profile in PROFILES.values()]
    rows.append(
        [f"`{GENERIC}`", "a driver without a profile, by the robot file's [board.driver]", "-", "the table's times"]
    )
    return table(["profile", "driver", "delay", "requires beside the chip's times"], rows, text_columns=4)


def _delays(profile: DriverProfile) -> str:
    couplers = {"STEP": profile.clk.value, "DIR": profile.direction.value, "EN": profile.enable.value}
    texts = [
        f"{name} {coupler.to_high_ns / 1e3:g} us to high, {coupler.to_low_ns / 1e3:g} us to low"
        for name, coupler in couplers.items()
        if coupler.to_high_ns or coupler.to_low_ns
    ]
    return "; ".join(texts) or "-"


def _asked(profile: DriverProfile) -> str:
    texts = [f"{name} {ns / 1e3:g} us" for name in _STEP_TIMES if (ns := profile.times.ns(f"{name}_ns"))]
    if texts:
        return f"{', '.join(texts)}; active edge {profile.active_edge}"
    return f"CLK high {profile.chip.pulse_min_counts / _US:g} us" if profile.chip.oscillator else "-"


_OTHER_OSC: Final = ("chip-100pf", "chip-1000pf")
_STEP_TIMES: Final = ("steplen", "stepspace", "dirsetup", "dirhold")
_MARKS: Final = {Grade.STATED: "", Grade.QUOTED: " [Q]", Grade.ASSUMED: " [A]"}


def _sheets() -> str:
    """Return a row for each chip: times in us, highest rate in kHz, and where its figures are from."""
    names = (*_STEP_TIMES, "enable", "wake")
    rows = []
    for sheet in _each_sheet():
        times = [_marked(getattr(sheet.times, f"{name}_ns"), 1e3) for name in names]
        disabled = ("ignored" if sheet.blocked.value else "counted") + _MARKS[sheet.blocked.grade]
        rate = _marked(sheet.times.rate_max_hz, 1e3)
        rows.append([sheet.name, ", ".join(map(str, sheet.microsteps)), *times, rate, disabled, sheet.document])
    heads = ["driver", "microsteps", *names, "kHz", "STEP while off", "source"]
    return table(heads, rows, text_columns=len(heads))


def _protections() -> str:
    """Return a row for each chip: what switches it off, what ends that, and which pin tells it."""
    rows = []
    for sheet in _each_sheet():
        hot, volt, output = sheet.shutdown, sheet.overvoltage, sheet.fault_output
        rows.append(
            [
                sheet.name,
                f"{hot.value.celsius} degC{_MARKS[hot.grade]}: {_ends(hot.value.release)}" if hot else "-",
                f"{_ends(sheet.overcurrent.value)}{_MARKS[sheet.overcurrent.grade]}",
                f"above {volt.value.volt} V{_MARKS[volt.grade]}: {_ends(volt.value.release)}" if volt else "-",
                f"{output.value.pin} {['low', 'high'][output.value.level]}{_MARKS[output.grade]}" if output else "-",
            ]
        )
    heads = ["driver", "heat, ended by", "short circuit, ended by", "supply, ended by", "told by"]
    return table(heads, rows, text_columns=len(heads))


def _ends(release: Release) -> str:
    return "cooling" if release is Release.COOLING else release.value


def _each_sheet() -> list[ChipSheet]:
    """Return each chip once, a TB6560 as it is with 330 pF."""
    sheets = {
        profile.chip.name: profile.chip for profile in reversed(PROFILES.values()) if profile.name not in _OTHER_OSC
    }
    return list(reversed(sheets.values()))


def _marked(fact: Fact[int] | None, unit: float) -> str:
    return f"{fact.value / unit:g}{_MARKS[fact.grade]}" if fact else "-"


def _figures() -> str:
    """Return a row for each source of each driver: its figures, and how they are known."""
    rows, seen = [], set[str]()
    for profile in PROFILES.values():
        if profile.name in _OTHER_OSC:
            continue
        if profile.chip.name not in seen:
            seen.add(profile.chip.name)
            rows += _by_source(profile.chip.name, _facts(profile.chip.times) | _facts(profile.chip))
        own = {name: fact for name, fact in (_facts(profile.times) | _facts(profile)).items() if fact.value != WIRE}
        rows += _by_source(f"`{profile.name}`", own)
    return table(["driver", "figures", "known", "source"], rows, text_columns=4)


def _by_source(driver: str, facts: Mapping[str, Fact[Any]]) -> list[list[str]]:
    """Return a row for each document or assumption: its figures, each with the place in the document."""
    documents: dict[tuple[Grade, str], dict[str, list[str]]] = {}
    for name, fact in facts.items():
        document, _, place = (fact.source, "", "") if fact.grade is Grade.ASSUMED else fact.source.partition(", ")
        places = documents.setdefault((fact.grade, document), {})
        places.setdefault(place, []).append(f"`{name}` {_value(fact.value)}")
    rows = []
    for (grade, document), places in documents.items():
        told = [", ".join(each) + (f" ({place})" if place else "") for place, each in places.items()]
        rows.append([driver, "; ".join(told), grade.value, document])
    return rows


def _facts(record: StepTimes | ChipSheet | DriverProfile) -> dict[str, Fact[Any]]:
    found = {field.name: getattr(record, field.name) for field in fields(record)}
    return {name: fact for name, fact in found.items() if isinstance(fact, Fact)}


def _value(value: Any) -> str:
    """Return a figure's value in short; a record as its fields, a table of pins as its pins and values."""
    if isinstance(value, PinTable):
        pins = f"{' '.join(value.pins)}: " if value.pins else ""
        return pins + ", ".join(f"{each:g}" + (f" {letters}" if letters else "") for each, letters in value.rows)
    if isinstance(value, tuple):
        return _several(value)
    if is_dataclass(value):
        return ", ".join(f"{field.name} {_value(getattr(value, field.name))}" for field in fields(value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.10g}" if isinstance(value, int | float) else str(value)


def _several(values: tuple[Any, ...]) -> str:
    if isinstance(values, CurrentSetting):
        return " ".join((f"{values.printed_a:g} A", *values.switches))
    names = getattr(values, "_fields", None)
    texts = map(_value, values)
    return ", ".join(texts if names is None else map(" ".join, zip(names, texts, strict=True)))


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
        "sheets": lambda _: _sheets(),
        "protections": lambda _: _protections(),
        "rules": lambda _: _rules(),
        "figures": lambda _: _figures(),
        "failing": lambda arguments: session(arguments, expected_exit_code=1),
    },
)
