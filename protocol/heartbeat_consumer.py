"""The heartbeat consumer: which other nodes a node listens to, and when it has lost one (CiA 301, section 7.2.8.3.2).

Object 0x1016 names the producers: node id in bits 16 to 23, time in ms in bits 0 to 15; an entry with a time of 0 or a
node id outside of 1 to 127 watches nobody. Watching begins with the first heartbeat. A lost producer is watched again
from its next heartbeat on. A boot-up message is no heartbeat: who says it has just forgotten what it was doing.
"""

from dataclasses import dataclass
from functools import partial

from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.nmt import NmtState

_MS_US = 1000
_STATE_MASK = 0x7F
"""Bit 7 of a heartbeat is reserved."""


@dataclass(slots=True)
class _Watch:
    """One producer that is watched; `deadline_us` is None while none of its heartbeats is awaited."""

    node_id: int
    timeout_us: int
    deadline_us: int | None = None
    lost: bool = False


class HeartbeatConsumer:
    """Watches the producers that 0x1016 names."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._dictionary = dictionary
        self._watches: dict[int, _Watch] = {}
        """By the address of the entry that names the producer."""
        for address in od.CONSUMER_HEARTBEATS:
            dictionary.write_hooks[address] = partial(self._write, address)
        self.changed = True
        """Whether the producers may be others since somebody last looked."""

    def restart(self) -> None:
        """Begin anew with what the dictionary holds: nobody has been heard."""
        self._watches.clear()
        for address in od.CONSUMER_HEARTBEATS:
            self._watch(address, self._dictionary.get(address))

    @property
    def producers(self) -> list[int]:
        """The node ids that are watched."""
        return [watch.node_id for watch in self._watches.values()]

    @property
    def lost(self) -> list[int]:
        """The node ids that were lost and have not come back."""
        return [watch.node_id for watch in self._watches.values() if watch.lost]

    @property
    def due_us(self) -> int | None:
        """When the next producer is lost if it stays silent."""
        deadlines = [watch.deadline_us for watch in self._watches.values() if watch.deadline_us is not None]
        return min(deadlines, default=None)

    def receive(self, node_id: int, data: bytes, now_us: int) -> bool:
        """A heartbeat of a node has arrived; True if the node was lost and is back."""
        if len(data) != 1 or data[0] & _STATE_MASK == NmtState.INITIALISING:
            return False
        for watch in self._watches.values():
            if watch.node_id == node_id:
                watch.deadline_us = now_us + watch.timeout_us
                was_lost, watch.lost = watch.lost, False
                return was_lost
        return False

    def poll(self, now_us: int) -> list[int]:
        """The node ids that are lost as of now, each once."""
        late = [w for w in self._watches.values() if w.deadline_us is not None and w.deadline_us <= now_us]
        for watch in late:
            watch.deadline_us = None
            watch.lost = True
        return [watch.node_id for watch in late]

    def _write(self, address: int, word: int) -> None:
        """A node may be named once (abort code as CiA 301, section 7.5.2.16 prescribes)."""
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
    """The node id of an entry; 0 if the entry watches nobody."""
    node_id = word >> 16
    return node_id if word & 0xFFFF and node_id <= 127 else 0
