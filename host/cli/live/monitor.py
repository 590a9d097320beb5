"""`steptwin monitor [ROBOT] --connect ...`: show the traffic of a live bus, or of a stored one, in CANopen's terms."""

import time
from collections.abc import Generator
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

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
    from steptwin.host.client.links.bus_link import Connection
    from steptwin.host.client.monitor import Decoded
    from steptwin.host.robots.robot import Robot

_POLL_S = 0.1


class _Seen(NamedTuple):
    """A frame: instant by the bus' clock, identifier and data."""

    time_s: float
    cob_id: int
    data: bytes


@command(
    "ar4-mk3 --node J2 --connect 127.0.0.1",
    "out/pick/bus.log --service emcy",
)
def monitor(
    live: LiveOptions,
    robot: RobotName = None,
    log: Path | None = option("FILE", "Stored bus instead of a live one: .log of candump -L, .asc, .blf or .trc."),
    service: list[str] | None = option("NAME", "Only nmt, sync, emcy, time, tpdo, rpdo, sdo or heartbeat; repeatable."),
    node: list[str] | None = option("NAME", "Only this joint's node, or the node of this number; repeatable."),
    seconds: float | None = option("S", "Time to listen, or to look at a stored bus; by default all of it."),
    count: int | None = option("N", "Number of frames to show; by default any."),
) -> None:
    """Show the traffic of a bus in CANopen's terms, without sending anything.

    With ROBOT, nodes are shown by the names of their joints. In place of ROBOT a stored bus may stand, or the folder
    of a run, whose robot is known.
    """
    from steptwin.host.client.monitor import SERVICES, Decoder

    if log is None and robot is not None and _is_stored(robot):
        log, robot = Path(robot), None
    log = _stored_bus(log)
    loaded = _robot(live, robot, log)
    for name in service or []:
        if name not in SERVICES:
            raise unknown("--service", name, SERVICES)
    names = _node_names(loaded)
    wanted_nodes = {_node_id(text, names) for text in node or []}
    _check_positive("--seconds", seconds)
    _check_positive("--count", count)
    frames = _live_frames(live.address.required(loaded), seconds) if log is None else _frames(live, log, seconds)
    decoder = Decoder(names)
    shown, documents = 0, list[dict[str, Any]]()
    with closing(frames):
        try:
            for seen in frames:
                decoded = decoder.decode(seen.cob_id, seen.data)
                if (service and decoded.service not in service) or (node and decoded.node_id not in wanted_nodes):
                    continue
                shown += 1
                if live.as_json:
                    documents.append(_document(seen, decoded))
                else:
                    say(f"{seen.time_s:.6f} {seen.cob_id:03X} {decoded.title:9} {decoded.node:8} {decoded.text}")
                if shown == count:
                    break
        except KeyboardInterrupt:
            if log is not None or seconds is not None or count is not None:
                raise
    live.tell({"frames": documents})


def _live_frames(found: "Connection", seconds: float | None) -> Generator[_Seen]:
    """Yield data frames with 11-bit identifiers until the time is over."""
    from steptwin.host.client.links.bus_link import bus_errors, open_bus

    with open_bus(found) as bus:
        until_s = None if seconds is None else time.monotonic() + seconds
        while until_s is None or time.monotonic() < until_s:
            with bus_errors(found.title):
                message = bus.recv(_POLL_S)
            if message and not (message.is_extended_id or message.is_remote_frame or message.is_error_frame):
                yield _Seen(message.timestamp, message.arbitration_id, bytes(message.data))


def _frames(live: LiveOptions, log: Path, seconds: float | None) -> Generator[_Seen]:
    """Yield the frames of a stored bus, up to a time after the first."""
    from steptwin.host.record.recorded_bus import read_bus

    stored = read_bus(log, live.address.channel).frames
    for us, frame, _ in stored:
        if seconds is not None and us - stored[0].us > seconds * 1e6:
            return
        yield _Seen(us / 1e6, frame.cob_id, bytes(frame.data))


def _is_stored(name: str) -> bool:
    """Return whether a name is a stored bus or a folder, and not a robot."""
    from steptwin.host.record.recorded_bus import FORMATS

    return Path(name).is_dir() or Path(name).suffix.lower() in FORMATS


def _stored_bus(log: Path | None) -> Path | None:
    """Return the file of a stored bus, given by its path or its folder."""
    from steptwin.host.record.folder import BUS_LOG

    return log / BUS_LOG if log is not None and log.is_dir() else log


def _robot(live: LiveOptions, name: str | None, log: Path | None) -> "Robot | None":
    """Return the named robot, else that of a stored run; None without one.

    Raises:
        InputError: a live board is given beside a stored bus, or the robot does not exist.
    """
    from steptwin.host.record.folder import BUS_LOG, ROBOT, read_robot

    address = live.address
    if log is not None and (address.connect or address.interface or address.bitrate):
        raise InputError(f"{log}: is a stored bus: leave --connect, --interface and --bitrate out")
    if name is not None or live.robot_file is not None:
        return live.robot(name)
    of_a_run = log is not None and log.name == BUS_LOG and (log.parent / ROBOT).is_file()
    return read_robot(log.parent) if log is not None and of_a_run else None


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


def _document(seen: _Seen, decoded: "Decoded") -> dict[str, Any]:
    frame = {"time_s": seen.time_s, "cob_id": seen.cob_id, "data": seen.data.hex()}
    return frame | asdict(decoded)
