"""Monitor the heartbeats of other nodes (CiA 301, section 7.2.8.3.2).

The consumer heartbeat time (1016h) names the producers: node id in bits 16 to 23, time in ms in bits 0 to 15. An entry
with a time of 0 or a node id outside of 1 to 127 is unused. Monitoring starts with a producer's first heartbeat; after
a loss it starts again with the next one. A boot-up message does not count: its sender has just restarted.
"""

from dataclasses import dataclass
from typing import Final

from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.nmt import NmtState
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

_MS_US: Final = 1000
_STATE_MASK: Final = 0x7F
"""Bit 7 of a heartbeat is reserved."""


@dataclass(slots=True)
class _Watch:
    """One watched producer; `deadline_us` is None before its first heartbeat and after its loss."""

    node_id: int
    timeout_us: int
    deadline_us: int | None = None
    lost: bool = False


class HeartbeatConsumer:
    """Monitors the heartbeat producers that 1016h names."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._dictionary = dictionary
        self._watches: dict[int, _Watch] = {}
        """Producers by the address of the entry that names them."""
        dictionary.bind(self)
        self.changed: bool = True
        """True if the set of producers may have changed; the reader resets it."""

    def restart(self) -> None:
        """Monitor the producers that the dictionary names, each from its next heartbeat on."""
        self._watches.clear()
        for address in od.CONSUMER_HEARTBEATS:
            self._watch(address, self._dictionary.get(address))

    @property
    def producers(self) -> list[int]:
        """Node ids of the monitored producers."""
        return [watch.node_id for watch in self._watches.values()]

    @property
    def lost(self) -> list[int]:
        """Node ids of the producers that were lost and have not come back."""
        return [watch.node_id for watch in self._watches.values() if watch.lost]

    @property
    def due_us(self) -> int | None:
        """Instant of the next heartbeat time-out; None if no heartbeat is awaited."""
        due_us: int | None = None
        for watch in self._watches.values():
            deadline_us = watch.deadline_us
            if deadline_us is not None and (due_us is None or deadline_us < due_us):
                due_us = deadline_us
        return due_us

    def receive(self, node_id: int, data: bytes, now_us: int) -> bool:
        """Process a heartbeat; return True if its node was lost and is back."""
        if len(data) != 1 or data[0] & _STATE_MASK == NmtState.INITIALISING:
            return False
        for watch in self._watches.values():
            if watch.node_id == node_id:
                watch.deadline_us = now_us + watch.timeout_us
                was_lost, watch.lost = watch.lost, False
                return was_lost
        return False

    def poll(self, now_us: int) -> list[int]:
        """Return the node ids of the producers whose heartbeat has timed out since the last call."""
        late = [w for w in self._watches.values() if w.deadline_us is not None and w.deadline_us <= now_us]
        for watch in late:
            watch.deadline_us = None
            watch.lost = True
        return [watch.node_id for watch in late]

    def watch_at(self, address: int, word: int) -> None:
        """Monitor the producer of an entry; refuse a node that another entry names (CiA 301, section 7.5.2.16)."""
        node_id = _node_of(word)
        if node_id and any(w.node_id == node_id for i, w in self._watches.items() if i != address):
            raise SdoAbortError(AbortCode.INCOMPATIBLE)
        self._watches.pop(address, None)
        self._watch(address, word)

    def _watch(self, address: int, word: int) -> None:
        self.changed = True
        node_id = _node_of(word)
        if node_id:
            self._watches[address] = _Watch(node_id, (word & 0xFFFF) * _MS_US)


def _node_of(word: int) -> int:
    """Return the node id of an entry; 0 if the entry is unused."""
    node_id = word >> 16
    return node_id if word & 0xFFFF and node_id <= 127 else 0
