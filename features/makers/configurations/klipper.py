"""Read a Klipper configuration, such as printer.cfg, with the files beside it that it includes.

Keys and defaults are those of Klipper's klippy/stepper.py, klippy/toolhead.py, klippy/kinematics/ and
klippy/extras/tmc.py at commit 84104bbb.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import prod, sqrt
from pathlib import Path
from typing import Final

from steptwin.features.makers.configurations.machine import NO_CORNERS, AxisFound, Configuration, Drivers, Figure
from steptwin.host.common.bad_input import prefixed, shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX
from steptwin.host.common.numbers import finite_number
from steptwin.host.common.own_files import is_file, read_old_text

AXES: Final = ("x", "y", "z")
KINDS: Final = {"cartesian": False, "corexy": True}
"""Kinematics of Klipper that have a kind here: whether X and Y share their motors."""
OTHER_KINDS: Final = (
    "corexz", "delta", "deltesian", "generic_cartesian", "hybrid_corexy", "hybrid_corexz", "none", "polar",
    "rotary_delta", "winch",
)  # fmt: skip
_INCLUDES_MAX: Final = 50
_SAVED: Final = "#*#"
"""Sign of the lines that SAVE_CONFIG writes at the end of the file; Klipper reads them."""
_SECTION: Final = re.compile(r"\[\s*([^\]]+?)\s*\]")
_OPTION: Final = re.compile(r"([A-Za-z_][\w.]*)\s*[:=]\s*(.*)")
_COMMENT: Final = re.compile(r"\s[#;].*$")
_DRIVERS: Final = {"tmc2208": "tmc2209", "tmc2209": "tmc2209", "tmc2225": "tmc2209", "tmc2226": "tmc2209",
                   "tmc2130": "tmc5160", "tmc5160": "tmc5160", "tmc2240": "tmc5160", "tmc2660": "tmc5160"}  # fmt: skip
"""Driver profiles for the sections of Klipper's TMC drivers: of chips without one the nearest."""
_EXACT: Final = {"tmc2209", "tmc5160"}
_PULSE_S: Final = 2e-6
_TMC_PULSE_S: Final = 100e-9
"""Defaults of step_pulse_duration, without and with a TMC section (klippy/stepper.py, klippy/extras/tmc.py)."""
_BOTH_EDGES_S: Final = 500e-9
"""Pulse up to which Klipper lets TMC drivers step at both edges of STEP (klippy/stepper.py)."""
_NO_SWITCH: Final = ":virtual_endstop", ":z_virtual_endstop"


@dataclass(slots=True)
class _Sections:
    """The sections of a configuration by name, the includes that are missing, and where a value was read."""

    found: dict[str, dict[str, str]] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    included: int = 0

    def read(self, path: Path) -> None:
        """Read a file and, in place, those that it includes."""
        name, option = "", ""
        for line in read_old_text(path, PROGRAM_BYTES_MAX).splitlines():
            text = line.removeprefix(_SAVED) if line.startswith(_SAVED) else line
            continues = text[:1] in (" ", "\t") and bool(option) and not line.startswith(_SAVED)
            text = _COMMENT.sub("", text).strip()
            if not text or text[0] in "#;":
                continue
            if section := _SECTION.fullmatch(text):
                name, option = section[1], ""
                if name.startswith("include "):
                    self._include(path, name.removeprefix("include ").strip())
                else:
                    self.found.setdefault(name, {})
            elif continues:
                self.found[name][option] += f" {text}"
            elif (given := _OPTION.fullmatch(text)) and name:
                option = given[1].lower()
                self.found.setdefault(name, {})[option] = given[2].strip()

    def _include(self, path: Path, pattern: str) -> None:
        inside = not Path(pattern).is_absolute() and ".." not in Path(pattern).parts
        files = sorted(each for each in path.parent.glob(pattern) if is_file(each)) if inside else []
        if not files:
            self.missing.append(pattern)
        for each in files:
            self.included += 1
            if self.included > _INCLUDES_MAX:
                raise InputError(f"includes more than {_INCLUDES_MAX} files")
            self.read(each)


class _Section:
    """A section's options, read as figures."""

    def __init__(self, name: str, options: Mapping[str, str]) -> None:
        self.name = name
        self.options = options

    def place(self, key: str) -> str:
        return f"[{self.name}] {key}"

    def figure(self, key: str, default: float | None = None, note: str = "Klipper's default") -> Figure | None:
        """Return a number; its default if the section has none."""
        text = self.options.get(key)
        if text is None:
            return None if default is None else Figure(default, f"{note} of {key}", assumed=True)
        with prefixed(f"{self.place(key)}: "):
            return Figure(finite_number(text), f"{self.place(key)}: {text}")

    def needed(self, key: str) -> Figure:
        """Return a number; raise InputError if the section has none."""
        found = self.figure(key)
        if found is None:
            raise InputError(f"{self.place(key)} is missing")
        return found

    def gear(self) -> float:
        """Return the turns of the motor for one turn of the last shaft."""
        text = self.options.get("gear_ratio", "")
        pairs = [pair for pair in re.split(r"[,\s]+(?=[\d.])", text.strip()) if pair]
        ratios = []
        for pair in pairs:
            found = re.fullmatch(r"([\d.]+)\s*:\s*([\d.]+)", pair)
            if found is None or not float(found[1]) or not float(found[2]):
                raise InputError(f"{self.place('gear_ratio')}: {shortened(text)!r} is not a ratio, as in 80:16")
            ratios.append(float(found[1]) / float(found[2]))
        return prod(ratios)


def is_klipper(text: str) -> bool:
    """Return whether a text has sections of Klipper."""
    return bool(re.search(r"^\[(printer|stepper_[a-z]\w*)\]", text, re.MULTILINE))


def read_klipper(path: Path) -> Configuration:
    """Return the machine of a Klipper configuration.

    Raises:
        InputError: the file cannot be read, its kinematics has no kind here, or a value is missing or wrong.
    """
    sections = _Sections()
    sections.read(path)
    hint = f"; not found: {', '.join(sections.missing)}" if sections.missing else ""
    if "printer" not in sections.found or "kinematics" not in sections.found["printer"]:
        raise InputError(f"[printer] kinematics is missing{hint}")
    printer = _Section("printer", sections.found["printer"])
    kind = printer.options["kinematics"]
    if kind not in KINDS:
        ours = " and ".join(KINDS)
        what = "has no kind here" if kind in OTHER_KINDS else "is unknown"
        raise InputError(f"[printer] kinematics: {shortened(kind)} {what}: {ours} have")
    if absent := [name for axis in AXES if (name := f"stepper_{axis}") not in sections.found]:
        raise InputError(f"[{absent[0]}] is missing{hint}")
    axes = tuple(_axis(axis, printer, sections.found, corexy=KINDS[kind]) for axis in AXES)
    used = {"printer", "board_pins", *(name for name in sections.found if name.startswith("stepper_"))}
    used |= {name for name in sections.found if re.fullmatch(r"tmc\w+ stepper_[xyz]\d*", name)}
    return Configuration(
        controller="Klipper",
        axes=axes,
        corexy=KINDS[kind],
        pulses_ns=_pulses(sections.found),
        notes=tuple(_notes(printer, sections, corexy=KINDS[kind])),
        left_out=tuple(f"[{name}]" for name in sections.found if name not in used),
    )


def _axis(axis: str, printer: _Section, found: Mapping[str, Mapping[str, str]], *, corexy: bool) -> AxisFound:
    name = f"stepper_{axis}"
    section = _Section(name, found[name])
    full, microsteps = section.figure("full_steps_per_rotation", 200), section.needed("microsteps")
    assert full is not None
    if "rotation_distance" in section.options:
        travel = section.needed("rotation_distance")
        if not travel.value > 0:
            raise InputError(f"{section.place('rotation_distance')}: {travel.value:g} is not above 0")
        steps = Figure(full.value * microsteps.value * section.gear() / travel.value, travel.origin)
    elif "step_distance" in section.options:
        distance = section.needed("step_distance")
        steps = Figure(1.0 / distance.value, distance.origin)
    else:
        raise InputError(f"{section.place('rotation_distance')} is missing")
    lower, upper = section.figure("position_min", 0.0), section.needed("position_max")
    assert lower is not None
    limits = _limits(axis, printer)
    direction, endstop = _endstop(section, lower.value, upper.value)
    search = section.figure("homing_speed", 5.0)
    assert search is not None
    second = [each for each in found if re.fullmatch(rf"{name}\d", each)]
    drivers = _drivers(name, found)
    return AxisFound(
        name=axis.upper(),
        steps_per_unit=steps,
        full_steps_per_rev=full,
        microsteps=microsteps,
        lower=lower,
        upper=upper,
        speed_max=limits[0],
        acceleration_max=limits[1],
        home_direction=direction,
        endstop=endstop,
        search_speed=search,
        zero_speed=section.figure("second_homing_speed", search.value / 2, "half of homing_speed, the default"),
        second_motor=second[0] if second and not _shares_motors(axis, corexy=corexy) else "",
        drivers=drivers,
        current_a=_current(name, found),
    )


def _shares_motors(axis: str, *, corexy: bool) -> bool:
    """Return whether an axis shares its motors with another."""
    return corexy and axis in "xy"


def _limits(axis: str, printer: _Section) -> tuple[Figure, Figure]:
    speed, acceleration = printer.needed("max_velocity"), printer.needed("max_accel")
    if axis != "z":
        return speed, acceleration
    return printer.figure("max_z_velocity") or speed, printer.figure("max_z_accel") or acceleration


def _endstop(section: _Section, lower: float, upper: float) -> tuple[int, Figure | None]:
    """Return the direction of homing, as Klipper infers it, and the switch; 0 and None without a switch."""
    if any(text in section.options.get("endstop_pin", "") for text in _NO_SWITCH):
        return 0, None
    endstop = section.figure("position_endstop")
    if endstop is None:
        return 0, None
    if "homing_positive_dir" in section.options:
        return (1 if section.options["homing_positive_dir"].lower() in ("true", "1", "yes", "on") else -1), endstop
    quarter = (upper - lower) / 4
    if endstop.value <= lower + quarter:
        return -1, endstop
    if endstop.value >= upper - quarter:
        return 1, endstop
    raise InputError(
        f"{section.place('position_endstop')}: {endstop.value:g} is in the middle of {lower:g}..{upper:g}:"
        " homing_positive_dir is missing"
    )


def _tmc(name: str, found: Mapping[str, Mapping[str, str]]) -> str | None:
    return next((each for each in found if re.fullmatch(rf"tmc\w+ {name}", each)), None)


def _drivers(name: str, found: Mapping[str, Mapping[str, str]]) -> Drivers | None:
    section = _tmc(name, found)
    chip = "" if section is None else section.split()[0]
    return Drivers(_DRIVERS[chip], f"[{section}]") if chip in _DRIVERS else None


def _current(name: str, found: Mapping[str, Mapping[str, str]]) -> Figure | None:
    section = _tmc(name, found)
    if section is None:
        return None
    rms = _Section(section, found[section]).figure("run_current")
    return None if rms is None else Figure(rms.value * sqrt(2.0), f"{rms.origin} A rms, times the root of 2")


def _pulses(found: Mapping[str, Mapping[str, str]]) -> dict[str, Figure]:
    """Return STEP's high and low time: the longest of the axes whose every pulse is a step."""
    figures = [_pulse(axis, found).scaled(1e9) for axis in AXES if not _steps_at_both_edges(axis, found)]
    if not figures:
        return {}
    longest = max(figures, key=lambda each: each.value)
    return {"steplen_ns": longest, "stepspace_ns": longest._replace(origin=f"{longest.origin}; low as long as high")}


def _pulse(axis: str, found: Mapping[str, Mapping[str, str]]) -> Figure:
    name = f"stepper_{axis}"
    usual = _PULSE_S if _tmc(name, found) is None else _TMC_PULSE_S
    figure = _Section(name, found[name]).figure("step_pulse_duration", usual)
    assert figure is not None
    return figure


def _steps_at_both_edges(axis: str, found: Mapping[str, Mapping[str, str]]) -> bool:
    return _tmc(f"stepper_{axis}", found) is not None and _pulse(axis, found).value <= _BOTH_EDGES_S


def _notes(printer: _Section, sections: _Sections, *, corexy: bool) -> Iterator[str]:
    if sections.missing:
        yield f"not found beside the file, and not read: {', '.join(sections.missing)}"
    if corexy:
        yield "max_velocity and max_accel bound the tool; along a diagonal a CoreXY's motor is 1.41 times as fast"
    else:
        yield "max_velocity and max_accel bound the tool's vector; here each axis has them"
    corner = printer.figure("square_corner_velocity", 5.0)
    assert corner is not None
    yield f"square_corner_velocity {corner.value:g} mm/s {NO_CORNERS}"
    for axis in AXES:
        name = f"stepper_{axis}"
        options = sections.found[name]
        if any(text in options.get("endstop_pin", "") for text in _NO_SWITCH):
            yield f"{axis.upper()}: endstop_pin {options['endstop_pin']} is no switch: homing is left out"
        more = [each for each in sections.found if re.fullmatch(rf"{name}\d", each)]
        if len(more) > 1:
            yield f"{axis.upper()}: {len(more) + 1} motors: a joint here has two, so {', '.join(more[1:])} is left out"
        elif more and _shares_motors(axis, corexy=corexy):
            yield f"{axis.upper()}: {more[0]} is left out: a motor that two joints share has no second one here"
        chip = (_tmc(name, sections.found) or " ").split()
        if chip and chip[0] in _DRIVERS and chip[0] not in _EXACT:
            yield f"{axis.upper()}: {chip[0].upper()} has no profile; {_DRIVERS[chip[0]]} is the nearest"
        if _steps_at_both_edges(axis, sections.found):
            yield f"{axis.upper()}: STEP makes a step at each edge, up and down: count both in a capture"
        if not chip:
            yield f"{axis.upper()}: microsteps must be what the driver's jumpers say: Klipper cannot check it"
    if "input_shaper" in sections.found:
        yield "[input_shaper] is not read: switch it off for a capture; [shaping] shapes motions here (docs/motions.md)"
