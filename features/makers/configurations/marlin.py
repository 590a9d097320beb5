"""Read a Marlin configuration: Configuration.h with the Configuration_adv.h beside it, or what M503 lists.

Names are those of Marlin 2.1.3's Configuration.h and Configuration_adv.h; older names are read, too.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from steptwin.features.makers.configurations.machine import NO_CORNERS, AxisFound, Configuration, Drivers, Figure
from steptwin.features.makers.configurations.preprocessor import Defines
from steptwin.host.common.bad_input import prefixed, shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX
from steptwin.host.common.numbers import finite_number
from steptwin.host.common.own_files import is_file, read_old_text

AXES: Final = ("X", "Y", "Z")
ADVANCED: Final = "Configuration_adv.h"
OTHER_KINDS: Final = (
    "AXEL_TPARA", "COREXZ", "COREYZ", "COREZX", "COREZY", "DELTA", "MARKFORGED_XY", "MARKFORGED_YX", "MORGAN_SCARA",
    "MP_SCARA", "POLAR", "POLARGRAPH",
)  # fmt: skip
"""Mechanisms of Marlin that have no kind here."""
_DRIVERS: Final = {
    "A4988": "a4988", "DRV8825": "drv8825", "TB6560": "chip-330pf", "TB6600": "tb6600", "TMC2209": "tmc2209",
    "TMC2209_STANDALONE": "tmc2209", "TMC5160": "tmc5160", "TMC5160_STANDALONE": "tmc5160",
}  # fmt: skip
"""Driver profiles by Marlin's driver types."""
_S_PER_MIN: Final = 60.0


def is_marlin(text: str) -> bool:
    """Return whether a text has Marlin's defines, or is what M503 lists."""
    return bool(re.search(r"^\s*#define\s+DEFAULT_AXIS_STEPS_PER_UNIT\b", text, re.MULTILINE)) or is_listed(text)


def is_listed(text: str) -> bool:
    """Return whether a text is what M503 lists."""
    return bool(re.search(r"^(?:echo:)?\s*M92\s+X", text, re.MULTILINE))


def read_marlin(path: Path) -> Configuration:
    """Return the machine of a Marlin configuration, or of what M503 lists.

    Raises:
        InputError: the file cannot be read, its mechanism has no kind here, or a value is missing or not understood.
    """
    text = read_old_text(path, PROGRAM_BYTES_MAX)
    if is_listed(text):
        return _of_listing(text)
    defines = Defines()
    defines.read(text)
    advanced = path.parent / ADVANCED
    has_advanced = advanced != path and is_file(advanced)
    if has_advanced:
        defines.read(read_old_text(advanced, PROGRAM_BYTES_MAX))
    for name in OTHER_KINDS:
        if defines.has(name):
            raise InputError(f"{name} has no kind here: cartesian machines, COREXY and COREYX have")
    steps = defines.figures("DEFAULT_AXIS_STEPS_PER_UNIT")
    if not steps:
        raise InputError("DEFAULT_AXIS_STEPS_PER_UNIT is missing")
    axes = tuple(_axis(index, name, steps, defines) for index, name in enumerate(AXES) if index < len(steps))
    return Configuration(
        controller="Marlin",
        axes=axes,
        corexy=defines.has("COREXY") or defines.has("COREYX"),
        pulses_ns=_pulses(defines),
        notes=tuple(_notes(defines, axes, has_advanced=has_advanced)),
    )


def _axis(index: int, name: str, steps: Sequence[Figure], defines: Defines) -> AxisFound:
    def listed(key: str, factor: float = 1.0) -> Figure | None:
        figures = defines.figures(key, factor)
        return figures[index] if len(figures) > index else None

    home = defines.figure(f"{name}_HOME_DIR")
    direction = 0 if home is None else (home.value > 0) - (home.value < 0)
    lower, upper = defines.figure(f"{name}_MIN_POS"), defines.figure(f"{name}_MAX_POS")
    search, bump = listed("HOMING_FEEDRATE_MM_M", 1 / _S_PER_MIN), listed("HOMING_BUMP_DIVISOR")
    driver = defines.texts.get(f"{name}_DRIVER_TYPE", "")
    by_uart = driver.startswith("TMC") and not driver.endswith("_STANDALONE")
    return AxisFound(
        name=name,
        steps_per_unit=steps[index],
        microsteps=defines.figure(f"{name}_MICROSTEPS") if by_uart else None,
        lower=lower,
        upper=upper,
        speed_max=listed("DEFAULT_MAX_FEEDRATE"),
        acceleration_max=listed("DEFAULT_MAX_ACCELERATION"),
        home_direction=direction,
        endstop=None if not direction else lower if direction < 0 else upper,
        search_speed=search,
        zero_speed=None if search is None or bump is None else search.scaled(1 / bump.value),
        second_motor=f"{name}2" if f"{name}2_DRIVER_TYPE" in defines.texts else "",
        drivers=Drivers(_DRIVERS[driver], f"{name}_DRIVER_TYPE") if driver in _DRIVERS else None,
    )


def _pulses(defines: Defines) -> dict[str, Figure]:
    names = {
        "steplen_ns": ("MINIMUM_STEPPER_PULSE_NS", 1.0),
        "dirsetup_ns": ("MINIMUM_STEPPER_POST_DIR_DELAY", 1.0),
        "dirhold_ns": ("MINIMUM_STEPPER_PRE_DIR_DELAY", 1.0),
    }
    if "MINIMUM_STEPPER_PULSE" in defines.texts:
        names["steplen_ns"] = ("MINIMUM_STEPPER_PULSE", 1000.0)
    found = {key: defines.figure(name, factor) for key, (name, factor) in names.items()}
    return {key: figure for key, figure in found.items() if figure is not None}


def _notes(defines: Defines, axes: tuple[AxisFound, ...], *, has_advanced: bool) -> Iterator[str]:
    if not has_advanced:
        yield f"{ADVANCED} is not beside the file: pulse times, second motors and bump speeds are the usual ones"
    yield "the EEPROM may hold other values: what M503 lists is read, too"
    types = {defines.texts.get(f"{axis.name}_DRIVER_TYPE", "A4988") for axis in axes}
    for each in sorted(types):
        if each not in _DRIVERS:
            yield f"drivers {shortened(each)} have no profile here: --set driver_profile=NAME"
        elif each == "A4988":
            yield "A4988 is what Marlin's file has unless somebody changed it: look at the board"
    if defines.has("CLASSIC_JERK"):
        yield f"CLASSIC_JERK is a jump of the speed at corners and {NO_CORNERS}"
    elif (junction := defines.figure("JUNCTION_DEVIATION_MM")) is not None:
        yield f"JUNCTION_DEVIATION_MM {junction.value:g} {NO_CORNERS}"
    if defines.has("S_CURVE_ACCELERATION"):
        yield "S_CURVE_ACCELERATION: accelerations peak above DEFAULT_MAX_ACCELERATION on the machine"
    acceleration = defines.figure("DEFAULT_TRAVEL_ACCELERATION") or defines.figure("DEFAULT_ACCELERATION")
    if acceleration is not None:
        yield f"moves have at most {acceleration.value:g} mm/s2 on the machine ({acceleration.origin})"


_PARAMETERS: Final = re.compile(r"([A-Z])\s*(-?[\d.]+)")


def _of_listing(text: str) -> Configuration:
    """Return the machine of M503's commands."""
    commands: dict[str, dict[str, str]] = {}
    for line in text.splitlines():
        if found := re.match(r"(?:echo:)?\s*(M\d+)\s+(.*)", line.partition(";")[0]):
            commands.setdefault(found[1], {}).update(_PARAMETERS.findall(found[2]))

    def figure(command: str, letter: str) -> Figure | None:
        given: Mapping[str, str] = commands.get(command, {})
        if letter not in given:
            return None
        with prefixed(f"{command} {letter}: "):
            return Figure(finite_number(given[letter]), f"{command} {letter}{given[letter]}")

    axes = []
    for name in AXES:
        steps = figure("M92", name)
        if steps is None or steps.value <= 0:
            raise InputError(f"M92 {name}: steps per mm are missing")
        current = figure("M906", name)
        axes.append(
            AxisFound(
                name=name,
                steps_per_unit=steps,
                speed_max=figure("M203", name),
                acceleration_max=figure("M201", name),
                current_a=None if current is None else current.scaled(2**0.5 / 1000),
            )
        )
    return Configuration(
        controller="Marlin",
        axes=tuple(axes),
        corexy=None,
        notes=(
            "whether it is a CoreXY is compiled into Marlin: --set belts=corexy, if it is",
            "M503 says nothing of switches: homing is left out",
        ),
    )
