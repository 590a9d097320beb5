"""The module around a driver chip: optocouplers, required timing, active edge, switches.

Levels at the terminals STEP, DIR and EN reach the chip's pins with a delay. Each has its own coupler, with different
delays of rise and fall. So a pulse can be lost, and a DIR edge can arrive after its CLK, which makes a step in the
wrong direction. For some modules only required times are known, not the delays. If a required time is violated, the
worst case is assumed: the pulse is lost, and DIR is read as late or as early as the requirement leaves open.
`input_stage` models this.
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
    """Setting of a module's own switches: the levels at the chip's pins.

    Attributes:
        microsteps: microsteps of the selected mode.
        running: levels of the chip's pins while it has power; RESET is then high, too.
        idle: levels that differ at standstill.
        idle_ms: time from the last step until the levels of standstill apply.
    """

    microsteps: int
    running: Mapping[str, int]
    idle: Mapping[str, int]
    idle_ms: int = 500


@dataclass(frozen=True, slots=True)
class Module:
    """The module around one chip; by default only wires.

    Attributes:
        chip: datasheet of the chip.
        full_a: phase current of 100 percent.
        clk: coupler between STEP and CLK.
        direction: coupler between DIR and CW/CCW.
        enable: coupler between EN and ENABLE; the wiring inverts a low-active terminal.
        times: required times at the terminals that exceed those of chip and couplers.
        active_edge: edge of STEP that triggers a step.
        enable_open: level of ENABLE at the chip if nothing is connected to EN: 0 by the chip's pull-down, 1 if current
            in the optocoupler switches the chip off.
        switches: switches of the module, which then uses only CLK, DIR and EN of the board; None if it has none.
        cooling: cooling of the chip.
        fault_wired: True if the chip's fault output is wired to the board.
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
        """Create the module's chip; raise ValueError if its current is outside of the operating range."""
        return DriverChip(self.chip, self.full_a, self.cooling)

    @property
    def only_wires(self) -> bool:
        """True if the terminals are the chip's pins, and the module has no requirements of its own."""
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
    """Return the module of one axis with its settings; None selects the usual setting.

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
