"""Chip datasheets as data: step timing, microstep modes, currents and protections.

Every chip is one `ChipSheet`, and so is a driver module whose chip is unknown. The emulator, the host's planner and
docs/driver.md use it. Each fact has its source and a grade: read in the source, quoted by another document, or assumed.

The oscillator is the TB6560's. The capacitor at OSC sets the chopping rate and the shortest CLK pulse that counts. Its
pages are those of Toshiba's datasheet "TB6560AHQ/AFG" of 2014-10-01.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import ceil, lcm
from typing import Final, Generic, NamedTuple, TypeVar

from steptwin.protocol.timer import COUNTS_PER_SECOND, COUNTS_PER_US, counts_of_ns

OSCILLATIONS_PER_CHOP: Final = 4
"""Oscillator periods in one chopping period (pages 16 and 20)."""

OSCILLATOR_MAX_HZ: Final = 600_000
"""Highest oscillator frequency (pages 6 to 8). The datasheet gives no lowest one."""

OSC_PF_MIN: Final = 64
"""Smallest capacitor, in whole pF, that keeps the oscillator below its limit (formula of `Oscillator.hz`)."""

_CLK_WIDTH_MIN_US: Final = {100.0: 10.0, 330.0: 30.0, 1000.0: 90.0}
"""Shortest CLK pulse by capacitor in pF: t_W(CLK), page 8. Only 330 pF is tested in production."""
Value = TypeVar("Value")


@dataclass(frozen=True, slots=True)
class Oscillator:
    """Oscillator with a capacitor at OSC, in pF; raises ValueError if the capacitor is too small."""

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
        """Frequency by the approximation of the datasheet (page 25): 400 kHz at 100 pF."""
        return 1e6 / (self.osc_pf * 1.5 * (10 / self.osc_pf + 1) / 66)

    @property
    def chopping_hz(self) -> float:
        """Chopping frequency: how often per second the current is regulated."""
        return self.hz / OSCILLATIONS_PER_CHOP

    @property
    def clk_width_min_us(self) -> float:
        """Shortest high time of CLK: the datasheet's figure, or 4 oscillator periods if it gives none."""
        return _CLK_WIDTH_MIN_US.get(self.osc_pf, 4e6 / self.hz)

    @property
    def clk_width_min_counts(self) -> int:
        """Shortest high time of CLK in timer counts, rounded up."""
        return ceil(self.clk_width_min_us * COUNTS_PER_US)


class Grade(StrEnum):
    """Reliability of a fact."""

    STATED = "stated"
    """Read in the source itself."""
    QUOTED = "quoted"
    """Quoted by another document; the source itself was not read."""
    ASSUMED = "assumed"
    """Not in any source; `Fact.source` gives the reason instead."""


@dataclass(frozen=True, slots=True)
class Fact(Generic[Value]):
    """A value with its source: document, revision and place."""

    value: Value
    source: str
    grade: Grade = Grade.STATED


def quoted(value: Value, source: str) -> Fact[Value]:
    """Return a fact that another document quotes."""
    return Fact(value, source, Grade.QUOTED)


def assumed(value: Value, reason: str) -> Fact[Value]:
    """Return a fact that no source states."""
    return Fact(value, reason, Grade.ASSUMED)


@dataclass(frozen=True, slots=True)
class PinTable(Generic[Value]):
    """Truth table: the levels of some pins select a value.

    Attributes:
        pins: names of the pins, or of switches and register bits.
        rows: values, each with one letter per pin: `L`, `H`, or `-` for any level.
    """

    pins: tuple[str, ...]
    rows: tuple[tuple[Value, str], ...]

    @property
    def values(self) -> tuple[Value, ...]:
        """All values in the order of the datasheet, each once."""
        return tuple(dict(self.rows))

    def levels(self, value: Value) -> dict[str, int]:
        """Return the pin levels that select a value, from its first row; raise KeyError if no row has it."""
        letters = dict(reversed(self.rows))[value]
        return {pin: int(letter == "H") for pin, letter in zip(self.pins, letters, strict=True)}

    def selected(self, levels: Mapping[str, int]) -> Value | None:
        """Return the value that pin levels select; None if the datasheet has no such row."""
        shown = "".join("LH"[levels[pin]] for pin in self.pins)
        for value, letters in self.rows:
            if all(letter in (level, "-") for letter, level in zip(letters, shown, strict=True)):
                return value
        return None


def always(value: Value) -> PinTable[Value]:
    """Return the table of a fixed value, which no pin changes."""
    return PinTable((), ((value, ""),))


@dataclass(frozen=True, slots=True, kw_only=True)
class StepTimes:
    """Minimum times at STEP, DIR and ENABLE, named as in LinuxCNC; None if the source gives no figure.

    Attributes:
        steplen_ns: active pulse of STEP.
        stepspace_ns: pause between two pulses of STEP.
        dirsetup_ns: DIR stable before the active edge.
        dirhold_ns: DIR stable after the active edge.
        enable_ns: from ENABLE until the first active edge.
        wake_ns: from power-up, or the end of reset or sleep, until the first active edge.
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
        """Return a time by its name in timer counts, rounded up."""
        return counts_of_ns(self.ns(name))


class Release(StrEnum):
    """Action that switches the outputs on again after a shutdown, once the cause is gone."""

    COOLING = "nothing more"
    ENABLE = "ENABLE off"
    RESET = "RESET low"
    POWER = "a power cycle"
    NEVER = "nothing: it is destroyed"


class Shutdown(NamedTuple):
    """Thermal shutdown: limit of the junction temperature, hysteresis, and the release after cooling."""

    celsius: int
    hysteresis_k: int
    release: Release


class OutputPin(NamedTuple):
    """A status output, and its level while active (home state or fault)."""

    pin: str
    level: int


class OverVoltage(NamedTuple):
    """Overvoltage shutdown: limit of the motor supply, and the release."""

    volt: int
    release: Release


_UNPROTECTED: Final = assumed(Release.NEVER, "no source describes a protection: a short circuit destroys it")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChipSheet:
    """A chip, or a driver module whose chip is unknown.

    The current of phase A is the cosine of the field angle, the current of phase B its sine. DIR low turns the field
    forward.

    Attributes:
        name: name of the chip or module.
        document: title and revision of the source.
        rails: supply pins, in their power-up order.
        logic_rail: supply of the step counter.
        times: minimum times at its pins.
        modes: microsteps per full step by pin levels.
        mode_in_reset: True if the mode may change in reset only; None if at any time.
        ordered_power: True if power-up must be in order: the rails, then the inputs, and power-down in reverse; None if
            in any order.
        torque_percent: percent of the full current by pin levels.
        fast_decay_percent: percent of a chopping period with fast decay by pin levels.
        home_deg: electrical angle of the field at power-up and in reset.
        home_full_deg: the same in full-step mode.
        vector_percent: phase current in equal steps from 0 to 90 degrees after its peak; None for a sine.
        both_full: True if both phases carry the full current in full-step mode, not 71 % of it.
        home_output: output that is active in the home state; None if there is none.
        fault_output: output that is active during a shutdown; None if there is none.
        blocked: True if STEP is ignored while ENABLE is off; False if the counter continues without outputs.
        on_delay_ns: from ENABLE on until the outputs are on.
        off_delay_ns: from ENABLE off until the outputs are off.
        shutdown: thermal shutdown; None if no source describes one.
        overcurrent: release of the latch after a short circuit or overcurrent.
        overvoltage: overvoltage shutdown; None if no source describes one.
        current_law: formula or method by which the full current is set, as text.
        current_max_a: highest phase current, at its peak.
        sense_ohm: usual sense resistor of a phase.
        on_resistance_ohm: both switches of a bridge together.
        supply_v: lowest and highest motor supply.
        oscillator: oscillator that determines the shortest pulse; None if it has none.
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
        """Microstep modes in rising order."""
        return tuple(sorted(self.modes.value.values))

    @property
    def substeps(self) -> int:
        """Substeps per full step: each step of each mode, and each home angle, is a whole number of substeps.

        So positions are exact for any chip. A TB6560 has 16 substeps, a TMC2209 256, a DM542 16 000.
        """
        return lcm(2, *self.microsteps)

    @property
    def terminals(self) -> tuple[str, ...]:
        """Supply pins, and inputs with a static level."""
        tables = (self.modes, self.torque_percent, self.fast_decay_percent)
        return (*self.rails, "RESET", "ENABLE", *(pin for table in tables for pin in table.value.pins))

    @property
    def period_min_counts(self) -> int:
        """Shortest period between two counted pulses; 0 if no source limits the rate."""
        rate = self.times.rate_max_hz
        return 0 if rate is None else COUNTS_PER_SECOND // rate.value

    @property
    def pulse_min_counts(self) -> int:
        """Shortest pulse that is counted."""
        return self.oscillator.clk_width_min_counts if self.oscillator else self.times.counts("steplen_ns")
