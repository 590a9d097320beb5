"""The settings of a robot's board: the bus, the drivers, the step pulses, and the wired inputs and outputs."""

from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar, Final, NamedTuple

from pydantic import AfterValidator

from steptwin.host.common.bad_input import at_most
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_errors import wrong
from steptwin.host.common.file_models import FileReading, FileTable
from steptwin.host.common.file_values import Choice, Positive, Within, check_limits
from steptwin.host.common.findings import UnreadError, check_all, judged
from steptwin.protocol.cia402 import GENERAL_INPUTS, DigitalOutput
from steptwin.protocol.drivers import (
    GENERIC,
    OSC_PF_MIN,
    PROFILES,
    ActiveEdge,
    DriverFigures,
    DriverProfile,
    bare_chip,
    driver_names,
)
from steptwin.protocol.frame import BITRATES, DEFAULT_BITRATE
from steptwin.protocol.od import MICROSTEPS_CHOICES, PULSE_NS_MIN, TIMING_NS_MAX
from steptwin.protocol.timer import COUNTS_PER_SECOND


class Microsteps(NamedTuple):
    """Microsteps per full step of an axis; as text, a sentence that names them.

    Attributes:
        joint: name of the axis' joint.
        driver: those that the driver makes, by its pins M1 and M2 or by its module's switches.
        board: those that the board counts with (2000h:01).
        filed: those of the robot's file.
    """

    joint: str
    driver: int
    board: int
    filed: int

    @property
    def agree(self) -> bool:
        """True if all three are the same."""
        return self.driver == self.board == self.filed

    @property
    def right(self) -> bool:
        """True if positions on the bus are those of the motor: the driver makes the steps that the board counts."""
        return self.driver == self.board

    def __str__(self) -> str:
        """Say what is set where, and how far motions go if they go wrong."""
        if self.agree:
            return f"{self.joint}: {self.driver} microsteps"
        filed = f"the robot's file says {self.filed}"
        if self.right:
            return f"{self.joint}: driver and board make {self.driver} microsteps, {filed}"
        return (
            f"{self.joint}: the driver makes {self.driver} microsteps, the board counts with {self.board}, {filed}:"
            f" it moves {self.board / self.driver:g} times as far as the board says"
        )


_SWITCHED: Final = ("idle_percent", "fast_decay_percent")
"""Keys that only drivers with switches, straps or registers of their own have."""
DRIVER_SETTINGS: Final = ("current_a", "active_edge", *_SWITCHED, "fault_wired")
"""Keys of a robot file that set its drivers."""
_TIMES: Final = ("steplen_ns", "stepspace_ns", "dirsetup_ns", "dirhold_ns")
"""Keys of the step timing (2001h)."""
PULSE_KEYS: Final = (*_TIMES, "step_rate_max_hz")
"""Keys of what drivers that the file names bring along."""
_PHASES: Final = {"steplen_ns": "stepspace_ns", "stepspace_ns": "steplen_ns"}
"""The two phases of a pulse: where the falling edge is the step, each is the other one at the driver."""


def named_profile(name: str, figures: DriverFigures | None) -> DriverProfile | None:
    """Return the drivers of a name, generic ones by their figures; None if there are none such."""
    if name == GENERIC:
        return figures.profile() if figures is not None else None
    return PROFILES.get(name)


def pulses_for(profile: DriverProfile, active_edge: ActiveEdge | None = None) -> dict[str, int]:
    """Return the times and the rate, by their keys of `BoardSettings`, with which drivers lose no step and no turn.

    Beyond the chip's own times they have what the driver's other parts ask for or delay. DIR's hold time counts from
    the rise, and CLK's low phase fills the period of the chip's highest rate. A time that the firmware cannot make is
    the least that it can.
    """
    falling = (active_edge or profile.active_edge) is ActiveEdge.FALLING
    clk, direction = profile.clk.value, profile.direction.value
    late_ns = clk.to_high_ns - clk.to_low_ns
    need = {key: max(profile.chip.times.ns(key), profile.times.ns(key)) for key in _TIMES}
    at_step = {
        "steplen_ns": need["steplen_ns"] + max(late_ns, 0),
        "stepspace_ns": need["stepspace_ns"] + max(-late_ns, 0),
    }
    phases = {key: max(at_step[_PHASES[key] if falling else key], PULSE_NS_MIN) for key in _PHASES}
    if (rate := profile.chip.times.rate_max_hz) is not None:
        phases["stepspace_ns"] = max(phases["stepspace_ns"], -(-(10**9) // rate.value) - phases["steplen_ns"])
    behind_ns = [delay_ns - clk.to_high_ns for delay_ns in (direction.to_high_ns, direction.to_low_ns)]
    setup_ns, hold_ns = need["dirsetup_ns"] + max(behind_ns), need["dirhold_ns"] - min(behind_ns)
    return {
        **phases,
        "dirsetup_ns": max(setup_ns, 0),
        "dirhold_ns": max(hold_ns, 0) + (phases["steplen_ns"] if falling else 0),
        "step_rate_max_hz": 10**9 // sum(phases.values()),
    }


_FigureNs = Annotated[int, Within(0, TIMING_NS_MAX // 2, "ns")]
_SettlingNs = Annotated[int, Within(0, 10**10, "ns")]
"""Up to ten seconds: a driver that takes longer until its first step is none."""


def _modes(modes: Any) -> tuple[int, ...]:
    """Return the microsteps of a driver, each once and in their order; raise pydantic's error if there are none."""
    if not modes:
        raise wrong("is empty; it lists the microsteps that the driver has")
    return tuple(mode for mode in MICROSTEPS_CHOICES if mode in modes)


@dataclass(frozen=True, slots=True)
class DriverTable(DriverFigures, FileTable):
    """Figures of a driver's manual, for `driver_profile = "generic"` (docs/driver.md)."""

    microsteps: Annotated[tuple[Annotated[int, Choice("", MICROSTEPS_CHOICES)], ...], AfterValidator(_modes)]
    steplen_ns: _FigureNs
    stepspace_ns: _FigureNs
    dirsetup_ns: _FigureNs
    dirhold_ns: _FigureNs
    enable_ns: _SettlingNs = 0
    wake_ns: _SettlingNs = 0
    step_rate_max_hz: Annotated[int, Within(1)] | None = None
    counts_while_off: bool = False
    current_max_a: Annotated[float, Within(0.01, 100.0, "A")] = 10.0
    input_high_v: Annotated[float, Within(0.0, 100.0, "V")] = 3.3
    input_ma: Annotated[float, Within(0.0, 100.0, "mA")] = 0.0


_PulseNs = Annotated[int, Within(PULSE_NS_MIN, TIMING_NS_MAX, "ns")]
_DirNs = Annotated[int, Within(0, TIMING_NS_MAX, "ns")]


@dataclass(frozen=True, slots=True)
class BoardSettings(FileTable):
    """The settings of the board; the names of the pulses' times are LinuxCNC's. None: the drivers' usual setting.

    Attributes:
        osc_pf: capacitor at each TB6560's OSC pin, which sets the shortest CLK pulse that it accepts; None if
            `driver_profile` sets it.
        steplen_ns: time for which CLK is high.
        stepspace_ns: least time for which CLK is low.
        dirsetup_ns: time for which DIR is stable before CLK rises.
        dirhold_ns: time for which DIR is stable after CLK has risen.
        step_rate_max_hz: highest step rate that a driver gets.
        bitrate: bit rate of the CAN bus, in bit/s.
        driver_profile: name of the drivers' profile; None for TB6560s on the board itself.
        driver: figures of generic drivers.
        current_a: phase current at full torque.
        active_edge: the edge of STEP that makes the drivers step.
        idle_percent: part of the current that flows at standstill, for drivers with a switch for it.
        fast_decay_percent: part of a chopping period with fast decay, for drivers with a switch for it.
        fault_wired: the drivers' fault outputs are wired to the board, for drivers that have one.
        personality: name of the drive whose objects the board shows on the bus, or a file of objects.

    Raises:
        InputError: a value out of range, pulses too long for the step rate, or too short for the named drivers' chip.
    """

    osc_pf: Annotated[int, Within(0, open=True)] | None
    steplen_ns: _PulseNs
    stepspace_ns: _PulseNs
    dirsetup_ns: _DirNs
    dirhold_ns: _DirNs
    step_rate_max_hz: Positive
    bitrate: Annotated[int, Choice("", BITRATES)] = DEFAULT_BITRATE
    driver_profile: Annotated[str, Choice("", driver_names)] | None = None
    driver: Annotated[DriverFigures, DriverTable] | None = None
    current_a: float | None = None
    active_edge: ActiveEdge | None = None
    idle_percent: int | None = None
    fast_decay_percent: int | None = None
    fault_wired: bool | None = None
    personality: str | None = None
    may_lack: ClassVar[tuple[str, ...]] = ("osc_pf", *PULSE_KEYS)

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Any:
        """Return the settings; drivers that the file names bring the times and the rate that it leaves out."""
        left_out = [key for key in PULSE_KEYS if key in values and values[key] is None]
        times: dict[str, int] = {}
        if "driver_profile" not in reading.table:
            reading.findings.add(*(f"{key}: is missing" for key in left_out))
        else:
            with suppress(UnreadError):
                profile = named_profile(values.get("driver_profile", ""), values.get("driver"))
                times = pulses_for(profile, values.get("active_edge")) if profile is not None else {}
        known = {key: value for key, value in values.items() if key not in left_out}
        brought = {key: times[key] for key in left_out if key in times}
        return judged(cls, known | brought, reading.findings)

    def __post_init__(self) -> None:
        check_all(
            self._check_drivers,
            self._check_figures,
            self._check_fault_output,
            *(partial(self._check_setting, key) for key in ("current_a", *_SWITCHED)),
            partial(check_limits, self),
        )
        self._check_pulses()
        if self.driver_profile is not None:
            check_all(self._check_rate, *(partial(self._check_chip_time, key) for key in _TIMES))

    def _check_chip_time(self, key: str) -> None:
        """Check a time against the chip's; a module's parts may need more, which a run shows."""
        falling = (self.active_edge or self.profile.active_edge) is ActiveEdge.FALLING
        least_ns = self.profile.chip.times.ns(_PHASES.get(key, key) if falling else key)
        value_ns = getattr(self, key)
        if key == "dirhold_ns" and least_ns and falling:
            least_ns += self.steplen_ns  # the board counts it from the rise
        if value_ns < least_ns:
            raise InputError(f"{key}: {value_ns} ns is too short for {self.driver_profile}: at least {least_ns} ns")

    def _check_rate(self) -> None:
        most = self.profile.chip.times.rate_max_hz
        if most is not None and self.step_rate_max_hz > most.value:
            raise InputError(
                f"step_rate_max_hz: {self.step_rate_max_hz:g} Hz is too fast for {self.driver_profile}:"
                f" at most {most.value} Hz"
            )

    def _check_pulses(self) -> None:
        pulse_ns = self.steplen_ns + self.stepspace_ns
        if pulse_ns * self.step_rate_max_hz > 1e9:
            raise InputError(
                f"step_rate_max_hz: {self.step_rate_max_hz:g} Hz is more than the {at_most(1e9 / pulse_ns)} Hz"
                f" that steplen_ns + stepspace_ns = {pulse_ns} ns allow"
            )

    def _check_drivers(self) -> None:
        if self.driver_profile is None:
            if self.osc_pf is None:
                raise InputError("osc_pf: is missing; a board needs it or driver_profile")
            if self.osc_pf < OSC_PF_MIN:
                raise InputError(
                    f"osc_pf: {self.osc_pf} pF makes the TB6560's oscillator faster than its 600 kHz: at least"
                    f" {OSC_PF_MIN} pF"
                )
        elif self.osc_pf is not None:
            raise InputError(f"osc_pf: driver_profile {self.driver_profile} sets it already")

    def _check_figures(self) -> None:
        if self.driver_profile == GENERIC and self.driver is None:
            raise InputError(f"driver: is missing; driver_profile {GENERIC} needs this table (docs/driver.md)")
        if self.driver_profile != GENERIC and self.driver is not None:
            told = f'has its own; driver_profile = "{GENERIC}" takes these'
            raise InputError(f"driver: {self.driver_profile or 'the chip at osc_pf'} {told}")

    def _check_fault_output(self) -> None:
        if not self.fault_wired:
            return
        try:
            profile = self.profile
        except (KeyError, ValueError):
            return
        if not profile.fault_terminal:
            have = ", ".join(name for name, each in PROFILES.items() if each.fault_terminal)
            raise InputError(f"fault_wired: {profile.name} has no terminal that tells of a fault; {have} have")

    @property
    def profile(self) -> DriverProfile:
        """The drivers; KeyError or ValueError if there are none such."""
        if self.driver_profile is None:
            return bare_chip(0 if self.osc_pf is None else self.osc_pf)
        profile = named_profile(self.driver_profile, self.driver)
        if profile is None:
            raise KeyError(self.driver_profile)
        return profile

    def _check_setting(self, key: str) -> None:
        """Check a setting of known drivers."""
        value = getattr(self, key)
        try:
            profile = self.profile
        except (KeyError, ValueError):
            return
        if value is None:
            return
        if key in _SWITCHED and not profile.switched:
            drivers = self.driver_profile or "the chip alone"
            raise InputError(f"{key}: {drivers} has no switch for it; driver_profile 3a-module has")
        checks = {"current_a": profile.current, "idle_percent": profile.idle, "fast_decay_percent": profile.fast_decay}
        try:
            checks[key](value)
        except ValueError as error:
            raise InputError(f"{key}: {error}") from error

    @property
    def driver_rate_max_hz(self) -> float:
        """The highest step rate that the board makes.

        Both phases of a pulse last whole counts of the timer, rounded up so that neither is too short. If their sum
        leaves no reserve, this rate is slightly below `step_rate_max_hz`.
        """
        pulse_counts = sum(
            -(-phase_ns * COUNTS_PER_SECOND // 10**9) for phase_ns in (self.steplen_ns, self.stepspace_ns)
        )
        return min(self.step_rate_max_hz, COUNTS_PER_SECOND / pulse_counts)


OUTPUTS_PER_AXIS: Final = len(DigitalOutput)


@dataclass(frozen=True, slots=True)
class Output(FileTable):
    """A digital output.

    Attributes:
        joint: the joint whose axis has it.
        out: its number there.
    """

    joint: str
    out: Annotated[int, Within(1, OUTPUTS_PER_AXIS)]


INPUTS_PER_AXIS: Final = len(GENERAL_INPUTS)


@dataclass(frozen=True, slots=True)
class Input(FileTable):
    """A digital input.

    Attributes:
        joint: the joint whose axis has it.
        input: its number there.
    """

    joint: str
    input: Annotated[int, Within(1, INPUTS_PER_AXIS)]
