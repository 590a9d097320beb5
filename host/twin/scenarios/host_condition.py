"""How the host of an embedded board is at present: what a scenario has made of the program that drives the machine."""

from dataclasses import dataclass, field

from steptwin.host.common.errors import BusError
from steptwin.host.twin.scenarios.harms import HostFault, HostFaultKind
from steptwin.protocol.timer import COUNTS_PER_SECOND


class HostLostError(BusError):
    """The host's program ends here, as a scenario wants it: it does nothing any more."""


@dataclass(slots=True)
class HostCondition:
    """The faults of the host that last.

    Attributes:
        dead: whether it has ended and sends nothing any more.
        restart_counts: instant at which another one takes over; None: none does.
    """

    dead: bool = False
    restart_counts: int | None = None
    _lasting: list[tuple[HostFault, bool]] = field(default_factory=list)
    """The others, and whether a time is known at which each ends."""

    def begin(self, fault: HostFault, now_counts: int, *, ends: bool = False) -> None:
        """Let a fault begin; `ends`: a time is known at which it ends."""
        if fault.kind in (HostFaultKind.DEATH, HostFaultKind.RESTART):
            self.dead = True
            if fault.kind is HostFaultKind.RESTART:
                self.restart_counts = now_counts + round(fault.by_s * COUNTS_PER_SECOND)
        else:
            self._lasting.append((fault, ends))

    def end(self, fault: HostFault) -> None:
        """Let this very fault end; a dead host stays dead."""
        self._lasting = [each for each in self._lasting if each[0] is not fault]

    def _of(self, kind: HostFaultKind) -> list[tuple[HostFault, bool]]:
        return [each for each in self._lasting if each[0].kind is kind]

    @property
    def hangs(self) -> bool:
        """Whether the program stands still."""
        return bool(self._of(HostFaultKind.HANG))

    @property
    def goes_on(self) -> bool:
        """Whether a program that stands still is known to go on."""
        return all(ends for _, ends in self._of(HostFaultKind.HANG))

    @property
    def late_s(self) -> float:
        """What each of its waits takes longer."""
        return sum(fault.by_s for fault, _ in self._of(HostFaultKind.LATE))

    @property
    def disordered(self) -> bool:
        """Whether it sends points out of order."""
        return bool(self._of(HostFaultKind.DISORDER))
