"""One driver: a chip and the module around it."""

from typing import Final

from steptwin.emulator.board.edges import Int8Array, Int64Array
from steptwin.emulator.drivers.chip import DriverChip
from steptwin.emulator.drivers.driver_module import Module
from steptwin.emulator.drivers.input_stage import InputStage
from steptwin.emulator.drivers.limits import Violations, merged
from steptwin.emulator.drivers.terminals import Moves, TerminalEdges
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.drivers import Release


class Driver:
    """Processes the edges at the driver's terminals; initially without supply and with all terminals low."""

    def __init__(self, module: Module, *, at_edges: bool = False) -> None:
        """Create a driver.

        Args:
            module: its chip, circuit and settings.
            at_edges: True if a step's instant is its active edge, False if the rise of its pulse.

        Raises:
            ValueError: its current is outside of the chip's operating range.
        """
        self.module: Final = module
        self.chip: DriverChip = module.make_chip()
        self._turned_to: int | None = None
        """Microsteps that a user has set with the module's switches; None if nobody has."""
        self._stage = None if module.only_wires else InputStage(module, self.chip.pulse_min_counts, at_edges=at_edges)

    def turn_switches(self, microsteps: int | None, counts: int) -> None:
        """Set the module's switches to a mode at an instant; None restores their initial setting."""
        if self._stage is None or self.module.switches is None:
            raise ValueError("the driver has no switches")
        self._turned_to = microsteps
        self._stage.turn_switches(self.module.chip.modes.value.levels(self.microsteps), counts)

    def change_capacitor(self, osc_pf: float) -> None:
        """Change the capacitor at OSC; raise ValueError if the chip has none or the capacitor is too small."""
        self.chip.change_capacitor(osc_pf)
        if self._stage is not None:
            self._stage.set_pulse_min(self.chip.pulse_min_counts)

    def begin_high(self, counts: int) -> None:
        """Set STEP high at power-up, without an edge."""
        if self._stage is not None:
            self._stage.begin_high(counts)

    def feed(self, edges: TerminalEdges) -> Moves:
        """Process the next stretch of edges at the terminals."""
        return self.chip.feed(self._stage.take(edges) if self._stage else edges)

    @property
    def pulse_min_counts(self) -> int:
        """Time after its rise when a pulse may be passed to the driver although it has not ended."""
        return 0 if self._stage else self.chip.pulse_min_counts

    @property
    def waiting(self) -> bool:
        """True while the driver must be fed as time advances, even without new edges."""
        return self._stage is not None and self._stage.waiting

    @property
    def held_pulses(self) -> int:
        """Number of undecided pulses: the chip may or may not count them."""
        return self._stage.held_pulses if self._stage else 0

    @property
    def held_steps(self) -> int:
        """Sum of the undecided pulses, each with the sign of DIR at its rise."""
        return self._stage.held_steps if self._stage else 0

    @property
    def microsteps(self) -> int:
        """Microsteps selected by the module's switches, even without power; without switches, by the chip's pins."""
        switches = self.module.switches
        return (self._turned_to or switches.microsteps) if switches else self.chip.microsteps

    @property
    def step_substeps(self) -> int:
        """Size of a step in the present mode."""
        return self.module.chip.substeps // self.microsteps

    @property
    def lost_steps(self) -> int:
        """Signed steps at the terminals minus signed counted steps; a step in the wrong direction counts twice."""
        return self._stage.meant_steps - self.chip.position_steps if self._stage else self.chip.lost_steps

    @property
    def violation_count(self) -> int:
        """Number of limit violations so far."""
        return self.chip.violation_count + (self._stage.violation_count if self._stage else 0)

    @property
    def steps(self) -> tuple[Int64Array, Int8Array]:
        """Counted steps since `forget`: instant at the terminals (see `at_edges`) and sign."""
        counts, signs = self.chip.steps
        return (self._stage.origins(counts) if self._stage else counts), signs

    @property
    def violations(self) -> Violations:
        """All violations of the module's and the chip's limits since `forget`, in order of time."""
        return merged([self._stage.violations, self.chip.violations]) if self._stage else self.chip.violations

    def forget(self) -> None:
        """Drop the recorded steps, violations and output changes, but keep their numbers."""
        self.chip.forget()
        if self._stage:
            self._stage.forget()

    @property
    def fault_input(self) -> DigitalInput | None:
        """The board's input that the chip's fault output drives; None if it is not connected."""
        if self.module.chip.fault_output is None or (self._stage is not None and not self.module.fault_wired):
            return None
        return DigitalInput.DRIVER_FAULT if self._stage else DigitalInput.DRIVER_PROTECT

    @property
    def reports_latch(self) -> bool:
        """True if the board can see a latch of the chip. A chip that a short circuit destroys reports nothing."""
        return self.fault_input is not None and self.module.chip.overcurrent.value is not Release.NEVER

    def fault_inputs(self, counts: int) -> DigitalInput:
        """Return `fault_input` if the fault output is active at an instant; else 0."""
        return self.fault_input if self.fault_input and not self.chip.fault_level(counts) else DigitalInput(0)

    def fault_stays_until(self, counts: int) -> int | None:
        """Return the instant before which the fault output stays unless a terminal changes; None for never."""
        return self.chip.fault_stays_until(counts) if self.fault_input else None
