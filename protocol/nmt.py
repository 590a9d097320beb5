"""Network management of one node: its state machine and its heartbeat (CiA 301, sections 7.2.8 and 7.3.2)."""

from enum import IntEnum


class NmtState(IntEnum):
    """A node's state; the value is what its heartbeat says."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtCommand(IntEnum):
    """The command specifiers of the NMT service."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


class ErrorBehaviour(IntEnum):
    """What a communication error does to the node's state, object 0x1029:01 (CiA 301, section 7.5.2.27)."""

    PRE_OPERATIONAL = 0
    """From OPERATIONAL only."""
    NO_CHANGE = 1
    STOPPED = 2


_TARGETS = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.INITIALISING,
    NmtCommand.RESET_COMMUNICATION: NmtState.INITIALISING,
}
"""Every command is valid in every state after boot-up; INITIALISING leads on to PRE-OPERATIONAL by itself."""

_COMMANDS = frozenset(NmtCommand)


def command_for(data: bytes, node_id: int) -> NmtCommand | None:
    """Read an NMT frame; None if it is malformed, unknown or meant for another node (0 means all)."""
    if len(data) != 2 or data[0] not in _COMMANDS or data[1] not in (0, node_id):
        return None
    return NmtCommand(data[0])


def target_of(command: NmtCommand) -> NmtState:
    """The state that a command leads to."""
    return _TARGETS[command]


def after_error(state: NmtState, behaviour: int) -> NmtState:
    """The state that a communication error leads to."""
    if behaviour == ErrorBehaviour.STOPPED:
        return NmtState.STOPPED
    if behaviour == ErrorBehaviour.PRE_OPERATIONAL and state is NmtState.OPERATIONAL:
        return NmtState.PRE_OPERATIONAL
    return state


class HeartbeatProducer:
    """Says the node's state every `period_us`; 0 switches it off."""

    def __init__(self) -> None:
        self.period_us = 0
        self.due_us: int | None = None

    def set_period(self, period_us: int, now_us: int) -> None:
        """Object 0x1017 was written: the first heartbeat comes at once."""
        self.period_us = period_us
        self.due_us = now_us if period_us else None

    def poll(self, now_us: int) -> bool:
        """Whether a heartbeat is to be sent now."""
        if self.due_us is None or now_us < self.due_us:
            return False
        self.due_us += self.period_us
        return True
