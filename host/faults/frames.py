"""The frames that a fault of the bus concerns, by name: those of a service, of one joint's node or of all."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_ID_MASK,
    COB_NMT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    COB_SYNC,
    COB_TPDO,
    FIRST_NODE_ID,
    FROM_NODE,
    HOST_NODE_ID,
    TO_NODE,
)

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot

_NODES: Final[Mapping[str, tuple[int, ...]]] = {
    "records": (COB_RPDO[3],),
    "commands": COB_RPDO[:3],
    "requests": (COB_SDO_REQUEST,),
    "answers": (COB_SDO_RESPONSE,),
    "reports": COB_TPDO,
    "emergencies": (COB_EMCY,),
    "heartbeats": (COB_HEARTBEAT,),
    "of-board": FROM_NODE,
}
"""Bases of the identifiers to which a joint's node id is added, by name."""
_HOST: Final[Mapping[str, tuple[int, ...]]] = {
    "nmt": (COB_NMT,),
    "sync": (COB_SYNC,),
    "host-heartbeat": (COB_HEARTBEAT + HOST_NODE_ID,),
    "of-host": (COB_NMT, COB_SYNC, COB_HEARTBEAT + HOST_NODE_ID),
    "all": tuple(range(COB_ID_MASK + 1)),
}
"""Identifiers by name."""
_OF_HOST: Final = "of-host"

FRAMES: Final = (*_NODES, *_HOST)
"""The names."""


def per_node(name: str) -> bool:
    """Return whether frames of this name belong to a joint's node."""
    return name in _NODES


def cob_ids(robot: "Robot", name: str, axis: int | None = None) -> tuple[int, ...]:
    """Return the identifiers of a name, of one axis' node or of all nodes, in rising order."""
    axes = range(len(robot.axes)) if axis is None else range(axis, axis + 1)
    bases = _NODES.get(name, TO_NODE if name == _OF_HOST else ())
    found = {base + FIRST_NODE_ID + each for base in bases for each in axes}
    return tuple(sorted(found | set(_HOST.get(name, ()))))


def name_of(robot: "Robot", ids: tuple[int, ...]) -> tuple[str, int | None] | None:
    """Return the name of identifiers, and the axis if they are one node's; None if they have no name."""
    for axis in (None, *range(len(robot.axes))):
        for name in FRAMES if axis is None else _NODES:
            if cob_ids(robot, name, axis) == ids:
                return name, axis
    return None


def read_identifier(table: Table, key: str) -> int:
    """Read an identifier of 11 bits; a reading of `Table`."""
    return checked_identifier(key, table.integer(key))


def checked_identifier(key: str, value: object) -> int:
    """Return an identifier of 11 bits; raise InputError, with the key in front, for anything else."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= COB_ID_MASK:
        raise InputError(f"{key}: {value!r} is not an identifier from 0 to 0x{COB_ID_MASK:X}")
    return value
