"""Reactions of the machine to a fault, as data, with their time limits, and the rows of their table."""

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
"""The firmware reads its inputs, and begins a ramp, with the next servo tick."""
HEARTBEAT_MS: Final = TIMEOUT_MS + TICK_MS
"""A host is lost when its heartbeat has been missing for this time."""
RECORD_MS: Final = 10
"""Longest record of a planned motion."""
QUEUE_MS: Final = (QUEUE_DEPTH + 1) * RECORD_MS + TICK_MS
"""Longest motion of a full queue and the record in execution."""

HOST_NOTICES_MS: Final = 40.0
"""Time until a host has stopped the other boards after a fault on one: the inhibit time of its report, two looks of the
host, 10 ms each, and waiting frames.
"""
LOST_BOARD_MS: Final = 1000 * SILENCE_S + 100 + HOST_NOTICES_MS
"""Time until a host notices a silent board; its last report may be one event timer period, 100 ms, old."""
DEAF_BOARD_MS: Final = 1000 * REPLY_TIMEOUT_S + HOST_NOTICES_MS
"""Time until a host has stopped the axes that have started without the others."""


class MotionEffect(Enum):
    """Effect of a fault on the motion."""

    GOES_ON = "goes on"
    RAMP = "stops by a ramp"
    CUT = "its pulses end at once"
    NOT_BEGUN = "does not begin"


@dataclass(frozen=True, slots=True)
class Reaction:
    """Reaction of the machine to a fault.

    Attributes:
        motion: effect on the motion.
        codes: error codes of EMCY; each axis concerned reports one of them; empty: no report.
        state: state of these axes' drives afterwards; None: unchanged.
        begins_ms: longest time from the fault's beginning to the start of the ramp or the end of pulses.
        certain: True if the reaction is required; False if none is right, too.
        verified: True if the drivers' counts stay as planned while the motion goes on; False: `verify` reports it.
        others: error codes that axes may report which the fault does not concern.

    Raises:
        ValueError: a state is given although the motion goes on.
    """

    motion: MotionEffect
    codes: tuple[ErrorCode, ...] = ()
    state: State | None = None
    begins_ms: float = 0.0
    certain: bool = True
    verified: bool = True
    others: tuple[ErrorCode, ...] = ()

    def __post_init__(self) -> None:
        if self.motion is MotionEffect.GOES_ON and self.state is not None:
            raise ValueError("state: is for a motion that ends; at the end of one that goes on the drives are off")

    @property
    def stops(self) -> bool:
        """True if the motion ends."""
        return self.motion is not MotionEffect.GOES_ON

    @property
    def may_stop(self) -> bool:
        """True if the fault may end the motion."""
        return self.stops or not self.certain

    @property
    def position_known(self) -> bool:
        """True if moved axes know their positions afterwards."""
        return self.motion is not MotionEffect.CUT


GOES_ON: Final = Reaction(MotionEffect.GOES_ON)
UNKNOWABLE: Final = Reaction(
    MotionEffect.RAMP, (ErrorCode.LIMIT_SWITCH,), State.FAULT, inf, certain=False, verified=False
)
"""A motor is away from its drive's position; nothing reports that but a limit switch."""
RUN_DRY: Final = (ErrorCode.PVT_UNDERRUN, ErrorCode.GROUP_STOPPED)
"""Error codes of queues that run dry: an axis at rest is stopped with moving ones."""
HOST_LOST: Final = (ErrorCode.HEARTBEAT_LOST, *RUN_DRY)
"""Error codes of a lost host: a full queue of short records runs dry before the heartbeat is missed."""


def stops(
    *codes: ErrorCode, motion: MotionEffect = MotionEffect.RAMP, begins_ms: float = TICK_MS, certain: bool = True
) -> Reaction:
    """Return a reaction that stops the axes; they report one of these codes."""
    return Reaction(motion, codes, State.FAULT, begins_ms, certain)


@dataclass(frozen=True, slots=True)
class Documented:
    """A row of the table of documented reactions.

    Attributes:
        what: the fault, as text.
        reaction: the reaction.
        why: remark for the page; may be empty.
        when: returns whether the row applies to a fault that begins at this moment; by default always.
    """

    what: str
    reaction: Reaction
    why: str = ""
    when: "Callable[[Any, Moment], bool]" = lambda _fault, _moment: True
