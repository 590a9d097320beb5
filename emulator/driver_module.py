"""The board around a TB6560: optocouplers, what its sellers ask for, its active edge, its switches.

What the controller puts on the terminals STEP, DIR and EN reaches the chip's pins late, each through its own part and
later one way than the other. So a pulse can get lost, and a DIR that left in time can arrive after its CLK: then that
step goes the wrong way. Where a board's inner delays are unknown but somebody has found out which times it needs, these
are its requirements, and outside them the worst case is taken: pulses are lost, DIR is read as late, or as early, as it
may be. `input_stage` does all that.
"""

from dataclasses import dataclass, field
from enum import StrEnum

from steptwin.emulator.dip_switches import DipSwitches
from steptwin.emulator.edges import Delay, counts_of_ns
from steptwin.emulator.tb6560 import SENSE_OHM, Cooling


class ClkEdge(StrEnum):
    """The edge at the STEP terminal that makes the chip's CLK rise."""

    RISING = "rising"
    FALLING = "falling"


@dataclass(frozen=True, slots=True)
class Coupler:
    """An optocoupler, or a wire: how long a level takes through it, in ns at the chip's pin."""

    to_high_ns: int = 0
    to_low_ns: int = 0

    @property
    def delay(self) -> Delay:
        """In counts, rounded up."""
        return Delay(counts_of_ns(self.to_high_ns), counts_of_ns(self.to_low_ns))


@dataclass(frozen=True, slots=True)
class Requirements:
    """The times that a board asks for at its terminals, by LinuxCNC's names; a step is active after the active edge."""

    steplen_ns: int = 0
    stepspace_ns: int = 0
    dirsetup_ns: int = 0
    dirhold_ns: int = 0


@dataclass(frozen=True, slots=True)
class Module:
    """The board around one chip; by default nothing but wires.

    Attributes:
        clk: from STEP to CLK.
        direction: from DIR to CW/CCW.
        enable: from EN to ENABLE; a low-active terminal is the wiring's business.
        requirements: what the board asks for beyond the couplers.
        active_edge: which edge of STEP is the step.
        switches: where the board has its own; then it follows CLK, DIR and EN alone, and RESET is high with the supply.
        idle_ms: how long after the last step the switches' idle current begins; found nowhere, so assumed.
        sense_ohm: resistors at NFA and NFB, where they are not switched.
        cooling: of the chip.
        source: where the figures are from.
    """

    clk: Coupler = Coupler()
    direction: Coupler = Coupler()
    enable: Coupler = Coupler()
    requirements: Requirements = Requirements()
    active_edge: ClkEdge = ClkEdge.RISING
    switches: DipSwitches | None = None
    idle_ms: int = 500
    sense_ohm: float = SENSE_OHM
    cooling: Cooling = field(default_factory=Cooling)
    source: str = "wires"

    @property
    def chip_sense_ohm(self) -> float:
        """The resistors that the chip has."""
        return self.switches.sense_ohm if self.switches else self.sense_ohm

    @property
    def only_wires(self) -> bool:
        """Whether the chip's pins are the terminals."""
        couplers = (self.clk, self.direction, self.enable)
        plain = self.active_edge is ClkEdge.RISING and self.requirements == Requirements()
        return plain and couplers == (Coupler(),) * 3 and self.switches is None
