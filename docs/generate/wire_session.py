"""Show a short session of one axis on the embedded bus, frame by frame, with the meaning of each."""

from dataclasses import replace
from typing import Final

from steptwin.controller.backend import fastest_kernel
from steptwin.host.client import AxisSettings, Machine
from steptwin.host.common.axis_records import AxisRecords
from steptwin.host.papers.markdown import code
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_NMT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    COB_SYNC,
    COB_TPDO,
    FIRST_NODE_ID,
    HOST_NODE_ID,
    Frame,
)
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.pvt import PvtStatus
from steptwin.protocol.timer import COUNTS_PER_SECOND

_SETTINGS: Final = AxisSettings(16, 33_000, 33_666, 15_000, 15_000, 15_360_000, 32_768_000)
_RECORDS: Final = AxisRecords([4_096, 8_192, 4_096], [26_214, 26_214, 0], [20, 20, 20])
"""One full step, 16 384 units: accelerating to 409.6 units/ms, at constant speed, decelerating."""

_SERVICES: Final = (
    (COB_EMCY, "<", "EMCY"),
    *((cob_id, "<", f"TPDO{i}") for i, cob_id in enumerate(COB_TPDO, start=1)),
    *((cob_id, ">", f"RPDO{i}") for i, cob_id in enumerate(COB_RPDO, start=1)),
    (COB_SDO_RESPONSE, "<", "SDO"),
    (COB_SDO_REQUEST, ">", "SDO"),
    (COB_HEARTBEAT, "<", "heartbeat"),
)
_SDO_COMMANDS: Final = {0x40: "read", 0x23: "write", 0x27: "write", 0x2B: "write", 0x2F: "write", 0x60: "written"}


def session() -> str:
    """Play the session; return it as one block."""
    board = _played()
    lines = [_line(counts, frame) for counts, frame in board.bus_log]
    return code("\n".join(lines))


def _played() -> EmbeddedBoard:
    whole = load_robot("teaching-scara")
    robot = replace(whole, joints=whole.joints[:1], home=whole.home[:1], outputs={}, places={})
    board = EmbeddedBoard(robot, [0.0], fastest_kernel())
    machine = Machine(board, robot.joint_names)
    machine.connect()
    machine.configure((_SETTINGS,))
    machine.enable()
    machine.preset([0])
    machine.run((_RECORDS,), [0], lambda _: None)
    machine.disable()
    machine.disconnect()
    return board


def _line(counts: int, frame: Frame) -> str:
    way, meaning = _meaning(frame)
    data = frame.data.hex(" ").upper()
    return f"{counts / COUNTS_PER_SECOND:9.6f} {way} {frame.cob_id:03X}  {data:<23}  {meaning}".rstrip()


def _meaning(frame: Frame) -> tuple[str, str]:
    if frame.cob_id == COB_NMT:
        return ">", f"NMT command {frame.data[0]} to {'all nodes' if frame.data[1] == 0 else hex(frame.data[1])}"
    if frame.cob_id == COB_SYNC:
        return ">", "SYNC"
    if frame.cob_id == COB_HEARTBEAT + HOST_NODE_ID:
        return ">", "heartbeat of the host"
    way, name = next((way, name) for base, way, name in _SERVICES if base + FIRST_NODE_ID == frame.cob_id)
    if name == "SDO":
        return way, _sdo(frame.data)
    details = {"RPDO2": _controlword, "RPDO4": _record, "TPDO1": _drive_status, "TPDO3": _pvt_status}
    return way, f"{name} {details[name](frame.data) if name in details else ''}"


def _sdo(data: bytes) -> str:
    index, subindex = int.from_bytes(data[1:3], "little"), data[3]
    command = _SDO_COMMANDS.get(data[0], "answer")
    value = int.from_bytes(data[4:8], "little", signed=True)
    entry = f"{index:04X}:{subindex:02X} {ENTRIES[od.address_of(index, subindex)].short_name}"
    return f"SDO {command} {entry} = {value}" if command in ("write", "answer") else f"SDO {command} {entry}"


def _controlword(data: bytes) -> str:
    return f"controlword 0x{int.from_bytes(data, 'little'):02X}, at the next SYNC"


def _record(data: bytes) -> str:
    displacement = int.from_bytes(data[0:3], "little", signed=True)
    velocity = int.from_bytes(data[3:6], "little", signed=True)
    return f"record {data[7]}: {displacement} units in {data[6]} ms, then {velocity}/64 units/ms"


def _drive_status(data: bytes) -> str:
    position = int.from_bytes(data[3:7], "little", signed=True)
    return f"statusword 0x{int.from_bytes(data[0:2], 'little'):04X}, mode {data[2]}, position {position}"


def _pvt_status(data: bytes) -> str:
    status = PvtStatus.decode(data)
    return f"next {status.next_sequence}, free {status.free}, flags {status.flags}"
