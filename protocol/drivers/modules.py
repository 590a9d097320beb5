"""Driver modules whose makers do not name the chip: Leadshine DM542, StepperOnline DM542T, TB6600 modules.

Switches select mode and current. Optocouplers are at the inputs; the stated times include their delays.
"""

from dataclasses import replace
from typing import Final

from steptwin.protocol.drivers.chip_sheet import (
    ChipSheet,
    Fact,
    OverVoltage,
    PinTable,
    Release,
    StepTimes,
    always,
    assumed,
    quoted,
)
from steptwin.protocol.drivers.driver_profile import Cooling, CurrentSetting, DriverProfile, InputLevels

_IN_A_CASE: Final = assumed(Cooling(resistance_k_per_w=4.0, capacity_j_per_k=100.0), "its case is the heat sink")
_HALF: Final = PinTable(("HALF",), ((100, "L"), (50, "H")))
"""Standstill current: the driver halves it by itself."""


def _settings(pins: tuple[str, ...], rows: dict[float, str]) -> tuple[CurrentSetting, ...]:
    """Return a current table from letters, one for each switch: H for ON."""
    on = {
        ampere: tuple(pin for pin, letter in zip(pins, row, strict=True) if letter == "H")
        for ampere, row in rows.items()
    }
    return tuple(CurrentSetting(ampere, ampere, 100, switches) for ampere, switches in on.items())


_DM542: Final = "Leadshine DM542 manual V1.0 (2012), section"
DM542: Final = ChipSheet(
    name="DM542",
    document="Leadshine DM542 manual V1.0, 2012",
    rails=("VM",),
    logic_rail="VM",
    times=StepTimes(
        steplen_ns=Fact(2_500, f"{_DM542} 10, t3"),
        stepspace_ns=Fact(2_500, f"{_DM542} 10, t4"),
        dirsetup_ns=Fact(5_000, f"{_DM542} 10, t2"),
        dirhold_ns=assumed(10_000, "LinuxCNC's figure for a DM556"),
        enable_ns=Fact(10_000, f"{_DM542} 10: t1 before DIR, and t2 from DIR"),
        rate_max_hz=Fact(200_000, f"{_DM542} 2"),
    ),
    modes=Fact(
        PinTable(
            ("SW5", "SW6", "SW7", "SW8"),
            (
                (2, "LHHH"),
                (4, "HLHH"),
                (8, "LLHH"),
                (16, "HHLH"),
                (32, "LHLH"),
                (64, "HLLH"),
                (128, "LLLH"),
                (5, "HHHL"),
                (10, "LHHL"),
                (20, "HLHL"),
                (25, "LLHL"),
                (40, "HHLL"),
                (50, "LHLL"),
                (100, "HLLL"),
                (125, "LLLL"),
            ),
        ),
        f"{_DM542} 7; H is ON",
    ),
    torque_percent=Fact(_HALF, f"{_DM542} 7, SW4"),
    fast_decay_percent=assumed(always(0), "its digital current control has no such part"),
    home_deg=assumed(0.0, "not told, and no pin shows it"),
    home_full_deg=assumed(45.0, "it has no full steps"),
    blocked=assumed(True, "ENA off disables the driver"),
    overcurrent=Fact(Release.POWER, f"{_DM542} 11: one blink, until the power is off"),
    overvoltage=Fact(OverVoltage(52, Release.POWER), f"{_DM542} 11: two blinks, until the power is off"),
    current_law=Fact("switches", f"{_DM542} 7"),
    current_max_a=Fact(4.2, f"{_DM542} 7, peak"),
    sense_ohm=assumed(0.05, "not told"),
    on_resistance_ohm=assumed(0.2, "not told"),
    supply_v=Fact((20.0, 50.0), f"{_DM542} 2"),
)

_DM542T: Final = "StepperOnline DM542T manual"
_DM542_MODES: Final = DM542.modes.value
DM542T: Final = replace(
    DM542,
    name="DM542T",
    document="StepperOnline DM542T, V4.0",
    modes=quoted(
        replace(_DM542_MODES, rows=((1, "HHHH"), *_DM542_MODES.rows)),
        f"{_DM542T} V4.0: 200 pulses/rev are new, with all ON as is assumed; the other rows as the DM542's",
    ),
    home_full_deg=assumed(45.0, "not told, and no pin shows it"),
    times=replace(
        DM542.times,
        steplen_ns=Fact(2_500, f"{_DM542T}, t3"),
        stepspace_ns=Fact(2_500, f"{_DM542T}, t4"),
        dirsetup_ns=Fact(5_000, f"{_DM542T}, t2"),
        enable_ns=quoted(200_000_000, f"{_DM542T} V4.0, figure 15; the older one has 5 us"),
    ),
    overcurrent=assumed(Release.POWER, "as the DM542"),
    overvoltage=assumed(OverVoltage(52, Release.POWER), "as the DM542"),
)

_TB6600: Final = "DFRobot TB6600 manual V1.2"
_NO_TIME: Final = assumed(
    5_000, "the manual has no times; the strictest in use, others take 3 us (Klipper) or 4 us (a Marlin configuration)"
)
TB6600: Final = ChipSheet(
    name="TB6600",
    document=_TB6600,
    rails=("VM",),
    logic_rail="VM",
    times=StepTimes(steplen_ns=_NO_TIME, stepspace_ns=_NO_TIME, dirsetup_ns=_NO_TIME, dirhold_ns=_NO_TIME),
    modes=Fact(
        PinTable(
            ("S1", "S2", "S3"),
            (
                (1, "HHL"),
                (2, "HLH"),
                (2, "LHH"),
                (4, "HLL"),
                (8, "LHL"),
                (16, "LLH"),
                (32, "LLL"),
            ),
        ),
        f"{_TB6600}; H is ON",
    ),
    torque_percent=assumed(_HALF, "half the current at standstill"),
    fast_decay_percent=assumed(always(0), "not told"),
    home_deg=assumed(45.0, "not told, and no pin shows it"),
    home_full_deg=assumed(45.0, "not told"),
    blocked=assumed(True, "EN off disables the driver"),
    overcurrent=assumed(Release.POWER, f"{_TB6600}: protected; what ends it is not told"),
    current_law=Fact("switches", _TB6600),
    current_max_a=Fact(3.5, _TB6600),
    sense_ohm=assumed(0.1, "not told"),
    on_resistance_ohm=assumed(0.49, "usual figure, not read there: Toshiba TB67S109A, which is often inside"),
    supply_v=Fact((9.0, 42.0), _TB6600),
)

_DM_CURRENTS: Final = _settings(
    ("SW1", "SW2", "SW3"),
    {1.0: "HHH", 1.46: "LHH", 1.91: "HLH", 2.37: "LLH", 2.84: "HHL", 3.31: "LHL", 3.76: "HLL", 4.2: "LLL"},
)
_TB_CURRENTS: Final = _settings(
    ("S4", "S5", "S6"),
    {0.5: "HHH", 1.0: "HLH", 1.5: "HHL", 2.0: "HLL", 2.5: "LHH", 2.8: "LLH", 3.0: "LHL", 3.5: "LLL"},
)

_DM542_PROFILE: Final = DriverProfile(
    name="dm542",
    title="Leadshine DM542 (2012): 1/2 to 1/128 and 1/5 to 1/125, optocouplers",
    chip=DM542,
    enable_open=1,
    currents=Fact(_DM_CURRENTS, f"{_DM542} 7, peak"),
    current_a=1.46,
    idle_percents=(50, 100),
    idle_percent=50,
    idle_ms=Fact(1_000, f"{_DM542} 7"),
    inputs=Fact(InputLevels(5.0, 7.0), f"{_DM542} 2"),
    cooling=_IN_A_CASE,
    source=f"{_DM542} 10",
)

PROFILES: Final = (
    _DM542_PROFILE,
    replace(
        _DM542_PROFILE,
        name="dm542t",
        title="StepperOnline DM542T V4.0, switched to 5 V: as a DM542, and 1/1; ENA 200 ms before the first pulse",
        chip=DM542T,
        currents=Fact(_DM_CURRENTS, f"{_DM542T}, peak"),
        idle_ms=Fact(400, _DM542T),
        inputs=quoted(InputLevels(3.5, 7.0), f"{_DM542T} V4.0, its switch at 5 V: at 24 V it hears no 5 V signal"),
        source=_DM542T,
    ),
    DriverProfile(
        name="tb6600",
        title="TB6600 module: 1/1 to 1/32, optocouplers; its manual has no times, 5 us are assumed",
        chip=TB6600,
        enable_open=1,
        currents=assumed(_TB_CURRENTS, f"the usual rows; {_TB6600} states the currents"),
        idle_percents=(50,),
        idle_percent=50,
        inputs=Fact(InputLevels(5.0, 8.0), f"{_TB6600}: 8 to 15 mA"),
        cooling=_IN_A_CASE,
        source=_TB6600,
    ),
)
