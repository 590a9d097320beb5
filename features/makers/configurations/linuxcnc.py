"""Read a LinuxCNC configuration: the .ini file and the .hal files beside it that it names.

Keys are those of LinuxCNC's docs/src/config/ini-config.adoc and src/hal/components/stepgen.c at commit 5c41560e.
"""

import re
from collections.abc import Iterator, Mapping
from math import copysign
from pathlib import Path
from typing import Final

from steptwin.features.makers.configurations.machine import AxisFound, Configuration, Figure
from steptwin.host.common.bad_input import prefixed, shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX
from steptwin.host.common.numbers import finite_number
from steptwin.host.common.own_files import is_file, read_old_text
from steptwin.host.robots.joint import Unit

_SECTION: Final = re.compile(r"\[\s*([A-Za-z_]\w*)\s*\]")
_OPTION: Final = re.compile(r"([A-Za-z_][\w()]*)\s*=\s*(.*)")
_SCALES: Final = ("SCALE", "INPUT_SCALE", "STEP_SCALE")
KINDS: Final = {"trivkins": False, "corexykins": True}
"""Kinematics of LinuxCNC that have a kind here: whether X and Y share their motors."""
_MM: Final = {"mm": 1.0, "metric": 1.0, "1": 1.0, "inch": 25.4, "in": 25.4, "imperial": 25.4, "0.03937007874016": 25.4}
_ANGULAR: Final = "ABC"
_TIMES: Final = {
    "STEPLEN": "steplen_ns",
    "STEPSPACE": "stepspace_ns",
    "DIRSETUP": "dirsetup_ns",
    "DIRHOLD": "dirhold_ns",
}
_SETP: Final = re.compile(r"^\s*setp\s+(\S*stepgen\S*)\.(steplen|stepspace|dirsetup|dirhold)\s+(\S+)", re.MULTILINE)
_READ: Final = ("KINS", "TRAJ")

Sections = Mapping[str, Mapping[str, str]]


def is_linuxcnc(text: str) -> bool:
    """Return whether a text has sections of LinuxCNC."""
    return bool(re.search(r"^\[(KINS|TRAJ|JOINT_0|AXIS_0|AXIS_X)\]", text, re.MULTILINE))


def read_linuxcnc(path: Path) -> Configuration:
    """Return the machine of a LinuxCNC configuration.

    Raises:
        InputError: the file cannot be read, its kinematics has no kind here, or a value is missing or wrong.
    """
    sections = _sections(read_old_text(path, PROGRAM_BYTES_MAX))
    corexy, letters = _kinematics(sections)
    to_mm = _units(sections)
    first: dict[str, int] = {}
    for number, letter in enumerate(letters):
        first.setdefault(letter, number)
    old = not any(name.startswith("JOINT_") for name in sections)
    second = {letter: number for number, letter in enumerate(letters) if first[letter] != number}
    axes = tuple(
        _axis(letter, number, sections, 1.0 if letter in _ANGULAR else to_mm, second.get(letter), old=old)
        for letter, number in first.items()
    )
    hal = _hal(path, sections)
    read = {*_READ, *(name for name in sections if re.fullmatch(r"(JOINT|AXIS)_\w+", name))}
    return Configuration(
        controller="LinuxCNC",
        axes=axes,
        corexy=corexy,
        pulses_ns=_pulses(sections, hal),
        notes=tuple(_notes(sections, axes, hal, to_mm)),
        left_out=tuple(f"[{name}]" for name in sections if name not in read),
    )


def _sections(text: str) -> dict[str, dict[str, str]]:
    sections: dict[str, dict[str, str]] = {}
    name = ""
    for line in text.splitlines():
        stripped = line.strip()
        if not stripped or stripped[0] in "#;":
            continue
        if section := _SECTION.match(stripped):
            name = section[1].upper()
            sections.setdefault(name, {})
        elif (option := _OPTION.match(stripped)) and name:
            key, value = option[1].upper(), re.sub(r"\s+[#;].*$", "", option[2]).strip()
            known = sections[name]
            known[key] = f"{known[key]} {value}" if key == "HALFILE" and key in known else value
    return sections


def _kinematics(sections: Sections) -> tuple[bool, str]:
    """Return whether it is a CoreXY, and the letters of the joints."""
    text = sections.get("KINS", {}).get("KINEMATICS", "trivkins")
    words = text.split()
    name = words[0] if words else "trivkins"
    if name not in KINDS:
        raise InputError(f"[KINS] KINEMATICS: {shortened(name)} has no kind here: {' and '.join(KINDS)} have")
    told = dict(word.split("=", 1) for word in words[1:] if "=" in word)
    letters = told.get("coordinates") or sections.get("TRAJ", {}).get("COORDINATES", "XYZ")
    letters = re.sub(r"\s", "", letters).upper()
    joints = sections.get("KINS", {}).get("JOINTS") or sections.get("TRAJ", {}).get("AXES")
    if joints is not None and joints.strip().isdecimal():
        letters = letters[: int(joints)]
    if unknown := [letter for letter in letters if letter not in "XYZABCUVW"]:
        raise InputError(f"[TRAJ] COORDINATES: {unknown[0]!r} is no axis")
    return KINDS[name], letters


def _units(sections: Sections) -> float:
    text = sections.get("TRAJ", {}).get("LINEAR_UNITS", "")
    if not text:
        raise InputError("[TRAJ] LINEAR_UNITS is missing: mm or inch")
    if text.lower() not in _MM:
        raise InputError(f"[TRAJ] LINEAR_UNITS: {shortened(text)!r} is neither mm nor inch")
    return _MM[text.lower()]


def _axis(letter: str, number: int, sections: Sections, to_mm: float, second: int | None, *, old: bool) -> AxisFound:
    joint = f"AXIS_{number}" if old else f"JOINT_{number}"
    if joint not in sections:
        raise InputError(f"[{joint}] is missing")
    of_joint = _Figures(joint, sections[joint])
    of_axis = _Figures(f"AXIS_{letter}", sections.get(f"AXIS_{letter}", sections[joint]))
    scale = next((found for key in _SCALES if (found := of_joint.figure(key)) is not None), None)
    if scale is None:
        raise InputError(f"[{joint}] SCALE is missing")
    if not scale.value:
        raise InputError(f"[{joint}] SCALE: 0 steps per unit is no machine's")
    search, latch = of_joint.figure("HOME_SEARCH_VEL", to_mm), of_joint.figure("HOME_LATCH_VEL", to_mm)
    homes = search is not None and search.value != 0.0
    return AxisFound(
        name=letter,
        steps_per_unit=Figure(abs(scale.value) / to_mm, scale.origin),
        unit=Unit.DEG if letter in _ANGULAR else Unit.MM,
        lower=of_axis.figure("MIN_LIMIT", to_mm) or of_joint.figure("MIN_LIMIT", to_mm),
        upper=of_axis.figure("MAX_LIMIT", to_mm) or of_joint.figure("MAX_LIMIT", to_mm),
        speed_max=of_joint.figure("MAX_VELOCITY", to_mm) or of_axis.figure("MAX_VELOCITY", to_mm),
        acceleration_max=of_joint.figure("MAX_ACCELERATION", to_mm) or of_axis.figure("MAX_ACCELERATION", to_mm),
        home_direction=int(copysign(1.0, search.value)) if search is not None and homes else 0,
        endstop=(
            of_joint.figure("HOME_OFFSET", to_mm) or Figure(0.0, "LinuxCNC's default of HOME_OFFSET", assumed=True)
        )
        if homes
        else None,
        search_speed=search.scaled(copysign(1.0, search.value)) if search is not None and homes else None,
        zero_speed=latch.scaled(copysign(1.0, latch.value)) if latch is not None and homes and latch.value else None,
        second_motor="" if second is None else f"joint {second}",
    )


class _Figures:
    """The numbers of a section."""

    def __init__(self, name: str, options: Mapping[str, str]) -> None:
        self.name = name
        self.options = options

    def figure(self, key: str, factor: float = 1.0) -> Figure | None:
        """Return a number times a factor; None if the section has none."""
        text = self.options.get(key)
        if text is None or not text.split():
            return None
        with prefixed(f"[{self.name}] {key}: "):
            return Figure(finite_number(text.split()[0]) * factor, f"[{self.name}] {key} = {text.split()[0]}")


def _hal(path: Path, sections: Sections) -> dict[str, list[tuple[str, str]]]:
    """Return what .hal files beside the .ini set of step generators' times: file and value, by the time's name."""
    found: dict[str, list[tuple[str, str]]] = {}
    for name in sections.get("HAL", {}).get("HALFILE", "").split():
        inside = not Path(name).is_absolute() and ".." not in Path(name).parts
        if name.endswith(".hal") and inside and is_file(path.parent / name):
            for _, key, text in _SETP.findall(read_old_text(path.parent / name, PROGRAM_BYTES_MAX)):
                found.setdefault(key.upper(), []).append((name, text))
    return found


def _pulses(sections: Sections, hal: Mapping[str, list[tuple[str, str]]]) -> dict[str, Figure]:
    """Return the times of the step generators: the longest of each, of .hal files before the .ini's."""
    pulses = {}
    for key, name in _TIMES.items():
        texts = [(file, text) for file, text in hal.get(key, ()) if re.fullmatch(r"[\d.]+", text)]
        texts = texts or [
            (f"[{section}] {key}", options[key].split()[0])
            for section, options in sections.items()
            if re.fullmatch(r"(JOINT|AXIS)_\d+", section) and options.get(key, "").split()
        ]
        figures = [Figure(finite_number(text), f"{place}: {text} ns") for place, text in texts]
        if figures:
            pulses[name] = max(figures, key=lambda each: each.value)
    return pulses


def _notes(sections: Sections, axes: tuple[AxisFound, ...], hal: Mapping[str, object], to_mm: float) -> Iterator[str]:
    if to_mm != 1.0:
        yield "lengths of the file are in inches; here they are in mm"
    turned = [name for name, options in sections.items() if options.get("SCALE", "").startswith("-")]
    if turned:
        yield f"SCALE is negative in {', '.join(turned)}: that motor is turned round, which moves nothing here"
    names = sections.get("HAL", {}).get("HALFILE", "").split()
    if names and not hal:
        yield f"step generators' times may be set in {', '.join(names)}, which say nothing of them or are not here"
    for axis in axes:
        if axis.second_motor:
            yield f"{axis.name}: {axis.second_motor} moves it too: a second motor"
    if any(
        float(options["BACKLASH"].split()[0]) for options in sections.values() if _is_number(options.get("BACKLASH"))
    ):
        yield "BACKLASH is not read"


def _is_number(text: str | None) -> bool:
    return bool(text and re.fullmatch(r"[-+\d.eE]+", text.split()[0]) and re.search(r"\d", text.split()[0]))
