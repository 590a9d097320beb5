"""Describe the module around a driver chip: optocouplers, required timing, active edge, switches.

Levels at the terminals STEP, DIR and EN reach the chip's pins late, each through its own part, and rises later or
earlier than falls. So a pulse can get lost, and a DIR edge that was in time at the terminals can arrive after its CLK:
that step then goes the wrong way. Some modules have unknown delays, but their users know which times they need: these
times are the requirements. Where they are not kept the worst case is taken: pulses are lost, and DIR is read as late,
or as early, as they leave open. `input_stage` models all this.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from steptwin.emulator.board.edges import Delay
from steptwin.emulator.drivers.chip import DriverChip
from steptwin.protocol.drivers import NO_TIMES, WIRE, ActiveEdge, ChipSheet, Cooling, Coupler, DriverProfile, StepTimes
from steptwin.protocol.timer import counts_of_ns


def delay_of(coupler: Coupler) -> Delay:
    """Return a coupler's delays in counts, rounded up."""
    return Delay(counts_of_ns(coupler.to_high_ns), counts_of_ns(coupler.to_low_ns))


@dataclass(frozen=True, slots=True)
class Switches:
    """How a module's own switches stand: the levels at the chip's pins that they set.

    Attributes:
        microsteps: of the mode that they select.
        running: levels of the chip's pins from when it is supplied, while the motor moves; RESET is high with them.
        standing: those of them that are others at standstill.
        idle_ms: time from the last step until that is so.
    """

    microsteps: int
    running: Mapping[str, int]
    standing: Mapping[str, int]
    idle_ms: int = 500


@dataclass(frozen=True, slots=True)
class Module:
    """The module around one chip; by default nothing but wires.

    Attributes:
        chip: what chip it is.
        full_a: phase current of 100 percent.
        clk: part between STEP and CLK.
        direction: part between DIR and CW/CCW.
        enable: part between EN and ENABLE; the wiring takes care of a low-active terminal.
        times: what the module requires at its terminals beyond the chip's times and those of the couplers.
        active_edge: edge of STEP that makes the step.
        enable_open: ENABLE at the chip if nothing is connected to EN: 0 for the chip's pull-down, 1 where the
            optocoupler's light switches the chip off.
        switches: the module's own switches, if it has any: it then follows CLK, DIR and EN alone.
        cooling: what cools the chip.
        fault_wired: the chip's fault output is wired to the board's input for it.
        source: origin of the delays.
    """

    chip: ChipSheet
    full_a: float = 1.5
    clk: Coupler = WIRE
    direction: Coupler = WIRE
    enable: Coupler = WIRE
    times: StepTimes = NO_TIMES
    active_edge: ActiveEdge = ActiveEdge.RISING
    enable_open: int = 0
    switches: Switches | None = None
    cooling: Cooling = field(default_factory=Cooling)
    fault_wired: bool = False
    source: str = "wires"

    def make_chip(self) -> DriverChip:
        """Return a chip as it is on the module; raise ValueError if its current is outside its operating range."""
        return DriverChip(self.chip, self.full_a, self.cooling)

    @property
    def only_wires(self) -> bool:
        """True if the terminals are the chip's pins, and the chip judges alone what comes there."""
        couplers = (self.clk, self.direction, self.enable)
        plain = self.active_edge is ActiveEdge.RISING and self.times == NO_TIMES and self.switches is None
        return plain and couplers == (WIRE,) * 3 and not (self.chip.times.dirsetup_ns or self.chip.times.dirhold_ns)


def fitted(
    profile: DriverProfile,
    microsteps: int,
    current_a: float | None = None,
    active_edge: ActiveEdge | None = None,
    *,
    idle_percent: int | None = None,
    fast_decay_percent: int | None = None,
    fault_wired: bool = False,
) -> Module:
    """Return the driver of one axis, set for its microstep mode; None takes the usual setting.

    Raises:
        ValueError: the driver has no such setting, or no switches.
    """
    current = profile.current(profile.current_a if current_a is None else current_a)
    switches = None
    if profile.switched:
        idle = profile.idle(profile.idle_percent if idle_percent is None else idle_percent)
        fast = profile.fast_decay(profile.fast_decay_percent if fast_decay_percent is None else fast_decay_percent)
        chip, torque = profile.chip, profile.chip.torque_percent.value
        mode = chip.modes.value.levels(profile.mode(microsteps))
        running = mode | chip.fast_decay_percent.value.levels(fast) | torque.levels(current.torque_percent)
        switches = Switches(microsteps, running | {"RESET": 1}, torque.levels(idle), profile.idle_ms.value)
    elif (idle_percent, fast_decay_percent) != (None, None):
        raise ValueError(f"{profile.name} has no switches for its current at standstill and for its decay")
    return Module(
        chip=profile.chip,
        full_a=current.full_a,
        clk=profile.clk.value,
        direction=profile.direction.value,
        enable=profile.enable.value,
        times=profile.times,
        active_edge=active_edge or profile.active_edge,
        enable_open=profile.enable_open,
        switches=switches,
        cooling=profile.cooling.value,
        fault_wired=fault_wired,
        source=profile.source,
    )
