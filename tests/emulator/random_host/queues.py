"""Everything that can grow on the board is bounded: look at every container of firmware and CAN controller."""

from collections import deque
from collections.abc import Iterable, Iterator
from enum import Enum
from itertools import islice
from types import ModuleType

from steptwin.controller.motion.axis_motion import AxisMotion
from steptwin.controller.motion.board_motion import BoardMotion
from steptwin.emulator.board.board import Board
from steptwin.emulator.bus.can_controller import FIFO_DEPTH, MAILBOXES
from steptwin.protocol.entry import Entry
from steptwin.protocol.pvt import QUEUE_DEPTH

QUEUE_PLACES_MAX = 160
"""No list, deque or set of a board with eight nodes holds more: these are the queues."""
TABLE_ENTRIES_MAX = 512
"""No table is larger; the largest are those of the object dictionary."""
_WHOLE = (int, str, bytes, float, type(None), Enum, type, ModuleType, BoardMotion, AxisMotion, Entry)
"""Kinds without parts that grow. The motion's storage is of fixed size, and `overfull` asks for what waits in it."""


def overfull(board: Board) -> Iterator[str]:
    """Yield each queue that holds more than it has room for; cheap, for every moment."""
    if len(board.can.mailboxes) > MAILBOXES:
        yield f"{len(board.can.mailboxes)} frames in {MAILBOXES} mailboxes"
    for node in board.firmware.nodes:
        queued = board.firmware.motion.axes[node.axis].queued
        if queued > QUEUE_DEPTH:
            yield f"axis {node.axis}: {queued} segments in a queue of {QUEUE_DEPTH}"


def overgrown(board: Board) -> Iterator[str]:
    """Yield each container of the firmware and of the CAN controller that is larger than any queue may be."""
    for root in (board.firmware, board.can):
        for path, container in _containers(root, type(root).__name__, set()):
            table = isinstance(container, (dict, tuple, frozenset))
            most = FIFO_DEPTH if path.endswith("._fifos[]") else TABLE_ENTRIES_MAX if table else QUEUE_PLACES_MAX
            if len(container) > most:
                yield f"{path} holds {len(container)}, more than {most}"


Container = list[object] | tuple[object, ...] | deque[object] | set[object] | frozenset[object] | dict[object, object]


def _containers(thing: object, path: str, seen: set[int]) -> Iterator[tuple[str, Container]]:
    """Yield the containers that belong to an object, and where they are."""
    seen.add(id(thing))
    parts: Iterable[tuple[str, object]] = ()
    if isinstance(thing, (list, tuple, deque, set, frozenset)):
        yield path, thing
        parts = ((f"{path}[]", part) for part in islice(thing, TABLE_ENTRIES_MAX))
    elif isinstance(thing, dict):
        yield path, thing
        parts = ((f"{path}[]", part) for part in islice(thing.values(), TABLE_ENTRIES_MAX))
    elif type(thing).__module__.startswith("steptwin."):
        names = [*vars(thing)] if hasattr(thing, "__dict__") else []
        names += [
            name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ()) if hasattr(thing, name)
        ]
        parts = ((f"{path}.{name}", getattr(thing, name)) for name in names)
    for where, part in parts:
        if not isinstance(part, _WHOLE) and id(part) not in seen:
            yield from _containers(part, where, seen)
