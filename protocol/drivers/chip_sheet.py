"""What a chip's datasheet says, as data: how it counts steps, which currents it sets, what it does in trouble.

Every chip is a record of this one kind. The emulator counts by it, the host plans within it, and docs/driver.md is made
of it. A driver module without a known chip has such a record of its own.
"""

from dataclasses import dataclass
from enum import StrEnum
from math import lcm
from typing import Final, NamedTuple

from steptwin.protocol.drivers.facts import Fact, assumed
from steptwin.protocol.drivers.oscillator import Oscillator
from steptwin.protocol.drivers.pin_table import PinTable
from steptwin.protocol.timer import COUNTS_PER_SECOND, counts_of_ns


@dataclass(frozen=True, slots=True, kw_only=True)
class StepTimes:
    """Times that a driver needs at STEP, DIR and ENABLE, under LinuxCNC's names; None: its source states none.

    Attributes:
        steplen_ns: from the active edge of STEP until it goes back.
        stepspace_ns: before the active edge, likewise.
        dirsetup_ns: DIR stable before the active edge.
        dirhold_ns: DIR stable after it.
        enable_ns: from ENABLE until the first active edge.
        wake_ns: from the supply, or the end of reset and sleep, until the first active edge.
        rate_max_hz: highest step rate.
    """

    steplen_ns: Fact[int] | None = None
    stepspace_ns: Fact[int] | None = None
    dirsetup_ns: Fact[int] | None = None
    dirhold_ns: Fact[int] | None = None
    enable_ns: Fact[int] | None = None
    wake_ns: Fact[int] | None = None
    rate_max_hz: Fact[int] | None = None

    def ns(self, name: str) -> int:
        """Return a time by its name; 0 if none is stated."""
        fact = getattr(self, name)
        return 0 if fact is None else int(fact.value)

    def counts(self, name: str) -> int:
        """Return a time by its name in counts of the board's timer, rounded up."""
        return counts_of_ns(self.ns(name))


class Release(StrEnum):
    """What lets the outputs come on again after a shutdown, once the cause is gone."""

    COOLING = "nothing more"
    ENABLE = "ENABLE off"
    RESET = "RESET low"
    POWER = "a power cycle"
    NEVER = "nothing: it is destroyed"


class Shutdown(NamedTuple):
    """Thermal shutdown: the junction's limit, how far it must fall below it, and what must happen then."""

    celsius: int
    hysteresis_k: int
    release: Release


class OutputPin(NamedTuple):
    """A pin that tells something, and its level then: that the field is in its home state, or of a fault."""

    pin: str
    level: int


class OverVoltage(NamedTuple):
    """The highest motor supply beyond which the outputs switch off, and what must happen then."""

    volt: int
    release: Release


_UNPROTECTED: Final = assumed(Release.NEVER, "no source describes a protection: a short circuit destroys it")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChipSheet:
    """A chip. Phase A's current is the cosine of the field's angle, phase B's its sine, and DIR low turns it forward.

    Attributes:
        name: of the chip, or of the driver that hides it.
        document: title and revision of its source.
        rails: its supplies, in the order in which they are switched on.
        logic_rail: the one with which it counts.
        times: what it needs at its pins.
        modes: microsteps by levels.
        mode_in_reset: the mode may change in reset only; None: at any time.
        ordered_power: supplies and inputs must come in order: the rails, then the inputs, and go in reverse; None: no
            order is asked for.
        torque_percent: part of the full current by levels.
        fast_decay_percent: part of a chopping period with fast decay by levels.
        home_deg: the field's electrical angle at power-up and in reset.
        home_full_deg: the same in full steps.
        vector_percent: a phase's current in equal steps from 0 to 90 degrees after its peak; None: a sine.
        both_full: in full steps both phases carry the full current, not 71 % of it.
        home_output: tells of the home state; None: no pin does.
        fault_output: tells that the outputs are shut down; None: no pin does.
        blocked: STEP is ignored while ENABLE is off; else the counter goes on, only the outputs are off.
        on_delay_ns: from ENABLE to the outputs.
        off_delay_ns: likewise to off.
        shutdown: None: it has no thermal shutdown that a source describes.
        overcurrent: what ends the latch with which it answers a short circuit or too much current.
        overvoltage: None: a supply that is too high does not switch it off, as far as a source says.
        current_law: how the full current is set, in words.
        current_max_a: highest current of a phase, at its peak.
        sense_ohm: usual resistors in series with the phases.
        on_resistance_ohm: of both switches of a bridge.
        supply_v: lowest and highest motor supply.
        oscillator: the capacitor that sets its shortest pulse; None: it has none.
    """

    name: str
    document: str
    rails: tuple[str, ...] = ("VDD", "VM")
    logic_rail: str = "VDD"
    times: StepTimes
    modes: Fact[PinTable[int]]
    mode_in_reset: Fact[bool] | None = None
    ordered_power: Fact[bool] | None = None
    torque_percent: Fact[PinTable[int]]
    fast_decay_percent: Fact[PinTable[int]]
    home_deg: Fact[float]
    home_full_deg: Fact[float]
    vector_percent: Fact[tuple[int, ...]] | None = None
    both_full: bool = False
    home_output: Fact[OutputPin] | None = None
    fault_output: Fact[OutputPin] | None = None
    blocked: Fact[bool]
    on_delay_ns: Fact[int] | None = None
    off_delay_ns: Fact[int] | None = None
    shutdown: Fact[Shutdown] | None = None
    overcurrent: Fact[Release] = _UNPROTECTED
    overvoltage: Fact[OverVoltage] | None = None
    current_law: Fact[str]
    current_max_a: Fact[float]
    sense_ohm: Fact[float]
    on_resistance_ohm: Fact[float]
    supply_v: Fact[tuple[float, float]]
    oscillator: Oscillator | None = None

    @property
    def microsteps(self) -> tuple[int, ...]:
        """The modes, from full steps on."""
        return tuple(sorted(self.modes.value.values))

    @property
    def substeps(self) -> int:
        """Parts of a full step of which each step of each mode, and each home angle, is a whole number.

        This unit keeps positions exact for any chip: 16 for a TB6560, 256 for a TMC2209, 16 000 for a DM542.
        """
        return lcm(2, *self.microsteps)

    @property
    def terminals(self) -> tuple[str, ...]:
        """Its supplies, and the inputs that are held at a level."""
        tables = (self.modes, self.torque_percent, self.fast_decay_percent)
        return (*self.rails, "RESET", "ENABLE", *(pin for table in tables for pin in table.value.pins))

    @property
    def period_min_counts(self) -> int:
        """Shortest time between two pulses that it counts, 0 if no source bounds the rate."""
        rate = self.times.rate_max_hz
        return 0 if rate is None else COUNTS_PER_SECOND // rate.value

    @property
    def pulse_min_counts(self) -> int:
        """Shortest pulse that it counts."""
        return self.oscillator.clk_width_min_counts if self.oscillator else self.times.counts("steplen_ns")
