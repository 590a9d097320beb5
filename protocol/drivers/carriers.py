"""Driver chips of Allegro, TI and Trinamic on small carrier boards, wired directly to the board's pins.

Straps or registers select the microstep mode; a trimmer or a register sets the current.
"""

from dataclasses import replace
from typing import Final

from steptwin.protocol.drivers.chip_sheet import (
    ChipSheet,
    Fact,
    OutputPin,
    PinTable,
    Release,
    Shutdown,
    StepTimes,
    always,
    assumed,
    quoted,
)
from steptwin.protocol.drivers.driver_profile import Cooling, DriverProfile, InputLevels

_FULL_TORQUE: Final = assumed(always(100), "no pin reduces the current")
_COOLING: Final = assumed(Cooling(resistance_k_per_w=32.0, capacity_j_per_k=1.0), "a carrier without a heat sink")

_A4988: Final = "A4988-DS Rev. 4, page"
A4988: Final = ChipSheet(
    name="A4988",
    document="Allegro A4988-DS, Rev. 4",
    times=StepTimes(
        steplen_ns=Fact(1_000, f"{_A4988} 6, figure 1, t_A"),
        stepspace_ns=Fact(1_000, f"{_A4988} 6, figure 1, t_B"),
        dirsetup_ns=Fact(200, f"{_A4988} 6, figure 1, t_C"),
        dirhold_ns=Fact(200, f"{_A4988} 6, figure 1, t_D"),
        wake_ns=Fact(1_000_000, f"{_A4988} 10, Sleep Mode"),
        rate_max_hz=Fact(500_000, f"{_A4988} 6, figure 1: t_A + t_B"),
    ),
    modes=Fact(
        PinTable(("MS1", "MS2", "MS3"), ((1, "LLL"), (2, "HLL"), (4, "LHL"), (8, "HHL"), (16, "HHH"))), f"{_A4988} 6"
    ),
    torque_percent=_FULL_TORQUE,
    fast_decay_percent=Fact(always(31), f"{_A4988} 7 and 9: 31.25 % in mixed decay"),
    home_deg=Fact(45.0, f"{_A4988} 14"),
    home_full_deg=Fact(45.0, f"{_A4988} 14"),
    blocked=Fact(False, f"{_A4988} 10: the translator follows STEP while the outputs are off"),
    shutdown=Fact(Shutdown(165, 15, Release.COOLING), f"{_A4988} 4"),
    overcurrent=assumed(Release.POWER, "A4988-DS Rev. 4, page 7: latched; what ends it was not read there"),
    current_law=Fact("VREF / (8 R)", f"{_A4988} 9"),
    current_max_a=Fact(2.0, f"{_A4988} 3"),
    sense_ohm=assumed(0.1, "usual on carriers"),
    on_resistance_ohm=assumed(0.64, "usual figure, not read there: A4988 datasheet: 320 mohm each, typical"),
    supply_v=assumed((8.0, 35.0), "usual figure, not read there: A4988 datasheet, load supply"),
)

_DRV8825: Final = "TI SLVSA73A, page"
_NEWER: Final = "TI DRV8825 datasheet, timing requirements; SLVSA73A has shorter times"
DRV8825: Final = ChipSheet(
    name="DRV8825",
    document="TI SLVSA73A, October 2010; times of later revisions",
    rails=("VM",),
    logic_rail="VM",
    times=StepTimes(
        steplen_ns=quoted(1_900, _NEWER),
        stepspace_ns=quoted(1_900, _NEWER),
        dirsetup_ns=quoted(650, _NEWER),
        dirhold_ns=quoted(650, _NEWER),
        enable_ns=quoted(650, _NEWER),
        wake_ns=quoted(1_700_000, _NEWER),
        rate_max_hz=quoted(250_000, _NEWER),
    ),
    modes=Fact(
        PinTable(
            ("MODE2", "MODE1", "MODE0"),
            (
                (1, "LLL"),
                (2, "LLH"),
                (4, "LHL"),
                (8, "LHH"),
                (16, "HLL"),
                (32, "HLH"),
                (32, "HHL"),
                (32, "HHH"),
            ),
        ),
        f"{_DRV8825} 9",
    ),
    torque_percent=_FULL_TORQUE,
    fast_decay_percent=Fact(
        PinTable(("DECAY_DRIVEN", "DECAY"), ((0, "HL"), (75, "L-"), (100, "HH"))), f"{_DRV8825} 9: mixed when open"
    ),
    home_deg=Fact(45.0, f"{_DRV8825} 10"),
    home_full_deg=Fact(45.0, f"{_DRV8825} 10"),
    home_output=Fact(OutputPin("nHOME", 0), f"{_DRV8825} 3"),
    fault_output=Fact(OutputPin("nFAULT", 0), f"{_DRV8825} 3"),
    blocked=Fact(True, f"{_DRV8825} 12: STEP is ignored while nENBL is high"),
    shutdown=Fact(Shutdown(150, 0, Release.COOLING), f"{_DRV8825} 12 and 13: 150 at least, no hysteresis is stated"),
    overcurrent=Fact(Release.RESET, f"{_DRV8825} 12: latched until nRESET or VM"),
    current_law=Fact("VREF / (5 R)", f"{_DRV8825} 8"),
    current_max_a=assumed(2.5, "usual figure, not read there: TI DRV8825 datasheet, first page"),
    sense_ohm=assumed(0.1, "usual on carriers"),
    on_resistance_ohm=assumed(0.4, "usual figure, not read there: TI DRV8825 datasheet: 0.2 ohm each, typical"),
    supply_v=assumed((8.2, 45.0), "usual figure, not read there: TI DRV8825 datasheet, first page"),
)

_A3967: Final = "Allegro 26184.24H, page"
A3967: Final = ChipSheet(
    name="A3967",
    document="Allegro 26184.24H",
    times=StepTimes(
        steplen_ns=quoted(1_000, "Allegro 26184.24H, timing"),
        stepspace_ns=quoted(1_000, "Allegro 26184.24H, timing"),
        dirsetup_ns=quoted(200, "Allegro 26184.24H, timing"),
        dirhold_ns=assumed(200, "as the setup time"),
        wake_ns=quoted(1_000_000, "Allegro 26184.24H, sleep mode"),
        rate_max_hz=quoted(500_000, "Allegro 26184.24H, timing"),
    ),
    modes=Fact(PinTable(("MS1", "MS2"), ((1, "LL"), (2, "HL"), (4, "LH"), (8, "HH"))), "Allegro 26184.24H, table 1"),
    torque_percent=_FULL_TORQUE,
    fast_decay_percent=assumed(PinTable(("PFD2", "PFD1"), ((0, "HH"), (50, "LH"), (100, "LL"))), "PFD's voltage"),
    home_deg=assumed(45.0, "as other translators of Allegro"),
    home_full_deg=assumed(45.0, "as other translators of Allegro"),
    blocked=assumed(False, "as other translators of Allegro"),
    shutdown=Fact(Shutdown(165, 15, Release.COOLING), f"{_A3967} 4"),
    current_law=assumed("VREF / (8 R)", "usual figure, not read there: Allegro 26184.24H"),
    current_max_a=quoted(0.75, "Allegro 26184.24H, first page"),
    sense_ohm=assumed(0.75, "EasyDriver"),
    on_resistance_ohm=assumed(2.0, "its bridges drop 1 to 2 V"),
    supply_v=assumed((7.0, 30.0), "usual figure, not read there: EasyDriver's description"),
)

_TRINAMIC: Final = "TMC2226 datasheet Rev. 1.06, section"
_REGISTER: Final = tuple(
    (1 << power, f"H--{8 - power:04b}".replace("0", "L").replace("1", "H")) for power in range(8, -1, -1)
)
TMC2209: Final = ChipSheet(
    name="TMC2209",
    document="Trinamic TMC2226 datasheet Rev. 1.06 (the same die)",
    times=StepTimes(
        steplen_ns=Fact(104, f"{_TRINAMIC} 13.1: t_CLK + 20 ns at 12 MHz"),
        stepspace_ns=Fact(104, f"{_TRINAMIC} 13.1: t_CLK + 20 ns at 12 MHz"),
        dirsetup_ns=Fact(20, f"{_TRINAMIC} 13.1"),
        dirhold_ns=Fact(20, f"{_TRINAMIC} 13.1"),
        rate_max_hz=Fact(6_000_000, f"{_TRINAMIC} 13.1: half of 12 MHz"),
    ),
    modes=Fact(
        PinTable(
            ("MSTEP_REG", "MS2", "MS1", "MRES3", "MRES2", "MRES1", "MRES0"),
            ((8, "LLL----"), (32, "LLH----"), (64, "LHL----"), (16, "LHH----"), *_REGISTER),
        ),
        "TMC2226 datasheet Rev. 1.06, page 9: by pins, or by its register of 1 to 256",
    ),
    torque_percent=_FULL_TORQUE,
    fast_decay_percent=assumed(always(0), "its choppers have no fixed part of fast decay"),
    home_deg=Fact(90.0, f"{_TRINAMIC} 13.4: phase A crosses zero, phase B is at its peak"),
    home_full_deg=assumed(135.0, "full steps have both phases on"),
    home_output=Fact(OutputPin("INDEX", 1), f"{_TRINAMIC} 13.4"),
    fault_output=Fact(OutputPin("DIAG", 1), f"{_TRINAMIC} 15"),
    blocked=assumed(False, "ENN is described for the outputs alone"),
    shutdown=assumed(Shutdown(143, 23, Release.COOLING), "on again below the warning of 120"),
    overcurrent=Fact(Release.ENABLE, f"{_TRINAMIC} 15: latched until ENN"),
    current_law=quoted("0.325 V / (R + 0.02 ohm), by VREF or IRUN", "TMC2209 datasheet"),
    current_max_a=assumed(2.8, "usual figure, not read there: TMC2209 datasheet, first page: peak"),
    sense_ohm=assumed(0.11, "usual on carriers"),
    on_resistance_ohm=assumed(0.34, "usual figure, not read there: TMC2209 datasheet: 170 mohm each"),
    supply_v=assumed((4.75, 29.0), "usual figure, not read there: TMC2209 datasheet, first page"),
)

_TMC5160: Final = "TMC5160 datasheet Rev. 1.10"
TMC5160: Final = replace(
    TMC2209,
    name="TMC5160",
    document="Trinamic TMC5160 datasheet Rev. 1.10, as a STEP/DIR driver",
    times=StepTimes(
        steplen_ns=Fact(104, f"{_TMC5160}, figure 15.1: t_CLK + 20 ns at 12 MHz"),
        stepspace_ns=Fact(104, f"{_TMC5160}, figure 15.1: t_CLK + 20 ns at 12 MHz"),
        dirsetup_ns=Fact(20, f"{_TMC5160}, figure 15.1"),
        dirhold_ns=Fact(20, f"{_TMC5160}, figure 15.1"),
        rate_max_hz=Fact(6_000_000, f"{_TMC5160}, figure 15.1: half of 12 MHz"),
    ),
    modes=Fact(
        PinTable(("MRES3", "MRES2", "MRES1", "MRES0"), tuple((mode, letters[3:]) for mode, letters in _REGISTER)),
        f"{_TMC5160}, CHOPCONF",
    ),
    home_deg=assumed(90.0, "as the TMC2209"),
    home_output=assumed(OutputPin("DIAG1", 1), "DIAG1 can be set to tell of the index"),
    fault_output=assumed(OutputPin("DIAG0", 0), "DIAG0 can be set to tell of faults; it is an open drain"),
    shutdown=assumed(Shutdown(136, 16, Release.COOLING), "the lowest; on again below the warning of 120"),
    overcurrent=assumed(Release.ENABLE, "as the TMC2209"),
    current_law=assumed("0.325 V / R, by GLOBALSCALER and IRUN", "usual figure, not read there: TMC5160 datasheet"),
    current_max_a=assumed(4.0, "0.075 ohm in series"),
    sense_ohm=quoted(0.075, "PAROL6"),
    on_resistance_ohm=assumed(0.06, "transistors outside of the chip"),
    supply_v=assumed((8.0, 60.0), "usual figure, not read there: TMC5160 datasheet, first page"),
)

_HIGH_3V3: Final = assumed(InputLevels(2.31), "0.7 VDD at 3.3 V")
PROFILES: Final = (
    DriverProfile(
        name="a4988",
        title="A4988 carrier: up to 1/16, goes on counting while it is disabled",
        chip=A4988,
        current_a=1.0,
        fast_decay_percent=31,
        inputs=_HIGH_3V3,
        cooling=_COOLING,
    ),
    DriverProfile(
        name="drv8825",
        title="DRV8825 carrier: up to 1/32, ignores STEP while it is disabled",
        chip=DRV8825,
        enable_open=1,  # nENBL has a pull-down
        fast_decay_percent=75,
        fault_terminal=True,
        inputs=assumed(InputLevels(2.2), "usual figure, not read there: TI DRV8825 datasheet, V_IH"),
        cooling=_COOLING,
    ),
    DriverProfile(
        name="a3967",
        title="A3967 on an EasyDriver: up to 1/8, 0.75 A",
        chip=A3967,
        current_a=0.75,
        fast_decay_percent=50,
        inputs=assumed(InputLevels(3.5), "0.7 VCC at the EasyDriver's 5 V"),
        cooling=_COOLING,
    ),
    DriverProfile(
        name="tmc2209",
        title="TMC2209 carrier: up to 1/256, by pins 1/8 to 1/64",
        chip=TMC2209,
        fault_terminal=True,
        inputs=_HIGH_3V3,
        cooling=_COOLING,
    ),
    DriverProfile(
        name="tmc5160",
        title="TMC5160 with STEP and DIR: up to 1/256 by SPI",
        chip=TMC5160,
        current_a=2.0,
        fault_terminal=True,
        inputs=_HIGH_3V3,
        cooling=_COOLING,
    ),
)
