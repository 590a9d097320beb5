"""Further CANopen nodes on the bus, each with the object dictionary of an EDS or DCF."""

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import ControlRequests, Feature

if TYPE_CHECKING:
    from pathlib import Path

    from steptwin.features.nodes.options import NodeOptions
    from steptwin.features.nodes.part import NodesPart
    from steptwin.host.robots.robot import Robot


def _machine_options() -> "type[NodeOptions]":
    from steptwin.features.nodes.options import NodeOptions

    return NodeOptions


def _read_options(options: "NodeOptions", _robot: "Robot", folder: "Path") -> "NodeOptions":
    return options.placed(folder)


def _part(
    robot: "Robot",
    _joints: Sequence[float],
    _axes_per_board: Sequence[int],
    options: "NodeOptions | None",
    _waits_for: Collection[str] | None,
) -> "NodesPart | None":
    if options is None or not options.nodes:
        return None
    from steptwin.features.nodes.eds_nodes import eds_nodes
    from steptwin.features.nodes.part import NodesPart

    return NodesPart(eds_nodes(options.nodes, len(robot.axes)))


def _requests() -> ControlRequests:
    from steptwin.features.nodes import control

    return control


FEATURE: Final = Feature(
    name="nodes", machine_options=_machine_options, read_options=_read_options, part=_part, requests=_requests
)
