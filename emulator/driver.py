"""One driver as the board sees it: a TB6560 and what is around it."""

from typing import Final

from steptwin.emulator.driver_module import ClkEdge, Module
from steptwin.emulator.edges import Int8Array, Int64Array
from steptwin.emulator.input_stage import InputStage
from steptwin.emulator.tb6560 import Outputs, Pins, Tb6560, Violations, merged


class Driver:
    """Takes what the board puts on the driver's terminals, without supply and all low at first.

    Raises:
        ValueError: a capacitor or resistor with which the chip is outside its operating range.
    """

    def __init__(self, osc_pf: float, module: Module) -> None:
        self.chip = Tb6560(osc_pf, module.chip_sense_ohm, module.cooling)
        self.active_edge: Final[ClkEdge] = module.active_edge
        """Of STEP: the chip's CLK rises with it."""
        self._stage = None if module.only_wires else InputStage(module, self.chip.clk_width_min_counts)

    def feed(self, pins: Pins) -> tuple[Int64Array, Int8Array]:
        """Let the driver see the next stretch of its terminals; every rise comes with its fall.

        Returns:
            When each step was counted by the chip and which way, +1 or -1.
        """
        return self.chip.feed(self._stage.take(pins) if self._stage else pins)

    @property
    def waiting(self) -> bool:
        """Whether something may happen although nothing comes in: the driver is to be fed for the time's sake."""
        return self._stage is not None and self._stage.waiting

    @property
    def held_pulses(self) -> int:
        """Pulses of which it is not known yet what becomes of them."""
        return self._stage.held_pulses if self._stage else 0

    @property
    def position_steps(self) -> int:
        """Steps counted since power-up; DIR high counts up."""
        return self.chip.position_steps

    @property
    def lost_steps(self) -> int:
        """Steps meant at the terminals less steps counted, both signed; one that went the wrong way makes two."""
        return self._stage.meant_steps - self.chip.position_steps if self._stage else self.chip.lost_steps

    @property
    def violation_count(self) -> int:
        """How many limits were broken so far."""
        return self.chip.violation_count + (self._stage.violation_count if self._stage else 0)

    @property
    def steps(self) -> tuple[Int64Array, Int8Array]:
        """Each counted step that is not forgotten, by when its pulse began at the terminals, and which way it went."""
        counts, signs = self.chip.steps
        return (self._stage.origins(counts) if self._stage else counts), signs

    @property
    def violations(self) -> Violations:
        """All broken limits so far, of the module and of the chip, in order of time."""
        return merged([self._stage.violations, self.chip.violations]) if self._stage else self.chip.violations

    @property
    def outputs(self) -> Outputs:
        """Phase currents, electrical angle and MO at any instant so far."""
        return self.chip.outputs

    def forget(self) -> None:
        """Keep the counts and forget their history: steps, violations and the outputs' instants begin anew."""
        self.chip.forget()
        if self._stage:
            self._stage.forget()

    def protect_level(self, counts: int) -> int:
        """The Protect pin with a pull-up at an instant: low while thermal shutdown keeps the outputs off.

        Of the modules none has a terminal for it.
        """
        return 1 if self._stage else self.chip.protect_level(counts)

    def protect_stays_until(self, counts: int) -> int | None:
        """Up to when that stays as it is at an instant, unless RESET or VDD changes; None: always."""
        return None if self._stage else self.chip.protect_stays_until(counts)
