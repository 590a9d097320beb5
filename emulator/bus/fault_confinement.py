"""A CAN controller's error counters and the error states that follow from them (ISO 11898-1, fault confinement).

Thresholds, and the receive counter after a good reception in error passive, are bxCAN's (RM0008, section 24.7.6 and
CAN_ESR).
"""

from enum import Enum

_WARNING_FROM = 96
_PASSIVE_ABOVE = 127
_BUS_OFF_ABOVE = 255
_COUNTER_MAX = 255
_RECEIVE_RESET = 120
"""Value of a receive counter above 128 after a good reception."""
_SENDER_STEP = 8


class ErrorState(Enum):
    """A controller's error state."""

    ACTIVE = "error active"
    WARNING = "error warning"
    PASSIVE = "error passive"
    BUS_OFF = "bus-off"


class FaultConfinement:
    """TEC and REC of one controller: a failed frame adds 8 at its sender and 1 at each receiver, a good one takes 1.

    No receiver is ever the first to notice an error, which would add 8: a disturbance on this bus hits all of them at
    once.
    """

    def __init__(self) -> None:
        self.transmit_errors: int = 0
        self.receive_errors: int = 0

    @property
    def state(self) -> ErrorState:
        """Error state that follows from the counters."""
        worst = max(self.transmit_errors, self.receive_errors)
        if self.transmit_errors > _BUS_OFF_ABOVE:
            return ErrorState.BUS_OFF
        if worst > _PASSIVE_ABOVE:
            return ErrorState.PASSIVE
        return ErrorState.WARNING if worst >= _WARNING_FROM else ErrorState.ACTIVE

    def sent(self) -> None:
        """Count a frame that was sent."""
        if self.transmit_errors:
            self.transmit_errors -= 1

    def received(self) -> None:
        """Count a frame that was received."""
        if self.receive_errors > _PASSIVE_ABOVE + 1:
            self.receive_errors = _RECEIVE_RESET
        elif self.receive_errors:
            self.receive_errors -= 1

    def sending_failed(self, *, acknowledged: bool = True) -> None:
        """Count an error in a frame of its own, but no missing acknowledgement in error passive: it may be alone."""
        if acknowledged or self.state is not ErrorState.PASSIVE:
            self.transmit_errors += _SENDER_STEP

    def receiving_failed(self) -> None:
        """Count an error in another station's frame."""
        self.receive_errors = min(self.receive_errors + 1, _COUNTER_MAX)

    def force_bus_off(self) -> None:
        """Set the counters as after 32 failed attempts in a row."""
        self.transmit_errors = _BUS_OFF_ABOVE + 1

    def reset(self) -> None:
        """Set the counters as after power-up, or after bus-off."""
        self.transmit_errors = self.receive_errors = 0
