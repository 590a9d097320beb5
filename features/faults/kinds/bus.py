"""Harms to the bus: frames lost, disturbed, doubled or delayed, stations that leave it, and strangers on it.

Which frames a fault strikes and how often is data: equal faults and seeds give equal strikes.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Final

from steptwin.emulator.bus.frame_filter import StrikeEffect
from steptwin.emulator.operations import Consequence, Operation
from steptwin.features.faults.kinds.harm import JOINT, Harm, Key, KeyKind, MachineHarm, keyed
from steptwin.host.common.errors import InputError
from steptwin.protocol.frame import BITRATES, COB_ID_MASK, Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND, COUNTS_PER_US

if TYPE_CHECKING:
    from steptwin.emulator.board.environment import BoardEnvironment
    from steptwin.emulator.simulation import Simulation

DELAY_MAX_S: Final = 86_400.0
"""Longest time by which frames are delayed: a day."""
_OPTIONAL_COUNT: Final = Key("count", KeyKind.WHOLE, "N", least=0, optional=True)


@dataclass(frozen=True, slots=True)
class BusFault(Harm):
    """A fault that strikes the attempts to send which fulfil all its conditions, from its beginning to its end.

    It is the bus' `FrameFilter`.

    Attributes:
        cob_ids: identifiers of the frames that it may strike.
        rate: part of the attempts that it strikes, 0 to 1, drawn from the bus' seeded generator.
        skip: number of attempts that it lets pass first.
        count: greatest number of strikes; None for no limit.
    """

    once: ClassVar[bool] = True

    cob_ids: Collection[int] = field(
        default=range(COB_ID_MASK + 1),
        metadata=keyed(
            Key("frames", KeyKind.FRAMES),
            replace(JOINT, optional=True),
            join=lambda ids, _axis: ids,
            split=lambda ids: (ids, None),
        ),
    )
    rate: float = field(default=1.0, metadata=keyed(Key("rate", KeyKind.NUMBER, "PART", 0, 1, optional=True)))
    skip: int = field(default=0, metadata=keyed(replace(_OPTIONAL_COUNT, name="skip")))
    count: int | None = field(default=None, metadata=keyed(_OPTIONAL_COUNT))

    def effect(self) -> StrikeEffect:
        """Return what a strike does; each fault has its own."""
        raise NotImplementedError

    def apply(self, simulation: "Simulation", _number: int) -> None:
        """Let it strike from now on, until the bus ends it."""
        simulation.bus.filters.begin(self)

    def why_endless(self) -> None:
        """Return None: `Bus.end_filter` ends it."""

    @classmethod
    def ends_by(cls, values: Mapping[str, Any]) -> str:
        """Return what ends it."""
        return f"strike {values['count']} or `{BusRepair.do}`" if "count" in values else f"`{BusRepair.do}`"


@dataclass(frozen=True, slots=True)
class FrameLoss(BusFault):
    """The frame is sent and acknowledged, but does not reach its receivers' processors; no station notices.

    Attributes:
        receiver: the only station that it concerns, by its place on the bus: 0 the host, 1 the first board; None for
            all.
    """

    do: ClassVar[str] = "loss"
    does: ClassVar[str] = "frames are acknowledged and do not arrive"

    receiver: int | None = field(default=None, metadata=keyed(replace(_OPTIONAL_COUNT, name="receiver")))

    def check(self, simulation: "Simulation", _number: int) -> None:
        """Raise InputError unless there is such a receiver."""
        boards = len(simulation.boards)
        if self.receiver is not None and self.receiver > boards:
            raise InputError(f"receiver: {self.receiver} is not from 0 to {boards}, the number of boards")

    def effect(self) -> StrikeEffect:
        """Let the frame not arrive."""
        return StrikeEffect(lost_by=slice(None) if self.receiver is None else slice(self.receiver, self.receiver + 1))


@dataclass(frozen=True, slots=True)
class FrameCorruption(BusFault):
    """The frame is disturbed: an error frame follows, error counters rise, the sender tries again."""

    do: ClassVar[str] = "corruption"
    does: ClassVar[str] = "frames are disturbed: CAN sends them again"

    def effect(self) -> StrikeEffect:
        """Disturb the frame."""
        return StrikeEffect(disturbed=True)


@dataclass(frozen=True, slots=True)
class FrameDuplicate(BusFault):
    """The last bit of the frame is disturbed: its receivers have taken it, but the sender sends it again.

    A frame is doubled only once.
    """

    do: ClassVar[str] = "duplicate"
    does: ClassVar[str] = "frames come twice, as after an error in their last bit"

    def effect(self) -> StrikeEffect:
        """Disturb the frame's last bit."""
        return StrikeEffect(doubled=True)


@dataclass(frozen=True, slots=True)
class FrameDelay(BusFault):
    """The sender waits for a time before it takes part in the arbitration. A frame is delayed only once."""

    do: ClassVar[str] = "delay"
    does: ClassVar[str] = "the sender of a frame waits before it sends it"

    delay_counts: int = field(
        kw_only=True,
        metadata=keyed(Key("by_s", KeyKind.NUMBER, "SECONDS", 1e-6, DELAY_MAX_S, "s", parts=COUNTS_PER_SECOND)),
    )

    def effect(self) -> StrikeEffect:
        """Let the senders wait."""
        return StrikeEffect(hold_counts=self.delay_counts)


@dataclass(frozen=True, slots=True)
class SenderOff(BusFault):
    """The sender goes into bus-off, as after 32 disturbed attempts in a row, and sends the frame after it."""

    do: ClassVar[str] = "sender-off"
    does: ClassVar[str] = "the sender of a frame goes into bus-off, and sends it afterwards"

    def effect(self) -> StrikeEffect:
        """Put the senders into bus-off."""
        return StrikeEffect(sender_off=True)


@dataclass(frozen=True, slots=True)
class BusRepair(Harm):
    """All faults of the bus end, and a stranger's babble."""

    do: ClassVar[str] = "bus-ok"
    does: ClassVar[str] = "all faults of the bus end, and so does babble; the host has the boards' bit rate"
    once: ClassVar[bool] = True

    def apply(self, simulation: "Simulation", _number: int) -> None:
        """End them now; let the host have the first board's bit rate."""
        simulation.bus.end_filters(simulation.now_counts)
        simulation.cancel(_babbles)
        bitrate = simulation.boards[0].can.bitrate
        if bitrate is not None and bitrate != simulation.bus.host_bitrate:
            simulation.operate(HostBitRate(bitrate))


@dataclass(frozen=True, slots=True)
class BusOff(MachineHarm):
    """A CAN controller leaves the bus, as after too many errors, and returns after the recessive bits that it needs.

    Attributes:
        axis: an axis of the board whose controller it is; None: the host's interface.
    """

    do: ClassVar[str] = "bus-off"
    does: ClassVar[str] = "the board of a joint, or without `joint` the host, goes into bus-off"
    once: ClassVar[bool] = True

    axis: int | None = field(default=None, metadata=keyed(Key("joint", KeyKind.STATION, optional=True)))

    def apply(self, simulation: "Simulation", number: int) -> None:
        """Throw the station off the bus."""
        station = simulation.host if self.axis is None else simulation.boards[number].can
        simulation.bus.throw_off(station, simulation.now_counts)


@dataclass(frozen=True, slots=True)
class HostBitRate(MachineHarm):
    """The host's adapter is opened with another bit rate: the boards that have none of it take its frames for errors.

    Attributes:
        bitrate: in bit/s.
    """

    do: ClassVar[str] = "bit-rate"
    does: ClassVar[str] = "the host's CAN adapter has another bit rate from now on"
    ends: ClassVar[str] = "`bit-rate` with that of the boards, or `bus-ok`"
    once: ClassVar[bool] = True

    bitrate: int = field(metadata=keyed(Key("bitrate", KeyKind.WHOLE, choices={each: each for each in BITRATES})))

    def __post_init__(self) -> None:
        if self.bitrate not in BITRATES:
            raise ValueError(f"bitrate {self.bitrate} is not one of {', '.join(map(str, BITRATES))}")

    def apply(self, simulation: "Simulation", _number: int) -> None:
        """Open the adapter again."""
        simulation.bus.set_host_bitrate(simulation.host, self.bitrate)

    def undo(self, before: "BoardEnvironment") -> "HostBitRate | None":
        """Return the board's bit rate."""
        return None if before.bitrate is None else HostBitRate(before.bitrate)


_FRAME: Final = keyed(Key("id", KeyKind.IDENTIFIER), Key("data", KeyKind.BYTES), join=Frame, split=tuple)


@dataclass(frozen=True, slots=True)
class StrangerSends(MachineHarm):
    """A station that is no part of the machine, such as a second master, sends a frame."""

    do: ClassVar[str] = "stranger"
    does: ClassVar[str] = "a foreign station, such as a second master, sends a frame"
    once: ClassVar[bool] = True

    frame: Frame = field(metadata=_FRAME)

    def apply(self, simulation: "Simulation", _number: int) -> None:
        """Send the frame."""
        simulation.rogue_node.send(self.frame, simulation.now_counts)


BABBLE_US: Final = 47, 10_000_000
"""From the duration of the shortest frame at 1 Mbit/s, which fills the bus, to 10 s."""
BABBLE_COUNT_MAX: Final = 1_000_000
"""Most frames of a babble: 47 s of a full bus."""
_BABBLE_AHEAD: Final = 2
"""Frames that the station has waiting, so that it always has one for the next arbitration."""


@dataclass(frozen=True, slots=True)
class Babble(MachineHarm):
    """The stranger sends a frame again and again, also before the one before it has found its way.

    Attributes:
        frame: the frame.
        period_us: time from one to the next; it is left out while two wait.
        count: number of times; 0: it does not send this frame any more.
    """

    do: ClassVar[str] = "babble"
    does: ClassVar[str] = "the same station sends a frame again and again, up to 1000000 times; 0: no more"
    once: ClassVar[bool] = True

    frame: Frame = field(metadata=_FRAME)
    period_us: int = field(metadata=keyed(Key("period_us", KeyKind.WHOLE, "PERIOD_US", *BABBLE_US)))
    count: int = field(metadata=keyed(Key("count", KeyKind.WHOLE, "COUNT", 0, BABBLE_COUNT_MAX)))

    def apply(self, simulation: "Simulation", number: int) -> None:
        """Send the frame unless two wait, and again a period later; end what has begun if it is not to be sent."""
        if not self.count:
            simulation.cancel(partial(_babbles, frame=self.frame))
            return
        if simulation.rogue_node.waiting < _BABBLE_AHEAD:
            simulation.rogue_node.send(self.frame, simulation.now_counts)
        if self.count > 1:
            next_counts = simulation.now_counts + self.period_us * COUNTS_PER_US
            simulation.schedule([Consequence(next_counts, replace(self, count=self.count - 1), number)])

    def undo(self, _before: object) -> "Babble":
        """Return the end of it."""
        return replace(self, count=0)

    @classmethod
    def ends_by(cls, values: Mapping[str, Any]) -> str | None:
        """Return what ends it."""
        return f"{values['period_us'] * values['count'] / 1e6:g} s or `{BusRepair.do}`" if values["count"] else None


def _babbles(operation: Operation, frame: Frame | None = None) -> bool:
    """Return whether an operation is a babble of this frame; None: of any."""
    return isinstance(operation, Babble) and frame in (None, operation.frame)


BUS: Final = (
    StrangerSends,
    Babble,
    FrameLoss,
    FrameCorruption,
    FrameDuplicate,
    FrameDelay,
    SenderOff,
    BusOff,
    HostBitRate,
    BusRepair,
)
"""The family, in the order of help and docs."""
