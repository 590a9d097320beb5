"""`steptwin monitor [ROBOT] --connect ...`: show the traffic of a live bus in CANopen's terms."""

import time
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotName
from steptwin.host.cli.live.connection import LiveOptions
from steptwin.host.cli.options import option
from steptwin.host.cli.output import say
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import whole
from steptwin.protocol.frame import NODE_ID_MAX

if TYPE_CHECKING:
    import can

    from steptwin.host.client.monitor import Decoded
    from steptwin.host.robots.robot import Robot

_POLL_S = 0.1


@command("lab-scara --node th2 --connect 127.0.0.1", "--service emcy --service nmt -i socketcan -c can0")
def monitor(
    live: LiveOptions,
    robot: RobotName = None,
    service: list[str] | None = option("NAME", "Only nmt, sync, emcy, time, tpdo, rpdo, sdo or heartbeat; repeatable."),
    node: list[str] | None = option("NAME", "Only this joint's node, or the node of this number; repeatable."),
    seconds: float | None = option("S", "Time to listen; by default until Ctrl-C."),
    count: int | None = option("N", "Number of frames to show; by default any."),
) -> None:
    """Show the traffic of a bus in CANopen's terms, without sending anything.

    With ROBOT, nodes are shown by the names of their joints.
    """
    from steptwin.host.client.links.bus_link import open_bus
    from steptwin.host.client.monitor import SERVICES, Decoder

    loaded = None if robot is None and live.robot_file is None else live.robot(robot)
    for name in service or []:
        if name not in SERVICES:
            raise unknown("--service", name, SERVICES)
    names = _node_names(loaded)
    wanted_nodes = {_node_id(text, names) for text in node or []}
    _check_positive("--seconds", seconds)
    _check_positive("--count", count)
    found = live.address.required(loaded)
    decoder = Decoder(names)
    shown, documents = 0, list[dict[str, Any]]()
    with open_bus(found) as bus:
        try:
            for message in _messages(bus, found.title, seconds):
                decoded = decoder.decode(message.arbitration_id, bytes(message.data))
                if (service and decoded.service not in service) or (node and decoded.node_id not in wanted_nodes):
                    continue
                shown += 1
                if live.as_json:
                    documents.append(_document(message, decoded))
                else:
                    say(_line(message, decoded))
                if shown == count:
                    break
        except KeyboardInterrupt:
            if seconds is not None or count is not None:
                raise
    live.tell({"frames": documents})


def _messages(bus: "can.BusABC", title: str, seconds: float | None) -> "Iterator[can.Message]":
    """Yield data frames with 11-bit identifiers as they come, until the time is over."""
    from steptwin.host.client.links.bus_link import bus_errors

    until_s = None if seconds is None else time.monotonic() + seconds
    while until_s is None or time.monotonic() < until_s:
        with bus_errors(title):
            message = bus.recv(_POLL_S)
        if message and not (message.is_extended_id or message.is_remote_frame or message.is_error_frame):
            yield message


def _node_names(robot: "Robot | None") -> dict[int, str]:
    from steptwin.protocol.frame import FIRST_NODE_ID

    return dict(enumerate(robot.axis_names, start=FIRST_NODE_ID)) if robot else {}


def _node_id(text: str, names: dict[int, str]) -> int:
    by_name = {name: node_id for node_id, name in names.items()}
    if text in by_name:
        return by_name[text]
    try:
        node_id = whole(text, 0)
    except ValueError:
        raise unknown("--node", text, [*by_name, "a number such as 0x10"]) from None
    if not 1 <= node_id <= NODE_ID_MAX:
        raise InputError(f"--node {text}: node ids are from 1 to {NODE_ID_MAX}")
    return node_id


def _check_positive(option: str, value: float | None) -> None:
    if value is not None and not 0 < value < float("inf"):
        raise InputError(f"{option} {value:g}: is not above 0 and finite")


def _line(message: "can.Message", decoded: "Decoded") -> str:
    return f"{message.timestamp:.6f} {message.arbitration_id:03X} {decoded.title:9} {decoded.node:8} {decoded.text}"


def _document(message: "can.Message", decoded: "Decoded") -> dict[str, Any]:
    frame = {"time_s": message.timestamp, "cob_id": message.arbitration_id, "data": bytes(message.data).hex()}
    return frame | asdict(decoded)
