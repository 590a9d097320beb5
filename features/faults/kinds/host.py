"""Harms to the host, the program that drives the machine; only scenarios ask for them."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, ClassVar, Final

from steptwin.features.faults.kinds.harm import Harm, Key, KeyKind, keyed
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.emulator.simulation import Simulation

NO_HOST: Final = "'host' is for runs in virtual time; hosts of a live board are programs of their own"
_NOT_ASKED: Final = "'host' is for scenarios of runs in virtual time; hosts of a live board are programs of their own"
BY_MAX_S: Final = 86_400.0
"""Longest time of a fault: a day."""


class HostFaultKind(StrEnum):
    """What goes wrong with the host, the program that drives the machine."""

    HANG = "hang"
    """The program stands still; the bus interface goes on with its heartbeat."""
    DEATH = "death"
    """The program and its heartbeat end; no frame comes any more."""
    RESTART = "restart"
    """It dies; after a time another one takes the machine over, resets its faults and enables it again."""
    LATE = "late"
    """Each of its waits lasts longer, as on a computer that is too slow."""
    DISORDER = "disorder"
    """Each second point of an axis is sent after the point that follows it."""


_TIMED: Final = (HostFaultKind.HANG, HostFaultKind.RESTART, HostFaultKind.LATE)
"""Faults of the host that have a time."""
_ENDING: Final = (HostFaultKind.HANG, HostFaultKind.LATE, HostFaultKind.DISORDER)
"""Faults of the host that a scenario may end."""


@dataclass(frozen=True, slots=True)
class HostFault(Harm):
    """A fault of the host.

    Attributes:
        kind: what goes wrong.
        by_s: duration of a HANG (0: until the fault ends), time until a RESTART, or what each wait of a LATE host takes
            longer.

    Raises:
        ValueError: a time is missing, negative, or means nothing for this kind.
    """

    do: ClassVar[str] = "host"
    does: ClassVar[str] = "something goes wrong with the host: only in scenarios"
    once: ClassVar[bool] = True

    kind: HostFaultKind = field(
        metadata=keyed(Key("how", KeyKind.WORD, choices={each.value: each for each in HostFaultKind}))
    )
    by_s: float = field(
        default=0.0, metadata=keyed(Key("by_s", KeyKind.NUMBER, "SECONDS", 0, BY_MAX_S, "s", optional=True, told=True))
    )

    def __post_init__(self) -> None:
        if self.by_s < 0:
            raise ValueError(f"by_s: {self.by_s:g} s is below 0")
        if self.by_s and self.kind not in _TIMED:
            raise ValueError(f"by_s: is for {', '.join(_TIMED)}, not for {self.kind}")
        if self.kind is HostFaultKind.LATE and not self.by_s:
            raise ValueError(f"by_s: a host that is {self.kind} by 0 s is not: say by how much, such as 0.05")

    def apply(self, _simulation: "Simulation", _number: int) -> None:
        """Raise InputError: only the engine of a scenario knows the host."""
        raise InputError(f"do: {_NOT_ASKED}")

    def why_endless(self) -> str | None:
        """Return why a scenario cannot end it; None if it can."""
        if self.kind in _ENDING and not (self.kind is HostFaultKind.HANG and self.by_s):
            return None
        return "the host is gone" if self.kind is HostFaultKind.DEATH else "by_s says how long it lasts"


HOST: Final = (HostFault,)
"""The family."""
