"""A program for SocketCAN that knows nothing of the preload: it tries the calls, and prints what has come of them."""

import errno
import json
import os
import select
import socket
import struct
import sys
from collections.abc import Callable
from typing import Any

CAN0, VCAN0 = "can0", "vcan0"
FRAME = struct.Struct("<IB3x8s")
STAMP = struct.Struct("@ll")
READ_1000 = (0x610, bytes.fromhex("4000100000000000"))
READ_1001 = (0x610, bytes.fromhex("4001100000000000"))
TIMEOUT_S = 5.0


def opened(name: str = CAN0, *filters: tuple[int, int]) -> socket.socket:
    """Open a socket that gets the answers of the node, or what the filters let pass."""
    can = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    packed = b"".join(struct.pack("<II", *each) for each in filters or ((0x590, 0x7FF),))
    can.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, packed)
    can.settimeout(TIMEOUT_S)
    can.bind((name,))
    return can


def packed(cob_id: int, data: bytes) -> bytes:
    return FRAME.pack(cob_id, len(data), data.ljust(8, b"\0"))


def ids(can: socket.socket, wait_s: float = 0.3) -> list[int]:
    """Return the identifiers that come while the socket is not silent for so long."""
    seen = []
    while select.select([can], [], [], wait_s)[0]:
        seen.append(FRAME.unpack(can.recv(16))[0])
    return seen


def failing(call: Callable[..., object], *arguments: Any) -> str:
    """Return the name of the error that a call ends with; empty without one."""
    try:
        call(*arguments)
    except OSError as error:
        return errno.errorcode[error.errno or 0]
    return ""


def with_stamps() -> dict[str, Any]:
    can = opened()
    can.setsockopt(socket.SOL_SOCKET, 35, 1)  # SO_TIMESTAMPNS
    can.send(packed(*READ_1000))
    data, control, flags, address = can.recvmsg(16, 64)
    seconds, ns = STAMP.unpack(control[0][2])
    return {"answer": data.hex(), "stamp_us": seconds * 1_000_000 + ns // 1000, "flags": flags, "from": address[0]}


def with_own() -> list[int]:
    can = opened(CAN0, (0x590, 0x7FF), (0x610, 0x7FF))
    can.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, 1)
    can.send(packed(*READ_1000))
    return [can.recvmsg(16)[2] for _ in range(2)]


def with_filters() -> list[list[int]]:
    inverse = 0x2000_0000
    all_but = opened(CAN0, (0x590 | inverse, 0x7FF))
    both = opened(VCAN0, (0x590, 0x7F0), (0x590 | inverse, 0x7FF))
    both.setsockopt(socket.SOL_CAN_RAW, 6, 1)  # CAN_RAW_JOIN_FILTERS
    silent = opened()
    silent.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"")
    sender = opened()
    sender.send(packed(*READ_1000))
    sender.send(packed(0x611, READ_1000[1]))
    return [sorted(set(ids(each))) for each in (all_but, both, silent, sender)]


def with_fork() -> list[str]:
    """Let a child answer whose parent's socket it is."""
    can = opened()
    can.setblocking(True)
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        can.send(packed(*READ_1001))
        os.write(writer, can.recv(16))
        os._exit(0)
    os.waitpid(child, 0)
    copy = os.dup(can.fileno())
    can.send(packed(*READ_1000))
    return [os.read(reader, 16).hex(), os.read(copy, 16).hex()]


def with_refusals() -> dict[str, str]:
    can = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    bound = opened()
    bound.setblocking(False)
    return {
        "unbound": failing(can.send, packed(*READ_1000)),
        "no such device": failing(can.bind, ("can9",)),
        "FD": failing(can.setsockopt, socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1),
        "FD off": failing(can.setsockopt, socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 0),
        "BCM": failing(socket.socket, socket.PF_CAN, socket.SOCK_DGRAM, socket.CAN_BCM),
        "short": failing(bound.send, b"123"),
        "nine bytes": failing(bound.send, FRAME.pack(1, 9, bytes(8))),
        "nothing there": failing(bound.recv, 16),
    }


def with_many() -> int:
    """Open and close more sockets than the library has places; return how many files that has left open."""
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(300):
        socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    for _ in range(20):
        opened().close()
    return len(os.listdir("/proc/self/fd")) - before


def main() -> None:
    found = {
        "names": [name for _, name in socket.if_nameindex() if "can" in name],
        "stamps": with_stamps(),
        "own": with_own(),
        "filters": with_filters(),
        "fork": with_fork(),
        "refusals": with_refusals(),
        "left open": with_many(),
    }
    sys.stdout.write(f"{json.dumps(found)}\n")


if __name__ == "__main__":
    main()
