"""Network management (NMT) of one node: states, heartbeat, node guarding (CiA 301, sections 7.2.8 and 7.3.2)."""

from enum import IntEnum


class NmtState(IntEnum):
    """NMT state of a node; the value is its code in the heartbeat."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtCommand(IntEnum):
    """Command specifiers of the NMT service."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


class ErrorBehaviour(IntEnum):
    """NMT state to enter after a communication error (1029h:01, CiA 301, section 7.5.2.27)."""

    PRE_OPERATIONAL = 0
    """Only if the node is OPERATIONAL."""
    NO_CHANGE = 1
    STOPPED = 2


_TARGETS = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.INITIALISING,
    NmtCommand.RESET_COMMUNICATION: NmtState.INITIALISING,
}
"""State after each command, from any state. INITIALISING changes to PRE-OPERATIONAL by itself."""

_COMMANDS = frozenset(NmtCommand)


def command_for(data: bytes, node_id: int) -> NmtCommand | None:
    """Decode an NMT command; return None if it is malformed, unknown or addresses another node (0: all nodes)."""
    if len(data) != 2 or data[0] not in _COMMANDS or data[1] not in (0, node_id):
        return None
    return NmtCommand(data[0])


def target_of(command: NmtCommand) -> NmtState:
    """Return the state after a command."""
    return _TARGETS[command]


def after_error(state: NmtState, behaviour: int) -> NmtState:
    """Return the state after a communication error."""
    if behaviour == ErrorBehaviour.STOPPED:
        return NmtState.STOPPED
    if behaviour == ErrorBehaviour.PRE_OPERATIONAL and state is NmtState.OPERATIONAL:
        return NmtState.PRE_OPERATIONAL
    return state


class HeartbeatProducer:
    """Announces the node's state every `period_us`; 0 switches the heartbeat off."""

    def __init__(self) -> None:
        self.period_us: int = 0
        self.due_us: int | None = None

    def set_period(self, period_us: int, now_us: int) -> None:
        """Set the producer heartbeat time (1017h); the first heartbeat is due at once."""
        self.period_us = period_us
        self.due_us = now_us if period_us else None

    def poll(self, now_us: int) -> bool:
        """Return whether a heartbeat is due now; then schedule the next one."""
        if self.due_us is None or now_us < self.due_us:
            return False
        self.due_us += self.period_us
        return True


_TOGGLE = 0x80


class GuardedNode:
    """Answers node guarding and watches the guarding master (CiA 301, section 7.2.8.3.2).

    The master requests the state by remote frames. Life guarding begins with the first one; after the node life time
    without another one the master is lost.
    """

    def __init__(self) -> None:
        self.due_us: int | None = None
        """Instant when the master is lost; None without life guarding."""
        self.lost: bool = False
        """True from the loss of the master until its next request."""
        self._toggle = 0

    def restart(self) -> None:
        """Begin again with toggle bit 0, and without life guarding until the next request."""
        self.due_us, self.lost, self._toggle = None, False, 0

    def answer(self, state: NmtState, life_time_us: int, now_us: int) -> bytes:
        """Return the answer to a request; a life time of 0 means no life guarding."""
        answer = bytes((self._toggle | state,))
        self._toggle ^= _TOGGLE
        self.due_us = now_us + life_time_us if life_time_us else None
        self.lost = False
        return answer

    def poll(self, now_us: int) -> bool:
        """Return True, once, when the master is lost."""
        if self.due_us is None or now_us < self.due_us:
            return False
        self.due_us, self.lost = None, True
        return True
