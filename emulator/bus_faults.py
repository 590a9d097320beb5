"""Scripted faults of the bus, as data: which frames, from when to when, how often. The same script, the same faults."""

from collections.abc import Container, Sequence
from dataclasses import dataclass
from enum import Enum
from random import Random

from steptwin.protocol.frame import COB_ID_MASK, Frame


class BusFaultKind(Enum):
    """What happens to an attempt to send a frame."""

    LOSS = "loss"
    """The frame passes and is acknowledged, but does not reach its receivers' processors: nobody notices."""
    CORRUPTION = "corruption"
    """A disturbance: an error frame follows, counters move, the sender tries again."""
    DELAY = "delay"
    """The sender's controller is held up before it takes part in the arbitration; once for each frame."""
    BUS_OFF = "bus-off"
    """The sender goes into bus-off, as after 32 disturbed attempts in a row; the frame is sent after it is back."""


@dataclass(frozen=True, slots=True)
class BusFault:
    """One line of the script. It strikes attempts to send that fulfil all conditions.

    Attributes:
        kind: what happens.
        cob_ids: whose frames: a range, a set, a tuple of identifiers.
        from_counts: the first instant at which it may strike.
        until_counts: the first instant at which it may no more.
        rate: the part of the attempts that it strikes, drawn from the script's seeded generator.
        skip: how many attempts it lets pass first.
        count: how often it strikes at most.
        delay_counts: how long a DELAY holds the sender up.
        receiver: the only station that a LOSS concerns, by its place on the bus: 0 the host, 1 the first board.
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
        """Whether identifier and time fit."""
        if now_counts < self.from_counts or (self.until_counts is not None and now_counts >= self.until_counts):
            return False
        return frame.cob_id in self.cob_ids


class FaultScript:
    """Faults in the order in which they are asked, with what they have done."""

    def __init__(self, faults: Sequence[BusFault] = (), seed: int = 0) -> None:
        self.faults = tuple(faults)
        self.struck: list[tuple[int, BusFault, Frame]] = []
        """Every strike: when, by which fault, which frame."""
        self._random = Random(seed)
        self._concerned = [0] * len(self.faults)
        self._strikes = [0] * len(self.faults)

    def strike(self, frame: Frame, now_counts: int, *, delayed: bool) -> BusFault | None:
        """The fault that strikes an attempt to send, if any; a frame that was delayed is not delayed again."""
        for number, fault in enumerate(self.faults):
            if delayed and fault.kind is BusFaultKind.DELAY:
                continue
            if fault.concerns(frame, now_counts) and self._chosen(number, fault):
                self.struck.append((now_counts, fault, frame))
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
