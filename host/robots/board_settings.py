"""How a robot's board is set: the bus, the drivers and the shape of the step pulses."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from steptwin.host.common.bad_input import require_positive, unknown
from steptwin.host.common.errors import InputError
from steptwin.protocol.frame import BITRATES
from steptwin.protocol.objects import PULSE_NS_MIN, TIMING_NS_MAX
from steptwin.protocol.timer import COUNTS_PER_SECOND

DRIVER_PROFILES: Final = ("chip-100pf", "chip-330pf", "chip-1000pf", "3a-module", "slow-blue-board")
"""The drivers that the emulated board can have."""

SWITCHED_PROFILES: Final = ("3a-module",)
"""The drivers with switches of their own."""

SWITCH_CHOICES: Final = {"idle_percent": (20, 50), "fast_decay_percent": (0, 25, 50, 100)}
"""What these can be set to, but for currents and microsteps."""

DRIVER_SETTINGS: Final = ("current_a", "active_edge", *SWITCH_CHOICES)
"""What a file may say about how its drivers are set."""

PHASE_CURRENT_MAX_A: Final = 3.0
"""A TB6560AHQ's operating range."""

OSC_PF_MIN: Final = 64
"""With less at its OSC pin its oscillator is faster than the 600 kHz of its operating range."""

_TIMING_MIN_NS: Final = {
    "steplen_ns": PULSE_NS_MIN,
    "stepspace_ns": PULSE_NS_MIN,
    "dirsetup_ns": 0,
    "dirhold_ns": 0,
}
"""What the board's object 0x2001 takes."""


class ActiveEdge(StrEnum):
    """Which edge of STEP makes a driver step."""

    RISING = "rising"
    FALLING = "falling"


@dataclass(frozen=True, slots=True)
class BoardSettings:
    """How the board is set: the bus, the drivers and the shape of the step pulses (LinuxCNC's names).

    Attributes:
        bitrate: of the CAN bus, in bit/s.
        osc_pf: capacitor at each TB6560's OSC pin, which sets the shortest CLK pulse that it accepts; None with a
            profile that says it.
        steplen_ns: how long CLK is high.
        stepspace_ns: how long it is low at least.
        dirsetup_ns: how long DIR is stable before CLK rises.
        dirhold_ns: how long it stays after CLK rose.
        step_rate_max_hz: the fastest CLK that a driver is given.
        driver_profile: which drivers the board has; None for TB6560s on the board itself.
        current_a: phase current at full torque; None for what is usual with the drivers.
        active_edge: which edge of STEP is the step; None for what is usual with the drivers.
        idle_percent: part of the current that is left at standstill, for drivers with a switch for it; None: as usual.
        fast_decay_percent: part of each chopping period in which the current decays fast, likewise.

    Raises:
        InputError: a number out of range, or pulses too long for the step rate.
    """

    bitrate: int
    osc_pf: int | None
    steplen_ns: int
    stepspace_ns: int
    dirsetup_ns: int
    dirhold_ns: int
    step_rate_max_hz: float
    driver_profile: str | None = None
    current_a: float | None = None
    active_edge: ActiveEdge | None = None
    idle_percent: int | None = None
    fast_decay_percent: int | None = None

    def __post_init__(self) -> None:
        self._check_drivers()
        require_positive(self, "step_rate_max_hz")
        if self.bitrate not in BITRATES:
            raise InputError(f"bitrate: {self.bitrate} is none of {', '.join(map(str, BITRATES))}")
        for name, least in _TIMING_MIN_NS.items():
            value = getattr(self, name)
            if not least <= value <= TIMING_NS_MAX:
                raise InputError(f"{name}: {value} ns is outside {least}..{TIMING_NS_MAX} ns")
        pulse_ns = self.steplen_ns + self.stepspace_ns
        if pulse_ns * self.step_rate_max_hz > 1e9:
            raise InputError(
                f"step_rate_max_hz: {self.step_rate_max_hz:g} Hz is more than the {1e9 / pulse_ns:.1f} Hz"
                f" that steplen_ns + stepspace_ns = {pulse_ns} ns allow"
            )

    def _check_drivers(self) -> None:
        if self.driver_profile is None:
            if self.osc_pf is None:
                raise InputError("osc_pf: is missing; it or driver_profile says which drivers there are")
            require_positive(self, "osc_pf")
            if self.osc_pf < OSC_PF_MIN:
                raise InputError(
                    f"osc_pf: {self.osc_pf} pF makes the TB6560's oscillator faster than its 600 kHz: at least"
                    f" {OSC_PF_MIN} pF"
                )
        elif self.driver_profile not in DRIVER_PROFILES:
            raise unknown("driver_profile:", self.driver_profile, DRIVER_PROFILES)
        elif self.osc_pf is not None:
            raise InputError(f"osc_pf: driver_profile {self.driver_profile} says already what is at OSC")
        if self.current_a is not None and not 0 < self.current_a <= PHASE_CURRENT_MAX_A:
            raise InputError(f"current_a: {self.current_a:g} A is not above 0 and up to {PHASE_CURRENT_MAX_A:g} A")
        for key, choices in SWITCH_CHOICES.items():
            self._check_switch(key, choices)

    def _check_switch(self, key: str, choices: tuple[int, ...]) -> None:
        percent = getattr(self, key)
        if percent is None:
            return
        if self.driver_profile not in SWITCHED_PROFILES:
            drivers = self.driver_profile or "the chip alone"
            raise InputError(f"{key}: {drivers} has no switch for it; driver_profile {SWITCHED_PROFILES[0]} has")
        if percent not in choices:
            raise InputError(f"{key}: {percent} % is none of {', '.join(map(str, choices))} %")

    @property
    def driver_rate_max_hz(self) -> float:
        """The fastest CLK that the board really makes.

        Both phases of a pulse last whole counts of its timer, rounded up so that none is shorter than asked for; where
        they leave no reserve the board is a little slower than `step_rate_max_hz`.
        """
        pulse_counts = sum(
            -(-phase_ns * COUNTS_PER_SECOND // 10**9) for phase_ns in (self.steplen_ns, self.stepspace_ns)
        )
        return min(self.step_rate_max_hz, COUNTS_PER_SECOND / pulse_counts)
