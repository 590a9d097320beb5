"""One driver as the board sees it: a chip and the module around it."""

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
    """Processes the edges at the driver's terminals; at first it has no supply and all terminals are low."""

    def __init__(self, module: Module, *, at_edges: bool = False) -> None:
        """Make a driver.

        Args:
            module: what it is.
            at_edges: a step's instant is that of its active edge, not of the rise with which its pulse begins.

        Raises:
            ValueError: its current is outside the chip's operating range.
        """
        self.module: Final = module
        self.chip: DriverChip = module.make_chip()
        self._turned_to: int | None = None
        """Microsteps to which the module's switches have been turned."""
        self._stage = None if module.only_wires else InputStage(module, self.chip.pulse_min_counts, at_edges=at_edges)

    def turn_switches(self, microsteps: int | None, counts: int) -> None:
        """Set the module's switches to a mode, or as they were at first (None), at an instant."""
        if self._stage is None or self.module.switches is None:
            raise ValueError("the driver has no switches")
        self._turned_to = microsteps
        self._stage.turn_switches(self.module.chip.modes.value.levels(self.microsteps), counts)

    def change_capacitor(self, osc_pf: float) -> None:
        """Let the capacitor at the chip's OSC have another value; raise ValueError if the chip cannot."""
        self.chip.change_capacitor(osc_pf)
        if self._stage is not None:
            self._stage.set_pulse_min(self.chip.pulse_min_counts)

    def begin_high(self, counts: int) -> None:
        """Let STEP be high as the power comes, which is no edge."""
        if self._stage is not None:
            self._stage.begin_high(counts)

    def feed(self, edges: TerminalEdges) -> Moves:
        """Let the driver see the next stretch of its terminals."""
        return self.chip.feed(self._stage.take(edges) if self._stage else edges)

    @property
    def pulse_min_counts(self) -> int:
        """Time for which STEP must have been high before the driver may be told of a pulse without its end."""
        return 0 if self._stage else self.chip.pulse_min_counts

    @property
    def waiting(self) -> bool:
        """True while the driver must be fed so that time advances, even without new edges."""
        return self._stage is not None and self._stage.waiting

    @property
    def held_pulses(self) -> int:
        """Number of pulses whose fate is not certain yet: the chip may or may not count them."""
        return self._stage.held_pulses if self._stage else 0

    @property
    def held_steps(self) -> int:
        """These pulses, each signed by DIR at its beginning."""
        return self._stage.held_steps if self._stage else 0

    @property
    def microsteps(self) -> int:
        """Microsteps that the module's switches select, also before the power is up, or else the chip's pins."""
        switches = self.module.switches
        return (self._turned_to or switches.microsteps) if switches else self.chip.microsteps

    @property
    def step_substeps(self) -> int:
        """Way of a step in the present mode."""
        return self.module.chip.substeps // self.microsteps

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
        """Counted steps that are not forgotten: instant at the terminals, as `at_edges` says, and sign."""
        counts, signs = self.chip.steps
        return (self._stage.origins(counts) if self._stage else counts), signs

    @property
    def violations(self) -> Violations:
        """All violations so far, of the module's and of the chip's limits, in order of time."""
        return merged([self._stage.violations, self.chip.violations]) if self._stage else self.chip.violations

    def forget(self) -> None:
        """Drop the recorded steps, violations and changes of the outputs, but keep how many there were."""
        self.chip.forget()
        if self._stage:
            self._stage.forget()

    @property
    def fault_input(self) -> DigitalInput | None:
        """The board's input for the chip's fault output: of a chip on the board itself, or one that is wired."""
        if self.module.chip.fault_output is None or (self._stage is not None and not self.module.fault_wired):
            return None
        return DigitalInput.DRIVER_FAULT if self._stage else DigitalInput.DRIVER_PROTECT

    @property
    def tells_latch(self) -> bool:
        """Whether the board sees a latch of the chip: a chip that a short circuit destroys tells nothing."""
        return self.fault_input is not None and self.module.chip.overcurrent.value is not Release.NEVER

    def told(self, counts: int) -> DigitalInput:
        """Return that input at an instant when the output tells that a protection holds the bridges off; else 0."""
        return self.fault_input if self.fault_input and not self.chip.fault_level(counts) else DigitalInput(0)

    def told_until(self, counts: int) -> int | None:
        """Return the instant up to which that stays so unless a terminal changes; None: always."""
        return self.chip.fault_stays_until(counts) if self.fault_input else None
