"""A CAN controller's error counters and the states that follow from them (ISO 11898-1, fault confinement).

Thresholds and the value after a good reception in error passive are bxCAN's (RM0008, section 24.7.6 and CAN_ESR).
"""

from enum import Enum

_WARNING_FROM = 96
_PASSIVE_ABOVE = 127
_BUS_OFF_ABOVE = 255
_COUNTER_MAX = 255
_RECEIVE_RESET = 120
"""What a good reception makes of a receive counter above 128."""
_SENDER_STEP = 8


class ErrorState(Enum):
    """How much a controller still trusts itself."""

    ACTIVE = "error active"
    WARNING = "error warning"
    PASSIVE = "error passive"
    BUS_OFF = "bus-off"


class FaultConfinement:
    """TEC and REC of one controller. A failed attempt costs its sender 8 and each receiver 1, a good one gains 1.

    Receivers never see that they were the first to notice an error (which would cost them 8): a disturbance on this
    bus hits all of them alike.
    """

    def __init__(self) -> None:
        self.transmit_errors = 0
        self.receive_errors = 0

    @property
    def state(self) -> ErrorState:
        """The state that the counters stand for."""
        worst = max(self.transmit_errors, self.receive_errors)
        if self.transmit_errors > _BUS_OFF_ABOVE:
            return ErrorState.BUS_OFF
        if worst > _PASSIVE_ABOVE:
            return ErrorState.PASSIVE
        return ErrorState.WARNING if worst >= _WARNING_FROM else ErrorState.ACTIVE

    def sent(self) -> None:
        """A frame has gone out."""
        if self.transmit_errors:
            self.transmit_errors -= 1

    def received(self) -> None:
        """A frame has come in."""
        if self.receive_errors > _PASSIVE_ABOVE + 1:
            self.receive_errors = _RECEIVE_RESET
        elif self.receive_errors:
            self.receive_errors -= 1

    def sending_failed(self, *, acknowledged: bool = True) -> None:
        """A frame of ours met an error. A passive sender that nobody acknowledges stays as it is: it may be alone."""
        if acknowledged or self.state is not ErrorState.PASSIVE:
            self.transmit_errors += _SENDER_STEP

    def receiving_failed(self) -> None:
        """A frame of somebody else met an error."""
        self.receive_errors = min(self.receive_errors + 1, _COUNTER_MAX)

    def force_bus_off(self) -> None:
        """Be as after 32 failed attempts in a row."""
        self.transmit_errors = _BUS_OFF_ABOVE + 1

    def reset(self) -> None:
        """Be as after power-up or the way back from bus-off."""
        self.transmit_errors = self.receive_errors = 0
