"""Describe the module around a TB6560: optocouplers, required timing, active edge, switches.

Levels at the terminals STEP, DIR and EN reach the chip's pins late, each through its own part, and rises later or
earlier than falls. So a pulse can get lost, and a DIR edge that was in time at the terminals can arrive after its CLK:
that step then goes the wrong way. Some modules have unknown delays, but their users know which times they need: these
times are the requirements. Where they are not kept the worst case is taken: pulses are lost, and DIR is read as late,
or as early, as they leave open. `input_stage` models all this.
"""

from dataclasses import dataclass, field
from enum import StrEnum

from steptwin.emulator.board.edges import Delay
from steptwin.emulator.drivers.dip_switches import DipSwitches
from steptwin.emulator.drivers.tb6560 import SENSE_OHM, Cooling
from steptwin.protocol.timer import counts_of_ns


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


@dataclass(frozen=True, slots=True)
class Module:
    """The module around one chip; by default nothing but wires.

    Attributes:
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
        sense_ohm: resistors at NFA and NFB, unless switches set them.
        cooling: what cools the chip.
        source: origin of the figures.
    """

    clk: Coupler = Coupler()
    direction: Coupler = Coupler()
    enable: Coupler = Coupler()
    requirements: Requirements = Requirements()
    active_edge: ClkEdge = ClkEdge.RISING
    enable_open: int = 0
    switches: DipSwitches | None = None
    idle_ms: int = 500
    sense_ohm: float = SENSE_OHM
    cooling: Cooling = field(default_factory=Cooling)
    source: str = "wires"

    @property
    def chip_sense_ohm(self) -> float:
        """Sense resistance at the chip."""
        return self.switches.sense_ohm if self.switches else self.sense_ohm

    @property
    def only_wires(self) -> bool:
        """True if the terminals are the chip's pins."""
        couplers = (self.clk, self.direction, self.enable)
        plain = self.active_edge is ClkEdge.RISING and self.requirements == Requirements()
        return plain and couplers == (Coupler(),) * 3 and self.switches is None
