"""The TB6560AHQ chip and the drivers that use it.

All pages are those of the Toshiba datasheet "TB6560AHQ/AFG" of 2014-10-01. The switches of the 3 A module are taken
from its table of currents and from sellers' descriptions, not from a schematic.
"""

from dataclasses import replace
from enum import Enum
from math import ceil
from typing import Final, NamedTuple

from steptwin.protocol.drivers.chip_sheet import (
    ChipSheet,
    Fact,
    Oscillator,
    OutputPin,
    PinTable,
    Release,
    Shutdown,
    StepTimes,
    assumed,
    quoted,
)
from steptwin.protocol.drivers.driver_profile import (
    ActiveEdge,
    Cooling,
    Coupler,
    CurrentSetting,
    DriverProfile,
    InputLevels,
)


class PinKind(Enum):
    """Electrical kind of a pin."""

    INPUT = "input"
    """Logic input with a pull-down of 100 kOhm: low if nothing is connected."""
    OPEN_DRAIN = "open drain"
    """Pulls low or is open; an external pull-up makes it high. Sinks up to 1 mA."""
    BRIDGE = "bridge"
    """Output to one end of a motor phase."""
    PASSIVE = "passive"
    """Pin with a resistor or capacitor to ground."""
    SUPPLY = "supply"
    GROUND = "ground"


class PinRow(NamedTuple):
    """One row of the pin table."""

    number: int
    name: str
    kind: PinKind
    function: str
    page: int


PINS: Final = (
    PinRow(1, "TQ2", PinKind.INPUT, "torque, with TQ1", 3),
    PinRow(2, "TQ1", PinKind.INPUT, "torque, with TQ2", 3),
    PinRow(3, "CLK", PinKind.INPUT, "a rise is a step", 3),
    PinRow(4, "ENABLE", PinKind.INPUT, "low: all outputs off", 3),
    PinRow(5, "RESET", PinKind.INPUT, "low: initial state", 3),
    PinRow(6, "SGND", PinKind.GROUND, "of the logic", 3),
    PinRow(7, "OSC", PinKind.PASSIVE, "capacitor of the chopper's oscillator", 3),
    PinRow(8, "VMB", PinKind.SUPPLY, "of the motor, phase B", 3),
    PinRow(9, "OUT_BM", PinKind.BRIDGE, "phase B, minus", 3),
    PinRow(10, "PGNDB", PinKind.GROUND, "of phase B", 3),
    PinRow(11, "NFB", PinKind.PASSIVE, "resistor that senses phase B's current", 3),
    PinRow(12, "OUT_BP", PinKind.BRIDGE, "phase B, plus", 3),
    PinRow(13, "OUT_AM", PinKind.BRIDGE, "phase A, minus", 3),
    PinRow(14, "NFA", PinKind.PASSIVE, "resistor that senses phase A's current", 3),
    PinRow(15, "PGNDA", PinKind.GROUND, "of phase A", 3),
    PinRow(16, "OUT_AP", PinKind.BRIDGE, "phase A, plus", 3),
    PinRow(17, "MO", PinKind.OPEN_DRAIN, "low in the initial state", 3),
    PinRow(18, "VMA", PinKind.SUPPLY, "of the motor, phase A", 3),
    PinRow(19, "Protect", PinKind.OPEN_DRAIN, "low after thermal shutdown (page 10; page 3 says high)", 10),
    PinRow(20, "VDD", PinKind.SUPPLY, "of the logic, 5 V", 3),
    PinRow(21, "CW/CCW", PinKind.INPUT, "low: CW, high: CCW", 3),
    PinRow(22, "M2", PinKind.INPUT, "excitation, with M1", 3),
    PinRow(23, "M1", PinKind.INPUT, "excitation, with M2", 3),
    PinRow(24, "DCY2", PinKind.INPUT, "decay, with DCY1", 3),
    PinRow(25, "DCY1", PinKind.INPUT, "decay, with DCY2", 3),
)

_SHEET: Final = "TB6560AHQ datasheet, page"
SENSE_VOLT: Final = 0.5
"""Voltage at the sense resistor that ends charging (V_NF, typical, pages 6 to 8)."""


def tb6560(osc_pf: float) -> ChipSheet:
    """Return the chip with this capacitor at OSC; raise ValueError if the capacitor is too small for the oscillator."""
    oscillator = Oscillator(osc_pf)
    return replace(
        _TB6560,
        oscillator=oscillator,
        times=StepTimes(
            steplen_ns=Fact(ceil(1000 * oscillator.clk_width_min_us), f"{_SHEET} 8"),
            rate_max_hz=Fact(15_000, f"{_SHEET} 7"),
        ),
    )


_TB6560: Final = ChipSheet(
    name="TB6560AHQ",
    document="Toshiba TB6560AHQ/AFG, 2014-10-01",
    times=StepTimes(),
    modes=Fact(PinTable(("M2", "M1"), ((1, "LL"), (2, "LH"), (16, "HL"), (8, "HH"))), f"{_SHEET} 9"),
    mode_in_reset=Fact(True, f"{_SHEET} 15"),
    ordered_power=Fact(True, f"{_SHEET} 28"),
    torque_percent=Fact(PinTable(("TQ2", "TQ1"), ((100, "LL"), (75, "LH"), (50, "HL"), (20, "HH"))), f"{_SHEET} 10"),
    fast_decay_percent=Fact(
        PinTable(("DCY2", "DCY1"), ((0, "LL"), (25, "LH"), (50, "HL"), (100, "HH"))), f"{_SHEET} 10"
    ),
    home_deg=Fact(0.0, f"{_SHEET} 9: A alone"),
    home_full_deg=Fact(315.0, f"{_SHEET} 9: A full, B full negative"),
    vector_percent=Fact((100, 100, 98, 96, 92, 88, 83, 77, 71, 63, 56, 47, 38, 29, 20, 10, 0), f"{_SHEET} 8, typical"),
    both_full=True,
    home_output=Fact(OutputPin("MO", 0), f"{_SHEET} 10"),
    fault_output=Fact(OutputPin("Protect", 0), f"{_SHEET} 10"),
    blocked=Fact(False, f"{_SHEET} 11: only the outputs go off, the counter follows CLK"),
    on_delay_ns=Fact(3_000, "TB6560AHQ datasheet, pages 6 to 8, typical"),
    off_delay_ns=Fact(2_000, "TB6560AHQ datasheet, pages 6 to 8, typical"),
    shutdown=Fact(Shutdown(170, 20, Release.RESET), "TB6560AHQ datasheet, pages 6 to 8"),
    current_law=Fact("0.5 V / R", "TB6560AHQ datasheet, pages 6 to 8"),
    current_max_a=Fact(3.0, "TB6560AHQ datasheet, pages 6 to 8; 3.5 A is the absolute maximum, for moments"),
    sense_ohm=assumed(0.33, "1.5 A"),
    on_resistance_ohm=Fact(0.6, "TB6560AHQ datasheet, pages 6 to 8, typical, upper and lower together"),
    supply_v=Fact((4.5, 34.0), f"{_SHEET} 8"),
)

_LOGIC: Final = Fact(InputLevels(2.0), f"{_SHEET} 7, V_IH")


def bare_chip(osc_pf: float) -> DriverProfile:
    """Return the profile of a chip that is wired directly to the board, with this capacitor at OSC."""
    return DriverProfile(
        name=f"chip-{osc_pf:g}pf",
        title=f"TB6560AHQ wired straight to the board, {osc_pf:g} pF at OSC",
        chip=tb6560(osc_pf),
        switched=False,
        inputs=_LOGIC,
    )


_SENSE_OHM: Final = {"SW1": 0.33, "SW2": 0.5, "SW3": 1.2}
"""Sense resistors by switch, read from a photograph. SW1 to SW3 connect them in parallel; S1 is TQ1."""


def _setting(printed_a: float, *switches: str) -> CurrentSetting:
    ohm = 1 / sum(1 / _SENSE_OHM[name] for name in switches if name in _SENSE_OHM)
    return CurrentSetting(printed_a, SENSE_VOLT / ohm, 75 if "S1" in switches else 100, switches)


THREE_AMP_MODULE: Final = DriverProfile(
    name="3a-module",
    title='single-axis "3 A" module: 6N137 on STEP, PC817 on DIR and EN, own switches',
    chip=tb6560(330),
    clk=Fact(Coupler(to_high_ns=75, to_low_ns=75), "6N137: 75 ns at most"),
    direction=assumed(Coupler(4_000, 24_000), "PC817: 4 us at 100 ohm (Sharp), tens of us with the board's kilohms"),
    enable=assumed(Coupler(24_000, 4_000), "as DIR, where the light switches the chip off"),
    enable_open=1,  # its EN light on means off, so it is on without a cable
    currents=assumed(
        (
            _setting(0.3, "SW3", "S1"),
            _setting(0.5, "SW3"),
            _setting(0.8, "SW2", "S1"),
            _setting(1.0, "SW2"),
            _setting(1.1, "SW2", "SW3", "S1"),
            _setting(1.2, "SW1", "S1"),
            _setting(1.4, "SW2", "SW3"),
            _setting(1.5, "SW1", "SW3", "S1"),
            _setting(1.6, "SW1"),
            _setting(1.9, "SW1", "SW2", "S1"),
            _setting(2.0, "SW1", "SW3"),
            _setting(2.2, "SW1", "SW2", "SW3", "S1"),
            _setting(2.6, "SW1", "SW2"),
            _setting(3.0, "SW1", "SW2", "SW3"),
        ),
        "the table on the board, which these resistors make within 0.1 A",
    ),
    idle_percents=(20, 50),  # S2; the sellers' descriptions disagree: ON is taken as 50 %
    idle_percent=50,
    inputs=assumed(InputLevels(3.0, 5.0), "330 ohm in series: 6.4 mA at 3.3 V, and a 6N137 needs 5 mA"),
    cooling=assumed(Cooling(resistance_k_per_w=8.0, capacity_j_per_k=40.0), "the heat sink of such a board"),
    source="3 A module: PC817 on DIR against 6N137 on STEP",
)

_BLUE: Final = "LinuxCNC settings passed on for blue TB6560 boards: 150 us, falling edge"

SLOW_BLUE_BOARD: Final = DriverProfile(
    name="slow-blue-board",
    title="blue multi-axis board: 150 us for all four timings, steps with the falling edge",
    chip=tb6560(330),
    times=StepTimes(
        steplen_ns=quoted(150_000, _BLUE),
        stepspace_ns=quoted(150_000, _BLUE),
        dirsetup_ns=quoted(150_000, _BLUE),
        dirhold_ns=quoted(150_000, _BLUE),
    ),
    active_edge=ActiveEdge.FALLING,
    switched=False,
    inputs=_LOGIC,
    cooling=assumed(Cooling(resistance_k_per_w=8.0, capacity_j_per_k=40.0), "the heat sink of such a board"),
    source=_BLUE,
)

PROFILES: Final = (bare_chip(100), bare_chip(330), bare_chip(1000), THREE_AMP_MODULE, SLOW_BLUE_BOARD)
