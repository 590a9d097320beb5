"""Read the settings of grbl 1.1 and grblHAL, as `$$` lists them.

Numbers, units and defaults are those of grbl's doc/markdown/settings.md and grbl/defaults.h at commit bfb67f0c, and of
grblHAL's core/settings.h at f80fc34d.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from steptwin.features.makers.configurations.machine import NO_CORNERS, AxisFound, Configuration, Figure
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import ROBOT_BYTES_MAX
from steptwin.host.common.numbers import finite_number
from steptwin.host.common.own_files import read_old_text
from steptwin.host.robots.joint import Unit

LETTERS: Final = "XYZABC"
_SETTING: Final = re.compile(r"^[<>\s]*\$(\d{1,3})\s*=\s*([^\s;(,]+)", re.MULTILINE)
_OF_AXES: Final = (100, 110, 120, 130)
"""First of the axes' settings: steps per mm, highest speeds in mm/min, accelerations in mm/s2, travels in mm."""
_BLOCK: Final = 10
_JERKS: Final = 800
"""First of grblHAL's settings of the axes' jerk in mm/s3."""
_STEPS_MAX: Final = 1e5
"""Steps per mm above which a setting is no machine's but garbage in the EEPROM."""
_AVR_RATE_HZ: Final = 30_000
"""Highest step rate of grbl on an AVR (grbl's README)."""
_STAYS_ON: Final = 255
_S_PER_MIN: Final = 60.0
_READ: Final = {0, 1, 2, 3, 4, 5, 11, 12, 20, 21, 22, 23, 24, 25, 27, 29, 32, 37}
_USUAL: Final = {24: 25.0, 25: 500.0}


def is_grbl(text: str) -> bool:
    """Return whether a text lists settings of grbl."""
    return len(_SETTING.findall(text)) > 3


def read_grbl(path: Path) -> Configuration:
    """Return the machine of a list of settings.

    Raises:
        InputError: the file cannot be read, is of grbl 0.8 or before, or a value is missing or no machine's.
    """
    listed = [(int(number), text) for number, text in _SETTING.findall(read_old_text(path, ROBOT_BYTES_MAX))]
    settings = dict(listed)
    if 100 not in settings:
        raise InputError(
            "$100 is missing: grbl 0.8 and before number their settings otherwise; take those of 0.9 or later"
        )
    axes = tuple(_axis(index, settings) for index in range(len(LETTERS)) if 100 + index in settings)
    again = sorted(number for number, count in Counter(number for number, _ in listed).items() if count > 1)
    known = _READ | {first + index for first in _OF_AXES for index in range(len(LETTERS))} | _of_grblhal(settings)
    return Configuration(
        controller="grblHAL" if _is_grblhal(settings) else "grbl",
        axes=axes,
        corexy=None,
        pulses_ns=_pulses(settings),
        notes=tuple(_notes(settings, axes, again)),
        left_out=tuple(f"${number}" for number in settings if number not in known),
    )


def _is_grblhal(settings: Mapping[int, str]) -> bool:
    return any(number >= 140 for number in settings)


def _of_grblhal(settings: Mapping[int, str]) -> set[int]:
    return (
        {first + index for first in (140, 150, _JERKS) for index in range(_BLOCK)} if _is_grblhal(settings) else set()
    )


def _figure(settings: Mapping[int, str], number: int, factor: float = 1.0) -> Figure | None:
    text = settings.get(number)
    if text is None:
        if number not in _USUAL:
            return None
        return Figure(_USUAL[number] * factor, f"grbl's default of ${number}", assumed=True)
    with prefixed(f"${number}: "):
        return Figure(finite_number(text) * factor, f"${number}={text}")


def _axis(index: int, settings: Mapping[int, str]) -> AxisFound:
    steps = _figure(settings, 100 + index)
    assert steps is not None
    if not 0 < steps.value < _STEPS_MAX:
        raise InputError(f"${100 + index}: {steps.value:g} steps per mm is no machine's: is the EEPROM erased?")
    travel = _figure(settings, 130 + index)
    search, zero = _figure(settings, 25, 1 / _S_PER_MIN), _figure(settings, 24, 1 / _S_PER_MIN)
    homes = _mask(settings, 22) & 1
    direction = 0 if not homes else -1 if _mask(settings, 23) >> index & 1 else 1
    lower = upper = endstop = None
    if travel is not None and travel.value > 0:
        lower, upper = travel.scaled(-1.0), Figure(0.0, "grbl's machine space is -travel to 0 after homing")
        endstop = lower if direction < 0 else upper
    current = _figure(settings, 140 + index)
    return AxisFound(
        name=LETTERS[index],
        steps_per_unit=steps,
        unit=Unit.MM if LETTERS[index] in "XYZ" else Unit.DEG,
        microsteps=_figure(settings, 150 + index),
        lower=lower,
        upper=upper,
        speed_max=_figure(settings, 110 + index, 1 / _S_PER_MIN),
        acceleration_max=_figure(settings, 120 + index),
        jerk_max=_figure(settings, _JERKS + index),
        home_direction=direction,
        endstop=endstop if direction else None,
        search_speed=search,
        zero_speed=zero,
        current_a=None
        if current is None
        else current.scaled(2**0.5 / 1000)._replace(origin=f"{current.origin} mA rms"),
    )


def _mask(settings: Mapping[int, str], number: int) -> int:
    text = settings.get(number, "0")
    if not text.isdecimal():
        raise InputError(f"${number}: {text!r} is not a whole number")
    return int(text)


def _pulses(settings: Mapping[int, str]) -> dict[str, Figure]:
    times = {"steplen_ns": _figure(settings, 0, 1000.0), "dirsetup_ns": _figure(settings, 29, 1000.0)}
    return {key: figure for key, figure in times.items() if figure is not None}


def _notes(settings: Mapping[int, str], axes: tuple[AxisFound, ...], again: list[int]) -> Iterator[str]:
    for number in again:
        yield f"${number} stands several times: the last one holds"
    yield "whether it is a CoreXY is compiled into grbl: --set belts=corexy, if it is"
    if not _mask(settings, 20):
        yield "$20=0: soft limits are off, so that nothing holds the machine within $130 and its neighbours"
    if not _mask(settings, 22) & 1:
        yield "$22=0: the machine is not homed, so there are no switches and homing is left out"
    if _mask(settings, 1) != _STAYS_ON:
        yield f"$1={_mask(settings, 1)}: the motors lose their current at each standstill, and may lose their position"
    if (junction := _figure(settings, 11)) is not None:
        yield f"$11: a junction deviation of {junction.value:g} mm {NO_CORNERS}"
    for axis in axes:
        rate_hz = axis.steps_per_unit.value * (axis.speed_max.value if axis.speed_max else 0.0)
        if rate_hz > _AVR_RATE_HZ:
            yield f"{axis.name}: {rate_hz:.0f} steps/s is more than the 30 000 of grbl on an AVR; nothing checks it"
