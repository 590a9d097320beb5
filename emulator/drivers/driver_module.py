"""Describe the module around a driver chip: optocouplers, required timing, active edge, switches.

Levels at the terminals STEP, DIR and EN reach the chip's pins late, each through its own part, and rises later or
earlier than falls. So a pulse can get lost, and a DIR edge that was in time at the terminals can arrive after its CLK:
that step then goes the wrong way. Some modules have unknown delays, but their users know which times they need: these
times are the requirements. Where they are not kept the worst case is taken: pulses are lost, and DIR is read as late,
or as early, as they leave open. `input_stage` models all this.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final, Protocol

from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import Delay
from steptwin.emulator.drivers.driver_chip import ChipKind, Cooling, DriverChip
from steptwin.protocol.timer import counts_of_ns

SENSE_OHM: Final = 0.33
"""Usual resistors that sense a phase's current: 1.5 A with a TB6560."""


class ClkEdge(StrEnum):
    """The edge at the STEP terminal with which the chip's CLK rises."""

    RISING = "rising"
    FALLING = "falling"


@dataclass(frozen=True, slots=True)
class Coupler:
    """An optocoupler or a wire, with its delays in ns for a level that becomes high or low at the chip's pin."""

    to_high_ns: int = 0
    to_low_ns: int = 0

    @property
    def delay(self) -> Delay:
        """The delays in counts, rounded up."""
        return Delay(counts_of_ns(self.to_high_ns), counts_of_ns(self.to_low_ns))


@dataclass(frozen=True, slots=True)
class Requirements:
    """Times that a module requires at its terminals, under LinuxCNC's names; a pulse begins with the active edge."""

    steplen_ns: int = 0
    stepspace_ns: int = 0
    dirsetup_ns: int = 0
    dirhold_ns: int = 0


class ModuleSwitches(Protocol):
    """How a module's own switches stand: the levels at the chip's pins that they set."""

    @property
    def microsteps(self) -> int:
        """Microsteps of the mode that they select."""

    @property
    def sense_ohm(self) -> float:
        """The sense resistors that they switch on."""

    @property
    def running(self) -> Mapping[Pin, int]:
        """Levels of the chip's pins from when it is supplied, while the motor moves."""

    @property
    def standing(self) -> Mapping[Pin, int]:
        """Those of them that are others at standstill."""


@dataclass(frozen=True, slots=True)
class Module:
    """The module around one chip; by default nothing but wires.

    Attributes:
        kind: what chip it is.
        clk: part between STEP and CLK.
        direction: part between DIR and CW/CCW.
        enable: part between EN and ENABLE; the wiring takes care of a low-active terminal.
        requirements: times that the module requires beyond those of the couplers.
        active_edge: edge of STEP that makes the step.
        enable_open: ENABLE at the chip if nothing is connected to EN: 0 for the chip's pull-down, 1 where the
            optocoupler's light switches the chip off.
        switches: the module's own switches, if it has any: it then follows CLK, DIR and EN alone, and RESET is high
            with the supply.
        idle_ms: time from the last step until the switches' idle current begins; assumed, since no source gives it.
        sense_ohm: resistors that sense the phases' currents, unless switches set them.
        cooling: what cools the chip.
        source: origin of the figures.
    """

    kind: ChipKind
    clk: Coupler = Coupler()
    direction: Coupler = Coupler()
    enable: Coupler = Coupler()
    requirements: Requirements = Requirements()
    active_edge: ClkEdge = ClkEdge.RISING
    enable_open: int = 0
    switches: ModuleSwitches | None = None
    idle_ms: int = 500
    sense_ohm: float = SENSE_OHM
    cooling: Cooling = field(default_factory=Cooling)
    source: str = "wires"

    def make_chip(self) -> DriverChip:
        """Return a chip as it is on the module; raise ValueError if its resistors are outside its operating range."""
        return self.kind.make(self.switches.sense_ohm if self.switches else self.sense_ohm, self.cooling)

    @property
    def only_wires(self) -> bool:
        """True if the terminals are the chip's pins."""
        couplers = (self.clk, self.direction, self.enable)
        plain = self.active_edge is ClkEdge.RISING and self.requirements == Requirements()
        return plain and couplers == (Coupler(),) * 3 and self.switches is None
