"""How the host of an embedded board is at present: what a scenario has made of the program that drives the machine."""

from dataclasses import dataclass, field

from steptwin.host.twin.scenarios.harms import HostFault


@dataclass(slots=True)
class HostCondition:
    """The faults of the host that last, each with the instant of its beginning."""

    faults: list[tuple[int, HostFault]] = field(default_factory=list)

    def begin(self, fault: HostFault, now_counts: int) -> None:
        """Let a fault begin."""
        self.faults.append((now_counts, fault))

    def end(self, fault: HostFault) -> None:
        """Let it end."""
        self.faults = [each for each in self.faults if each[1] is not fault]
