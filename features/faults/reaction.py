"""What the machine does for a fault, as data, how soon, and a row of the table that documents it."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import inf
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.client.lease import TIMEOUT_MS
from steptwin.host.client.waiting import REPLY_TIMEOUT_S, SILENCE_S
from steptwin.protocol.cia402 import ErrorCode, State
from steptwin.protocol.pvt import QUEUE_DEPTH

if TYPE_CHECKING:
    from steptwin.features.faults.moment import Moment

TICK_MS: Final = 0.25
"""The firmware sees its inputs, and begins a ramp, with the next servo tick."""
HEARTBEAT_MS: Final = TIMEOUT_MS + TICK_MS
"""A host is lost when its heartbeat has been missing for this long."""
RECORD_MS: Final = 10
"""Longest record of a planned motion."""
QUEUE_MS: Final = (QUEUE_DEPTH + 1) * RECORD_MS + TICK_MS
"""A full queue and the record in execution last so long."""

HOST_NOTICES_MS: Final = 40.0
"""What a host needs to stop the other boards after a fault on one: the inhibit time of its report and two looks of the
host, 10 ms each, and frames that wait for the bus."""
LOST_BOARD_MS: Final = 1000 * SILENCE_S + 100 + HOST_NOTICES_MS
"""Until a host notices that a board is silent, whose last report may be one period of its event timer, 100 ms, old."""
DEAF_BOARD_MS: Final = 1000 * REPLY_TIMEOUT_S + HOST_NOTICES_MS
"""Until a host has stopped the axes that have started because others have not."""


class Motion(Enum):
    """What becomes of the motion."""

    GOES_ON = "goes on"
    RAMP = "stops by a ramp"
    CUT = "its pulses end at once"
    NOT_BEGUN = "does not begin"


@dataclass(frozen=True, slots=True)
class Reaction:
    """What the machine does for a fault.

    Attributes:
        motion: what becomes of the motion.
        codes: error codes of EMCY, with one of which each axis concerned reports it; empty: they report nothing.
        state: state of these axes' drives afterwards; None: the same as before.
        begins_ms: time from the fault's beginning within which the ramp begins or the pulses end.
        certain: whether it must come; else none is right as well.
        verified: whether the drivers' counts are as planned as long as the motion goes on; False: `verify` tells.
        others: error codes that axes may report which the fault does not concern.

    Raises:
        ValueError: a state is expected after a motion that goes on.
    """

    motion: Motion
    codes: tuple[ErrorCode, ...] = ()
    state: State | None = None
    begins_ms: float = 0.0
    certain: bool = True
    verified: bool = True
    others: tuple[ErrorCode, ...] = ()

    def __post_init__(self) -> None:
        if self.motion is Motion.GOES_ON and self.state is not None:
            raise ValueError("state: is for a motion that ends; at the end of one that goes on the drives are off")

    @property
    def stops(self) -> bool:
        """True if the motion ends."""
        return self.motion is not Motion.GOES_ON

    @property
    def may_stop(self) -> bool:
        """True if the motion may end because of the fault."""
        return self.stops or not self.certain

    @property
    def position_known(self) -> bool:
        """Whether axes that moved know their positions afterwards."""
        return self.motion is not Motion.CUT


GOES_ON: Final = Reaction(Motion.GOES_ON)
UNKNOWABLE: Final = Reaction(Motion.RAMP, (ErrorCode.LIMIT_SWITCH,), State.FAULT, inf, certain=False, verified=False)
"""A motor is elsewhere than its drive believes: nothing tells that, unless it comes to a limit switch."""
RUN_DRY: Final = (ErrorCode.PVT_UNDERRUN, ErrorCode.GROUP_STOPPED)
"""Error codes where queues run dry: an axis that rests then is stopped with those that move."""
HOST_LOST: Final = (ErrorCode.HEARTBEAT_LOST, *RUN_DRY)
"""Error codes where the host is gone: a full queue of short records runs dry before the heartbeat is missed."""


def stops(
    *codes: ErrorCode, motion: Motion = Motion.RAMP, begins_ms: float = TICK_MS, certain: bool = True
) -> Reaction:
    """Return the reaction by which axes stop in a fault and report it with one of these codes."""
    return Reaction(motion, codes, State.FAULT, begins_ms, certain)


@dataclass(frozen=True, slots=True)
class Documented:
    """A row of the table of documented reactions.

    Attributes:
        what: the fault, in words.
        reaction: the reaction.
        why: a remark for the page; may be empty.
        when: returns whether it is right for a fault that begins while the machine does this; by default it always is.
    """

    what: str
    reaction: Reaction
    why: str = ""
    when: "Callable[[Any, Moment], bool]" = lambda _fault, _moment: True
