"""A robot as data: joints with their limits and transmissions, the board that drives them, dimensions, home."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.homing import JointHoming, JointSwitches
from steptwin.protocol.cia402 import DigitalOutput
from steptwin.protocol.frame import BITRATES
from steptwin.protocol.objects import PULSE_NS_MIN, TIMING_NS_MAX, UNITS_PER_FULL_STEP
from steptwin.protocol.timer import COUNTS_PER_SECOND

MICROSTEPS: Final = (1, 2, 8, 16)
"""What a TB6560's M1 and M2 pins can choose."""

WIRE_POSITION_MAX: Final = (1 << 31) - 1
"""Positions travel as i32 wire units."""

AXES_MAX: Final = 8
"""Two 16-bit timers with four compare channels each."""

OUTPUTS_PER_AXIS: Final = len(DigitalOutput)

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


class Unit(StrEnum):
    """What a joint's position is measured in; speeds are per second."""

    MM = "mm"
    DEG = "deg"


class ActiveEdge(StrEnum):
    """Which edge of STEP makes a driver step."""

    RISING = "rising"
    FALLING = "falling"


@dataclass(frozen=True, slots=True)
class Transmission:
    """From motor steps to joint travel.

    Attributes:
        full_steps_per_rev: of the motor; 200 for the usual 1.8 deg.
        microsteps: per full step, as set at the driver.
        travel_per_turn: the joint's travel per turn of the driven shaft: 360 degrees, a screw's lead or a pulley's
            circumference in mm.
        ratio: motor turns per turn of the driven shaft.

    Raises:
        InputError: a number that is no transmission.
    """

    full_steps_per_rev: int
    microsteps: int
    travel_per_turn: float
    ratio: float = 1.0

    def __post_init__(self) -> None:
        if self.microsteps not in MICROSTEPS:
            raise InputError(f"microsteps: {self.microsteps} is none of the TB6560's {MICROSTEPS}")
        _require_positive(self, "full_steps_per_rev", "travel_per_turn", "ratio")

    @property
    def travel_per_rev(self) -> float:
        """The joint's travel in mm or degrees per motor turn."""
        return self.travel_per_turn / self.ratio

    @property
    def steps_per_unit(self) -> float:
        """Steps per mm or degree, rounded once: from the ratio, since 360/ratio is already inexact for most."""
        return self.full_steps_per_rev * self.microsteps * self.ratio / self.travel_per_turn

    @property
    def wire_units_per_unit(self) -> float:
        """Wire units per mm or degree; microsteps and units are powers of two, so that nothing is rounded again."""
        return self.steps_per_unit / self.microsteps * UNITS_PER_FULL_STEP


@dataclass(frozen=True, slots=True)
class Joint:
    """One axis. Positions in `unit`, speed in unit/s, acceleration in unit/s^2.

    Raises:
        InputError: limits that leave no room, or that the wire's i32 positions do not reach; limit switches within
            them, a homing that the switches or the joint do not allow.
    """

    name: str
    unit: Unit
    lower: float
    upper: float
    speed_max: float
    acceleration_max: float
    transmission: Transmission
    switches: JointSwitches = field(default_factory=JointSwitches)
    homing: JointHoming | None = None

    def __post_init__(self) -> None:
        if not self.lower < self.upper:
            raise InputError(f"upper: {self.upper:g} {self.unit} is not above lower, {self.lower:g} {self.unit}")
        _require_positive(self, "speed_max", "acceleration_max")
        farthest = max(abs(self.lower), abs(self.upper))
        reach = WIRE_POSITION_MAX / self.transmission.wire_units_per_unit
        if farthest > reach:
            bound = "upper" if farthest == abs(self.upper) else "lower"
            raise InputError(f"{bound}: {farthest:g} {self.unit} from zero is beyond the wire's {reach:g} {self.unit}")
        self.switches.check_outside(self.lower, self.upper, self.unit)
        if self.homing:
            self.switches.check_method(self.homing.method)
            self.homing.check_within(self.speed_max, self.acceleration_max)

    @property
    def step_rate_max_hz(self) -> float:
        """The step rate at the joint's highest speed."""
        return self.speed_max * self.transmission.steps_per_unit


@dataclass(frozen=True, slots=True)
class Board:
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
        _require_positive(self, "step_rate_max_hz")
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
            _require_positive(self, "osc_pf")
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


@dataclass(frozen=True, slots=True)
class Output:
    """A digital output of the board: which joint's axis has it at its connector, and as which number.

    Raises:
        InputError: no such number.
    """

    joint: str
    out: int

    def __post_init__(self) -> None:
        if not 1 <= self.out <= OUTPUTS_PER_AXIS:
            raise InputError(f"out: {self.out} is not from 1 to {OUTPUTS_PER_AXIS}")


@dataclass(frozen=True, slots=True)
class Robot:
    """A machine.

    Attributes:
        name: as on the command line.
        title: one line for people.
        kinematics: the kind of mechanism, a name known to `steptwin.host.robots.kinematics`.
        geometry: the mechanism's dimensions in mm and degrees, by name.
        joints: in the order of their axes on the board.
        home: joint positions, in joint order, that the machine takes after homing.
        board: settings that all axes share.
        outputs: what is wired to the board's digital outputs, by name.
        places: named joint positions that jobs go to; a place may name only some of the joints.
        toml: the file that the robot was read from, word for word; empty for one that was made otherwise.

    Raises:
        InputError: no joints, too many for a board, a position outside the joints' limits, a place of no joint, an
            output of no joint or two of the same number.
    """

    name: str
    title: str
    kinematics: str
    geometry: Mapping[str, float]
    joints: tuple[Joint, ...]
    home: tuple[float, ...]
    board: Board
    outputs: Mapping[str, Output] = field(default_factory=dict)
    places: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    toml: str = field(default="", repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 1 <= len(self.joints) <= AXES_MAX:
            raise InputError(f"joints: {len(self.joints)} of them, a board drives 1 to {AXES_MAX}")
        self._check_place("home", dict(zip(self.joint_names, self.home, strict=True)))
        for name, place in self.places.items():
            self._check_place(f"places.{name}", place)
        wired: dict[Output, str] = {}
        for name, output in self.outputs.items():
            if output.joint not in self.joint_names:
                raise unknown(f"outputs.{name}.joint:", output.joint, self.joint_names)
            if wired.setdefault(output, name) != name:
                raise InputError(f"outputs.{name}: output {output.out} of {output.joint} is {wired[output]} already")

    def _check_place(self, key: str, place: Mapping[str, float]) -> None:
        if not place:
            raise InputError(f"{key}: names no joint")
        for name, position in place.items():
            if name not in self.joint_names:
                raise unknown(f"{key}: joint", name, self.joint_names)
            joint = self.joint(name)
            if not joint.lower <= position <= joint.upper:
                limits = f"{joint.lower:g}..{joint.upper:g} {joint.unit}"
                raise InputError(f"{key}.{name}: {position:g} {joint.unit} is outside {limits}")

    @property
    def joint_names(self) -> tuple[str, ...]:
        """In axis order."""
        return tuple(joint.name for joint in self.joints)

    def joint(self, name: str) -> Joint:
        """A joint by its name; KeyError if there is none."""
        return {joint.name: joint for joint in self.joints}[name]

    @property
    def steps_per_unit(self) -> FloatArray:
        """Shape (joints,): steps per mm or degree."""
        return np.array([joint.transmission.steps_per_unit for joint in self.joints])

    @property
    def wire_units_per_unit(self) -> FloatArray:
        """Shape (joints,): wire units per mm or degree."""
        return np.array([joint.transmission.wire_units_per_unit for joint in self.joints])


def _require_positive(settings: object, *names: str) -> None:
    for name in names:
        value = getattr(settings, name)
        if not value > 0:
            raise InputError(f"{name}: {value:g} is not above 0")
