"""The frames that a fault of the bus concerns, by name: those of a service, of one joint's node or of all."""

from collections.abc import Mapping
from typing import Final

from steptwin.host.robots.robot import Robot
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
    HOST_NODE_ID,
)

_NODES: Final[Mapping[str, tuple[int, ...]]] = {
    "records": (COB_RPDO[3],),
    "commands": COB_RPDO[:3],
    "requests": (COB_SDO_REQUEST,),
    "answers": (COB_SDO_RESPONSE,),
    "reports": COB_TPDO,
    "emergencies": (COB_EMCY,),
    "heartbeats": (COB_HEARTBEAT,),
    "of-board": (COB_EMCY, *COB_TPDO, COB_SDO_RESPONSE, COB_HEARTBEAT),
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
_FROM_HOST: Final = (*COB_RPDO, COB_SDO_REQUEST)
"""Bases of the identifiers with which the host addresses a node."""

FRAMES: Final = (*_NODES, *_HOST)
"""The names."""


def per_node(name: str) -> bool:
    """Return whether frames of this name belong to a joint's node."""
    return name in _NODES


def cob_ids(robot: Robot, name: str, axis: int | None = None) -> tuple[int, ...]:
    """Return the identifiers of a name, of one axis' node or of all nodes, in rising order."""
    axes = range(len(robot.joints)) if axis is None else range(axis, axis + 1)
    bases = _NODES.get(name, _FROM_HOST if name == _OF_HOST else ())
    found = {base + FIRST_NODE_ID + each for base in bases for each in axes}
    return tuple(sorted(found | set(_HOST.get(name, ()))))


def name_of(robot: Robot, ids: tuple[int, ...]) -> tuple[str, int | None] | None:
    """Return the name of identifiers, and the axis if they are one node's; None if they have no name."""
    for axis in (None, *range(len(robot.joints))):
        for name in FRAMES if axis is None else _NODES:
            if cob_ids(robot, name, axis) == ids:
                return name, axis
    return None
