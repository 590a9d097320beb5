"""Driver profiles: a chip, the circuit around it and its usual settings.

A user describes any other driver by the figures of its manual, in the robot file's table [board.driver].
"""

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, NamedTuple, TypeVar

from steptwin.protocol.drivers.chip_sheet import ChipSheet, Fact, PinTable, StepTimes, always, assumed
from steptwin.protocol.timer import COUNTS_PER_SECOND

GENERIC: Final = "generic"
"""Name of the profile that is made from the robot file's figures."""

_FILE: Final = "robot file, board.driver"
_NO_KEY: Final = f"not told: {_FILE} has no key for it"
_MODE_BITS: Final = 5
"""Width of the register that selects one of up to 17 microstep modes."""


class ActiveEdge(StrEnum):
    """The edge of STEP that triggers a step."""

    RISING = "rising"
    FALLING = "falling"


@dataclass(frozen=True, slots=True)
class Coupler:
    """An optocoupler or a wire: delays in ns until the chip's pin becomes high or low."""

    to_high_ns: int = 0
    to_low_ns: int = 0


@dataclass(frozen=True, slots=True)
class Cooling:
    """Cooling of a chip; the default is a TB6560 without heat sink in still air."""

    resistance_k_per_w: float = 25.0
    capacity_j_per_k: float = 4.0
    ambient_celsius: float = 25.0

    @property
    def time_constant_counts(self) -> float:
        """Thermal time constant: 63 % of a temperature change takes this long."""
        return self.resistance_k_per_w * self.capacity_j_per_k * COUNTS_PER_SECOND


class CurrentSetting(NamedTuple):
    """A row of the current table that is printed on a module.

    Attributes:
        printed_a: current in the table, which identifies the row.
        full_a: current at 100 percent torque with these switches.
        torque_percent: torque setting that the switches select at the chip's pins.
        switches: names of the switches that are ON.
    """

    printed_a: float
    full_a: float
    torque_percent: int = 100
    switches: tuple[str, ...] = ()


class InputLevels(NamedTuple):
    """Drive requirement of STEP, DIR and ENABLE: lowest high voltage, and optocoupler current (0 for none)."""

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
    """A type of driver and its usual settings.

    Attributes:
        name: name in robot files and on the command line.
        title: description in one line.
        chip: its chip.
        times: step times at its terminals that exceed those of the chip.
        clk: coupler between STEP and CLK.
        direction: coupler between DIR and the chip.
        enable: coupler between EN and ENABLE; the wiring inverts a low-active terminal.
        active_edge: edge of STEP that triggers a step.
        enable_open: level of ENABLE at the chip if nothing is connected to EN: 0 by the chip's pull-down, 1 if current
            in the optocoupler switches the chip off.
        switched: True if switches, straps or registers of the driver set mode, current and decay, and RESET follows the
            supply; False if the board's pins do.
        currents: rows of its current table; None if any current up to the chip's highest can be set.
        current_a: usual phase current at full torque.
        idle_percents: available standstill currents, in percent of the full current.
        idle_percent: usual standstill current.
        idle_ms: time from the last step until the standstill current is set.
        fast_decay_percent: usual part of each chopping period with fast decay.
        fault_terminal: True if the chip's fault output is at a terminal and can be wired to the board.
        inputs: drive requirement of its terminals.
        cooling: cooling of its chip.
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
        """Time from ENABLE until the driver accepts steps; it includes the wake-up time after power-up."""
        needed_ns = [times.ns(name) for times in (self.chip.times, self.times) for name in ("enable_ns", "wake_ns")]
        return max(needed_ns) + self.enable.value.to_high_ns

    def mode(self, microsteps: int) -> int:
        """Return `microsteps` if the driver has this mode; else raise ValueError with the nearest ones."""
        return one_of(microsteps, self.chip.microsteps, f"{self.name}'s")

    def current(self, current_a: float) -> CurrentSetting:
        """Return the driver's setting for a current.

        Raises:
            ValueError: the current is not positive, exceeds the chip's limit or is not in the driver's table; the
                message names the nearest ones.
        """
        most_a = self.chip.current_max_a.value
        if self.currents is None:
            if not 0 < current_a <= most_a:
                raise ValueError(f"{current_a:g} A is not above 0 and up to {most_a:g} A, the most of {self.name}")
            return CurrentSetting(current_a, current_a)
        settings = {setting.printed_a: setting for setting in self.currents.value}
        return settings[one_of(current_a, tuple(settings), f"{self.name}'s", " A")]

    def idle(self, percent: int) -> int:
        """Return `percent` if the driver has this standstill current; else raise ValueError with the nearest ones."""
        return one_of(percent, self.idle_percents, f"{self.name}'s", " %")

    def fast_decay(self, percent: int) -> int:
        """Return `percent` if the driver has this part of fast decay; else raise ValueError with the nearest ones."""
        return one_of(percent, self.chip.fast_decay_percent.value.values, f"{self.name}'s", " %")


Number = TypeVar("Number", int, float)


def one_of(value: Number, choices: Sequence[Number], whose: str, unit: str = "") -> Number:
    """Return `value` if it is one of the choices; else raise ValueError that lists them and names the nearest."""
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
    """A user's figures of a driver. The active edge of STEP is a setting of the board.

    Attributes:
        microsteps: available microsteps per full step.
        steplen_ns: shortest active pulse of STEP.
        stepspace_ns: shortest pause between two pulses of STEP.
        dirsetup_ns: DIR stable before the active edge.
        dirhold_ns: DIR stable after the active edge.
        enable_ns: from ENABLE until the first step.
        wake_ns: from power-up until the first step.
        step_rate_max_hz: highest step rate; None if the pulse times alone limit it.
        counts_while_off: True if STEP is counted while ENABLE is off, False if it is ignored.
        current_max_a: highest phase current, at its peak.
        input_high_v: lowest high voltage at STEP, DIR and ENABLE.
        input_ma: input current of an optocoupler; 0 for none.
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
        """Return the driver's profile; facts without a key in the robot file are marked as assumed."""

        def given(key: str) -> Fact[int] | None:
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
                steplen_ns=given("steplen_ns"),
                stepspace_ns=given("stepspace_ns"),
                dirsetup_ns=given("dirsetup_ns"),
                dirhold_ns=given("dirhold_ns"),
                enable_ns=given("enable_ns"),
                wake_ns=given("wake_ns"),
                rate_max_hz=given("step_rate_max_hz"),
            ),
            modes=Fact(PinTable(tuple(f"MODE{bit}" for bit in reversed(range(_MODE_BITS))), modes), _FILE),
            torque_percent=assumed(always(100), _NO_KEY),
            fast_decay_percent=assumed(always(0), _NO_KEY),
            home_deg=assumed(0.0, _NO_KEY),
            home_full_deg=assumed(45.0, _NO_KEY),
            blocked=Fact(not self.counts_while_off, f"{_FILE}.counts_while_off"),
            current_law=assumed("by hand", _NO_KEY),
            current_max_a=Fact(self.current_max_a, f"{_FILE}.current_max_a"),
            sense_ohm=assumed(0.1, _NO_KEY),
            on_resistance_ohm=assumed(0.5, _NO_KEY),
            supply_v=assumed((0.0, 1000.0), _NO_KEY),
        )
        return DriverProfile(
            name=GENERIC,
            title="driver of the robot file's [board.driver]",
            chip=chip,
            current_a=min(1.5, self.current_max_a),
            inputs=Fact(InputLevels(self.input_high_v, self.input_ma), f"{_FILE}.input_high_v"),
            source=_FILE,
        )
