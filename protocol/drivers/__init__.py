"""Stepper drivers as data: the chip, its circuit and its settings. The emulator and the host's planner use them."""

from typing import Final

from steptwin.protocol.drivers.carriers import PROFILES as _CARRIERS
from steptwin.protocol.drivers.chip_sheet import (
    OSC_PF_MIN,
    ChipSheet,
    Fact,
    Grade,
    Oscillator,
    OutputPin,
    OverVoltage,
    PinTable,
    Release,
    Shutdown,
    StepTimes,
)
from steptwin.protocol.drivers.driver_profile import (
    GENERIC,
    NO_TIMES,
    WIRE,
    ActiveEdge,
    Cooling,
    Coupler,
    CurrentSetting,
    DriverFigures,
    DriverProfile,
    InputLevels,
    one_of,
)
from steptwin.protocol.drivers.modules import PROFILES as _MODULES
from steptwin.protocol.drivers.tb6560 import PROFILES as _TB6560
from steptwin.protocol.drivers.tb6560 import bare_chip

PROFILES: Final = {profile.name: profile for profile in (*_TB6560, *_CARRIERS, *_MODULES)}
"""Profiles by their names."""


def driver_names() -> tuple[str, ...]:
    """Return all driver names that a robot file may use; for "generic" the file must give the figures."""
    return (*PROFILES, GENERIC)


__all__ = [
    "GENERIC",
    "NO_TIMES",
    "OSC_PF_MIN",
    "PROFILES",
    "WIRE",
    "ActiveEdge",
    "ChipSheet",
    "Cooling",
    "Coupler",
    "CurrentSetting",
    "DriverFigures",
    "DriverProfile",
    "Fact",
    "Grade",
    "InputLevels",
    "Oscillator",
    "OutputPin",
    "OverVoltage",
    "PinTable",
    "Release",
    "Shutdown",
    "StepTimes",
    "bare_chip",
    "driver_names",
    "one_of",
]
