"""Harms to the drivers: a Protect pin held low, another mode, another capacitor, a short circuit in the motor."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Final

from steptwin.features.faults.kinds.harm import AxisHarm, Key, KeyKind, keyed
from steptwin.host.common.errors import InputError
from steptwin.protocol.drivers import ChipSheet, one_of
from steptwin.protocol.od import MICROSTEPS_CHOICES

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board
    from steptwin.emulator.board.environment import BoardEnvironment
    from steptwin.emulator.simulation import Simulation

OSC_MIN_PF: Final = 64
"""Smallest capacitor at OSC, in whole pF, with which the chip's oscillator keeps to its limit."""


def _chip(simulation: "Simulation", number: int, axis: int) -> ChipSheet:
    return simulation.boards[number].drivers.drivers[axis].module.chip


@dataclass(frozen=True, slots=True)
class DriverProtect(AxisHarm):
    """A driver's Protect pin is held low from outside, as a chip in thermal shutdown does itself, or released."""

    do: ClassVar[str] = "protect"
    does: ClassVar[str] = "the Protect pin of a driver is held low, as by a chip that is too hot, or released"

    active: bool = field(metadata=keyed(Key("held", KeyKind.TRUTH)))

    def check(self, simulation: "Simulation", number: int) -> None:
        """Raise InputError unless the driver's chip has such a pin."""
        chip = _chip(simulation, number, self.axis)
        if chip.fault_output is None:
            raise InputError(f"{chip.name} has no pin that tells of a fault; a TB6560, a DRV8825 and Trinamic's have")

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Hold the pin, or release it."""
        board.hold_protect(self.axis, held=self.active)

    def undo(self, before: "BoardEnvironment") -> "DriverProtect":
        """Return the pin as it was."""
        return DriverProtect(self.axis, before.axes[self.axis].protect_held)


@dataclass(frozen=True, slots=True)
class DriverMode(AxisHarm):
    """A driver gets another microstep mode, by its switches or by the chip's pins M1 and M2.

    Attributes:
        microsteps: microsteps per full step; None: as the board has it, or the switches had it at power-up.
    """

    do: ClassVar[str] = "mode"
    does: ClassVar[str] = "a driver is set to another microstep mode, or as it was"
    ends: ClassVar[str] = "`mode {joint}`"
    end_values: ClassVar[Mapping[str, Any]] = {"microsteps": None}

    microsteps: int | None = field(
        default=None,
        metadata=keyed(
            Key("microsteps", KeyKind.WHOLE, "N", choices={each: each for each in MICROSTEPS_CHOICES}, optional=True)
        ),
    )

    def __post_init__(self) -> None:
        if self.microsteps is not None and self.microsteps not in MICROSTEPS_CHOICES:
            raise ValueError(f"microsteps {self.microsteps} is not one of {', '.join(map(str, MICROSTEPS_CHOICES))}")

    def check(self, simulation: "Simulation", number: int) -> None:
        """Raise InputError unless the driver's chip has the mode."""
        if self.microsteps is None:
            return
        chip = _chip(simulation, number, self.axis)
        try:
            one_of(self.microsteps, chip.microsteps, f"{chip.name}'s")
        except ValueError as error:
            raise InputError(f"microsteps: {error}") from error

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Set the mode at the start of the next tick."""
        board.set_driver_mode(self.axis, self.microsteps)

    def undo(self, _before: "BoardEnvironment") -> "DriverMode":
        """Return the mode at power-up."""
        return DriverMode(self.axis, None)


@dataclass(frozen=True, slots=True)
class OscCapacitor(AxisHarm):
    """The capacitor at a driver chip's OSC pin has another value, as one that has aged or is the wrong one.

    It sets the chopping rate and the shortest pulse that counts.
    """

    do: ClassVar[str] = "osc"
    does: ClassVar[str] = "the capacitor at a driver chip's OSC pin has another value"
    ends: ClassVar[str] = "`osc {joint}` with the capacitor of before"
    over: ClassVar[str] = "the part stays as it is"

    osc_pf: float = field(metadata=keyed(Key("osc_pf", KeyKind.NUMBER, "PF", OSC_MIN_PF, 1e6, "pF")))

    def check(self, simulation: "Simulation", number: int) -> None:
        """Raise InputError unless the driver's chip has such a capacitor."""
        chip = _chip(simulation, number, self.axis)
        if chip.oscillator is None:
            raise InputError(f"{chip.name} has no capacitor at OSC; a TB6560 has")

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Exchange the capacitor at the start of the next tick."""
        board.drain()
        board.drivers.change_capacitor(self.axis, self.osc_pf)


@dataclass(frozen=True, slots=True)
class ShortCircuit(AxisHarm):
    """A motor is short-circuited, from one phase to the other or to ground, or whole again.

    A driver with a protection switches itself off as soon as current flows, until what its source says; another one is
    destroyed.
    """

    do: ClassVar[str] = "short-circuit"
    does: ClassVar[str] = "a motor is short-circuited, or whole again: its driver switches itself off, and stays so"
    ends: ClassVar[str] = "`short-circuit {joint} off`"
    end_values: ClassVar[Mapping[str, Any]] = {"shorted": False}

    shorted: bool = field(metadata=keyed(Key("shorted", KeyKind.TRUTH)))

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Short the motor at the start of the next tick, or repair it."""
        board.short(self.axis, shorted=self.shorted)

    def undo(self, before: "BoardEnvironment") -> "ShortCircuit":
        """Return the motor as it was; its driver is not."""
        return ShortCircuit(self.axis, before.axes[self.axis].shorted)


DRIVERS: Final = (DriverProtect, DriverMode, OscCapacitor, ShortCircuit)
"""The family, in the order of help and docs."""
