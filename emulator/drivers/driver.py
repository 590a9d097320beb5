"""One driver as the board sees it: a TB6560 and the module around it."""

from typing import Final

from steptwin.emulator.board.edges import Int8Array, Int64Array
from steptwin.emulator.drivers.driver_module import ClkEdge, Module
from steptwin.emulator.drivers.input_stage import InputStage
from steptwin.emulator.drivers.tb6560 import (
    EXCITATIONS,
    Excitation,
    LevelPin,
    Outputs,
    Pins,
    Tb6560,
    Violations,
    merged,
)

_LEVELS: Final = {excitation: levels for levels, excitation in EXCITATIONS.items()}
"""Levels of M2 and M1 by the mode that they select."""


class Driver:
    """Processes the edges at the driver's terminals; at first it has no supply and all terminals are low.

    Raises:
        ValueError: the capacitor or a resistor puts the chip outside its operating range.
    """

    def __init__(self, osc_pf: float, module: Module) -> None:
        self.chip = Tb6560(osc_pf, module.chip_sense_ohm, module.cooling)
        self.active_edge: Final[ClkEdge] = module.active_edge
        """The edge of STEP with which the chip's CLK rises."""
        self.enable_open: Final[int] = module.enable_open
        """Level that ENABLE has for the driver if nothing is connected to its terminal."""
        self._switches: Final = module.switches
        self._turned_to: Excitation | None = None
        """The mode to which the module's switches are set."""
        self._stage = None if module.only_wires else InputStage(module, self.chip.clk_width_min_counts)

    @property
    def has_switches(self) -> bool:
        """True if the module's own switches select the mode."""
        return self._switches is not None

    def turn_switches(self, excitation: Excitation | None, counts: int) -> None:
        """Set the module's switches to a mode, or as they were at first (None), at an instant."""
        if self._stage is None or self._switches is None:
            raise ValueError("the driver has no switches")
        self._turned_to = excitation
        m2, m1 = _LEVELS[self.excitation]
        self._stage.turn_switches({LevelPin.M1: m1, LevelPin.M2: m2}, counts)

    def set_osc(self, osc_pf: float) -> None:
        """Put another capacitor to the chip's OSC pin; raise ValueError as when the driver is made."""
        self.chip.set_osc(osc_pf)
        if self._stage is not None:
            self._stage.set_clk_width(self.chip.clk_width_min_counts)

    def feed(self, pins: Pins) -> tuple[Int64Array, Int8Array]:
        """Let the driver see the next stretch of its terminals; every rise comes with its fall.

        Returns:
            Instant of each step that the chip has counted, and the rotor's move by it, in sixteenths of a full step
            with its sign.
        """
        return self.chip.feed(self._stage.take(pins) if self._stage else pins)

    @property
    def waiting(self) -> bool:
        """True while the driver must be fed so that time advances, even without new edges."""
        return self._stage is not None and self._stage.waiting

    @property
    def held_pulses(self) -> int:
        """Number of pulses whose fate is not certain yet: the chip may or may not count them."""
        return self._stage.held_pulses if self._stage else 0

    @property
    def position_steps(self) -> int:
        """Steps counted since power-up; steps with DIR high count up."""
        return self.chip.position_steps

    @property
    def position_sixteenths(self) -> int:
        """Position of the rotor since power-up, in sixteenths of a full step; it grows while DIR is high."""
        return self.chip.position_sixteenths

    @property
    def excitation(self) -> Excitation:
        """The mode that the module's switches select, also before the power is up, or else the chip's pins."""
        return (self._turned_to or self._switches.excitation) if self._switches else self.chip.excitation

    @property
    def lost_steps(self) -> int:
        """Signed steps at the terminals less signed steps counted; a step in the wrong direction counts as two."""
        return self._stage.meant_steps - self.chip.position_steps if self._stage else self.chip.lost_steps

    @property
    def violation_count(self) -> int:
        """Number of violations of limits so far."""
        return self.chip.violation_count + (self._stage.violation_count if self._stage else 0)

    @property
    def steps(self) -> tuple[Int64Array, Int8Array]:
        """Counted steps that are not forgotten: instant at which the pulse began at the terminals, and sign."""
        counts, signs = self.chip.steps
        return (self._stage.origins(counts) if self._stage else counts), signs

    @property
    def violations(self) -> Violations:
        """All violations so far, of the module's and of the chip's limits, in order of time."""
        return merged([self._stage.violations, self.chip.violations]) if self._stage else self.chip.violations

    @property
    def outputs(self) -> Outputs:
        """Phase currents, electrical angle and MO, for any instant so far."""
        return self.chip.outputs

    def forget(self) -> None:
        """Drop the recorded steps, violations and changes of the outputs, but keep how many there were."""
        self.chip.forget()
        if self._stage:
            self._stage.forget()

    def protect_level(self, counts: int) -> int:
        """Return the level of the Protect pin, with a pull-up: low while thermal shutdown keeps the outputs off.

        No module has a terminal for it: with a module it reads high.
        """
        return 1 if self._stage else self.chip.protect_level(counts)

    def protect_stays_until(self, counts: int) -> int | None:
        """Return the instant up to which Protect keeps its level unless RESET or VDD changes; None: always."""
        return None if self._stage else self.chip.protect_stays_until(counts)
