"""The chip's 25 pins, and the settings that the levels at its inputs select, from the datasheet's tables."""

from enum import Enum
from typing import Final, NamedTuple

from steptwin.controller.node.pins import OUTPUT_PINS, Pin
from steptwin.emulator.drivers.driver_chip import Rail
from steptwin.emulator.drivers.tb6560.excitation import Excitation


class PinKind(Enum):
    """Electrical kind of a pin."""

    INPUT = "input"
    """Logic input with a pull-down of 100 kOhm: low while nothing is connected."""
    OPEN_DRAIN = "open drain"
    """Low or open; high only by a pull-up outside. Sinks up to 1 mA."""
    BRIDGE = "bridge"
    """An end of a motor's phase."""
    PASSIVE = "passive"
    """A resistor or capacitor is connected to ground."""
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

TERMINALS: Final = (*Rail, *(pin for pin in Pin if pin not in OUTPUT_PINS))
"""What is held at a level. VM stands for VMA and VMB together."""

EXCITATIONS: Final = {
    (0, 0): Excitation.TWO_PHASE,
    (0, 1): Excitation.ONE_TWO_PHASE,
    (1, 0): Excitation.FOUR_W_ONE_TWO_PHASE,
    (1, 1): Excitation.TWO_W_ONE_TWO_PHASE,
}
"""Modes by the levels of M2 and M1 (page 9)."""

TORQUE_PERCENT: Final = {(0, 0): 100, (0, 1): 75, (1, 0): 50, (1, 1): 20}
"""Parts of the full current by the levels of TQ2 and TQ1 (page 10)."""

FAST_DECAY_PERCENT: Final = {(0, 0): 0, (0, 1): 25, (1, 0): 50, (1, 1): 100}
"""Parts of each chopping period, at its end, with fast decay, by the levels of DCY2 and DCY1 (page 10)."""
