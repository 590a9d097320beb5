"""Faults of the bus: frames lost, disturbed, doubled or delayed, stations that leave it, and a rogue node on it.

Frames and number of strikes are data: equal faults and seeds give equal strikes.
"""

from abc import abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Annotated, Any, Final

from steptwin.emulator.bus.frame_filter import StrikeEffect
from steptwin.emulator.operations import Consequence, Operation
from steptwin.features.faults.fault import JOINT, Fault, Key, KeyKind, Keys, MachineFault
from steptwin.features.faults.reaction import (
    DEAF_BOARD_MS,
    GOES_ON,
    HEARTBEAT_MS,
    HOST_LOST,
    RUN_DRY,
    TICK_MS,
    Documented,
    MotionEffect,
    Reaction,
    stops,
)
from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import ErrorCode, State
from steptwin.protocol.frame import (
    BITRATES,
    COB_HEARTBEAT,
    COB_ID_MASK,
    COB_NMT,
    COB_SYNC,
    HOST_NODE_ID,
    Frame,
)
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.timer import COUNTS_PER_SECOND, COUNTS_PER_US

if TYPE_CHECKING:
    from steptwin.emulator.board.environment import BoardEnvironment
    from steptwin.emulator.simulation import Simulation
    from steptwin.features.faults.engine import Engine
    from steptwin.features.faults.moment import Moment

_OF_BAD_BUS: Final = (
    *HOST_LOST,
    ErrorCode.CAN_OVERRUN,
    ErrorCode.CAN_ERROR_PASSIVE,
    ErrorCode.CAN_BUS_OFF_RECOVERED,
)
"""Error codes of late or lost frames; the EMCYs themselves may be lost."""

# --- a rogue node


def _to_all(command: NmtCommand) -> "Callable[[RogueFrame | Babble, Moment], bool]":
    """Return the condition that a rogue node sends an NMT command to all nodes."""
    return lambda fault, _: fault.frame == Frame(COB_NMT, bytes((command, 0)))


_ROGUE_FRAMES: Final = (
    Documented(
        "a rogue node stops all nodes (NMT)",
        Reaction(MotionEffect.RAMP, (), State.FAULT, TICK_MS, others=(ErrorCode.COMMUNICATION,)),
        "0x6007 acts; a stopped node sends no EMCY: 0x8100 comes when it is started again",
        _to_all(NmtCommand.STOP),
    ),
    Documented(
        "a rogue node resets the communication of all nodes (NMT)",
        stops(ErrorCode.COMMUNICATION),
        "0x6007 acts; the nodes announce themselves again",
        _to_all(NmtCommand.RESET_COMMUNICATION),
    ),
    Documented(
        "a rogue node resets all nodes (NMT)",
        Reaction(MotionEffect.RAMP, (), State.SWITCH_ON_DISABLED, TICK_MS),
        "0x6007 acts; each node is silent until its axis stands, then starts as after power-up",
        _to_all(NmtCommand.RESET_NODE),
    ),
    Documented(
        "a rogue node sends frames",
        Reaction(
            MotionEffect.GOES_ON,
            (
                *RUN_DRY,
                ErrorCode.COMMUNICATION,
                ErrorCode.HEARTBEAT_LOST,
                ErrorCode.CAN_OVERRUN,
                ErrorCode.CAN_ERROR_PASSIVE,
                ErrorCode.PDO_TOO_SHORT,
                ErrorCode.PDO_TOO_LONG,
            ),
            certain=False,
        ),
        "unless it commands otherwise: a board obeys every station. Babble with a low identifier keeps the points away",
    ),
)

FrameOfKeys = Annotated[Frame, Keys((Key("id", KeyKind.IDENTIFIER), Key("data", KeyKind.BYTES)), Frame, tuple)]


@dataclass(frozen=True, slots=True)
class RogueFrame(MachineFault):
    """A rogue node, such as a second master, sends a frame."""

    do = "rogue-node"
    once = True
    reactions = _ROGUE_FRAMES

    frame: FrameOfKeys

    def apply(self, simulation: "Simulation", _number: int) -> None:
        simulation.rogue_node.send(self.frame, simulation.now_counts)


BABBLE_US: Final = 47, 10_000_000
"""From the duration of the shortest frame at 1 Mbit/s, which fills the bus, to 10 s."""
BABBLE_COUNT_MAX: Final = 1_000_000
"""Largest number of frames of a babble: 47 s of a full bus."""
_BABBLE_AHEAD: Final = 2
"""Number of waiting frames of the rogue node; it always has one for the next arbitration."""


@dataclass(frozen=True, slots=True)
class Babble(MachineFault):
    """The same node sends a frame again and again, up to 1000000 times; 0: no more.

    It does not wait for the frame before to be sent.

    Attributes:
        frame: the frame.
        period_us: period of the frames; a frame is left out while two wait.
        count: number of frames; 0 ends the babble of this frame.
    """

    do = "babble"
    once = True
    place_fields = ("frame",)
    reactions = _ROGUE_FRAMES

    frame: FrameOfKeys
    period_us: Annotated[int, Key(metavar="PERIOD_US", least=BABBLE_US[0], most=BABBLE_US[1])]
    count: Annotated[int, Key(metavar="COUNT", least=0, most=BABBLE_COUNT_MAX)]

    def apply(self, simulation: "Simulation", number: int) -> None:
        """Send the frame unless two wait, and again a period later; 0 ends the babble."""
        if not self.count:
            simulation.cancel(partial(_babbles, frame=self.frame))
            return
        if simulation.rogue_node.waiting < _BABBLE_AHEAD:
            simulation.rogue_node.send(self.frame, simulation.now_counts)
        if self.count > 1:
            next_counts = simulation.now_counts + self.period_us * COUNTS_PER_US
            simulation.schedule([Consequence(next_counts, replace(self, count=self.count - 1), number)])

    def undo(self, _before: object) -> "Babble":
        return replace(self, count=0)

    @classmethod
    def ends_by(cls, values: Mapping[str, Any]) -> str | None:
        return f"{values['period_us'] * values['count'] / 1e6:g} s or `{BusRepair.do}`" if values["count"] else None


def _babbles(operation: Operation, frame: Frame | None = None) -> bool:
    """Return whether an operation is a babble of this frame; None: of any frame."""
    return isinstance(operation, Babble) and frame in (None, operation.frame)


# --- frames


@dataclass(frozen=True, slots=True)
class BusFault(Fault):
    """A fault that strikes transmissions under all its conditions, from its beginning to its end.

    It is the bus' `FrameFilter`.

    Attributes:
        cob_ids: identifiers of the frames that it may strike.
        rate: fraction of the transmissions that it strikes, 0 to 1, drawn from the bus' seeded generator.
        skip: number of transmissions that pass first.
        count: largest number of strikes; None for no limit.
    """

    once = True

    cob_ids: Annotated[
        Collection[int],
        Keys(
            (Key("frames", KeyKind.FRAMES), replace(JOINT, optional=True)),
            join=lambda ids, _axis: ids,
            split=lambda ids: (ids, None),
        ),
    ] = range(COB_ID_MASK + 1)
    rate: Annotated[float, Key(metavar="PART", least=0, most=1)] = 1.0
    skip: Annotated[int, Key(metavar="N", least=0)] = 0
    count: Annotated[int | None, Key(metavar="N", least=0)] = None

    @abstractmethod
    def effect(self) -> StrikeEffect:
        """Return the effect of a strike."""

    def apply(self, simulation: "Simulation", _number: int) -> None:
        """Strike from now on, until the bus ends it."""
        simulation.bus.filters.begin(self)

    def end(self, engine: "Engine") -> None:
        engine.target.simulation.bus.end_filter(self, engine.target.simulation.now_counts)

    @property
    def strikes(self) -> bool:
        """False: it strikes when a frame comes."""
        return False

    def why_endless(self) -> None:
        """Return None: `end` ends it."""

    @classmethod
    def ends_by(cls, values: Mapping[str, Any]) -> str:
        return f"strike {values['count']} or `{BusRepair.do}`" if "count" in values else f"`{BusRepair.do}`"


def _only(cob_id: int, fault: BusFault) -> bool:
    """Return whether a fault concerns only the frames of one identifier."""
    return set(fault.cob_ids) == {cob_id}


def _silent_host(fault: "FrameLoss", _moment: "Moment") -> bool:
    """Return whether a fault is only the loss of all heartbeats of the host."""
    return _only(COB_HEARTBEAT + HOST_NODE_ID, fault) and fault.rate == 1 and not fault.skip


def _deaf_board(fault: "FrameLoss", moment: "Moment") -> bool:
    """Return whether SYNC is lost for one of several boards."""
    return _only(COB_SYNC, fault) and fault.receiver is not None and moment.several_boards


@dataclass(frozen=True, slots=True)
class FrameLoss(BusFault):
    """Frames are acknowledged and do not arrive.

    No station notices.

    Attributes:
        receiver: only station that it concerns, by its place on the bus: 0 the host, 1 the first board; None for all.
    """

    do = "loss"
    reactions = (
        Documented(
            "heartbeat of the host lost",
            stops(ErrorCode.HEARTBEAT_LOST, begins_ms=HEARTBEAT_MS, certain=False),
            "unless it comes again in time",
            _silent_host,
        ),
        Documented(
            "SYNC lost for one of several boards",
            stops(*HOST_LOST, begins_ms=DEAF_BOARD_MS, certain=False),
            "the host notices after 1 s that not all axes start, stops those that did, and gives up",
            _deaf_board,
        ),
        Documented(
            "SYNC lost",
            Reaction(MotionEffect.NOT_BEGUN, (ErrorCode.HEARTBEAT_LOST,), State.FAULT, certain=False),
            "the host notices that no axis starts, and gives up",
            lambda fault, _: _only(COB_SYNC, fault),
        ),
        Documented(
            "frames lost",
            stops(*RUN_DRY, ErrorCode.HEARTBEAT_LOST, begins_ms=inf, certain=False),
            "lost points are sent again; if too many are lost, the queues run dry",
        ),
    )

    receiver: Annotated[int | None, Key(metavar="N", least=0)] = None

    def check(self, simulation: "Simulation", _number: int) -> None:
        boards = len(simulation.boards)
        if self.receiver is not None and self.receiver > boards:
            raise InputError(f"receiver: {self.receiver} is not from 0 to {boards}, the number of boards")

    def effect(self) -> StrikeEffect:
        return StrikeEffect(lost_by=slice(None) if self.receiver is None else slice(self.receiver, self.receiver + 1))


@dataclass(frozen=True, slots=True)
class FrameCorruption(BusFault):
    """Frames are disturbed: CAN sends them again.

    An error frame follows, and error counters rise.
    """

    do = "corruption"
    reactions = (
        Documented(
            "frames disturbed",
            stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
            "CAN repeats them; if none comes through, it is as if they were lost",
        ),
    )

    def effect(self) -> StrikeEffect:
        return StrikeEffect(disturbed=True)


_TWICE_OR_OFF: Final = (
    Documented(
        "frames come twice, or make their sender leave the bus",
        stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
        "sequence numbers tell; a sender whose frames all come twice goes into bus-off",
    ),
)


@dataclass(frozen=True, slots=True)
class FrameDuplicate(BusFault):
    """Frames come twice, as after an error in their last bit.

    The receivers have taken the frame, but the sender sends it again. A frame is doubled only once.
    """

    do = "duplicate"
    reactions = _TWICE_OR_OFF

    def effect(self) -> StrikeEffect:
        return StrikeEffect(doubled=True)


@dataclass(frozen=True, slots=True)
class FrameDelay(BusFault):
    """The sender of a frame waits before it sends it.

    It waits for a time before it takes part in the arbitration. A frame is delayed only once.
    """

    do = "delay"
    reactions = (
        Documented(
            "frames delayed",
            stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
            "the queues bridge it, up to the points that are in them; the host gives a start up that is a second late",
        ),
    )

    delay_counts: Annotated[
        int, Key("by_s", metavar="SECONDS", least=1e-6, most=86_400.0, unit="s", parts=COUNTS_PER_SECOND)
    ] = field(kw_only=True)

    def effect(self) -> StrikeEffect:
        return StrikeEffect(hold_counts=self.delay_counts)


@dataclass(frozen=True, slots=True)
class SenderOff(BusFault):
    """The sender of a frame goes into bus-off, and sends it afterwards.

    It does so as after 32 disturbed attempts in a row.
    """

    do = "sender-off"
    reactions = _TWICE_OR_OFF

    def effect(self) -> StrikeEffect:
        return StrikeEffect(sender_off=True)


# --- stations


@dataclass(frozen=True, slots=True)
class BusOff(MachineFault):
    """The board of a joint, or without `joint` the host, goes into bus-off.

    Its CAN controller leaves the bus, as after too many errors, and returns after the recessive bits that it needs.

    Attributes:
        axis: an axis of the controller's board; None: the host's interface.
    """

    do = "bus-off"
    once = True
    reactions = (
        Documented(
            "a board's controller leaves the bus",
            replace(
                stops(ErrorCode.CAN_BUS_OFF_RECOVERED), others=(ErrorCode.CAN_ERROR_PASSIVE, ErrorCode.CAN_OVERRUN)
            ),
            "0x6007 and 0x1029 act at once; the EMCY comes when it is back, after 128 x 11 bits; one not acknowledged"
            " meanwhile is error passive; newer reports replace those that wait",
            lambda fault, _: fault.axis is not None,
        ),
        Documented(
            "the host's controller leaves the bus",
            Reaction(MotionEffect.GOES_ON, (ErrorCode.CAN_ERROR_PASSIVE, ErrorCode.CAN_OVERRUN), certain=False),
            "it is back after 128 x 11 bits, which the queues bridge",
        ),
    )

    axis: Annotated[int | None, Key("joint", KeyKind.STATION)] = None

    def apply(self, simulation: "Simulation", number: int) -> None:
        station = simulation.host if self.axis is None else simulation.boards[number].can
        simulation.bus.throw_off(station, simulation.now_counts)


@dataclass(frozen=True, slots=True)
class HostBitRate(MachineFault):
    """The host's CAN adapter has another bit rate from now on.

    The boards, which do not have it, take its frames for errors.

    Attributes:
        bitrate: in bit/s.
    """

    do = "bit-rate"
    once = True
    ends = "`bit-rate` with that of the boards, or `bus-ok`"
    reactions = (
        Documented(
            "the host has the bit rate of the boards",
            GOES_ON,
            when=lambda fault, moment: fault.bitrate == moment.bitrate,
        ),
        Documented(
            "the host has another bit rate than the boards",
            Reaction(MotionEffect.RAMP, (), State.FAULT, HEARTBEAT_MS, certain=False, others=_OF_BAD_BUS),
            "the boards cannot send and leave the bus (0x6007), or miss the host's heartbeat, unless it has theirs"
            " again in time; their EMCYs come through afterwards",
        ),
    )

    bitrate: Annotated[int, Key(choices={each: each for each in BITRATES})]

    def __post_init__(self) -> None:
        if self.bitrate not in BITRATES:
            raise ValueError(f"bitrate {self.bitrate} is not one of {', '.join(map(str, BITRATES))}")

    def apply(self, simulation: "Simulation", _number: int) -> None:
        simulation.bus.set_host_bitrate(simulation.host, self.bitrate)

    def undo(self, before: "BoardEnvironment") -> "HostBitRate | None":
        return None if before.bitrate is None else HostBitRate(before.bitrate)


@dataclass(frozen=True, slots=True)
class BusRepair(Fault):
    """All faults of the bus end, and so does babble; the host has the boards' bit rate."""

    do = "bus-ok"
    once = True
    reactions = (Documented("bus repaired", GOES_ON),)

    def apply(self, simulation: "Simulation", _number: int) -> None:
        """End all bus faults; set the host to the first board's bit rate."""
        simulation.bus.end_filters(simulation.now_counts)
        simulation.cancel(_babbles)
        bitrate = simulation.boards[0].can.bitrate
        if bitrate is not None and bitrate != simulation.bus.host_bitrate:
            simulation.operate(HostBitRate(bitrate))
