"""Faults of the host, the program that drives the machine; only scenarios have them."""

from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from typing import TYPE_CHECKING, Annotated, Final

from steptwin.features.faults.fault import Fault, Key
from steptwin.features.faults.reaction import (
    HEARTBEAT_MS,
    HOST_LOST,
    QUEUE_MS,
    RUN_DRY,
    Documented,
    MotionEffect,
    Reaction,
    stops,
)
from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import State
from steptwin.protocol.timer import COUNTS_PER_SECOND

if TYPE_CHECKING:
    from steptwin.emulator.simulation import Simulation
    from steptwin.features.faults.engine import Engine

NO_HOST: Final = "'host' is for runs in virtual time; hosts of a live board are programs of their own"


class HostFaultKind(StrEnum):
    """Faults of the host, the program that drives the machine."""

    HANG = "hang"
    """The program stops working; the bus interface goes on with its heartbeat."""
    DEATH = "death"
    """The program and its heartbeat end; no more frames come."""
    RESTART = "restart"
    """The program ends; after a time another one takes the machine over, resets its faults and enables it again."""
    LATE = "late"
    """Each of its waits lasts longer, as on a slow computer."""
    DISORDER = "disorder"
    """Every second point of an axis is sent after the next point."""


_TIMED: Final = (HostFaultKind.HANG, HostFaultKind.RESTART, HostFaultKind.LATE)
"""Faults of the host with a time."""
_ENDING: Final = (HostFaultKind.HANG, HostFaultKind.LATE, HostFaultKind.DISORDER)
"""Faults of the host that a scenario may end."""


@dataclass(frozen=True, slots=True)
class HostFault(Fault):
    """Something goes wrong with the host: only in scenarios.

    Attributes:
        kind: what goes wrong.
        by_s: duration of a HANG (0: until the fault ends), time until a RESTART, or extra time of each wait of a LATE
            host.

    Raises:
        ValueError: a time is missing, negative, or not used by this kind.
    """

    do = "host"
    once = True
    reactions = (
        Documented(
            "host hangs, its heartbeat goes on",
            stops(*RUN_DRY, begins_ms=QUEUE_MS, certain=False),
            "the queues bridge it, up to the points that are in them",
            lambda fault, _: fault.kind is HostFaultKind.HANG,
        ),
        Documented(
            "host dies",
            stops(*HOST_LOST, begins_ms=HEARTBEAT_MS),
            "records of less than 6 ms run out before the heartbeat is missed",
            lambda fault, _: fault.kind is HostFaultKind.DEATH,
        ),
        Documented(
            "host dies and starts again",
            Reaction(MotionEffect.RAMP, HOST_LOST, State.OPERATION_ENABLED, HEARTBEAT_MS, certain=False),
            "the new one waits for rest, resets the fault and enables the drives; the motion is not continued",
            lambda fault, _: fault.kind is HostFaultKind.RESTART,
        ),
        Documented(
            "host is late",
            stops(*RUN_DRY, begins_ms=inf, certain=False),
            "the queues bridge it, up to the points that are in them",
            lambda fault, _: fault.kind is HostFaultKind.LATE,
        ),
        Documented(
            "host sends points out of order",
            stops(*RUN_DRY, begins_ms=inf, certain=False),
            "the board reports each gap and the host sends the points again; if it lasts, the queues run dry",
        ),
    )

    kind: Annotated[HostFaultKind, Key("how")]
    by_s: Annotated[float, Key(metavar="SECONDS", least=0, most=86_400.0, unit="s", written=True)] = 0.0

    def __post_init__(self) -> None:
        if self.by_s < 0:
            raise ValueError(f"by_s: {self.by_s:g} s is below 0")
        if self.by_s and self.kind not in _TIMED:
            raise ValueError(f"by_s: is for {', '.join(_TIMED)}, not for {self.kind}")
        if self.kind is HostFaultKind.LATE and not self.by_s:
            raise ValueError(f"by_s: a host that is {self.kind} by 0 s is not: say by how much, such as 0.05")

    def apply(self, _simulation: "Simulation", _number: int) -> None:
        """Raise InputError: only the engine of a scenario knows the host."""
        raise InputError(f"do: {NO_HOST.replace('runs', 'scenarios of runs')}")

    def begin(self, engine: "Engine", *, ends: bool) -> None:
        engine.host.begin(self, engine.target.simulation.now_counts, ends=ends)

    def end(self, engine: "Engine") -> None:
        engine.host.end(self)

    @property
    def lasts_s(self) -> float | None:
        """Duration of its hang, if known."""
        return (self.by_s or None) if self.kind is HostFaultKind.HANG else None

    def why_endless(self) -> str | None:
        if self.kind in _ENDING and not self.lasts_s:
            return None
        return "the host is gone" if self.kind is HostFaultKind.DEATH else "by_s says how long it lasts"


@dataclass(slots=True)
class HostCondition:
    """Lasting faults of the host.

    Attributes:
        dead: True if it has ended and sends nothing any more.
        restart_counts: instant when another host takes over; None: none does.
    """

    dead: bool = False
    restart_counts: int | None = None
    _lasting: list[tuple[HostFault, bool]] = field(default_factory=list)
    """Other faults, and whether the end of each is known."""

    def begin(self, fault: HostFault, now_counts: int, *, ends: bool = False) -> None:
        """Begin a fault; `ends` is True if its end is known."""
        if fault.kind in (HostFaultKind.DEATH, HostFaultKind.RESTART):
            self.dead = True
            if fault.kind is HostFaultKind.RESTART:
                self.restart_counts = now_counts + round(fault.by_s * COUNTS_PER_SECOND)
        else:
            self._lasting.append((fault, ends))

    def end(self, fault: HostFault) -> None:
        """End this very fault; a dead host stays dead."""
        self._lasting = [each for each in self._lasting if each[0] is not fault]

    def _of(self, kind: HostFaultKind) -> list[tuple[HostFault, bool]]:
        return [each for each in self._lasting if each[0].kind is kind]

    @property
    def hangs(self) -> bool:
        """True while the program hangs."""
        return bool(self._of(HostFaultKind.HANG))

    @property
    def goes_on(self) -> bool:
        """True if a hanging program is known to continue."""
        return all(ends for _, ends in self._of(HostFaultKind.HANG))

    @property
    def late_s(self) -> float:
        """Extra time of each of its waits."""
        return sum(fault.by_s for fault, _ in self._of(HostFaultKind.LATE))

    @property
    def disordered(self) -> bool:
        """True while it sends points out of order."""
        return bool(self._of(HostFaultKind.DISORDER))
