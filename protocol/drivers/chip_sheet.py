"""What a chip's datasheet says, as data: how it counts steps, which currents it sets, what it does in trouble.

Every chip is a record of this one kind. The emulator counts by it, the host plans within it, and docs/driver.md is made
of it. A driver module without a known chip has such a record of its own. Each fact says where it is from: a source's
own words, another file's quotation, or a guess. In a table the levels of some pins select a value. The oscillator is
the TB6560's: the capacitor at OSC sets the chopping rate and the shortest CLK pulse that counts; its pages are those of
Toshiba's datasheet "TB6560AHQ/AFG" of 2014-10-01.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import ceil, lcm
from typing import Final, Generic, NamedTuple, TypeVar

from steptwin.protocol.timer import COUNTS_PER_SECOND, COUNTS_PER_US, counts_of_ns

OSCILLATIONS_PER_CHOP: Final = 4
"""Periods of the oscillator in one chopping period (pages 16 and 20)."""

OSCILLATOR_MAX_HZ: Final = 600_000
"""Upper end of the operating range (pages 6 to 8), which has no lower end."""

OSC_PF_MIN: Final = 64
"""Smallest capacitor, in whole pF, with which the oscillator keeps to it by the formula of `Oscillator.hz`."""

_CLK_WIDTH_MIN_US: Final = {100.0: 10.0, 330.0: 30.0, 1000.0: 90.0}
"""t_W(CLK) at the capacitors for which the datasheet states it (page 8); only 330 pF is tested in production."""
Value = TypeVar("Value")


@dataclass(frozen=True, slots=True)
class Oscillator:
    """A capacitor at OSC, in pF; raises ValueError unless it is positive and large enough for the operating range."""

    osc_pf: float

    def __post_init__(self) -> None:
        if not self.osc_pf > 0:
            raise ValueError(f"the OSC capacitor is {self.osc_pf} pF; it must be positive, for example 330")
        if self.hz > OSCILLATOR_MAX_HZ:
            raise ValueError(
                f"the OSC capacitor is {self.osc_pf:g} pF, which makes {self.hz / 1000:.0f} kHz: at most"
                f" {OSCILLATOR_MAX_HZ // 1000} kHz are allowed, {OSC_PF_MIN} pF or more"
            )

    @property
    def hz(self) -> float:
        """Frequency by the datasheet's approximation (page 25): 400 kHz at 100 pF."""
        return 1e6 / (self.osc_pf * 1.5 * (10 / self.osc_pf + 1) / 66)

    @property
    def chopping_hz(self) -> float:
        """How many times a second the current is regulated."""
        return self.hz / OSCILLATIONS_PER_CHOP

    @property
    def clk_width_min_us(self) -> float:
        """Shortest time for which CLK is high: the datasheet's figure, or else 4 periods of the oscillator."""
        return _CLK_WIDTH_MIN_US.get(self.osc_pf, 4e6 / self.hz)

    @property
    def clk_width_min_counts(self) -> int:
        """The same in counts of the board's timer, rounded up."""
        return ceil(self.clk_width_min_us * COUNTS_PER_US)


class Grade(StrEnum):
    """How a fact is known."""

    STATED = "stated"
    """Read in the source itself."""
    QUOTED = "quoted"
    """Another file quotes the source, which itself was not read."""
    ASSUMED = "assumed"
    """No source says so; in the source's place stands the reason."""


@dataclass(frozen=True, slots=True)
class Fact(Generic[Value]):
    """A value with its source: document, revision and place."""

    value: Value
    source: str
    grade: Grade = Grade.STATED


def quoted(value: Value, source: str) -> Fact[Value]:
    """Return a fact that is known from a quotation."""
    return Fact(value, source, Grade.QUOTED)


def assumed(value: Value, reason: str) -> Fact[Value]:
    """Return a fact that no source states."""
    return Fact(value, reason, Grade.ASSUMED)


@dataclass(frozen=True, slots=True)
class PinTable(Generic[Value]):
    """Values by the levels of pins.

    Attributes:
        pins: names of the pins, or of the switches and register bits that act like pins.
        rows: each value with a letter for each pin: `L`, `H`, or `-` where the level does not matter.
    """

    pins: tuple[str, ...]
    rows: tuple[tuple[Value, str], ...]

    @property
    def values(self) -> tuple[Value, ...]:
        """All values once, in the datasheet's order."""
        return tuple(dict(self.rows))

    def levels(self, value: Value) -> dict[str, int]:
        """Return levels of the pins that select a value, by its first row; KeyError if none do."""
        letters = dict(reversed(self.rows))[value]
        return {pin: int(letter == "H") for pin, letter in zip(self.pins, letters, strict=True)}

    def selected(self, levels: Mapping[str, int]) -> Value | None:
        """Return the value that levels select; None where the datasheet names none."""
        shown = "".join("LH"[levels[pin]] for pin in self.pins)
        for value, letters in self.rows:
            if all(letter in (level, "-") for letter, level in zip(letters, shown, strict=True)):
                return value
        return None


def always(value: Value) -> PinTable[Value]:
    """Return the table of a value that no pin changes."""
    return PinTable((), ((value, ""),))


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
        rails: its supplies, in their order of switching on.
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
        """Parts of a full step that each step of each mode, and each home angle, is a whole number of.

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
