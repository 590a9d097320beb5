"""Harms to limit and home switches: one that sticks, a broken wire, a worn contact."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, ClassVar, Final

from steptwin.features.faults.kinds.harm import AxisHarm, Harm, Key, KeyKind, keyed
from steptwin.protocol.cia402 import SWITCH_INPUTS, DigitalInput

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board
    from steptwin.emulator.board.environment import BoardEnvironment

BOUNCES_MAX: Final = 1000
WITHIN_US: Final = 5_000
"""Usual time for which a small switch bounces."""


@dataclass(frozen=True, slots=True)
class SwitchOperation(AxisHarm):
    """An operation on a limit or home switch."""

    switch: DigitalInput = field(metadata=keyed(Key("switch", KeyKind.SWITCH)))

    def __post_init__(self) -> None:
        if self.switch not in SWITCH_INPUTS:
            raise ValueError(f"a switch is one of {', '.join(map(str, SWITCH_INPUTS))}, not {self.switch!r}")


@dataclass(frozen=True, slots=True)
class StuckSwitch(SwitchOperation):
    """A limit or home switch of an axis sticks closed or open wherever the machine is, or is free again (None).

    Closed is active. An input to which no switch is wired can be held closed as well, as by a chafed cable.
    """

    do: ClassVar[str] = "switch"
    does: ClassVar[str] = "a switch `-`, `+` or `home` sticks `closed` or `open`, or is `free`"

    closed: bool | None = field(
        metadata=keyed(Key("stuck", KeyKind.WORD, choices={"closed": True, "open": False, "free": None}))
    )

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Hold the switch, or let it go."""
        board.inputs.stick(self.axis, self.switch, closed=self.closed)

    def undo(self, before: "BoardEnvironment") -> "StuckSwitch":
        """Return that the switch sticks as it did, or is free."""
        axis = before.axes[self.axis]
        closed = bool(axis.levels & self.switch) if axis.stuck & self.switch else None
        return StuckSwitch(self.axis, self.switch, closed)


class Contact(StrEnum):
    """What a switch's contact does while nothing presses the switch, which decides what a broken wire looks like."""

    NORMALLY_OPEN = "normally-open"
    """A broken wire looks like a switch that nothing presses: the input is never active."""
    NORMALLY_CLOSED = "normally-closed"
    """A broken wire looks like a pressed switch: the input is active."""


_WHOLE: Final = "whole"


@dataclass(frozen=True, slots=True)
class SwitchWire(SwitchOperation):
    """The wire of a limit or home switch breaks, or is whole again (None)."""

    do: ClassVar[str] = "switch-wire"
    does: ClassVar[str] = (
        "a switch's wire is `whole`, or broken at a contact that is `normally-open` or `normally-closed`"
    )
    ends: ClassVar[str] = "`switch-wire {joint} {switch} whole`"
    end_values: ClassVar[Mapping[str, Any]] = {"broken": _WHOLE}

    broken: Contact | None = field(
        metadata=keyed(Key("broken", KeyKind.WORD, choices={_WHOLE: None, **{each.value: each for each in Contact}}))
    )

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Cut the wire, or mend it."""
        closed = None if self.broken is None else self.broken is Contact.NORMALLY_CLOSED
        board.inputs.cut(self.axis, self.switch, closed=closed)

    def undo(self, _before: "BoardEnvironment") -> "SwitchWire":
        """Return the whole wire."""
        return SwitchWire(self.axis, self.switch, None)


@dataclass(frozen=True, slots=True)
class BouncingSwitch(SwitchOperation):
    """From now on a limit or home switch bounces each time that it closes or opens.

    Attributes:
        bounces: number of times that it falls back after a change; 0: it does not bounce any more.
        within_us: time within which it does so.
        seed: what the instants are drawn from.
    """

    do: ClassVar[str] = "bounce"
    does: ClassVar[str] = "a switch is worn: it bounces so often with each change, within 5 ms; 0: no more"
    ends: ClassVar[str] = "`bounce {joint} {switch} 0`"
    end_values: ClassVar[Mapping[str, Any]] = {"bounces": 0}

    bounces: int = field(metadata=keyed(Key("bounces", KeyKind.WHOLE, "BOUNCES", least=0, most=BOUNCES_MAX)))
    within_us: int = field(
        default=WITHIN_US, metadata=keyed(Key("within_us", KeyKind.WHOLE, "US", least=1, optional=True, told=True))
    )
    seed: int = field(default=0, metadata=keyed(Key("seed", KeyKind.WHOLE, "SEED", least=0, optional=True)))

    def __post_init__(self) -> None:
        SwitchOperation.__post_init__(self)
        Harm.__post_init__(self)
        if self.within_us < 2 * self.bounces:
            raise ValueError(f"within_us {self.within_us} is too short for {self.bounces} bounces: 2 us for each")

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Let the switch bounce from now on."""
        board.inputs.let_bounce(self.axis, self.switch, self.bounces, self.within_us, self.seed)

    def undo(self, _before: "BoardEnvironment") -> "BouncingSwitch":
        """Return the switch as a new one."""
        return BouncingSwitch(self.axis, self.switch, 0)


SWITCHES: Final = (StuckSwitch, SwitchWire, BouncingSwitch)
"""The family, in the order of help and docs."""
