"""What the machine does for a fault, as data, and a row of the table that documents it."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import inf
from typing import Final

from steptwin.host.twin.scenarios.harms import Harm
from steptwin.host.twin.scenarios.moment import Moment
from steptwin.host.twin.scenarios.reaction_times import TICK_MS
from steptwin.protocol.cia402 import ErrorCode, State


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
    """A row of the table.

    Attributes:
        what: the fault, in words.
        applies: returns whether a harm is of this kind while the machine does this.
        reaction: the reaction.
        why: a remark for the page; may be empty.
    """

    what: str
    applies: Callable[[Harm, Moment], bool]
    reaction: Reaction
    why: str = ""
