"""Scripted faults of the bus, as data: which frames, from when to when, how often. Equal scripts give equal faults."""

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from enum import Enum
from random import Random

from steptwin.protocol.frame import COB_ID_MASK, Frame


class BusFaultKind(Enum):
    """Effect of a fault on an attempt to send a frame."""

    LOSS = "loss"
    """The frame is sent and acknowledged, but does not reach its receivers' processors; no station notices."""
    CORRUPTION = "corruption"
    """The frame is disturbed: an error frame follows, error counters rise, the sender tries again."""
    DUPLICATE = "duplicate"
    """The last bit of the frame is disturbed: its receivers have taken it, but the sender sends it again. A frame is
    doubled only once."""
    DELAY = "delay"
    """The sender waits before it takes part in the arbitration. A frame is delayed only once."""
    BUS_OFF = "bus-off"
    """The sender goes into bus-off, as after 32 disturbed attempts in a row, and sends the frame after it."""


@dataclass(frozen=True, slots=True)
class BusFault:
    """One line of the script. It strikes the attempts to send that fulfil all its conditions.

    Attributes:
        kind: its effect.
        cob_ids: identifiers of the frames that it may strike.
        from_counts: first instant at which it may strike.
        until_counts: first instant at which it can no longer strike; None for no end.
        rate: part of the attempts that it strikes, 0 to 1, drawn from the script's seeded generator.
        skip: number of attempts that it lets pass first.
        count: greatest number of strikes; None for no limit.
        delay_counts: time for which a DELAY makes the sender wait.
        receiver: the only station that a LOSS concerns, by its place on the bus: 0 the host, 1 the first board; None
            for all.
    """

    kind: BusFaultKind
    cob_ids: Container[int] = range(COB_ID_MASK + 1)
    from_counts: int = 0
    until_counts: int | None = None
    rate: float = 1.0
    skip: int = 0
    count: int | None = None
    delay_counts: int = 0
    receiver: int | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.rate <= 1:
            raise ValueError(f"rate: {self.rate:g} is not from 0 to 1")
        if self.kind is BusFaultKind.DELAY and self.delay_counts <= 0:
            raise ValueError(f"delay_counts: {self.delay_counts} is not above 0")

    def concerns(self, frame: Frame, now_counts: int) -> bool:
        """Return True if the fault may strike a frame with this identifier at this time."""
        if now_counts < self.from_counts or (self.until_counts is not None and now_counts >= self.until_counts):
            return False
        return frame.cob_id in self.cob_ids


class FaultScript:
    """Faults in the order in which they are tried, and the record of their strikes."""

    def __init__(self, faults: Sequence[BusFault] = (), seed: int = 0) -> None:
        self.faults = list(faults)
        """The faults that may strike, in the order in which they are tried."""
        self.struck: list[tuple[int, BusFault, Frame]] = []
        """Every strike: instant, fault and frame."""
        self.on_strike: Callable[[int, BusFault], None] = lambda _now_counts, _fault: None
        """Called at each strike."""
        self._random = Random(seed)
        self._concerned = [0] * len(self.faults)
        self._strikes = [0] * len(self.faults)

    def begin(self, fault: BusFault) -> None:
        """Try a further fault from now on, after those that are there."""
        self.faults.append(fault)
        self._concerned.append(0)
        self._strikes.append(0)

    def end(self, fault: BusFault) -> None:
        """Try this very fault no more; one that is not there, or an equal one, changes nothing."""
        for number, each in enumerate(self.faults):
            if each is fault:
                for of_each in (self.faults, self._concerned, self._strikes):
                    del of_each[number]
                return

    def end_all(self) -> None:
        """Try no fault any more."""
        for of_each in (self.faults, self._concerned, self._strikes):
            of_each.clear()

    def reseed(self, seed: int) -> None:
        """Draw from another seed from now on."""
        self._random = Random(seed)

    def strike(self, frame: Frame, now_counts: int, had: Container[BusFaultKind] = ()) -> BusFault | None:
        """Return the fault that strikes an attempt to send, or None: none of the kinds that the frame has had."""
        for number, fault in enumerate(self.faults):
            if fault.kind in had:
                continue
            if fault.concerns(frame, now_counts) and self._chosen(number, fault):
                self.struck.append((now_counts, fault, frame))
                self.on_strike(now_counts, fault)
                return fault
        return None

    def _chosen(self, number: int, fault: BusFault) -> bool:
        self._concerned[number] += 1
        if self._concerned[number] <= fault.skip or self._strikes[number] == fault.count:
            return False
        if fault.rate < 1 and self._random.random() >= fault.rate:
            return False
        self._strikes[number] += 1
        return True
