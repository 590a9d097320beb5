"""A driver as it stands at an axis connector: a chip, what is around it, and how it is usually set.

One that no profile describes is the user's, with what its manual says in a robot file's table [board.driver].
"""

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, NamedTuple, TypeVar

from steptwin.protocol.drivers.chip_sheet import ChipSheet, Fact, PinTable, StepTimes, always, assumed
from steptwin.protocol.timer import COUNTS_PER_SECOND

GENERIC: Final = "generic"
"""Name of the profile that is made of these figures."""

_FILE: Final = "robot file, board.driver"
_UNTOLD: Final = f"not told: {_FILE} has no key for it"
_MODE_BITS: Final = 5
"""Bits of a register that selects among up to 17 microstep modes."""


class ActiveEdge(StrEnum):
    """The edge of STEP that makes a driver step."""

    RISING = "rising"
    FALLING = "falling"


@dataclass(frozen=True, slots=True)
class Coupler:
    """An optocoupler or a wire, with its delays in ns for a level that becomes high or low at the chip's pin."""

    to_high_ns: int = 0
    to_low_ns: int = 0


@dataclass(frozen=True, slots=True)
class Cooling:
    """Cooling of a chip; the default is the TB6560's bare package in still air."""

    resistance_k_per_w: float = 25.0
    capacity_j_per_k: float = 4.0
    ambient_celsius: float = 25.0

    @property
    def time_constant_counts(self) -> float:
        """Time until 63 % of a change of temperature is over."""
        return self.resistance_k_per_w * self.capacity_j_per_k * COUNTS_PER_SECOND


class CurrentSetting(NamedTuple):
    """A row of a module's table of currents.

    Attributes:
        printed_a: the current of the table, by which it is chosen.
        full_a: current of 100 percent with these switches.
        torque_percent: part of it that the switches select at the chip's pins.
        switches: names of the switches that are ON.
    """

    printed_a: float
    full_a: float
    torque_percent: int = 100
    switches: tuple[str, ...] = ()


class InputLevels(NamedTuple):
    """What STEP, DIR and ENABLE must be driven with: least voltage of a high level, and current, 0 without a light."""

    high_v: float
    light_ma: float = 0.0


WIRE: Final = Coupler()
"""No delay."""
NO_TIMES: Final = StepTimes()
_WIRE: Final = Fact(WIRE, "a wire")
_IDLE_MS: Final = assumed(500, "no source gives the time")
_BARE: Final = Fact(Cooling(), "TB6560AHQ datasheet, pages 6 to 8")


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverProfile:
    """A kind of driver, and its usual settings.

    Attributes:
        name: its name in robot files and on the command line.
        title: description in one line.
        chip: the chip.
        times: what it needs at its terminals beyond the chip's times.
        clk: part between STEP and CLK.
        direction: part between DIR and the chip.
        enable: part between EN and ENABLE; the wiring takes care of a low-active terminal.
        active_edge: edge of STEP that makes the step.
        enable_open: ENABLE at the chip if nothing is connected to EN: 0 for the chip's pull-down, 1 where a light
            switches the chip off.
        switched: switches, straps or registers of its own set mode, current and decay, and RESET is high with the
            supply; else the board's pins do.
        currents: the only currents that it can be set to; empty: any up to the chip's highest.
        current_a: usual phase current at full torque.
        idle_percents: currents at standstill that can be chosen, in percent of the full current.
        idle_percent: the usual one.
        idle_ms: time from the last step until it begins.
        fast_decay_percent: usual part of each chopping period with fast decay.
        fault_terminal: the chip's fault output is at a terminal, so that it can be wired to the board.
        inputs: levels at its terminals.
        cooling: of the chip.
        source: origin of the delays, for reports.
    """

    name: str
    title: str
    chip: ChipSheet
    times: StepTimes = NO_TIMES
    clk: Fact[Coupler] = _WIRE
    direction: Fact[Coupler] = _WIRE
    enable: Fact[Coupler] = _WIRE
    active_edge: ActiveEdge = ActiveEdge.RISING
    enable_open: int = 0
    switched: bool = True
    currents: Fact[tuple[CurrentSetting, ...]] | None = None
    current_a: float = 1.5
    idle_percents: tuple[int, ...] = (100,)
    idle_percent: int = 100
    idle_ms: Fact[int] = _IDLE_MS
    fast_decay_percent: int = 0
    fault_terminal: bool = False
    inputs: Fact[InputLevels]
    cooling: Fact[Cooling] = _BARE
    source: str = "wires"

    @property
    def settling_ns(self) -> int:
        """Time from ENABLE until it takes steps; ENABLE comes after the supply, so it is awake then, too."""
        asked_ns = [times.ns(name) for times in (self.chip.times, self.times) for name in ("enable_ns", "wake_ns")]
        return max(asked_ns) + self.enable.value.to_high_ns

    def mode(self, microsteps: int) -> int:
        """Return microsteps that the driver has; raise ValueError, with the nearest ones, for others."""
        return one_of(microsteps, self.chip.microsteps, f"{self.name}'s")

    def current(self, current_a: float) -> CurrentSetting:
        """Return how the driver is set to a current.

        Raises:
            ValueError: it is not positive, beyond the chip's highest, or none of the driver's; the nearest are named.
        """
        most_a = self.chip.current_max_a.value
        if self.currents is None:
            if not 0 < current_a <= most_a:
                raise ValueError(f"{current_a:g} A is not above 0 and up to {most_a:g} A, the most of {self.name}")
            return CurrentSetting(current_a, current_a)
        settings = {setting.printed_a: setting for setting in self.currents.value}
        return settings[one_of(current_a, tuple(settings), f"{self.name}'s", " A")]

    def idle(self, percent: int) -> int:
        """Return a current at standstill that the driver has; raise ValueError, with the nearest ones, for others."""
        return one_of(percent, self.idle_percents, f"{self.name}'s", " %")

    def fast_decay(self, percent: int) -> int:
        """Return a part of fast decay that the driver has; raise ValueError, with the nearest ones, for others."""
        return one_of(percent, self.chip.fast_decay_percent.value.values, f"{self.name}'s", " %")


Number = TypeVar("Number", int, float)


def one_of(value: Number, choices: Sequence[Number], whose: str, unit: str = "") -> Number:
    """Return a value if it is one of the choices; raise ValueError, which names all and the nearest ones, if not."""
    if value in choices:
        return value
    ordered = sorted(choices)
    place = bisect(ordered, value)
    nearest = [f"{each:g}{unit}" for each in ordered[max(place - 1, 0) : place + 1]]
    listed = ", ".join(f"{each:g}" for each in ordered)
    says = "the nearest are" if len(nearest) > 1 else "the nearest is"
    raise ValueError(f"{value:g}{unit} is not one of {whose} {listed}{unit}: {says} {' and '.join(nearest)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverFigures:
    """What a user says of a driver; the times are those of `StepTimes`, and its active edge is the board's setting.

    Attributes:
        microsteps: microsteps per full step that it has.
        steplen_ns: from the active edge of STEP until it goes back.
        stepspace_ns: before the active edge, likewise.
        dirsetup_ns: DIR stable before the active edge.
        dirhold_ns: DIR stable after it.
        enable_ns: from ENABLE until the first step.
        wake_ns: from the supply until the first step.
        step_rate_max_hz: highest step rate; None: that of the shortest pulses.
        counts_while_off: STEP is counted while ENABLE is off, too; else it is ignored.
        current_max_a: highest current of a phase, at its peak.
        input_high_v: least voltage of a high level at STEP, DIR and ENABLE.
        input_ma: current that an optocoupler takes there; 0: it has none.
    """

    microsteps: tuple[int, ...]
    steplen_ns: int
    stepspace_ns: int
    dirsetup_ns: int
    dirhold_ns: int
    enable_ns: int = 0
    wake_ns: int = 0
    step_rate_max_hz: int | None = None
    counts_while_off: bool = False
    current_max_a: float = 10.0
    input_high_v: float = 3.3
    input_ma: float = 0.0

    def profile(self) -> DriverProfile:
        """Return the driver's profile; what the table has no key for is assumed and says so."""

        def told(key: str) -> Fact[int] | None:
            value = getattr(self, key)
            return Fact(value, f"{_FILE}.{key}") if value else None

        modes = tuple(
            (mode, f"{number:0{_MODE_BITS}b}".replace("0", "L").replace("1", "H"))
            for number, mode in enumerate(sorted(self.microsteps))
        )
        chip = ChipSheet(
            name="generic driver",
            document=_FILE,
            rails=("VM",),
            logic_rail="VM",
            times=StepTimes(
                steplen_ns=told("steplen_ns"),
                stepspace_ns=told("stepspace_ns"),
                dirsetup_ns=told("dirsetup_ns"),
                dirhold_ns=told("dirhold_ns"),
                enable_ns=told("enable_ns"),
                wake_ns=told("wake_ns"),
                rate_max_hz=told("step_rate_max_hz"),
            ),
            modes=Fact(PinTable(tuple(f"MODE{bit}" for bit in reversed(range(_MODE_BITS))), modes), _FILE),
            torque_percent=assumed(always(100), _UNTOLD),
            fast_decay_percent=assumed(always(0), _UNTOLD),
            home_deg=assumed(0.0, _UNTOLD),
            home_full_deg=assumed(45.0, _UNTOLD),
            blocked=Fact(not self.counts_while_off, f"{_FILE}.counts_while_off"),
            current_law=assumed("by hand", _UNTOLD),
            current_max_a=Fact(self.current_max_a, f"{_FILE}.current_max_a"),
            sense_ohm=assumed(0.1, _UNTOLD),
            on_resistance_ohm=assumed(0.5, _UNTOLD),
            supply_v=assumed((0.0, 1000.0), _UNTOLD),
        )
        return DriverProfile(
            name=GENERIC,
            title="driver of the robot file's [board.driver]",
            chip=chip,
            current_a=min(1.5, self.current_max_a),
            inputs=Fact(InputLevels(self.input_high_v, self.input_ma), f"{_FILE}.input_high_v"),
            source=_FILE,
        )
