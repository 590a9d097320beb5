"""How the host of an embedded board is at present: what a scenario has made of the program that drives the machine."""

from dataclasses import dataclass

from steptwin.host.common.errors import BusError
from steptwin.host.twin.scenarios.harms import HostFault, HostFaultKind
from steptwin.protocol.timer import COUNTS_PER_SECOND


class HostLostError(BusError):
    """The host's program ends here, as a scenario wants it: it does nothing any more."""


@dataclass(slots=True)
class HostCondition:
    """The faults of the host that last.

    Attributes:
        hangs: whether the program stands still.
        dead: whether it has ended and sends nothing any more.
        restart_counts: instant at which another one takes over; None: none does.
        late_s: what each of its waits takes longer.
        disordered: whether it sends points out of order.
    """

    hangs: bool = False
    dead: bool = False
    restart_counts: int | None = None
    late_s: float = 0.0
    disordered: bool = False

    def begin(self, fault: HostFault, now_counts: int) -> None:
        """Let a fault begin."""
        match fault.kind:
            case HostFaultKind.HANG:
                self.hangs = True
            case HostFaultKind.DEATH:
                self.dead = True
            case HostFaultKind.RESTART:
                self.dead = True
                self.restart_counts = now_counts + round(fault.by_s * COUNTS_PER_SECOND)
            case HostFaultKind.LATE:
                self.late_s = fault.by_s
            case HostFaultKind.DISORDER:
                self.disordered = True

    def end(self, fault: HostFault) -> None:
        """Let a fault end that may."""
        match fault.kind:
            case HostFaultKind.HANG:
                self.hangs = False
            case HostFaultKind.LATE:
                self.late_s = 0.0
            case HostFaultKind.DISORDER:
                self.disordered = False
            case _:
                pass
