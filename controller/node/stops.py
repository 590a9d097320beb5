"""Stop one axis, by a ramp or at once; tables hold the meaning of CiA 402's option codes."""

from enum import Enum
from typing import Final, NamedTuple

from steptwin.controller.motion.axis_motion import STOP_MAX_MS
from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, State
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS


class ConnectionLoss(Enum):
    """An event by which a node loses its master."""

    HEARTBEAT = "a heartbeat that the node monitors is lost"
    LIFE_GUARDING = "the master that guards the node is lost"
    BUS_OFF = "the board's CAN controller goes into bus-off"
    RPDO_TIMEOUT = "a receive PDO with an event timer does not come in time"
    NMT_STOPPED = "the node enters the NMT state STOPPED"
    RESET_COMMUNICATION = "the communication is reset"
    RESET_APPLICATION = "the node is reset"


class LossEffect(NamedTuple):
    """Consequences of a connection loss that do not depend on the option code.

    Attributes:
        code: error that the option "fault signal" reports.
        detail: detail of the error.
        by_error_behaviour: True if the error behaviour (1029h:01) determines the NMT state, False if the event does.
    """

    code: ErrorCode
    detail: int = 0
    by_error_behaviour: bool = False


LOSS_EFFECTS: Final = {
    ConnectionLoss.HEARTBEAT: LossEffect(ErrorCode.HEARTBEAT_LOST, by_error_behaviour=True),
    ConnectionLoss.LIFE_GUARDING: LossEffect(ErrorCode.HEARTBEAT_LOST, by_error_behaviour=True),
    ConnectionLoss.BUS_OFF: LossEffect(ErrorCode.CAN_BUS_OFF_RECOVERED, by_error_behaviour=True),
    ConnectionLoss.RPDO_TIMEOUT: LossEffect(ErrorCode.RPDO_TIMEOUT),
    ConnectionLoss.NMT_STOPPED: LossEffect(ErrorCode.COMMUNICATION, NmtCommand.STOP),
    ConnectionLoss.RESET_COMMUNICATION: LossEffect(ErrorCode.COMMUNICATION, NmtCommand.RESET_COMMUNICATION),
    ConnectionLoss.RESET_APPLICATION: LossEffect(ErrorCode.COMMUNICATION, NmtCommand.RESET_NODE),
}
"""Effects by event. Lost heartbeats and masters and late RPDOs are reported before, with node id or PDO number."""


class StopKind(Enum):
    """Kind of stop; the value is the address of the deceleration's entry."""

    CUT = None
    """End the pulses at once. A moving motor coasts, and its position is then unknown."""
    SLOW_DOWN = od.PROFILE_DECELERATION
    QUICK_STOP = od.QUICK_STOP_DECELERATION


class QuickStop(NamedTuple):
    """Kind of a quick stop, and the state after it."""

    kind: StopKind
    end: State


QUICK_STOPS = {
    0: QuickStop(StopKind.CUT, State.SWITCH_ON_DISABLED),
    1: QuickStop(StopKind.SLOW_DOWN, State.SWITCH_ON_DISABLED),
    2: QuickStop(StopKind.QUICK_STOP, State.SWITCH_ON_DISABLED),
    5: QuickStop(StopKind.SLOW_DOWN, State.QUICK_STOP_ACTIVE),
    6: QuickStop(StopKind.QUICK_STOP, State.QUICK_STOP_ACTIVE),
}
"""By the quick stop option code (605Ah). 3, 4, 7 and 8 need current or voltage limits, which a stepper lacks."""
SHUTDOWNS = {0: StopKind.CUT, 1: StopKind.SLOW_DOWN}
"""By the shutdown option code (605Bh)."""
DISABLES = {0: StopKind.CUT, 1: StopKind.SLOW_DOWN}
"""By the disable operation option code (605Ch)."""
HALTS = {1: StopKind.SLOW_DOWN, 2: StopKind.QUICK_STOP}
"""By the halt option code (605Dh)."""
FAULT_REACTIONS = {0: StopKind.CUT, 1: StopKind.SLOW_DOWN, 2: StopKind.QUICK_STOP}
"""By the fault reaction option code (605Eh)."""

_FIXED_REACTIONS = {
    ErrorCode.UNDERVOLTAGE: StopKind.CUT,  # without its supply the driver cannot follow a ramp
    ErrorCode.OUTPUT_STAGE: StopKind.CUT,  # the driver has switched itself off
    ErrorCode.ESTOP: StopKind.QUICK_STOP,  # IEC 60204-1, stop category 1: stop, then remove the power
}


def fault_stop(code: ErrorCode, detail: int, option: int) -> StopKind:
    """Return how an axis stops for an error: as the error requires, or by the fault reaction option code."""
    if code is ErrorCode.TEMPERATURE and detail:  # the driver chip has switched itself off
        return StopKind.CUT
    return _FIXED_REACTIONS.get(code, FAULT_REACTIONS[option])


class AxisStop:
    """Stops one axis. A stop without ramp in motion loses the position reference."""

    def __init__(self, context: AxisContext) -> None:
        self._motion = context.motion
        self._dictionary = context.dictionary
        self._reference = context.reference

    def duration_ms(self, kind: StopKind) -> int:
        """Return the duration of a stop from the present velocity: at least 1 ms, at most STOP_MAX_MS."""
        if kind.value is None:
            return 1
        velocity = abs(self._motion.velocity)
        deceleration = self._dictionary.get(kind.value) * VELOCITY_PER_UNIT_PER_MS
        return min(max(1, -(-velocity * 1_000_000 // deceleration)), STOP_MAX_MS)

    @property
    def halt_kind(self) -> StopKind:
        """Kind of stop that the halt option code (605Dh) selects."""
        return HALTS[self._dictionary.get(od.HALT_OPTION)]

    def halt_deceleration(self) -> int:
        """Return the deceleration of a halt in units/s^2."""
        return self._dictionary.get(self.halt_kind.value)

    def ramp_down(self, kind: StopKind, duration_ms: int | None = None) -> None:
        """Stop with constant deceleration, in `duration_ms` if given; at once if the ramp would leave the i32 range."""
        velocity = self._motion.velocity
        self._motion.stop(self.duration_ms(kind) if duration_ms is None else duration_ms)
        if velocity and not self._motion.running:
            self._reference.lose()

    def cut(self) -> None:
        """End all pulses now. A moving motor coasts, and its steps are not counted."""
        if self._motion.velocity:
            self._reference.lose()
        self._motion.flush()
