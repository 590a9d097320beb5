"""A scenario: the faults that happen in a run, as data. The same scenario on the same run gives the same bytes."""

from dataclasses import dataclass, replace
from random import Random

from steptwin.host.twin.scenarios.harms import Harm, HostFault
from steptwin.host.twin.scenarios.reaction import Reaction
from steptwin.host.twin.scenarios.triggers import AtRandom, Trigger


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault.

    Attributes:
        name: what reports call it; unique in its scenario.
        trigger: what starts it.
        harm: what it does.
        until: what ends it; a number is seconds from its start; None: it lasts until the run's end.
        expected: the reaction that is right, where the documented one is not (`reactions.documented`).
    """

    name: str
    trigger: Trigger
    harm: Harm
    until: Trigger | float | None = None
    expected: Reaction | None = None


@dataclass(frozen=True, slots=True)
class Scenario:
    """Faults, and the seed of everything in them that is random.

    Raises:
        ValueError: two faults have the same name.
    """

    name: str
    faults: tuple[Fault, ...]
    seed: int = 0

    def __post_init__(self) -> None:
        names = [fault.name for fault in self.faults]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"two faults are called {twice[0]!r}")

    @property
    def harms_host(self) -> bool:
        """True if a fault concerns the host, which a board in real time does not have."""
        return any(isinstance(fault.harm, HostFault) for fault in self.faults)

    def drawn(self) -> "Scenario":
        """Return the scenario with a time in place of each random one: a fault's own, whatever other faults there are.

        So a fault keeps its instant when others are taken out.
        """
        return replace(self, faults=tuple(self._drawn(fault) for fault in self.faults))

    def _drawn(self, fault: Fault) -> Fault:
        random = Random(f"{self.seed} {fault.name}")
        trigger, until = fault.trigger, fault.until
        if isinstance(trigger, AtRandom):
            trigger = trigger.drawn(random)
        if isinstance(until, AtRandom):
            until = until.drawn(random)
        return replace(fault, trigger=trigger, until=until)
